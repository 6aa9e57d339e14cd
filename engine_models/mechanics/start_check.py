"""The start of a run: checked, as engines take any without a word, and with its whole turns put away."""

import math

import numpy as np

from engine_models.engine import FloatArray, ImpossibleStart, Trajectory
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.contact_law import damping_factor_of
from engine_models.mechanics.joints import directions, joint_gap, penetration_m
from engine_models.scene.scene import Scene

#: A pin may be in a wall by this many metres, and leave it by so many m/s for every m/s (and one more) at
#: which the bodies move.
START_TOLERANCE = 1e-9


def checked_start(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, each (bodies, 3).

    Angles are without whole turns, by twos, after which gas is the same: ``unwound`` gives them back. They
    only cost digits in an engine: at 1e6 rad an angle's are 1.2e-10 rad apart, while a turn taken as a double
    is off by 2e-16 rad, so that so many turns are off by no more than 4e-11 rad.

    Raises:
        ImpossibleStart: a pin is on its way out of a wall whose law takes its damping from the touch.
    """
    position, velocity = start_state(scene)
    _require_touches(scene, position, velocity)
    return position - _turns(position), velocity


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
