"""What in a scene does not fit together: names that are taken, parts at odds, short tables."""

import math
from typing import TYPE_CHECKING

from engine_models.scene.format import require, require_known
from engine_models.scene.plain_words import one_of
from reference_solver.mechanism.data import GROUND

if TYPE_CHECKING:
    from engine_models.scene.scene import Scene

#: A table may end before its scene by rounding.
ROUND_OFF = 1e-12


def check_parts(scene: "Scene") -> None:
    """Raise ValueError, with the entry and what was expected, where parts do not fit each other."""
    _check_joints(scene)
    _check_drive(scene)
    for name, load in scene.load.items():
        path, guides = f"load.{name}", [it for it, part in scene.guide.items() if part.body == name]
        if load.guide is not None:
            require_known(f"{path}.guide", load.guide, guides, f"a guide of {name}")
        one = load.guide is not None or len(guides) < 2 or not load.has_forces
        require(one, f"{path}.guide", one_of(guides), None)
        fits = (load.along_rad is not None) == (load.has_forces and not guides)
        told = "a number for a force without a guide, and only there"
        require(fits, f"{path}.along_rad", told, load.along_rad)
        driven = load.gas is None or load.gas.body or scene.drive.body
        require(driven is not None, f"{path}.gas.body", "a body, or drive.body", None)
    start, both = scene.start, scene.body.keys() & scene.guide.keys()
    for place, name in enumerate(start.hold):
        require(name not in both, f"start.hold.{place}", "a name that is of a body or of a guide", name)
    for name in scene.body if start.states else ():
        require(name in start.states, f"start.{name}", "the state of every body or of none", None)
    for key in ("angle_rad", "position_m", "hold") if start.states else ():
        came = getattr(start, key)
        require(not came, f"start.{key}", "nothing beside the state of every body", came)


def _check_joints(scene: "Scene") -> None:
    for name, guide in scene.guide.items():
        require(name not in scene.pins, f"guide.{name}", "a name that no pin has", name)
        require_known(f"guide.{name}.pin", guide.pin, scene.body[guide.body].pins_m, f"a pin of {guide.body}")
        require(guide.on != guide.body, f"guide.{name}.on", "ground or another body", guide.on)
    for name, spring in scene.spring.items():
        first, second = (end.partition(".")[0] for end in spring.between)
        require(first != second, f"spring.{name}.between", "pins of two bodies", spring.between)
    for pin, (number, _) in scene.markers.items():
        expected = f"a pin that a body has too ({', '.join(name for name in scene.pins if name != pin)})"
        require(number != GROUND, f"ground.pins_m.{pin}", expected, pin)
    places = [[(0.0, 0.0), *(scene.point(name, pin) for pin in it.pins_m)] for name, it in scene.body.items()]
    longest = max(math.dist(a, b) for points in places for a in points for b in points)
    for name, room in scene.clearance.items():
        bodies, c = scene.pins[name], room.radial_clearance_m
        require_known(f"clearance.{name}.bearing", room.bearing or bodies[0], bodies, f"what has pin {name}")
        expected = f"a number < {longest:g}, the largest distance between two joints of a body"
        require(c < longest or not longest, f"clearance.{name}.radial_clearance_m", expected, c)


def _check_drive(scene: "Scene") -> None:
    """Refuse a drive of what cannot turn, and tables shorter than the scene."""
    begin_s, end_s = scene.start.time_s, scene.start.time_s + scene.end_time_s
    on_ground = {guide.body for guide in scene.guide.values() if guide.on == "ground" and not guide.turns}
    turns = scene.drive.kind == "free" or scene.driven not in on_ground
    require(turns, "drive.body", "a body that can turn, which no guide of the ground holds", scene.driven)
    times = {f"load.{name}.by_time": it.by_time.time_s for name, it in scene.load.items() if it.by_time}
    for path, time in (times | {"drive": scene.drive.time_s or ()}).items():
        if time:
            first, last = f"{path}.time_s.0", f"{path}.time_s.{len(time) - 1}"
            require(time[0] <= begin_s, first, f"a number <= {begin_s:g}, when the scene begins", time[0])
            lasts = time[-1] >= end_s * (1 - ROUND_OFF)
            require(lasts, last, f"at least {end_s:g}, when the scene ends", time[-1])
