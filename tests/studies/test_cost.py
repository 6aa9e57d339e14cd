"""The cost study's rounds: each times every rung, in an order of its own that comes out again."""

from collections.abc import Iterable
from itertools import repeat

import numpy as np
import pytest

from engine_models.engine import BareRun
from studies import cost
from studies.case import Row, run_case


def test_every_round_times_the_same_rungs_in_an_order_of_its_own() -> None:
    one, again = (cost.cases(full=False) for _ in range(2))
    rounds: dict[object, list[str]] = {}
    for case in one:
        rounds.setdefault(case.columns["round"], []).append(str({**case.head(), "round": 0}))
    assert len(rounds) == cost.ROUNDS
    assert len({frozenset(order) for order in rounds.values()}) == 1
    assert len({tuple(order) for order in rounds.values()}) == len(rounds)
    assert [case.key for case in one] == [case.key for case in again], "which comes out again"


END = np.arange(9.0).reshape(3, 3)


class Timed:
    """An engine whose timed runs take these times, and whose second one ends off by some m."""

    def __init__(self, times_s: Iterable[float], off_m: float = 0.0) -> None:
        self.times_s, self.ends = iter(times_s), iter([0.0, off_m])

    def bare_run(self, *_: object) -> BareRun:
        end = END.copy()
        end[1, 1] += next(self.ends, 0.0)
        return BareRun(next(self.times_s), end)


def install(monkeypatch: pytest.MonkeyPatch, engine: Timed, repeats: int) -> None:
    monkeypatch.setattr(cost, "make_engine", lambda *_, **__: engine)
    monkeypatch.setattr(cost, "end_of", lambda *_: END)
    monkeypatch.setattr(cost, "REPEAT_S", 1e9)
    monkeypatch.setattr(cost, "REPEATS", repeats)


def rounds_of(monkeypatch: pytest.MonkeyPatch, repeats: int, rounds: int, *times_s: float) -> list[Row]:
    """Return the rows of rounds of so many repeats each of a setting whose timed runs take these times."""
    install(monkeypatch, Timed(times_s), repeats)
    timed = next(case for case in cost.cases(full=False) if "round" in case.columns)
    return [cost.measure(timed)[0] for _ in range(rounds)]


def test_a_round_is_timed_by_its_least_repeat_and_again_if_it_is_slower_than_one_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Slower by more than 1.3 times, and three times at the most."""
    (row,) = rounds_of(monkeypatch, 5, 1, 0.09, 0.01, 0.05, 0.02, 0.02)
    assert (row["solve_time_s"], row["repeats"]) == (0.01, 5)
    rows = rounds_of(monkeypatch, 1, 5, *(0.10, 0.2, 0.15, 0.18, 0.19, 0.05, 0.066, 0.07, 0.064))
    assert [row.get("solve_time_s") for row in rows] == [0.10, 0.15, 0.05, 0.064, None]
    assert [row["repeats"] for row in rows] == [1, 4, 1, 3, 0]  # two are as good as each other


@pytest.mark.parametrize("off_m", [4.9e-4, 5.1e-4, np.nan])
@pytest.mark.parametrize("scene", ["clearance-free-0.5mm", "ideal-free"])
def test_a_timed_run_that_ends_elsewhere_has_failed_and_says_when(
    scene: str, off_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A clearance of 0.5 mm, or a hundredth of a crank of 50 mm, in one direction, in the second of three."""
    install(monkeypatch, Timed(repeat(1.0), off_m), 3)
    timed = next(c for c in cost.cases(False) if c.timed and c.scene.name == scene)
    row, _ = run_case(timed)
    if off_m < 5e-4:
        assert (row["status"], row["repeats"]) == ("ok", 3)
        assert row["end_apart_m"] == pytest.approx(off_m)
    else:
        what = f"off by {off_m:.3g} m from the recorded run's" if np.isfinite(off_m) else "not finite"
        assert (row["status"], row["exception"]) == ("failed", "SimulationFailed")
        assert row["reason"] == f"the timed run's end at t = {timed.scene.end_time_s:.6g} s is {what}"
