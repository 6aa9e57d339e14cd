"""The start of a run: checked, as engines take any without a word, and with its whole turns put away."""

import math

import numpy as np

from engine_models.engine import FloatArray, ImpossibleStart, Trajectory
from engine_models.guards import guarded
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.joints import CRANK, SLIDER, joint_gap
from engine_models.scene.scene import Scene

#: An ideal joint may be open by this many metres at the start, and its sides drift apart by so many m/s for
#: every m/s (and one more) at which the bodies move.
START_TOLERANCE = 1e-9


def checked_start(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, each (bodies, 3).

    Raises:
        ImpossibleStart: an ideal joint is open, the slider off its guide, or the crank not at its speed.
    """
    position, velocity = start_state(scene)
    if not guarded():
        return position, velocity
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
    if (motion := crank_motion(scene)) is not None:
        drift.append(abs(velocity[CRANK, 2] - motion.start_speed_rad_s))
    if not max(open_by, default=0.0) <= START_TOLERANCE:
        raise ImpossibleStart(f"start: ideal joints or guide are open by {max(open_by):.3g} m at t = 0 s")
    if not max(drift, default=0.0) <= START_TOLERANCE * (1 + np.abs(velocity).max()):
        raise ImpossibleStart(f"start: joints, guide or driver are off by {max(drift):.3g} m/s at t = 0 s")
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
