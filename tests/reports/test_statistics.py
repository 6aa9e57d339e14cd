"""Tests of ensembles keep their level and have the power that they claim."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from engine_models.engine import FloatArray
from reports.chapters.predictability import statistics
from reports.chapters.predictability.statistics import Margins

TRIALS, SIZE = 2000, 100
MARGINS = Margins(np.array([0.04, 0.05, 0.0]), np.array([0.0, 0.0, 0.07]))


def members(seed: int) -> tuple[FloatArray, FloatArray]:
    """Two samples of each trial: a correlated pair of skewed quantities about 10, and one phase about 0."""
    rng, shape = np.random.default_rng(seed), (2, TRIALS, SIZE)
    common, own = rng.exponential(size=shape), rng.exponential(size=shape)
    one, other = np.stack([9 + common, 8 + common + own, rng.uniform(-0.3, 0.3, shape)], axis=-1)
    return one, other


def rate_of(p: FloatArray) -> statistics.Rate:
    """How often p is within the level."""
    return statistics.Rate(int((p <= statistics.LEVEL).sum()), TRIALS)


def test_single_tests_together_sound_false_alarms_at_most_at_the_nominal_rate() -> None:
    rate = rate_of(statistics.holm(statistics.difference_p(*members(1))).min(axis=-1))
    assert rate.interval[0] <= statistics.LEVEL, rate


def test_the_joint_test_sounds_false_alarms_at_its_nominal_rate() -> None:
    rate = rate_of(statistics.joint_p(*members(2)))
    assert rate.interval[0] <= statistics.LEVEL <= rate.interval[1], rate


def test_the_joint_test_sees_what_hides_in_the_scatter_of_each_quantity() -> None:
    one, other = members(3)
    moved = one + np.array([0.2, -0.2, 0.0])  # a fifth of the scatter each, against their correlation
    alone = rate_of(statistics.holm(statistics.difference_p(moved, other)).min(axis=-1))
    assert rate_of(statistics.joint_p(moved, other)).interval[0] > 2 * alone.interval[1]


def test_the_joint_test_of_one_quantity_is_students() -> None:
    rng = np.random.default_rng(4)
    one, other = rng.normal(size=(2, 30, 1))
    assert statistics.joint_p(one, other) == pytest.approx(stats.ttest_ind(one[:, 0], other[:, 0]).pvalue)


@pytest.mark.parametrize("move", [MARGINS.above, MARGINS.below])
def test_samples_a_margin_apart_are_called_equivalent_at_most_at_the_nominal_rate(
    move: Callable[[FloatArray], FloatArray],
) -> None:
    one, other = members(5)
    for quantity, p in enumerate(statistics.equivalence_p(move(one), other, MARGINS).T):
        low, high = rate_of(p).interval
        assert low <= statistics.LEVEL <= high, f"quantity {quantity}: {rate_of(p)}"


def test_equivalence_is_that_of_schuirmanns_two_tests() -> None:
    one, other = (sample[0] for sample in members(6))
    shift = Margins(np.zeros(3), np.array([0.3, 0.3, 0.05]))
    p = statistics.equivalence_p(one, other, shift)
    low, high = statistics.difference_intervals(one, other)
    within = (low > -shift.shift) & (high < shift.shift)
    np.testing.assert_array_equal(p <= statistics.LEVEL, within)


def test_calibration_finds_the_level_and_the_power_of_students_test() -> None:
    rng, size = np.random.default_rng(7), 50
    pool = rng.normal(10, 1, size=(4000, 1))
    margins = Margins(np.array([0.05]), np.zeros(1))
    found = statistics.calibrated(pool, size, margins, 1000)
    # Of one quantity the joint test is its own once more, and Holm halves the level of both. The means are
    # half a standard deviation apart: the noncentral distribution of Student's t.
    level, freedom, away = statistics.LEVEL / 2, 2 * size - 2, 0.5 * np.sqrt(size / 2)
    beyond = stats.t.ppf(1 - level / 2, freedom)
    power = stats.nct.sf(beyond, freedom, away) + stats.nct.cdf(-beyond, freedom, away)
    expected = {
        "false alarm": (found.any_alarm, level),
        "power": (found.planted_joint[0], power),
        "false equivalence": (found.planted_clear[0], statistics.LEVEL),
    }
    for name, (rate, chance) in expected.items():
        low, high = rate.interval
        # The pool is one draw itself: its own spread is known to a hundredth, which moves power by as much.
        assert low - 0.01 <= chance <= high + 0.01, f"{name}: {rate} against {chance}"


def test_holms_correction_is_the_textbooks() -> None:
    corrected = statistics.holm(np.array([0.01, 0.04, 0.03, 0.005]))
    assert corrected == pytest.approx([0.03, 0.06, 0.06, 0.02])
