"""What the coordinates of a mechanism are: a tree over its joints, and the joints that close loops.

Bodies that guides keep from turning against each other make a group, with one angle; that of the ground has
none. Ground and bodies hang together by a tree of joints: at first guides of the ground that keep a body from
turning, with the way along them as a coordinate, then pins, which need none, those near to the ground before
others, then other guides. What is driven is a coordinate, so that a driven guide comes before all. A part of
the mechanism that only joints with clearance hold floats: the centre of mass of its first body has x and y
for coordinates. Joints that are left over close loops, a pin by two rows and a guide by one. Where one way
along the ground is in such a loop, the row along it gives that way from the others, and it is not integrated.

The mass of a bar in a loop is put on its two ends where its centre of mass is between them (see ``tree``):
one end moves as what it hangs on does, the other as that which the loop leads to.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from reference_solver.mechanism.mechanism import (
    GROUND,
    Mechanism,
    Point,
    PrescribedMotion,
    PrescribedSlide,
    PrescribedSpeed,
    RevoluteJoint,
    SameAngle,
    Slot,
)
from reference_solver.tape import FloatArray

#: A part of a bar's length by which its centre of mass is off its line by rounding.
ROUND_OFF = 1e-15
#: A place in the order of joints that comes after all others.
FAR = 10**9


@dataclass(frozen=True)
class Coordinate:
    """The angle, x or y of a body, or the way along a guide, of the number ``of`` among the constraints."""

    kind: Literal["angle", "x", "y", "way"]
    of: int


@dataclass(frozen=True)
class Hung:
    """A body that hangs on another one by a joint, a number among the constraints; it floats without one."""

    body: int
    on: int = GROUND
    joint: int | None = None


@dataclass(frozen=True)
class Lump:
    """A bar whose mass is on its ends: that by which it hangs, and that at a joint that closes a loop.

    The latter moves as a point of another body does, that of ``through`` on its side i, or j.
    """

    body: int
    on: int
    joint: int
    closing: int
    through: int
    by_i: bool


@dataclass(frozen=True)
class Structure:
    """The coordinates of a mechanism, its tree in the order from the ground on, and what closes loops.

    ``groups`` has for every body the one whose angle it has, GROUND for none; ``aligned`` says that it has
    that angle itself. ``explicit`` has the ways that follow from a loop, with the pins that close these.
    ``driven`` is the coordinate whose motion is prescribed, by the constraint ``driver``.
    """

    coordinates: tuple[Coordinate, ...]
    groups: tuple[int, ...]
    aligned: tuple[bool, ...]
    hung: tuple[Hung, ...]
    closing: tuple[int, ...]
    lumps: tuple[Lump, ...]
    explicit: tuple[tuple[int, int], ...]
    rows: int
    driven: int | None
    driver: int | None

    @property
    def freedoms(self) -> int:
        """Number of coordinates whose motion nothing prescribes."""
        return len(self.coordinates) - self.rows - (self.driven is not None)

    @property
    def carried(self) -> tuple[int, ...]:
        """Coordinates that are integrated: all but the driven one, and those that follow from loops."""
        given = {self.driven, *(k for k, _ in self.explicit)}
        return tuple(k for k in range(len(self.coordinates)) if k not in given)

    @cached_property
    def numbers(self) -> dict[Coordinate, int]:
        """The numbers of the coordinates."""
        return {coordinate: k for k, coordinate in enumerate(self.coordinates)}


def structure_of(mechanism: Mechanism, q: FloatArray) -> Structure:
    """Return the structure of a mechanism in numbers with coordinates q (3b,) at the start."""
    constraints, bodies = mechanism.constraints, range(len(mechanism.bodies))
    groups = _groups(mechanism)
    starts = [0.0 if group == GROUND else float(q[3 * group + 2]) for group in groups]
    aligned = tuple(bool(q[3 * body + 2] == start) for body, start in zip(bodies, starts, strict=True))
    driver = next((k for k, c in enumerate(constraints) if isinstance(c, DRIVERS)), None)
    of = None if driver is None else constraints[driver]
    guide = _guide_of(mechanism, of) if isinstance(of, PrescribedSlide) else None
    hung, closing = _hang(mechanism, groups, guide)
    coordinates = [Coordinate("angle", body) for body in bodies if groups[body] == body]
    for part in hung:
        if part.joint is None:
            coordinates += [Coordinate("x", part.body), Coordinate("y", part.body)]
        elif isinstance(constraints[part.joint], Slot):
            coordinates.append(Coordinate("way", part.joint))
    driven = None
    if guide is not None:
        driven = coordinates.index(Coordinate("way", guide))
    elif isinstance(of, PrescribedSpeed | PrescribedMotion):
        driven = coordinates.index(Coordinate("angle", groups[of.body]))
    ways = {
        coordinates.index(Coordinate("way", way)): k for k, way in _explicit(mechanism, groups, hung, closing)
    }
    return Structure(
        coordinates=tuple(coordinates),
        groups=groups,
        aligned=aligned,
        hung=hung,
        closing=closing,
        lumps=tuple(_lumps(mechanism, hung, closing)),
        explicit=tuple((way, k) for way, k in ways.items() if way != driven),
        rows=sum(2 if isinstance(constraints[k], RevoluteJoint) else 1 for k in closing),
        driven=driven,
        driver=driver,
    )


#: Constraints that prescribe a motion.
DRIVERS = (PrescribedSpeed, PrescribedMotion, PrescribedSlide)


def _groups(mechanism: Mechanism) -> tuple[int, ...]:
    """Return for every body the first one that has its angle, GROUND where it has none."""
    groups = list(range(len(mechanism.bodies)))
    for c in mechanism.constraints:
        if isinstance(c, SameAngle):
            i, j = (GROUND if body == GROUND else groups[body] for body in (c.body_i, c.body_j))
            groups = [min(i, j) if group in (i, j) else group for group in groups]
    return tuple(groups)


def _guide_of(mechanism: Mechanism, driver: PrescribedSlide) -> int:
    """Return the number of the guide along which a motion is prescribed."""

    def line(of: Slot | PrescribedSlide) -> tuple[object, ...]:
        return of.body_i, of.point_i, of.body_j, of.point_j, of.angle_rad

    lines = enumerate(mechanism.constraints)
    return next(k for k, c in lines if isinstance(c, Slot) and line(c) == line(driver))


def _hang(
    mechanism: Mechanism, groups: tuple[int, ...], driven_guide: int | None
) -> tuple[tuple[Hung, ...], tuple[int, ...]]:
    """Return the bodies as they hang on the ground and on each other, and the joints that close loops."""
    left = {k: c for k, c in enumerate(mechanism.constraints) if isinstance(c, RevoluteJoint | Slot)}
    far = _distances(mechanism, [c for c in left.values() if isinstance(c, RevoluteJoint)])

    def order(k: int) -> tuple[int, int, int]:
        joint = left[k]
        away = far.get(joint.body_i, FAR) + far.get(joint.body_j, FAR)
        if isinstance(joint, RevoluteJoint):
            return 2, away, k
        still = joint.body_i == GROUND and joint.body_j != GROUND and groups[joint.body_j] == GROUND
        return 0 if k == driven_guide else 1 if still else 3, away, k

    hung, known = list[Hung](), {GROUND}
    while len(known) <= len(mechanism.bodies):
        leading = [k for k, joint in left.items() if (joint.body_i in known) != (joint.body_j in known)]
        if leading:
            joint = left[k := min(leading, key=order)]
            ends = joint.body_i, joint.body_j
            body, on = ends if ends[1] in known else ends[::-1]
            hung.append(Hung(body, on, k))
            del left[k]
        else:
            body = min({*range(len(mechanism.bodies))} - known)
            hung.append(Hung(body))
        known.add(body)
    return tuple(hung), tuple(left)


def _distances(mechanism: Mechanism, pins: list[RevoluteJoint]) -> dict[int, int]:
    """Return how many pins bodies are from the ground, without those that no pins lead to."""
    far, edge = {GROUND: 0}, {GROUND}
    for distance in range(1, len(mechanism.bodies) + 1):
        ends = [(pin.body_i, pin.body_j) for pin in pins]
        edge = {b for i, j in ends for a, b in ((i, j), (j, i)) if a in edge and b not in far}
        far |= dict.fromkeys(edge, distance)
    return far


def _explicit(
    mechanism: Mechanism, groups: tuple[int, ...], hung: tuple[Hung, ...], closing: tuple[int, ...]
) -> Iterator[tuple[int, int]]:
    """Yield the pins that close loops with one way along the ground, and the guides of these ways."""
    ways: dict[int, set[int | None]] = {GROUND: set()}
    for part in hung:
        link = None if part.joint is None else mechanism.constraints[part.joint]
        ways[part.body] = set(ways[part.on])
        if link is None:  # it floats
            ways[part.body] = {None, -1 - part.body}
        elif isinstance(link, Slot) and (link.body_i == GROUND or groups[link.body_i] == GROUND):
            ways[part.body].add(part.joint)
    for k in closing:
        pin = mechanism.constraints[k]
        if isinstance(pin, RevoluteJoint) and len(own := ways[pin.body_i] ^ ways[pin.body_j]) == 1:
            (way,) = own
            if way is not None and way >= 0:
                yield k, way


def _lumps(mechanism: Mechanism, hung: tuple[Hung, ...], closing: tuple[int, ...]) -> Iterator[Lump]:
    """Yield the bars whose mass goes on their ends: nearer to the ground than they are themselves."""
    depth = {GROUND: 0}
    pins = [(k, c) for k in closing if isinstance(c := mechanism.constraints[k], RevoluteJoint)]
    for part in hung:
        depth[part.body] = depth[part.on] + 1
    for part in hung:
        link = None if part.joint is None else mechanism.constraints[part.joint]
        if part.joint is None or not isinstance(link, RevoluteJoint):
            continue
        here = link.point_j if link.body_j == part.body else link.point_i
        for k, pin in pins:
            sides = _sides(pin, part.body)
            if sides is None or not _between(here, sides[0]):
                continue
            _, body, point, by_i = sides
            ways = [(depth[body], k, by_i)]
            for other, more in pins:
                if other != k and (beyond := _sides(more, body)) is not None and beyond[0] == point:
                    ways.append((depth[beyond[1]], other, beyond[3]))
            nearest, through, side = min(ways)
            if nearest < depth[part.body]:
                yield Lump(part.body, part.on, part.joint, k, through, side)
                break


def _sides(pin: RevoluteJoint, body: int) -> tuple[Point, int, Point, bool] | None:
    """Return a body's point at a pin, and the other body, its point, and whether that is body i."""
    if pin.body_j == body:
        return pin.point_j, pin.body_i, pin.point_i, True
    return (pin.point_i, pin.body_j, pin.point_j, False) if pin.body_i == body else None


def _between(one: Point, other: Point) -> bool:
    """Return whether the centre of mass is on the line through two points, which are apart."""
    across = one[0] * other[1] - one[1] * other[0]
    size = max(abs(x) for x in (*one, *other))
    return one != other and abs(across) <= ROUND_OFF * size * size
