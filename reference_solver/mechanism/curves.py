"""Curves through the points of tables, once for all engines: cubic splines, or straight lines."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from reference_solver.mechanism.data import Interpolation, Table

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

#: Slopes at both ends of a spline; of an end whose slope is None the third derivative does not jump there.
Ends = tuple[float | None, float | None]


def curve_of(table: Table) -> "PPoly":
    """Return the curve through a table, in pieces of four coefficients each."""
    if table.period:
        x, y = (*table.x[:-1], table.x[0] + table.period), (*table.y[:-1], table.y[0])
        return curve(x, y, table.interpolation, "periodic")
    return table_curve(table.x, table.y, table.interpolation, table.end_slopes)


def table_curve(
    x: Sequence[float], y: Sequence[float], interpolation: Interpolation, slopes: Sequence[float] | None
) -> "PPoly":
    """Return the curve through a table that does not repeat.

    Without slopes its third derivative does not jump at the points next to the ends, but its slope is 0 at an
    end whose two values are equal.
    """
    if interpolation == "linear":
        return curve(x, y, interpolation, (None, None))
    if slopes is not None:
        return curve(x, y, interpolation, (slopes[0], slopes[1]))
    ends = 0.0 if y[0] == y[1] else None, 0.0 if y[-2] == y[-1] else None
    return curve(x, y, interpolation, ends)


def curve(
    x: Sequence[float], y: Sequence[float], interpolation: Interpolation, ends: Ends | Literal["periodic"]
) -> "PPoly":
    """Return what passes through a table's points, in pieces of four coefficients each."""
    from scipy.interpolate import (
        CubicSpline,
        PPoly,
    )  # it takes a moment, and scenes without tables do without

    if interpolation == "linear":
        nothing = np.zeros(len(x) - 1)
        pieces = np.array([nothing, nothing, np.diff(y) / np.diff(x), y[:-1]])
        return PPoly(pieces, x, extrapolate="periodic" if ends == "periodic" else True)
    if ends == "periodic":
        return CubicSpline(x, y, bc_type="periodic")
    return CubicSpline(x, y, bc_type=tuple("not-a-knot" if slope is None else (1, slope) for slope in ends))
