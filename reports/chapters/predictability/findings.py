"""What the predictability study's rows say, in sentences made from the rows or checked against them."""

from collections.abc import Iterator, Mapping, Sequence

import pandas as pd

from reports.chapters.predictability import data
from reports.chapters.predictability.comparison import Verdict, calibrations
from reports.chapters.predictability.statistics import LEVEL, Calibration, Interval, student_interval
from reports.parts import stated
from reports.tables import in_text, listed

#: A scene whose twins stay closer than this to the end has no horizon worth the name, in m.
TOGETHER_M = 1e-9
#: Of more quantities than these a sentence tells the number.
MOST_NAMED = 3


def horizons(rows: pd.DataFrame) -> Iterator[str]:
    """Yield which scenes can be followed for how long; ``rows`` has one of each."""
    followed = rows.filter(regex="^horizon_").isna().all(axis=1)
    if followed.any():
        whole = rows[followed]
        largest = whole[["largest_distance_perturbed_m", "largest_distance_halved_m"]].max(axis=None)
        scenes = listed(whole["scene"])
        sentence = f"Nothing parts on {scenes}: all twins stay within {in_text(largest)} m of the reference."
        yield stated(sentence, largest < TOGETHER_M)
    if not followed.all():
        moved = in_text(rows["perturbation_rad"].iloc[0])
        yield f"Elsewhere runs part whose start is moved by {moved} rad, or whose step is halved."
    for _, row in rows[~followed].iterrows():
        yield f"On {row['scene']} {_parting(row)}."


def _parting(row: pd.Series) -> str:
    """Return after how long the first twin's slider is off by the largest tolerance that any passes."""
    for words, (tolerance, _) in reversed(data.TOLERANCES.items()):
        first = row[[f"horizon_{words}_s", f"horizon_halved_{words}_s"]].min()
        if first == first:
            return f"the slider is off by {tolerance} after {_length(row, first)}"
    return "only some twins part before the end"


def _length(row: pd.Series, time_s: float) -> str:
    turns = row["revolutions"]
    return f"{turns * time_s / row['end_time_s']:.1f} revolutions" if turns > 0 else f"{time_s:.2g} s"


def exponents(by_scene: Mapping[str, pd.DataFrame]) -> Iterator[str]:
    """Yield the exponents of the scenes whose every start has one, and why the others have none."""
    none = []
    for scene, starts in by_scene.items():
        values, settled = data.measured(starts), int(starts["settled"].eq(True).sum())
        if len(values) == len(starts) > 1:
            yield from _grows(scene, starts)
        elif settled == len(starts):
            none.append(f"{scene} (within {starts['revolutions'].max():.0f} revolutions)")
        elif settled:
            yield (
                f"On {scene} {settled} of {len(starts)} starts settle to continuous contact: what is chaotic "
                "there may all be transient, and nothing is claimed."
            )
        elif len(starts) > 1:
            yield (
                f"On {scene} only {len(values)} of {len(starts)} starts could be followed for half of the "
                "run, and nothing is claimed."
            )
    if none:
        yield f"No exponent is given where every start settles to continuous contact: {listed(none)}."


def _grows(scene: str, starts: pd.DataFrame) -> Iterator[str]:
    """Yield what the exponent of a scene is, and whether it is the same from half of the run."""
    whole, half = (student_interval(data.measured(starts, part)) for part in ("", "_half"))
    sentence = f"On {scene} neighbouring motions part with an exponent of {_interval(whole)} per revolution"
    converged = whole.low <= half.high and half.low <= whole.high
    if not converged:
        yield f"{sentence}, which has not converged: nothing is claimed."
    elif whole.low > 0:
        yield f"{sentence}, which is chaos."
    else:
        yield f"{sentence}, which these starts do not tell from zero."
    yield f"From half of each run it is {_interval(half)}."


def _interval(of: Interval) -> str:
    return f"{of.mean:.2f} ± {(of.high - of.low) / 2:.2f}"


def ensembles(scene: str, verdicts: list[Verdict], own: bool = True) -> Iterator[str]:
    """Yield how often the tests are wrong on a scene, and what they say of every ensemble.

    Only on a scene of the study's ``own`` is known what they have to find.
    """
    deciding = [each for each in calibrations(verdicts) if each.decides]
    if deciding:
        yield from _trusted(scene, deciding, own)
    for verdict in verdicts:
        sentence, planted = _verdict(scene, verdict), verdict.pair.label == data.PLANTED
        yield stated(sentence, verdict.told_apart) if planted and own else sentence


def _trusted(scene: str, deciding: list[Calibration], own: bool) -> Iterator[str]:
    """Yield, checked, how often the tests of enough members are wrong at the most."""
    alarms = [each.any_alarm for each in deciding]
    clears = [rate for each in deciding for rate in each.margin_clear]
    for sentence, rates, level in (
        (f"Members of the reference itself on {scene} are told apart in", alarms, LEVEL / deciding[0].pairs),
        (f"Means on {scene} that are a margin apart are called equivalent in", clears, LEVEL),
    ):
        worst = max(rates, key=lambda rate: rate.value)
        told = (
            f"{sentence} {100 * worst.value:.1f} % of draws at the most, of {100 * level:.2g} % that may be"
        )
        right = not worst.exceeds(level)
        yield stated(f"{told}.", right) if right or own else f"{told}: too often to mean much."


def _verdict(scene: str, verdict: Verdict) -> str:
    """Return what the tests say of a pair, in a sentence."""
    pair = verdict.pair
    twin = "its model twin" if pair.twin.startswith(data.TWIN_OF) else pair.twin
    both = f"{pair.label} and {twin} on {scene}"
    if not verdict.decides:
        one, other = pair.sizes
        return f"Nothing is said of {both}: {one} and {other} members are too few to decide."
    if verdict.agrees:
        though = "though they are told apart" if verdict.told_apart else "and not told apart"
        return f"{both} are equivalent in all {len(verdict.quantities)} quantities, {though}."
    if verdict.differing:
        return f"{both} differ in {_named(verdict.differing)}."
    if verdict.told_apart:
        return f"{both} differ in their means taken together, in none alone."
    return f"Whether {both} are equivalent is open in {_named(verdict.undecided)}."


def _named(quantities: Sequence[str]) -> str:
    return listed(quantities) if len(quantities) <= MOST_NAMED else f"{len(quantities)} quantities"
