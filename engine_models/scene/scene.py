"""A scene: one planar mechanism in motion, from its start to its end, as frozen data that fits together.

It is checked by its names, resolved to the mechanism that engines build from, and put together at its start.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
import tomli_w
from pydantic import ConfigDict, Field, PrivateAttr, ValidationInfo, model_validator

from engine_models.scene import format as form
from engine_models.scene.arguments import check_arguments
from engine_models.scene.format import Named, Place, SceneError, require
from engine_models.scene.plain_words import expect, one_of, unknown
from engine_models.scene.short import OF_GENERAL, CrankSlider, assembled, in_short
from reference_solver.mechanism import data
from reference_solver.mechanism.assembly import Joints, Quantity, Told, assemble, require_closed
from reference_solver.mechanism.data import GROUND, Course, Motion, Point
from reference_solver.mechanism.loads import distance_m
from reference_solver.mechanism.motions import curve_of, going_on, moved
from reference_solver.tape import FloatArray

Kind = TypeVar("Kind")
#: The path of a field, or values by their paths.
Fields = Annotated[str | Mapping[str, object], expect("a string or a mapping of names to values")]
#: What moves by less has not moved, and a table may end before its scene by this part.
ROUND_OFF = 1e-12
#: A scene that a table drives begins at another speed than the table's by this part of the fastest in it: a
#: coarse table is not differentiated more sharply, other units are far off.
ALIKE = 0.1


class Placed(NamedTuple):
    """A start: q and v, (3b,) each; what was moved to put it together, in words, None if it was not."""

    q: tuple[float, ...]
    v: tuple[float, ...]
    moved: str | None = None


class Observed(NamedTuple):
    """What a scene is about, by its name: x or y of a point of a body, its angle, or the way along a guide.

    Tolerances, errors and studies are of this quantity.
    """

    name: str
    what: str
    body: int
    point: Point = (0.0, 0.0)
    guide: data.Line | None = None


class Scene(form.Top):
    """Any planar mechanism in motion: bodies that share pins, guides, springs, loads, a drive.

    ``observe`` is what the scene is about: a pin's x or y, a body's angle, or the way along a guide, as
    "B.x", "B.y", "body.angle" or "guide.along". ``turning`` is the body whose turns are revolutions, "" for
    none; it is the driven one unless it is named. The parts fit together, and are put together at the start.
    """

    model_config = ConfigDict(validate_default=True)

    ground: form.Ground = form.Ground(pins_m={})
    body: Annotated[Named[form.Body], Field(min_length=1)]
    guide: Named[form.Guide] = Field({})
    observe: str
    turning: str | None = None
    spring: Named[form.Spring] = Field({})
    torsion: Named[form.Torsion] = Field({})
    load: Named[form.Load] = Field({})
    drive: form.Drive = form.Drive(kind="free")
    clearance: Named[form.Clearance] = Field({})
    start: form.PlacedStart = form.PlacedStart()

    _short: CrankSlider | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _hangs_together(self, info: ValidationInfo) -> "Scene":
        self._short = (info.context or {}).get("short")
        for path, name, choices, what in _names(self):
            if name is not None and name not in (known := [*choices]):
                raise ValueError(unknown(path, name, known, f"{what} ({', '.join(known) or 'none'})"))
        _check_parts(self)
        self.placed  # noqa: B018  put together, or refused
        return self

    @classmethod
    def checked(cls, data: Mapping[str, Any], folder: Path = Path(), **_: Any) -> "Scene":
        """Return the scene that a mapping describes, in either spelling; raise SceneError if it is none."""
        if data.keys() & OF_GENERAL:
            return super().checked(data, folder, body=data.get("body"))
        short = CrankSlider.checked(data, folder)
        try:
            return super().checked(short.general(), short=short)
        except SceneError as error:
            raise SceneError(*map(in_short, error.reasons)) from None

    def __hash__(self) -> int:
        """Return a hash of what a file of the scene says."""
        return hash(self.to_toml())

    @check_arguments
    def replace(self, field: Fields, value: object = None) -> "Scene":
        """Return the scene with another value in a field: ``replace("clearance.B.restitution", 0.5)``.

        Several fields, checked together, are given as a mapping. None takes a part away, and what there is
        not yet comes to be: ``replace("clearance.B", None)`` makes a joint ideal. Raises SceneError where it
        is no scene with the new values.
        """
        fields = {field: value} if isinstance(field, str) else field
        return self.checked(with_fields(self.as_written(), fields))

    def as_written(self) -> dict[str, Any]:
        """Return the scene as a file has it, in its own spelling."""
        return self._short.as_written() if self._short else super().as_written()

    def to_toml(self) -> str:
        """Return the scene as a TOML file that reads back to an equal scene."""
        return tomli_w.dumps(self.as_written())

    @property
    def is_short(self) -> bool:
        """Whether it is written in the short spelling, as a crank-slider or a pendulum."""
        return self._short is not None

    @property
    def short(self) -> CrankSlider:
        """The scene in the short spelling, in which it has to be written."""
        assert self._short is not None, f"scene {self.name}: neither a crank-slider nor a pendulum"
        return self._short

    def number(self, name: str) -> int:
        """Return the number of a body, or of the ground."""
        return GROUND if name == "ground" else [*self.body].index(name)

    def point(self, name: str, place: str | Place) -> Point:
        """Return a pin or a place of a body from its centre of mass, or of the ground from the origin."""
        centre: Place = 0.0 if name == "ground" else self.body[name].centre_of_mass_m
        if isinstance(place, str):
            place = (self.ground if name == "ground" else self.body[name]).pins_m[place]
        (x, y), (x0, y0) = (each if isinstance(each, tuple) else (each, 0.0) for each in (place, centre))
        return x - x0, y - y0

    @cached_property
    def pins(self) -> dict[str, list[str]]:
        """The names of what has each pin: the ground first, then bodies in the order of the file."""
        places = {"ground": self.ground.pins_m} | {name: body.pins_m for name, body in self.body.items()}
        pins = dict.fromkeys(pin for own in places.values() for pin in own)
        return {pin: [name for name, own in places.items() if pin in own] for pin in pins}

    @property
    def markers(self) -> dict[str, tuple[int, Point]]:
        """The pins of no joint, guide or spring, by their names: the body of each, and its point there."""
        used = {guide.pin for guide in self.guide.values()}
        used |= {end.partition(".")[2] for spring in self.spring.values() for end in spring.between}
        alone = {pin: names[0] for pin, names in self.pins.items() if len(names) == 1 and pin not in used}
        return {pin: (self.number(name), self.point(name, pin)) for pin, name in alone.items()}

    @cached_property
    def mechanism(self) -> data.MechanismData:
        """The mechanism by names, from which engines build it."""
        return _mechanism(self)

    @cached_property
    def placed(self) -> Placed:
        """The start: coordinates and velocities of all bodies."""
        return _placed(self, self._short)

    @property
    def observed(self) -> Observed:
        """What the scene is about."""
        name, _, axis = self.observe.rpartition(".")
        if axis == "along":
            guide = self.mechanism.guides[[*self.guide].index(name)]
            return Observed(self.observe, axis, guide.body_j, guide.point_j, guide)
        last = name if axis == "angle" else self.pins[name][-1]
        point = (0.0, 0.0) if axis == "angle" else self.point(last, name)
        return Observed(self.observe, axis, self.number(last), point)

    @property
    def driven(self) -> str:
        """The name of the driven body, or guide."""
        return self.drive.guide or self.drive.body or next(iter(self.body))

    @property
    def turning_body(self) -> int | None:
        """The number of the body whose turns are revolutions, None where time is the unit.

        It is that of ``turning``; without it the driven one, or the first, where the ground has its pin.
        """
        if self.turning is not None:
            return self.number(self.turning) if self.turning else None
        on_ground = self.drive.guide is None and self.ground.pins_m.keys() & self.body[self.driven].pins_m
        return self.number(self.driven) if on_ground else None

    @property
    def clearances(self) -> dict[str, form.Clearance]:
        """The clearances of the joints that have one, by the joints' names, in their order."""
        return {pin.name: self.clearance[pin.name] for pin in self.mechanism.loose}


def with_fields(data: dict[str, Any], fields: Mapping[str, object]) -> dict[str, Any]:
    """Return the data of a scene with values put into it by their fields' paths, and sections for them."""
    for path, value in fields.items():
        part, *names = data, *path.split(".")
        for name in names[:-1]:
            if not isinstance(part.get(name), dict):
                part[name] = {}
            part = part[name]
        part[names[-1]] = value
        if value is None:
            del part[names[-1]]
    return data


def _names(scene: Scene) -> Iterator[tuple[str, str | None, Iterable[str], str]]:
    """Yield every name by which a part means another: its path, the name, what it may be, that in words."""
    start, pins, bodies, guides = scene.start, scene.pins, [*scene.body], [*scene.guide]
    taken = ["ground", *form.PlacedStart.model_fields]
    for name in bodies:
        require(name not in taken, f"body.{name}", f"a name other than {one_of(taken)}", name)
    for name, guide in scene.guide.items():
        yield f"guide.{name}.body", guide.body, bodies, "a body"
        yield f"guide.{name}.pin", guide.pin, scene.body[guide.body].pins_m, f"a pin of {guide.body}"
        others = [it for it in ("ground", *bodies) if it != guide.body]
        yield f"guide.{name}.on", guide.on, others, "ground or another body"
    ends = [f"{part}.{pin}" for pin, parts in pins.items() for part in parts]
    of_torsion = "torsion", ["ground", *bodies], "ground or a body, not"
    for kind, choices, what in (("spring", ends, "a body.pin, not of"), of_torsion):
        for name, spring in getattr(scene, kind).items():
            for place, end in enumerate(spring.between):
                other = spring.between[1 - place].partition(".")[0]
                others = [it for it in choices if it.partition(".")[0] != other]
                yield f"{kind}.{name}.between.{place}", end, others, f"{what} {other}"
    joints = [pin for pin, parts in pins.items() if len(parts) == 2]
    for pin, room in scene.clearance.items():
        yield f"clearance.{pin}", pin, joints, "a pin of two bodies, of two at one place where three meet"
        yield f"clearance.{pin}.bearing", room.bearing, pins[pin], f"what has pin {pin}"
    for name, load in scene.load.items():
        own = [it for it, guide in scene.guide.items() if guide.body == name]
        yield f"load.{name}", name, bodies, "a body"
        yield f"load.{name}.guide", load.guide, own, f"a guide of {name}"
        free = scene.body[name].pins_m if load.has_forces and not own else ()
        yield f"load.{name}.pin", load.pin, free, f"a pin of {name} for a force without a guide"
        yield f"load.{name}.gas.body", load.gas.body if load.gas else None, bodies, "a body"
    yield "drive.body", scene.drive.body, bodies, "a body"
    yield "drive.guide", scene.drive.guide, guides, "a guide"
    pinned = [pin for pin, parts in pins.items() if parts != ["ground"]]
    told = {"angle_rad": "a body", "speed_rad_s": "a body", "position_m": "a guide", "speed_m_s": "a guide"}
    for key, what in (told | {"place_m": "a pin of a body"}).items():
        for name in getattr(start, key):
            yield f"start.{key}.{name}", name, {"a body": bodies, "a guide": guides}.get(what, pinned), what
    for place, name in enumerate(start.hold):
        yield f"start.hold.{place}", name, [*bodies, *guides, *start.place_m], "a body, a guide or a pin told"
    yield "turning", scene.turning or None, bodies, "a body, or none"
    observed = [f"{pin}.{axis}" for pin in pinned for axis in "xy"]
    observed += [f"{name}.angle" for name in bodies] + [f"{name}.along" for name in guides]
    yield "observe", scene.observe, observed, "a pin's x or y, a body's angle or a guide's along"


def _check_parts(scene: Scene) -> None:
    """Raise ValueError, with the entry and what was expected, where parts do not fit each other."""
    start = scene.start
    for name in scene.body:
        of_all = not start.states or name in start.states
        require(of_all, f"start.{name}", "the state of every body or of none", None)
    for name in scene.guide:
        require(name not in scene.pins, f"guide.{name}", "a name that no pin has", name)
    for pin, (number, _) in scene.markers.items():
        expected = f"a pin that a body has too ({', '.join(name for name in scene.pins if name != pin)})"
        require(number != GROUND, f"ground.pins_m.{pin}", expected, pin)
    places = [[(0.0, 0.0), *(scene.point(name, pin) for pin in it.pins_m)] for name, it in scene.body.items()]
    longest = max(math.dist(a, b) for points in places for a in points for b in points)
    for name, room in scene.clearance.items():
        c, expected = room.radial_clearance_m, f"a number < {longest:g}, the longest distance on a body"
        require(c < longest or not longest, f"clearance.{name}.radial_clearance_m", expected, c)
    for name, load in scene.load.items():
        path, guides = f"load.{name}", [it for it, guide in scene.guide.items() if guide.body == name]
        one = load.guide is not None or len(guides) < 2 or not load.has_forces
        require(one, f"{path}.guide", one_of(guides), None)
        alone, told = load.has_forces and not guides, "a number for a force without a guide, and only there"
        require((load.along_rad is not None) == alone, f"{path}.along_rad", told, load.along_rad)
        driven = load.gas is None or load.gas.body or scene.drive.body
        require(driven is not None, f"{path}.gas.body", "a body, or drive.body", None)
    for key in ("angle_rad", "position_m", "place_m", "hold") if start.states else ():
        came = getattr(start, key)
        require(not came, f"start.{key}", "nothing beside the state of every body", came)
    kept = [guide.body for guide in scene.guide.values() if guide.on == "ground" and not guide.turns]
    turns = scene.drive.kind == "free" or scene.driven not in kept
    require(turns, "drive.body", "a body that can turn, which no guide of the ground holds", scene.driven)
    times = {f"load.{name}.by_time": it.by_time.time_s for name, it in scene.load.items() if it.by_time}
    begin_s, end_s = start.time_s, start.time_s + scene.end_time_s
    for path, time in (times | {"drive": scene.drive.time_s}).items():
        if time:
            first, last = f"{path}.time_s.0", f"{path}.time_s.{len(time) - 1}"
            require(time[0] <= begin_s, first, f"a number <= {begin_s:g}, when the scene begins", time[0])
            lasts = time[-1] >= end_s * (1 - ROUND_OFF)
            require(lasts, last, f"at least {end_s:g}, when the scene ends", time[-1])


def _data(kind: type[Kind], part: object, **others: Any) -> Kind:
    """Return a dataclass with those fields of a part that have its fields' names and a value, and others."""
    own = {field.name: getattr(part, field.name, None) for field in fields(kind)}  # type: ignore[arg-type]
    return kind(**{name: value for name, value in own.items() if value is not None} | others)


def _mechanism(scene: Scene) -> data.MechanismData:
    """Return the mechanism by names of a scene whose parts fit each other.

    A pin is a joint from the first part that has it to each other, named PIN or, of three or more, PIN.BODY.
    """
    pins = tuple(
        data.Pin(
            **_ends(scene, (first, pin), (other, pin)),
            name=pin if len(others) == 1 else f"{pin}.{other}",
            clearance=room.data() if (room := scene.clearance.get(pin)) else None,
            bearing_on_j=pin in scene.clearance and scene.clearance[pin].bearing == other,
        )
        for pin, (first, *others) in scene.pins.items()
        for other in others
    )

    def each(kind: type[Kind], parts: Mapping[str, Any], ends: Callable[[Any], Any]) -> tuple[Kind, ...]:
        return tuple(_data(kind, it, name=name, **_ends(scene, *ends(it))) for name, it in parts.items())

    guides = each(data.Guide, scene.guide, lambda it: ((it.on, it.through_m), (it.body, it.pin)))
    springs = each(data.Spring, scene.spring, lambda it: (end.split(".") for end in it.between))
    torsions = tuple(
        _data(data.Torsion, it, name=name, body_i=i, body_j=j)
        for name, it in scene.torsion.items()
        for i, j in [map(scene.number, it.between)]
    )
    bodies = tuple(_data(data.Body, it, name=name) for name, it in scene.body.items())
    loads = tuple(_load(scene, name, it, guides) for name, it in scene.load.items())
    gravity = scene.gravity_m_s2 if isinstance(scene.gravity_m_s2, tuple) else (0.0, -scene.gravity_m_s2)
    drive = _drive(scene, bodies, guides)
    return data.MechanismData(bodies, pins, guides, springs, torsions, loads, drive, gravity)


def _ends(scene: Scene, i: Any, j: Any) -> dict[str, Any]:
    """Return the fields of ``data.Ends`` between two places or pins of bodies, each (body, place)."""
    numbers = {"body_i": scene.number(i[0]), "body_j": scene.number(j[0])}
    return numbers | {"point_i": scene.point(*i), "point_j": scene.point(*j)}


def _load(scene: Scene, name: str, load: form.Load, guides: tuple[data.Guide, ...]) -> data.Load:
    """Return a load: its forces act along a guide of the body, or a line through a pin or its centre."""
    body, line, gas, by_time = scene.number(name), None, load.gas, load.by_time
    if load.has_forces:
        point = (0.0, 0.0) if load.pin is None else scene.point(name, load.pin)
        fixed = data.Line(GROUND, (0.0, 0.0), body, point, load.along_rad or 0.0)
        line = next((it for it in guides if it.body_j == body and load.guide in (None, it.name)), fixed)
    force = by_time.table("time_s", "force_N") if by_time and by_time.force_N else None
    twist = by_time.table("time_s", "torque_N_m") if by_time and by_time.torque_N_m else None
    of_gas = gas and data.GasData(scene.number(gas.body or scene.driven), gas.by_angle)
    return _data(data.Load, load, body=body, line=line, gas=of_gas, force_by_time=force, torque_by_time=twist)


def _drive(scene: Scene, bodies: tuple[data.Body, ...], guides: tuple[data.Guide, ...]) -> data.DriveData:
    """Return the drive; the speed at the start is that told of what is driven, or that of a given state."""
    drive: Any = scene.drive
    start, name, number, unit, told = scene.start, scene.driven, None, "rad_s", scene.start.speed_rad_s
    if drive.guide:
        number, unit, told = [*scene.guide].index(name), "m_s", start.speed_m_s
    body, speed = scene.number(name) if number is None else guides[number].body_j, told.get(name, 0.0)
    if start.states and name not in told:
        q, v = state_of(scene)
        driven = body if number is None else guides[number]
        speed = float((Joints(data.MechanismData(bodies, ())).told_rows(q, [driven]) @ v)[0])
    law: data.DriveLaw | None = None
    match drive.kind:
        case "constant-speed":
            law = data.ConstantSpeed(speed)
        case "ramp":
            law = data.Ramp(speed, getattr(drive, f"final_speed_{unit}"), drive.ramp_time_s)
        case "fluctuating":
            amplitude = getattr(drive, f"amplitude_{unit}")
            law = data.Fluctuation(speed, amplitude, drive.frequency_Hz, drive.phase_rad)
        case "table":
            law = data.Course(drive.table("time_s", "position_m" if drive.guide else "angle_rad"))
        case "torque":
            law = data.Torque(drive.table("time_s", "torque_N_m") if drive.time_s else drive.torque_N_m)
        case "motor" if drive.speed_rad_s:
            law = data.Motor(table=drive.table("speed_rad_s", "torque_N_m"))
        case "motor":
            law = data.Motor(drive.stall_torque_N_m, drive.no_load_speed_rad_s)
    return data.DriveData(body, number, law, start.time_s)


def state_of(scene: Scene) -> tuple[FloatArray, FloatArray]:
    """Return the given states of all bodies as coordinates and velocities, (n,) each."""
    states = np.array([[*scene.start.states[name].model_dump().values()] for name in scene.body])
    return states[:, :3].ravel(), states[:, 3:].ravel()


def _placed(scene: Scene, short: CrankSlider | None) -> Placed:
    """Return the start of a scene whose parts fit each other; raise ValueError if there is none."""
    of, words, told = scene.mechanism, None, _told(scene)
    if scene.start.states:
        q, v = state_of(scene)
        require_closed(of, q, v)
    elif short is not None and short.guide == (0.0, 0.0) and told.speeds.keys() <= {0}:
        q, v = assembled(short, short.start.crank_angle_rad, told.speeds.get(0, 0.0))
    else:
        start, what = assemble(of, told), "guide" if scene.drive.guide else "body"
        moves = scene.drive.kind == "free" or start.drive_moves
        require(moves, f"drive.{what}", f"a {what} that joints let move at the start", scene.driven)
        q, v, words = start.q, start.v, start.moved
    for spring in of.springs:
        has_length = spring.free_length_m > 0 or spring.damping_N_s_m > 0
        apart = not has_length or distance_m(spring, q.reshape(1, -1))[0] > ROUND_OFF * spring.free_length_m
        expected = "ends that are apart at the start (else its force has no direction)"
        require(bool(apart), f"spring.{spring.name}.between", expected, "both at one place")
    return Placed(tuple(q.ravel().tolist()), tuple(v.ravel().tolist()), words)


def _told(scene: Scene) -> Told:
    """Return what the file tells of the start, by numbers, with the speed of what is driven."""
    start, of = scene.start, scene.mechanism
    bodies: dict[str, Quantity] = {name: number for number, name in enumerate(scene.body)}
    guides, places = {guide.name: guide for guide in of.guides}, dict[str, list[data.Guide]]()
    values = {bodies[name]: angle for name, angle in start.angle_rad.items()}
    values |= {guides[name]: way for name, way in start.position_m.items()}
    for pin, place in start.place_m.items():
        ends = _ends(scene, ("ground", 0.0), (scene.pins[pin][-1], pin))
        places[pin] = [data.Guide(**ends, angle_rad=angle, name=pin) for angle in (0.0, math.pi / 2)]
        values |= dict(zip(places[pin], place if isinstance(place, tuple) else (place, 0.0), strict=True))
    speeds = {bodies[name]: speed for name, speed in start.speed_rad_s.items()}
    along: dict[Quantity, float] = {guides[name]: speed for name, speed in start.speed_m_s.items()}
    if isinstance(law := of.drive.law, Motion):
        rates, driven = speeds, bodies.get(scene.driven, of.drive.body)
        if of.drive.guide is not None:
            rates, driven = along, of.guides[of.drive.guide]
        speed = float(moved(going_on(law, of.drive.clock_s), 0.0)[1])
        if isinstance(law, Course) and driven in rates:
            fastest = max(map(abs, curve_of(law.table).derivative()(law.table.x)))
            field = f"start.speed_{'rad_s' if rates is speeds else 'm_s'}.{scene.driven}"
            expected = f"the speed of the drive's table when the scene begins, {speed:.4g}"
            require(abs(rates[driven] - speed) <= ALIKE * fastest, field, expected, rates[driven])
        if speed or speeds or along:
            rates[driven] = speed
    names = held_at_start(scene)
    held = [of[name] for of in (bodies, guides) for name in names if name in of]
    held += [line for name in names for line in places.get(name, ())]
    return Told(values, held, speeds | along)


def held_at_start(scene: Scene) -> tuple[str, ...]:
    """Return the bodies and guides whose values are held.

    Unless ``hold`` names them, it is what is driven, else the first body or guide told; what is driven is
    not held untold where a pin's place is told.
    """
    start, told = scene.start, [name for name in scene.body if name in scene.start.angle_rad]
    told += start.position_m
    if start.hold or (scene.drive.kind != "free" and (scene.driven in told or not start.place_m)):
        return start.hold or (scene.driven,)
    return tuple(told[:1])
