"""The verdict on a run of an extreme case, from its row alone."""

import math
import re
from collections.abc import Mapping
from enum import Enum
from typing import Any

import pandas as pd

from reports.parts import quantity
from reports.quantities import QUALITY, quality_failures
from reports.results import with_columns

Row = Mapping[str, Any]


class Verdict(Enum):
    """How a run came out, from good to bad: what misleads nobody is better than what does."""

    RIGHT = "right"
    REFUSED = "refused"
    FAILED = "clear error"
    NOTICED = "wrong, found by a check"
    INACCURATE = "inaccurate"
    FAILED_OBSCURELY = "unclear error"
    TIMED_OUT = "timed out"
    OUT_OF_MEMORY = "out of memory"
    CRASHED = "crashed"
    WRONG = "wrong, no error"


#: The numbers that a verdict rests on, each with a column of its bound.
JUDGED = ("relative_error", "unaccounted_energy_part", "constraint_relative")
ENERGY, CONSTRAINT = JUDGED[1:]
#: Verdicts on runs that end with word of when and why, the engine's own or that of the check after every run.
TOLD_SO = (Verdict.FAILED, Verdict.NOTICED)
#: How a failure tells its time, and to which part of the time.
_TIME, TOLD = re.compile(r"\bt = (-?\d[\d.e+-]*) s\b"), 1e-2
#: Who tells that there is no motion: the engine itself; a check of ours, which ends a run with which the
#: engine would go on; our model of the engine, where that has no such law; the scene's own check, for all.
ENGINE, GUARD, MODEL, SCENE = "engine", "guard", "model", "scene"
#: How a reason begins that is the scene's.
NO_SCENE = "no such scene:"
#: Part of the shortest link that joints are apart in what is no mechanism any more.
APART = 0.1
_ENDED = {v.value: v for v in (Verdict.TIMED_OUT, Verdict.OUT_OF_MEMORY, Verdict.CRASHED)}


def answers(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the study's runs with our checks on, by the place of their cases, with what is made of them.

    ``reason`` is the engine's, or else why the check after every run fails it. ``verdict`` is the
    ``Verdict``; ``as_wanted`` whether theory asks for what came: the motion, or no motion where there is
    none; ``worst`` which of the numbers judged exceeds its bound most, None where there are none. ``told_by``
    is who speaks where no motion came. Where that is a check of ours, ``unguarded`` is the verdict on the
    same run without checks and ``came`` says what came of it, else None and empty. ``bare`` is the verdict
    without checks of every run, and ``wanted_unguarded`` is ``as_wanted`` without checks.
    """
    judged = _judged(rows)
    runs = judged[judged["guarded"].ne(False)]
    others = {(row["scene"], row["label"]): row for _, row in judged[judged["guarded"].eq(False)].iterrows()}
    pairs = [(row, others.get((row["scene"], row["label"]))) for _, row in runs.iterrows()]
    speakers = [_told_by(row, other) for row, other in pairs]
    unguarded = [other if told == GUARD else None for (_, other), told in zip(pairs, speakers, strict=True)]
    both = [(row, other) for (row, _), other in zip(pairs, unguarded, strict=True)]
    return runs.assign(
        told_by=speakers,
        unguarded=[None if other is None else other["verdict"] for _, other in both],
        came=["" if other is None else _came(other) for _, other in both],
        bare=[(row if other is None else other)["verdict"] for row, other in both],
        wanted_unguarded=[(row if other is None else other)["as_wanted"] for row, other in both],
    )


def wrong_results(answered: pd.DataFrame) -> pd.DataFrame:
    """Return by label the number ``wrong`` of wrong results without an error, with our checks off.

    They are among the ``cases`` (how many) that our model of the engine expresses. The most wrong come first.
    """
    asked = answered[answered["told_by"] != MODEL]
    wrong = asked["bare"].isin((Verdict.WRONG, Verdict.NOTICED)).groupby(asked["label"], observed=True)
    counts = pd.DataFrame({"wrong": wrong.sum(), "cases": wrong.size()})
    return counts.sort_values("wrong", ascending=False, kind="stable")


def _judged(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of all runs with what needs no other row."""
    names = ("judged", "guarded", "finite", "penetration_part", "penetration_m", "ideal_gap_part")
    rows = with_columns(rows, *JUDGED, *names, "ideal_gap_m", "spoken_by").sort_values("place", kind="stable")
    rows[QUALITY] = quality_failures(rows)
    rows["reason"] = rows["reason"].where(rows["reason"] != "", rows[QUALITY])
    for name, of in (("verdict", verdict_on), ("as_wanted", _as_wanted), ("worst", _worst)):
        rows[name] = pd.Series([of(row) for _, row in rows.iterrows()], rows.index)
    return rows


def _told_by(row: Row, other: Row | None) -> str:
    """Return who tells that there is no motion, empty where there is one.

    A check of ours ended the run, or failed it afterwards, where the same run without comes out otherwise.
    """
    if row["status"] == "unsupported":
        return SCENE if row["reason"].startswith(NO_SCENE) else MODEL
    if row["verdict"] is Verdict.NOTICED:
        return GUARD
    if row["status"] != "failed":
        return ""
    if row["spoken_by"] == "adapter":
        return MODEL
    same = other is None or (other["status"], other["reason"]) == (row["status"], row["reason"])
    return ENGINE if same else GUARD


def _came(row: Row) -> str:
    """Return in words what came of a run without checks."""
    if row["status"] != "ok":
        return f"{row['verdict'].value}: {row['reason']}"
    if not row["finite"]:
        return "success, with numbers that are not finite"
    if row["penetration_part"] > 1:
        return f"success, with a pin {quantity(row['penetration_m'], 'm')} beyond the wall of its bearing"
    if row["ideal_gap_part"] > APART:
        return f"success, with a joint or the guide {quantity(row['ideal_gap_m'], 'm')} apart"
    if row["wanted"] == "refusal":
        return f"success, {row['judged']}"
    if row["worst"] == ENERGY:
        return f"success, with energy off by {quantity(row[ENERGY])} of that in play"
    return f"success, with {row['judged']} off by {quantity(row['relative_error'])}"


def verdict_on(row: Row) -> Verdict:
    """Return the verdict on a row.

    A success is wrong, and noticed, if the check after every run fails it. Others are wrong if a number is
    missing, for those that are not finite are no numbers, if motion, energy or constraints are off by more
    than ``nonsense_factor`` times their bounds, or if theory knows of no answer. One is right if nothing
    exceeds its bound. A failure is clear if it tells when: a time, or that it is the initial state's.
    """
    if row["status"] in _ENDED:
        return _ENDED[row["status"]]
    if row["status"] == "unsupported":
        return Verdict.REFUSED
    if row["status"] != "ok":
        told = _TIME.search(row["reason"]) or row["reason"].startswith("initial ")
        return Verdict.FAILED if told else Verdict.FAILED_OBSCURELY
    if row[QUALITY]:
        return Verdict.NOTICED
    excess = {name: row[name] / row[f"{name}_bound"] for name in JUDGED}
    if row["wanted"] == "refusal" or any(map(math.isnan, excess.values())):
        return Verdict.WRONG
    if max(excess.values()) > row["nonsense_factor"]:
        return Verdict.WRONG
    return Verdict.RIGHT if max(excess.values()) <= 1 else Verdict.INACCURATE


def _as_wanted(row: Row) -> bool:
    verdict, wanted = row["verdict"], row["wanted"]
    if wanted == "refusal":
        return verdict in (Verdict.REFUSED, *TOLD_SO)
    if wanted == "stop" and verdict in TOLD_SO:
        time = _TIME.search(row["reason"])
        return bool(time and abs(float(time[1]) - row["stop_s"]) <= row["step_s"] * (1 + TOLD))
    return verdict is Verdict.RIGHT or (wanted == "answer or word" and verdict in (Verdict.REFUSED, *TOLD_SO))


def _worst(row: Row) -> str | None:
    excess = {name: row[name] / row[f"{name}_bound"] for name in JUDGED if not math.isnan(row[name])}
    return max(excess, key=excess.__getitem__, default=None)
