"""Which engine to take on a scene and at which setting, what that costs, and where it stops being trusted."""

import math
from collections.abc import Iterator
from typing import Any

import pandas as pd

from reports.chapters.clearance import PEAK_FORCE
from reports.chapters.comparison.standing import FORCE, Standings
from reports.equal_error import Arrival
from reports.quantities import PEAK, finished
from reports.results import NOT_INSTALLED
from reports.run.command import command
from reports.shared_tables import NOT_JUDGED, SHORT_OF, quality_failures, speakers, unjudged
from reports.style import words
from reports.tables import in_text, plain, setting

#: A share of energy that no physics accounts for is worth a word from here on; less is what any run has.
WORTH_A_WORD = 1e-6
#: From so many ms on a time is told in s.
MS_OF_A_SECOND = 1000.0


def sentences(standings: Standings, given: str) -> Iterator[str]:
    """Yield the recommendation, at most two numbers a sentence, and what it rests on.

    ``given`` is the scene as it is typed in the commands that run what is recommended.
    """
    chosen = standings.chosen
    if chosen is None:
        why = [f"its {name} is not judged: {why}" for name, why in standings.unjudged]
        reason = next(iter(why), "no run finished and passed the check of energy and gaps")
        yield f"Nothing can be recommended: {reason}."
    else:
        yield from _choice(standings, chosen, given)
        yield from _others(standings, chosen, given)
        yield from _trust(standings, chosen)
    yield from _horizon(standings)
    yield from refusals(standings)


def size(value: float) -> str:
    """Return a number in a sentence, two significant digits, with a power of ten where it needs one."""
    return plain(value) if 0.01 <= value < 1000 else in_text(value)


def below(uncertainty: float, unit: str) -> str:
    """Return in words an error that the truth is not known well enough to tell."""
    return f"less than the {size(uncertainty)} {unit} to which the truth is known"


def duration(time_s: float) -> str:
    """Return a time in ms, or in s if it is long."""
    ms = 1e3 * time_s
    return f"{plain(ms)} ms" if ms < MS_OF_A_SECOND else f"{plain(time_s)} s"


def _run(standings: Standings, rung: Any, given: str) -> str:
    return f"To run it: {command(standings.rows.loc[rung.Index], given)}"


def _choice(standings: Standings, chosen: Any, given: str) -> Iterator[str]:
    what, unit = words(standings.column)
    wanted = f"{size(standings.wanted)} {unit}"
    if standings.there:
        alone = standings.motion_alone[chosen.Index]
        take = "For the motion alone take" if alone else "Take"
        yield f"{take} {chosen.label} at {setting(chosen.knob, chosen.value)}."
        yield _run(standings, chosen, given)
        above = chosen.error > standings.floor
        error = f"{size(chosen.error)} {unit} at most" if above else below(standings.floor, unit)
        yield f"Its {what} is {error}; {wanted} is what is asked for."
        if finer := len(standings.finer(chosen)):
            runs = "the one finer setting" if finer == 1 else f"all {finer} finer settings"
            yield f"With {runs} of it that ran it stays within that."
    else:
        yield f"No engine gets to the {what} of {wanted} that is asked for."
        at = setting(chosen.knob, chosen.value)
        yield f"The nearest is {chosen.label} at {at}, with {size(chosen.error)} {unit}."
        yield _run(standings, chosen, given)
    if standings.floor > standings.wanted:
        yield f"The truth itself is only known to {size(standings.floor)} {unit}."
    own = standings.rows[(standings.rows["label"] == chosen.label) & standings.rows["round"].notna()]
    besides = f"; building the model and reading out take {duration(own['build_time_s'].median())} more"
    yield f"Its solve takes {duration(chosen.time_s)}{besides}."


def _others(standings: Standings, chosen: Any, given: str) -> Iterator[str]:
    """Yield what to take for forces, without the engine chosen, with building, and for less error."""
    there, forces = standings.there, standings.with_forces
    reasons: dict[str, list[str]] = {}
    if there and standings.motion_alone[chosen.Index]:
        yield "Its solve gives no forces; they are computed afterwards, at the samples."
        if forces:
            reasons[forces[0].label] = ["for forces in the solve"]
        else:
            yield "Nothing that gives forces in its solve gets to that error."
    if len(there) > 1:
        reasons.setdefault(there[1].label, []).append(f"without {chosen.engine}")
    arrived = {each.label: each for each in (*forces, *there)}
    for label, when in reasons.items():
        other, rung = arrived[label], standings.rung(arrived[label])
        take = f"take {label} at {setting(rung.knob, rung.value)}"
        yield f"{', or '.join(when).capitalize()}, {take}: {_cost(standings, other)}."
        yield _run(standings, rung, given)
    if len(set(finished(standings.recorded)["engine"])) == 1:
        yield "No other engine ran, so there is nothing to compare it with."
    elif len(there) == 1:
        yield "No other engine gets to that error."
    whole = standings.whole().there
    if whole and whole[0].engine != standings.there[0].engine:
        time = duration(whole[0].time_s)
        yield f"Where every run builds its model anew, {whole[0].label} is the cheapest, at {time} in all."
    nearest = standings.nearest
    if standings.there and nearest.Index != standings.chosen.Index:
        _, unit = words(standings.column)
        above = nearest.error > standings.floor
        best = f"{size(nearest.error)} {unit}" if above else below(standings.floor, unit)
        yield f"The most accurate is {nearest.label}: {best}, in {duration(nearest.time_s)}."


def _cost(standings: Standings, other: Arrival) -> str:
    share = standings.share(other)
    return f"it takes {share.in_words} at equal error" if share else "no round has both at equal error"


def _trust(standings: Standings, chosen: Any) -> Iterator[str]:
    row = standings.rows.loc[chosen.Index]
    yield from _forces(standings, chosen, row)
    yield from _impacts(row)
    if row["unaccounted_energy_part"] >= WORTH_A_WORD:
        yield f"No physics accounts for {size(row['unaccounted_energy_part'])} of the energy in play."
    coarser = standings.coarser(chosen)
    if len(coarser):
        yield _next_coarser(standings, coarser.iloc[-1])


def _forces(standings: Standings, chosen: Any, row: pd.Series) -> Iterator[str]:
    """Yield how far joint forces are off, which of them are not judged, and how far peaks of impacts are."""
    error, known = standings.force_error_N(chosen.Index)
    if not math.isnan(error):
        off = below(known, "N") if error <= known else f"up to {size(error)} N"
        loose = "impacts_matched" in row.dropna()
        where = ", pointwise through the impacts" if loose else " at the samples compared"
        yield f"Its joint forces are off by {off}{where}."
    if silent := unjudged(row.get(NOT_JUDGED), FORCE):
        of = "; ".join(f"{name.removesuffix(' force')}, {why}" for name, why in silent)
        yield f"{'Joint forces' if math.isnan(error) else 'Some joint forces'} are not judged: {of}."
    error, known, part = row.reindex([PEAK_FORCE, PEAK_FORCE.replace("_error_", "_uncertainty_"), PEAK])
    if not math.isnan(part):
        off = below(known, "N") if error <= known else f"up to {size(part)} %"
        missed = "; one that is missed counts as 100 %" if row["impacts_missed"] else ""
        yield f"The peak forces of its impacts are off by {off}{missed}."


def _impacts(row: pd.Series) -> Iterator[str]:
    counts = row.reindex(["impacts_matched", "impacts_missed", "impacts_unmatched"])
    if counts.isna().any() or counts.sum() == 0:
        return
    matched, missed, unmatched = counts.astype(int)
    if missed or unmatched:
        yield f"It has {matched} of {matched + missed} impacts, bounces that die away included."
        if unmatched:
            yield f"{unmatched} of its impacts are none of the truth's."
    else:
        error, known = row["impact_time_error_s"], row.get("impact_time_uncertainty_s", 0.0)
        off = f"{size(error)} s at most" if error > known else below(known, "s")
        yield f"It finds every impact, {matched} of them, at times that are off by {off}."


def _next_coarser(standings: Standings, row: pd.Series) -> str:
    what, unit = words(standings.column)
    begins = "It stops being good enough at" if standings.there else "It is worse still at"
    at = setting(row["knob"], row["value"])
    begin = f"{begins} {at}, the next coarser here:"
    if row["status"] != "ok":
        return f"{begin} it {row['status']}, {row['reason']}."
    if failure := quality_failures(row.to_frame().T).iloc[0]:
        return f"{begin} {failure}."
    error = row[standings.column]
    if error > standings.level:
        return f"{begin} its {what} is {size(error)} {unit}."
    return f"At {at}, the next coarser here, it is as good but not cheaper."


def _horizon(standings: Standings) -> Iterator[str]:
    ran = finished(standings.recorded)
    if ran.empty:
        return
    until, end = ran["compared_until_s"].min(), ran["end_time_s"].iloc[0]
    if until < SHORT_OF * end:
        yield (
            f"No run is to be trusted moment by moment past {until:.3g} s of {end:.3g} s: starts moved by a "
            "hair part there, so errors are those before, and only averages mean something after."
        )


def refusals(standings: Standings) -> Iterator[str]:
    """Yield of each engine that finished no run why not, and who says so."""
    silent = standings.silent
    for row, speaker in zip(silent.itertuples(), speakers(silent), strict=True):
        if row.status == NOT_INSTALLED:
            yield f"{row.reason}."
        else:
            yield f"{row.engine} finished no run: {row.reason} (said by {speaker})."
