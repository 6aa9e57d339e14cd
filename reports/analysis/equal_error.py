"""Run times at equal error: which setting is fastest, by what factor, and how sure that is.

The settings that were run on a scene are a data frame, a row for each; those of a configuration go from
coarse to fine. Columns: ``engine``, ``label``, the parameter that is varied (``knob``) with its ``value``,
the ``place`` in the series, ``error``, the error that is ``kept``, whether the solve gives the
``motion_alone``, the run times ``times_s`` (rounds,) in s from the least on, NaN of rounds without one, the
least, ``time_s``, and the length of the motion, ``end_time_s``.

The error that a setting keeps is the largest of its own and of all finer settings of its configuration: a
small error before a larger one is luck. It is infinite where a finer run failed, and where errors have grown
to the clearance, which says nothing of the setting.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from reports.quantities import floor, knobs, recorded, tolerances, value
from reports.results import FloatArray, with_columns
from reports.tables import plain, setting

#: The columns of the slider's error and of the smallest clearance, if there is one.
SLIDER, CLEARANCE = "slider_position_error_m", "smallest_clearance_m"
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
SATURATED = 0.1

#: By scene: the settings that were run on it, and the uncertainty of its reference solution.
ByScene = Mapping[str, tuple[pd.DataFrame, float]]


@dataclass(frozen=True)
class Choice:
    """A way to reach an error: at a setting that was run, or between two neighbouring ones.

    ``setting`` says which in words, ``times_s`` (rounds,) are the run times there, from the least on. If the
    solve gives the ``motion_alone`` no forces are in them. ``row`` is the row's index, None in between.
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

    def shown_ms(self, column: str) -> str:
        """Return the time in ms as a cell beside errors of a column, marked where it is not resolved."""
        unresolved = self.next_s > SPREAD * self.time_s
        return f"{UNRESOLVED_MARK if unresolved else ''}{plain(1e3 * self.time_s)}{self.mark(column)}"

    def mark(self, column: str) -> str:
        """Return the mark of a time without forces where a column of errors is of a force, or nothing."""
        return ALONE_MARK if self.motion_alone and is_force(column) else ""


@dataclass(frozen=True)
class Ratio:
    """A ratio of run times, and its interval: each time may be that of its next fastest round."""

    times: float
    low: float
    high: float

    @property
    def decided(self) -> bool:
        """Whether the interval leaves out that both take as long."""
        return self.low > 1 or self.high < 1

    def __str__(self) -> str:
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

    The rows of runs that failed are to be among them. A signal that is exactly zero throughout, as forces
    between impacts of rigid walls, has no settings.
    """
    rows = from_coarse_to_fine(with_columns(rows, "motion_alone", "end_time_s"))
    names = [name for name in rows if name.startswith("setting_")]
    asked = zip(*(rows[name] for name in ("engine", "arm", "step_s", *names)), strict=True)
    at = pd.Series([" ".join(map(str, of)) for of in asked], rows.index, dtype=object)
    by_round = pd.pivot_table(rows.assign(at=at, time_s=value(rows, "solve_time_s")), "time_s", "at", "round")
    times = pd.Series(list(np.sort(by_round.to_numpy())), by_round.index, dtype=object)
    ran = recorded(rows)
    ran = ran.assign(
        place=ran.groupby("label", observed=True).cumcount(),
        error=value(ran, column).clip(lower=floor),
        times_s=at.map(times),
        motion_alone=ran["motion_alone"].isin([True]),
    )
    failed = ran.index.map(at).isin(set(at[rows["status"] == "failed"]))
    ran = ran.assign(kept=kept(ran, failed | saturated(ran)))
    columns = ["engine", "label", "knob", "value", "place", "error", "kept", "motion_alone", "times_s"]
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
    rows, tolerance = with_columns(rows, "round", "compiled_anew"), tolerances(rows)
    varied = tolerance.groupby(rows["label"], observed=True).transform("nunique") > 1
    return rows.assign(
        knob=knobs(rows).where(varied, "step"), value=tolerance.where(varied, rows["step_s"])
    ).sort_values("value", ascending=False, kind="stable")


def front(settings: pd.DataFrame) -> pd.DataFrame:
    """Return the settings that no other beats in both the error kept and run time, from fast to accurate."""
    settings = settings.sort_values(["time_s", "kept"])
    return settings[settings["kept"] < settings["kept"].cummin().shift(fill_value=math.inf)]


def choices(settings: pd.DataFrame, error: float) -> list[Choice]:
    """Return how each engine that reaches an error does so in the least time, the fastest engine first."""
    found = (fastest(of_engine, error) for _, of_engine in settings.groupby("engine"))
    return sorted(filter(None, found), key=lambda each: each.time_s)


def reaching(settings: pd.DataFrame, error: float) -> list[Choice]:
    """Return each engine's fastest setting that was run and keeps an error, the fastest engine first."""
    within = settings[settings["kept"] <= error].sort_values("time_s", kind="stable")
    return [choice_at(each) for each in within.drop_duplicates("engine").itertuples()]


def fastest(settings: pd.DataFrame, error: float) -> Choice | None:
    """Return how the fastest configuration among some settings reaches an error, None if none does."""
    series: dict[str, list[Any]] = {}
    for each in settings.sort_values("label", kind="stable").itertuples():
        series.setdefault(each.label, []).append(each)
    ways = (way for of_label in series.values() for way in _ways(of_label, error))
    return min(ways, key=lambda way: way.time_s, default=None)


def choice_at(ran: Any) -> Choice:
    """Return the choice of a setting that was run, one of ``itertuples``."""
    at = setting(ran.knob, ran.value)
    return Choice(ran.engine, ran.label, at, ran.times_s, ran.motion_alone, ran.Index)


def _ways(series: Sequence[Any], error: float) -> Iterator[Choice]:
    """Yield the settings of a configuration that keep an error, and log-log places between neighbours."""
    yield from (choice_at(ran) for ran in series if ran.kept <= error)
    errors, places = np.array([[ran.kept, ran.place] for ran in series]).T
    between = (errors[:-1] > error) & (error > errors[1:]) & np.isfinite(errors[:-1])
    for k in np.flatnonzero(between & (np.diff(places) == 1)):
        one, other = series[int(k)], series[int(k) + 1]
        share = math.log(one.kept / error) / math.log(one.kept / other.kept)
        times = one.times_s * (other.times_s / one.times_s) ** share
        between_both = setting(one.knob, one.value, other.value)
        yield Choice(one.engine, one.label, between_both, times, one.motion_alone)


def ratio(slow: Choice, fast: Choice) -> Ratio:
    """Return what one takes in times of another."""
    low, high = slow.time_s / fast.next_s, slow.next_s / fast.time_s
    return Ratio(slow.time_s / fast.time_s, low, high)


def levels(settings: pd.DataFrame, floor: float) -> list[float]:
    """Return the powers of ten between the reference's uncertainty and the second largest error kept."""
    errors = sorted(settings["kept"][settings["kept"] < math.inf])
    if len(errors) < 2:
        return []
    low, high = math.ceil(math.log10(max(floor, errors[0]) * (1 + 1e-9))), math.floor(math.log10(errors[-2]))
    return [10.0**k for k in range(high, low - 1, -1)]


def candidates(by_scene: ByScene, error: float) -> list[Candidate]:
    """Return each engine's setting that reaches an error on most scenes, the recommended one first.

    Of those that do on as many it is the one that is the least behind on the scene where it is slowest. Only
    settings that were run count.
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
