"""Run times at equal error: interpolated between rungs, never beyond, and decided only where rounds agree."""

import pytest

from reports.equal_error import Rung, duel, front, levels, rungs, time_at
from reports.quantities import column
from reports.results import Run
from reports.style import Name

FAST: Name = ("reference", "located")
SLOW: Name = ("exudyn", "DOPRI5")


def rung(name: Name, error: float, *times_s: float) -> Rung:
    return Rung(name, error, 1.0, times_s)


LADDER = [rung(FAST, 1e-4, 1.0, 1.0, 1.0), rung(FAST, 1e-8, 10.0, 10.0, 10.0)]


def test_the_time_at_an_error_lies_on_the_line_between_two_rungs_log_log() -> None:
    assert time_at(LADDER, 1e-6) == pytest.approx(10**0.5)
    assert time_at(LADDER, 1e-4) == 1.0
    assert time_at(LADDER, 1e-8) == 10.0


def test_an_error_that_no_rung_reaches_has_no_time_and_a_coarse_one_the_first_rungs() -> None:
    assert time_at(LADDER, 1e-9) is None
    assert time_at(LADDER, 1e-2) == 1.0


def test_a_rung_that_costs_more_and_errs_more_is_not_on_the_front() -> None:
    worse = rung(FAST, 1e-3, 5.0, 5.0, 5.0)
    assert front([*LADDER, worse]) == LADDER


def test_a_duel_is_the_median_ratio_with_its_range_and_decided_if_all_rounds_agree() -> None:
    slow = [rung(SLOW, 1e-6, 6.0, 5.0, 9.0)]
    fast = [rung(FAST, 1e-6, 1.0, 1.0, 1.0)]
    found = duel(slow, fast, 1e-6)
    assert found is not None
    assert (found.median, found.least, found.most) == (6.0, 5.0, 9.0)
    assert found.decided
    close = duel([rung(SLOW, 1e-6, 0.9, 1.1, 1.0)], fast, 1e-6)
    assert close is not None
    assert not close.decided
    assert duel(slow, fast, 1e-7) is None


def test_levels_are_powers_of_ten_that_at_least_two_rungs_bracket_above_the_floor() -> None:
    of = [rung(FAST, e, 1.0) for e in (3e-4, 2e-5, 4e-8)]
    assert levels(of, 0.0) == pytest.approx([1e-5, 1e-6, 1e-7])
    assert levels(of, 2e-6) == pytest.approx([1e-5])
    assert levels(of[:1], 0.0) == []


def test_a_signal_that_is_exactly_zero_has_no_rungs_and_one_below_the_floor_is_at_it() -> None:
    def run(error: float, **values: float) -> Run:
        values = {"joint_O_force_error_N": error, "steps": 9.0, "solve_time_s": 1.0, **values}
        return Run("case", "fingerprint", "s", *FAST, 0.1, "ok", "", values, {})

    force = column("joint_O_force_error_N")
    timed = run(0.0, round=0.0)
    assert rungs([run(0.0), timed], "s", force, 0.0) == []
    assert [rung.error for rung in rungs([run(0.0), timed], "s", force, 1e-9)] == [1e-9]
