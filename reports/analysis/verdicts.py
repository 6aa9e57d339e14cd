"""The verdict on a run of an extreme case, from its row alone."""

import math
import re
from collections.abc import Mapping
from enum import Enum
from typing import Any

import pandas as pd

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
#: Verdicts on runs that end with word of when and why, the engine's own or that of the check after every run.
TOLD_SO = (Verdict.FAILED, Verdict.NOTICED)
#: Verdicts on runs that did not go wrong.
WELL = (Verdict.RIGHT, Verdict.REFUSED, Verdict.FAILED)
#: How a failure tells its time, and to which part of the time.
_TIME, TOLD = re.compile(r"\bt = (-?\d[\d.e+-]*) s\b"), 1e-2
_ENDED = {v.value: v for v in (Verdict.TIMED_OUT, Verdict.OUT_OF_MEMORY, Verdict.CRASHED)}


def answers(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the study's runs, by the place of their cases, with what is made of them.

    ``reason`` is the engine's, or else why the check after every run fails it. ``verdict`` is the
    ``Verdict``; ``as_wanted`` whether theory asks for what came: the motion, or no motion where there is
    none.
    """
    rows = with_columns(rows, *JUDGED, "judged").sort_values("place", kind="stable")
    rows[QUALITY] = quality_failures(rows)
    rows["reason"] = rows["reason"].where(rows["reason"] != "", rows[QUALITY])
    for name, of in (("verdict", verdict_on), ("as_wanted", _as_wanted)):
        rows[name] = pd.Series([of(row) for _, row in rows.iterrows()], rows.index)
    return rows


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
