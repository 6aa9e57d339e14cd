"""The start of a run: checked, as engines take any without a word, and with its whole turns put away."""

import math

import numpy as np

from engine_models.engine import FloatArray, ImpossibleStart, Trajectory
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.contact_law import damping_factor_of
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.joints import CRANK, SLIDER, directions, joint_gap, penetration_m
from engine_models.scene.scene import Scene
from reference_solver.mechanism.assembly import NotAssembled, require_closed

#: An ideal joint may be open by this many metres at the start, and its sides drift apart by so many m/s for
#: every m/s (and one more) at which the bodies move.
START_TOLERANCE = 1e-9


def checked_start(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, each (bodies, 3).

    Angles are without whole turns, by twos, after which gas is the same: ``unwound`` gives them back. They
    only cost digits in an engine: at 1e6 rad an angle's are 1.2e-10 rad apart, while a turn taken as a double
    is off by 2e-16 rad, so that so many turns are off by no more than 4e-11 rad.

    Raises:
        ImpossibleStart: an ideal joint is open, a body off its guide, what is driven not at its speed, or a
            pin on its way out of a wall whose law takes its damping from the touch.
    """
    position, velocity = start_state(scene)
    if scene.is_plain:
        _require_closed(scene, position, velocity)
    else:
        try:
            require_closed(scene.mechanism, position.ravel(), velocity.ravel())
        except NotAssembled as reason:
            raise ImpossibleStart(f"start: {reason}") from None
    _require_touches(scene, position, velocity)
    return position - _turns(position), velocity


def _require_closed(scene: Scene, position: FloatArray, velocity: FloatArray) -> None:
    """Require closed joints, a slider on its guide and a driver at its speed of a plain crank-slider."""
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


def _turns(position: FloatArray) -> FloatArray:
    """Return the whole turns, by twos, in angles of positions (bodies, 3), in their shape."""
    turns = np.zeros_like(position)
    turns[:, 2] = [angle - math.remainder(angle, 4 * math.pi) for angle in position[:, 2].tolist()]
    return turns


def _require_touches(scene: Scene, position: FloatArray, velocity: FloatArray) -> None:
    """Require of pins that come out of their walls that no force depends on how fast they went in.

    With the default floor of that speed instead the damping is so large that the pin sticks, in ever so many
    steps; a floor that the scene states is taken at its word.
    """
    slow = START_TOLERANCE * (1 + np.abs(velocity).max())
    for joint, room in scene.clearances.items():
        if not damping_factor_of(room) or room.minimum_impact_speed_m_s is not None:
            continue
        gap = joint_gap(scene, joint, position[None], velocity[None])
        depth = float(penetration_m(room, gap.gap_m)[0])
        out = -float(np.sum(directions(gap.gap_m)[0] * gap.rate_m_s))
        if depth > START_TOLERANCE and out > slow:
            raise ImpossibleStart(
                f"start: expected pin {joint} within its clearance, or on its way into the wall, got it "
                f"{depth:.3g} m in the wall and leaving at {out:.3g} m/s: law {room.law} needs the speed of "
                "the touch, which was before; start it there or just before the wall, or state "
                f"clearance.{joint}.minimum_impact_speed_m_s"
            )


def unwound(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """Return a run from ``checked_start`` with the scene's own turns in the bodies' angles again."""
    trajectory.position[...] += _turns(start_state(scene)[0])
    return trajectory
