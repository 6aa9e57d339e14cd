"""Ensembles of the predictability study: their members, what is compared of them, and the verdicts."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from reports.analysis.statistics import (
    FEWEST,
    ONE_SIDED_LEVEL,
    TOO_FEW,
    Interval,
    Margins,
    Sample,
    difference,
    student_interval,
    verdict,
)
from reports.parts import Table
from reports.quantities import finished
from reports.results import FloatArray, with_columns
from reports.style import in_legend_order
from reports.tables import ABSENT

STUDY = "predictability"
#: The confidence of the intervals of differences.
PERCENT = f"{100 * (1 - 2 * ONE_SIDED_LEVEL):.0f} %"

#: The reference's two ensembles of a scene as it is, which differ in their starts: others are compared with
#: both. One with a tenth less clearance must not come out equivalent.
OWN = ("reference (DOP853)", "reference (other starts)")
PLANTED = "reference (a tenth less clearance)"
#: How the reference's ensembles with an engine's own contact law are called; the engine's label follows.
TWIN_OF = "reference (twin of "
#: The averages of a member that are compared, in words.
QUANTITIES = {
    "impact_speed_m_s": "impact speed [m/s]",
    "impacts_per_revolution": "impacts per revolution",
    "impulse_per_revolution_N_s": "impulse per revolution [N·s]",
    "dissipated_energy_per_revolution_J": "dissipated per revolution [J]",
    "flight_part": "fraction of time in free flight",
    "rms_slider_deviation_m": "slider deviation from ideal [mm]",
    "impact_phase_cosine": "mean cosine of impact phase",
    "impact_phase_sine": "mean sine of impact phase",
}
FACTORS = {"rms_slider_deviation_m": 1e3}
#: Margins, a part of the mean or, of phases, a number. They were fixed before any engine ran: none is more
#: than what a clearance that is off by a tenth, or a restitution that is off by 0.05, does to the mean.
PARTS_OF_MEAN = {
    "impact_speed_m_s": 0.05,
    "impacts_per_revolution": 0.1,
    "impulse_per_revolution_N_s": 0.005,
    "dissipated_energy_per_revolution_J": 0.1,
    "flight_part": 0.1,
    "rms_slider_deviation_m": 0.05,
}
SHIFTS = {"impact_phase_cosine": 0.1, "impact_phase_sine": 0.1}
#: The members of each ensemble on a scene, by label.
Ensembles = dict[str, pd.DataFrame]


def prepared(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with labels: of members the ensemble, of all others the engine and the part."""
    rows = with_columns(rows, "member", *QUANTITIES)
    label = rows["part"].where(rows["member"].notna(), rows["engine"] + " (" + rows["part"] + ")")
    rows = rows.assign(arm=rows["part"], label=label)
    return rows.assign(label=in_legend_order(rows))


class Pair(NamedTuple):
    """An ensemble, that of the reference with the same contact law, and what the test says of them.

    ``differences`` (k,) of the ``quantities`` are in units of their margins.
    """

    label: str
    twin: str
    sizes: tuple[int, int]
    quantities: list[str]
    differences: Interval
    verdict: str


def by_scene(rows: pd.DataFrame) -> dict[str, Ensembles]:
    """Return the finished members of each label on each scene, in the order in which they were drawn."""
    members = finished(rows[rows["member"].notna()]).sort_values("member", kind="stable")
    scenes = members.groupby("scene")
    return {str(scene): dict(iter(of.groupby("label", observed=True))) for scene, of in scenes}


def compared(by_label: Ensembles) -> list[str]:
    """Return the quantities that every member of a scene has, and that scatter in every ensemble."""
    return [
        name
        for name in QUANTITIES
        if all(of[name].notna().all() and (len(of) == 1 or np.ptp(of[name]) > 0) for of in by_label.values())
    ]


def matrix(members: pd.DataFrame, quantities: Sequence[str]) -> FloatArray:
    """Return the quantities of members in the units of their words, (n, k)."""
    factors = [FACTORS.get(name, 1.0) for name in quantities]
    return np.asarray(members[list(quantities)].to_numpy(dtype=float) * factors)


def margins(quantities: Sequence[str]) -> Margins:
    """Return the margins of equivalence of quantities."""
    part, shift = (np.array([of.get(name, 0.0) for name in quantities]) for of in (PARTS_OF_MEAN, SHIFTS))
    return Margins(part, shift)


def control(by_label: Ensembles) -> pd.DataFrame:
    """Return all of the reference's members of a scene as it is."""
    return pd.concat([by_label[label] for label in OWN if label in by_label])


def pairs(by_label: Ensembles) -> list[Pair]:
    """Return every ensemble of a scene with what the test says of it.

    It is compared with the reference's with the same contact law, which are all of its own members unless an
    engine has a law of its own. The reference's second ensemble is compared with its first.
    """
    names, found = compared(by_label), list[Pair]()
    for label, members in by_label.items() if OWN[0] in by_label and names else ():
        if label == OWN[0] or label.startswith(TWIN_OF):
            continue
        twin = f"{TWIN_OF}{label})"
        own = by_label[OWN[0]] if label == OWN[1] else control(by_label)
        others = by_label.get(twin, own)
        sizes = len(members), len(others)
        nothing = Interval(*np.full((3, len(names)), np.nan))
        one, other = (
            Sample.of(matrix(of, names)) if min(sizes) >= FEWEST else None for of in (members, others)
        )
        apart = difference(one, other, margins(names)) if one and other else nothing
        found.append(
            Pair(label, twin if twin in by_label else OWN[0], sizes, names, apart, verdict(apart, sizes))
        )
    return found


def means_table(by_label: Ensembles, scene: str) -> Table:
    """Return the mean of every quantity of every ensemble on a scene, with its interval."""
    names = compared(by_label)
    cells: dict[str, list[str]] = {
        "ensemble": [*by_label],
        "members": [str(len(of)) for of in by_label.values()],
    }
    for name in names:
        values = [matrix(of, [name])[:, 0] for of in by_label.values()]
        cells[QUANTITIES[name]] = [
            with_half_width(student_interval(of)) if len(of) > 1 else f"{of[0]:.3g}" for of in values
        ]
    reading = "Means over members and half of Student's 95 % interval."
    return Table.of(f"{STUDY}-means-{scene}", f"Means of ensembles on {scene}", reading, STUDY, cells)


def tests_table(found: Sequence[Pair], scene: str) -> Table:
    """Return the difference of every quantity of every pair of ensembles, with the verdict on the pair."""
    names = ("ensemble", "compared with", "members", "quantity", "margin", "difference", "verdict")
    cells: dict[str, list[str]] = {name: [] for name in names}
    for pair in found:
        for q, name in enumerate(pair.quantities):
            factor, unit = (1.0, "") if name in SHIFTS else (100.0, " %")
            margin = factor * {**PARTS_OF_MEAN, **SHIFTS}[name]
            mean, low, high = (f"{margin * each[q]:+.3g}{unit}" for each in pair.differences)
            shown = ABSENT if pair.verdict == TOO_FEW else f"{mean} ({low} to {high})"
            sizes = f"{pair.sizes[0]} and {pair.sizes[1]}"
            line = (pair.label, pair.twin, sizes, QUANTITIES[name], f"{margin:g}{unit}", shown, pair.verdict)
            for column, cell in zip(names, line, strict=True):
                cells[column].append(cell)
    reading = f"Differences of means with {PERCENT} intervals, as parts of the other mean but for phases."
    return Table.of(f"{STUDY}-tests-{scene}", f"Ensembles on {scene} by quantity", reading, STUDY, cells)


def with_half_width(of: Interval | None) -> str:
    """Return a mean with half the width of its interval as text."""
    return ABSENT if of is None else f"{of.mean:.3g} ± {(of.high - of.low) / 2:.1g}"
