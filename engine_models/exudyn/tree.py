"""The coordinates that Exudyn solves for, as links: of single bodies, and of bodies that ideal joints hold.

A link moves or turns its frame against that of its parent. In the absolute model every body has a branch of
its own: one coordinate on a guide of the ground that keeps its angle, or else about an ideal pin of the
ground; three without either. The other ideal joints are constraints. Only a driven guide always has links, as
its way has to be a coordinate. In the tree model all ideal joints are links, which is possible where they
close no loop. Bodies are found breadth first from the ground, then from a body of each part that is afloat.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.states import way
from reference_solver.mechanism.data import GROUND, Guide, MechanismData, Pin, Point

Joint = Pin | Guide
Axis = Literal["x", "y", "turn"]
AXES: tuple[Axis, ...] = ("x", "y", "turn")
#: A body, the joint that hangs it on one that is there before, None if it is afloat, and that one.
Hung = tuple[int, Joint | None, int]


@dataclass(frozen=True)
class Link:
    """One link: its coordinate moves its frame along x or y, or turns it, against its parent, -1 the ground.

    ``offset_m`` is its place in the parent's frame, ``angle_rad`` its angle there at coordinate 0. ``body``
    is None for a link without mass; ``centre_m`` is where the body's centre of mass is in the link's frame
    and ``turned_rad`` the angle of the body's x axis there. ``name`` is that of the joint that the coordinate
    belongs to, if any.
    """

    parent: int
    axis: Axis
    offset_m: Point = (0.0, 0.0)
    angle_rad: float = 0.0
    body: int | None = None
    centre_m: Point = (0.0, 0.0)
    turned_rad: float = 0.0
    name: str = ""

    def place(self, point: Point) -> Point:
        """Return a point of the body in the link's frame."""
        x, y = turned(self.turned_rad, point)
        return self.centre_m[0] + x, self.centre_m[1] + y


@dataclass
class Branch:
    """The links of one node, and their coordinates and rates at the start."""

    links: list[Link] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    rates: list[float] = field(default_factory=list)

    @property
    def kind(self) -> str:
        """A "rotor" is one link that turns, a "mass" one that slides; "free" are x, y and angle of a body."""
        if len(self.links) == 1:
            return "rotor" if self.links[0].axis == "turn" else "mass"
        return "free" if [link.axis for link in self.links] == [*AXES] else "tree"


def turned(angle_rad: float, point: Point) -> Point:
    """Return a point turned about the origin."""
    (x, y), cos, sin = point, float(np.cos(angle_rad)), float(np.sin(angle_rad))
    return x * cos - y * sin, x * sin + y * cos


def spanning(of: MechanismData, joints: Sequence[Joint]) -> Iterator[Hung]:
    """Yield all bodies in the order in which joints hang them on each other.

    Of a part that is afloat the first is the driven body, or that with the line of a driven guide.
    """
    drive, placed = of.drive, list[int]()
    first = drive.body if drive.guide is None else of.guides[drive.guide].body_i
    for root in (GROUND, *sorted(range(len(of.bodies)), key=lambda body: body != first)):
        if root in placed:
            continue
        if root != GROUND:
            yield root, None, GROUND
        placed.append(root)
        for before in (queue := [root]):
            for joint in joints:
                body = {joint.body_i: joint.body_j, joint.body_j: joint.body_i}.get(before)
                if body is not None and body not in placed:
                    yield body, joint, before
                    placed.append(body)
                    queue.append(body)


def why_no_tree(of: MechanismData) -> str:
    """Return why a mechanism has no model without constraints, nothing if it has one."""
    ideal: list[Joint] = [*of.ideal, *of.guides]
    drive, turns = of.drive, {GROUND: 0}
    hung = [*spanning(of, ideal)]
    if len(ideal) > sum(joint is not None for _, joint, _ in hung):
        return "explicit solvers take no constraints, and ideal joints alone form a closed loop"
    for body, joint, before in hung:
        turns[body] = turns[before] + (not isinstance(joint, Guide) or joint.turns)
    if drive.prescribes and drive.guide is None and turns[drive.body] != 1:
        driven = of.bodies[drive.body].name
        return f"no coordinate is the angle of {driven}, whose speed is prescribed, but a sum of them"
    if drive.prescribes and drive.guide is not None and of.guides[drive.guide].body_i != GROUND:
        name = of.guides[drive.guide].name
        return f"guide {name} is driven, and its line moves: explicit solvers drive one of the ground"
    return ""


def way_of(branches: list[Branch], guide: Guide) -> tuple[int, int] | None:
    """Return branch and link of the coordinate that is the way along a guide, if there is one."""
    places = ((b, k, link) for b, branch in enumerate(branches) for k, link in enumerate(branch.links))
    return next(((b, k) for b, k, link in places if (link.name, link.axis) == (guide.name, "x")), None)


def branches_of(
    of: MechanismData, tree: bool, states: FloatArray
) -> tuple[list[Branch], dict[int, tuple[int, int]]]:
    """Return the branches of a model, and branch and link of every body.

    ``states`` (2, bodies, 3) are positions and velocities at the start.
    """
    branches, places = list[Branch](), dict[int, tuple[int, int]]()
    for body, joint, before in spanning(of, [*of.ideal, *of.guides] if tree else _carriers(of)):
        turn, parent, frame = states[:, body, 2], -1, Link(-1, "x")
        if before == GROUND:
            branches.append(Branch())
            number = len(branches) - 1
        else:
            number, parent = places[before]
            frame = branches[number].links[parent]
            turn = turn - states[:, before, 2] + [frame.turned_rad, 0.0]
        branch = branches[number]
        if joint is None:
            added = [(Link(k - 1, axis), states[:, body, k]) for k, axis in enumerate(AXES)]
            added[-1] = replace(added[-1][0], body=body), turn
        elif isinstance(joint, Pin):
            ends = [(joint.body_i, joint.point_i), (joint.body_j, joint.point_j)]
            (_, point), (_, (x, y)) = ends if before == joint.body_i else ends[::-1]
            link = Link(parent, "turn", frame.place(point), body=body, centre_m=(-x, -y), name=joint.name)
            added = [(link, turn)]
        else:
            added = _sliding(joint, before, parent, frame, turn, states, len(branch.links))
        for link, (start, rate) in added:
            branch.links.append(link)
            branch.start.append(float(start))
            branch.rates.append(float(rate))
        places[body] = number, len(branch.links) - 1
    return branches, places


def _carriers(of: MechanismData) -> list[Joint]:
    """Return the joints that are links in the absolute model: one of the ground a body; a driven guide."""
    held = [guide for guide in of.guides if not guide.turns]
    both: list[Joint] = [*held, *of.ideal]
    carriers = {joint.body_j: joint for joint in reversed(both) if joint.body_i == GROUND}
    if of.drive.prescribes and of.drive.guide is not None:
        driven = of.guides[of.drive.guide]
        carriers[driven.body_j] = driven
    return [*carriers.values()]


def _sliding(
    guide: Guide, before: int, parent: int, frame: Link, turn: FloatArray, states: FloatArray, number: int
) -> list[tuple[Link, FloatArray]]:
    """Return the links, from a number on, by which a guide hangs a body on one before, and their states.

    ``turn`` (2,) is the angle of the body against the frame of the link of the one before, and its rate.
    """
    s, name = np.concatenate(way(guide, states[:1], states[1:])), guide.name
    if before == guide.body_i:
        line, centre = guide.angle_rad + frame.turned_rad, (-guide.point_j[0], -guide.point_j[1])
        link, turn = Link(parent, "x", frame.place(guide.point_i), line, name=name), turn - [line, 0.0]
        if guide.turns:
            return [(link, s), (Link(number, "turn", body=guide.body_j, centre_m=centre, name=name), turn)]
        centre = turned(turn[0], centre)
        return [(replace(link, body=guide.body_j, centre_m=centre, turned_rad=turn[0]), s)]
    # The body that has the line hangs on that which moves along it: the way is the other way round.
    angle, place = guide.angle_rad, frame.place(guide.point_j)
    turn = turn + np.array([angle, 0.0])
    centre = turned(-angle, (-guide.point_i[0], -guide.point_i[1]))
    link = Link(parent, "x", place, turn[0], guide.body_i, centre, -angle, name)
    if not guide.turns:
        return [(link, -s)]
    pivot = Link(parent, "turn", place, name=name)
    return [(pivot, turn), (replace(link, parent=number, offset_m=(0.0, 0.0), angle_rad=0.0), -s)]
