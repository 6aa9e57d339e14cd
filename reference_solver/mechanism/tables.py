"""Piecewise cubic functions given by tables of any length, which a kernel looks up in its parameters."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from reference_solver.checks import require, require_finite, require_not_negative
from reference_solver.mechanism.lifting import Table
from reference_solver.tape import FloatArray, Scalar

#: What a piece has in a table: where it begins, and coefficients of 1, s, s^2, s^3, s counted from there.
ROW = 5
#: A jump of a derivative that makes less than this part of the largest value across a piece is none.
SMOOTH = 1e-12


def piece(p: FloatArray, place: float, pieces: float, period: float, x: float) -> tuple[float, ...]:
    """Return s and the four coefficients of the piece that x is in, of a table that begins at len(p) + place.

    The first and the last piece go on for ever; with a period, x is taken back into it.
    """
    first, low, high = len(p) + int(place), 0, int(pieces)
    if period > 0.0:
        x -= period * ((x - p[first]) // period)
    while high - low > 1:
        middle = (low + high) // 2
        if x < p[first + 5 * middle]:
            high = middle
        else:
            low = middle
    row = first + 5 * low
    return x - p[row], p[row + 1], p[row + 2], p[row + 3], p[row + 4]


@dataclass(frozen=True)
class PiecewiseCubic(Table):
    """A function of one variable by its pieces: of each, one after the other, a ``ROW`` of numbers.

    With a ``period`` other than 0 it repeats.
    """

    rows: tuple[float, ...] = field(repr=False)
    period: float = 0.0

    def __post_init__(self) -> None:
        count, name = len(self.rows), "PiecewiseCubic.rows"
        require(name, count, count > 0 and count % ROW == 0, f"{ROW} numbers for each piece")
        require_finite(name, self.rows)
        require_not_negative(self, "period")
        begins = self._array[::ROW]
        for k in np.flatnonzero(np.diff(begins) <= 0):
            wanted = f"a number > {begins[k]:g}, where the piece before begins"
            require(f"{name}[{ROW * (k + 1)}]", begins[k + 1], False, wanted)

    @cached_property
    def _array(self) -> FloatArray:
        return np.array(self.rows)

    @property
    def straight(self) -> bool:
        """Whether all pieces are straight lines, so that the function has kinks where they meet."""
        return not self._array.reshape(-1, ROW)[:, 3:].any()

    @property
    def knots(self) -> list[float]:
        """Where pieces begin that are more than round-off away from the one before, gone on."""
        begins, value, degree = self._array[::ROW], np.abs(self._array[1::ROW]), 1 if self.straight else 3
        highest, wide = self._array[1 + degree :: ROW], np.diff(begins, append=begins[-1])
        jump, wide = highest - np.roll(highest, 1), np.maximum(wide, np.roll(wide, 1))
        matters = np.abs(jump) * wide**degree > SMOOTH * value.max()
        return [float(x) for x in begins[matters]]

    def placed(self, behind: int = 0) -> "PlacedTable":
        """Return what a kernel knows of it, with so many numbers of other tables behind this one's."""
        return PlacedTable(-float(len(self.rows) + behind), len(self.rows) / ROW, self.period)

    def at(self, x: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """Return the function and its first two derivatives at a number or at a tape's value."""
        return _cubic(*piece(self._array, -len(self.rows), len(self.rows) / ROW, self.period, x))


@dataclass(frozen=True)
class PlacedTable:
    """A table among a kernel's parameters: where it begins, from their end on, its pieces and its period."""

    place: Scalar
    pieces: Scalar
    period: Scalar

    def at(self, x: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        """Return the function and its first two derivatives on the tape that the place is on."""
        return _cubic(*self.place.tape.call("piece", [self.place, self.pieces, self.period, x], 5))


def _cubic(s: Scalar, a: Scalar, b: Scalar, c: Scalar, d: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    return a + s * (b + s * (c + s * d)), b + s * (2.0 * c + s * (3.0 * d)), 2.0 * c + 6.0 * (s * d)
