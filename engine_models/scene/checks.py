"""What in a scene does not fit together: unknown names, parts at odds, short tables."""

import math
from collections.abc import Mapping
from typing import Any

from engine_models.scene.format import PlacedStart, Sections, TableDrive, TorqueDrive, require, require_known
from engine_models.scene.mechanism import levers_m, markers_of, mechanism_data, pins_of, point_of
from engine_models.scene.plain_words import one_of

#: A table may end before its scene by rounding.
ROUND_OFF = 1e-12
AXES = ("x", "y", "angle", "along")


def check_parts(scene: Sections) -> None:
    """Raise ValueError, with the entry and what was expected, where parts do not fit each other."""
    pins = pins_of(scene)
    _check_names(scene, pins)
    _check_pins(scene, pins)
    _check_drive(scene)
    _check_loads(scene)
    _check_start(scene)


def _check_names(scene: Sections, pins: Mapping[str, list[str]]) -> None:
    taken = ("ground", *PlacedStart.model_fields)
    for name in scene.body:
        require(name not in taken, f"body.{name}", f"a name other than {one_of([*taken])}", name)
    for name, guide in scene.guide.items():
        require(name not in pins, f"guide.{name}", "a name that no pin has", name)
        require_known(f"guide.{name}.body", guide.body, scene.body, "a body")
        require_known(f"guide.{name}.pin", guide.pin, scene.body[guide.body].pins_m, f"a pin of {guide.body}")
        others = [body for body in scene.body if body != guide.body]
        require_known(f"guide.{name}.on", guide.on, ["ground", *others], "ground or another body")
    ends = [f"{body}.{pin}" for pin, bodies in pins.items() for body in bodies]
    for name, spring in scene.spring.items():
        for place, end in enumerate(spring.between):
            require_known(f"spring.{name}.between.{place}", end, ends, "a pin with its body")
        first, second = (end.partition(".")[0] for end in spring.between)
        require(first != second, f"spring.{name}.between", "pins of two bodies", spring.between)
    axis = scene.observe.rpartition(".")[2]
    require(axis in AXES, "observe", f"a name and, after a dot, {one_of([*AXES])}", scene.observe)
    of_bodies = [pin for pin in pins if pins[pin] != ["ground"]]
    choices = {"angle": [*scene.body], "along": [*scene.guide]}.get(axis, of_bodies)
    what = {"angle": "a body", "along": "a guide"}.get(axis, "a pin of a body")
    require_known("observe", scene.observe, [f"{each}.{axis}" for each in choices], what)
    if scene.turning:
        require_known("turning", scene.turning, scene.body, "a body")


def _check_pins(scene: Sections, pins: Mapping[str, list[str]]) -> None:
    """Refuse a pin that the ground alone has, and clearances of no joint, or larger than it."""
    for pin, body in markers_of(scene).items():
        expected = f"a pin that a body has too ({', '.join(name for name in pins if name != pin)})"
        require(body != "ground", f"ground.pins_m.{pin}", expected, pin)
    places = [[point_of(scene, name, pin) for pin in body.pins_m] for name, body in scene.body.items()]
    between = [math.dist(a, b) for own in places for a in own for b in own]
    longest = max(*levers_m(mechanism_data(scene)), *between) if scene.clearance else 0.0
    two = [name for name, bodies in pins.items() if len(bodies) == 2]
    for name, room in scene.clearance.items():
        bodies, c = pins.get(name, []), room.radial_clearance_m
        require_known(
            f"clearance.{name}", name, two, "a pin of two bodies, of two at one place where three meet"
        )
        require_known(f"clearance.{name}.bearing", room.bearing or bodies[0], bodies, f"what has pin {name}")
        expected = f"a number < {longest:g}, the largest distance between two joints of a body"
        require(c < longest or not longest, f"clearance.{name}.radial_clearance_m", expected, c)


def _check_drive(scene: Sections) -> None:
    """Refuse a drive of what is not there or cannot turn, and tables shorter than the scene."""
    drive, begin_s = scene.drive, scene.start.time_s
    if drive.guide is not None:
        require_known("drive.guide", drive.guide, scene.guide, "a guide")
    else:
        require_known("drive.body", scene.driven, scene.body, "a body")
    on_ground = {guide.body for guide in scene.guide.values() if guide.on == "ground" and not guide.turns}
    turns = drive.kind == "free" or scene.driven not in on_ground
    require(turns, "drive.body", "a body that can turn, which no guide of the ground holds", scene.driven)
    end_s = begin_s + scene.end_time_s
    tables: dict[str, Any] = {f"load.{name}.by_time": load.by_time for name, load in scene.load.items()}
    tables["drive"] = drive if isinstance(drive, TableDrive | TorqueDrive) else None
    for path, table in tables.items():
        if table is not None and (time := table.time_s) is not None:
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
        one = load.guide is not None or len(guides) < 2 or not load.has_forces
        require(one, f"{path}.guide", one_of(guides), None)
        told, expected = (
            load.along_rad is not None,
            "a number for a force on a body without a guide, and only there",
        )
        require(told == (load.has_forces and not guides), f"{path}.along_rad", expected, load.along_rad)
        if load.gas is not None:
            body = load.gas.body or scene.drive.body
            require(body is not None, f"{path}.gas.body", "a body, or drive.body", None)
            require_known(f"{path}.gas.body", str(body), scene.body, "a body")


def _check_start(scene: Sections) -> None:
    start, both = scene.start, [*scene.body, *scene.guide]
    bodies, guides = ([*scene.body], "a body"), ([*scene.guide], "a guide")
    kinds = {"angle_rad": bodies, "speed_rad_s": bodies, "position_m": guides, "speed_m_s": guides}
    for key, (names, what) in kinds.items():
        for name in getattr(start, key):
            require_known(f"start.{key}.{name}", name, names, what)
    for place, name in enumerate(start.hold):
        require_known(f"start.hold.{place}", name, both, "a body or a guide")
        require(both.count(name) == 1, f"start.hold.{place}", "a name that is of a body or of a guide", name)
    for name in scene.body if start.states else ():
        require(name in start.states, f"start.{name}", "the state of every body or of none", None)
    for key in ("angle_rad", "position_m", "hold") if start.states else ():
        came = getattr(start, key)
        require(not came, f"start.{key}", "nothing beside the state of every body", came)
