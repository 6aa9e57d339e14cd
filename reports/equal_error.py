"""Run times at equal error: which setting is fastest, by what factor, and how sure that is.

The settings that were run on a scene are a data frame, a row for each; those of a configuration go from
coarse to fine. Columns: ``engine``, ``label``, the parameter that is varied (``knob``) with its ``value``,
``error``, the error that is ``kept``, whether the solve gives the ``motion_alone``, the run times ``times_s``
(rounds,) in s from the least on, NaN of rounds without one, the least, ``time_s``, and the length of the
motion, ``end_time_s``.

The error that a setting keeps is the largest of its own and of all finer settings of its configuration: a
small error before a larger one is luck. It is infinite where a finer run failed, and where errors have grown
to the clearance, which says nothing of the setting.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from reports.look import plain, setting
from reports.results import SLIDER, FloatArray, floor, knobs, tolerances, value, with_columns

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
class Choice:
    """A setting that was run: ``setting`` says which in words, ``times_s`` (rounds,) are its run times.

    They begin with the least. If the solve gives the ``motion_alone`` no forces are in them. ``row`` is the
    row's index.
    """

    engine: str
    label: str
    setting: str
    times_s: FloatArray
    motion_alone: bool = False
    row: Any = None

    @property
    def time_s(self) -> float:
        """The run time: the least of the rounds, since what slows a machine makes no run shorter."""
        return float(self.times_s[0])

    @property
    def next_s(self) -> float:
        """The time of the next fastest round; of one round alone ``SPREAD`` times its own."""
        there = np.isfinite(self.times_s[1:2]).any()
        return float(self.times_s[1]) if there else SPREAD * self.time_s

    def mark(self, column: str) -> str:
        """Return the mark of a time without the forces, beside errors of a column of forces."""
        return ALONE_MARK if self.motion_alone and is_force(column) else ""

    def shown_ms(self, column: str) -> str:
        """Return the time in ms as a cell beside errors of a column, marked where it is not resolved."""
        unresolved = self.next_s > SPREAD * self.time_s
        return f"{UNRESOLVED_MARK if unresolved else ''}{plain(1e3 * self.time_s)}{self.mark(column)}"


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


@dataclass(frozen=True)
class Candidate:
    """A setting that reaches an error on some ``scenes`` of a class, with its run on each of them.

    ``slowdowns`` are its run times there in times of the fastest engine's.
    """

    scenes: tuple[str, ...]
    runs: tuple[Choice, ...]
    slowdowns: tuple[float, ...]

    @property
    def label(self) -> str:
        """The configuration."""
        return self.runs[0].label

    @property
    def setting(self) -> str:
        """The setting in words."""
        return self.runs[0].setting


def is_force(column: str) -> bool:
    """Return whether a column of errors is of a force or a torque."""
    return "force" in column or "torque" in column


def settings_by_scene(rows: pd.DataFrame, column: str) -> ByScene:
    """Return by scene the settings that have errors of a column, and the reference's uncertainty of these."""
    found = {}
    for scene, of_scene in rows.groupby("scene"):
        known = floor(of_scene, column)
        if len(ran := settings(of_scene, column, known)):
            found[str(scene)] = ran, known
    return found


def settings(rows: pd.DataFrame, column: str, floor: float) -> pd.DataFrame:
    """Return the settings of one scene's rows that have errors and times; errors are no less than ``floor``.

    Timed runs are told by their ``round``; the rows of runs that failed are to be among all. A signal that is
    exactly zero throughout, as forces between impacts of rigid walls, has no settings.
    """
    rows = from_coarse_to_fine(with_columns(rows, "motion_alone", "end_time_s", "solve_time_s"))
    names = [name for name in rows if name.startswith("setting_")]
    asked = zip(*(rows[name] for name in ("engine", "arm", "step_s", *names)), strict=True)
    at = pd.Series([" ".join(map(str, of)) for of in asked], rows.index, dtype=object)
    by_round = pd.pivot_table(rows.assign(at=at, time_s=value(rows, "solve_time_s")), "time_s", "at", "round")
    times = pd.Series(list(np.sort(by_round.to_numpy())), by_round.index, dtype=object)
    ran = rows[rows["round"].isna()]
    ran = ran.assign(
        error=value(ran, column).clip(lower=floor),
        times_s=at.map(times),
        motion_alone=ran["motion_alone"].isin([True]),
    )
    failed = ran.index.map(at).isin(set(at[rows["status"] == "failed"]))
    ran = ran.assign(kept=kept(ran, failed | saturated(ran)))
    columns = ["engine", "label", "knob", "value", "error", "kept", "motion_alone", "times_s"]
    ran = ran[[*columns, "end_time_s"]].dropna(subset=columns).query("error > 0")
    return ran.assign(time_s=ran["times_s"].map(np.nanmin).astype(float))


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


def reaching(settings: pd.DataFrame, error: float) -> list[Choice]:
    """Return each engine's fastest setting that keeps an error, the fastest engine first."""
    within = settings[settings["kept"] <= error].sort_values("time_s", kind="stable")
    return [choice_at(each) for each in within.drop_duplicates("engine").itertuples()]


def choice_at(ran: Any) -> Choice:
    """Return the choice of a setting, one of ``itertuples``."""
    at = setting(ran.knob, ran.value)
    return Choice(ran.engine, ran.label, at, ran.times_s, ran.motion_alone, ran.Index)


def ratio(slow: Choice, fast: Choice) -> Ratio:
    """Return what one takes in times of another."""
    low, high = slow.time_s / fast.next_s, slow.next_s / fast.time_s
    return Ratio(slow.time_s / fast.time_s, low, high)


def candidates(by_scene: ByScene, error: float) -> list[Candidate]:
    """Return each engine's setting that reaches an error on most scenes, the recommended one first.

    Of those that do on as many it is the one that is the least behind on the scene where it is slowest.
    """
    found: dict[tuple[str, str], list[tuple[str, Choice, float]]] = {}
    for scene, (ran, _) in by_scene.items():
        within = [choice_at(each) for each in ran[ran["kept"] <= error].itertuples()]
        least = min((each.time_s for each in within), default=math.nan)
        for each in within:
            found.setdefault((each.label, each.setting), []).append((scene, each, each.time_s / least))
    every = [Candidate(*zip(*runs, strict=True)) for runs in found.values()]
    best: dict[str, Candidate] = {}
    for candidate in sorted(every, key=lambda each: (-len(each.scenes), max(each.slowdowns))):
        best.setdefault(candidate.runs[0].engine, candidate)
    return list(best.values())
