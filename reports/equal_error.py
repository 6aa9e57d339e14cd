"""Run times at equal error: who is cheapest, and by what factor, round by round of the timed runs.

The rungs of ladders are data frames, a row for each: ``engine``, ``label``, ``error``, ``steps``, the run
times ``times_s`` of every round in s, and their median ``time_s``.
"""

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from reports.quantities import finished, floor, value


def ladders(rows: pd.DataFrame, column: str) -> dict[str, tuple[pd.DataFrame, float]]:
    """Return by scene the rungs that have errors of a column, and the truth's uncertainty of it."""
    found = {}
    for scene, of_scene in rows.groupby("scene"):
        doubt = floor(of_scene, column)
        found[scene] = rungs(of_scene, column, doubt), doubt
    return {scene: (of_scene, doubt) for scene, (of_scene, doubt) in found.items() if len(of_scene)}


def rungs(rows: pd.DataFrame, column: str, floor: float) -> pd.DataFrame:
    """Return the rungs of one scene's rows that have errors and times; errors are no less than ``floor``.

    A signal that is exactly zero throughout, as forces between impacts of rigid walls, has no rungs.
    """
    rows = finished(rows)
    settings = [name for name in rows if name.startswith("setting_")]
    rung = rows[["engine", "arm", "step_s", *settings]].map(str).agg(" ".join, axis=1)
    timed = rows["round"].notna()
    times = rows[timed].sort_values("round").groupby(rung)["solve_time_s"].agg(tuple)
    recorded = rows[~timed].assign(error=value(rows, column).clip(lower=floor), times_s=rung.map(times))
    recorded = recorded.dropna(subset=["error", "times_s"]).query("error > 0")
    return recorded.assign(time_s=recorded["times_s"].map(np.median).astype(float))


def front(rungs: pd.DataFrame) -> pd.DataFrame:
    """Return the rungs that no other beats in both error and time, from cheap to accurate."""
    rungs = rungs.sort_values(["time_s", "error"])
    return rungs[rungs["error"] < rungs["error"].cummin().shift(fill_value=math.inf)]


def time_at(rungs: pd.DataFrame, error: float, at_round: int | None = None) -> float:
    """Return the time in s at which the front of some rungs reaches an error, NaN if it does not.

    Between two rungs it is interpolated log-log; one round's time, or else the median's.
    """
    best = front(rungs)
    times = list(best["time_s"] if at_round is None else best["times_s"].str[at_round])
    errors = list(best["error"])
    reached = sum(each > error for each in errors)
    if reached == len(errors):
        return math.nan
    if reached == 0 or errors[reached] == error:
        return float(times[reached])
    (before, after), (slow, time) = errors[reached - 1 : reached + 1], times[reached - 1 : reached + 1]
    share = math.log(before / error) / math.log(before / after)
    return float(slow * (time / slow) ** share)


@dataclass(frozen=True)
class Duel:
    """The run time of one engine in times another's, at equal error: median and range over the rounds."""

    median: float
    least: float
    most: float

    @property
    def decided(self) -> bool:
        """Whether the same one is cheaper in every round."""
        return self.least > 1 or self.most < 1


def duel(slow: pd.DataFrame, fast: pd.DataFrame, error: float) -> Duel | None:
    """Return what ``slow`` takes in times of ``fast``, None where one of them does not reach the error."""
    rounds = min(map(len, (*slow["times_s"], *fast["times_s"])))
    ratios = [time_at(slow, error, k) / time_at(fast, error, k) for k in range(rounds)]
    return None if np.isnan(ratios).any() else Duel(float(np.median(ratios)), min(ratios), max(ratios))


def levels(rungs: pd.DataFrame, floor: float) -> list[float]:
    """Return the powers of ten between the truth's uncertainty and the second largest rung's error."""
    errors = sorted(rungs["error"])
    if len(errors) < 2:
        return []
    low, high = math.ceil(math.log10(max(floor, errors[0]) * (1 + 1e-9))), math.floor(math.log10(errors[-2]))
    return [10.0**k for k in range(high, low - 1, -1)]
