"""Engines against their model twins past the horizon, and how far the tests can be trusted."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from reports.chapters.predictability import data
from reports.chapters.predictability.statistics import (
    CONFIDENCE,
    LEVEL,
    Rate,
    detectable_difference,
    difference_interval,
    false_alarms,
    holm,
    kolmogorov_smirnov_p,
    permutation_p,
)
from reports.parts import Table
from reports.style import Name, title

#: Draws from the reference's members in which false alarms are counted.
DRAWS = 300
#: Of fewer members p-values are too coarse for their level to be told.
FEWEST = 8
_PERCENT = f"{100 * CONFIDENCE:.0f} %"


def compared(found: data.Ensembles, scene: str) -> Table | None:
    """Return every engine against its model twin, quantity by quantity."""
    quantities = data.shown(found)
    rows = [row for name, twin in data.compared(found) for row in _comparison(found, name, twin, quantities)]
    if not rows:
        return None
    return Table(
        f"predictability-tests-{scene}",
        f"Engines against their model twins on {scene}",
        f"The difference of the means, in percent of the twin's but for phases, with its {_PERCENT} "
        "bootstrap interval; p of the permutation test, alone and after Holm's correction for the number of "
        "quantities; p of the test of Kolmogorov and Smirnov, which sees differences of shape too.",
        ("engine", "quantity", "difference", "p (means)", "p (Holm)", "p (shape)"),
        tuple(rows),
    )


def _comparison(
    found: data.Ensembles, name: Name, twin: Name, quantities: Sequence[str]
) -> list[tuple[str, ...]]:
    one, other = (data.matrix(found[each], quantities) for each in (name, twin))
    p, shape = permutation_p(one, other), kolmogorov_smirnov_p(one, other)
    return [
        (
            title(name),
            data.QUANTITIES[quantity],
            _difference(quantity, a, b),
            f"{at:.3f}",
            f"{raised:.3f}",
            f"{ks:.3f}",
        )
        for quantity, a, b, at, raised, ks in zip(quantities, one.T, other.T, p, holm(p), shape, strict=True)
    ]


def _difference(quantity: str, one: np.ndarray, other: np.ndarray) -> str:
    found = difference_interval(one, other)
    if _is_absolute(quantity, other):
        return f"{found.mean:+.2f} ({found.low:+.2f} to {found.high:+.2f})"
    scale = 100 / abs(other.mean())
    return f"{scale * found.mean:+.1f} % ({scale * found.low:+.1f} to {scale * found.high:+.1f})"


Alarms = tuple[list[str], list[Rate], list[Rate]]


def alarms(found: data.Ensembles) -> Alarms | None:
    """Return the quantities and how often each test tells the reference from itself, None of few members."""
    groups = [found[data.REFERENCE, arm] for arm in data.OWN if (data.REFERENCE, arm) in found]
    if len(groups) < 2 or min(map(len, groups)) < FEWEST:
        return None
    quantities = data.shown(found)
    pool = data.matrix([run for group in groups for run in group], quantities)
    size = min(min(map(len, groups)), len(pool) // 2)
    return quantities, *false_alarms(pool, size, DRAWS)


def false_alarm_table(found: data.Ensembles, scene: str, counted: Alarms) -> Table:
    """Return the false-alarm rates of both tests, and what they could miss."""
    groups = [found[data.REFERENCE, arm] for arm in data.OWN if (data.REFERENCE, arm) in found]
    size = len(groups[0])
    pool = data.matrix([run for group in groups for run in group], counted[0])
    rows = [
        (
            data.QUANTITIES[quantity],
            _rate(by_means),
            _rate(by_any),
            _detectable(quantity, column, size),
        )
        for quantity, by_means, by_any, column in zip(*counted, pool.T, strict=True)
    ]
    return Table(
        f"predictability-false-alarms-{scene}",
        f"False alarms of the tests on {scene}",
        f"How often two samples of {size} members are told apart at a nominal {100 * LEVEL:.0f} % though "
        f"both were drawn from the {len(pool)} members of the reference (its own starts, others, and half "
        f"the step): {DRAWS} draws, with the interval that as many independent ones would have. The last "
        "column is the difference of means that samples of this size show four times out of five.",
        ("quantity", "permutation of means", "Kolmogorov-Smirnov", "detectable difference"),
        tuple(rows),
    )


def _detectable(quantity: str, values: np.ndarray, size: int) -> str:
    least = detectable_difference(values, size)
    return f"{least:.2f}" if _is_absolute(quantity, values) else f"{100 * least / abs(values.mean()):.0f} %"


def _is_absolute(quantity: str, values: np.ndarray) -> bool:
    """Return whether differences of a quantity are no parts of its mean."""
    return quantity in data.ABSOLUTE or values.mean() == 0


def _rate(rate: Rate) -> str:
    low, high = rate.interval
    return f"{100 * rate.value:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def told_apart(found: data.Ensembles) -> Rate:
    """Return how many of the tests of means between the reference's own ensembles sound an alarm."""
    quantities = data.shown(found)
    samples = [
        data.matrix(found[data.REFERENCE, arm], quantities)
        for arm in data.OWN
        if (data.REFERENCE, arm) in found
    ]
    p = np.array([permutation_p(one, other) for one, other in combinations(samples, 2)])
    return Rate(int((p <= LEVEL).sum()), p.size)
