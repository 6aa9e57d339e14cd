"""A scene's parts as the mechanism by names that engines build from: names become numbers and places."""

import math

import numpy as np

from engine_models.scene.format import ByTime, Load, Place, Sections, period_of
from reference_solver.mechanism import data
from reference_solver.mechanism.data import GROUND, Point
from reference_solver.tape import FloatArray


def pair(place: Place) -> Point:
    """Return a place as a pair: one number is on the x axis."""
    return place if isinstance(place, tuple) else (place, 0.0)


def number_of(scene: Sections, name: str) -> int:
    """Return the number of a body, or of the ground."""
    return GROUND if name == "ground" else [*scene.body].index(name)


def point_of(scene: Sections, name: str, pin: str) -> Point:
    """Return a pin of a body from its centre of mass, or of the ground from the origin."""
    if name == "ground":
        return pair(scene.ground.pins_m[pin])
    body = scene.body[name]
    return _from_centre(scene, name, body.pins_m[pin])


def _from_centre(scene: Sections, name: str, place: Place) -> Point:
    centre = pair(0.0 if name == "ground" else scene.body[name].centre_of_mass_m)
    x, y = pair(place)
    return x - centre[0], y - centre[1]


def pins_of(scene: Sections) -> dict[str, list[str]]:
    """Return the names of what has each pin: the ground first, then bodies in the order of the file."""
    where: dict[str, list[str]] = {}
    places = {"ground": scene.ground.pins_m} | {name: body.pins_m for name, body in scene.body.items()}
    for name, pins in places.items():
        for pin in pins:
            where.setdefault(pin, []).append(name)
    return where


def mechanism_data(scene: Sections) -> data.MechanismData:
    """Return the mechanism by names of a scene whose parts fit each other."""
    bodies = tuple(data.BodyData(name, body.mass_kg, body.inertia_kg_m2) for name, body in scene.body.items())
    guides = _guides(scene)
    return data.MechanismData(
        bodies,
        _pins(scene),
        guides,
        _springs(scene),
        tuple(_load(scene, name, load, guides) for name, load in scene.load.items()),
        _drive(scene, bodies, guides),
        scene.gravity,
    )


def _pins(scene: Sections) -> tuple[data.Pin, ...]:
    """Return the joints: of each pin from the first that has it to each other, named PIN or PIN.BODY."""
    found = []
    for pin, (first, *others) in pins_of(scene).items():
        for other in others:
            room = scene.clearance.get(pin)
            found.append(
                data.Pin(
                    pin if len(others) == 1 else f"{pin}.{other}",
                    number_of(scene, first),
                    point_of(scene, first, pin),
                    number_of(scene, other),
                    point_of(scene, other, pin),
                    None if room is None else room.data(),
                    room is not None and room.bearing == other,
                )
            )
    return tuple(found)


def _guides(scene: Sections) -> tuple[data.Guide, ...]:
    return tuple(
        data.Guide(
            number_of(scene, guide.on),
            _from_centre(scene, guide.on, guide.through_m),
            guide.angle_rad,
            number_of(scene, guide.body),
            point_of(scene, guide.body, guide.pin),
            name,
            guide.turns,
        )
        for name, guide in scene.guide.items()
    )


def _springs(scene: Sections) -> tuple[data.Spring, ...]:
    found = []
    for name, spring in scene.spring.items():
        (i, pin_i), (j, pin_j) = (end.split(".") for end in spring.between)
        ends = number_of(scene, i), point_of(scene, i, pin_i), number_of(scene, j), point_of(scene, j, pin_j)
        damping = spring.damping_N_s_m or 0.0
        found.append(data.Spring(name, *ends, spring.stiffness_N_m, spring.free_length_m, damping))
    return tuple(found)


def _load(scene: Sections, name: str, load: Load, guides: tuple[data.Guide, ...]) -> data.Load:
    body = number_of(scene, name)
    return data.Load(
        body,
        _line(load, body, guides) if load.has_forces else None,
        load.force_N or 0.0,
        load.viscous_N_s_m or 0.0,
        load.spring_N_m or 0.0,
        load.free_position_m or 0.0,
        _gas(scene, load),
        _by_time(load.by_time, "force_N"),
        load.torque_N_m or 0.0,
        load.viscous_N_m_s or 0.0,
        _by_time(load.by_time, "torque_N_m"),
    )


def _line(load: Load, body: int, guides: tuple[data.Guide, ...]) -> data.Line:
    """Return the line of a load's forces: a guide of the body, or one through its centre of mass."""
    for guide in guides:
        if guide.body_j == body and load.guide in (None, guide.name):
            return guide
    return data.Line(GROUND, (0.0, 0.0), load.along_rad or 0.0, body, (0.0, 0.0))


def _gas(scene: Sections, load: Load) -> data.GasData | None:
    gas = load.gas
    if gas is None:
        return None
    body = number_of(scene, gas.body or scene.drive.body or "")
    return data.GasData(body, gas.table("angle_rad", "force_N", period_of(gas.angle_rad)))


def _by_time(table: ByTime | None, column: str) -> data.Table | None:
    return None if table is None or getattr(table, column) is None else table.table("time_s", column)


def _drive(
    scene: Sections, bodies: tuple[data.BodyData, ...], guides: tuple[data.Guide, ...]
) -> data.DriveData:
    drive, name = scene.drive, scene.driven
    if drive.guide is not None:
        number = [*scene.guide].index(name)
        body, told = guides[number].body_j, scene.start.speed_m_s.get(name)
        if told is None and scene.start.states:
            told = _speed_along(scene, data.MechanismData(bodies, (), (guides[number],)))
    else:
        number, body, told = None, number_of(scene, name), scene.start.speed_rad_s.get(name)
        if told is None and name in scene.start.states:
            told = scene.start.states[name].angular_velocity_rad_s
    return data.DriveData(body, number, drive.law(told or 0.0), scene.clock_s)


def levers_m(of: data.MechanismData) -> list[float]:
    """Return the distances in m between points of each body at joints and guides, and its centre of mass."""
    points: dict[int, list[Point]] = {number: [(0.0, 0.0)] for number in range(len(of.bodies))}
    parts: list[data.Pin | data.Line] = [*of.pins, *of.guides]
    for part in parts:
        points.get(part.body_i, []).append(part.point_i)
        points.get(part.body_j, []).append(part.point_j)
    return [math.dist(a, b) for own in points.values() for a in own for b in own]


def state_of(scene: Sections) -> tuple[FloatArray, FloatArray]:
    """Return the given states of all bodies as coordinates and velocities, (n,) each."""
    states = np.array([[*scene.start.states[name].model_dump().values()] for name in scene.body])
    return states[:, :3].ravel(), states[:, 3:].ravel()


def _speed_along(scene: Sections, of: data.MechanismData) -> float:
    """Return the speed in m/s along the only guide of a mechanism in the given states."""
    from reference_solver.mechanism.assembly import Joints  # most scenes do without

    q, v = state_of(scene)
    return float(Joints(of).way_rows(q)[0] @ v)
