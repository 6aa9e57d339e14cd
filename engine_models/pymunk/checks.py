"""Whether a run of Pymunk is still that of the scene's mechanism."""

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.pymunk.forces import gaps
from engine_models.scene.scene import Scene

#: With a joint this many crank lengths apart the bodies are no mechanism any more, and the run has failed.
LOST_GAP = 0.1


def require_the_mechanism(scene: Scene, position: FloatArray, time_s: FloatArray) -> None:
    """Check that the positions at the times, (n, bodies, 3) at (n,), are still the scene's mechanism.

    Raises:
        SimulationFailed: at the first time when an ideal joint is too far apart or not finite, or a pin is
            through the wall of its bearing, or when the rod has gone over the vertical, which one that is
            longer than the crank and the clearances never does.
    """
    gap = {name: np.hypot(d[:, 0], d[:, 1]) for name, d in gaps(scene, position).items()}
    failures: list[tuple[int, str]] = []

    def note(holds: NDArray[np.bool_], what: str) -> None:
        if not holds.all():
            failures.append((int(np.argmin(holds)), what))

    nothing = np.zeros(len(position))
    ideal = [nothing, *(gap[name] for name in scene.joints if name not in scene.joints_with_clearance)]
    room = 0.0
    for name in scene.joints_with_clearance:
        clearance = getattr(scene.clearance, name)
        room += clearance.radial_clearance_m
        note(gap[name] <= clearance.bearing_radius_m, f"pin through the wall of its bearing at joint {name}")
    if scene.is_crank_slider:
        ideal.append(np.abs(position[:, 2, 1]))
        crank, rod, _ = scene.crank_slider()
        if rod.length_m >= crank.length_m + room:
            note(~(np.cos(position[:, 1, 2]) <= 0), "rod turned over")
    apart = np.max(ideal, axis=0)
    note(apart <= LOST_GAP * scene.crank.length_m, "constraints lost, a joint is {gap:.3g} m apart,")
    if failures:
        first, what = min(failures)
        raise SimulationFailed(f"{what.format(gap=apart[first])} at t = {time_s[first]:.6g} s")
