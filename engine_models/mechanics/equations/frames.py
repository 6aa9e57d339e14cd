"""A tree at coordinates: directions of its frames, places, what coordinates move, and the loops' rows."""

from collections.abc import Mapping
from functools import cached_property

from engine_models.mechanics.equations.tree import Row, Terms, Tree, Vector, is_number
from reference_solver.mechanism.mechanism import GROUND
from reference_solver.tape import Scalar, cos, sin


class ByCoordinate(dict[int, Scalar]):
    """Values by the numbers of coordinates, 0 of those that have none."""

    def __missing__(self, _: int) -> Scalar:
        """Return what has none."""
        return 0.0


class Frames:
    """A tree at coordinates u by their numbers: numbers themselves, or a tape's values.

    Those that follow from loops are computed, exactly, as their rows are linear in them.

    If angles are ``subtracted``, the cosine of a difference is that, and no sum of products: a Taylor series
    of both cosine and sine takes two convolutions for four. Of an angle that is driven, most often the sine
    alone occurs, which products give at less.
    """

    def __init__(self, tree: Tree, u: Mapping[int, Scalar], subtracted: bool = False) -> None:
        self.tree, self._subtracted = tree, subtracted
        self._known = dict(u)
        self._turns: dict[int, Vector] = {GROUND: (1.0, 0.0)}
        self._between = dict[tuple[int, int], Vector]()

    @cached_property
    def u(self) -> list[Scalar]:
        """All coordinates."""
        rows = self.tree.rows
        for way, number in self.tree.explicit.items():
            row, rest = rows[number], 0.0
            for (frame, other), a in row.terms.items():
                value, _ = self.combined(row.frame, frame, components(a, row.along))
                if other != way:
                    rest = rest + (value if other is None else self._known[other] * value)
            own, _ = self.combined(row.frame, GROUND, components(row.terms[GROUND, way], row.along))
            self._known[way] = -(rest / own)
        return [self._known[k] for k in range(len(self.tree.structure.coordinates))]

    def factor(self, way: int | None) -> Scalar:
        """Return u of an element."""
        return 1.0 if way is None else self.u[way]

    def turn(self, frame: int) -> Vector:
        """Return cosine and sine of a frame's angle."""
        if frame not in self._turns:
            self._turns[frame] = cos(self._known[frame]), sin(self._known[frame])
        return self._turns[frame]

    def between(self, f: int, g: int) -> Vector:
        """Return cosine and sine of delta = w_g - w_f; that of two angles is written once."""
        if f == g:
            return 1.0, 0.0
        if f == GROUND:
            return self.turn(g)
        if f > g:
            c, s = self.between(g, f)
            return c, -s
        if (f, g) not in self._between and self._subtracted and self.tree.structure.driven not in (f, g):
            difference = self._known[g] - self._known[f]
            self._between[f, g] = cos(difference), sin(difference)
        elif (f, g) not in self._between:
            (c, s), (other_c, other_s) = self.turn(f), self.turn(g)
            self._between[f, g] = c * other_c + s * other_s, c * other_s - s * other_c
        return self._between[f, g]

    def combined(self, f: int, g: int, pair: Vector) -> Vector:
        """Return x cos(delta) + y sin(delta) of a pair (x, y), and its derivative by delta."""
        (c, s), (x, y) = self.between(f, g), pair
        return x * c + y * s, y * c - x * s

    def vector(self, terms: Terms) -> Vector:
        """Return the sum of terms (2,) in m."""
        x: Scalar = 0.0
        y: Scalar = 0.0
        for (frame, way), a in terms.items():
            (c, s), factor = self.turn(frame), self.factor(way)
            x, y = x + factor * (c * a[0] - s * a[1]), y + factor * (s * a[0] + c * a[1])
        return x, y

    def columns(self, terms: Terms) -> dict[int, Vector]:
        """Return the derivatives of a sum of terms by the coordinates."""
        columns = dict[int, Vector]()
        for (frame, way), a in terms.items():
            (c, s), factor = self.turn(frame), self.factor(way)
            x, y = c * a[0] - s * a[1], s * a[0] + c * a[1]
            parts = {} if way is None else {way: (x, y)}
            if frame != GROUND:
                parts[frame] = (-(factor * y), factor * x)
            for k, part in parts.items():
                old = columns.get(k, (0.0, 0.0))
                columns[k] = old[0] + part[0], old[1] + part[1]
        return columns

    @cached_property
    def loops(self) -> list[ByCoordinate]:
        """The rows of the joints that close loops.

        g = sum of u_p r(delta_p), r the component along the row's direction, and delta the angle of p's frame
        in that of the row: g' = sum of u_p' r + u_p delta' dr/d delta.
        """
        return [self._row(row) for row in self.tree.rows]

    def _row(self, row: Row) -> ByCoordinate:
        parts = ByCoordinate()
        for (frame, way), a in row.terms.items():
            value, slope = self.combined(row.frame, frame, components(a, row.along))
            if way is not None:
                parts[way] += value
            if frame != row.frame:
                lever = self.factor(way) * slope
                for k, part in ((frame, lever), (row.frame, -lever)):
                    if k != GROUND:
                        parts[k] += part
        return nonzero(parts)

    def bias(self, row: Row, rates: list[Scalar]) -> Scalar:
        """Return what g'' of a row has beside the coordinates' accelerations, at their rates.

        It is the sum of 2 u_p' delta' dr/d delta - u_p delta'^2 r.
        """
        total: Scalar = 0.0
        for (frame, way), a in row.terms.items():
            value, slope = self.combined(row.frame, frame, components(a, row.along))
            if frame == row.frame:
                continue
            turning = rate_of(rates, frame) - rate_of(rates, row.frame)
            total = total - self.factor(way) * value * (turning * turning)
            if way is not None:
                total = total + 2.0 * (rates[way] * turning) * slope
        return total


def rate_of(rates: list[Scalar], frame: int) -> Scalar:
    """Return how fast a frame turns."""
    return 0.0 if frame == GROUND else rates[frame]


def components(a: Vector, along: Vector) -> Vector:
    """Return what ``Frames.combined`` makes a component of a along a direction: (n.a, a x n)."""
    return along[0] * a[0] + along[1] * a[1], a[0] * along[1] - a[1] * along[0]


def nonzero(parts: ByCoordinate) -> ByCoordinate:
    """Return what is not the number 0."""
    own = {k: part for k, part in parts.items() if not (is_number(part) and part == 0.0)}
    return ByCoordinate(own)
