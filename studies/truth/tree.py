"""Places in a mechanism as sums over a spanning tree of its joints, and loops closed by Newton's method.

The coordinates u (m,) are the angles of bodies, the gaps of loose pins and the ways along guides. Bodies that
guides keep parallel share one angle. Loose pins are taken into the tree first, so that a gap is a coordinate,
exact to its own round-off. Vectors are complex numbers: from the ground outwards, the centre of a body is

    p = sum over terms of A e^(i f) s,    f an angle or 0, s a way, a gap's component or 1.

Whatever is wanted is a real row y = Re(w p), w a constant. With A w = P - i Q its terms are

    X s,  X = P cos f + Q sin f,  and  X' = Q cos f - P sin f = dX/df:
    dy/df = X' s,  dy/ds = X,  y'' = (dy/du) u'' + sum of (2 f' s' X' - f'^2 s X).

Joints that are left over close loops: rows g(u) = 0. A part of u, as many as rows, depends on the others, z:
with G = dg/du,  G_dep u_dep' = -G_ind z',  and  G_dep u_dep'' = -G_ind z'' - bias.
"""

import cmath
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_solver.mechanism.data import GROUND, Guide, Line, MechanismData, Pin, Point

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: Stands for no coordinate.
NONE = -1
#: Terms by angle (``GROUND``: it is 0) and factor (``NONE``: it is 1).
Vector = dict[tuple[int, int], complex]
#: Kinds of rows that are made of two others, d, and their derivatives: d along a turning line, and |d|.
ALONG, LENGTH = range(2)


class Tree(NamedTuple):
    """Rows in numbers: first ``closing`` ones, then those of vectors d, then from ``acting`` on the others.

    Of the latter the first are x and y of all bodies' centres. ``terms`` (t, 3) has row, angle and way or
    NONE of each turning term, ``turning`` (t, 2) its P and Q; ``links`` (l, 2) row and coordinate of each
    linear one, ``linear`` (l,) its factor. The first ``closing_terms`` and ``closing_links`` belong to
    closing rows. ``constant`` (rows,) is what does not move, ``still`` (rows, m) what of the derivatives does
    not. ``made`` (k, 4) has kind, row, the first of the two rows d and the line's angle of each row that is
    made of others, ``along`` (k, 2) the line's direction in the axes of its body. ``unit`` (m,) is what a
    coordinate is measured by, ``is_gap`` (m,) is 1 for a component of a gap.
    """

    angles: int
    closing: int
    acting: int
    closing_terms: int
    closing_links: int
    terms: IntArray
    turning: FloatArray
    links: IntArray
    linear: FloatArray
    constant: FloatArray
    still: FloatArray
    made: IntArray
    along: FloatArray
    unit: FloatArray
    is_gap: IntArray


class Work(NamedTuple):
    """Room for what is computed at one state, and the choice of independent coordinates.

    ``order`` (m,) has the independent ones first, ``place`` (m,) where in it each stands. ``u`` and ``v``
    (m,) are coordinates and rates, ``turned`` (angles, 2) cosines and sines, ``X`` (t, 2) X and X' of terms,
    ``value`` and ``bias`` (rows,), ``J`` (rows, m) derivatives, ``T`` (m, n) the derivatives of u by z, ``b``
    (m,) what u'' has beside T z'', ``G`` (c, c) the factors of G_dep; ``swaps`` and ``column`` (c,),
    ``pivots`` (c, m) and ``used`` (m,) are room.
    """

    order: IntArray
    place: IntArray
    u: FloatArray
    v: FloatArray
    turned: FloatArray
    X: FloatArray
    value: FloatArray
    bias: FloatArray
    J: FloatArray
    T: FloatArray
    b: FloatArray
    G: FloatArray
    swaps: IntArray
    column: FloatArray
    pivots: FloatArray
    used: IntArray


@dataclass
class Layout:
    """Coordinates and rows of a mechanism while they are put together.

    ``angle`` and ``offset`` (bodies,) say which coordinate a body's angle is, or that it is constant
    (``GROUND``), and what it has beside it. ``gaps`` and ``ways`` have the first coordinate of pins and of
    guides.
    """

    angle: list[int]
    offset: list[float]
    units: list[float]
    size_m: float
    centres: dict[int, Vector] = field(default_factory=dict)
    gaps: dict[str, int] = field(default_factory=dict)
    ways: dict[str, int] = field(default_factory=dict)
    closing: list[tuple[Vector, complex]] = field(default_factory=list)
    free: dict[int, int] = field(default_factory=dict)

    def coordinate(self, unit: float, count: int = 1) -> int:
        """Return the first of new coordinates."""
        self.units += [unit] * count
        return len(self.units) - count

    def turned(self, body: int, by: complex) -> Vector:
        """Return a vector that is constant in the axes of a body."""
        if body == GROUND:
            return {(GROUND, NONE): by}
        return {(self.angle[body], NONE): by * cmath.exp(1j * self.offset[body])}

    def point(self, body: int, point: Point) -> Vector:
        """Return where a point of a body is."""
        if body == GROUND:
            return {(GROUND, NONE): complex(*point)}
        return total(self.centres[body], self.turned(body, complex(*point)))

    def line(self, line: Line) -> tuple[int, complex]:
        """Return the angle with which a line turns, and its direction without that."""
        ((angle, _), along) = next(iter(self.turned(line.body_i, cmath.exp(1j * line.angle_rad)).items()))
        return angle, along

    def gap(self, first: int) -> Vector:
        """Return the vector of two coordinates."""
        return {(GROUND, first): 1.0 + 0j, (GROUND, first + 1): 1j}

    def way(self, guide: Guide, coordinate: int) -> Vector:
        """Return the vector along a guide."""
        angle, along = self.line(guide)
        return {(angle, coordinate): along}


def total(*vectors: Vector) -> Vector:
    """Return the sum of vectors."""
    found: Vector = {}
    for vector in vectors:
        for key, value in vector.items():
            found[key] = found.get(key, 0j) + value
    return found


def times(vector: Vector, factor: float) -> Vector:
    """Return a vector times a factor."""
    return {key: factor * value for key, value in vector.items()}


def bearing_and_pin(pin: Pin) -> tuple[tuple[int, Point], tuple[int, Point]]:
    """Return body and point of a joint's bearing, and of its pin."""
    i, j = (pin.body_i, pin.point_i), (pin.body_j, pin.point_j)
    return (j, i) if pin.bearing_on_j else (i, j)


def layout_of(of: MechanismData, angles: FloatArray) -> Layout:
    """Return coordinates, places and closing rows of a mechanism that starts at such angles (bodies,)."""
    size_m = max((abs(complex(*point)) for point in _points(of)), default=1.0) or 1.0
    layout = Layout(*_angles(of, angles), [], size_m)
    layout.units = [1.0] * (max(layout.angle, default=GROUND) + 1)
    edges = [*of.loose, *_driven(of), *of.ideal, *of.guides, *range(len(of.bodies))]
    chosen, cut = _spanning(edges)
    left = list(chosen)
    while left:
        part = next(part for part in left if any(_is_placed(layout, body) for body in _ends(part)))
        left.remove(part)
        _hang(layout, part)
    for part in cut:
        if isinstance(part, Pin | Guide) and part.name not in layout.ways:
            _close(layout, part, of.drive.guide is not None and part is of.guides[of.drive.guide])
    return layout


def _points(of: MechanismData) -> Iterator[Point]:
    parts: list[Pin | Guide] = [*of.pins, *of.guides]
    for part in parts:
        yield from ((part.point_i,) if part.body_i != GROUND else ())
        yield part.point_j


def _angles(of: MechanismData, angles: FloatArray) -> tuple[list[int], list[float]]:
    """Return which angle each body has, and what beside it: parallel bodies have one together."""
    first = list(range(len(of.bodies)))
    for _ in of.guides:  # until nothing changes
        for guide in of.guides:
            if not guide.turns:
                ends = [GROUND if body == GROUND else first[body] for body in (guide.body_i, guide.body_j)]
                first = [min(ends) if own in ends else own for own in first]
    numbers = {body: k for k, body in enumerate(sorted({own for own in first if own != GROUND}))}
    numbers[GROUND] = GROUND
    beside = [0.0 if own == GROUND else angles[own] for own in first]
    return [numbers[own] for own in first], [float(a - b) for a, b in zip(angles, beside, strict=True)]


def _driven(of: MechanismData) -> list[Guide]:
    return [] if of.drive.guide is None else [of.guides[of.drive.guide]]


Edge = Pin | Guide | int


def _ends(part: Edge) -> tuple[int, int]:
    return (GROUND, part) if isinstance(part, int) else (part.body_i, part.body_j)


def _spanning(edges: Iterable[Edge]) -> tuple[list[Edge], list[Edge]]:
    """Return the edges of a spanning tree, earlier ones first (Kruskal 1956), and the others.

    The last edges are bodies by themselves, which two coordinates of their own place.
    """
    group: dict[int, int] = {}
    chosen, cut = list[Edge](), list[Edge]()
    for part in edges:
        i, j = (group.setdefault(body, body) for body in _ends(part))
        (cut if i == j else chosen).append(part)
        group = {body: i if own == j else own for body, own in group.items()}
    return chosen, cut


def _is_placed(layout: Layout, body: int) -> bool:
    return body == GROUND or body in layout.centres


def _sides(layout: Layout, part: Pin | Guide) -> tuple[tuple[int, Point], tuple[int, Point], Vector]:
    """Return bodies and points of both sides of a joint, and the vector between in new coordinates."""
    i, j = (part.body_i, part.point_i), (part.body_j, part.point_j)
    if isinstance(part, Guide):
        layout.ways[part.name] = layout.coordinate(layout.size_m)
        return i, j, layout.way(part, layout.ways[part.name])
    if part.clearance is None:
        return i, j, {}
    layout.gaps[part.name] = layout.coordinate(part.clearance.radial_clearance_m, 2)
    return *bearing_and_pin(part), layout.gap(layout.gaps[part.name])


def _hang(layout: Layout, part: Edge) -> None:
    """Place the one body of a part that has no place yet."""
    if isinstance(part, int):
        layout.free[part] = layout.coordinate(layout.size_m, 2)
        layout.centres[part] = layout.gap(layout.free[part])
        return
    near, far, between = _sides(layout, part)
    if not _is_placed(layout, near[0]):
        near, far, between = far, near, times(between, -1.0)
    arm = layout.turned(far[0], complex(*far[1]))
    layout.centres[far[0]] = total(layout.point(*near), between, times(arm, -1.0))


def _close(layout: Layout, part: Pin | Guide, is_driven: bool) -> None:
    """Add the rows of a joint that is left over: two, or one across a line that does not turn."""
    if isinstance(part, Guide):
        angle, along = layout.line(part)
        if angle == GROUND and not is_driven:
            i, j = (part.body_i, part.point_i), (part.body_j, part.point_j)
            apart = total(layout.point(*j), times(layout.point(*i), -1.0))
            layout.closing.append((apart, -1j * along.conjugate()))
            return
    near, far, between = _sides(layout, part)
    apart = total(layout.point(*far), times(layout.point(*near), -1.0), times(between, -1.0))
    layout.closing += [(apart, 1.0 + 0j), (apart, -1j)]


#: Rows that are made of others: kind, the vector d, the line's angle and its direction.
Made = tuple[int, Vector, int, complex]


def tree_of(layout: Layout, acting: list[tuple[Vector, complex] | Made]) -> Tree:
    """Return the rows of a layout: closing ones, centres, and then those along which forces act, in order."""
    makes = [row for row in acting if len(row) == 4]
    between = [(d, factor) for _, d, _, _ in makes for factor in (1.0 + 0j, -1j)]
    centres = [(layout.centres[b], factor) for b in range(len(layout.centres)) for factor in (1.0 + 0j, -1j)]
    first, vectors = len(layout.closing), len(layout.closing) + len(between)
    rows = [*layout.closing, *between, *centres, *(row if len(row) == 2 else ({}, 1j) for row in acting)]
    at = vectors + len(centres)
    made = [
        (row[0], at + k, first + 2 * makes.index(row), row[2])
        for k, row in enumerate(acting)
        if len(row) == 4
    ]
    terms, turning, links, linear, ends = list[tuple[int, int, int]](), [], list[tuple[int, int]](), [], []
    m = len(layout.units)
    constant, still = np.zeros(len(rows)), np.zeros((len(rows), m))
    for k, (vector, weight) in enumerate(rows):
        for (angle, way), value in vector.items():
            A = weight * value
            if angle != GROUND and abs(A) > 0.0:
                terms.append((k, angle, way))
                turning.append((A.real, -A.imag))
            elif angle == GROUND and way == NONE:
                constant[k] += A.real
            elif angle == GROUND and A.real != 0.0:
                links.append((k, way))
                linear.append(A.real)
                still[k, way] += A.real
        ends.append((len(terms), len(links)))
    closing_terms, closing_links = ends[first - 1] if first else (0, 0)
    return Tree(
        max(layout.angle, default=GROUND) + 1,
        first,
        vectors,
        closing_terms,
        closing_links,
        np.array(terms, np.int64).reshape(-1, 3),
        np.array(turning, float).reshape(-1, 2),
        np.array(links, np.int64).reshape(-1, 2),
        np.array(linear, float),
        constant,
        still,
        np.array(made, np.int64).reshape(-1, 4),
        np.array([(row[3].real, row[3].imag) for row in makes], float).reshape(-1, 2),
        np.array(layout.units),
        np.array([any(0 <= k - gap <= 1 for gap in layout.gaps.values()) for k in range(m)], np.int64),
    )


def work_of(tree: Tree) -> Work:
    """Return room for a tree, with no choice of independent coordinates yet."""
    (rows, m), c = tree.still.shape, tree.closing
    return Work(
        order=np.arange(m),
        place=np.arange(m),
        u=np.zeros(m),
        v=np.zeros(m),
        turned=np.zeros((tree.angles, 2)),
        X=np.zeros((len(tree.terms), 2)),
        value=np.zeros(rows),
        bias=np.zeros(rows),
        J=np.zeros((rows, m)),
        T=np.zeros((m, m - c)),
        b=np.zeros(m),
        G=np.zeros((c, c)),
        swaps=np.zeros(c, np.int64),
        column=np.zeros(c),
        pivots=np.zeros((c, m)),
        used=np.zeros(m, np.int64),
    )
