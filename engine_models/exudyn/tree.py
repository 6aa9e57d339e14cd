"""The coordinates that Exudyn solves for, as links: of single bodies, and of bodies that ideal joints hold.

A link moves or turns its frame against that of its parent. In the absolute model every body has a branch of
its own: one coordinate on a guide of the ground that keeps its angle, or else about an ideal pin of the
ground; three without either. The other ideal joints are constraints. Only a driven guide always has links, as
its way has to be a coordinate. In the tree model all ideal joints are links, which is possible where they
close no loop. Bodies are found breadth first from the ground, then from a body of each part that is afloat.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.states import way
from reference_solver.mechanism.data import GROUND, Guide, MechanismData, Pin, Point

Joint = Pin | Guide
Axis = Literal["x", "y", "turn"]
AXES: tuple[Axis, ...] = ("x", "y", "turn")


class Hung(NamedTuple):
    """A body and the joint that hangs it on one that is there before; None for a body that is afloat."""

    body: int
    joint: Joint | None
    before: int


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


def spanning(of: MechanismData, joints: Iterable[Joint]) -> Iterator[Hung]:
    """Yield all bodies in the order in which joints hang them on each other.

    Of a part that is afloat the first is the driven body, or that with the line of a driven guide.
    """
    drive, joints = of.drive, [*joints]
    first = drive.body if drive.guide is None else of.guides[drive.guide].body_i
    placed = list[int]()
    for root in (GROUND, *sorted(range(len(of.bodies)), key=lambda body: body != first)):
        if root in placed:
            continue
        if root != GROUND:
            yield Hung(root, None, GROUND)
        placed.append(root)
        for before in (queue := [root]):
            for joint in joints:
                body = {joint.body_i: joint.body_j, joint.body_j: joint.body_i}.get(before)
                if body is not None and body not in placed:
                    yield Hung(body, joint, before)
                    placed.append(body)
                    queue.append(body)


def ideal_joints(of: MechanismData) -> list[Joint]:
    """Return the joints without clearance, guides included."""
    return [*of.ideal, *of.guides]


def why_no_tree(of: MechanismData) -> str:
    """Return why a mechanism has no model without constraints, nothing if it has one."""
    drive, turns, ideal = of.drive, {GROUND: 0}, ideal_joints(of)
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


def driven_link(of: MechanismData, links: list[Link]) -> int | None:
    """Return the link whose coordinate is the way along a driven guide, or turns a driven body, if any."""
    if of.drive.guide is not None:
        name = of.guides[of.drive.guide].name
        return next((k for k, link in enumerate(links) if (link.name, link.axis) == (name, "x")), None)
    k = next((k for k, link in enumerate(links) if link.body == of.drive.body), -1)
    while k >= 0 and links[k].axis != "turn":
        k = links[k].parent
    return k if k >= 0 else None


def branches_of(
    of: MechanismData, tree: bool, position: FloatArray, velocity: FloatArray
) -> tuple[list[Branch], dict[int, tuple[int, int]]]:
    """Return the branches of a model from a start, (bodies, 3) each; and the branch and link of each body."""
    grown = _Growing(position, velocity)
    for hung in spanning(of, ideal_joints(of) if tree else _carriers(of)):
        grown.add(hung)
    return grown.branches, grown.places


def _carriers(of: MechanismData) -> list[Joint]:
    """Return the joints that are links in the absolute model: one of the ground a body; a driven guide."""
    held = [guide for guide in of.guides if not guide.turns]
    both: list[Joint] = [*held, *of.ideal]
    carriers = {joint.body_j: joint for joint in reversed(both) if joint.body_i == GROUND}
    if of.drive.prescribes and of.drive.guide is not None:
        driven = of.guides[of.drive.guide]
        carriers[driven.body_j] = driven
    return [*carriers.values()]


class _Growing:
    """Branches that grow by one body after the other, from a start (bodies, 3)."""

    def __init__(self, position: FloatArray, velocity: FloatArray) -> None:
        self.branches, self.places = list[Branch](), dict[int, tuple[int, int]]()
        self._position, self._velocity = position, velocity

    def add(self, hung: Hung) -> None:
        """Add a body; on the ground it begins a branch."""
        body, joint, before = hung
        if before == GROUND:
            self.branches.append(Branch())
            self._number, parent, frame = len(self.branches) - 1, -1, Link(-1, "x")
            angle, spin = self._position[body, 2], self._velocity[body, 2]
        else:
            self._number, parent = self.places[before]
            frame = self.branches[self._number].links[parent]
            angle = self._position[body, 2] - (self._position[before, 2] - frame.turned_rad)
            spin = self._velocity[body, 2] - self._velocity[before, 2]
        if joint is None:
            for axis, value, rate in zip(AXES, self._position[body], self._velocity[body], strict=True):
                parent = self._link(Link(parent, axis, body=body if axis == "turn" else None), value, rate)
        elif isinstance(joint, Pin):
            ends = [(joint.body_i, joint.point_i), (joint.body_j, joint.point_j)]
            (_, point), (_, own) = ends if before == joint.body_i else ends[::-1]
            centre = -own[0], -own[1]
            link = Link(parent, "turn", frame.place(point), body=body, centre_m=centre, name=joint.name)
            self._link(link, angle, spin)
        elif before == joint.body_i:
            self._along(joint, parent, frame, angle, spin)
        else:
            self._behind(joint, parent, frame, angle, spin)

    def _along(self, guide: Guide, parent: int, frame: Link, angle: float, spin: float) -> None:
        """Add the body of a guide on what has the line."""
        line, (s, rate) = guide.angle_rad + frame.turned_rad, self._way(guide)
        centre, body, turn = (-guide.point_j[0], -guide.point_j[1]), guide.body_j, angle - line
        sliding = Link(parent, "x", frame.place(guide.point_i), line, name=guide.name)
        if guide.turns:
            carrier = self._link(sliding, s, rate)
            self._link(Link(carrier, "turn", body=body, centre_m=centre, name=guide.name), turn, spin)
        else:
            self._link(replace(sliding, body=body, centre_m=turned(turn, centre), turned_rad=turn), s, rate)

    def _behind(self, guide: Guide, parent: int, frame: Link, angle: float, spin: float) -> None:
        """Add the body that has the line on that of a guide."""
        (s, rate), place, turn = self._way(guide), frame.place(guide.point_j), angle + guide.angle_rad
        if guide.turns:
            parent = self._link(Link(parent, "turn", place, name=guide.name), turn, spin)
            place, turn = (0.0, 0.0), 0.0
        centre = turned(-guide.angle_rad, (-guide.point_i[0], -guide.point_i[1]))
        link = Link(parent, "x", place, turn, guide.body_i, centre, -guide.angle_rad, guide.name)
        self._link(link, -s, -rate)

    def _link(self, link: Link, start: float, rate: float) -> int:
        """Add a link, and return its number."""
        branch = self.branches[self._number]
        branch.links.append(link)
        branch.start.append(float(start))
        branch.rates.append(float(rate))
        if link.body is not None:
            self.places[link.body] = self._number, len(branch.links) - 1
        return len(branch.links) - 1

    def _way(self, guide: Guide) -> tuple[float, float]:
        s, rate = way(guide, self._position[None], self._velocity[None])
        return float(s[0]), float(rate[0])
