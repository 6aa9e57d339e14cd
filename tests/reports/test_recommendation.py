"""The recommendation of a comparison, from rows made by hand whose answer is known without it."""

import re
from collections.abc import Iterator
from typing import Any

import pandas as pd
import pytest

from reports.chapters.comparison.recommendation import sentences
from reports.chapters.comparison.standing import Standings
from reports.results import frame

WANTED_M = 1e-6
ROUNDS = (1.0, 1.1, 0.9)
#: Errors in m and run times in s at tolerances 1e-4, 1e-6, 1e-8: on straight lines in logarithms, the fast
#: engine's at 1e-6 m halfway between two rungs, that is at sqrt(1 ms * 4 ms), the slow one's at a rung.
TOLERANCES = (1e-4, 1e-6, 1e-8)
FAST = ((1e-3, 0.00025), (1e-5, 0.001), (1e-7, 0.004))
SLOW = ((1e-4, 0.003), (1e-6, 0.006), (1e-8, 0.012))
FAST_M_S, SLOW_M_S = 0.002, 0.006


def rows(engine: str, rungs: tuple[tuple[float, float], ...], **more: Any) -> Iterator[dict[str, Any]]:
    for tolerance, (error, time) in zip(TOLERANCES, rungs, strict=True):
        head = {
            "case": f"{engine}{tolerance}",
            "fingerprint": engine,
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


def test_the_cheapest_at_the_error_wanted_is_recommended_at_a_setting_that_was_run() -> None:
    text = said(rows("exudyn", FAST), rows("reference", SLOW))
    assert "Take exudyn (arm) at step_tolerance 1e-08." in text
    assert "1.0×10⁻⁷ m at most; 1.0×10⁻⁶ m is what is asked for" in text
    assert "It stops being good enough at step_tolerance 1e-06, the next coarser here" in text


def test_times_are_compared_at_equal_error() -> None:
    found = standings(rows("exudyn", FAST), rows("reference", SLOW))
    assert [each.time_s for each in found.there] == pytest.approx([FAST_M_S, SLOW_M_S])
    text = "\n".join(sentences(found, "mine.toml"))
    other = "Without exudyn, take reference (arm) at step_tolerance 1e-06"
    assert f"{other}: it takes {SLOW_M_S / FAST_M_S:.0f} times as long at equal error." in text


def test_what_is_recommended_stays_within_the_error_at_all_finer_settings() -> None:
    """At 1e-4 the fast engine is lucky: ten times as good as is asked for, and at 1e-6 ten times worse."""
    lucky = ((1e-7, 0.0001), (1e-5, 0.001), (1e-7, 0.004))
    text = said(rows("exudyn", lucky), rows("reference", SLOW))
    assert "Take exudyn (arm) at step_tolerance 1e-08." in text
    assert "finer setting" not in text, "there is none that ran"
    sure = said(rows("exudyn", ((1e-7, 0.0001), (2e-7, 0.001), (1e-9, 0.004))), rows("reference", SLOW))
    assert "Take exudyn (arm) at step_tolerance 0.0001." in sure
    assert "With all 2 finer settings of it that ran it stays within that." in sure
    never = said(rows("exudyn", ((1e-7, 0.0001), (1e-7, 0.001), (1e-5, 0.004))), rows("reference", SLOW))
    assert "Take reference (arm) at step_tolerance 1e-06." in never
    assert "No other engine gets to that error." in never


def test_motion_alone_is_recommended_as_such_with_what_gives_forces_too() -> None:
    text = said(rows("heyoka", FAST, motion_alone=True), rows("reference", SLOW))
    assert "For the motion alone take heyoka (arm) at step_tolerance 1e-08." in text
    assert "For forces in the solve, or without heyoka, take reference (arm) at step_tolerance 1e-06" in text
    both = said(rows("heyoka", FAST, motion_alone=True), rows("scipy", FAST, motion_alone=True))
    assert "Nothing that gives forces in its solve gets to that error." in both


def test_forces_and_the_next_engine_are_two_things_where_that_gives_motion_alone_too() -> None:
    slowest = tuple((error, 10 * time) for error, time in SLOW)
    alone = {"motion_alone": True}
    text = said(rows("heyoka", FAST, **alone), rows("scipy", SLOW, **alone), rows("reference", slowest))
    assert "For forces in the solve, take reference (arm)" in text
    assert "Without heyoka, take scipy (arm)" in text


def test_an_error_below_what_is_known_of_the_truth_has_no_digits() -> None:
    known = {"slider_position_uncertainty_m": 2e-7, "joint_O_force_uncertainty_N": 0.5}
    text = said(rows("exudyn", FAST, **known))
    assert "Its slider position error is less than the 2.0×10⁻⁷ m to which the truth is known" in text
    assert "Its joint forces are off by less than the 0.5 N to which the truth is known" in text
    assert "1.0×10⁻⁷" not in text


def test_the_form_of_the_model_counts_as_error() -> None:
    other_law = {"slider_position_model_difference_m": 1e-5}
    text = said(rows("exudyn", FAST, **other_law), rows("reference", SLOW))
    assert "Take reference (arm) at step_tolerance 1e-06." in text
    assert "No other engine gets to that error." in text


def test_what_fails_the_check_is_not_recommended() -> None:
    text = said(rows("exudyn", FAST, quality_failure="energy"), rows("reference", SLOW))
    assert "Take reference (arm)" in text
    assert "exudyn" not in text


def test_where_none_is_good_enough_the_nearest_is_named_as_such() -> None:
    coarse = ((1e-2, 0.001), (1e-3, 0.002), (1e-4, 0.003))
    text = said(rows("exudyn", coarse))
    assert "No engine gets to the slider position error of 1.0×10⁻⁶ m" in text
    assert "The nearest is exudyn (arm) at step_tolerance 1e-08, with 1.0×10⁻⁴ m." in text
    assert "nothing to compare it with" in text


def test_a_horizon_before_the_end_is_told() -> None:
    text = said(rows("exudyn", FAST, compared_until_s=0.25))
    assert "past 0.25 s of 1 s" in text


def test_who_refuses_is_named_with_the_reason_and_whose_word_it_is() -> None:
    refusal = {"status": "unsupported", "reason": "it has no rods", "spoken_by": "engine"}
    text = said(rows("exudyn", FAST), rows("pymunk", SLOW, **refusal))
    assert "pymunk finished no run: it has no rods (said by the engine)." in text


def test_of_nothing_but_refusals_nothing_is_recommended() -> None:
    refusal = {"status": "unsupported", "reason": "it has no rods", "spoken_by": "engine"}
    silent = (row for row in rows("pymunk", SLOW, **refusal) if row["status"] != "ok")
    assert "Nothing can be recommended" in said(silent)


def test_no_sentence_has_more_than_two_numbers() -> None:
    impacts = {"impacts_matched": 9, "impacts_missed": 3, "impacts_unmatched": 1, "impact_time_error_s": 1e-6}
    impacts |= {"motion_alone": True}
    for text in said(rows("exudyn", FAST, compared_until_s=0.25, **impacts), rows("scipy", SLOW)).split("\n"):
        assert len(re.findall(r"(?<![\w×⁻.-])\d[\d.]*(e-\d+)?", text.replace("×10", ""))) <= 2, text


def test_the_rows_are_not_changed() -> None:
    table = frame([*rows("exudyn", FAST)])
    before = table.copy()
    list(sentences(Standings.of(table), "mine.toml"))
    pd.testing.assert_frame_equal(table, before)
