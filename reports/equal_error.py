"""Run times at equal error: which setting is fastest, by what factor, and how sure that is.

The settings that were run on a scene are a data frame, a row for each; those of a configuration go from
coarse to fine. Columns: ``engine``, ``label``, the parameter that is varied (``knob``) with its ``value``,
both in words (``setting``), ``error``, the error that is ``kept``, whether the solve gives the
``motion_alone``, the length of the motion, ``end_time_s``, and the run times of the rounds: the least,
``time_s``, since what slows a machine makes no run shorter, ``next_s`` and ``last_s``. Of one round alone the
next time is ``SPREAD`` times its own.

The error that a setting keeps is the largest of its own and of all finer settings of its configuration: a
small error before a larger one is luck. It is infinite where a finer run failed, and where errors have grown
to the clearance, which says nothing of the setting.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from reports.look import plain, setting
from reports.results import SLIDER, floor, knobs, tolerances, value, with_columns

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

#: By scene: the settings that were run on it, and the uncertainty of its reference solution.
ByScene = Mapping[str, tuple[pd.DataFrame, float]]


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


def is_resolved(run: Any) -> bool:
    """Return whether a second round comes near the run time of a setting."""
    return bool(run.next_s <= SPREAD * run.time_s)


def settings_by_scene(rows: pd.DataFrame, column: str) -> ByScene:
    """Return by scene the settings that have errors of a column, and the reference's uncertainty of these."""
    by_scene = {str(scene): (of, floor(of, column)) for scene, of in rows.groupby("scene")}
    ran = {scene: (settings(of, column, known), known) for scene, (of, known) in by_scene.items()}
    return {scene: each for scene, each in ran.items() if len(each[0])}


def settings(rows: pd.DataFrame, column: str, floor: float) -> pd.DataFrame:
    """Return the settings of one scene's rows that have errors and times; errors are no less than ``floor``.

    Timed runs are told by their ``round``; the rows of runs that failed are to be among all. A signal that is
    exactly zero throughout, as forces between impacts of rigid walls, has no settings.
    """
    rows = from_coarse_to_fine(with_columns(rows, "motion_alone", "end_time_s", "solve_time_s"))
    names = ["engine", "arm", "step_s", *(name for name in rows if name.startswith("setting_"))]
    at = pd.Series([str(of) for of in rows[names].itertuples(index=False, name=None)], rows.index)
    times = value(rows, "solve_time_s").where(rows["round"].notna()).dropna().groupby(at).apply(sorted)
    ran = rows[rows["round"].isna()]
    rounds = pd.DataFrame([*at[ran.index].map(times).map(_least_next_last)], ran.index)
    failed = ran.index.map(at).isin(set(at[rows["status"] == "failed"]))
    ran = ran.assign(
        **rounds.set_axis(["time_s", "next_s", "last_s"], axis=1),
        setting=[*map(setting, ran["knob"], ran["value"])],
        error=value(ran, column).clip(lower=floor),
        motion_alone=ran["motion_alone"].isin([True]),
    )
    ran = ran.assign(kept=kept(ran, failed | saturated(ran)))
    columns = ["engine", "label", "knob", "value", "setting", "error", "kept", "motion_alone", "time_s"]
    return ran[[*columns, "next_s", "last_s", "end_time_s"]].dropna(subset=columns).query("error > 0")


def _least_next_last(times_s: Any) -> tuple[float, float, float]:
    if not isinstance(times_s, list):
        return math.nan, math.nan, math.nan
    return times_s[0], times_s[1] if len(times_s) > 1 else SPREAD * times_s[0], times_s[-1]


def kept(settings: pd.DataFrame, lost: "pd.Series[bool] | None" = None) -> "pd.Series[float]":
    """Return the largest error of each setting and all finer ones, infinite where one is ``lost``.

    Settings without an error, as of a signal that is not judged, tell nothing.
    """
    errors = settings["error"].fillna(0.0)
    errors = errors if lost is None else errors.mask(lost, math.inf)
    return errors[::-1].groupby(settings["label"][::-1], observed=True).cummax()[::-1]


def saturated(rows: pd.DataFrame) -> "pd.Series[bool]":
    """Return of which rows the error of the slider has grown to the clearance."""
    rows = with_columns(rows, SLIDER, CLEARANCE)
    return value(rows, SLIDER) >= SATURATED * rows[CLEARANCE].astype(float)


def from_coarse_to_fine(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one scene's rows from coarse to fine, with what a configuration varies: tolerance or step."""
    rows, tolerance = with_columns(rows, "round"), tolerances(rows)
    varied = tolerance.groupby(rows["label"], observed=True).transform("nunique") > 1
    return rows.assign(
        knob=knobs(rows).where(varied, "step"), value=tolerance.where(varied, rows["step_s"])
    ).sort_values("value", ascending=False, kind="stable")


def front(settings: pd.DataFrame) -> pd.DataFrame:
    """Return the settings that no other beats in both the error kept and run time, from fast to accurate."""
    settings = settings.sort_values(["time_s", "kept"])
    return settings[settings["kept"] < settings["kept"].cummin().shift(fill_value=math.inf)]


def reaching(settings: pd.DataFrame, error: float) -> pd.DataFrame:
    """Return each engine's fastest setting that keeps an error, the fastest engine first."""
    within = settings[settings["kept"] <= error].sort_values("time_s", kind="stable")
    return within.drop_duplicates("engine")


def candidates(by_scene: ByScene, error: float) -> list[pd.DataFrame]:
    """Return each engine's setting that reaches an error on most scenes, the recommended one first.

    Each is a data frame of its runs with their ``scene``. Of those that do on as many it is the one that is
    the least behind on the scene where it is slowest: ``slowdown`` is its time by the fastest engine's.
    """
    within = [ran[ran["kept"] <= error].assign(scene=scene) for scene, (ran, _) in by_scene.items()]
    runs = pd.concat(within)
    runs["slowdown"] = runs["time_s"] / runs.groupby("scene")["time_s"].transform("min")
    every = [of for _, of in runs.groupby(["label", "setting"], sort=False, observed=True)]
    best: dict[str, pd.DataFrame] = {}
    for each in sorted(every, key=lambda of: (-len(of), of["slowdown"].max())):
        best.setdefault(each["engine"].iloc[0], each)
    return list(best.values())
