"""The end of runs that would take for ever."""

import math

from engine_models.engine import SimulationFailed
from engine_models.scene.scene import Scene

#: A run that needs more steps than this would take hours or more.
MOST_STEPS = 1e10
#: Steps of a ramp, or of a period of a fluctuation, below which what an engine says of it is nonsense.
FEWEST_STEPS = 4


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
