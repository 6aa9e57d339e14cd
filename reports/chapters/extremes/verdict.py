"""The verdict on a run of the gallery, from its row alone."""

import math
import re
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any

import pandas as pd

from reports.results import with_columns
from reports.shared_tables import QUALITY, quality_failures

Row = Mapping[str, Any]


class Verdict(Enum):
    """How a run came out, from good to bad: what misleads nobody is better than what does."""

    RIGHT = "right"
    REFUSED = "refused"
    FAILED = "failed clearly"
    NOTICED = "noticed nonsense"
    INACCURATE = "inaccurate"
    FAILED_OBSCURELY = "failed obscurely"
    TIMED_OUT = "timed out"
    OUT_OF_MEMORY = "out of memory"
    CRASHED = "crashed"
    NONSENSE = "nonsense"


#: The numbers that a verdict rests on, each with a column of its bound.
JUDGED = ("relative_error", "energy_relative", "constraint_relative")
ENERGY, CONSTRAINT = JUDGED[1:]
#: Verdicts on runs that end with word of when and why, the engine's own or that of the check after every run.
TOLD_SO = (Verdict.FAILED, Verdict.NOTICED)
#: How a failure tells its time.
_TIME = re.compile(r"\bt = -?\d[\d.e+-]* s\b")
#: A failure tells its time to six digits.
TOLD = 1e-2
_ENDED = {v.value: v for v in (Verdict.TIMED_OUT, Verdict.OUT_OF_MEMORY, Verdict.CRASHED)}


def answers(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the study's rows by the place of their cases in the gallery, with what is columns of them.

    ``reason`` is the engine's, or else why the check after every run fails it. ``verdict`` is the
    ``Verdict``; ``as_wanted`` whether theory asks for no more than what came, the motion,
    or no motion where there is none; ``worst`` which of the numbers judged exceeds its bound most, None
    where there are none.
    """
    rows = with_columns(rows, *JUDGED, "judged").sort_values("place", kind="stable")
    rows[QUALITY] = quality_failures(rows)
    rows["reason"] = rows["reason"].where(rows["reason"] != "", rows[QUALITY])
    columns: dict[str, Callable[[Row], object]] = {
        "verdict": verdict_on,
        "as_wanted": _as_wanted,
        "worst": _worst,
    }
    for name, of in columns.items():
        rows[name] = pd.Series([of(row) for _, row in rows.iterrows()], rows.index)
    return rows


def verdict_on(row: Row) -> Verdict:
    """Return the verdict on a row.

    An answer that the check after every run fails is noticed nonsense. Others are nonsense if a number is
    missing, for those that are not finite are no numbers, if energy or constraints are off by more than
    ``nonsense_factor`` times their bounds, or if theory knows of no answer. An answer is right if nothing
    exceeds its bound. A failure is clear if it tells when.
    """
    if row["status"] in _ENDED:
        return _ENDED[row["status"]]
    if row["status"] == "unsupported":
        return Verdict.REFUSED
    if row["status"] != "ok":
        return Verdict.FAILED if _TIME.search(row["reason"]) else Verdict.FAILED_OBSCURELY
    if row[QUALITY]:
        return Verdict.NOTICED
    excess = {name: row[name] / row[f"{name}_bound"] for name in JUDGED}
    if row["wanted"] == "refusal" or any(map(math.isnan, excess.values())):
        return Verdict.NONSENSE
    if max(excess[ENERGY], excess[CONSTRAINT]) > row["nonsense_factor"]:
        return Verdict.NONSENSE
    return Verdict.RIGHT if max(excess.values()) <= 1 else Verdict.INACCURATE


def _as_wanted(row: Row) -> bool:
    verdict, wanted = row["verdict"], row["wanted"]
    if wanted == "refusal":
        return verdict in (Verdict.REFUSED, *TOLD_SO)
    if wanted == "stop" and verdict in TOLD_SO:
        return bool(abs(_told_time(row["reason"]) - row["stop_s"]) <= row["step_s"] * (1 + TOLD))
    return verdict is Verdict.RIGHT or (wanted == "answer or word" and verdict in TOLD_SO)


def _told_time(reason: str) -> float:
    time = _TIME.search(reason)
    return float(time[0].removeprefix("t = ").removesuffix(" s")) if time else math.inf


def _worst(row: Row) -> str | None:
    excess = {name: row[name] / row[f"{name}_bound"] for name in JUDGED if not math.isnan(row[name])}
    return max(excess, key=excess.__getitem__, default=None)
