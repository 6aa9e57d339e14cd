"""Intervals and the test of equivalence over members of ensembles.

Values are (..., n, k): n independent members with k quantities each; many pairs are tested at once.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from reports.results import FloatArray

#: Confidence of an interval of a mean.
CONFIDENCE = 0.95
#: Level of each one-sided test. It is below the 5 % of false equivalence that are claimed, because Student's
#: t does not know the skewness of the members; a test draws samples and counts.
ONE_SIDED_LEVEL = 0.04
#: Of fewer members nothing is tested.
FEWEST = 20

VERDICTS = EQUIVALENT, DIFFERENT, OPEN, TOO_FEW = "equivalent", "different", "undecided", "too few members"


class Interval(NamedTuple):
    """A mean, or means of any shape, and the ends of the confidence interval."""

    mean: Any
    low: Any
    high: Any


def student_interval(values: FloatArray) -> Interval:
    """Return the mean of independent values (n,), n > 1, with Student's interval."""
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(CONFIDENCE)
    return Interval(float(values.mean()), float(low), float(high))


class Sample(NamedTuple):
    """A sample of ``size`` members by its means and the squares of their standard errors, (..., k) each."""

    size: int
    mean: FloatArray
    variance: FloatArray

    @classmethod
    def of(cls, values: FloatArray) -> "Sample":
        """Return what is asked of values (..., n, k)."""
        n = values.shape[-2]
        return cls(n, values.mean(axis=-2), values.var(axis=-2, ddof=1) / n)


@dataclass(frozen=True)
class Margins:
    """The differences of means, (k,) each, up to which samples count as equivalent.

    A margin is ``part`` of the other sample's mean, which is positive, or ``shift`` in the quantity's unit;
    of the two one is 0.
    """

    part: FloatArray
    shift: FloatArray


def difference(one: Sample, other: Sample, margins: Margins) -> Interval:
    """Return the differences of the means of two samples in units of the margins, (..., k), with intervals.

    Both one-sided tests (Schuirmann 1987) reject where an interval, of confidence 1 - 2 ``ONE_SIDED_LEVEL``
    after Welch, lies within -1 and 1. Where the margin is a part of the other mean its scatter counts as well
    (Sasabuchi 1980): the interval is that of the ratio of the means (Fieller 1954), and has no end where the
    other mean is not told from zero.
    """
    variance = one.variance + other.variance
    scatter = one.variance**2 / (one.size - 1) + other.variance**2 / (other.size - 1)
    t = stats.t.ppf(1 - ONE_SIDED_LEVEL, variance**2 / scatter)
    off, half = one.mean - other.mean, t * np.sqrt(variance)
    ratio, by_part = _ratio(one, other, t), margins.part > 0
    with np.errstate(divide="ignore", invalid="ignore"):  # the margin of each quantity is of one kind
        shifts = (end / margins.shift for end in (off, off - half, off + half))
        parts = ((end - 1) / margins.part for end in ratio)
        return Interval(*(np.where(by_part, *ends) for ends in zip(parts, shifts, strict=True)))


def _ratio(one: Sample, other: Sample, t: FloatArray) -> Interval:
    """Return the ratios r of two means: the ends of (one - r other)^2 <= t^2 (variance + r^2 variance)."""
    product, other_square = one.mean * other.mean, other.mean**2
    known = other_square - t**2 * other.variance
    scatter = one.variance * other_square + other.variance * (one.mean**2 - t**2 * one.variance)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = t * np.sqrt(scatter)
        low, high = ((product + end) / known for end in (-root, root))
        return Interval(
            one.mean / other.mean, np.where(known > 0, low, -np.inf), np.where(known > 0, high, np.inf)
        )


def verdict(differences: Interval, sizes: tuple[int, int]) -> str:
    """Return what the intervals (k,) of all quantities say of two samples of these sizes.

    Samples are equivalent where all intervals lie within the margins, for which no correction is needed
    (Berger 1982), and different where any lies beyond one.
    """
    if min(sizes) < FEWEST:
        return TOO_FEW
    if np.all((differences.low > -1) & (differences.high < 1)):
        return EQUIVALENT
    return DIFFERENT if np.any((differences.low > 1) | (differences.high < -1)) else OPEN
