"""A mechanism as a tree: what leads to its points, its masses put together, and the rows that close loops.

A place is a sum of vectors that turn with frames, the ground or groups of bodies at angles w_f:

    p = sum of u_p R_p a_p,   R_p = [cos w_f, -sin w_f; sin w_f, cos w_f],   f the frame of p

where a_p is constant and u_p is 1, a bar's arm, or a coordinate, the way along a guide or a translation. Of
one frame and one coordinate all vectors are one: (f, coordinate) is an ``Element``. With J the turn by 90
degrees and delta = w_g - w_f, for elements p and q in frames f and g,

    (R_p a).(R_q b) = (a.b) cos(delta) - (a x b) sin(delta) = G,    (R_p a).(J R_q b) = dG/d delta

so that of the bodies' masses only sums of m a.b and m a x b are left for all pairs of elements. In the same
way the component of R_q b along a direction n of frame f is (n.b) cos(delta) + (b x n) sin(delta).

A bar of a loop has a part rho of its mass m on one end, and the rest on the other, where its centre of mass
is on the line between them, of the length l. Since v_1.v_2 = (v_1^2 + v_2^2 - l^2 w^2)/2 of its ends,

    m v^2 = (1 - rho) m v_1^2 + rho m v_2^2 - rho (1 - rho) m l^2 w^2

so that the bar's own angle is left in its inertia alone: products of angles' rates vanish with it.

The numbers of a tree are numbers, or a tape's values.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from engine_models.mechanics.equations.structure import Coordinate, Lump, Structure
from reference_solver.mechanism.mechanism import (
    GROUND,
    Ends,
    Mechanism,
    PrescribedMotion,
    PrescribedSlide,
    PrescribedSpeed,
    RevoluteJoint,
    Slot,
)
from reference_solver.mechanism.motions import MOTIONS
from reference_solver.mechanism.points import State, ends_of
from reference_solver.tape import Array, Scalar, cos, sin

#: A vector in the plane.
Vector = tuple[Scalar, Scalar]
#: A frame, the number of a group's angle or GROUND, and the coordinate that is its factor, None for 1.
Element = tuple[int, int | None]
#: Elements with their constant vectors.
Terms = dict[Element, Vector]
#: Components of a direction that are no more than the round-off of its angle.
ROUND_OFF = 2e-16


@dataclass(frozen=True)
class Row:
    """What closes a loop: the sum of the terms has no component along a constant direction of a frame."""

    frame: int
    along: Vector
    terms: Terms


class Tree:
    """A mechanism with coordinates q_start (3b,) at the start, by its structure."""

    def __init__(self, structure: Structure, mechanism: Mechanism, q_start: Array) -> None:
        self.structure, self.mechanism, self._q_start = structure, mechanism, q_start
        self.angle_of = [
            GROUND if group == GROUND else structure.numbers[Coordinate("angle", group)]
            for group in structure.groups
        ]
        #: What leads to the bodies' centres of mass.
        self.centres: dict[int, Terms] = {GROUND: {}}
        for part in structure.hung:
            self.centres[part.body] = self._centre(part.body, part.on, part.joint)
        #: What moves a body's centre of mass, with the parts that are at these places.
        self.carried: dict[int, list[tuple[Scalar, Terms]]] = {
            body: [(1.0, self.centres[body])] for body in range(len(mechanism.bodies))
        }
        #: What a body's inertia has less than its own for every unit of its mass.
        self._spread = dict[int, Scalar]()
        for lump in structure.lumps:
            self._put_on_ends(lump)

    def offset(self, body: int) -> Scalar:
        """Return the angle of a body in its frame, in rad."""
        if self.structure.aligned[body]:
            return 0.0
        group = self.structure.groups[body]
        start = 0.0 if group == GROUND else self._q_start[3 * group + 2]
        return self._q_start[3 * body + 2] - start

    def frame(self, body: int) -> int:
        """Return the frame of a body or of the ground."""
        return GROUND if body == GROUND else self.angle_of[body]

    def point(self, body: int, place: Vector) -> Terms:
        """Return what leads to a point given in the axes of its body."""
        return _sum(self.centres[body], self._own(body, place))

    def gap(self, ends: Ends) -> Terms:
        """Return what leads from the point of body i to that of body j."""
        return _sum(self.point(ends.body_j, ends.point_j), self.point(ends.body_i, ends.point_i), -1.0)

    @cached_property
    def masses(self) -> dict[tuple[Element, Element], Vector]:
        """The sums of m a.b and -m a x b of all pairs of elements that move a centre of mass together."""
        sums = dict[tuple[Element, Element], Vector]()
        lumps = [
            (body.mass_kg * share, terms)
            for number, body in enumerate(self.mechanism.bodies)
            for share, terms in self.carried[number]
        ]
        for mass, terms in lumps:
            moved = [(p, a) for p, a in terms.items() if p != (GROUND, None)]
            for k, (p, a) in enumerate(moved):
                for q, b in moved[k:]:
                    pair, (a1, b1) = ((p, q), (a, b)) if _key(p) <= _key(q) else ((q, p), (b, a))
                    old = sums.get(pair, (0.0, 0.0))
                    across = 0.0 if p == q else a1[1] * b1[0] - a1[0] * b1[1]
                    products = a1[0] * b1[0] + a1[1] * b1[1], across
                    sums[pair] = old[0] + mass * products[0], old[1] + mass * products[1]
        return sums

    @cached_property
    def inertias(self) -> dict[int, Scalar]:
        """The sums of the inertias that turn with an angle, by its number."""
        sums = dict[int, Scalar]()
        for body, part in enumerate(self.mechanism.bodies):
            if (angle := self.angle_of[body]) != GROUND:
                own = part.inertia_kg_m2 - part.mass_kg * self._spread.get(body, 0.0)
                sums[angle] = sums.get(angle, 0.0) + own
        return sums

    @cached_property
    def rows(self) -> list[Row]:
        """The rows of the joints that close loops, in parts of the longest arm of each."""
        rows = list[Row]()
        for k in self.structure.closing:
            joint = self.mechanism.constraints[k]
            assert isinstance(joint, RevoluteJoint | Slot)
            terms = _scaled(gap := self.gap(joint))
            if isinstance(joint, Slot):
                x, y = self._direction(joint)
                rows.append(Row(self.frame(joint.body_i), (-y, x), terms))
                continue
            (x, y), guided = (1.0, 0.0), terms
            for way, pin in self.structure.explicit:
                if pin == k:  # along the way, and across it, where it does not occur
                    p = GROUND, way
                    (x, y), guided = gap[p], {q: a for q, a in terms.items() if q != p}
            rows += [Row(GROUND, (x, y), terms), Row(GROUND, (-y, x), guided)]
        return rows

    @cached_property
    def explicit(self) -> dict[int, int]:
        """The numbers of the rows that give ways, by those of the ways."""
        first, found = 0, dict[int, int]()
        for k in self.structure.closing:
            found |= {way: first for way, pin in self.structure.explicit if pin == k}
            first += 1 if isinstance(self.mechanism.constraints[k], Slot) else 2
        return found

    def coordinates(self, q: Array, v: Array) -> tuple[list[Scalar], list[Scalar]]:
        """Return the coordinates and their rates, m each, at q and q' (3b,) of the bodies."""
        state, u, rates = State(q, v), list[Scalar](), list[Scalar]()
        for coordinate in self.structure.coordinates:
            if coordinate.kind == "way":
                way, rate = self._way(coordinate.of, state)
            else:
                place = 3 * coordinate.of + ("x", "y", "angle").index(coordinate.kind)
                way, rate = q[place], v[place]
            u.append(way)
            rates.append(rate)
        return u, rates

    def driven(self, t: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """Return the driven coordinate, its speed and its acceleration at a time since the start."""
        driver, k = self.structure.driver, self.structure.driven
        assert driver is not None
        assert k is not None
        law = self.mechanism.constraints[driver]
        start = self.coordinates(self._q_start, np.zeros(len(self._q_start)))[0][k]
        if isinstance(law, PrescribedSpeed):
            return start + law.speed_rad_s * t, law.speed_rad_s, 0.0
        assert isinstance(law, PrescribedMotion | PrescribedSlide)
        moved, speed, acceleration = MOTIONS[type(law.motion)](law.motion, t)
        return start + moved, speed, acceleration

    # s = e.d, d = p_j - p_i, e' = phi_i' J e: s' = e.d' + phi_i' (J e).d
    def _way(self, joint: int, state: State) -> tuple[Scalar, Scalar]:
        line = self.mechanism.constraints[joint]
        assert isinstance(line, Slot | PrescribedSlide)
        i, j = ends_of(line, state)
        e = state.direction(line.body_i, line.angle_rad)
        d, d_dot = j.place - i.place, j.rate - i.rate
        return e @ d, e @ d_dot + i.spin * (e[0] * d[1] - e[1] * d[0])

    def _centre(self, body: int, on: int, joint: int | None) -> Terms:
        """Return what leads to the centre of mass of a body that hangs on another one by a joint."""
        numbers = self.structure.numbers
        if joint is None:
            x, y = (numbers[Coordinate(kind, body)] for kind in ("x", "y"))
            return {(GROUND, x): (1.0, 0.0), (GROUND, y): (0.0, 1.0)}
        link = self.mechanism.constraints[joint]
        assert isinstance(link, RevoluteJoint | Slot)
        from_i = link.body_i == on
        there, own = (link.point_i, link.point_j) if from_i else (link.point_j, link.point_i)
        way: Terms = {}
        if isinstance(link, Slot):
            way = {(self.frame(link.body_i), numbers[Coordinate("way", joint)]): self._direction(link)}
        place = _sum(self.point(on, there), way, 1.0 if from_i else -1.0)
        return _sum(place, self._own(body, own), -1.0)

    def _put_on_ends(self, lump: Lump) -> None:
        """Put a bar's mass on its ends."""
        links = (self.mechanism.constraints[k] for k in (lump.joint, lump.closing, lump.through))
        joint, closing, through = (link for link in links if isinstance(link, RevoluteJoint))
        (there, one), (_, two) = (
            (link.point_i, link.point_j) if link.body_j == lump.body else (link.point_j, link.point_i)
            for link in (joint, closing)
        )
        if lump.by_i:
            far = self.point(through.body_i, through.point_i)
        else:
            far = self.point(through.body_j, through.point_j)
        x, y = two[0] - one[0], two[1] - one[1]
        square = x * x + y * y
        part = -(one[0] * x + one[1] * y) / square
        self.carried[lump.body] = [(1.0 - part, self.point(lump.on, there)), (part, far)]
        self._spread[lump.body] = part * (1.0 - part) * square

    def _own(self, body: int, place: Vector) -> Terms:
        """Return what leads from a body's centre of mass to a point of it."""
        return {(self.frame(body), None): self._turned(body, place)}

    def _direction(self, line: Slot) -> Vector:
        """Return the direction of a guide in the frame that it turns with."""
        x, y = _rounded(cos(line.angle_rad)), _rounded(sin(line.angle_rad))
        return self._turned(line.body_i, (x, y))

    def _turned(self, body: int, vector: Vector) -> Vector:
        """Return a vector in the axes of a body in those of its frame."""
        if body == GROUND or self.structure.aligned[body]:
            return vector
        (x, y), offset = vector, self.offset(body)
        c, s = cos(offset), sin(offset)
        return c * x - s * y, s * x + c * y


def _rounded(x: Scalar) -> Scalar:
    return 0.0 if is_number(x) and abs(x) <= ROUND_OFF else x


def is_number(x: Scalar) -> bool:
    """Return whether x is a number, and neither a tape's value nor an array."""
    return isinstance(x, float | int)


def _scaled(terms: Terms) -> Terms:
    """Return terms in parts of the longest arm, where these are numbers: an arm along an axis is a 1 then."""
    arms = [a for (frame, way), a in terms.items() if way is None and frame != GROUND]
    if not all(is_number(x) for a in arms for x in a):
        return terms
    longest = max((math.hypot(*a) for a in arms), default=1.0) or 1.0
    return {element: (x / longest, y / longest) for element, (x, y) in terms.items()}


def _key(element: Element) -> tuple[int, int]:
    """Return an element's place in an order."""
    frame, way = element
    return frame, GROUND if way is None else way


def _sum(one: Mapping[Element, Vector], other: Mapping[Element, Vector], sign: float = 1.0) -> Terms:
    """Return the sum of terms, or the difference, without what is zero."""
    total = dict(one)
    for element, (x, y) in other.items():
        a, b = total.pop(element, (0.0, 0.0))
        new = a + sign * x, b + sign * y
        if not all(is_number(part) and part == 0.0 for part in new):
            total[element] = new
    return total
