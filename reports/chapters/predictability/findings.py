"""What the predictability study's rows say, in sentences made from the rows or checked against them."""

from collections.abc import Iterator, Mapping

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


def horizons(rows: pd.DataFrame) -> Iterator[str]:
    """Yield which scenes can be followed for how long; ``rows`` has one of each."""
    followed = rows.filter(regex="^horizon_").isna().all(axis=1)
    if followed.any():
        whole = rows[followed]
        largest = whole[["largest_distance_perturbed_m", "largest_distance_halved_m"]].max(axis=None)
        named = listed(
            f"{row['scene']} (for {_length(row, row['end_time_s'])})" for _, row in whole.iterrows()
        )
        sentence = f"Nothing parts on {named}: all twins stay within {in_text(largest)} m of the reference."
        yield stated(sentence, largest < TOGETHER_M)
    for _, row in rows[~followed].iterrows():
        yield f"On {row['scene']} {_parting(row)}."


def _parting(row: pd.Series) -> str:
    """Return after how long the twins of a scene that parts are off by each tolerance."""
    parts = []
    for words, (tolerance, _) in data.TOLERANCES.items():
        first = row[[f"horizon_{words}_s", f"horizon_halved_{words}_s"]].min()
        if first == first:
            parts.append(f"{tolerance} after {_length(row, first)}")
    if not parts:
        return "only some twins part before the end"
    moved = in_text(row["perturbation_rad"])
    return f"a start moved by {moved} rad, or half the step, moves the slider by {listed(parts)}"


def _length(row: pd.Series, time_s: float) -> str:
    turns = row["revolutions"]
    return f"{turns * time_s / row['end_time_s']:.1f} revolutions" if turns > 0 else f"{time_s:.2g} s"


def exponents(by_scene: Mapping[str, pd.DataFrame]) -> Iterator[str]:
    """Yield the exponents of the scenes that have one, and which have none."""
    settled = []
    for scene, starts in by_scene.items():
        values = data.measured(starts)
        if len(values) > 1:
            yield _grows(scene, student_interval(values))
        elif not len(values):
            settled.append(f"{scene} (within {starts['revolutions'].max():.0f} revolutions)")
    if settled:
        yield f"No exponent is given where every start settles to continuous contact: {listed(settled)}."


def _grows(scene: str, mean: Interval) -> str:
    sentence = (
        f"On {scene} distances grow {float(f'{np.exp(mean.mean):.1e}'):,.0f}-fold in a revolution: an "
        f"exponent of {mean.mean:.1f} ({mean.low:.1f} to {mean.high:.1f})"
    )
    if mean.low > 0:
        return f"{sentence}, which is chaos."
    return f"{sentence}, which these starts do not tell from zero."


def ensembles(by_label: data.Ensembles, scene: str, alarms: Alarms | None) -> Iterator[str]:
    """Yield which engines differ from their model twins, and how far the test can be trusted."""
    if alarms is not None:
        yield from _trusted(by_label, scene, alarms)
    quantities = data.shown(by_label)
    for label, twin in data.compared(by_label):
        one, other = (data.matrix(by_label[each], quantities) for each in (label, twin))
        raised = holm(permutation_p(one, other))
        differing = [
            data.QUANTITIES[q].split(" [")[0] for q, p in zip(quantities, raised, strict=True) if p <= LEVEL
        ]
        sentence = (
            f"{label} differs from its model twin on {scene} in {listed(differing)}"
            if differing
            else f"{label} is not told from its model twin on {scene} by any of {len(quantities)} quantities"
        )
        yield f"{sentence} ({len(one)} members each)."


def _trusted(by_label: data.Ensembles, scene: str, alarms: Alarms) -> Iterator[str]:
    """Yield, checked, how often the tests of means tell the reference from itself."""
    share = sum(rate.count for rate in alarms.by_means) / sum(rate.trials for rate in alarms.by_means)
    sentence = (
        f"On {scene} the permutation test tells the reference from itself in {100 * share:.1f} % of "
        f"draws, at a nominal {100 * LEVEL:.0f} %: its alarms mean what they should."
    )
    yield stated(sentence, share <= LEVEL + LEVEL_ROOM)
    direct = told_apart(by_label)
    yield (
        f"Taken as they are, the reference's ensembles on {scene} (same starts, others, half the step) "
        f"are told from one another in {direct.count} of {direct.trials} tests, where "
        f"{LEVEL * direct.trials:.1f} alarms are expected."
    )


def pictures(results: Results, points: pd.DataFrame) -> Iterator[str]:
    """Yield up to which clearance every revolution repeats the one before."""
    spreads = [float(np.ptp(results.curve(case, "gap_y_part"))) for case in points["case"]]
    room, spread = 1e3 * points["radial_clearance_m"], pd.Series(spreads, points.index, dtype=float)
    repeating = room[spread <= REPEATS]
    if len(repeating) in (0, len(room)):
        return
    sentence = (
        f"Every revolution repeats the one before at {len(repeating)} of {len(room)} clearances, all of "
        f"them up to {repeating.max():.2g} mm; the pin's height at 90° varies by up to {spread.max():.1f} "
        "clearances from revolution to revolution at larger ones."
    )
    yield stated(sentence, room[spread.idxmax()] > repeating.max())
