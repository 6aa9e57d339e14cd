"""The recommendation of a comparison, from rows made by hand whose answer is known without it."""

import re
from collections.abc import Iterator
from typing import Any

import pandas as pd
import pytest

from reports.comparison.sentences import sentences
from reports.comparison.standing import Standings, standings_table
from reports.results import frame

WANTED_M = 1e-6
ROUNDS = (1.1, 1.2, 1.0)
#: Errors in m and run times in s at tolerances 1e-4, 1e-6, 1e-8: the fast engine has 1e-6 m at the last.
TOLERANCES = (1e-4, 1e-6, 1e-8)
FAST = ((1e-3, 0.00025), (1e-5, 0.001), (1e-7, 0.004))
SLOW = ((1e-4, 0.003), (1e-6, 0.006), (1e-8, 0.012))
FAST_M_S, SLOW_M_S = 0.004, 0.006


def rows(engine: str, settings: tuple[tuple[float, float], ...], **more: Any) -> Iterator[dict[str, Any]]:
    for tolerance, (error, time) in zip(TOLERANCES, settings, strict=True):
        head = {
            "case": f"{engine}{tolerance}",
            "scene": "mine",
            "engine": engine,
            "arm": "arm",
            "label": f"{engine} (arm)",
            "end_time_s": 1.0,
            "step_s": 0.01,
            "setting_step_tolerance": tolerance,
            "judged_by": "slider_position_error_m",
            "wanted_error": WANTED_M,
            "status": "ok",
            "reason": "",
        }
        yield {
            **head,
            "steps": 100,
            "compared_until_s": 1.0,
            "slider_position_error_m": error,
            "slider_position_uncertainty_m": 1e-12,
            "joint_O_force_error_N": 1e6 * error,
            "unaccounted_energy_part": 1e-9,
            "quality_failure": "",
            **more,
        }
        for k, part in enumerate(ROUNDS):
            yield {**head, "case": f"{head['case']}-{k}", "round": k, "solve_time_s": part * time} | {
                "build_time_s": 1e-5
            }


def standings(*of: Iterator[dict[str, Any]]) -> Standings:
    return Standings.of(frame([row for each in of for row in each]))


def said(*of: Iterator[dict[str, Any]]) -> str:
    return "\n".join(sentences(standings(*of), "mine.toml"))


def test_the_fastest_at_the_error_wanted_is_recommended_at_a_setting_that_was_run() -> None:
    text = said(rows("exudyn", FAST), rows("reference", SLOW))
    assert "Use exudyn (arm) at step_tolerance 1e-08." in text
    assert "Slider position error: 100 nm; asked for: 1 µm." in text
    assert "Not good enough at step_tolerance 1e-06: slider position error 10 µm." in text


def test_times_are_compared_at_equal_error() -> None:
    found = standings(rows("exudyn", FAST), rows("reference", SLOW))
    assert [each.time_s for each in found.reached] == pytest.approx([FAST_M_S, SLOW_M_S])
    text = "\n".join(sentences(found, "mine.toml"))
    other = "Next best engine: reference (arm) at step_tolerance 1e-06"
    assert f"{other}, 1.5x slower at equal error." in text


def test_what_is_recommended_stays_within_the_error_at_all_finer_settings() -> None:
    """At 1e-4 the fast engine is lucky: ten times as good as is asked for, and at 1e-6 ten times worse."""
    lucky = ((1e-7, 0.0001), (1e-5, 0.001), (1e-7, 0.004))
    text = said(rows("exudyn", lucky), rows("reference", SLOW))
    assert "Use exudyn (arm) at step_tolerance 1e-08." in text
    sure = said(rows("exudyn", ((1e-7, 0.0001), (2e-7, 0.001), (1e-9, 0.004))), rows("reference", SLOW))
    assert "Use exudyn (arm) at step_tolerance 0.0001." in sure
    assert "Not good enough" not in sure, "there is no coarser setting"
    never = said(rows("exudyn", ((1e-7, 0.0001), (1e-7, 0.001), (1e-5, 0.004))), rows("reference", SLOW))
    assert "Use reference (arm) at step_tolerance 1e-06." in never
    assert "No other engine reached that error." in never


def test_motion_alone_is_recommended_as_such_with_what_gives_forces_too() -> None:
    text = said(rows("exudyn", FAST, motion_alone=True), rows("reference", SLOW))
    assert "Use exudyn (arm) at step_tolerance 1e-08 (motion only" in text
    assert "With forces in the solve: reference (arm) at step_tolerance 1e-06, 1.5x slower" in text
    assert "Next best engine" not in text, "it is the same"
    both = said(rows("exudyn", FAST, motion_alone=True), rows("scipy", FAST, motion_alone=True))
    assert "No setting with forces in the solve reached that error." in both


def test_forces_and_the_next_engine_are_two_things_where_that_gives_motion_alone_too() -> None:
    slowest = tuple((error, 10 * time) for error, time in SLOW)
    alone = {"motion_alone": True}
    text = said(rows("exudyn", FAST, **alone), rows("scipy", SLOW, **alone), rows("reference", slowest))
    assert "With forces in the solve: reference (arm)" in text
    assert "Next best engine: scipy (arm)" in text


def test_an_error_below_the_reference_solutions_uncertainty_is_a_bound() -> None:
    known = {"slider_position_uncertainty_m": 2e-7, "joint_O_force_uncertainty_N": 0.5}
    text = said(rows("exudyn", FAST, **known))
    assert (
        "Slider position error: below 200 nm, the reference solution's uncertainty; asked for: 1 µm." in text
    )
    assert "joint force below 500 mN, the reference solution's uncertainty" in text
    assert "100 nm" not in text


def test_the_form_of_the_model_counts_as_error() -> None:
    other_law = {"slider_position_model_difference_m": 1e-5}
    text = said(rows("exudyn", FAST, **other_law), rows("reference", SLOW))
    assert "Use reference (arm) at step_tolerance 1e-06." in text
    assert "No other engine reached that error." in text


def test_what_fails_the_check_is_not_recommended() -> None:
    found = standings(rows("exudyn", FAST, quality_failure="energy"), rows("reference", SLOW))
    assert "Use reference (arm)" in "\n".join(sentences(found, "mine.toml"))
    table = standings_table(found)
    assert list(table.cells()[["configuration", "setting"]].itertuples(index=False, name=None)) == [
        ("reference (arm)", "step_tolerance 1e-06"),
        ("exudyn", "no valid run"),
    ]


def test_the_coarser_setting_that_fails_is_named_with_its_failure() -> None:
    """At 1e-6 the run is good enough but slower; at 1e-4 it fails."""
    of = [{**row} for row in rows("exudyn", ((1e-7, 0.001), (2e-7, 0.009), (1e-8, 0.004)))]
    coarsest = next(row for row in of if row["setting_step_tolerance"] == 1e-4)
    text = said(iter([coarsest | {"status": "failed", "reason": "diverged at t = 0.1 s"}, *of[1:]]))
    assert "Use exudyn (arm) at step_tolerance 1e-08." in text
    assert "Not good enough at step_tolerance 0.0001: failed, diverged at t = 0.1 s." in text


def test_a_ratio_that_the_timing_does_not_resolve_is_marked_as_such() -> None:
    """The rounds of both take 0.9 to 1.1 times their medians, in another order."""
    of = list(rows("reference", FAST))
    for row in of:
        if "round" in row:
            row["round"] = {0: 1, 1: 2, 2: 0}[row["round"]]
    text = said(rows("exudyn", FAST), iter(of))
    assert re.search(
        r"Next best engine: .*, [\d.]+x the time at equal error, not resolved by the timing\.", text
    )


def test_where_none_is_good_enough_the_nearest_is_named_as_such() -> None:
    coarse = ((1e-2, 0.001), (1e-3, 0.002), (1e-4, 0.003))
    text = said(rows("exudyn", coarse))
    assert "No engine reached a slider position error of 1 µm at any tested setting." in text
    assert "Closest: exudyn (arm) at step_tolerance 1e-08." in text
    assert "Slider position error: 100 µm; asked for: 1 µm." in text


def test_where_one_engine_ran_it_is_said() -> None:
    assert "No other engine ran." in said(rows("exudyn", FAST))


def test_a_horizon_before_the_end_is_reported() -> None:
    text = said(rows("exudyn", FAST, compared_until_s=0.25))
    assert "Predictability horizon: 0.25 s of 1 s." in text


def test_an_engine_that_refuses_is_named_with_its_reason() -> None:
    refusal = {"status": "unsupported", "reason": "it has no rods"}
    text = said(rows("exudyn", FAST), rows("pymunk", SLOW, **refusal))
    assert "pymunk: unsupported, it has no rods." in text


def test_of_nothing_but_refusals_nothing_is_recommended() -> None:
    refusal = {"status": "unsupported", "reason": "it has no rods"}
    silent = (row for row in rows("pymunk", SLOW, **refusal) if row["status"] != "ok")
    assert "No recommendation: no run finished" in said(silent)


def test_the_rows_are_not_changed() -> None:
    table = frame([*rows("exudyn", FAST)])
    before = table.copy()
    list(sentences(Standings.of(table), "mine.toml"))
    pd.testing.assert_frame_equal(table, before)
