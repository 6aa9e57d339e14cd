"""Run times at equal error: who is cheapest, and by what factor, round by round of the timed runs."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from reports.quantities import Quantity
from reports.results import Run
from reports.style import Name

#: What tells a rung of a ladder: engine, arm, step and settings.
Key = tuple[str, str, float, tuple[tuple[str, object], ...]]


def key(run: Run) -> Key:
    """Return what a recorded run and the timed runs of the same rung share."""
    return run.engine, run.arm, run.step_s, tuple(sorted(run.settings.items()))


@dataclass(frozen=True)
class Rung:
    """A rung with its error and, for every round, the median of its run times in s."""

    name: Name
    error: float
    steps: float
    times_s: tuple[float, ...]

    @property
    def time_s(self) -> float:
        """The median over the rounds."""
        return float(np.median(self.times_s))


def rungs(runs: Iterable[Run], scene: str, quantity: Quantity, floor: float) -> list[Rung]:
    """Return a scene's rungs that have errors and times; errors are no less than ``floor``.

    A signal that is exactly zero throughout, as forces between impacts of rigid walls, has no rungs.
    """
    here = [run for run in runs if run.scene == scene and run.ok]
    times: dict[Key, list[float]] = {}
    for run in sorted(here, key=lambda run: run.values.get("round", -1)):
        if "round" in run.values:
            times.setdefault(key(run), []).append(run.values["solve_time_s"])
    out = []
    for run in here:
        error = quantity.value(run)
        if "round" not in run.values and error is not None and max(error, floor) > 0 and key(run) in times:
            out.append(Rung(run.name, max(error, floor), run.values["steps"], tuple(times[key(run)])))
    return out


def front(of: Sequence[Rung]) -> list[Rung]:
    """Return the rungs that no other beats in both error and time, from cheap to accurate."""
    out: list[Rung] = []
    for rung in sorted(of, key=lambda rung: (rung.time_s, rung.error)):
        if not out or rung.error < out[-1].error:
            out.append(rung)
    return out


def time_at(of: Sequence[Rung], error: float, at_round: int | None = None) -> float | None:
    """Return the time in s at which the front of some rungs reaches an error, None if it does not.

    Between two rungs it is interpolated log-log; one round's time, or else the median's.
    """
    before: Rung | None = None
    for rung in front(of):
        time = rung.time_s if at_round is None else rung.times_s[at_round]
        if rung.error <= error:
            if before is None or rung.error == error:
                return time
            slow = before.time_s if at_round is None else before.times_s[at_round]
            share = math.log(before.error / error) / math.log(before.error / rung.error)
            return float(slow * (time / slow) ** share)
        before = rung
    return None


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


def duel(slow: Sequence[Rung], fast: Sequence[Rung], error: float) -> Duel | None:
    """Return what ``slow`` takes in times of ``fast``, None where one of them does not reach the error."""
    rounds = min(len(rung.times_s) for rung in (*slow, *fast))
    ratios = []
    for k in range(rounds):
        a, b = time_at(slow, error, k), time_at(fast, error, k)
        if a is None or b is None:
            return None
        ratios.append(a / b)
    return Duel(float(np.median(ratios)), min(ratios), max(ratios))


def levels(of: Sequence[Rung], floor: float) -> list[float]:
    """Return the powers of ten between the truth's uncertainty and the second largest rung's error."""
    errors = sorted(rung.error for rung in of)
    if len(errors) < 2:
        return []
    low, high = math.ceil(math.log10(max(floor, errors[0]) * (1 + 1e-9))), math.floor(math.log10(errors[-2]))
    return [10.0**k for k in range(high, low - 1, -1)]
