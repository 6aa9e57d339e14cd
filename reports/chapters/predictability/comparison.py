"""Ensembles against their model twins past the horizon, and how often the tests are right."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reports.chapters.predictability import data
from reports.chapters.predictability.data import Pair
from reports.chapters.predictability.statistics import (
    LEVEL,
    Calibration,
    Interval,
    Margins,
    Rate,
    calibrated,
    difference_intervals,
    equivalence_p,
    told_apart_p,
)
from reports.parts import Table
from reports.results import FloatArray
from reports.tables import ABSENT

#: Draws from the reference's members in which alarms are counted.
DRAWS = 500
_PERCENT = f"{100 * (1 - 2 * LEVEL):.0f} %"


@dataclass(frozen=True)
class Verdict:
    """What the tests say of a pair: p of differences, ``alone`` (k,) and ``joint``, and of equivalence (k,).

    ``differences`` are in units of the margin.
    """

    pair: Pair
    quantities: list[str]
    alone: FloatArray
    joint: float
    equivalent: FloatArray
    differences: list[Interval]

    @property
    def differing(self) -> list[str]:
        """The quantities that are told apart, in words."""
        return self._named(self.alone <= LEVEL)

    @property
    def undecided(self) -> list[str]:
        """The quantities that are not shown to be within the margin, in words."""
        return self._named(self.equivalent > LEVEL)

    @property
    def agrees(self) -> bool:
        """Whether all quantities are within the margin, which no correction is needed for (Berger 1982)."""
        return not self.undecided

    @property
    def told_apart(self) -> bool:
        """Whether any test tells the two apart."""
        return bool(self.differing) or self.joint <= LEVEL

    @property
    def words(self) -> str:
        """The verdict."""
        if self.agrees:
            return "equivalent, yet told apart" if self.told_apart else "equivalent"
        return "different" if self.told_apart else "open"

    def _named(self, which: NDArray[np.bool_]) -> list[str]:
        return [
            data.QUANTITIES[q].split(" [")[0]
            for q, is_one in zip(self.quantities, which, strict=True)
            if is_one
        ]


def verdicts(by_label: data.Ensembles) -> list[Verdict]:
    """Return what the tests say of every pair of a scene's ensembles."""
    quantities = data.shown(by_label)
    return [_verdict(pair, quantities, data.margins(quantities)) for pair in data.pairs(by_label)]


def _verdict(pair: Pair, quantities: list[str], margins: Margins) -> Verdict:
    one, other = pair.one, pair.other
    ends = (one.mean(axis=0) - other.mean(axis=0), *difference_intervals(one, other))
    differences = [Interval(*map(float, each)) for each in np.transpose(ends / margins.sizes(other))]
    *alone, joint = told_apart_p(one, other)
    equivalent = equivalence_p(one, other, margins)
    return Verdict(pair, quantities, np.array(alone), float(joint), equivalent, differences)


def verdict_table(verdicts: list[Verdict], scene: str) -> Table:
    """Return the verdict on every pair."""
    return Table.of(
        f"predictability-verdicts-{scene}",
        f"Ensembles against their twins on {scene}",
        "The twin is the reference with the engine's own contact law where that differs from the scene's. "
        "Equivalent: two one-sided tests put every quantity within its margin. Different: Hotelling's joint "
        "test of all means, or Welch's of a single one, tells the two apart, all after Holm's correction for "
        "their number. Open: neither, the members being too few. All levels are "
        f"{100 * LEVEL:.0f} %.",
        {
            "ensemble": [each.pair.label for each in verdicts],
            "twin": [each.pair.twin for each in verdicts],
            "members each": [str(len(each.pair.one)) for each in verdicts],
            "p (joint)": [_p(each.joint) for each in verdicts],
            "quantities": [str(len(each.quantities)) for each in verdicts],
            "told apart": [str(len(each.differing)) for each in verdicts],
            "within their margins": [str(len(each.quantities) - len(each.undecided)) for each in verdicts],
            "verdict": [each.words for each in verdicts],
        },
    )


def compared(verdicts: list[Verdict], scene: str) -> Table:
    """Return every pair quantity by quantity."""
    cells = [
        (
            each.pair.label,
            data.QUANTITIES[quantity],
            _margin(quantity),
            _difference(quantity, each.differences[q]),
            _p(each.alone[q]),
            _p(each.equivalent[q]),
        )
        for each in verdicts
        for q, quantity in enumerate(each.quantities)
    ]
    return Table(
        f"predictability-tests-{scene}",
        f"Ensembles against their twins on {scene}, by quantity",
        f"The difference of the means, in percent of the twin's but for phases, with its {_PERCENT} "
        "interval; p that the means are the same (Welch, after Holm's correction for the number of tests); p "
        "that they differ by the margin or more (two one-sided tests).",
        ("ensemble", "quantity", "margin", "difference", "p (same)", "p (beyond the margin)"),
        tuple(cells),
    )


def _p(value: float) -> str:
    return f"{value:.3f}" if value >= 0.001 else "< 0.001"


def _margin(quantity: str) -> str:
    if quantity in data.SHIFTS:
        return f"{data.SHIFTS[quantity]:g}"
    return f"{100 * data.PARTS_OF_MEAN[quantity]:g} %"


def _difference(quantity: str, in_margins: Interval) -> str:
    mean, low, high = in_margins.mean, in_margins.low, in_margins.high
    if quantity in data.SHIFTS:
        mean, low, high = (data.SHIFTS[quantity] * end for end in (mean, low, high))
        return f"{mean:+.3f} ({low:+.3f} to {high:+.3f})"
    mean, low, high = (100 * data.PARTS_OF_MEAN[quantity] * end for end in (mean, low, high))
    return f"{mean:+.2f} % ({low:+.2f} to {high:+.2f})"


def calibrations(by_label: data.Ensembles, verdicts: list[Verdict]) -> list[Calibration]:
    """Return how the tests do at every size of a pair, by members of the reference; none without a pair."""
    pool, margins = data.pool(by_label), data.margins(data.shown(by_label))
    sizes = sorted({len(each.pair.one) for each in verdicts})
    return [calibrated(pool, size, margins, DRAWS) for size in sizes]


def calibration_table(calibrations: list[Calibration], quantities: list[str], scene: str) -> Table:
    """Return false-alarm rates and power of all tests, by size and quantity."""
    cells = []
    for of_size in calibrations:
        size = str(of_size.size)
        columns = (
            *(of_size.same_alarms, of_size.planted_alarms, of_size.planted_joint),
            *(of_size.planted_clear, of_size.same_clear),
        )
        for q, quantity in enumerate(quantities):
            cells.append((size, data.QUANTITIES[quantity], *(_rate(column[q]) for column in columns)))
        absent = (ABSENT,) * 3
        cells.append((size, "jointly", _rate(of_size.same_joint), *absent, ABSENT))
        cells.append((size, "all together", _rate(of_size.any_alarm), *absent, _rate(of_size.all_clear)))
    return Table(
        f"predictability-calibration-{scene}",
        f"How often the tests are right on {scene}",
        f"Shares of {DRAWS} draws of two samples from the reference's members, as they are or with a "
        "difference of the margin planted in one quantity. A false alarm tells apart what is the same; a "
        "false equivalence is called where the margin is reached: at most "
        f"{100 * LEVEL:.0f} % if the tests are right, of alarms in all together. Power is how often what is "
        "planted is seen, by the quantity's own test or jointly, and what is the same is called equivalent.",
        (
            *("members each", "quantity", "false alarm", "power at the margin"),
            *("joint power at the margin", "false equivalence", "power of equivalence"),
        ),
        tuple(cells),
    )


def _rate(rate: Rate) -> str:
    return f"{100 * rate.value:.1f} %"
