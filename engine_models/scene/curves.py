"""Curves through the points of tables, and by how much a spline leaves what its table says."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np

from engine_models.scene.data import require

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Interpolation = Literal["spline", "linear"]
#: How many points each takes: a cubic spline without conditions at its ends, and a straight line.
FEWEST_POINTS: dict[Interpolation, int] = {"spline": 4, "linear": 2}
#: A spline is warned of where it leaves its table's values by more than this part of their range.
OVERSHOOT = 0.03
#: Slopes at both ends of a spline; of an end whose slope is None the third derivative does not jump there.
Ends = tuple[float | None, float | None]


def require_table(
    x_name: str, x: Sequence[float], y_name: str, y: Sequence[float], interpolation: Interpolation
) -> None:
    """Refuse a table that is too short, whose columns differ in length, or whose x does not rise."""
    if len(x) < FEWEST_POINTS[interpolation]:
        raise ValueError(f"{x_name}: expected at least {FEWEST_POINTS[interpolation]} numbers, got {len(x)}")
    if len(y) != len(x):
        raise ValueError(f"{y_name}: expected as many numbers as {x_name} has, {len(x)}, got {len(y)}")
    for place, (before, after) in enumerate(pairwise(x), 1):
        require(after > before, f"{x_name}.{place}", f"a number > {before:g}, the one before", after)
        expected = f"a number neither at {before:g} nor endlessly far from it"
        require(_has_cubic(after - before, y[place] - y[place - 1]), f"{x_name}.{place}", expected, after)


def _has_cubic(step: float, rise: float) -> bool:
    """Return whether coefficients of a cubic that rises so far within a step are finite numbers."""
    try:
        return math.isfinite(step**3) and math.isfinite((1.0 + abs(rise)) / step**3)
    except (OverflowError, ZeroDivisionError):
        return False


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


@dataclass(frozen=True)
class Overshoot:
    """A curve's own range, ``low`` to ``high``, and where it is furthest outside of its table's values.

    There it is outside by a ``part`` of their range.
    """

    low: float
    high: float
    at: float
    part: float


def overshoot(of: "PPoly", y: Sequence[float]) -> Overshoot | None:
    """Return how a curve leaves its table's values, None up to ``OVERSHOOT`` of their range."""
    with np.errstate(all="ignore"):
        at = of.derivative().roots(extrapolate=False)
        values = of(at := at[np.isfinite(at)])
    low, high = min(y), max(y)
    beyond = np.maximum(values - high, low - values)
    if not len(at) or beyond.max() <= OVERSHOOT * (high - low):
        return None
    k, least, most = int(beyond.argmax()), min(low, values.min()), max(high, values.max())
    part = beyond[k] / (high - low) if high > low else math.inf
    return Overshoot(float(least), float(most), float(at[k]), float(part))
