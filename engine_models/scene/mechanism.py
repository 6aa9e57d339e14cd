"""A scene's parts as the mechanism by names that engines build from: names become numbers and places."""

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
    """Return the mechanism by names of a scene whose parts fit each other.

    A pin is a joint from the first part that has it to each other, named PIN or, of three or more, PIN.BODY.
    """
    rooms = {pin: scene.clearance[pin].data() if pin in scene.clearance else None for pin in scene.pins}
    pins = tuple(
        data.Pin(
            **_ends(scene, (first, pin), (other, pin)),
            name=pin if len(others) == 1 else f"{pin}.{other}",
            clearance=rooms[pin],
            bearing_on_j=pin in scene.clearance and scene.clearance[pin].bearing == other,
        )
        for pin, (first, *others) in scene.pins.items()
        for other in others
    )
    guides = tuple(
        as_data(data.Guide, it, name=name, **_ends(scene, (it.on, it.through_m), (it.body, it.pin)))
        for name, it in scene.guide.items()
    )
    springs = tuple(
        as_data(data.Spring, it, name=name, **_ends(scene, *(end.split(".") for end in it.between)))
        for name, it in scene.spring.items()
    )
    bodies = tuple(as_data(data.Body, it, name=name) for name, it in scene.body.items())
    loads = tuple(_load(scene, name, it, guides) for name, it in scene.load.items())
    gravity = scene.gravity_m_s2 if isinstance(scene.gravity_m_s2, tuple) else (0.0, -scene.gravity_m_s2)
    drive = _drive(scene, bodies, guides)
    return data.MechanismData(bodies, pins, guides, springs, loads, drive, gravity)


def _ends(scene: "Scene", i: Any, j: Any) -> dict[str, Any]:
    """Return the fields of ``data.Ends`` between two places or pins of bodies, each (body, place)."""
    numbers = {"body_i": scene.number(i[0]), "body_j": scene.number(j[0])}
    return numbers | {"point_i": scene.point(*i), "point_j": scene.point(*j)}


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


def _drive(scene: "Scene", bodies: tuple[data.Body, ...], guides: tuple[data.Guide, ...]) -> data.DriveData:
    """Return the drive; the speed at the start is that told of what is driven, or that of a given state."""
    from reference_solver.mechanism.assembly import Joints  # most scenes do without

    drive, start, name, number = scene.drive, scene.start, scene.driven, None
    if drive.guide is None:
        body, speed = scene.number(name), start.speed_rad_s.get(name)
        if speed is None and start.states:
            speed = start.states[name].angular_velocity_rad_s
    else:
        number = [*scene.guide].index(name)
        body, speed = guides[number].body_j, start.speed_m_s.get(name)
        if speed is None and start.states:
            q, v = state_of(scene)
            speed = float(Joints(data.MechanismData(bodies, (), guides)).way_rows(q)[number] @ v)
    speed = speed or 0.0
    law: data.DriveLaw | None = None
    match drive.kind:
        case "constant-speed":
            law = data.ConstantSpeed(speed)
        case "ramp":
            last = drive.final_speed_rad_s if number is None else drive.final_speed_m_s
            law = as_data(data.Ramp, drive, first=speed, last=last, duration_s=drive.ramp_time_s)
        case "fluctuating":
            amplitude = drive.amplitude_rad_s if number is None else drive.amplitude_m_s
            law = as_data(data.Fluctuation, drive, mean=speed, amplitude=amplitude)
        case "table":
            law = data.Course(drive.course)
        case "torque":
            by_time = {"torque_N_m": drive.table("time_s", "torque_N_m")} if drive.time_s else {}
            law = as_data(data.Torque, drive, **by_time)
        case "motor":
            table = drive.table("speed_rad_s", "torque_N_m") if drive.speed_rad_s else None
            law = as_data(data.Motor, drive, table=table)
    return data.DriveData(body, number, law, start.time_s)


def state_of(scene: "Scene") -> tuple[FloatArray, FloatArray]:
    """Return the given states of all bodies as coordinates and velocities, (n,) each."""
    states = np.array([[*scene.start.states[name].model_dump().values()] for name in scene.body])
    return states[:, :3].ravel(), states[:, 3:].ravel()
