"""Engines against their model twins past the horizon, and how far the tests can be trusted."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from reports.chapters.predictability import data, statistics
from reports.chapters.predictability.statistics import CONFIDENCE, LEVEL, Rate
from reports.parts import Table
from reports.results import FloatArray

#: Draws from the reference's members in which false alarms are counted.
DRAWS = 300
#: Of fewer members p-values are too coarse for their level to be told.
FEWEST = 8
_PERCENT = f"{100 * CONFIDENCE:.0f} %"


def compared(by_label: data.Ensembles, scene: str) -> Table | None:
    """Return every engine against its model twin, quantity by quantity."""
    quantities = data.shown(by_label)
    cells = [
        cell
        for label, twin in data.compared(by_label)
        for cell in _comparison(by_label, label, twin, quantities)
    ]
    if not cells:
        return None
    return Table(
        f"predictability-tests-{scene}",
        f"Engines against their model twins on {scene}",
        f"The difference of the means, in percent of the twin's but for phases, with its {_PERCENT} "
        "bootstrap interval; p of the permutation test, alone and after Holm's correction for the number of "
        "quantities; p of the test of Kolmogorov and Smirnov, which sees differences of shape too.",
        ("engine", "quantity", "difference", "p (means)", "p (Holm)", "p (shape)"),
        tuple(cells),
    )


def _comparison(
    by_label: data.Ensembles, label: str, twin: str, quantities: Sequence[str]
) -> list[tuple[str, ...]]:
    one, other = (data.matrix(by_label[each], quantities) for each in (label, twin))
    p = statistics.permutation_p(one, other)
    shown = [
        [f"{each:.3f}" for each in row]
        for row in (p, statistics.holm(p), statistics.kolmogorov_smirnov_p(one, other))
    ]
    differences = map(_difference, quantities, one.T, other.T)
    words = [data.QUANTITIES[quantity] for quantity in quantities]
    return [(label, *cells) for cells in zip(words, differences, *shown, strict=True)]


def _difference(quantity: str, one: np.ndarray, other: np.ndarray) -> str:
    difference = statistics.difference_interval(one, other)
    if _is_absolute(quantity, other):
        return f"{difference.mean:+.2f} ({difference.low:+.2f} to {difference.high:+.2f})"
    scale = 100 / abs(other.mean())
    mean, low, high = (scale * end for end in (difference.mean, difference.low, difference.high))
    return f"{mean:+.1f} % ({low:+.1f} to {high:+.1f})"


@dataclass(frozen=True)
class Alarms:
    """How often each test tells the reference's own members (n, k) of ``pool`` from one another.

    Rates are by quantity, of samples of ``size`` members.
    """

    quantities: list[str]
    pool: FloatArray
    size: int
    by_means: list[Rate]
    by_any: list[Rate]


def alarms(by_label: data.Ensembles) -> Alarms | None:
    """Return how often the tests tell the reference from itself, None of few members."""
    quantities = data.shown(by_label)
    groups = _own(by_label, quantities)
    if len(groups) < 2 or min(map(len, groups)) < FEWEST:
        return None
    pool = np.concatenate(groups)
    size = min(min(map(len, groups)), len(pool) // 2)
    return Alarms(quantities, pool, size, *statistics.false_alarms(pool, size, DRAWS))


def _own(by_label: data.Ensembles, quantities: Sequence[str]) -> list[FloatArray]:
    """Return the reference's ensembles of a scene's own law, (n, k) each."""
    return [data.matrix(by_label[label], quantities) for label in data.OWN if label in by_label]


def false_alarm_table(alarms: Alarms, scene: str) -> Table:
    """Return the false-alarm rates of both tests, and what they could miss."""
    detectable = [
        _detectable(quantity, values, alarms.size)
        for quantity, values in zip(alarms.quantities, alarms.pool.T, strict=True)
    ]
    return Table.of(
        f"predictability-false-alarms-{scene}",
        f"False alarms of the tests on {scene}",
        f"How often two samples of {alarms.size} members are told apart at a nominal {100 * LEVEL:.0f} % "
        f"though both were drawn from the {len(alarms.pool)} members of the reference (its own starts, "
        f"others, and half the step): {DRAWS} draws, with the interval that as many independent ones would "
        "have. The last column is the difference of means that samples of this size show four times out "
        "of five.",
        {
            "quantity": [data.QUANTITIES[quantity] for quantity in alarms.quantities],
            "permutation of means": map(_rate, alarms.by_means),
            "Kolmogorov-Smirnov": map(_rate, alarms.by_any),
            "detectable difference": detectable,
        },
    )


def _detectable(quantity: str, values: np.ndarray, size: int) -> str:
    least = statistics.detectable_difference(values, size)
    return f"{least:.2f}" if _is_absolute(quantity, values) else f"{100 * least / abs(values.mean()):.0f} %"


def _is_absolute(quantity: str, values: np.ndarray) -> bool:
    """Return whether differences of a quantity are no parts of its mean."""
    return quantity in data.ABSOLUTE or values.mean() == 0


def _rate(rate: Rate) -> str:
    low, high = rate.interval
    return f"{100 * rate.value:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def told_apart(by_label: data.Ensembles) -> Rate:
    """Return how many of the tests of means between the reference's own ensembles sound an alarm."""
    samples = _own(by_label, data.shown(by_label))
    p = np.array([statistics.permutation_p(one, other) for one, other in combinations(samples, 2)])
    return Rate(int((p <= LEVEL).sum()), p.size)
