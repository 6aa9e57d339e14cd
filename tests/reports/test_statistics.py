"""The test of equivalence keeps its level, and its intervals are the textbooks'."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from reports.analysis import ensembles, statistics
from reports.analysis.statistics import Interval, Margins, Sample, difference, student_interval, verdict
from reports.quantities import finished
from reports.results import FloatArray, read_results

PUBLISHED = Path(__file__).parents[2] / "reports/published/results/predictability"
#: The part of samples whose means are a margin apart that may be called equivalent.
CLAIMED = 0.05
#: Sizes as those of an engine's ensemble and of the reference's, how many pairs are drawn, and at once.
SIZES, DRAWS, AT_ONCE = (200, 400), 20_000, 2000
Draw = Callable[[np.random.Generator, tuple[int, ...]], FloatArray]
#: What is drawn, with a mean of 10: skewed, as speeds and losses of impacts are, or of unequal scatter.
DISTRIBUTIONS: dict[str, Draw] = {
    "normal": lambda rng, shape: rng.normal(10, 1, shape),
    "skewed to the right": lambda rng, shape: 9 + rng.exponential(1, shape),
    "skewed to the left": lambda rng, shape: 11 - rng.exponential(1, shape),
    "one more scattered": lambda rng, shape: rng.normal(10, 1 if shape[1] == SIZES[0] else 3, shape),
}
MARGIN = Margins(np.array([0.06]), np.zeros(1))


def called_equivalent(draw: Draw, sizes: tuple[int, int], margins: Margins, side: int) -> FloatArray:
    """Return how many of ``DRAWS`` pairs a margin apart are called equivalent, (k,)."""
    rng, called = np.random.default_rng(11), np.zeros(len(margins.part))
    for _ in range(DRAWS // AT_ONCE):
        one, other = (draw(rng, (AT_ONCE, size, len(margins.part))) for size in sizes)
        apart = difference(
            Sample.of(one * (1 + side * margins.part) + side * margins.shift), Sample.of(other), margins
        )
        called += ((apart.low > -1) & (apart.high < 1)).sum(axis=0)
    return called


def exceeds(count: float) -> bool:
    """Whether so many calls are more than the part that is claimed makes but once in a thousand times."""
    return bool(stats.binom.sf(count - 1, DRAWS, CLAIMED) < 1e-3)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_of_means_a_margin_apart_five_percent_are_called_equivalent(name: str, side: int) -> None:
    """At most, on either side of the margin, and not by refusing everything."""
    (count,) = called_equivalent(DISTRIBUTIONS[name], SIZES, MARGIN, side)
    assert not exceeds(count), f"{count / DRAWS:.4f}"
    assert count > 0.6 * CLAIMED * DRAWS, f"{count / DRAWS:.4f}"


@pytest.mark.parametrize("side", [1, -1])
def test_it_is_so_for_members_of_the_reference_with_their_skewness(side: int) -> None:
    """A hundred members each, drawn with replacement from the published ones."""
    rows = ensembles.prepared(finished(read_results(PUBLISHED)))
    ((_, by_label),) = ensembles.by_scene(rows).items()
    names = ensembles.compared(by_label)
    assert len(names) >= 6, names
    pool = ensembles.matrix(ensembles.control(by_label), names)

    def draw(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
        return pool[rng.integers(len(pool), size=shape[:2])]

    called = called_equivalent(draw, (100, 200), ensembles.margins(names), side)
    rates = dict(zip(names, called / DRAWS, strict=True))
    assert not any(map(exceeds, called)), rates


def test_the_interval_of_a_shift_is_welchs() -> None:
    rng = np.random.default_rng(4)
    one, other = rng.normal(size=(30, 1)), 2 * rng.normal(size=(50, 1))
    welch = stats.ttest_ind(one[:, 0], other[:, 0], equal_var=False)
    found = difference(Sample.of(one), Sample.of(other), Margins(np.zeros(1), np.array([0.25])))
    ends = welch.confidence_interval(1 - 2 * statistics.ONE_SIDED_LEVEL)
    assert np.ravel([found.low, found.high]) == pytest.approx([ends.low / 0.25, ends.high / 0.25])
    assert found.mean == pytest.approx((one.mean() - other.mean()) / 0.25)


def test_an_interval_of_a_part_ends_where_a_one_sided_test_with_the_scatter_of_both_means_does() -> None:
    """Each end is where Sasabuchi's test, of one mean against so many times the other, has its level."""
    rng = np.random.default_rng(5)
    one, other = rng.normal(10, 2, size=(40, 1)), rng.normal(9, 3, size=(40, 1))
    found = difference(Sample.of(one), Sample.of(other), MARGIN)
    variances = [of.var(ddof=1) / 40 for of in (one, other)]
    freedom = sum(variances) ** 2 / sum(of**2 / 39 for of in variances)
    for end, sign in ((found.low, 1), (found.high, -1)):
        times = 1 + 0.06 * end[0]
        t = (one.mean() - times * other.mean()) / np.sqrt(variances[0] + times**2 * variances[1])
        assert stats.t.sf(sign * t, freedom) == pytest.approx(statistics.ONE_SIDED_LEVEL)


def test_a_part_of_a_mean_that_is_not_told_from_zero_has_no_end() -> None:
    values = np.array([[-1.0], [1.5]] * 10)
    found = difference(Sample.of(values + 5), Sample.of(values), MARGIN)
    assert (found.low[0], found.high[0]) == (-np.inf, np.inf)


def test_students_interval_is_that_of_the_distribution() -> None:
    values = np.array([1.0, 2.0, 4.0, 5.0])
    half = stats.t.ppf(0.975, 3) * values.std(ddof=1) / 2
    assert student_interval(values) == pytest.approx((3.0, 3.0 - half, 3.0 + half))


@pytest.mark.parametrize(
    ("ends", "size", "expected"),
    [
        ([(-0.5, 0.9), (-0.99, 0.1)], 20, "equivalent"),
        ([(-0.5, 0.9), (-1.01, 0.1)], 200, "undecided"),
        ([(-0.5, 0.9), (-3.0, -1.01)], 200, "different"),
        ([(1.01, 2.0), (-0.1, 0.1)], 200, "different"),
        ([(-0.5, 0.9), (-0.99, 0.1)], 19, "too few members"),
    ],
)
def test_all_quantities_within_are_equivalent_and_one_beyond_is_different(
    ends: list[tuple[float, float]], size: int, expected: str
) -> None:
    low, high = np.transpose(ends)
    assert verdict(Interval((low + high) / 2, low, high), (400, size)) == expected
