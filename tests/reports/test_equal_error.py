"""Run times at equal error: interpolated between rungs, never beyond, and decided only where rounds agree."""

import numpy as np
import pandas as pd
import pytest

from reports.chapters.work_precision.tables import _ratio
from reports.equal_error import duel, front, levels, rungs, time_at
from reports.results import frame


def ladder(*errors_and_times: tuple[float, tuple[float, ...]]) -> pd.DataFrame:
    """Return rungs from their errors and the times of their rounds in s."""
    rungs = pd.DataFrame(errors_and_times, columns=["error", "times_s"])
    return rungs.assign(time_s=rungs["times_s"].map(np.median))


LADDER = ladder((1e-4, (1.0, 1.0, 1.0)), (1e-8, (10.0, 10.0, 10.0)))


def test_the_time_at_an_error_lies_on_the_line_between_two_rungs_log_log() -> None:
    assert time_at(LADDER, 1e-6) == pytest.approx(10**0.5)
    assert time_at(LADDER, 1e-4) == 1.0
    assert time_at(LADDER, 1e-8) == 10.0


def test_an_error_that_no_rung_reaches_has_no_time_and_a_coarse_one_the_first_rungs() -> None:
    assert np.isnan(time_at(LADDER, 1e-9))
    assert time_at(LADDER, 1e-2) == 1.0


def test_a_rung_that_costs_more_and_errs_more_is_not_on_the_front() -> None:
    worse = ladder((1e-3, (5.0, 5.0, 5.0)))
    assert list(front(pd.concat([LADDER, worse]))["error"]) == [1e-4, 1e-8]


def test_a_duel_is_the_ratio_of_the_times_in_each_round() -> None:
    slow, fast = ladder((1e-6, (6.0, 5.0, 9.0))), ladder((1e-6, (1.0, 2.0, 1.0)))
    assert duel(slow, fast, 1e-6) == pytest.approx([6.0, 2.5, 9.0])
    assert np.isnan(duel(slow, fast, 1e-7)).all()


@pytest.mark.parametrize(
    ("times", "shown"), [((6.0, 5.0, 9.0), "6 (5 to 9)"), ((1.1, 0.9, 1.2), "[1.1 (0.9 to 1.2)]")]
)
def test_a_ratio_is_in_brackets_unless_all_rounds_agree(times: tuple[float, ...], shown: str) -> None:
    fast, slow = ladder((1e-6, (1.0, 1.0, 1.0))), ladder((1e-6, times))
    rungs = pd.concat([fast.assign(engine="fast"), slow.assign(engine="slow")])
    assert _ratio(rungs, 1e-6) == ("fast", "slow", shown)
    assert _ratio(rungs, 1e-7) == ("–", "–", "–")


def test_levels_are_powers_of_ten_that_at_least_two_rungs_bracket_above_the_floor() -> None:
    of = ladder(*((error, (1.0,)) for error in (3e-4, 2e-5, 4e-8)))
    assert levels(of, 0.0) == pytest.approx([1e-5, 1e-6, 1e-7])
    assert levels(of, 2e-6) == pytest.approx([1e-5])
    assert levels(of[:1], 0.0) == []


def test_a_signal_that_is_exactly_zero_has_no_rungs_and_one_below_the_floor_is_at_it() -> None:
    arm = {"scene": "s", "engine": "reference", "arm": "located", "label": "reference (located)"}
    case = {**arm, "case": "0", "fingerprint": "0", "step_s": 0.1, "status": "ok", "reason": ""}
    recorded = {**case, "joint_O_force_error_N": 0.0, "steps": 9}
    timed = [{**case, "round": k, "solve_time_s": 1.0 + k} for k in (1, 0)]
    rows = frame([recorded, *timed])
    assert rungs(rows, "joint_O_force_error_N", 0.0).empty
    (rung,) = rungs(rows, "joint_O_force_error_N", 1e-9).to_dict("records")
    assert (rung["error"], rung["times_s"], rung["time_s"]) == (1e-9, (1.0, 2.0), 1.5)
