"""Intervals and tests over members of ensembles, and how often the tests are right.

Samples are (..., n, k): n independent members with k quantities each; tests of many samples are made at once.
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from reports.results import FloatArray

#: Confidence of every interval of a mean, and level of every test.
CONFIDENCE, LEVEL = 0.95, 0.05
#: Calibration begins with the same random numbers, so that a report is the same whenever it is made.
SEED = 20240229


@dataclass(frozen=True)
class Interval:
    """A mean and the ends of its confidence interval."""

    mean: float
    low: float
    high: float


def student_interval(values: FloatArray) -> Interval:
    """Return the mean of independent values (n,), n > 1, with Student's interval."""
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(CONFIDENCE)
    return Interval(float(values.mean()), float(low), float(high))


@dataclass(frozen=True)
class Margins:
    """The differences of means, (k,) each, up to which samples count as equivalent: ``part`` of the other
    sample's mean, which is positive, and ``shift`` in the quantity's unit; one of the two is 0.
    """

    part: FloatArray
    shift: FloatArray

    def above(self, sample: FloatArray) -> FloatArray:
        """Return a sample with every mean moved up by its margin."""
        return sample * (1 + self.part) + self.shift

    def below(self, sample: FloatArray) -> FloatArray:
        """Return a sample with every mean moved down by its margin."""
        return sample * (1 - self.part) - self.shift

    def sizes(self, sample: FloatArray) -> FloatArray:
        """Return the margins about a sample's means in the quantities' units, (k,)."""
        return np.asarray(self.part * sample.mean(axis=-2) + self.shift)


def difference_intervals(one: FloatArray, other: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ends, (k,) each, of Welch's intervals of the differences of means.

    Their confidence of 1 - 2 ``LEVEL`` is that of two one-sided tests.
    """
    low, high = stats.ttest_ind(one, other, equal_var=False).confidence_interval(1 - 2 * LEVEL)
    return np.asarray(low), np.asarray(high)


def difference_p(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the p of Welch's test that means are the same, (..., k)."""
    return np.asarray(stats.ttest_ind(one, other, axis=-2, equal_var=False).pvalue)


def equivalence_p(one: FloatArray, other: FloatArray, margins: Margins) -> FloatArray:
    """Return the p of Schuirmann's two one-sided tests (1987) that means differ by the margin, (..., k).

    Where the margin is a part of the other mean, that mean's scatter is part of the test (Sasabuchi 1980).
    """
    sides = ((margins.above(other), "less"), (margins.below(other), "greater"))
    p = [stats.ttest_ind(one, end, axis=-2, equal_var=False, alternative=side).pvalue for end, side in sides]
    return np.asarray(np.max(p, axis=0))


def joint_p(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the p of Hotelling's test (1931) that all k means are the same, (...).

    It sees any combination of differences, also such as hide within the scatter of each quantity.
    """
    n, m, k = one.shape[-2], other.shape[-2], one.shape[-1]
    off = [sample - sample.mean(axis=-2, keepdims=True) for sample in (one, other)]
    freedom = n + m - 2
    covariance = sum(np.swapaxes(each, -1, -2) @ each for each in off) / freedom
    difference = (one.mean(axis=-2) - other.mean(axis=-2))[..., None]
    try:
        solved = np.linalg.solve(covariance, difference)
    except np.linalg.LinAlgError:  # what does not scatter in a draw tells nothing there
        solved = np.linalg.pinv(covariance, hermitian=True) @ difference
    distance = (difference * solved).sum(axis=(-2, -1))
    scale = n * m / (n + m) * (freedom - k + 1) / (freedom * k)
    return np.asarray(stats.f.sf(scale * distance, k, freedom - k + 1))


def holm(p: FloatArray) -> FloatArray:
    """Return p-values (..., k) raised so that any false alarm among k has the level's chance (Holm 1979)."""
    order = np.argsort(p, axis=-1)
    weighted = np.take_along_axis(p, order, axis=-1) * np.arange(p.shape[-1], 0, -1)
    out = np.empty_like(p)
    np.put_along_axis(out, order, np.minimum(np.maximum.accumulate(weighted, axis=-1), 1.0), axis=-1)
    return out


@dataclass(frozen=True)
class Rate:
    """How often something happened in a number of trials, with Clopper and Pearson's interval (1934)."""

    count: int
    trials: int

    @property
    def value(self) -> float:
        """The share of the trials."""
        return self.count / self.trials

    @property
    def interval(self) -> tuple[float, float]:
        """The interval of the chance."""
        low, high = stats.binomtest(self.count, self.trials).proportion_ci(CONFIDENCE, method="exact")
        return float(low), float(high)


def told_apart_p(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the p of all tests of differences, (..., k + 1): of each mean, and at the end of all jointly.

    They are raised by Holm's correction, so that any false alarm among them has the level's chance.
    """
    return holm(np.append(difference_p(one, other), joint_p(one, other)[..., None], axis=-1))


@dataclass(frozen=True)
class Calibration:
    """How often the tests of two samples of ``size`` give an alarm or an all-clear, over many draws.

    Lists are of the k quantities, with a difference of the margin ``planted`` in that one alone, or in none
    (``same``). ``alarms`` are of the quantity's own test, ``joint`` of the joint one, both after Holm's
    correction; ``clear`` is that two one-sided tests call its means equivalent. ``any_alarm`` and
    ``all_clear`` are without a difference.
    """

    size: int
    same_alarms: list[Rate]
    planted_alarms: list[Rate]
    same_joint: Rate
    planted_joint: list[Rate]
    same_clear: list[Rate]
    planted_clear: list[Rate]
    any_alarm: Rate
    all_clear: Rate


def calibrated(pool: FloatArray, size: int, margins: Margins, draws: int) -> Calibration:
    """Return how the tests do on samples of ``size`` drawn from a pool (N, k), members with replacement.

    The pool is taken for the distribution: two samples are independent draws from it, and a member may be in
    both, as two values of a distribution may be alike.
    """
    rng, k = np.random.default_rng(SEED), pool.shape[-1]
    one, other = pool[rng.integers(len(pool), size=(2, draws, size))]
    moved, same, clear = margins.above(one), told_apart_p(one, other), equivalence_p(one, other, margins)
    planted = [told_apart_p(np.where(alone, moved, one), other) for alone in np.eye(k, dtype=bool)]

    def rate(p: FloatArray) -> Rate:
        return Rate(int((p <= LEVEL).sum()), draws)

    return Calibration(
        size,
        same_alarms=[rate(p) for p in same.T[:k]],
        planted_alarms=[rate(p[:, q]) for q, p in enumerate(planted)],
        same_joint=rate(same[:, k]),
        planted_joint=[rate(p[:, k]) for p in planted],
        same_clear=[rate(p) for p in clear.T],
        planted_clear=[rate(p) for p in equivalence_p(moved, other, margins).T],
        any_alarm=rate(same.min(axis=-1)),
        all_clear=rate(clear.max(axis=-1)),
    )
