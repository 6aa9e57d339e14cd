"""What watches a run: the memory that it needs, its pace, and whoever asked how far it has come.

Engines tell now and then, never more often than once for a sample or for some thousands of steps. One that
never tells is as good an engine.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.scene.scene import Scene

#: Measured with two contacts: of a sample all engines keep up to 2.1 kB, its row in a table included.
BYTES_PER_SAMPLE, BYTES_PER_CONTACT = 1_000, 750
#: What there is to a run where the machine does not tell what is free.
UNTOLD_BYTES = 4 * 10**9
#: A run that needs more steps than this would take hours or more.
MOST_STEPS = 1e10
#: Steps of a ramp, or of a period of a fluctuation, below which what an engine says of it is nonsense.
FEWEST_STEPS = 4
#: Takes the time in s that a run has reached. What it raises ends the run.
Listener = Callable[[float], None]

_LISTENER: ContextVar[Listener | None] = ContextVar("listener", default=None)


def require_memory(
    scene: Scene, settings: RunSettings, recorded_steps: int = 0, bytes_per_step: int = 0
) -> None:
    """Check that the states of samples, and what an engine keeps of ``recorded_steps``, fit into the memory.

    Raises:
        UnsupportedScene: they do not.
    """
    per_sample = BYTES_PER_SAMPLE + BYTES_PER_CONTACT * len(scene.clearances)
    samples, steps = (settings.samples + 1) * per_sample, recorded_steps * bytes_per_step
    free, need = free_bytes(), samples + steps
    if need > free:
        used = settings.step_used_s(scene.end_time_s) * steps / max(free - samples, 1)
        longer = f"step: expected at least {used:.3g}, got {settings.step_s:g}"
        fewer = f"samples: expected at most {settings.samples * free / need:.3g}, got {settings.samples}"
        told = f"(needs {need / 1e9:.3g} GB of memory, {free / 1e9:.3g} GB are free)"
        raise UnsupportedScene(f"{longer if steps > samples else fewer} {told}")


def free_bytes() -> int:
    """Return how much memory the machine has free, but no more than this process's group may have."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
        limit = Path("/sys/fs/cgroup/memory.max")  # not less what the group uses: cached files make room
        most = limit.read_text(encoding="ascii").strip() if limit.exists() else "max"
        return free if most == "max" else min(free, int(most))
    except (OSError, StopIteration):  # another system
        return UNTOLD_BYTES


class Pace:
    """Judges every so many steps, enough to outlast any one contact, whether a run comes to its end."""

    def __init__(self, scene: Scene, outlasting: int, most_steps: float = MOST_STEPS) -> None:
        self._end_s, self._outlasting, self._most_steps = scene.end_time_s, outlasting, most_steps
        self._judged, self._judged_s = 0, 0.0

    def judge(self, reached_s: float, steps: int) -> None:
        """Judge the time passed since the last time by the steps done since then, if they are enough.

        Raises:
            SimulationFailed: at this pace the run would need more than ``most_steps``.
        """
        passed_s, since = max(reached_s - self._judged_s, 0.0), steps - self._judged
        if since < self._outlasting:
            return
        if passed_s * self._most_steps < since * self._end_s:
            raise too_slow(passed_s / since, f" at t = {reached_s:.6g} s")
        self._judged, self._judged_s = steps, reached_s


def too_slow(step_s: float, when: str = "") -> SimulationFailed:
    """Return the failure of a run whose steps are too short to come to its end."""
    advice = "take a longer step or a looser tolerance, or softer and wider contacts"
    return SimulationFailed(f"steps of {step_s:.3g} s{when} do not come to the end of the run: {advice}")


def quickest_s(scene: Scene) -> float:
    """Return how long a ramp or a period of a fluctuation takes in s, infinite without one."""
    drive = scene.drive
    period_s = 1.0 / drive.frequency_Hz if drive.frequency_Hz else math.inf
    return drive.ramp_time_s or period_s


def require_followed(scene: Scene, step_s: float) -> None:
    """Refuse a run whose steps of one length are too long for what the driver does.

    Raises:
        SimulationFailed: a ramp, or a period of a fluctuation, has fewer than ``FEWEST_STEPS`` of them.
    """
    if quickest_s(scene) < FEWEST_STEPS * step_s:
        field = "ramp_time_s" if scene.drive.kind == "ramp" else "frequency_Hz"
        raise SimulationFailed(
            f"drive.{field}: expected at least {FEWEST_STEPS} steps in {quickest_s(scene):.3g} s, "
            f"got steps of {step_s:.3g} s: shorten the step"
        )


@contextmanager
def told_to(listener: Listener) -> Iterator[None]:
    """Have the runs in this block tell a listener."""
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def listener() -> Listener | None:
    """Return whom the present run is to tell, if anybody."""
    return _LISTENER.get()


def tell(time_s: float) -> None:
    """Tell the listener, if there is one."""
    if (listening := listener()) is not None:
        listening(time_s)
