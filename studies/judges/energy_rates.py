"""How fast something drifts and how it grows: a slope with a confidence interval, an exponent of time."""

from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray

#: The run is cut into this many parts, whose own slopes tell how sure the slope of the whole is.
PARTS = 5
#: Means are taken over at most this many blocks: more say nothing new, and pairs of them are compared.
MOST_BLOCKS = 100
CONFIDENCE = 0.95
#: The part of a run that a growth exponent is taken from: all but the first twentieth.
LATE = 1 / 20


@dataclass(frozen=True)
class Rate:
    """A slope over time and its confidence interval, in the curve's unit per second."""

    per_s: float
    low_per_s: float
    high_per_s: float


def blocks_of(periods: float) -> int:
    """Return how many blocks to cut a run of so many periods into: each whole periods long if they allow."""
    whole = int(periods * (1 + 1e-9))
    fewest = 2 * PARTS
    if whole < fewest:
        return fewest
    per_block = -(-whole // MOST_BLOCKS)
    return max(fewest, whole // per_block // PARTS * PARTS)


def drift_rate(time_s: FloatArray, value: FloatArray, blocks: int) -> Rate:
    """Return the drift of a curve, both (n,) with n > ``blocks``, a multiple of ``PARTS``.

    The slope is the median of the slopes of all pairs (Theil 1950, Sen 1968) of means over blocks, so that
    what swings within a block averages out and a single jump moves it little. What is left after that is
    neither independent nor of one kind: noise about a line leaves the slope surer than a walk of random
    steps, as round-off and impacts make. The interval is therefore Student's, from the slopes of five parts
    of the run, which are independent for both (batch means); for noise about a line it is too wide.
    """
    from scipy.stats import t as student  # which takes a second to load
    from scipy.stats import theilslopes

    if blocks % PARTS or blocks < 2 * PARTS or len(time_s) <= blocks:
        raise ValueError(f"blocks: expected a multiple of {PARTS} below {len(time_s)}, got {blocks}")
    # The first sample is left out: then samples divide into blocks, and a start that is exact has no weight.
    time, mean = (
        np.array([part.mean() for part in np.array_split(curve[1:], blocks)]) for curve in (time_s, value)
    )
    slope = float(theilslopes(mean, time)[0])
    parts = [
        float(theilslopes(y, x)[0]) for x, y in zip(np.split(time, PARTS), np.split(mean, PARTS), strict=True)
    ]
    spread = float(np.std(parts, ddof=1)) / np.sqrt(PARTS)
    half = float(student.ppf((1 + CONFIDENCE) / 2, PARTS - 1)) * spread
    return Rate(slope, slope - half, slope + half)


def so_far(value: FloatArray) -> FloatArray:
    """Return the largest size of a curve (n,) up to each time."""
    return np.asarray(np.maximum.accumulate(np.abs(value)))


def growth_exponent(time_s: FloatArray, value: FloatArray) -> float:
    """Return p of the power law t^p that the largest size so far follows: 0 where it is bounded.

    It is the least-squares slope of the logarithms at times evenly spaced on a logarithmic scale.
    """
    late = np.geomspace(LATE * time_s[-1], time_s[-1], 60)
    at = np.unique(np.searchsorted(time_s, late).clip(1, len(time_s) - 1))
    size = so_far(value)[at]
    seen = size > 0
    if seen.sum() < 2:
        return 0.0
    return float(np.polyfit(np.log(time_s[at][seen]), np.log(size[seen]), 1)[0])


def thinned(curve: FloatArray, most: int) -> FloatArray:
    """Return at most ``most + 1`` samples of a curve (n,), evenly spaced by index, both ends included."""
    return np.asarray(curve[np.linspace(0, len(curve) - 1, min(most + 1, len(curve))).round().astype(int)])
