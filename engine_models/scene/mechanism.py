"""A scene's parts as the mechanism by names that engines build from: names become numbers and places."""

import math
from collections.abc import Iterator

import numpy as np

from engine_models.scene import format as form
from engine_models.scene.format import Guide, Load, Place, Sections, Spring
from reference_solver.mechanism import data
from reference_solver.mechanism.data import GROUND, Point
from reference_solver.tape import FloatArray


def number_of(scene: Sections, name: str) -> int:
    """Return the number of a body, or of the ground."""
    return GROUND if name == "ground" else [*scene.body].index(name)


def point_of(scene: Sections, name: str, pin: str) -> Point:
    """Return a pin of a body from its centre of mass, or of the ground from the origin."""
    return _from_centre(scene, name, (scene.ground if name == "ground" else scene.body[name]).pins_m[pin])


def _from_centre(scene: Sections, name: str, place: Place) -> Point:
    """Return a place of a body, or of the ground, from its centre of mass: one number is on its x axis."""
    centre = 0.0 if name == "ground" else scene.body[name].centre_of_mass_m
    (x, y), (x0, y0) = (each if isinstance(each, tuple) else (each, 0.0) for each in (place, centre))
    return x - x0, y - y0


def pins_of(scene: Sections) -> dict[str, list[str]]:
    """Return the names of what has each pin: the ground first, then bodies in the order of the file."""
    where: dict[str, list[str]] = {}
    places = {"ground": scene.ground.pins_m} | {name: body.pins_m for name, body in scene.body.items()}
    for name, pins in places.items():
        for pin in pins:
            where.setdefault(pin, []).append(name)
    return where


def markers_of(scene: Sections) -> dict[str, str]:
    """Return the pins of no joint, guide or spring, whose places are columns, and what has each."""
    used = {guide.pin for guide in scene.guide.values()}
    used |= {end.partition(".")[2] for spring in scene.spring.values() for end in spring.between}
    return {pin: names[0] for pin, names in pins_of(scene).items() if len(names) == 1 and pin not in used}


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
    return data.Spring(*i, *j, spring.stiffness_N_m, spring.damping_N_s_m, spring.free_length_m, name)


def _load(scene: Sections, name: str, load: Load, guides: tuple[data.Guide, ...]) -> data.Load:
    """Return a load: its forces act along a guide of the body, or along a line through its centre of mass."""
    body, fixed = number_of(scene, name), None
    if load.has_forces:
        fixed = data.Line(GROUND, (0.0, 0.0), body, (0.0, 0.0), load.along_rad or 0.0)
    own = (it for it in guides if fixed and it.body_j == body and load.guide in (None, it.name))
    gas, by_time = load.gas, load.by_time
    return data.Load(
        body,
        next(own, fixed),
        load.force_N or 0.0,
        load.viscous_N_s_m or 0.0,
        load.spring_N_m or 0.0,
        load.free_position_m or 0.0,
        None if gas is None else data.GasData(number_of(scene, gas.body or scene.driven), gas.by_angle),
        by_time.table("time_s", "force_N") if by_time and by_time.force_N else None,
        load.torque_N_m or 0.0,
        load.viscous_N_m_s or 0.0,
        by_time.table("time_s", "torque_N_m") if by_time and by_time.torque_N_m else None,
    )


def _drive(scene: Sections, bodies: tuple[data.Body, ...], guides: tuple[data.Guide, ...]) -> data.DriveData:
    """Return the drive; the speed at the start is that told of what is driven, or that of a given state."""
    name, start, guide = scene.driven, scene.start, None
    if scene.drive.guide is not None:
        guide = [*scene.guide].index(name)
        body, speed = guides[guide].body_j, start.speed_m_s.get(name)
        if speed is None and start.states:
            speed = _speed_along(scene, data.MechanismData(bodies, (), (guides[guide],)))
    else:
        body, speed = number_of(scene, name), start.speed_rad_s.get(name)
        if speed is None and start.states:
            speed = start.states[name].angular_velocity_rad_s
    return data.DriveData(body, guide, _law(scene.drive, speed or 0.0), start.time_s)


def _law(drive: form.Drive, speed: float) -> data.DriveLaw | None:
    """Return the law of a drive, whose start has a speed in rad/s or m/s."""
    match drive:
        case form.ConstantSpeedDrive():
            return data.ConstantSpeed(speed)
        case form.RampDrive():
            return data.Ramp(speed, getattr(drive, drive.fitting), drive.ramp_time_s)
        case form.FluctuatingDrive():
            return data.Fluctuation(speed, getattr(drive, drive.fitting), drive.frequency_Hz, drive.phase_rad)
        case form.TableDrive():
            return data.Course(drive.course)
        case form.TorqueDrive(torque_N_m=float(torque)):
            return data.Torque(torque)
        case form.TorqueDrive():
            return data.Torque(drive.table("time_s", "torque_N_m"))
        case form.MotorDrive(speed_rad_s=None):
            return data.Motor(drive.stall_torque_N_m or 0.0, drive.no_load_speed_rad_s or 0.0)
        case form.MotorDrive():
            return data.Motor(table=drive.table("speed_rad_s", "torque_N_m"))
    return None


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
