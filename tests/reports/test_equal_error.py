"""Run times at equal error: of settings that were run, and resolved only where rounds agree."""

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reports.equal_error import Ratio, candidates, front, is_resolved, judged, kept, ratio, reaching, settings
from reports.results import frame

#: Two configurations whose errors alternate: no setting of either gives what a line between the two would.
CRUDE, SHARP = ((1e-2, 1.0), (1e-6, 100.0)), ((1e-4, 3.0), (1e-9, 400.0))
SLIDER, FORCE = "slider_position_error_m", "joint_B_force_error_N"


def series(*ran: tuple[float, float], label: str = "engine (arm)", scene: str = "s") -> pd.DataFrame:
    """Return a configuration's settings from errors and run times in s, called by their errors."""
    columns = pd.DataFrame(ran, columns=["error", "time_s"]).assign(label=label, engine=label.split()[0])
    columns = columns.assign(scene=scene, lost=False, column="x", setting=columns["error"].map("{:g}".format))
    return columns.assign(kept=kept(columns), end_time_s=1.0)


def within(ran: pd.DataFrame, error: float) -> pd.DataFrame:
    return ran.assign(reached=ran["kept"] <= error)


def reached(ran: pd.DataFrame, error: float) -> list[tuple[str, str, float]]:
    best = reaching(within(ran, error))[["label", "setting", "time_s"]]
    return [*best.itertuples(index=False, name=None)]


def test_who_reaches_an_error_does_so_at_a_setting_that_was_run() -> None:
    both = pd.concat([series(*CRUDE, label="engine (crude)"), series(*SHARP, label="engine (sharp)")])
    assert list(front(both)["error"]) == [1e-2, 1e-4, 1e-6, 1e-9], "the two alternate on the front"
    assert reached(both, 1e-3) == [("engine (sharp)", "0.0001", 3.0)]
    assert reached(both, 1e-5) == [("engine (crude)", "1e-06", 100.0)]
    assert reached(both, 1e-10) == []
    assert front(series((1e-4, 2.0), (1e-4, 1.0)))["time_s"].tolist() == [1.0]
    arms = [("a (one)", 3.0), ("a (two)", 2.0), ("b (one)", 1.0)]
    together = pd.concat([series((1e-6, time), label=label) for label, time in arms])
    assert [of[::2] for of in reached(together, 1e-6)] == [("b (one)", 1.0), ("a (two)", 2.0)]


def test_a_setting_before_a_worse_one_is_luck_and_counts_by_that_ones_error() -> None:
    ran = series((1e-6, 1.0), (1e-4, 2.0), (1e-8, 4.0))
    assert list(ran["kept"]) == [1e-4, 1e-4, 1e-8]
    assert reached(ran, 1e-5) == [("engine (arm)", "1e-08", 4.0)]
    assert list(front(ran)["kept"]) == [1e-4, 1e-8]
    (other,) = reached(pd.concat([ran, series((1e-6, 2.5), label="engine (sharp)")]), 1e-6)
    assert other[0] == "engine (sharp)", "another configuration's settings say nothing of this one's"


def recorded(error: Any, step_s: float = 0.1, rounds: tuple[float, ...] = (2.0, 1.0), **more: Any) -> Any:
    """Return a recorded run at a step, with its timed ones."""
    head = {"scene": "s", "engine": "reference", "arm": "located", "label": "reference (located)"}
    case = {**head, "case": str(step_s), "step_s": step_s, "status": "ok", "reason": "", **more}
    case |= {SLIDER: error} if case["status"] == "ok" else {}
    timed = [{**case, "round": k, "solve_time_s": time} for k, time in enumerate(rounds)]
    return [{**case, "end_time_s": 1.0}, *timed]


def judge(*rows: list[dict[str, Any]], column: str = SLIDER) -> pd.DataFrame:
    return judged(settings(frame([row for each in rows for row in each])), column, 1.0)


def test_a_finer_run_that_failed_keeps_nothing_and_one_that_was_not_made_says_nothing() -> None:
    coarse, fine = recorded(1e-6, 0.2), recorded(1e-8, 0.05)
    assert list(judge(coarse, recorded(1e-7, status="failed"), fine)["kept"]) == [np.inf, 1e-8]
    assert list(judge(coarse, recorded(1e-7, status="unsupported"), fine)["kept"]) == [1e-6, 1e-8]
    timed_in_vain = recorded(1e-7)
    timed_in_vain[-1]["status"] = "failed"
    assert list(judge(coarse, timed_in_vain, fine)["kept"]) == [np.inf, np.inf, 1e-8]


def test_errors_that_have_grown_to_the_clearance_rank_nobody() -> None:
    """From a tenth of 0.5 mm on, whatever signal is judged."""
    loose: dict[str, Any] = {"smallest_clearance_m": 5e-4, FORCE: 1.0}
    rows = recorded(5e-5, 0.2, **loose), recorded(4.9e-5, 0.1, **loose)
    assert list(judge(*rows)["kept"]) == [np.inf, 4.9e-5]
    assert list(judge(*rows, column=FORCE)["kept"]) == [np.inf, 1.0]


def ran(*rounds: float) -> Any:
    """Return the setting whose run took these times."""
    (only,) = judge(recorded(1.0, rounds=rounds)).itertuples()
    return only


@pytest.mark.parametrize(
    ("slow", "fast", "expected", "resolved", "shown"),
    [
        ((9.0, 5.0, 6.4), (2.0, 1.0, 2.0), (5.0, 2.5, 6.4), True, "5"),
        ((1.1, 1.5), (1.0, 1.2), (1.1, 1.1 / 1.2, 1.5), False, "~1.1"),
        ((9.0,), (1.0,), (9.0, 0.0, math.inf), False, "~9"),
    ],
)
def test_a_ratio_is_of_the_least_times_and_marked_unless_its_interval_leaves_out_one(
    slow: tuple[float, ...], fast: tuple[float, ...], expected: Any, resolved: bool, shown: str
) -> None:
    """Either time may be that of its second round; where there is one alone nothing is resolved."""
    found = ratio(ran(*slow), ran(*fast))
    assert (found.times, found.low, found.high) == pytest.approx(expected)
    assert (is_resolved(ran(*slow)), str(found)) == (resolved, shown)
    assert ran(*slow).last_s == max(slow)
    assert not Ratio(2.0, 1.0, 3.0).decided, "an interval that ends at one contains it"
    assert Ratio(0.5, 0.4, 0.9).decided


def test_a_signal_that_is_exactly_zero_has_no_settings_and_one_below_the_floor_is_at_it() -> None:
    assert judge(recorded(0.0)).empty
    (at_floor,) = judge(recorded(0.0, slider_position_uncertainty_m=1e-9)).itertuples()
    assert (at_floor.error, at_floor.floor) == (1e-9, 1e-9)


def test_settings_go_by_what_is_varied_with_failed_ones_left_out() -> None:
    """Tolerances at the same step, whose runs come from the study in any order; another scene's by itself."""
    ran = [(1e-10, "ok", "s"), (1e-6, "ok", "s"), (1e-8, "failed", "s"), (1e-4, "ok", "t")]
    rows = [
        recorded(at, setting_step_tolerance=at, case=f"{at}", status=status, scene=scene)
        for at, status, scene in ran
    ]
    found = judge(*rows)
    assert list(found["setting"]) == ["step_tolerance 1e-06", "step_tolerance 1e-10", "step 0.1 s"]
    assert list(found["scene"]) == ["s", "s", "t"]


def test_the_candidate_of_an_engine_is_the_setting_that_reaches_the_error_on_most_scenes() -> None:
    """Of two settings of a that reach it on both scenes one is twice as slow at most, the other 2.1 times.

    In sum the other is the faster one: 1 and 2.1 times, not 2 and 1.2.
    """
    runs = [("s", "a (even)", 1e-6, 2.0), ("s", "a (odd)", 1e-7, 1.0), ("s", "a (half)", 1e-7, 1.0)]
    runs += [("t", "a (even)", 1e-7, 3.0), ("t", "a (odd)", 1e-7, 5.25), ("t", "a (half)", 1e-5, 0.1)]
    runs += [("t", "c (one)", 1e-7, 2.5), ("u", "b (one)", 1e-8, 4.0)]
    every = pd.concat([series(of, label=label, scene=scene) for scene, label, *of in runs])  # type: ignore[arg-type]
    first, *others = candidates(within(every.assign(setting="step"), 1e-6))
    assert first["label"].iloc[0] == "a (even)"
    assert list(first["slowdown"]) == [2.0, 1.2]
    assert list(first["scene"]) == ["s", "t"]
    ranked = {(each["label"].iloc[0], *each["scene"]) for each in others}
    assert ranked == {("b (one)", "u"), ("c (one)", "t")}
