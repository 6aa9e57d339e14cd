"""The start of a scene: as given, by the closed form of a crank-slider, or put together."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from engine_models.scene.format import require
from engine_models.scene.mechanism import state_of
from engine_models.scene.short import CrankSlider
from reference_solver.mechanism.data import Course, Motion
from reference_solver.mechanism.loads import distance_m
from reference_solver.mechanism.motions import curve_of, going_on, moved
from reference_solver.tape import FloatArray

if TYPE_CHECKING:
    from engine_models.scene.scene import Scene
    from reference_solver.mechanism import assembly

#: What moves by less has not moved.
ROUND_OFF = 1e-12
#: A scene that a table drives begins at another speed than the table's by this part of the fastest in it: a
#: coarse table is not differentiated more sharply, other units are far off.
ALIKE = 0.1


class Placed(NamedTuple):
    """A start: q and v, (3b,) each; what was moved to put it together, in words, None if it was not."""

    q: tuple[float, ...]
    v: tuple[float, ...]
    moved: str | None = None


def placed(scene: "Scene", short: CrankSlider | None) -> Placed:
    """Return the start of a scene whose parts fit each other, and that may be spelt short.

    Raises:
        ValueError: there is no such start.
    """
    from reference_solver.mechanism.assembly import NotAssembled, assemble, require_closed  # most do without

    of, words, told = scene.mechanism, None, _told(scene)
    try:
        if scene.start.states:
            q, v = state_of(scene)
            require_closed(of, q, v)
        elif short is not None and short.guide == (0.0, 0.0) and not told.speed_m_s:
            q, v = assembled(short, short.start.crank_angle_rad, told.speed_rad_s.get(0, 0.0))
        else:
            start, what = assemble(of, told), "guide" if scene.drive.guide else "body"
            moves = scene.drive.kind == "free" or start.drive_moves
            require(moves, f"drive.{what}", f"a {what} that joints let move at the start", scene.driven)
            q, v, told_ways = start.q, start.v, [name in scene.start.position_m for name in scene.guide]
            changes = [(f"{name} turned by", "rad") for name in scene.body]
            changes += [(f"{name} moved along by", "m") for name in scene.guide]
            sizes = np.abs([*start.turned_rad, *start.moved_m * told_ways])
            by = [
                f"{what} {x:.3g} {unit}"
                for (what, unit), x in zip(changes, sizes, strict=True)
                if x > ROUND_OFF
            ]
            words = ", ".join(by) or "nothing moved"
    except NotAssembled as reason:
        raise ValueError(_refused(scene, str(reason))) from None
    for spring in of.springs:
        has_length = spring.free_length_m > 0 or spring.damping_N_s_m > 0
        apart = not has_length or distance_m(spring, q.reshape(1, -1))[0] > ROUND_OFF * spring.free_length_m
        expected = "ends that are apart at the start (else its force has no direction)"
        require(bool(apart), f"spring.{spring.name}.between", expected, "both at one place")
    return Placed(tuple(q.ravel().tolist()), tuple(v.ravel().tolist()), words)


def assembled(short: CrankSlider, angle_rad: float, speed_rad_s: float) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities, each (3, 3), of a crank-slider whose guide is on the x axis.

    They are those of crank, rod and slider by (x, y, phi) of the centre of mass, at a crank angle and speed;
    of a pendulum (1, 3). The rod is on the side of its acute angle: the slider lies to the right of pin A.
    """
    crank, theta, omega = short.crank, angle_rad, speed_rad_s
    state = np.zeros((2, 1 if short.rod is None else 3, 3))
    state[:, 0, :2] = along_axis(crank.centre_of_mass_m, theta, omega)
    state[:, 0, 2] = theta, omega
    if (rod := short.rod) is not None:
        r, length = crank.length_m, rod.length_m
        phi = np.arcsin(-r / length * np.sin(theta))
        phi_rate = -r * np.cos(theta) / (length * np.cos(phi)) * omega
        pin = along_axis(r, theta, omega)
        state[:, 1, :2] = pin + along_axis(rod.centre_of_mass_m, phi, phi_rate)
        state[:, 1, 2] = phi, phi_rate
        state[:, 2, 0] = (pin + along_axis(length, phi, phi_rate))[:, 0]
    return state[0], state[1]


def along_axis(distance_m: float, angle_rad: float, rate_rad_s: float) -> FloatArray:
    """Return the vector of a distance along a turning axis, and its derivative, (2, 2)."""
    x, y = np.cos(angle_rad), np.sin(angle_rad)
    return np.array(
        [[distance_m * x, distance_m * y], [-distance_m * rate_rad_s * y, distance_m * rate_rad_s * x]]
    )


def _refused(scene: "Scene", reason: str) -> str:
    """Return why there is no such start, with the entry that tells what does not hold."""
    start, expected = scene.start, reason.partition(", got")[0]
    if "speeds" not in expected or start.states:
        return f"start.hold: {reason}" if "held" in expected and start.hold else f"start: {reason}"
    drives = scene.speed_is_prescribed and scene.driven not in {**start.speed_rad_s, **start.speed_m_s}
    also = f" (that of {scene.driven}, by the drive, among them)" if drives else ""
    key = "speed_m_s" if start.speed_m_s and not start.speed_rad_s else "speed_rad_s"
    return f"start.{key}: {reason}{also}"


def _told(scene: "Scene") -> "assembly.Told":
    """Return what the file tells of the start, by numbers, with the speed of what is driven."""
    from reference_solver.mechanism.assembly import Told

    start, drive, held = scene.start, scene.mechanism.drive, held_at_start(scene)
    bodies = {name: number for number, name in enumerate(scene.body)}
    guides = {name: number for number, name in enumerate(scene.guide)}
    angles = {bodies[name]: angle for name, angle in start.angle_rad.items()}
    ways = {guides[name]: way for name, way in start.position_m.items()}
    speeds = {bodies[name]: speed for name, speed in start.speed_rad_s.items()}
    along = {guides[name]: speed for name, speed in start.speed_m_s.items()}
    if isinstance(drive.law, Motion):
        driven, number = (speeds, drive.body) if drive.guide is None else (along, drive.guide)
        speed = float(moved(going_on(drive.law, drive.clock_s), 0.0)[1])
        if isinstance(drive.law, Course) and number in driven:
            rates = curve_of(drive.law.table).derivative()(drive.law.table.x)
            alike = abs(driven[number] - speed) <= ALIKE * max(map(abs, rates))
            field = f"start.speed_{'rad_s' if drive.guide is None else 'm_s'}.{scene.driven}"
            expected = f"the speed of the drive's table when the scene begins, {speed:.4g}"
            require(alike, field, expected, driven[number])
        if speed or speeds or along:
            driven[number] = speed
    held_bodies = tuple(bodies[name] for name in held if name in bodies)
    held_guides = tuple(guides[name] for name in held if name in guides)
    return Told(angles, ways, held_bodies, held_guides, speeds, along)


def held_at_start(scene: "Scene") -> tuple[str, ...]:
    """Return the bodies and guides whose values are held.

    Unless ``hold`` names them, it is what is driven, else the first body or guide told.
    """
    if scene.start.hold or scene.drive.kind != "free":
        return scene.start.hold or (scene.driven,)
    told = [name for name in scene.body if name in scene.start.angle_rad]
    return (*told, *scene.start.position_m)[:1]
