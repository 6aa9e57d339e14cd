"""The start of a run: where bodies are, and how fast; checked, and without its whole turns."""

import numpy as np

from engine_models.engine import FloatArray, ImpossibleStart, Trajectory
from engine_models.mechanics.states import pin_gap, turns_of
from engine_models.scene.scene import Scene, held_at_start
from reference_solver.mechanism.contacts import damping_factor_of

#: A pin is in its wall that is by so many metres, and leaves it at so many m/s for every m/s, and one more,
#: at which the bodies move.
START_TOLERANCE = 1e-9


def start_state(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, (bodies, 3) each: those given, or the assembly's."""
    return np.array(scene.placed.q).reshape(-1, 3), np.array(scene.placed.v).reshape(-1, 3)


def start_angle(scene: Scene) -> tuple[str, float]:
    """Return the path of the field that tells the turning body's angle at the start, and the angle in rad.

    Raises:
        ValueError: the start tells no such angle, or does not hold it.
    """
    if scene.turning_body is None:
        raise ValueError("expected a turning body, got none")
    name = scene.mechanism.names[scene.turning_body]
    path = "start.crank_angle_rad" if scene.is_short else f"start.angle_rad.{name}"
    if name not in scene.start.angle_rad or name not in held_at_start(scene):
        raise ValueError(f"expected a start that tells {path} and holds it, got another")
    return path, scene.start.angle_rad[name]


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
    return position - _turns(scene, position), velocity


def _turns(scene: Scene, position: FloatArray) -> FloatArray:
    """Return the whole turns, by twos, in angles of positions (bodies, 3), in their shape."""
    turns = np.zeros_like(position)
    turns[:, 2] = turns_of(scene.mechanism, position[:, 2])
    return turns


def _require_touches(scene: Scene, position: FloatArray, velocity: FloatArray) -> None:
    """Require of pins that come out of their walls that no force depends on how fast they went in.

    With the default floor of that speed instead the damping is so large that the pin sticks, in ever so many
    steps; a floor that the scene states is taken at its word.
    """
    slow = START_TOLERANCE * (1 + np.abs(velocity).max())
    for pin in scene.mechanism.loose:
        joint, room = pin.name, scene.clearances[pin.name]
        if not damping_factor_of(room) or room.minimum_impact_speed_m_s is not None:
            continue
        between = pin_gap(pin, position[None], velocity[None])
        gap, rate = between.gap_m[0], between.rate_m_s[0]
        distance = float(np.hypot(*gap))
        depth, out = distance - room.radial_clearance_m, -float(gap @ rate) / max(distance, 1e-300)
        if depth > START_TOLERANCE and out > slow:
            raise ImpossibleStart(
                f"start: expected pin {joint} within its clearance, or on its way into the wall, got it "
                f"{depth:.3g} m in the wall and leaving at {out:.3g} m/s: law {room.law} needs the speed of "
                "the touch, which was before; start it there or just before the wall, or state "
                f"clearance.{joint}.minimum_impact_speed_m_s"
            )


def unwound(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """Return a run from ``checked_start`` with the scene's own turns in the bodies' angles again."""
    trajectory.position[...] += _turns(scene, start_state(scene)[0])
    return trajectory
