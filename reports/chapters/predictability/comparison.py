"""Ensembles against their model twins past the horizon, and how often the tests are right."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reports.chapters.predictability import data
from reports.chapters.predictability.data import Pair
from reports.chapters.predictability.statistics import (
    BEYOND_LEVEL,
    LEVEL,
    POWER,
    Calibration,
    Interval,
    Margins,
    Rate,
    Sample,
    calibrated,
    difference,
    equivalence_p,
    told_apart_p,
)
from reports.parts import Table
from reports.results import FloatArray
from reports.tables import ABSENT

#: Draws from the reference's members in which alarms are counted: of 500 there were 7.4 % where 5 % is right.
DRAWS = 10_000
PERCENT = f"{100 * (1 - 2 * BEYOND_LEVEL):.0f} %"
TOO_FEW = "too few members to decide"


@dataclass(frozen=True)
class Verdict:
    """What the tests say of a pair: p of differences, ``alone`` (k,) and ``joint``, and of equivalence (k,).

    ``differences`` are in units of the margin. Tests of such sizes are as good as ``calibration`` has it:
    where they do not decide, nothing is said.
    """

    pair: Pair
    quantities: list[str]
    calibration: Calibration
    alone: FloatArray
    joint: float
    equivalent: FloatArray
    differences: list[Interval]

    @property
    def decides(self) -> bool:
        """Whether there are enough members."""
        return self.calibration.decides

    @property
    def differing(self) -> list[str]:
        """The quantities that are told apart, in words."""
        return self._named(self.alone <= LEVEL)

    @property
    def undecided(self) -> list[str]:
        """The quantities that are not shown to be within the margin, in words."""
        return self._named(self.equivalent > BEYOND_LEVEL)

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
        if not self.decides:
            return TOO_FEW
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
    pairs, quantities = data.pairs(by_label), data.shown(by_label)
    if not pairs:
        return []
    own, other = (
        data.matrix(members, quantities) for members in (data.control(by_label), by_label[data.PLANTED])
    )
    margins = data.margins(quantities)
    by_sizes = {
        sizes: calibrated(own, other, sizes, margins, pairs=len(pairs), draws=DRAWS)
        for sizes in {pair.sizes: None for pair in pairs}
    }
    return [_verdict(pair, quantities, margins, by_sizes[pair.sizes]) for pair in pairs]


def _verdict(pair: Pair, quantities: list[str], margins: Margins, calibration: Calibration) -> Verdict:
    one, other = (Sample.of(data.matrix(of, quantities)) for of in (pair.members, pair.of_twin))
    apart = difference(one, other)
    ends = np.transpose([apart.value, *apart.interval()] / margins.sizes(other))
    *alone, joint = told_apart_p(one, other, calibration.pairs)
    return Verdict(
        pair,
        quantities,
        calibration,
        np.array(alone),
        float(joint),
        equivalence_p(one, other, margins),
        [Interval(*map(float, each)) for each in ends],
    )


def verdict_table(verdicts: list[Verdict], scene: str) -> Table:
    """Return the verdict on every pair; of too few members there is nothing else."""

    def cells(of: Callable[[Verdict], str]) -> list[str]:
        return [of(each) if each.decides else ABSENT for each in verdicts]

    return Table.of(
        f"predictability-verdicts-{scene}",
        f"Ensembles against their twins on {scene}",
        "The twin is the reference with the engine's own contact law where that differs from the scene's, "
        "else all of the reference's members. "
        "Equivalent: two one-sided tests put every quantity within its margin. Different: the joint test of "
        "all means (Krishnamoorthy and Yu), or Welch's of a single one, tells the two apart, after Holm's "
        "correction for the number of tests and Bonferroni's for that of pairs. Open: neither. Levels are "
        f"{100 * LEVEL:.0f} %, of equivalence {100 * BEYOND_LEVEL:.0f} %. {TOO_FEW.capitalize()}: in less "
        f"than {100 * POWER:.0f} % of draws of so many a clearance that is a tenth smaller is told apart, or "
        f"what is the same called equivalent. {data.WHY_MARGINS}",
        {
            "ensemble": [each.pair.label for each in verdicts],
            "twin": [each.pair.twin for each in verdicts],
            "members": [_sizes(each.pair.sizes) for each in verdicts],
            "p (joint)": cells(lambda each: _p(each.joint)),
            "quantities": [str(len(each.quantities)) for each in verdicts],
            "told apart": cells(lambda each: str(len(each.differing))),
            "within their margins": cells(lambda each: str(len(each.quantities) - len(each.undecided))),
            "verdict": [each.words for each in verdicts],
        },
    )


def _sizes(sizes: tuple[int, int]) -> str:
    return f"{sizes[0]} and {sizes[1]}"


def compared(verdicts: list[Verdict], scene: str) -> Table | None:
    """Return every pair of enough members quantity by quantity."""
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
        if each.decides
        for q, quantity in enumerate(each.quantities)
    ]
    if not cells:
        return None
    return Table(
        f"predictability-tests-{scene}",
        f"Ensembles against their twins on {scene}, by quantity",
        f"The difference of the means, in percent of the twin's but for phases, with its {PERCENT} "
        "interval; p that the means are the same (Welch, after Holm's correction for the number of tests and "
        "Bonferroni's for that of pairs); p that they differ by the margin or more (two one-sided tests). "
        "Ensembles of too few members to decide are left out.",
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


def calibrations(verdicts: list[Verdict]) -> list[Calibration]:
    """Return how the tests do at the sizes of all pairs, each once."""
    return list({each.pair.sizes: each.calibration for each in verdicts}.values())


def calibration_table(calibrations: list[Calibration], quantities: list[str], scene: str) -> Table:
    """Return false-alarm rates and power of all tests, by sizes and quantity."""
    cells = []
    for of in calibrations:
        sizes, columns = _sizes(of.sizes), (of.same_alarms, of.seen, of.margin_clear, of.same_clear)
        for q, quantity in enumerate(quantities):
            cells.append((sizes, data.QUANTITIES[quantity], *(_rate(column[q]) for column in columns)))
        jointly, together = (
            (_rate(of.same_joint), _rate(of.seen_joint)),
            map(_rate, (of.any_alarm, of.seen_at_all)),
        )
        cells.append((sizes, "jointly", *jointly, ABSENT, ABSENT))
        cells.append((sizes, "all together", *together, ABSENT, _rate(of.all_clear)))
    low, high = Rate(round(LEVEL * DRAWS), DRAWS).interval
    return Table(
        f"predictability-calibration-{scene}",
        f"How often the tests are right on {scene}",
        f"Shares of {DRAWS} draws of two samples from the reference's members, or of one from those with a "
        "clearance that is a tenth smaller. A false alarm tells apart what is the same: at most "
        f"{100 * LEVEL / calibrations[0].pairs:.2g} % in all together, as {calibrations[0].pairs} pairs are "
        "compared. A false equivalence is called where means are the margin apart: at most "
        f"{100 * LEVEL:.0f} %, which is counted as {100 * low:.1f} to {100 * high:.1f} %. Power is how often "
        "the smaller clearance is told apart, and what is the same called equivalent.",
        (
            *("members", "quantity", "false alarm", "power to see a tenth less clearance"),
            *("false equivalence", "power of equivalence"),
        ),
        tuple(cells),
    )


def _rate(rate: Rate) -> str:
    return f"{100 * rate.value:.1f} %"
