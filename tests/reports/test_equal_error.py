"""Run times at equal error: interpolated within an arm, never beyond, and decided only where rounds agree."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from reports.equal_error import Arrival, arrival, arrivals, front, kept, levels, ratio, rungs
from reports.results import frame

Rung = tuple[float, float]
#: Two arms whose rungs alternate: no setting of either gives what a line from one arm to the other would.
CRUDE, SHARP = ((1e-2, 1.0), (1e-6, 100.0)), ((1e-4, 3.0), (1e-9, 400.0))


def ladder(*rungs: Rung, label: str = "engine (arm)", places: tuple[int, ...] | None = None) -> pd.DataFrame:
    """Return an arm's rungs from their errors and run times in s, each with a tenth of its error's number."""
    columns = pd.DataFrame(rungs, columns=["error", "time_s"]).assign(label=label)
    return columns.assign(
        engine=label.split()[0],
        kept=kept(columns),
        knob="step",
        value=columns["error"] / 10,
        place=places or range(len(rungs)),
        steps=1.0,
        motion_alone=False,
        times_s=[np.array([time, time]) for time in columns["time_s"]],
    )


def timed(*times_s: float) -> Arrival:
    return Arrival("engine", "engine (arm)", "step 0.1 s", np.array(times_s))


def reached(rungs: pd.DataFrame, error: float) -> tuple[str, str, object]:
    there = arrival(rungs, error)
    assert there is not None
    return there.label, there.setting, there.time_s


def test_the_time_at_an_error_lies_on_the_line_between_two_rungs_log_log() -> None:
    arm = ladder((1e-4, 1.0), (1e-8, 10.0))
    assert reached(arm, 1e-6)[1:] == ("step 1e-05 to 1e-09 s", pytest.approx(10**0.5))
    assert reached(arm, 1e-4)[1:] == ("step 1e-05 s", 1.0)
    assert reached(arm, 1e-8)[1:] == ("step 1e-09 s", 10.0)


def test_no_time_lies_between_the_rungs_of_different_arms() -> None:
    both = pd.concat([ladder(*CRUDE, label="engine (crude)"), ladder(*SHARP, label="engine (sharp)")])
    assert list(front(both)["error"]) == [1e-2, 1e-4, 1e-6, 1e-9], "the arms alternate on the front"
    mixed = 3.0**0.5
    assert reached(both, 1e-3) == ("engine (sharp)", "step 1e-05 s", 3.0), f"not {mixed}, which no step gives"
    assert reached(both, 1e-5) == (
        "engine (sharp)",
        "step 1e-05 to 1e-10 s",
        pytest.approx(3.0 * (400 / 3) ** 0.2),
    )


def test_a_rung_that_failed_is_not_interpolated_over() -> None:
    arm = ladder((1e-4, 1.0), (1e-8, 10.0), places=(0, 2))
    assert reached(arm, 1e-6)[1:] == ("step 1e-09 s", 10.0)


def test_a_rung_before_a_worse_one_is_luck_and_counts_by_that_ones_error() -> None:
    arm = ladder((1e-6, 1.0), (1e-4, 2.0), (1e-8, 4.0))
    assert list(arm["kept"]) == [1e-4, 1e-4, 1e-8]
    assert reached(arm, 1e-4)[2] == 1.0
    assert reached(arm, 1e-5)[1:] == ("step 1e-05 to 1e-09 s", pytest.approx(2.0 * 2.0**0.25))
    assert list(front(arm)["kept"]) == [1e-4, 1e-8]
    others = pd.concat([arm, ladder((1e-6, 2.5), label="engine (sharp)")])
    assert reached(others, 1e-6)[0] == "engine (sharp)", "another arm's rungs say nothing of this one's"


def recorded(error_m: float, step_s: float, **columns: Any) -> list[dict[str, Any]]:
    """Return a recorded run of a ladder by step, with two timed ones."""
    return rows_of(slider_position_error_m=error_m, **{"step_s": step_s, "case": str(step_s), **columns})


def kept_of(*rows: list[dict[str, Any]], column: str = "slider_position_error_m") -> list[float]:
    return list(rungs(frame([row for each in rows for row in each]), column, 0.0)["kept"])


def test_a_finer_run_that_failed_keeps_nothing_and_one_that_was_not_made_says_nothing() -> None:
    coarse, fine = recorded(1e-6, 0.2), recorded(1e-8, 0.05)
    assert kept_of(coarse, recorded(1e-7, 0.1, status="failed"), fine) == [np.inf, 1e-8]
    assert kept_of(coarse, recorded(1e-7, 0.1, status="unsupported"), fine) == [1e-6, 1e-8]
    timed_in_vain = recorded(1e-7, 0.1)
    timed_in_vain[-1]["status"] = "failed"
    assert kept_of(coarse, timed_in_vain, fine) == [np.inf, np.inf, 1e-8]


def test_errors_that_have_grown_to_the_clearance_rank_nobody() -> None:
    """From a tenth of 0.5 mm on, whatever signal is judged; at a fixed time by the error until then."""
    loose: dict[str, Any] = {"smallest_clearance_m": 5e-4, "joint_B_force_error_N": 1.0}
    early = "slider_position_error_until_6ms_m"
    rows = recorded(5e-5, 0.2, **loose, **{early: 1e-6}), recorded(4.9e-5, 0.1, **loose, **{early: 5.1e-5})
    assert kept_of(*rows) == [np.inf, 4.9e-5]
    assert kept_of(*rows, column="joint_B_force_error_N") == [np.inf, 1.0]
    assert kept_of(*rows, column=early) == [np.inf, np.inf]
    both = ladder((1e-3, 1.0), (1e-5, 2.0)).assign(kept=[np.inf, 1e-5])
    assert reached(both, 1e-4)[1:] == ("step 1e-06 s", 2.0), "nothing is interpolated from there"
    assert levels(both, 0.0) == []
    assert list(front(both)["kept"]) == [1e-5]


def test_an_error_that_no_rung_gets_to_has_no_time_and_a_coarse_one_the_first_rungs() -> None:
    arm = ladder((1e-4, 1.0), (1e-8, 10.0))
    assert arrival(arm, 1e-9) is None
    assert reached(arm, 1e-2)[2] == 1.0


def test_engines_come_with_their_cheapest_arm_the_cheapest_engine_first() -> None:
    arms = [("a (one)", 3.0), ("a (two)", 2.0), ("b (one)", 1.0)]
    all_rungs = pd.concat([ladder((1e-6, time), label=label) for label, time in arms])
    assert [(each.label, each.time_s) for each in arrivals(all_rungs, 1e-6)] == [
        ("b (one)", 1.0),
        ("a (two)", 2.0),
    ]


@pytest.mark.parametrize(
    ("times", "shown"),
    [
        ((6.0, 5.0, 9.0), "6 (5 to 9)"),
        ((1.1, 0.9, 1.2), "~1.1 (0.9 to 1.2)"),
        ((140.0,), "140 (140 to 140)"),
    ],
)
def test_a_ratio_is_marked_unless_its_interval_leaves_out_one(times: tuple[float, ...], shown: str) -> None:
    found = ratio(timed(*times), timed(*(1.0 for _ in times)))
    assert str(found) == shown
    assert found is not None
    told = f"{shown.split()[0]} times as long"
    assert found.in_words == (told if found.decided else f"{told} (not resolved by the timing)")


def test_the_interval_of_ten_rounds_is_narrower_than_their_range_and_the_same_every_time() -> None:
    rounds = timed(*np.linspace(2.0, 3.0, 10)), timed(*np.ones(10))
    found = ratio(*rounds)
    assert found is not None
    assert 2.0 < found.low < found.median < found.high < 3.0
    assert ratio(*rounds) == found


def test_a_ratio_is_of_the_rounds_that_both_have() -> None:
    found = ratio(timed(6.0, np.nan, 8.0), timed(np.nan, 1.0, 2.0))
    assert found is not None
    assert found.median == 4.0
    assert ratio(timed(np.nan, 1.0), timed(1.0, np.nan)) is None


def test_levels_are_powers_of_ten_that_at_least_two_rungs_bracket_above_the_floor() -> None:
    of = ladder(*((error, 1.0) for error in (3e-4, 2e-5, 4e-8)))
    assert levels(of, 0.0) == pytest.approx([1e-5, 1e-6, 1e-7])
    assert levels(of, 2e-6) == pytest.approx([1e-5])
    assert levels(of[:1], 0.0) == []


def rows_of(**recorded: Any) -> list[dict[str, Any]]:
    """Return a recorded run with two timed ones."""
    arm = {"scene": "s", "engine": "reference", "arm": "located", "label": "reference (located)"}
    case = {**arm, "case": "0", "fingerprint": "0", "step_s": 0.1, "status": "ok", "reason": "", **recorded}
    return [{**case, "steps": 9}, *({**case, "round": k, "solve_time_s": 1.0 + k} for k in (1, 0))]


def test_a_signal_that_is_exactly_zero_has_no_rungs_and_one_below_the_floor_is_at_it() -> None:
    rows = frame(rows_of(joint_O_force_error_N=0.0))
    assert rungs(rows, "joint_O_force_error_N", 0.0).empty
    (rung,) = rungs(rows, "joint_O_force_error_N", 1e-9).to_dict("records")
    assert (rung["error"], list(rung["times_s"]), rung["time_s"]) == (1e-9, [1.0, 2.0], 1.5)


def test_rungs_go_by_what_their_ladder_varies_with_failed_ones_and_compilations_left_out() -> None:
    """Two tolerances at the same step, whose runs come from the study in any order."""
    tolerances = (1e-10, 1e-6, 1e-8)
    rows = [
        row
        for tolerance in tolerances
        for row in rows_of(
            slider_position_error_m=tolerance,
            setting_step_tolerance=tolerance,
            case=str(tolerance),
            status="failed" if tolerance == 1e-8 else "ok",
        )
    ]
    compiled = {**rows_of()[0], "case": "c", "setting_step_tolerance": 1e-6, "compiled_anew": 1}
    found = rungs(frame([*rows, compiled]), "slider_position_error_m", 0.0)
    assert [(rung.knob, rung.value, rung.place) for rung in found.itertuples()] == [
        ("step_tolerance", 1e-6, 0),
        ("step_tolerance", 1e-10, 2),
    ]
