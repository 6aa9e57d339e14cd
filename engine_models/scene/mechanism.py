"""A scene's parts as the mechanism by names that engines build from: names become numbers and places."""

from collections.abc import Iterator
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from engine_models.scene import format as form
from reference_solver.mechanism import data
from reference_solver.mechanism.data import GROUND
from reference_solver.tape import FloatArray

if TYPE_CHECKING:
    from engine_models.scene.scene import Scene

Kind = TypeVar("Kind")


def as_data(kind: type[Kind], part: object, **others: Any) -> Kind:
    """Return a dataclass with those fields of a part that have its fields' names and a value, and others."""
    own = {field.name: getattr(part, field.name, None) for field in fields(kind)}  # type: ignore[arg-type]
    return kind(**{name: value for name, value in own.items() if value is not None} | others)


def mechanism_data(scene: "Scene") -> data.MechanismData:
    """Return the mechanism by names of a scene whose parts fit each other."""
    guides = tuple(
        as_data(data.Guide, it, name=name, **_ends(scene, (it.on, it.through_m), (it.body, it.pin)))
        for name, it in scene.guide.items()
    )
    springs = tuple(
        as_data(data.Spring, it, name=name, **_ends(scene, *(end.split(".") for end in it.between)))
        for name, it in scene.spring.items()
    )
    return data.MechanismData(
        tuple(as_data(data.Body, it, name=name) for name, it in scene.body.items()),
        tuple(_pins(scene)),
        guides,
        springs,
        tuple(_load(scene, name, it, guides) for name, it in scene.load.items()),
        _drive(scene, guides),
        scene.gravity,
    )


def _ends(scene: "Scene", i: Any, j: Any) -> dict[str, Any]:
    """Return the fields of ``data.Ends`` between two places or pins of bodies, each (body, place)."""
    numbers = {"body_i": scene.number(i[0]), "body_j": scene.number(j[0])}
    return numbers | {"point_i": scene.point(*i), "point_j": scene.point(*j)}


def _pins(scene: "Scene") -> Iterator[data.Pin]:
    """Yield the joints: of each pin from the first that has it to each other, named PIN or PIN.BODY."""
    for pin, (first, *others) in scene.pins.items():
        room = scene.clearance.get(pin)
        for other in others:
            name, ends = (
                pin if len(others) == 1 else f"{pin}.{other}",
                _ends(scene, (first, pin), (other, pin)),
            )
            on_j = room is not None and room.bearing == other
            yield data.Pin(**ends, name=name, clearance=_clearance(room) if room else None, bearing_on_j=on_j)


def _clearance(room: form.Clearance) -> data.ClearanceData:
    friction = room.friction and as_data(data.FrictionLaw, room.friction)
    return as_data(data.ClearanceData, room, friction=friction)


def _load(scene: "Scene", name: str, load: form.Load, guides: tuple[data.Guide, ...]) -> data.Load:
    """Return a load: its forces act along a guide of the body, or along a line through its centre of mass."""
    body, line, gas, by_time = scene.number(name), None, load.gas, load.by_time
    if load.has_forces:
        fixed = data.Line(GROUND, (0.0, 0.0), body, (0.0, 0.0), load.along_rad or 0.0)
        line = next((it for it in guides if it.body_j == body and load.guide in (None, it.name)), fixed)
    tables = {
        f"{column.partition('_')[0]}_by_time": by_time.table("time_s", column)
        for column in ("force_N", "torque_N_m")
        if by_time and getattr(by_time, column)
    }
    of_gas = gas and data.GasData(scene.number(gas.body or scene.driven), gas.by_angle)
    return as_data(data.Load, load, body=body, line=line, gas=of_gas, **tables)


def _drive(scene: "Scene", guides: tuple[data.Guide, ...]) -> data.DriveData:
    """Return the drive; the speed at the start is that told of what is driven, or that of a given state."""
    name, start, guide = scene.driven, scene.start, None
    if scene.drive.guide is None:
        body, speed = scene.number(name), start.speed_rad_s.get(name)
        if speed is None and start.states:
            speed = start.states[name].angular_velocity_rad_s
    else:
        guide = [*scene.guide].index(name)
        body, speed = guides[guide].body_j, start.speed_m_s.get(name)
        if speed is None and start.states:
            speed = _speed_along(scene, guides[guide])
    return data.DriveData(body, guide, _law(scene.drive, speed or 0.0), start.time_s)


def _law(drive: form.Drive, speed: float) -> data.DriveLaw | None:
    """Return the law of a drive, whose start has a speed in rad/s or m/s."""
    match drive:
        case form.ConstantSpeedDrive():
            return data.ConstantSpeed(speed)
        case form.RampDrive():
            return data.Ramp(speed, getattr(drive, drive.fitting), drive.ramp_time_s)
        case form.FluctuatingDrive():
            return as_data(data.Fluctuation, drive, mean=speed, amplitude=getattr(drive, drive.fitting))
        case form.TableDrive():
            return data.Course(drive.course)
        case form.TorqueDrive():
            constant = drive.torque_N_m
            return data.Torque(drive.table(*drive.COLUMNS) if isinstance(constant, tuple) else constant)
        case form.MotorDrive():
            return as_data(
                data.Motor, drive, table=drive.table(*drive.COLUMNS) if drive.speed_rad_s else None
            )
    return None


def state_of(scene: "Scene") -> tuple[FloatArray, FloatArray]:
    """Return the given states of all bodies as coordinates and velocities, (n,) each."""
    states = np.array([[*scene.start.states[name].model_dump().values()] for name in scene.body])
    return states[:, :3].ravel(), states[:, 3:].ravel()


def _speed_along(scene: "Scene", guide: data.Guide) -> float:
    """Return the speed in m/s along a guide in the given states."""
    from reference_solver.mechanism.assembly import Joints  # most scenes do without

    bodies = tuple(as_data(data.Body, it) for it in scene.body.values())
    q, v = state_of(scene)
    return float(Joints(data.MechanismData(bodies, (), (guide,))).way_rows(q)[0] @ v)
