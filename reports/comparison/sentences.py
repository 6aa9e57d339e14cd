"""The recommendation of a comparison in sentences: what to use, its error and run time, and its limits."""

import math
import re
from collections.abc import Iterator
from typing import Any

import pandas as pd

from reports.comparison.standing import IMPACTS, Standings
from reports.equal_error import Choice, ratio
from reports.look import plain, quantity, setting, words
from reports.results import FORCE, PEAK, finished, quality_failures
from reports.run.command import command

#: The part of the energy in play from which on unaccounted energy is reported; any run has less.
REPORTED_ENERGY = 1e-6
#: The column of signals that are not judged, with why: "joint_B_force_N: zero; ...".
NOT_JUDGED = "not_judged"
#: A comparison ends before its scene if it is short of this part of it.
SHORT_OF = 0.999
#: The names of joint forces among the signals that are not compared.
JOINT_FORCES = r"^joint_[\w.-]+_force_N$"


def sentences(standings: Standings, given: str) -> Iterator[str]:
    """Yield the recommendation and what it rests on; ``given`` is the scene as it is typed in a command."""
    chosen = standings.chosen
    if chosen is None:
        yield f"No recommendation: {_why_none(standings)}."
    else:
        row = standings.rows.loc[chosen.row]
        yield from _recommended(standings, chosen, given)
        yield from _next_best(standings, chosen)
        if others := [*_other_errors(row)]:
            yield f"Other errors: {'; '.join(others)}."
        yield from _limit(standings, chosen)
    yield from _horizon(standings)
    yield from not_run(standings)


def not_run(standings: Standings) -> Iterator[str]:
    """Yield of each engine that finished no run why not."""
    for row in standings.not_run.itertuples():
        yield f"{row.engine}: {row.status}, {row.reason}."


def measured(error: float, known: float, unit: str) -> str:
    """Return an error with its unit, or the reference solution's uncertainty as a bound of a smaller one."""
    if error <= known:
        return f"below {quantity(known, unit)}, the reference solution's uncertainty"
    return quantity(error, unit)


def _why_none(standings: Standings) -> str:
    signal = f"^{standings.column.replace('_error_', '_')}$"
    for text in finished(standings.recorded).get(NOT_JUDGED, ()):
        for name, why in unjudged(text, signal):
            return f"{name} is not compared ({why})"
    return "no run finished and passed the check of energy, joint gaps and penetration"


def _recommended(standings: Standings, chosen: Choice, given: str) -> Iterator[str]:
    what, unit = words(standings.column)
    wanted, row = quantity(standings.wanted, unit), standings.rows.loc[chosen.row]
    if standings.reached:
        alone = " (motion only; forces are computed after the solve)" if chosen.motion_alone else ""
        yield f"Use {chosen.label} at {chosen.setting}{alone}."
    else:
        yield f"No engine reached a {what} of {wanted} at any tested setting."
        yield f"Closest: {chosen.label} at {chosen.setting}."
    yield f"Command: {command(row, given)}"
    error = measured(row[standings.column], standings.floor, unit)
    yield f"{what[:1].upper()}{what[1:]}: {error}; asked for: {wanted}."
    timed = standings.rows[(standings.rows["label"] == chosen.label) & standings.rows["round"].notna()]
    solve, build = quantity(chosen.time_s, "s"), quantity(timed["build_time_s"].min(), "s")
    yield f"Time of the solve: {solve}; building the model and reading out take {build} more."


def _next_best(standings: Standings, chosen: Choice) -> Iterator[str]:
    """Yield what gives forces in its solve, where the recommended run does not, and the next best engine."""
    if not standings.reached:
        return
    others, with_forces = standings.reached[1:2], standings.reached_with_forces[:1]
    if chosen.motion_alone and with_forces:
        yield f"With forces in the solve: {_slower(standings, with_forces[0])}."
        others = [each for each in others if each.label != with_forces[0].label]
    elif chosen.motion_alone:
        yield "No setting with forces in the solve reached that error."
    for other in others:
        yield f"Next best engine: {_slower(standings, other)}."
    if len(set(finished(standings.recorded)["engine"])) == 1:
        yield "No other engine ran."
    elif len(standings.reached) == 1:
        yield "No other engine reached that error."


def _slower(standings: Standings, other: Choice) -> str:
    share = ratio(other, standings.reached[0])
    if share.decided:
        slower = f"{plain(share.times)}x slower at equal error"
    else:
        slower = f"{plain(share.times)}x the time at equal error, not resolved by the timing"
    return f"{other.label} at {other.setting}, {slower}"


def unjudged(text: object, signals: str = "") -> list[tuple[str, str]]:
    """Return each signal that matches and is not judged, in words, and why, from a row's ``NOT_JUDGED``."""
    parts = (part.partition(": ") for part in (text.split("; ") if isinstance(text, str) else ()) if part)
    return [(words(name)[0], why) for name, _, why in parts if re.search(signals, name)]


def _other_errors(row: "pd.Series[Any]") -> Iterator[str]:
    """Yield the errors of a run that did not decide: of joint forces, of impacts and of energy."""
    loose = not math.isnan(row["impacts_matched"])
    if not math.isnan(row[FORCE]):
        where = " pointwise through the impacts" if loose else ""
        yield f"joint force {_of(row, FORCE, 'N')}{where}"
    if loose and row[[*IMPACTS]].sum():
        matched, missed, unmatched = row[[*IMPACTS]].astype(int)
        others = f", {unmatched} more are not in the reference solution" if unmatched else ""
        complete = f", times within {_of(row, 'impact_time_error_s', 's')}" if not missed + unmatched else ""
        yield f"{matched} of {matched + missed} impacts found{others}{complete}"
    if not math.isnan(row[PEAK]):
        whole = " (a missed one counts as 100 %)" if row["impacts_missed"] else ""
        yield f"peak force of the impacts {_of(row, PEAK, '%')}{whole}"
    if row["unaccounted_energy_part"] >= REPORTED_ENERGY:
        yield f"unaccounted energy {quantity(row['unaccounted_energy_part'])} of that in play"
    yield from (f"{name} not compared ({why})" for name, why in unjudged(row.get(NOT_JUDGED), JOINT_FORCES))


def _of(row: "pd.Series[Any]", column: str, unit: str) -> str:
    return measured(row[column], row.get(column.replace("_error_", "_uncertainty_"), 0.0), unit)


def _limit(standings: Standings, chosen: Choice) -> Iterator[str]:
    """Yield at which coarser setting the recommended configuration misses the error asked for, and how."""
    row = standings.fails_at(chosen)
    if row is None or not standings.reached:
        return
    what, unit = words(standings.column)
    if row["status"] != "ok":
        how = f"{row['status']}, {row['reason']}"
    else:
        how = quality_failures(row.to_frame().T).iloc[0] or f"{what} {quantity(row[standings.column], unit)}"
    yield f"Not good enough at {setting(row['knob'], row['value'])}: {how}."


def _horizon(standings: Standings) -> Iterator[str]:
    ran = finished(standings.recorded)
    if ran.empty:
        return
    until, end = ran["compared_until_s"].min(), ran["end_time_s"].iloc[0]
    if until < SHORT_OF * end:
        yield (
            f"Predictability horizon: {until:.3g} s of {end:.3g} s. Errors are compared up to there; "
            "beyond it only statistics are meaningful."
        )
