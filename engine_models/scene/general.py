"""A scene of any planar mechanism: what in a file of one does not hang together, and its start."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydantic import PrivateAttr, model_validator

from engine_models.scene.data import require
from engine_models.scene.drives import PRESCRIBED, Drive, TableDrive, TorqueDrive
from engine_models.scene.loads import Load
from engine_models.scene.mechanism import levers_m, mechanism_data, pins_of, point_of, state_of
from engine_models.scene.parts import Clearance, GeneralParts, Observed, PlacedStart
from engine_models.scene.plain_words import one_of, shown, unknown
from reference_solver.mechanism.data import DriveData, MechanismData
from reference_solver.tape import FloatArray

if TYPE_CHECKING:
    from reference_solver.mechanism import assembly

#: A table may end before its scene by rounding, and what moves by less has not moved.
ROUND_OFF = 1e-12
#: Parts of the format that no engine runs yet, with what they are.
LATER = {"film": "a lubricated bearing", "friction": "dry friction of an ideal joint"}
NOT_YET = "expected nothing yet ({}: no engine runs it so far), got a section"
AXES = ("x", "y", "angle", "along")


@dataclass(frozen=True)
class Assembled:
    """A start that was put together: q and v, (n,) each, and in words what was moved for it."""

    q: tuple[float, ...]
    v: tuple[float, ...]
    moved: str


class GeneralScene(GeneralParts):
    """Any planar mechanism in motion: bodies that share pins, guides, springs, loads, a drive.

    ``observe`` is what the scene is about: a pin's x or y, a body's angle, or the way along a guide.
    ``turning`` is the body whose turns are revolutions, "" for none; it is the driven one unless it is named.
    """

    _assembled: Assembled | None = PrivateAttr(None)

    @model_validator(mode="before")
    @classmethod
    def _has_no_later_part(cls, data: object) -> object:
        if isinstance(data, Mapping):
            refuse_later(data)
            _refuse_unknown_in_start(data)
        return data

    @model_validator(mode="after")
    def _hangs_together(self) -> "GeneralScene":
        check_parts(self)
        self._assembled = assembled(self)
        return self

    @property
    def placed(self) -> Assembled | None:
        """The start that was put together, None where the state of every body is given."""
        return self._assembled

    def _mechanism(self) -> MechanismData:
        return mechanism_data(self)

    @property
    def observed(self) -> Observed:
        """What the scene is about."""
        name, _, axis = self.observe.rpartition(".")
        if axis == "angle":
            return Observed(self.observe, "angle", [*self.body].index(name))
        if axis == "along":
            guide = self.mechanism.guides[[*self.guide].index(name)]
            return Observed(self.observe, "along", guide.body_j, guide.point_j, guide)
        last = pins_of(self)[name][-1]
        body = [*self.body].index(last) if last in self.body else -1
        return Observed(self.observe, "x" if axis == "x" else "y", body, point_of(self, last, name))

    @property
    def turning_body(self) -> int | None:
        """The body of ``turning``; without it the driven one, or the first, where the ground has its pin."""
        if self.turning is not None:
            return [*self.body].index(self.turning) if self.turning else None
        body = self.drive.body or next(iter(self.body))
        is_pinned = self.ground.pins_m.keys() & self.body[body].pins_m.keys()
        return [*self.body].index(body) if is_pinned and self.drive.guide is None else None

    @property
    def clearances(self) -> dict[str, Clearance]:
        """The clearances of the joints that have one, in the order of the joints."""
        return {name: self.clearance[name] for name in self.joints if name in self.clearance}


def refuse_later(data: Mapping[str, object]) -> None:
    """Refuse parts of the format that no engine runs yet, play in a guide among them."""
    for name, what in LATER.items():
        if part := data.get(name):
            path = ".".join([name, *map(str, part)][:2]) if isinstance(part, Mapping) else name
            raise ValueError(f"{path}: {NOT_YET.format(what)}")
    rooms, guides = data.get("clearance"), data.get("guide")
    if isinstance(rooms, Mapping):
        own = [*guides] if isinstance(guides, Mapping) else ["guide"] if "crank" in data else []
        for name in own:
            if name in rooms:
                raise ValueError(f"clearance.{name}: {NOT_YET.format('play in a guide')}")


def _refuse_unknown_in_start(data: Mapping[str, object]) -> None:
    """Refuse what is neither a key of the start nor a body, before it is looked at as a body's state."""
    bodies, start = data.get("body"), data.get("start")
    if isinstance(bodies, Mapping) and isinstance(start, Mapping):
        for name in start:
            _known(f"start.{name}", name, [*PlacedStart.model_fields, *bodies], "a key of start or a body")


def check_parts(scene: GeneralParts) -> None:
    """Raise ValueError, with the entry and what was expected, where parts do not fit each other."""
    _check_names(scene)
    pins = pins_of(scene)
    _check_guides(scene)
    _check_springs(scene, pins)
    _check_clearances(scene, pins)
    _check_observed(scene, pins)
    _check_drive(scene)
    _check_loads(scene)
    _check_start(scene)
    _check_pins_alone(scene, pins)
    _check_sizes(scene)


def _known(path: str, name: str, choices: Iterable[str], what: str) -> None:
    """Refuse a name that is none of the choices."""
    choices = list(choices)
    if name not in choices:
        expected = f"{what} ({', '.join(choices)})" if choices else f"{what}, of which there is none"
        raise ValueError(unknown(path, name, choices, expected))


def _check_names(scene: GeneralParts) -> None:
    taken = {"ground": "the frame's", **dict.fromkeys(PlacedStart.model_fields, "that of a key of start")}
    for name, body in scene.body.items():
        if name in taken:
            raise ValueError(f"body.{name}: expected a name other than {taken[name]}, got {shown(name)}")
        if not body.pins_m:
            raise ValueError(f"body.{name}.pins_m: expected one pin at least, got none")
    for name in scene.guide:
        if name in pins_of(scene):
            raise ValueError(f"guide.{name}: expected a name that no pin has, got {shown(name)}")


def _check_guides(scene: GeneralParts) -> None:
    for name, guide in scene.guide.items():
        _known(f"guide.{name}.body", guide.body, scene.body, "a body")
        _known(f"guide.{name}.pin", guide.pin, scene.body[guide.body].pins_m, f"a pin of {guide.body}")
        others = [body for body in scene.body if body != guide.body]
        _known(f"guide.{name}.on", guide.on, ["ground", *others], "ground or another body")


def _check_springs(scene: GeneralParts, pins: Mapping[str, list[str]]) -> None:
    ends = [f"{body}.{pin}" for pin, bodies in pins.items() for body in bodies]
    for name, spring in scene.spring.items():
        for place, end in enumerate(spring.between):
            _known(f"spring.{name}.between.{place}", end, ends, "a pin with its body")
        first, second = (end.partition(".")[0] for end in spring.between)
        if first == second:
            raise ValueError(f"spring.{name}.between: expected pins of two bodies, got both of {first}")


def _check_clearances(scene: GeneralParts, pins: Mapping[str, list[str]]) -> None:
    two = [name for name, bodies in pins.items() if len(bodies) == 2]
    for name, room in scene.clearance.items():
        if len(pins.get(name, ())) > 2:
            raise ValueError(
                f"clearance.{name}: expected a pin of two bodies, got one of {', '.join(pins[name])}: "
                "give the bodies two pins at one place"
            )
        _known(f"clearance.{name}", name, two, "a pin of two bodies")
        if room.bearing is not None:
            _known(f"clearance.{name}.bearing", room.bearing, pins[name], f"what has pin {name}")


def _check_sizes(scene: GeneralParts) -> None:
    """Refuse clearances larger than the mechanism, whose units are others."""
    longest = max(levers_m(mechanism_data(scene)))
    for name, room in scene.clearance.items():
        expected = f"a number < {longest:g}, the largest distance between two joints of a body"
        c = room.radial_clearance_m
        require(c < longest or not longest, f"clearance.{name}.radial_clearance_m", expected, c)


def _check_observed(scene: GeneralParts, pins: Mapping[str, list[str]]) -> None:
    name, _, axis = scene.observe.rpartition(".")
    if axis not in AXES:
        expected = f"a name and, after a dot, {one_of([*AXES])}"
        raise ValueError(f"observe: expected {expected}, got {shown(scene.observe)}")
    of = {"angle": ("a body", [*scene.body]), "along": ("a guide", [*scene.guide])}
    what, choices = of.get(axis, ("a pin of a body", [pin for pin in pins if pins[pin] != ["ground"]]))
    if name not in choices:
        known = ", ".join(f"{each}.{axis}" for each in choices) or "none"
        raise ValueError(unknown("observe", name, choices, f"{what} ({known})", shown(scene.observe)))
    if scene.turning:
        _known("turning", scene.turning, scene.body, "a body")


def _check_drive(scene: GeneralParts) -> None:
    drive = scene.drive
    if drive.body is not None:
        _known("drive.body", drive.body, scene.body, "a body")
    if drive.guide is not None:
        _known("drive.guide", drive.guide, scene.guide, "a guide")
    if drive.kind != "free" and drive.guide is None:
        body = drive.body or next(iter(scene.body))
        if body not in turning_bodies(scene):
            raise ValueError(
                f"drive.body: expected a body that can turn, got {shown(body)}, which a guide holds"
            )
    check_time_tables(drive, scene.load, scene.clock_s, scene.end_time_s)


def turning_bodies(scene: GeneralParts) -> list[str]:
    """Return the bodies that no guide, nor a row of them, keeps from turning against the ground."""
    still = {"ground"}
    for _ in scene.guide:
        pairs = ({guide.body, guide.on} for guide in scene.guide.values() if not guide.turns)
        still = still.union(*(both for both in pairs if both & still))
    return [name for name in scene.body if name not in still]


def check_time_tables(drive: Drive, loads: Mapping[str, Load], begin_s: float, duration_s: float) -> None:
    """Refuse tables over time that do not last from the start of a scene to its end."""
    tables = [(f"load.{name}.by_time", load.by_time.time_s) for name, load in loads.items() if load.by_time]
    if isinstance(drive, TableDrive | TorqueDrive) and drive.time_s is not None:
        tables.append(("drive", drive.time_s))
    for path, time in tables:
        expected = f"a number <= {begin_s:g}, when the scene begins"
        require(time[0] <= begin_s, f"{path}.time_s.0", expected, time[0])
        end = begin_s + duration_s
        lasts = time[-1] >= end * (1 - ROUND_OFF)
        require(lasts, f"{path}.time_s.{len(time) - 1}", f"at least {end:g}, when the scene ends", time[-1])


def _check_loads(scene: GeneralParts) -> None:
    for name, load in scene.load.items():
        path = f"load.{name}"
        _known(path, name, scene.body, "a body")
        guides = [guide for guide, part in scene.guide.items() if part.body == name]
        if load.guide is not None:
            _known(f"{path}.guide", load.guide, guides, f"a guide of {name}")
        if load.has_forces and len(guides) > 1 and load.guide is None:
            raise ValueError(f"{path}.guide: expected {one_of(guides)}, got nothing")
        if load.has_forces and not guides and load.along_rad is None:
            raise ValueError(f"{path}.along_rad: expected a number for a body without a guide, got nothing")
        if load.along_rad is not None and (guides or not load.has_forces):
            when = "for a body in a guide" if guides else "without a force"
            require(False, f"{path}.along_rad", f"nothing {when}", load.along_rad)
        if load.gas is not None and load.gas.body is None and scene.drive.body is None:
            raise ValueError(f"{path}.gas.body: expected a body, or drive.body, got nothing")
        if load.gas is not None and load.gas.body is not None:
            _known(f"{path}.gas.body", load.gas.body, scene.body, "a body")


def _check_start(scene: GeneralParts) -> None:
    start = scene.start
    bodies, guides = ([*scene.body], "a body"), ([*scene.guide], "a guide")
    kinds = {"angle_rad": bodies, "speed_rad_s": bodies, "position_m": guides, "speed_m_s": guides}
    for key, (names, what) in kinds.items():
        for name in getattr(start, key):
            _known(f"start.{key}.{name}", name, names, what)
    for place, name in enumerate(start.hold):
        _known(f"start.hold.{place}", name, [*scene.body, *scene.guide], "a body or a guide")
        if name in scene.body and name in scene.guide:
            expected = "a name that is of a body or of a guide"
            raise ValueError(f"start.hold.{place}: expected {expected}, got {shown(name)}, which is of both")
    missing = [name for name in scene.body if name not in start.states]
    if start.states and missing:
        raise ValueError(f"start.{missing[0]}: expected the state of every body or of none, got nothing")
    for key in ("angle_rad", "position_m", "hold"):
        if start.states and getattr(start, key):
            raise ValueError(f"start.{key}: expected nothing beside the state of every body, got values")


def _check_pins_alone(scene: GeneralParts, pins: Mapping[str, list[str]]) -> None:
    """Refuse a pin that one body alone has and nothing uses."""
    used = {guide.pin for guide in scene.guide.values()} | {scene.observe.rpartition(".")[0]}
    used |= {end.partition(".")[2] for spring in scene.spring.values() for end in spring.between}
    for pin, bodies in pins.items():
        if len(bodies) == 1 and pin not in used:
            place = "ground" if bodies[0] == "ground" else f"body.{bodies[0]}"
            others = ", ".join(name for name in pins if name != pin) or "none"
            raise ValueError(
                f"{place}.pins_m.{pin}: expected a pin that another body or the ground has too ({others}), "
                "got it here alone"
            )


#: A scene that a table drives begins at another speed than the table's by this part of the fastest in it: a
#: coarse table is not differentiated more sharply, other units are far off.
ALIKE = 0.1


def placed_start(scene: GeneralParts) -> Assembled | None:
    """Return the start put together, as it was when the scene was checked if it was; see ``assembled``."""
    return scene.placed if isinstance(scene, GeneralScene) and scene.placed else assembled(scene)


def assembled(scene: GeneralParts) -> Assembled | None:
    """Return the start put together, None where the state of every body is given.

    Raises:
        ValueError: there is no such start.
    """
    from reference_solver.mechanism.assembly import NotAssembled, assemble  # most scenes do without

    if scene.start.states:
        _require_closed(scene)
        return None
    drive = scene.drive
    try:
        found = assemble(mechanism_data(scene), _told(scene))
    except NotAssembled as reason:
        raise ValueError(_refused(scene, str(reason))) from None
    if drive.kind != "free" and not found.drive_moves:
        what = "guide" if drive.guide else "body"
        name = drive.guide or drive.body or next(iter(scene.body))
        came = f"{shown(name)}, which the joints hold"
        raise ValueError(f"drive.{what}: expected a {what} that can move at the start, got {came}")
    _check_springs_at(scene, found.q)
    return Assembled(tuple(found.q.tolist()), tuple(found.v.tolist()), _moved(scene, found))


def _check_springs_at(scene: GeneralParts, q: FloatArray) -> None:
    """Refuse a spring whose ends are at one place, so that its force has no direction."""
    from reference_solver.mechanism.assembly import place_of

    for spring in mechanism_data(scene).springs:
        i, j = place_of(q, spring.body_i, spring.point_i), place_of(q, spring.body_j, spring.point_j)
        has_length = spring.free_length_m > 0 or spring.damping_N_s_m > 0
        if has_length and not np.hypot(*(j - i)) > ROUND_OFF * spring.free_length_m:
            where = ", ".join(scene.spring[spring.name].between)
            expected = "ends that are apart at the start (else its force has no direction)"
            raise ValueError(f"spring.{spring.name}.between: expected {expected}, got {where} at one place")


def _require_closed(scene: GeneralParts) -> None:
    """Refuse states of bodies at which joints are open, or speeds that joints and drive do not allow."""
    from reference_solver.mechanism.assembly import NotAssembled, require_closed

    q, v = state_of(scene)
    _check_springs_at(scene, q)
    try:
        require_closed(mechanism_data(scene), q, v)
    except NotAssembled as reason:
        raise ValueError(f"start: {reason}") from None


def _refused(scene: GeneralParts, reason: str) -> str:
    """Return why there is no such start, with the entry that tells what does not hold."""
    start, drive = scene.start, scene.drive
    expected = reason.partition(", got")[0]
    if "held" in expected and start.hold:
        return f"start.hold: {reason}"
    if "speeds" not in expected:
        return f"start: {reason}"
    told = {**start.speed_rad_s, **start.speed_m_s}
    name = drive.guide or drive.body or next(iter(scene.body))
    drives = drive.kind in PRESCRIBED and name not in told
    also = f" (that of {name}, by the drive, among them)" if drives else ""
    key = "speed_m_s" if start.speed_m_s and not start.speed_rad_s else "speed_rad_s"
    return f"start.{key}: {reason}{also}"


def _moved(scene: GeneralParts, found: "assembly.Assembled") -> str:
    """Return in words which bodies the assembly has turned and what it has moved along guides the most."""
    parts, told = [], [name in scene.start.position_m for name in scene.guide]
    for names, values, verb, unit in (
        ([*scene.body], found.turned_rad, "turned", "rad"),
        ([*scene.guide], found.moved_m * told, "moved along", "m"),
    ):
        most = int(abs(values).argmax()) if len(values) else 0
        if len(values) and abs(values[most]) > ROUND_OFF:
            parts.append(f"{names[most]} {verb} by {abs(values[most]):.3g} {unit}")
    return ", ".join(parts) or "nothing moved"


def _told(scene: GeneralParts) -> "assembly.Told":
    """Return what the file tells of the start, by numbers."""
    from reference_solver.mechanism.assembly import Told

    start, bodies, guides = scene.start, [*scene.body], [*scene.guide]
    held_bodies, held_guides = held_at_start(scene)
    speeds = {bodies.index(name): speed for name, speed in start.speed_rad_s.items()}
    along = {guides.index(name): speed for name, speed in start.speed_m_s.items()}
    drive = mechanism_data(scene).drive
    if drive.prescribes:
        driven, number = (speeds, drive.body) if drive.guide is None else (along, drive.guide)
        own = speed_at_start(drive)
        if own or number in driven or speeds or along:
            _require_speed_of_table(scene, driven.get(number), own)
            driven[number] = own
    return Told(
        {bodies.index(name): angle for name, angle in start.angle_rad.items()},
        {guides.index(name): way for name, way in start.position_m.items()},
        tuple(bodies.index(name) for name in held_bodies),
        tuple(guides.index(name) for name in held_guides),
        speeds,
        along,
    )


def held_at_start(scene: GeneralParts) -> tuple[list[str], list[str]]:
    """Return the bodies and guides whose values are held.

    Unless ``hold`` names them, it is what is driven, else the first body or guide told.
    """
    drive, start = scene.drive, scene.start
    if start.hold:
        return [name for name in start.hold if name in scene.body], [
            n for n in start.hold if n in scene.guide
        ]
    if drive.kind != "free":
        if drive.guide is not None:
            return [], [drive.guide]
        return [drive.body or next(iter(scene.body))], []
    told = [name for name in scene.body if name in start.angle_rad][:1]
    return told, [] if told else [*start.position_m][:1]


def speed_at_start(drive: DriveData) -> float:
    """Return the speed that a drive prescribes as a run begins, in rad/s or m/s."""
    from reference_solver.mechanism.building import motion_of
    from reference_solver.mechanism.motions import MOTIONS

    motion = motion_of(drive)
    assert motion is not None
    return float(MOTIONS[type(motion)](motion, 0.0)[1])


def _require_speed_of_table(scene: GeneralParts, told: float | None, own: float) -> None:
    """Refuse a speed told that is not the one of the drive's table."""
    drive = scene.drive
    if not isinstance(drive, TableDrive) or told is None:
        return
    fastest = max(abs(rate) for rate in drive.spline().derivative()(drive.time_s))
    if abs(told - own) > ALIKE * fastest:
        key, unit = ("speed_rad_s", "rad/s") if drive.guide is None else ("speed_m_s", "m/s")
        name = drive.guide or drive.body or next(iter(scene.body))
        expected = f"the speed of the drive's table when the scene begins, {own:.4g} {unit}"
        raise ValueError(f"start.{key}.{name}: expected {expected}, got {told:g}")
