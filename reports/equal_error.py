"""Run times at equal error: which setting is fastest, by what factor, and how sure that is.

One data frame has a row for each setting of a configuration on a scene, from coarse to fine: what is
varied (``knob``, ``value``, both in words as ``setting``), the error of one column, and the run times of the
rounds: the least, ``time_s``, since what slows a machine makes no run shorter, ``next_s`` and ``last_s``. Of
one round alone the next time is infinite.

The error that a setting keeps is the largest of its own and of all finer settings of its configuration: a
small error before a larger one is luck. It is infinite where a finer run failed, and where errors have grown
to the clearance, which says nothing of the setting.
"""

import math
from dataclasses import dataclass
from typing import Any

import pandas as pd

from reports.look import plain, setting
from reports.results import SLIDER, knobs, tolerances, uncertainty, value, with_columns

#: A time is resolved if another round comes within this factor of the least. How a time looks that is not,
#: and a ratio that the timing does not resolve from 1, and what a caption says of them.
SPREAD, UNRESOLVED_MARK = 1.3, "~"
UNRESOLVED = (
    f"{UNRESOLVED_MARK}: not resolved by the timing: no second round is within {SPREAD:g} times the time, or "
    "the interval of the ratio contains 1."
)
#: The mark of a run time that leaves out the forces, and what a caption says of it.
ALONE_MARK = "*"
ALONE = f"{ALONE_MARK}: motion only; forces are computed after the timed run."
#: Part of the smallest clearance from which on an error of the slider has grown to what the clearance allows.
SATURATED, CLEARANCE = 0.1, "smallest_clearance_m"


@dataclass(frozen=True)
class Ratio:
    """How many times as long a setting takes as another, and its ends by the next fastest rounds."""

    times: float
    low: float
    high: float

    @property
    def decided(self) -> bool:
        """Whether the timing tells which of the two is faster."""
        return not self.low <= 1 <= self.high

    def __str__(self) -> str:
        """Return the ratio as a cell, marked where it is not resolved from 1."""
        return f"{'' if self.decided else UNRESOLVED_MARK}{plain(self.times)}"


def ratio(slow: Any, fast: Any) -> Ratio:
    """Return what one setting takes in times of another."""
    return Ratio(slow.time_s / fast.time_s, slow.time_s / fast.next_s, slow.next_s / fast.time_s)


def mark(run: Any, column: str) -> str:
    """Return the mark of a time without the forces, beside errors of a column of forces."""
    return ALONE_MARK if run.motion_alone and ("force" in column or "torque" in column) else ""


def is_resolved(run: Any) -> Any:
    """Return whether a second round comes near the run time of a setting, or of each in a data frame."""
    return run.next_s <= SPREAD * run.time_s


def settings(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the recorded runs with what is varied, their run times, and whether they are ``lost``.

    Timed runs are told by their ``round``; those that failed are to be among the rows. A setting is lost if a
    run of it failed, or if its error has grown to the clearance.
    """
    rows = from_coarse_to_fine(with_columns(rows, "motion_alone", "end_time_s", "solve_time_s"))
    names = ["scene", "engine", "arm", "step_s", *rows.filter(regex="^setting_")]
    at = pd.Series([str(of) for of in rows[names].itertuples(index=False, name=None)], rows.index)
    times = value(rows, "solve_time_s").where(rows["round"].notna()).dropna()
    least, last = (times.groupby(at).agg(end) for end in ("min", "max"))
    return rows.assign(
        setting=[*map(setting, rows["knob"], rows["value"])],
        motion_alone=rows["motion_alone"].isin([True]),
        lost=at.isin(at[rows["status"] == "failed"]) | saturated(rows),
        time_s=at.map(least),
        next_s=at.map(times.sort_values().groupby(at).nth(1).groupby(at).min()).fillna(math.inf),
        last_s=at.map(last),
    )[rows["round"].isna()]


def judged(ran: pd.DataFrame, column: str, target: float) -> pd.DataFrame:
    """Return the settings that have times and an ``error`` of a column, with the error that they keep.

    Errors are no less than the reference solution's uncertainty on the scene, ``floor``; ``reached`` is
    whether the error kept is within the target. A signal that is exactly zero throughout, as forces between
    impacts of rigid walls, has no settings.
    """
    floor = uncertainty(ran, column).groupby(ran["scene"]).transform("max").fillna(0.0)
    ran = ran.assign(column=column, target=target, floor=floor, error=value(ran, column).clip(lower=floor))
    ran["kept"] = kept(ran)
    ran["reached"] = ran["kept"] <= target
    return ran.dropna(subset=["error", "time_s"]).query("error > 0")


def kept(ran: pd.DataFrame) -> "pd.Series[float]":
    """Return the largest error of each setting and all finer ones, infinite where one is ``lost``.

    Settings without an error, as of a signal that is not judged, tell nothing.
    """
    errors = ran["error"].fillna(0.0).mask(ran["lost"], math.inf)[::-1]
    return errors.groupby([ran["scene"], ran["label"]], observed=True).cummax()


def saturated(rows: pd.DataFrame) -> "pd.Series[bool]":
    """Return of which rows the error of the slider has grown to the clearance."""
    rows = with_columns(rows, SLIDER, CLEARANCE)
    return value(rows, SLIDER) >= SATURATED * rows[CLEARANCE].astype(float)


def from_coarse_to_fine(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rows by scene, from coarse to fine, with what a configuration varies: tolerance or step."""
    rows, tolerance = with_columns(rows, "round"), tolerances(rows)
    varied = tolerance.groupby([rows["scene"], rows["label"]], observed=True).transform("nunique") > 1
    rows = rows.assign(knob=knobs(rows).where(varied, "step"), value=tolerance.where(varied, rows["step_s"]))
    return rows.sort_values(["scene", "value"], ascending=[True, False])


def front(ran: pd.DataFrame) -> pd.DataFrame:
    """Return one scene's settings that no other beats in both error kept and run time, the fastest first."""
    ran = ran.sort_values(["time_s", "kept"])
    return ran[ran["kept"] < ran["kept"].cummin().shift(fill_value=math.inf)]


def reaching(ran: pd.DataFrame) -> pd.DataFrame:
    """Return each engine's fastest setting that reaches each target, the fastest first."""
    return ran[ran["reached"]].sort_values("time_s").drop_duplicates(["column", "scene", "engine"])


def candidates(ran: pd.DataFrame) -> list[pd.DataFrame]:
    """Return each engine's setting that reaches a target on most scenes, the recommended one first.

    Each is a data frame of its runs. Of those that do on as many it is the one that is the least behind on
    the scene where it is slowest: ``slowdown`` is its time by the fastest engine's.
    """
    runs = ran[ran["reached"]]
    runs = runs.assign(slowdown=runs["time_s"] / runs.groupby("scene")["time_s"].transform("min"))
    every = [of for _, of in runs.groupby(["label", "setting"], sort=False, observed=True)]
    best: dict[str, pd.DataFrame] = {}
    for each in sorted(every, key=lambda of: (-len(of), of["slowdown"].max())):
        best.setdefault(each["engine"].iloc[0], each)
    return list(best.values())
