"""Intervals and tests over members of ensembles, and how often the tests sound a false alarm."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import stats

from reports.results import FloatArray

#: Confidence of every interval, and level of every test.
CONFIDENCE, LEVEL = 0.95, 0.05
RESAMPLES, PERMUTATIONS = 4000, 1999
#: Every call begins with the same random numbers, so that a report is the same whenever it is made.
SEED = 20240229


@dataclass(frozen=True)
class Interval:
    """A mean and the ends of its confidence interval."""

    mean: float
    low: float
    high: float


def mean_interval(values: FloatArray) -> Interval:
    """Return the mean of independent values (n,) with its bootstrap interval (percentiles, Efron 1979)."""
    return difference_interval(values, np.zeros(1))


def student_interval(values: FloatArray) -> Interval:
    """Return the mean of a few independent values (n,), n > 1, with Student's interval.

    A bootstrap of five values would be too narrow by a quarter.
    """
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(CONFIDENCE)
    return Interval(float(values.mean()), float(low), float(high))


def difference_interval(one: FloatArray, other: FloatArray) -> Interval:
    """Return the difference of the means of two samples, (n,) and (m,), with its bootstrap interval."""
    rng = np.random.default_rng(SEED)
    means = [
        values[rng.integers(len(values), size=(RESAMPLES, len(values)))].mean(axis=1)
        for values in (one, other)
    ]
    low, high = np.quantile(means[0] - means[1], [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Interval(float(one.mean() - other.mean()), float(low), float(high))


def permutation_p(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the two-sided p of a difference of means of samples (n, k) and (m, k) of k quantities, (k,).

    Members are reassigned to the samples at random, whole, so that no distribution is assumed (Fisher 1935).
    """
    pooled, n = np.concatenate([one, other]), len(one)
    parts = _reassignments(len(pooled), n)
    differences = np.abs(parts @ pooled)
    observed = np.abs(one.mean(axis=0) - other.mean(axis=0))
    # The observed assignment is one of those possible; ties within round-off count as such.
    beyond = (differences >= observed * (1 - 1e-12)).sum(axis=0)
    return np.asarray((1 + beyond) / (1 + PERMUTATIONS))


@lru_cache(maxsize=8)
def _reassignments(total: int, n: int) -> FloatArray:
    """Return weights (PERMUTATIONS, total) that give the difference of means of a random n and the rest."""
    order = np.random.default_rng(SEED).permuted(np.tile(np.arange(total), (PERMUTATIONS, 1)), axis=1)
    return np.where(order < n, 1 / n, -1 / (total - n))


def kolmogorov_smirnov_p(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the p of Kolmogorov and Smirnov's test of samples (n, k) and (m, k), (k,)."""
    return np.asarray(stats.ks_2samp(one, other, method="exact", axis=0).pvalue)


def holm(p: FloatArray) -> FloatArray:
    """Return p-values (k,) raised so that any false alarm among them has the level's chance (Holm 1979)."""
    order = np.argsort(p)
    raised = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    out = np.empty(len(p))
    out[order] = np.minimum(raised, 1.0)
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


def false_alarms(pool: FloatArray, size: int, draws: int) -> tuple[list[Rate], list[Rate]]:
    """Return how often each test tells two samples of ``size`` apart that come from one pool (n, k).

    The first list is of the permutation test, the second of Kolmogorov and Smirnov's, one for each quantity.
    """
    rng = np.random.default_rng(SEED)
    alarms = np.zeros((2, pool.shape[1]), dtype=int)
    for _ in range(draws):
        chosen = pool[rng.choice(len(pool), 2 * size, replace=False)]
        one, other = chosen[:size], chosen[size:]
        for row, test in zip(alarms, (permutation_p, kolmogorov_smirnov_p), strict=True):
            row += test(one, other) <= LEVEL
    by_means, by_any = ([Rate(int(count), draws) for count in row] for row in alarms)
    return by_means, by_any


def detectable_difference(values: FloatArray, size: int) -> float:
    """Return the difference of means that samples of ``size`` of such values (n,) show 4 times of 5.

    By the normal approximation: (1.96 + 0.84) standard errors of a difference.
    """
    quantiles = stats.norm.ppf(1 - LEVEL / 2) + stats.norm.ppf(0.8)
    return float(quantiles * values.std(ddof=1) * np.sqrt(2 / size))
