"""Run times at equal error: who is cheapest, by what factor, and how sure that is.

The rungs of ladders are data frames, a row for each, those of an arm from coarse to fine: ``engine``,
``label``, what the ladder varies (``knob``) with its ``value``, the ``place`` on the ladder, ``error``, the
error that is ``kept``, whether the solve gives the ``motion_alone``, ``steps``, ``evaluations`` of the
equations, NaN where nobody counts them, the run times ``times_s`` (rounds,) in s, NaN of a round without one,
and their median ``time_s``.

An error is kept that all finer settings of the arm have as well: a small one before a larger one is luck. It
is infinite where a finer run failed, and where errors have grown to the clearance, which ranks nobody.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from reports.quantities import floor, knobs, tolerances, value
from reports.results import FloatArray, with_columns
from reports.tables import plain, setting

#: The columns of the slider's error and of the smallest clearance, if there is one.
SLIDER, CLEARANCE = "slider_position_error_m", "smallest_clearance_m"
#: How a ratio looks that the timing does not resolve from 1, and what a table's caption says of it.
UNRESOLVED_MARK = "~"
UNRESOLVED = f"A ratio marked {UNRESOLVED_MARK} is not resolved by the timing: its interval has 1 in it."
#: What is said of a run time by which forces are judged that are not in it, and what a caption says of that.
WITHOUT_FORCES = " without forces"
ALONE = (
    "A time “without forces” is of an arm whose solve gives the motion alone: its forces are computed after "
    "the run, where they are sampled."
)
#: Part of the smallest clearance from which on an error of the slider has grown to what the clearance allows:
#: how large it is then tells nothing of the setting.
SATURATED = 0.1
#: Draws of rounds with replacement, and the percentiles of the medians drawn: an interval of 95 %.
DRAWS, PERCENTILES = 2000, (2.5, 97.5)


@dataclass(frozen=True)
class Arrival:
    """How an arm gets to an error: at a rung of its ladder, or between two neighbouring ones.

    ``setting`` says which in words, ``times_s`` (rounds,) are the run times there, NaN of a round without. In
    them are no forces if the arm's solve gives the ``motion_alone``.
    """

    engine: str
    label: str
    setting: str
    times_s: FloatArray
    motion_alone: bool = False

    @property
    def time_s(self) -> float:
        """The median over the rounds."""
        return float(np.nanmedian(self.times_s))

    def without(self, column: str) -> str:
        """What to say of its time where a column of errors is judged, nothing if all of that is in it."""
        return WITHOUT_FORCES if self.motion_alone and is_force(column) else ""


def is_force(column: str) -> bool:
    """Return whether a column of errors is of a force or a torque."""
    return "force" in column or "torque" in column


@dataclass(frozen=True)
class Ratio:
    """A ratio of run times: the median over the rounds, with the ends of its 95 % confidence interval."""

    median: float
    low: float
    high: float

    @property
    def decided(self) -> bool:
        """Whether the interval leaves out that both take as long."""
        return self.low > 1 or self.high < 1

    @property
    def in_words(self) -> str:
        """The ratio in a sentence: 1.5 times as long."""
        text = f"{plain(self.median)} times as long"
        return text if self.decided else f"{UNRESOLVED_MARK}{text} (not resolved by the timing)"

    def __str__(self) -> str:
        text = f"{plain(self.median)} ({plain(self.low)} to {plain(self.high)})"
        return text if self.decided else f"{UNRESOLVED_MARK}{text}"


@dataclass(frozen=True)
class Judged:
    """Rows judged by a column of errors, and by run times that are those of ``work``, in words.

    ``name`` begins the names of the figures and tables of it.
    """

    name: str
    rows: pd.DataFrame
    column: str
    work: str = "in the native solve"

    def whole(self) -> "Judged":
        """Return the same with what building the model and reading out takes within the run times."""
        times = self.rows["solve_time_s"] + self.rows["build_time_s"]
        work = "with building and reading out"
        return replace(self, name=f"{self.name}-whole", rows=self.rows.assign(solve_time_s=times), work=work)

    @cached_property
    def ladders(self) -> dict[str, tuple[pd.DataFrame, float]]:
        """By scene the rungs that have errors, and the truth's uncertainty of these."""
        floors = {scene: floor(of_scene, self.column) for scene, of_scene in self.rows.groupby("scene")}
        by_scene = {
            scene: (rungs(of_scene, self.column, floors[scene]), floors[scene])
            for scene, of_scene in self.rows.groupby("scene")
        }
        return {scene: ladder for scene, ladder in by_scene.items() if len(ladder[0])}


def rungs(rows: pd.DataFrame, column: str, floor: float) -> pd.DataFrame:
    """Return the rungs of one scene's rows that have errors and times; errors are no less than ``floor``.

    The rows of runs that failed are to be among them. A signal that is exactly zero throughout, as forces
    between impacts of rigid walls, has no rungs.
    """
    rows = from_coarse_to_fine(with_columns(rows, "motion_alone"))
    settings = [name for name in rows if name.startswith("setting_")]
    asked = zip(*(rows[name] for name in ("engine", "arm", "step_s", *settings)), strict=True)
    rung = pd.Series([" ".join(map(str, of)) for of in asked], rows.index, dtype=object)
    by_round = pd.pivot_table(
        rows.assign(rung=rung, time_s=value(rows, "solve_time_s")), "time_s", "rung", "round"
    )
    times = pd.Series(list(by_round.to_numpy()), by_round.index, dtype=object)
    recorded = rows[rows["round"].isna() & rows["compiled_anew"].isna()]
    recorded = recorded.assign(
        place=recorded.groupby("label", observed=True).cumcount(),
        error=value(recorded, column).clip(lower=floor),
        times_s=rung.map(times),
        motion_alone=recorded["motion_alone"].isin([True]),
    )
    failed = recorded.index.map(rung).isin(set(rung[rows["status"] == "failed"]))
    recorded = recorded.assign(kept=kept(recorded, failed | saturated(recorded, column)))
    columns = ["engine", "label", "knob", "value", "place", "error", "kept", "motion_alone", "times_s"]
    recorded = recorded[[*columns, "steps", "evaluations"]].dropna(subset=columns).query("error > 0")
    return recorded.assign(time_s=recorded["times_s"].map(np.nanmedian).astype(float))


def kept(rungs: pd.DataFrame, lost: "pd.Series[bool] | None" = None) -> "pd.Series[float]":
    """Return the largest error of each rung and all finer ones of its arm, infinite where one is ``lost``.

    Rungs without an error, as of a signal that is not judged, tell nothing.
    """
    errors = rungs["error"].fillna(0.0) if lost is None else rungs["error"].fillna(0.0).mask(lost, math.inf)
    return errors[::-1].groupby(rungs["label"][::-1], observed=True).cummax()[::-1]


def saturated(rows: pd.DataFrame, column: str) -> "pd.Series[bool]":
    """Return of which rows the error of the slider has grown to the clearance.

    It is that of the column, if that is one, and else that at the end of the motion.
    """
    rows = with_columns(rows, SLIDER, CLEARANCE)
    off = value(rows, column if column.startswith(SLIDER.removesuffix("_m")) else SLIDER)
    return off >= SATURATED * rows[CLEARANCE].astype(float)


def from_coarse_to_fine(rows: pd.DataFrame) -> pd.DataFrame:
    """Return one scene's rows in the order of ladders, with what each arm varies: tolerance, or else step."""
    rows, tolerance = with_columns(rows, "round", "compiled_anew", "steps", "evaluations"), tolerances(rows)
    varied = tolerance.groupby(rows["label"], observed=True).transform("nunique") > 1
    return rows.assign(
        knob=knobs(rows).where(varied, "step"), value=tolerance.where(varied, rows["step_s"])
    ).sort_values("value", ascending=False, kind="stable")


def front(rungs: pd.DataFrame) -> pd.DataFrame:
    """Return the rungs that no other beats in both the error kept and time, from cheap to accurate."""
    rungs = rungs.sort_values(["time_s", "kept"])
    return rungs[rungs["kept"] < rungs["kept"].cummin().shift(fill_value=math.inf)]


def arrivals(rungs: pd.DataFrame, error: float) -> list[Arrival]:
    """Return how each engine that gets to an error does so at the least cost, the cheapest engine first."""
    found = (arrival(ladder, error) for _, ladder in rungs.groupby("engine"))
    return sorted(filter(None, found), key=lambda each: each.time_s)


def arrival(rungs: pd.DataFrame, error: float) -> Arrival | None:
    """Return how the cheapest of the arms among some rungs gets to an error, None if none does."""
    arms: dict[str, list[Any]] = {}
    for rung in rungs.sort_values("label", kind="stable").itertuples():
        arms.setdefault(rung.label, []).append(rung)
    ways = (way for arm in arms.values() for way in _ways(arm, error))
    return min(ways, key=lambda way: way.time_s, default=None)


def at_rung(rung: Any) -> Arrival:
    """Return how an arm gets to a rung of its own, one of ``itertuples``."""
    return Arrival(rung.engine, rung.label, setting(rung.knob, rung.value), rung.times_s, rung.motion_alone)


def _ways(arm: Sequence[Any], error: float) -> Iterator[Arrival]:
    """Yield how an arm gets to an error: rungs that keep it, and log-log between neighbouring ones."""
    yield from (at_rung(rung) for rung in arm if rung.kept <= error)
    errors, places = np.array([[rung.kept, rung.place] for rung in arm]).T
    between = (errors[:-1] > error) & (error > errors[1:]) & np.isfinite(errors[:-1])
    for k in np.flatnonzero(between & (np.diff(places) == 1)):
        one, other = arm[int(k)], arm[int(k) + 1]
        share = math.log(one.kept / error) / math.log(one.kept / other.kept)
        times = one.times_s * (other.times_s / one.times_s) ** share
        if np.isfinite(times).any():  # rounds that both have
            between_both = setting(one.knob, one.value, other.value)
            yield Arrival(one.engine, one.label, between_both, times, one.motion_alone)


def ratio(slow: Arrival, fast: Arrival) -> Ratio | None:
    """Return what one takes in times of another, by the rounds that have both; None if there is none.

    The interval is that of percentiles of the median over rounds drawn with replacement, the same draws
    every time.
    """
    ratios = slow.times_s / fast.times_s
    ratios = ratios[np.isfinite(ratios)]
    if not len(ratios):
        return None
    drawn = np.random.default_rng(0).integers(len(ratios), size=(DRAWS, len(ratios)))
    low, high = np.percentile(np.median(ratios[drawn], axis=1), PERCENTILES)
    return Ratio(float(np.median(ratios)), float(low), float(high))


def levels(rungs: pd.DataFrame, floor: float) -> list[float]:
    """Return the powers of ten between the truth's uncertainty and the second largest error that is kept."""
    errors = sorted(rungs["kept"][rungs["kept"] < math.inf])
    if len(errors) < 2:
        return []
    low, high = math.ceil(math.log10(max(floor, errors[0]) * (1 + 1e-9))), math.floor(math.log10(errors[-2]))
    return [10.0**k for k in range(high, low - 1, -1)]
