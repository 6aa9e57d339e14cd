"""Run times at equal error: who is cheapest, and by what factor, round by round of the timed runs.

The rungs of ladders are data frames, a row for each: ``engine``, ``label``, ``error``, ``steps``, the run
times ``times_s`` of every round in s, and their median ``time_s``.
"""

import math

import numpy as np
import pandas as pd

from reports.quantities import finished, floor, value
from reports.results import FloatArray


def ladders(rows: pd.DataFrame, column: str) -> dict[str, tuple[pd.DataFrame, float]]:
    """Return by scene the rungs that have errors of a column, and the truth's uncertainty of it."""
    by_scene = {}
    for scene, of_scene in rows.groupby("scene"):
        doubt = floor(of_scene, column)
        by_scene[scene] = rungs(of_scene, column, doubt), doubt
    return {scene: (of_scene, doubt) for scene, (of_scene, doubt) in by_scene.items() if len(of_scene)}


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
    recorded = recorded[["engine", "label", "error", "steps", "times_s"]].dropna().query("error > 0")
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


def duel(slow: pd.DataFrame, fast: pd.DataFrame, error: float) -> FloatArray:
    """Return what ``slow`` takes in times of ``fast`` in each round, (n,), NaN if one does not."""
    rounds = min(map(len, (*slow["times_s"], *fast["times_s"])))
    return np.array([time_at(slow, error, k) / time_at(fast, error, k) for k in range(rounds)])


def levels(rungs: pd.DataFrame, floor: float) -> list[float]:
    """Return the powers of ten between the truth's uncertainty and the second largest rung's error."""
    errors = sorted(rungs["error"])
    if len(errors) < 2:
        return []
    low, high = math.ceil(math.log10(max(floor, errors[0]) * (1 + 1e-9))), math.floor(math.log10(errors[-2]))
    return [10.0**k for k in range(high, low - 1, -1)]
