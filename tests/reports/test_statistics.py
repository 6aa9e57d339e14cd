"""Tests of ensembles keep their level and have the power that they claim."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from engine_models.engine import FloatArray
from reports.chapters.predictability import statistics
from reports.chapters.predictability.statistics import Margins, Sample

TRIALS, SIZE = 2000, 100
#: Sizes as those of an engine's ensemble and the control's, draws of these, and what is drawn: mean 10 each.
UNEQUAL, DRAWS, BATCHES = (200, 400), 2000, 10
DISTRIBUTIONS: dict[str, Callable[[np.random.Generator, tuple[int, ...]], FloatArray]] = {
    "normal": lambda rng, shape: rng.normal(10, 1, shape),
    "skewed to the right": lambda rng, shape: 9 + rng.exponential(1, shape),
    "skewed to the left": lambda rng, shape: 11 - rng.exponential(1, shape),
    "one more scattered": lambda rng, shape: rng.normal(10, 1 if shape[1] == UNEQUAL[0] else 3, shape),
}
MARGINS = Margins(np.array([0.04, 0.05, 0.0]), np.array([0.0, 0.0, 0.07]))


def samples(seed: int) -> tuple[Sample, Sample]:
    one, other = members(seed)
    return Sample.of(one), Sample.of(other)


def members(seed: int) -> tuple[FloatArray, FloatArray]:
    """Two samples of each trial: a correlated pair of skewed quantities about 10, and one phase about 0."""
    rng, shape = np.random.default_rng(seed), (2, TRIALS, SIZE)
    common, own = rng.exponential(size=shape), rng.exponential(size=shape)
    one, other = np.stack([9 + common, 8 + common + own, rng.uniform(-0.3, 0.3, shape)], axis=-1)
    return one, other


def rate_of(p: FloatArray, level: float = statistics.LEVEL) -> statistics.Rate:
    """How often p is within the level."""
    return statistics.Rate(int((p <= level).sum()), TRIALS)


def test_single_tests_together_sound_false_alarms_at_most_at_the_nominal_rate() -> None:
    rate = rate_of(statistics.holm(statistics.difference_p(*samples(1))).min(axis=-1))
    assert rate.interval[0] <= statistics.LEVEL, rate


def test_the_joint_test_sounds_false_alarms_at_its_nominal_rate() -> None:
    rate = rate_of(statistics.joint_p(*samples(2)))
    assert rate.interval[0] <= statistics.LEVEL <= rate.interval[1], rate


def test_the_joint_test_sees_what_hides_in_the_scatter_of_each_quantity() -> None:
    one, other = members(3)
    moved = one + np.array([0.2, -0.2, 0.0])  # a fifth of the scatter each, against their correlation
    both = Sample.of(moved), Sample.of(other)
    alone = rate_of(statistics.holm(statistics.difference_p(*both)).min(axis=-1))
    assert rate_of(statistics.joint_p(*both)).interval[0] > 2 * alone.interval[1]


def test_tests_of_one_quantity_are_welchs_whatever_the_sizes() -> None:
    rng = np.random.default_rng(4)
    one, other = rng.normal(size=(30, 1)), 2 * rng.normal(size=(50, 1))
    welch = stats.ttest_ind(one[:, 0], other[:, 0], equal_var=False)
    found = Sample.of(one), Sample.of(other)
    assert statistics.joint_p(*found) == pytest.approx(welch.pvalue)
    assert statistics.difference_p(*found) == pytest.approx(welch.pvalue)
    ends = welch.confidence_interval(1 - 2 * statistics.BEYOND_LEVEL)
    assert np.ravel(statistics.difference(*found).interval()) == pytest.approx([ends.low, ends.high])


def test_the_joint_test_of_samples_of_one_size_and_scatter_is_hotellings() -> None:
    """With the same pattern of scatter in both, whose covariance is then that of either."""
    rng, n, k = np.random.default_rng(9), 25, 3
    scatter = rng.normal(size=(n, k))
    moved = np.array([0.3, -0.1, 0.5])
    covariance = np.cov(scatter.T)
    distance = n / 2 * moved @ np.linalg.solve(covariance, moved)
    expected = stats.f.sf((2 * n - 2 - k + 1) / ((2 * n - 2) * k) * distance, k, 2 * n - 2 - k + 1)
    found = statistics.joint_p(Sample.of(scatter + moved), Sample.of(scatter))
    assert found == pytest.approx(expected, rel=1e-10)


def test_the_joint_test_keeps_its_level_where_the_smaller_sample_scatters_more() -> None:
    """As Hotelling's does not: with these it sounds them in 44 % of draws."""
    rng = np.random.default_rng(10)
    one, other = 3 * rng.normal(size=(TRIALS, 50, 3)), rng.normal(size=(TRIALS, 200, 3))
    rate = rate_of(statistics.joint_p(Sample.of(one), Sample.of(other)))
    assert rate.interval[0] <= statistics.LEVEL <= rate.interval[1], rate


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_at_most_the_promised_part_of_means_a_margin_apart_is_called_equivalent(name: str) -> None:
    """On either side of the margin, however samples scatter, and not by refusing everything."""
    rng, margins = np.random.default_rng(11), Margins(np.array([0.06]), np.zeros(1))
    for move in (margins.above, margins.below):
        called = trials = 0
        for _ in range(BATCHES):
            one, other = (Sample.of(DISTRIBUTIONS[name](rng, (DRAWS, size, 1))) for size in UNEQUAL)
            p = statistics.equivalence_p(move(one), other, margins)
            called, trials = called + int((p <= statistics.BEYOND_LEVEL).sum()), trials + DRAWS
        rate = statistics.Rate(called, trials)
        assert not rate.exceeds(statistics.LEVEL), f"{move.__name__}: {rate.value:.4f}"
        assert rate.value > 0.6 * statistics.LEVEL, f"{move.__name__}: {rate.value:.4f}"


@pytest.mark.parametrize("move", [MARGINS.above, MARGINS.below])
def test_samples_a_margin_apart_are_called_equivalent_at_the_level_of_each_test(
    move: Callable[[Sample], Sample],
) -> None:
    one, other = samples(5)
    for quantity, p in enumerate(statistics.equivalence_p(move(one), other, MARGINS).T):
        low, high = rate_of(p, statistics.BEYOND_LEVEL).interval
        assert low <= statistics.BEYOND_LEVEL <= high, f"quantity {quantity}: {low:.3f} to {high:.3f}"


def test_equivalence_is_an_interval_within_the_margins() -> None:
    one, other = (Sample.of(sample[0]) for sample in members(6))
    shift = Margins(np.zeros(3), np.array([0.3, 0.3, 0.05]))
    p = statistics.equivalence_p(one, other, shift)
    low, high = statistics.difference(one, other).interval()
    within = (low > -shift.shift) & (high < shift.shift)
    np.testing.assert_array_equal(p <= statistics.BEYOND_LEVEL, within)


def test_calibration_finds_the_level_and_the_power_of_welchs_test() -> None:
    rng, size, pairs = np.random.default_rng(7), 50, 2
    pool, planted = rng.normal(10, 1, size=(2, 4000, 1))
    margins = Margins(np.array([0.05]), np.zeros(1))
    found = statistics.calibrated(pool, planted + 0.5, (size, size), margins, pairs=pairs, draws=1000)
    # Of one quantity the joint test is its own once more: Holm halves the level of both, and pairs once more.
    # The means are half a standard deviation apart: the noncentral distribution of Student's t.
    level, freedom, away = statistics.LEVEL / 2 / pairs, 2 * size - 2, 0.5 * np.sqrt(size / 2)
    beyond = stats.t.ppf(1 - level / 2, freedom)
    power = stats.nct.sf(beyond, freedom, away) + stats.nct.cdf(-beyond, freedom, away)
    # Both sides of the margin, which is as many standard deviations from the mean, have to be told from it.
    bound = away - stats.t.ppf(1 - statistics.BEYOND_LEVEL, freedom)
    expected = {
        "false alarm": (found.any_alarm, level),
        "power": (found.seen_at_all, power),
        "false equivalence": (found.margin_clear[0], statistics.BEYOND_LEVEL),
        "power of equivalence": (found.all_clear, 2 * stats.norm.cdf(bound) - 1),
    }
    for name, (rate, chance) in expected.items():
        low, high = rate.interval
        # The pool is one draw itself: its own spread is known to a hundredth, which moves power by as much.
        assert low - 0.01 <= chance <= high + 0.01, f"{name}: {rate} against {chance}"


def test_samples_decide_that_have_the_power_both_to_see_and_to_clear() -> None:
    rng = np.random.default_rng(8)
    pool, margins = rng.normal(10, 1, size=(4000, 1)), Margins(np.array([0.05]), np.zeros(1))
    for size, apart, decides in ((100, 0.6, True), (20, 1.5, False), (100, 0.1, False)):
        found = statistics.calibrated(pool, pool + apart, (size, size), margins, draws=500)
        powers = found.seen_at_all.value, found.all_clear.value
        assert found.decides == decides == (min(powers) >= 0.8), powers


def test_a_rate_exceeds_a_level_beyond_what_counting_tells() -> None:
    """Of 1000 draws with a chance of a half three spreads are 47: normal, to a few per cent of its tail."""
    assert not statistics.Rate(545, 1000).exceeds(0.5)
    assert statistics.Rate(552, 1000).exceeds(0.5)


def test_holms_correction_is_the_textbooks() -> None:
    corrected = statistics.holm(np.array([0.01, 0.04, 0.03, 0.005]))
    assert corrected == pytest.approx([0.03, 0.06, 0.06, 0.02])
