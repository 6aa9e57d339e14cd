"""Where the two sides of a joint are, and the start of a run, checked: engines take any without a word."""

import math
from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray, SimulationFailed, Trajectory
from engine_models.mechanics.assembly import start_state
from engine_models.scene.scene import Scene

CRANK, ROD, SLIDER = range(3)

#: An ideal joint may be open by this many metres at the start, and its sides drift apart by so many m/s for
#: every m/s (and one more) at which the bodies move.
START_TOLERANCE = 1e-9

#: A body, None for the ground, and a place on it along its axis from its centre of mass.
End = tuple[int | None, float]


@dataclass(frozen=True)
class JointGap:
    """``gap_m`` (n, 2) is from the bearing's centre to the pin's; spins (n,) are those of the two bodies."""

    gap_m: FloatArray
    rate_m_s: FloatArray
    pin_spin_rad_s: FloatArray
    bearing_spin_rad_s: FloatArray


def ends(scene: Scene) -> dict[str, tuple[End, End]]:
    """Return pin and bearing of every joint; the bearing is on the body nearer the crank pivot."""
    crank, rod = scene.crank, scene.rod
    s = crank.centre_of_mass_m
    found: dict[str, tuple[End, End]] = {"O": ((CRANK, -s), (None, 0.0))}
    if rod is not None:
        d = rod.centre_of_mass_m
        found["A"] = (ROD, -d), (CRANK, crank.length_m - s)
        found["B"] = (SLIDER, 0.0), (ROD, rod.length_m - d)
    return found


def joint_gap(scene: Scene, joint: str, position: FloatArray, velocity: FloatArray) -> JointGap:
    """Return a joint's gap in states (n, bodies, 3)."""
    (pin, pin_rate, pin_spin), (bearing, bearing_rate, bearing_spin) = (
        _point(end, position, velocity) for end in ends(scene)[joint]
    )
    return JointGap(pin - bearing, pin_rate - bearing_rate, pin_spin, bearing_spin)


def _point(end: End, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    body, place_m = end
    if body is None:
        nowhere = np.zeros((len(position), 2))
        return nowhere, nowhere, nowhere[:, 0]
    angle, spin = position[:, body, 2], velocity[:, body, 2]
    x, y = place_m * np.cos(angle), place_m * np.sin(angle)
    at = position[:, body, :2] + np.stack([x, y], axis=-1)
    return at, velocity[:, body, :2] + spin[:, None] * np.stack([-y, x], axis=-1), spin


def checked_start(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, each (bodies, 3).

    Raises:
        SimulationFailed: an ideal joint is open, the slider off its guide, or the crank not at its speed.
    """
    position, velocity = start_state(scene)
    gaps = [
        joint_gap(scene, joint, position[None], velocity[None])
        for joint in scene.joints
        if joint not in scene.joints_with_clearance
    ]
    open_by = [np.hypot(*gap.gap_m[0]) for gap in gaps]
    drift = [np.hypot(*gap.rate_m_s[0]) for gap in gaps]
    if scene.is_crank_slider:
        open_by.append(np.abs(position[SLIDER, 1:]).max())
        drift.append(np.abs(velocity[SLIDER, 1:]).max())
    if scene.drive.kind == "constant-speed":
        drift.append(abs(velocity[CRANK, 2] - scene.start.crank_speed_rad_s))
    if not max(open_by, default=0.0) <= START_TOLERANCE:
        raise SimulationFailed(f"start: ideal joints or guide are open by {max(open_by):.3g} m at t = 0 s")
    if not max(drift, default=0.0) <= START_TOLERANCE * (1 + np.abs(velocity).max()):
        raise SimulationFailed(f"start: joints, guide or driver are off by {max(drift):.3g} m/s at t = 0 s")
    return position, velocity


def wound(scene: Scene) -> Scene:
    """Return the scene with the crank's angle at the start within (-pi, pi].

    Whole turns only cost digits in an engine: at 1e6 rad an angle's are 1.2e-10 rad apart, while a turn taken
    as a double is off by 2e-16 rad, so that so many turns are off by no more than 4e-11 rad.
    """
    start = scene.start
    changed: dict[str, object] = {"crank_angle_rad": math.remainder(start.crank_angle_rad, 2 * math.pi)}
    if start.crank is not None:
        angle = math.remainder(start.crank.angle_rad, 2 * math.pi)
        changed["crank"] = start.crank.model_copy(update={"angle_rad": angle})
    return scene.model_copy(update={"start": start.model_copy(update=changed)})


def unwound(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """Return a run of ``wound(scene)`` with the scene's own turns in the crank's angle again."""
    start = scene.start
    angle = start.crank_angle_rad if start.crank is None else start.crank.angle_rad
    trajectory.position[:, CRANK, 2] += angle - math.remainder(angle, 2 * math.pi)
    return trajectory
