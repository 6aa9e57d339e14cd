"""What the predictability study's rows say, in sentences made from the rows or checked against them."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from reports.chapters.predictability import data
from reports.chapters.predictability.comparison import Alarms, told_apart
from reports.chapters.predictability.statistics import LEVEL, Interval, holm, permutation_p, student_interval
from reports.parts import stated
from reports.results import Results
from reports.tables import in_text, listed

#: A scene whose twins stay closer than this to the end has no horizon worth the name, in m.
TOGETHER_M = 1e-9
#: The measured level of a test may be above the nominal one by this: twice the counting error of 300 draws.
#: It may be below it by anything, where members share a value.
LEVEL_ROOM = 0.025
#: Revolutions repeat when the pin is back in its place within this part of the clearance.
REPEATS = 0.01


def horizons(rows: pd.DataFrame) -> tuple[str, ...]:
    """Return which scenes can be followed for how long; ``rows`` has one of each."""
    followed = rows.filter(regex="^horizon_").isna().all(axis=1)
    return (*_followed(rows[followed]), *(_to_horizon(row) for _, row in rows[~followed].iterrows()))


def _followed(rows: pd.DataFrame) -> list[str]:
    if rows.empty:
        return []
    largest = rows[["largest_distance_perturbed_m", "largest_distance_halved_m"]].max(axis=None)
    named = listed(f"{row['scene']} (for {_length(row, row['end_time_s'])})" for _, row in rows.iterrows())
    sentence = f"Nothing parts on {named}: all twins stay within {in_text(largest)} m of the reference."
    return [stated(sentence, largest < TOGETHER_M)]


def _to_horizon(row: pd.Series) -> str:
    told = []
    for words, (tolerance, _) in data.TOLERANCES.items():
        first = row[[f"horizon_{words}_s", f"horizon_halved_{words}_s"]].min()
        if first == first:
            told.append(f"{tolerance} after {_length(row, first)}")
    if not told:
        return f"On {row['scene']} only some twins part before the end."
    moved = in_text(row["perturbation_rad"])
    cause = f"On {row['scene']} a start moved by {moved} rad, or half the step,"
    return f"{cause} moves the slider by {listed(told)}."


def _length(row: pd.Series, time_s: float) -> str:
    turns = row["revolutions"]
    return f"{turns * time_s / row['end_time_s']:.1f} revolutions" if turns > 0 else f"{time_s:.2g} s"


def exponents(found: Mapping[str, pd.DataFrame]) -> tuple[str, ...]:
    """Return the exponents of the scenes that have one, and which have none."""
    sentences, settled = [], []
    for scene, starts in found.items():
        values = data.measured(starts)
        if len(values) > 1:
            sentences.append(_grows(scene, student_interval(values)))
        elif not len(values):
            settled.append(f"{scene} (within {starts['revolutions'].max():.0f} revolutions)")
    if settled:
        sentences.append(
            f"No exponent is given where every start settles to continuous contact: {listed(settled)}."
        )
    return tuple(sentences)


def _grows(scene: str, mean: Interval) -> str:
    sentence = (
        f"On {scene} distances grow {float(f'{np.exp(mean.mean):.1e}'):,.0f}-fold in a revolution: an "
        f"exponent of {mean.mean:.1f} ({mean.low:.1f} to {mean.high:.1f})"
    )
    if mean.low > 0:
        return f"{sentence}, which is chaos."
    return f"{sentence}, which these starts do not tell from zero."


def ensembles(found: data.Ensembles, scene: str, alarms: Alarms | None) -> tuple[str, ...]:
    """Return which engines differ from their model twins, and how far the test can be trusted."""
    quantities = data.shown(found)
    sentences = [] if alarms is None else _trusted(found, scene, alarms)
    for label, twin in data.compared(found):
        one, other = (data.matrix(found[each], quantities) for each in (label, twin))
        raised = holm(permutation_p(one, other))
        differing = [
            data.QUANTITIES[q].split(" [")[0] for q, p in zip(quantities, raised, strict=True) if p <= LEVEL
        ]
        count = f"{len(one)} members each"
        sentences.append(
            f"{label} differs from its model twin on {scene} in {listed(differing)} ({count})."
            if differing
            else f"{label} is not told from its model twin on {scene} by any of {len(quantities)} "
            f"quantities ({count})."
        )
    return tuple(sentences)


def _trusted(found: data.Ensembles, scene: str, alarms: Alarms) -> list[str]:
    """Return, checked, how often the tests of means tell the reference from itself."""
    share = sum(rate.count for rate in alarms.by_means) / sum(rate.trials for rate in alarms.by_means)
    sentence = (
        f"On {scene} the permutation test tells the reference from itself in {100 * share:.1f} % of "
        f"draws, at a nominal {100 * LEVEL:.0f} %: its alarms mean what they should."
    )
    direct = told_apart(found)
    return [
        stated(sentence, share <= LEVEL + LEVEL_ROOM),
        f"Taken as they are, the reference's ensembles on {scene} (same starts, others, half the step) "
        f"are told from one another in {direct.count} of {direct.trials} tests, where "
        f"{LEVEL * direct.trials:.1f} alarms are expected.",
    ]


def pictures(results: Results, points: pd.DataFrame) -> tuple[str, ...]:
    """Return up to which clearance every revolution repeats the one before."""
    spreads = pd.Series(
        [float(np.ptp(results.curve(case, "gap_y_part"))) for case in points["case"]],
        1e3 * points["radial_clearance_m"],
        dtype=float,
    )
    repeating = spreads.index[spreads <= REPEATS]
    if len(repeating) in (0, len(spreads)):
        return ()
    sentence = (
        f"Every revolution repeats the one before at {len(repeating)} of {len(spreads)} clearances, all of "
        f"them up to {repeating.max():.2g} mm; the pin's height at 90° varies by up to {spreads.max():.1f} "
        "clearances from revolution to revolution at larger ones."
    )
    return (stated(sentence, spreads.idxmax() > repeating.max()),)
