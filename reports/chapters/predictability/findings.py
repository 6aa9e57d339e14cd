"""What the predictability study's rows say, in sentences made from the rows or checked against them."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from reports.chapters.predictability import data
from reports.chapters.predictability.comparison import Alarms, told_apart
from reports.chapters.predictability.statistics import LEVEL, Interval, holm, permutation_p, student_interval
from reports.parts import stated
from reports.results import Results, Run
from reports.style import title
from reports.tables import in_text

#: A scene whose twins stay closer than this to the end has no horizon worth the name, in m.
TOGETHER_M = 1e-9
#: The measured level of a test may be above the nominal one by this: twice the counting error of 300 draws.
#: It may be below it by anything, where members share a value.
LEVEL_ROOM = 0.025
#: Revolutions repeat when the pin is back in its place within this part of the clearance.
REPEATS = 0.01


def horizons(runs: Sequence[Run]) -> list[str]:
    """Return which scenes can be followed for how long."""
    out = []
    followed = [run for run in runs if not any(name.startswith("horizon_") for name in run.values)]
    if followed:
        largest = max(_largest(run) for run in followed)
        named = listed(f"{run.scene} (for {_length(run, run.values['end_time_s'])})" for run in followed)
        sentence = f"Nothing parts on {named}: all twins stay within {in_text(largest)} m of the reference."
        out.append(stated(sentence, largest < TOGETHER_M))
    for run in runs:
        if run not in followed:
            out.append(_followed_to_horizon(run))
    return out


def _followed_to_horizon(run: Run) -> str:
    told = []
    for words, (tolerance, _) in data.TOLERANCES.items():
        times = [run.values.get(f"horizon_{kind}{words}_s") for kind in ("", "halved_")]
        known = [time for time in times if time is not None]
        if known:
            told.append(f"{tolerance} after {_length(run, min(known))}")
    moved = in_text(run.values["perturbation_rad"])
    if not told:
        return f"On {run.scene} only some twins part before the end."
    return (
        f"On {run.scene} a start moved by {moved} rad, or half the step, moves the slider by {listed(told)}."
    )


def _largest(run: Run) -> float:
    return max(run.values["largest_distance_perturbed_m"], run.values["largest_distance_halved_m"])


def _length(run: Run, time_s: float) -> str:
    turns = run.values.get("revolutions")
    return f"{turns * time_s / run.values['end_time_s']:.1f} revolutions" if turns else f"{time_s:.2g} s"


def exponents(found: Mapping[str, Sequence[Run]]) -> list[str]:
    """Return the exponents of the scenes that have one, and which have none."""
    out, settled = [], []
    for scene, starts in found.items():
        values = data.measured(starts)
        if len(values) > 1:
            out.append(_grows(scene, student_interval(values)))
        elif not len(values):
            turns = max(run.values["revolutions"] for run in starts)
            settled.append(f"{scene} (within {turns:.0f} revolutions)")
    if settled:
        out.append(
            f"No exponent is given where every start settles to continuous contact: {listed(settled)}."
        )
    return out


def _grows(scene: str, mean: Interval) -> str:
    sentence = (
        f"On {scene} distances grow {float(f'{np.exp(mean.mean):.1e}'):,.0f}-fold in a revolution: an "
        f"exponent of {mean.mean:.1f} ({mean.low:.1f} to {mean.high:.1f})"
    )
    if mean.low > 0:
        return f"{sentence}, which is chaos."
    return f"{sentence}, which these starts do not tell from zero."


def ensembles(found: data.Ensembles, scene: str, counted: Alarms | None) -> list[str]:
    """Return which engines differ from their model twins, and how far the test can be trusted."""
    quantities, out = data.shown(found), []
    if counted is not None:
        rates = counted[1]
        share = sum(rate.count for rate in rates) / sum(rate.trials for rate in rates)
        sentence = (
            f"On {scene} the permutation test tells the reference from itself in {100 * share:.1f} % of "
            f"draws, at a nominal {100 * LEVEL:.0f} %: its alarms mean what they should."
        )
        out.append(stated(sentence, share <= LEVEL + LEVEL_ROOM))
        direct = told_apart(found)
        out.append(
            f"Taken as they are, the reference's ensembles on {scene} (same starts, others, half the step) "
            f"are told from one another in {direct.count} of {direct.trials} tests, where "
            f"{LEVEL * direct.trials:.1f} alarms are expected."
        )
    for name, twin in data.compared(found):
        one, other = (data.matrix(found[each], quantities) for each in (name, twin))
        raised = holm(permutation_p(one, other))
        differing = [
            data.QUANTITIES[q].split(" [")[0] for q, p in zip(quantities, raised, strict=True) if p <= LEVEL
        ]
        count = f"{len(one)} members each"
        out.append(
            f"{title(name)} differs from its model twin on {scene} in {listed(differing)} ({count})."
            if differing
            else f"{title(name)} is not told from its model twin on {scene} by any of {len(quantities)} "
            f"quantities ({count})."
        )
    return out


def pictures(results: Results, runs: Sequence[Run]) -> list[str]:
    """Return up to which clearance every revolution repeats the one before."""
    spreads = []
    for run in runs:
        curve = results.curve(run, "gap_y_part")
        if curve is not None:
            spreads.append((1e3 * run.values["radial_clearance_m"], float(np.ptp(curve))))
    repeating = [room for room, spread in spreads if spread <= REPEATS]
    if not repeating or len(repeating) == len(spreads):
        return []
    wild = max(spread for _, spread in spreads)
    sentence = (
        f"Every revolution repeats the one before at {len(repeating)} of {len(spreads)} clearances, all of "
        f"them up to {max(repeating):.2g} mm; the pin's height at 90° varies by up to {wild:.1f} clearances "
        "from revolution to revolution at larger ones."
    )
    widest = max(spreads, key=lambda point: point[1])[0]
    return [stated(sentence, widest > max(repeating))]


def listed(parts: Iterable[str]) -> str:
    """Return parts as a list in a sentence: a, b and c."""
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last
