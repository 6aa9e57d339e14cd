"""Intervals and tests over members of ensembles, and how often the tests are right.

Samples are (..., n, k): n independent members with k quantities each; tests of many are made at once.
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from reports.results import FloatArray

#: Confidence of every interval of a mean, and level of every test.
CONFIDENCE, LEVEL = 0.95, 0.05
#: Level of the tests of equivalence: so at most ``LEVEL`` of what is a margin apart is called equivalent.
#: Student's t leaves the skewness of 200 and 400 members out, with which 5 % would become up to 5.6 %.
BEYOND_LEVEL = 0.04
#: Samples decide that tell another mechanism apart, and call the same one equivalent, in this part of draws,
#: the usual one (Cohen 1988).
POWER = 0.8
#: A rate is above another if chance alone has it so rarely.
CHANCE = 0.001
#: Draws that are tested at once.
BATCH = 100
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
class Sample:
    """What tests ask of a sample (..., n, k) of ``size`` n: means (..., k), their covariance (..., k, k)."""

    size: int
    mean: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, values: FloatArray) -> "Sample":
        """Return what is asked of a sample."""
        n, off = values.shape[-2], values - values.mean(axis=-2, keepdims=True)
        return cls(n, values.mean(axis=-2), np.swapaxes(off, -1, -2) @ off / (n - 1) / n)

    @property
    def variance(self) -> FloatArray:
        """The estimated variances of the means, (..., k)."""
        return np.diagonal(self.covariance, axis1=-2, axis2=-1)

    def moved(self, factor: FloatArray, shift: FloatArray) -> "Sample":
        """Return the sample with all its values times a factor (k,), and moved by a shift (k,)."""
        covariance = self.covariance * factor * factor[:, None]
        return Sample(self.size, self.mean * factor + shift, covariance)


@dataclass(frozen=True)
class Margins:
    """The differences of means, (k,) each, up to which samples count as equivalent: ``part`` of the other
    sample's mean, which is positive, and ``shift`` in the quantity's unit; one of the two is 0.
    """

    part: FloatArray
    shift: FloatArray

    def above(self, sample: Sample) -> Sample:
        """Return a sample with every mean moved up by its margin."""
        return sample.moved(1 + self.part, self.shift)

    def below(self, sample: Sample) -> Sample:
        """Return a sample with every mean moved down by its margin."""
        return sample.moved(1 - self.part, -self.shift)

    def sizes(self, sample: Sample) -> FloatArray:
        """Return the margins about a sample's means in the quantities' units, (..., k)."""
        return np.asarray(self.part * sample.mean + self.shift)


@dataclass(frozen=True)
class Difference:
    """The difference of two samples' means, (..., k), its standard error, and its freedom after Welch."""

    value: FloatArray
    error: FloatArray
    freedom: FloatArray

    @property
    def statistic(self) -> FloatArray:
        """The difference over its error."""
        return self.value / self.error

    def interval(self) -> tuple[FloatArray, FloatArray]:
        """Return the ends, (..., k), with the confidence of two one-sided tests, 1 - 2 ``BEYOND_LEVEL``."""
        half = self.error * stats.t.ppf(1 - BEYOND_LEVEL, self.freedom)
        return self.value - half, self.value + half


def difference(one: Sample, other: Sample) -> Difference:
    """Return the difference of the means of two samples."""
    variance = one.variance + other.variance
    scatter = one.variance**2 / (one.size - 1) + other.variance**2 / (other.size - 1)
    with np.errstate(invalid="ignore"):  # what does not scatter in a draw has no test there
        return Difference(one.mean - other.mean, np.sqrt(variance), variance**2 / scatter)


def difference_p(one: Sample, other: Sample) -> FloatArray:
    """Return the p of Welch's test that means are the same, (..., k)."""
    of = difference(one, other)
    return np.asarray(2 * stats.t.sf(np.abs(of.statistic), of.freedom))


def equivalence_p(one: Sample, other: Sample, margins: Margins) -> FloatArray:
    """Return the p of Schuirmann's two one-sided tests (1987) that means differ by the margin, (..., k).

    Where the margin is a part of the other mean, that mean's scatter is part of the test (Sasabuchi 1980).
    """
    above, below = (difference(one, end) for end in (margins.above(other), margins.below(other)))
    p = stats.t.cdf(above.statistic, above.freedom), stats.t.sf(below.statistic, below.freedom)
    return np.asarray(np.max(p, axis=0))


def joint_p(one: Sample, other: Sample) -> FloatArray:
    """Return the p of Krishnamoorthy and Yu's test (2004) that all k means are the same, (...).

    It is Hotelling's for samples whose sizes and covariances may differ, Welch's of one quantity, and sees
    any combination of differences, also such as hide within the scatter of each quantity.
    """
    k, covariance = one.mean.shape[-1], one.covariance + other.covariance
    try:
        inverse = np.linalg.inv(covariance)
    except np.linalg.LinAlgError:  # what does not scatter in a draw tells nothing there
        inverse = np.linalg.pinv(covariance, hermitian=True)
    apart = (one.mean - other.mean)[..., None]
    distance = (apart * (inverse @ apart)).sum(axis=(-2, -1))
    spread = np.zeros_like(distance)
    for sample in (one, other):
        share = sample.covariance @ inverse
        trace, of_square = (np.trace(of, axis1=-2, axis2=-1) for of in (share, share @ share))
        spread = spread + (of_square + trace**2) / (sample.size - 1)
    freedom = (k + k**2) / spread
    scale = (freedom - k + 1) / (freedom * k)
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

    def exceeds(self, level: float) -> bool:
        """Whether it happened more often than a chance of ``level`` makes it but once in a thousand times."""
        return bool(stats.binom.sf(self.count - 1, self.trials, level) < CHANCE)


def told_apart_p(one: Sample, other: Sample, pairs: int = 1) -> FloatArray:
    """Return the p of all tests of differences, (..., k + 1): of each mean, and at the end of all jointly.

    They are raised by Holm's correction, and by Bonferroni's for the number of ``pairs`` that are compared,
    so that any false alarm among all of these has the level's chance.
    """
    own = np.append(difference_p(one, other), joint_p(one, other)[..., None], axis=-1)
    return np.asarray(np.minimum(pairs * holm(own), 1.0))


@dataclass(frozen=True)
class Calibration:
    """How often the tests of two samples of ``sizes`` give an alarm or an all-clear, over many draws.

    Lists are of the k quantities. ``same_alarms`` are of the quantity's own test, ``same_joint`` of the joint
    one and ``any_alarm`` of any, of samples of one distribution; ``seen``, ``seen_joint`` and ``seen_at_all``
    where one of the two is of another mechanism. ``margin_clear`` is that means are called equivalent which
    are a margin apart, above as often as below, ``same_clear`` means that are the same, ``all_clear`` all of
    them.
    """

    sizes: tuple[int, int]
    pairs: int
    same_alarms: list[Rate]
    same_joint: Rate
    any_alarm: Rate
    seen: list[Rate]
    seen_joint: Rate
    seen_at_all: Rate
    margin_clear: list[Rate]
    same_clear: list[Rate]
    all_clear: Rate

    @property
    def decides(self) -> bool:
        """Whether such samples mostly tell another mechanism apart, and find the same equivalent."""
        return min(self.seen_at_all.value, self.all_clear.value) >= POWER


def calibrated(
    pool: FloatArray,
    planted: FloatArray,
    sizes: tuple[int, int],
    margins: Margins,
    *,
    pairs: int = 1,
    draws: int,
) -> Calibration:
    """Return how the tests do on samples drawn with replacement from a pool (N, k), and one of the planted.

    ``planted`` (M, k) are members of another mechanism, ``pairs`` as of ``told_apart_p``. The pool is taken
    for the distribution: two samples are independent draws from it, and a member may be in both, as two
    values of a distribution may be alike. ``draws`` is a multiple of ``BATCH``.
    """
    rng, k, told = np.random.default_rng(SEED), pool.shape[-1], list[tuple[FloatArray, ...]]()
    for count in [BATCH] * (draws // BATCH):
        one, other, elsewhere = (
            Sample.of(of[rng.integers(len(of), size=(count, size))])
            for of, size in ((pool, sizes[0]), (pool, sizes[1]), (planted, sizes[0]))
        )
        sides = [equivalence_p(move(one), other, margins) for move in (margins.above, margins.below)]
        told.append(
            (
                told_apart_p(one, other, pairs),
                told_apart_p(elsewhere, other, pairs),
                np.where(np.arange(count)[:, None] % 2, *sides),
                equivalence_p(one, other, margins),
            )
        )
    same, seen, at_margin, clear = (np.concatenate(each) for each in zip(*told, strict=True))

    def rate(p: FloatArray, level: float = LEVEL) -> Rate:
        return Rate(int((p <= level).sum()), draws)

    return Calibration(
        sizes,
        pairs,
        same_alarms=[rate(p) for p in same.T[:k]],
        same_joint=rate(same[:, k]),
        any_alarm=rate(same.min(axis=-1)),
        seen=[rate(p) for p in seen.T[:k]],
        seen_joint=rate(seen[:, k]),
        seen_at_all=rate(seen.min(axis=-1)),
        margin_clear=[rate(p, BEYOND_LEVEL) for p in at_margin.T],
        same_clear=[rate(p, BEYOND_LEVEL) for p in clear.T],
        all_clear=rate(clear.max(axis=-1), BEYOND_LEVEL),
    )
