"""What in a scene does not fit together: unknown names, parts at odds, short tables."""

import math
from collections.abc import Mapping

from engine_models.scene.format import (
    PlacedStart,
    Sections,
    TableDrive,
    TorqueDrive,
    refuse,
    require,
    require_known,
)
from engine_models.scene.mechanism import levers_m, mechanism_data, pins_of, point_of
from engine_models.scene.plain_words import one_of, shown, unknown

#: A table may end before its scene by rounding.
ROUND_OFF = 1e-12
AXES = ("x", "y", "angle", "along")


def check_parts(scene: Sections) -> None:
    """Raise ValueError, with the entry and what was expected, where parts do not fit each other."""
    pins = pins_of(scene)
    _check_names(scene, pins)
    _check_guides(scene)
    _check_springs(scene, pins)
    _check_clearances(scene, pins)
    _check_observed(scene, pins)
    _check_drive(scene)
    _check_time_tables(scene)
    _check_loads(scene)
    _check_start(scene)
    _check_pins_alone(scene, pins)
    _check_sizes(scene)


def _check_names(scene: Sections, pins: Mapping[str, list[str]]) -> None:
    taken = {"ground": "the frame's", **dict.fromkeys(PlacedStart.model_fields, "that of a key of start")}
    for name, body in scene.body.items():
        require(name not in taken, f"body.{name}", f"a name other than {taken.get(name)}", name)
        if not body.pins_m:
            raise ValueError(f"body.{name}.pins_m: expected one pin at least, got none")
    for name in scene.guide:
        require(name not in pins, f"guide.{name}", "a name that no pin has", name)


def _check_guides(scene: Sections) -> None:
    for name, guide in scene.guide.items():
        require_known(f"guide.{name}.body", guide.body, scene.body, "a body")
        require_known(f"guide.{name}.pin", guide.pin, scene.body[guide.body].pins_m, f"a pin of {guide.body}")
        others = [body for body in scene.body if body != guide.body]
        require_known(f"guide.{name}.on", guide.on, ["ground", *others], "ground or another body")


def _check_springs(scene: Sections, pins: Mapping[str, list[str]]) -> None:
    ends = [f"{body}.{pin}" for pin, bodies in pins.items() for body in bodies]
    for name, spring in scene.spring.items():
        for place, end in enumerate(spring.between):
            require_known(f"spring.{name}.between.{place}", end, ends, "a pin with its body")
        first, second = (end.partition(".")[0] for end in spring.between)
        if first == second:
            raise ValueError(f"spring.{name}.between: expected pins of two bodies, got both of {first}")


def _check_clearances(scene: Sections, pins: Mapping[str, list[str]]) -> None:
    two = [name for name, bodies in pins.items() if len(bodies) == 2]
    for name, room in scene.clearance.items():
        if len(pins.get(name, ())) > 2:
            raise ValueError(
                f"clearance.{name}: expected a pin of two bodies, got one of {', '.join(pins[name])}: "
                "give the bodies two pins at one place"
            )
        require_known(f"clearance.{name}", name, two, "a pin of two bodies")
        if room.bearing is not None:
            require_known(f"clearance.{name}.bearing", room.bearing, pins[name], f"what has pin {name}")


def _check_observed(scene: Sections, pins: Mapping[str, list[str]]) -> None:
    name, _, axis = scene.observe.rpartition(".")
    require(axis in AXES, "observe", f"a name and, after a dot, {one_of([*AXES])}", scene.observe)
    of = {"angle": ("a body", [*scene.body]), "along": ("a guide", [*scene.guide])}
    what, choices = of.get(axis, ("a pin of a body", [pin for pin in pins if pins[pin] != ["ground"]]))
    if name not in choices:
        known = ", ".join(f"{each}.{axis}" for each in choices) or "none"
        raise ValueError(unknown("observe", name, choices, f"{what} ({known})", shown(scene.observe)))
    if scene.turning:
        require_known("turning", scene.turning, scene.body, "a body")


def _check_drive(scene: Sections) -> None:
    drive = scene.drive
    if drive.body is not None:
        require_known("drive.body", drive.body, scene.body, "a body")
    if drive.guide is not None:
        require_known("drive.guide", drive.guide, scene.guide, "a guide")
    elif drive.kind != "free" and scene.driven in _held(scene):
        came = f"{shown(scene.driven)}, which a guide holds"
        raise ValueError(f"drive.body: expected a body that can turn, got {came}")


def _held(scene: Sections) -> set[str]:
    """Return the ground, and the bodies that a guide, or a row of them, keeps from turning against it."""
    still = {"ground"}
    for _ in scene.guide:
        pairs = ({guide.body, guide.on} for guide in scene.guide.values() if not guide.turns)
        still = still.union(*(both for both in pairs if both & still))
    return still


def _check_time_tables(scene: Sections) -> None:
    """Refuse tables over time that do not last from the start of a scene to its end."""
    begin_s, drive = scene.clock_s, scene.drive
    end_s = begin_s + scene.end_time_s
    tables = {
        f"load.{name}.by_time": load.by_time.time_s for name, load in scene.load.items() if load.by_time
    }
    if isinstance(drive, TableDrive | TorqueDrive) and drive.time_s is not None:
        tables["drive"] = drive.time_s
    for path, time in tables.items():
        expected = f"a number <= {begin_s:g}, when the scene begins"
        require(time[0] <= begin_s, f"{path}.time_s.0", expected, time[0])
        lasts, last = time[-1] >= end_s * (1 - ROUND_OFF), f"{path}.time_s.{len(time) - 1}"
        require(lasts, last, f"at least {end_s:g}, when the scene ends", time[-1])


def _check_loads(scene: Sections) -> None:
    for name, load in scene.load.items():
        path = f"load.{name}"
        require_known(path, name, scene.body, "a body")
        guides = [guide for guide, part in scene.guide.items() if part.body == name]
        if load.guide is not None:
            require_known(f"{path}.guide", load.guide, guides, f"a guide of {name}")
        if load.has_forces and len(guides) > 1:
            require(load.guide is not None, f"{path}.guide", one_of(guides), None)
        if load.has_forces and not guides:
            told = load.along_rad is not None
            require(told, f"{path}.along_rad", "a number for a body without a guide", None)
        elif load.along_rad is not None:
            when = "for a body in a guide" if guides else "without a force"
            refuse(f"{path}.along_rad", f"nothing {when}", load.along_rad)
        if load.gas is not None and load.gas.body is None:
            require(scene.drive.body is not None, f"{path}.gas.body", "a body, or drive.body", None)
        elif load.gas is not None and load.gas.body is not None:
            require_known(f"{path}.gas.body", load.gas.body, scene.body, "a body")


def _check_start(scene: Sections) -> None:
    start = scene.start
    bodies, guides = ([*scene.body], "a body"), ([*scene.guide], "a guide")
    kinds = {"angle_rad": bodies, "speed_rad_s": bodies, "position_m": guides, "speed_m_s": guides}
    for key, (names, what) in kinds.items():
        for name in getattr(start, key):
            require_known(f"start.{key}.{name}", name, names, what)
    for place, name in enumerate(start.hold):
        require_known(f"start.hold.{place}", name, [*scene.body, *scene.guide], "a body or a guide")
        if name in scene.body and name in scene.guide:
            expected = "a name that is of a body or of a guide"
            raise ValueError(f"start.hold.{place}: expected {expected}, got {shown(name)}, which is of both")
    missing = [name for name in scene.body if name not in start.states]
    if start.states and missing:
        refuse(f"start.{missing[0]}", "the state of every body or of none", None)
    for key in ("angle_rad", "position_m", "hold"):
        if start.states and getattr(start, key):
            raise ValueError(f"start.{key}: expected nothing beside the state of every body, got values")


def _check_pins_alone(scene: Sections, pins: Mapping[str, list[str]]) -> None:
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


def _check_sizes(scene: Sections) -> None:
    """Refuse clearances larger than the mechanism, whose units are others."""
    places = [[point_of(scene, name, pin) for pin in body.pins_m] for name, body in scene.body.items()]
    between = [math.dist(a, b) for own in places for a in own for b in own]
    longest = max(*levers_m(mechanism_data(scene)), *between)
    for name, room in scene.clearance.items():
        expected = f"a number < {longest:g}, the largest distance between two joints of a body"
        c = room.radial_clearance_m
        require(c < longest or not longest, f"clearance.{name}.radial_clearance_m", expected, c)
