"""A scene's parts as the mechanism by names that engines build from: names become numbers and places."""

import math
from collections.abc import Iterator

import numpy as np

from engine_models.scene.format import Guide, Load, Place, Sections, Spring, period_of
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
    return _from_centre(scene, name, (scene.ground if name == "ground" else scene.body[name]).pins_m[pin])


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
    bodies = tuple(data.Body(body.mass_kg, body.inertia_kg_m2, name) for name, body in scene.body.items())
    guides = tuple(_guide(scene, name, guide) for name, guide in scene.guide.items())
    springs = tuple(_spring(scene, name, spring) for name, spring in scene.spring.items())
    loads = tuple(_load(scene, name, load, guides) for name, load in scene.load.items())
    drive = _drive(scene, bodies, guides)
    return data.MechanismData(bodies, (*_pins(scene),), guides, springs, loads, drive, scene.gravity)


def _end(scene: Sections, name: str, pin: str) -> tuple[int, Point]:
    return number_of(scene, name), point_of(scene, name, pin)


def _pins(scene: Sections) -> Iterator[data.Pin]:
    """Yield the joints: of each pin from the first that has it to each other, named PIN or PIN.BODY."""
    for pin, (first, *others) in pins_of(scene).items():
        for other in others:
            name, room = pin if len(others) == 1 else f"{pin}.{other}", scene.clearance.get(pin)
            ends = *_end(scene, first, pin), *_end(scene, other, pin)
            on_j = room is not None and room.bearing == other
            yield data.Pin(*ends, name, None if room is None else room.data(), on_j)


def _guide(scene: Sections, name: str, guide: Guide) -> data.Guide:
    through = number_of(scene, guide.on), _from_centre(scene, guide.on, guide.through_m)
    return data.Guide(*through, *_end(scene, guide.body, guide.pin), guide.angle_rad, name, guide.turns)


def _spring(scene: Sections, name: str, spring: Spring) -> data.Spring:
    i, j = (_end(scene, *end.split(".")) for end in spring.between)
    return data.Spring(*i, *j, spring.stiffness_N_m, spring.damping_N_s_m or 0.0, spring.free_length_m, name)


def _load(scene: Sections, name: str, load: Load, guides: tuple[data.Guide, ...]) -> data.Load:
    body, gas, line = number_of(scene, name), None, None
    if load.has_forces:  # along a guide of the body, or along a line through its centre of mass
        fixed = data.Line(GROUND, (0.0, 0.0), body, (0.0, 0.0), load.along_rad or 0.0)
        own = (guide for guide in guides if guide.body_j == body and load.guide in (None, guide.name))
        line = next(own, fixed)
    if load.gas is not None:
        by_angle = load.gas.table("angle_rad", "force_N", period_of(load.gas.angle_rad))
        gas = data.GasData(number_of(scene, load.gas.body or scene.drive.body or ""), by_angle)
    return data.Load(
        body,
        line,
        load.force_N or 0.0,
        load.viscous_N_s_m or 0.0,
        load.spring_N_m or 0.0,
        load.free_position_m or 0.0,
        gas,
        _by_time(load, "force_N"),
        load.torque_N_m or 0.0,
        load.viscous_N_m_s or 0.0,
        _by_time(load, "torque_N_m"),
    )


def _by_time(load: Load, column: str) -> data.Table | None:
    own = load.by_time
    return None if own is None or getattr(own, column) is None else own.table("time_s", column)


def _drive(scene: Sections, bodies: tuple[data.Body, ...], guides: tuple[data.Guide, ...]) -> data.DriveData:
    name, states = scene.driven, scene.start.states
    if scene.drive.guide is not None:
        number = [*scene.guide].index(name)
        body, told = guides[number].body_j, scene.start.speed_m_s.get(name)
        if told is None and states:
            told = _speed_along(scene, data.MechanismData(bodies, (), (guides[number],)))
    else:
        number, body, told = None, number_of(scene, name), scene.start.speed_rad_s.get(name)
        if told is None and name in states:
            told = states[name].angular_velocity_rad_s
    return data.DriveData(body, number, scene.drive.law(told or 0.0), scene.clock_s)


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
