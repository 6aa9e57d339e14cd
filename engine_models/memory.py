"""What a run will need of memory, known before it starts, and refused where there is not as much."""

from pathlib import Path

from engine_models.engine import RunSettings, UnsupportedScene
from engine_models.scene.scene import Scene

#: Measured with two contacts: of a sample all engines keep up to 2.1 kB, its row in a table included.
BYTES_PER_SAMPLE, BYTES_PER_CONTACT = 1_000, 750
#: What there is to a run where the machine does not tell what is free.
UNTOLD_BYTES = 4 * 10**9


class TooLarge(UnsupportedScene):
    """A run would need more memory than there is; ``option`` of its settings decides how much it needs."""

    def __init__(self, option: str, expected: str, value: float) -> None:
        self.option = option
        super().__init__(f"{option}: expected {expected}, got {value:g}")


def require_memory(
    scene: Scene, settings: RunSettings, recorded_steps: int = 0, bytes_per_step: int = 0
) -> None:
    """Check that what a run leaves behind fits into the memory that is free.

    Of samples that is their states, of ``recorded_steps`` what an engine keeps of each that it takes.

    Raises:
        TooLarge: it does not.
    """
    samples = (settings.samples + 1) * (
        BYTES_PER_SAMPLE + BYTES_PER_CONTACT * len(scene.joints_with_clearance)
    )
    steps, free = recorded_steps * bytes_per_step, free_bytes()
    if samples + steps <= free:
        return
    need = f"(needs {(samples + steps) / 1e9:.3g} GB of memory, {free / 1e9:.3g} GB are free)"
    if steps > samples:
        longer = settings.step_used_s(scene.end_time_s) * steps / max(free - samples, 1)
        raise TooLarge("step", f"at least {longer:.3g} s {need}", settings.step_s)
    raise TooLarge(
        "samples", f"at most {settings.samples * free / (samples + steps):.3g} {need}", settings.samples
    )


def free_bytes() -> int:
    """Return how much memory the machine has free, but no more than this process's group may have."""
    free = UNTOLD_BYTES
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
        # Not less what the group uses: that counts cached files, which make room.
        return min(free, int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    except (OSError, ValueError, StopIteration):  # another system, or no limit
        return free
