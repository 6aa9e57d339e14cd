"""The observed order of convergence, claimed only where the errors show one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

#: An error counts when it is this many times a floor: the floor then moves the slope by at most 0.14.
ABOVE_FLOOR = 10.0
#: An error above this part of how far the signal itself swings is of a motion that has little to do with it.
ASTRAY = 0.1
#: Local order (between neighbouring steps) below which an error has stopped falling.
FALLING = 0.5
#: The finest local order below this part of the one before it shows a floor coming.
BEND = 0.75
#: No order is claimed from fewer points, and only the finest few are used: coarser ones are pre-asymptotic.
FEWEST, MOST = 3, 4
#: Local orders of the points used that differ by more than this make no straight line.
STRAIGHT = 1.0

#: The rule in words, for the page.
RULE = (
    f"The observed order is the least-squares slope of log(error) over log(step) at the finest {FEWEST} or "
    f"{MOST} steps at which the error still falls. Left out are errors within a factor of {ABOVE_FLOOR:g} of "
    "the reference solution's uncertainty or of the floor at which the configuration stops improving, and "
    f"errors above {ASTRAY:g} of the signal's amplitude. Where there is no order the cell says why: "
    "round-off, astray (errors as large as the signal), flat, irregular or too few points."
)

Verdict = Literal["order", "round-off", "astray", "flat", "too few points", "irregular"]


@dataclass(frozen=True)
class Order:
    """An observed order: ``slope`` and the ``steps`` it is taken from, or the ``verdict`` why there is none.

    ``spread`` is the largest less the smallest local order of the steps used.
    """

    verdict: Verdict
    slope: float | None = None
    steps: tuple[float, ...] = ()
    spread: float = 0.0

    def __str__(self) -> str:
        return self.verdict if self.slope is None else f"{self.slope:.2f}"


def observed_order(
    steps: Sequence[float], errors: Sequence[float], floor: float = 0.0, scale: float = np.inf
) -> Order:
    """Return the slope of log(error) over log(step), or why none is claimed.

    ``steps`` and ``errors`` are (n,), in any order of steps; ``floor`` is the reference solution's
    uncertainty, ``scale`` the signal's largest distance from its mean, both in the unit of the errors. The
    rule, in this order:

    1. of points not above ``ASTRAY`` times the scale the stretch of steps in which the error falls: local
       orders of at least ``FALLING``; of several the one in which it falls the most. This leaves out
       saturated coarse steps, round-off, and a rising branch;
    2. without the finest points at which the local order bends to below ``BEND`` of the one before;
    3. without points below ``ABOVE_FLOOR`` times the reference solution's uncertainty and, where finer points
       were left out in 1 or 2, without points below ``ABOVE_FLOOR`` times the smallest error of the stretch,
       which is at the engine's own floor;
    4. the finest ``MOST`` of what is left, at least ``FEWEST``, with local orders within ``STRAIGHT``.
    """
    h, e = _coarse_to_fine(steps, errors)
    if not len(h):
        return Order("too few points")
    if np.all(e < ABOVE_FLOOR * floor):
        return Order("round-off")
    h, e = h[e <= ASTRAY * scale], np.maximum(e[e <= ASTRAY * scale], np.finfo(float).tiny)
    if not len(h):
        return Order("astray")
    begin, end = _falling_stretch(local_orders(h, e))
    if end - begin < 2:
        return Order("flat" if len(h) >= FEWEST else "too few points")
    smallest = e[end - 1]
    while end - begin >= FEWEST and _bends(local_orders(h[begin:end], e[begin:end])):
        end -= 1
    limit = ABOVE_FLOOR * (max(floor, smallest) if end < len(h) else floor)
    used = np.arange(begin, end)[e[begin:end] >= limit][-MOST:]
    if len(used) < FEWEST:
        return Order("too few points")
    local = local_orders(h[used], e[used])
    spread = float(np.ptp(local))
    if spread > STRAIGHT:
        return Order("irregular", steps=tuple(h[used]), spread=spread)
    slope = float(np.polyfit(np.log(h[used]), np.log(e[used]), 1)[0])
    return Order("order", slope, tuple(h[used]), spread)


def local_orders(h: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return the slope between neighbouring points, (n - 1,)."""
    return np.asarray(np.diff(np.log(e)) / np.diff(np.log(h)))


def _coarse_to_fine(steps: Sequence[float], errors: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    points = pd.DataFrame({"h": np.asarray(steps, dtype=float), "e": np.asarray(errors, dtype=float)})
    points = points[np.isfinite(points).all(axis=1) & (points["h"] > 0)]
    points = points.sort_values(["h", "e"], ascending=[False, True]).drop_duplicates("h")
    return points["h"].to_numpy(), points["e"].to_numpy()  # of two runs at one mean step, the better


def _falling_stretch(local: np.ndarray) -> tuple[int, int]:
    """Return begin and end of the points of the stretch with local orders >= FALLING and the largest drop."""
    best, drop, begin = (0, 0), 0.0, 0
    for k in range(len(local) + 1):
        if k == len(local) or local[k] < FALLING:
            if local[begin:k].sum() > drop:
                best, drop = (begin, k + 1), float(local[begin:k].sum())
            begin = k + 1
    return best


def _bends(local: np.ndarray) -> bool:
    return bool(local[-1] < BEND * local[-2])
