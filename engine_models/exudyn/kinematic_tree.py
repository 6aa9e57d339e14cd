"""The coordinates that Exudyn solves for, as links: of single bodies, and of bodies that ideal joints hold.

A link moves or turns its frame against that of its parent. In the absolute model every body has a branch of
its own: one coordinate on a guide of the ground that keeps its angle, or else about an ideal pin of the
ground; three without either. The other ideal joints are constraints. Only a driven guide always has links, as
its way has to be a coordinate. In the tree model all ideal joints are links, which is possible where they
close no loop. Its bodies are found breadth first from the ground, then from a body of each part that is
afloat.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.states import way
from reference_solver.mechanism.data import GROUND, Guide, MechanismData, Pin, Point

Joint = Pin | Guide
Kind = Literal["rotor", "mass", "free", "tree"]
Axis = Literal["x", "y", "turn"]
AXES: tuple[Axis, ...] = ("x", "y", "turn")
#: Position, velocity, acceleration of all bodies, each (n, bodies, 3) as in ``Trajectory``.
States = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Link:
    """One link: its coordinate moves its frame along x or y, or turns it, against its parent, -1 the ground.

    ``offset_m`` is its place in the parent's frame, ``angle_rad`` its angle there at coordinate 0. ``body``
    is None for a link without mass; ``centre_m`` is where the body's centre of mass is in the link's frame
    and ``turned_rad`` the angle of the body's x axis there. ``name`` is that of the joint that the coordinate
    belongs to, if any.
    """

    parent: int
    joint: Axis
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


@dataclass(frozen=True)
class Branch:
    """The links of one node, with their coordinates and rates at the start, each (links,).

    A "rotor" is one link that turns, a "mass" one that slides, both on the ground; what is "free" has x, y
    and its angle; all else is a "tree".
    """

    kind: Kind
    links: tuple[Link, ...]
    start: FloatArray
    rates: FloatArray


def turned(angle_rad: float, point: Point) -> Point:
    """Return a point turned about the origin."""
    (x, y), cos, sin = point, float(np.cos(angle_rad)), float(np.sin(angle_rad))
    return x * cos - y * sin, x * sin + y * cos


def up(links: tuple[Link, ...], link: int) -> Iterator[int]:
    """Yield a link and those that carry it, up to the ground."""
    while link >= 0:
        yield link
        link = links[link].parent


def driven_link(of: MechanismData, links: tuple[Link, ...]) -> int | None:
    """Return the link whose coordinate is the way along a driven guide, or turns a driven body, if any."""
    if of.drive.guide is not None:
        name = of.guides[of.drive.guide].name
        return next((k for k, link in enumerate(links) if link.name == name and link.joint == "x"), None)
    own = next((k for k, link in enumerate(links) if link.body == of.drive.body), -1)
    return next((k for k in up(links, own) if links[k].joint == "turn"), None)


def absolute_branches(of: MechanismData, position: FloatArray, velocity: FloatArray) -> tuple[Branch, ...]:
    """Return the branches of the absolute model from a start, (bodies, 3) each."""
    branches, carriers, grown = list[Branch](), _carriers(of), _Growing(position, velocity)
    along = of.drive.guide if of.drive.prescribes else None
    if along is not None and carriers.get(of.guides[along].body_j) is not of.guides[along]:
        below = of.guides[along].body_i
        if below in carriers:
            grown.hang(carriers[below], GROUND)
        elif below != GROUND:
            grown.afloat(below)
        grown.hang(of.guides[along], below)
        branches.append(grown.branch("tree"))
    others = [body for body in range(len(of.bodies)) if body not in grown.numbers]
    return (*branches, *(_single(body, carriers.get(body), position, velocity) for body in others))


def _single(body: int, carrier: Joint | None, position: FloatArray, velocity: FloatArray) -> Branch:
    """Return the branch of a body alone, by a joint of the ground or by its own coordinates."""
    grown = _Growing(position, velocity)
    if carrier is None:
        grown.afloat(body)
        return grown.branch("free")
    grown.hang(carrier, GROUND)
    return grown.branch("mass" if isinstance(carrier, Guide) else "rotor")


def _carriers(of: MechanismData) -> dict[int, Joint]:
    """Return the joint of the ground by which a body has one coordinate, of all bodies that have one."""
    held = [guide for guide in of.guides if not guide.turns]
    both: list[Joint] = [*held, *of.ideal]
    joints = [joint for joint in both if joint.body_i == GROUND]
    return {joint.body_j: joint for joint in reversed(joints)}


def tree_branches(of: MechanismData, position: FloatArray, velocity: FloatArray) -> tuple[Branch, ...]:
    """Return the branches of the tree model: one tree, and the bodies that no other body and no pin holds."""
    alone, grown = _alone(of), _Growing(position, velocity)
    for joint, body in spanning(of):
        if joint is None and body not in alone:
            grown.afloat(body)
        elif joint is not None and joint.body_j not in alone:
            grown.hang(joint, body)
    tree = [grown.branch("tree")] if grown.links else []
    return (*tree, *(_single(body, guide, position, velocity) for body, guide in alone.items()))


def _ideal(of: MechanismData) -> list[Joint]:
    return [*of.ideal, *of.guides]


def _alone(of: MechanismData) -> dict[int, Guide | None]:
    """Return the bodies that have one ideal joint at most, a guide of the ground that keeps their angle."""
    found, joints = dict[int, Guide | None](), _ideal(of)
    for body in range(len(of.bodies)):
        own = [joint for joint in joints if body in (joint.body_i, joint.body_j)]
        if not own:
            found[body] = None
        elif len(own) == 1 and isinstance(own[0], Guide) and own[0].body_i == GROUND and not own[0].turns:
            found[body] = own[0]
    return found


def spanning(of: MechanismData) -> list[tuple[Joint | None, int]]:
    """Return the ideal joints that hang one body on another, in order, each with what is there before.

    None stands for a body that is afloat: the driven one of its part, else the first.
    """
    joints, order = _ideal(of), list[tuple[Joint | None, int]]()
    first = sorted(range(len(of.bodies)), key=lambda body: body != of.drive.body)
    placed = list[int]()
    for root in (GROUND, *first):
        if root in placed:
            continue
        if root != GROUND:
            order.append((None, root))
        placed.append(root)
        for body in (queue := [root]):
            for joint in joints:
                other = {joint.body_i: joint.body_j, joint.body_j: joint.body_i}.get(body)
                if other is not None and other not in placed:
                    order.append((joint, body))
                    placed.append(other)
                    queue.append(other)
    return order


def closes_a_loop(of: MechanismData) -> bool:
    """Return whether ideal joints are more than hang bodies on each other."""
    return len(of.ideal) + len(of.guides) > sum(joint is not None for joint, _ in spanning(of))


def turns_above(of: MechanismData, body: int) -> int:
    """Return how many coordinates of a tree add up to the angle of a body."""
    above = {GROUND: 0}
    for joint, before in spanning(of):
        if joint is None:
            above[before] = 1
        else:
            new = joint.body_i if before == joint.body_j else joint.body_j
            above[new] = above[before] + (isinstance(joint, Pin) or joint.turns)
    return above[body]


@dataclass
class _Growing:
    """Links that are added one after the other, from a start (bodies, 3)."""

    position: FloatArray
    velocity: FloatArray
    links: list[Link] = field(default_factory=list)
    start: list[float] = field(default_factory=list)
    rates: list[float] = field(default_factory=list)
    numbers: dict[int, int] = field(default_factory=dict)

    def branch(self, kind: Kind) -> Branch:
        """Return what has grown."""
        return Branch(kind, tuple(self.links), np.array(self.start), np.array(self.rates))

    def afloat(self, body: int) -> None:
        """Add a body by its own coordinates."""
        parent = -1
        for axis, joint in enumerate(AXES):
            link = Link(parent, joint, body=body if joint == "turn" else None)
            parent = self._add(link, self.position[body, axis], self.velocity[body, axis])

    def hang(self, joint: Joint, before: int) -> None:
        """Add the body that a joint holds on one that is there before, or on the ground."""
        if isinstance(joint, Pin):
            self._by_pin(joint, before)
        elif before == joint.body_i:
            self._along(joint)
        else:
            self._behind(joint)

    def _by_pin(self, pin: Pin, before: int) -> None:
        ends = [(pin.body_i, pin.point_i), (pin.body_j, pin.point_j)]
        (_, point), (body, own) = ends if before == pin.body_i else ends[::-1]
        link = Link(self._number(before), "turn", self._place(before, point), name=pin.name)
        self._add(replace(link, body=body, centre_m=(-own[0], -own[1])), *self._apart(body, before))

    def _along(self, guide: Guide) -> None:
        """Add the body of a guide on what has the line."""
        i, j, angle = guide.body_i, guide.body_j, guide.angle_rad + self._turned(guide.body_i)
        (s, rate), (turn, spin) = self._way(guide), self._apart(j, i)
        turn, centre = turn - angle, (-guide.point_j[0], -guide.point_j[1])
        sliding = Link(self._number(i), "x", self._place(i, guide.point_i), angle, name=guide.name)
        if guide.turns:
            parent = self._add(sliding, s, rate)
            self._add(Link(parent, "turn", body=j, centre_m=centre, name=guide.name), turn, spin)
        else:
            self._add(replace(sliding, body=j, centre_m=turned(turn, centre), turned_rad=turn), s, rate)

    def _behind(self, guide: Guide) -> None:
        """Add the body that has the line on that of a guide."""
        i, j, (s, rate) = guide.body_i, guide.body_j, self._way(guide)
        parent, place, (turn, spin) = self._number(j), self._place(j, guide.point_j), self._apart(i, j)
        turn += guide.angle_rad
        if guide.turns:
            parent = self._add(Link(parent, "turn", place, name=guide.name), turn, spin)
            place, turn = (0.0, 0.0), 0.0
        centre = turned(-guide.angle_rad, (-guide.point_i[0], -guide.point_i[1]))
        self._add(Link(parent, "x", place, turn, i, centre, -guide.angle_rad, guide.name), -s, -rate)

    def _add(self, link: Link, start: float, rate: float) -> int:
        """Add a link, and return its number."""
        self.links.append(link)
        self.start.append(float(start))
        self.rates.append(float(rate))
        if link.body is not None:
            self.numbers[link.body] = len(self.links) - 1
        return len(self.links) - 1

    def _number(self, body: int) -> int:
        return self.numbers.get(body, -1)

    def _turned(self, body: int) -> float:
        return 0.0 if body == GROUND else self.links[self.numbers[body]].turned_rad

    def _place(self, body: int, point: Point) -> Point:
        return point if body == GROUND else self.links[self.numbers[body]].place(point)

    def _apart(self, body: int, before: int) -> tuple[float, float]:
        """Return the angle of a body against the frame of another's link, and its rate."""
        angle, spin = self.position[body, 2], self.velocity[body, 2]
        if before == GROUND:
            return angle, spin
        return angle - (self.position[before, 2] - self._turned(before)), spin - self.velocity[before, 2]

    def _way(self, guide: Guide) -> tuple[float, float]:
        s, rate = way(guide, self.position[None], self.velocity[None])
        return float(s[0]), float(rate[0])


def tree_states(
    links: tuple[Link, ...], q: FloatArray, v: FloatArray, a: FloatArray
) -> Iterator[tuple[int, States]]:
    """Yield each body with its position, velocity and acceleration (n, 3) from those of links (n, links)."""
    frames: list[FloatArray] = []  # (3, n, 3): position, velocity, acceleration of origin and angle
    for k, link in enumerate(links):
        frame = np.zeros((3, len(q), 3))
        if link.parent >= 0:
            frame += frames[link.parent]
        frame[:, :, :2] += _turned_along(link.offset_m, frame)
        frame[0, :, 2] += link.angle_rad
        moving = np.stack([q[:, k], v[:, k], a[:, k]])
        if link.joint == "turn":
            frame[:, :, 2] += moving
        else:
            frame[:, :, :2] += _moved_along(link.joint, moving, frame)
        frames.append(frame)
        if link.body is not None:
            centre = frame.copy()
            centre[:, :, :2] += _turned_along(link.centre_m, frame)
            centre[0, :, 2] += link.turned_rad
            yield link.body, (centre[0], centre[1], centre[2])


def _axes(frame: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the unit vectors (n, 2) along x and y of a frame."""
    cos, sin = np.cos(frame[0, :, 2]), np.sin(frame[0, :, 2])
    return np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)


def _turned_along(point: Point, frame: FloatArray) -> FloatArray:
    """Return the vector to a point of a frame with its two derivatives, (3, n, 2)."""
    x, y = _axes(frame)
    _, rate, acceleration = frame[:, :, 2, None]
    out = point[0] * np.stack([x, rate * y, acceleration * y - rate**2 * x])
    if point[1]:
        out += point[1] * np.stack([y, -rate * x, -acceleration * x - rate**2 * y])
    return np.asarray(out)


def _moved_along(joint: str, moving: FloatArray, frame: FloatArray) -> FloatArray:
    """Return the vector of a way (3, n) with its derivatives along an axis of a frame, (3, n, 2)."""
    x, y = _axes(frame)
    along, across = (x, y) if joint == "x" else (y, -x)
    s, v, a = moving[:, :, None]
    _, rate, acceleration = frame[:, :, 2, None]
    slid = a * along + 2 * v * rate * across + s * (acceleration * across - rate**2 * along)
    return np.stack([s * along, v * along + s * rate * across, slid])
