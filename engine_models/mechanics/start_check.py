"""The start of a run: checked, as engines take any without a word, and with its whole turns put away."""

import math
from typing import TypeVar

import numpy as np

from engine_models.engine import FloatArray, ImpossibleStart, Trajectory
from engine_models.guards import guarded
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.contact_law import damping_factor_of
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.joints import CRANK, SLIDER, clearances, directions, joint_gap, penetration_m
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from reference_solver.mechanism.assembly import NotAssembled, require_closed

T = TypeVar("T", bound=AnyScene)

#: An ideal joint may be open by this many metres at the start, and its sides drift apart by so many m/s for
#: every m/s (and one more) at which the bodies move.
START_TOLERANCE = 1e-9


def checked_start(scene: AnyScene) -> tuple[FloatArray, FloatArray]:
    """Return the positions and velocities at t = 0, each (bodies, 3).

    Angles of a scene in the general form are without whole turns, by twos (see ``unwound``).

    Raises:
        ImpossibleStart: an ideal joint is open, a body off its guide, what is driven not at its speed, or a
            pin on its way out of a wall whose law takes its damping from the touch.
    """
    position, velocity = start_state(scene)
    if not guarded():
        return position, velocity
    if scene.is_plain:
        assert isinstance(scene, Scene)
        _require_closed(scene, position, velocity)
    else:
        try:
            require_closed(scene.mechanism, position.ravel(), velocity.ravel())
        except NotAssembled as reason:
            raise ImpossibleStart(f"start: {reason}") from None
    _require_touches(scene, position, velocity)
    return position - _turns(scene, position), velocity


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


def _turns(scene: AnyScene, position: FloatArray) -> FloatArray:
    """Return the whole turns, by twos, in the angles of a scene in the general form, (bodies, 3)."""
    turns = np.zeros_like(position)
    if not isinstance(scene, Scene):
        turns[:, 2] = [angle - math.remainder(angle, 4 * math.pi) for angle in position[:, 2].tolist()]
    return turns


def _require_touches(scene: AnyScene, position: FloatArray, velocity: FloatArray) -> None:
    """Require of pins that come out of their walls that no force depends on how fast they went in.

    With the default floor of that speed instead the damping is so large that the pin sticks, in ever so many
    steps; a floor that the scene states is taken at its word.
    """
    slow = START_TOLERANCE * (1 + np.abs(velocity).max())
    for joint, room in clearances(scene).items():
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


def wound(scene: T) -> T:
    """Return the scene with the crank's angle at the start within (-pi, pi], or a period of its gas.

    Whole turns only cost digits in an engine: at 1e6 rad an angle's are 1.2e-10 rad apart, while a turn taken
    as a double is off by 2e-16 rad, so that so many turns are off by no more than 4e-11 rad. A scene in the
    general form stays as it is (see ``checked_start``).
    """
    if not isinstance(scene, Scene):
        return scene
    start, turn = scene.start, _period(scene)
    changed: dict[str, object] = {"crank_angle_rad": math.remainder(start.crank_angle_rad, turn)}
    if start.crank is None and changed["crank_angle_rad"] == start.crank_angle_rad:
        return scene
    if start.crank is not None:
        angle = math.remainder(start.crank.angle_rad, turn)
        changed["crank"] = start.crank.model_copy(update={"angle_rad": angle})
    return scene.model_copy(update={"start": start.model_copy(update=changed)})


def unwound(scene: AnyScene, trajectory: Trajectory) -> Trajectory:
    """Return a run of ``wound(scene)`` with the scene's own turns in the bodies' angles again."""
    if not isinstance(scene, Scene):
        trajectory.position[...] += _turns(scene, start_state(scene)[0])
        return trajectory
    start = scene.start
    angle = start.crank_angle_rad if start.crank is None else start.crank.angle_rad
    trajectory.position[:, CRANK, 2] += angle - math.remainder(angle, _period(scene))
    return trajectory


def _period(scene: Scene) -> float:
    """Return the angle after which a crank-slider is the same: one turn, or two of its gas."""
    load = scene.load.slider
    return 2 * math.pi if load is None or load.gas is None else load.gas.period_rad
