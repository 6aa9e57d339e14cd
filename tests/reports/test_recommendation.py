"""The recommendation of a comparison, from rows made by hand whose answer is known without it."""

import math
from collections.abc import Iterator
from typing import Any

import pandas as pd
import pytest

from reports.results import frame
from reports.standings import Standings, sentences, standings_table

ROUNDS = (1.1, 1.2, 1.0)
#: Errors in m and run times in s at tolerances 1e-4, 1e-6, 1e-8; 1e-6 m is asked for.
TOLERANCES = (1e-4, 1e-6, 1e-8)
FAST = ((1e-3, 0.00025), (1e-5, 0.001), (1e-7, 0.004))
SLOW = ((1e-4, 0.003), (1e-6, 0.006), (1e-8, 0.012))
REFUSED = {"status": "unsupported", "reason": "it has no rods"}


def rows(engine: str, settings: tuple[tuple[float, float], ...], **more: Any) -> Iterator[dict[str, Any]]:
    """Yield a recorded run and three timed ones at each tolerance."""
    for tolerance, (error, time) in zip(TOLERANCES, settings, strict=True):
        head: dict[str, Any] = {"scene": "mine", "engine": engine, "arm": "arm", "label": f"{engine} (arm)"}
        head |= {"case": f"{engine}{tolerance}", "status": "ok", "reason": "", "end_time_s": 1.0}
        head |= {
            "step_s": 0.01,
            "samples": 9,
            "setting_step_tolerance": tolerance,
            "judged_by": "slider_position_error_m",
        }
        measured: dict[str, Any] = {"slider_position_error_m": error, "slider_position_uncertainty_m": 1e-12}
        measured |= {"joint_O_force_error_N": 1e6 * error, "unaccounted_energy_part": 1e-9}
        measured |= {"compared_until_s": 1.0, "quality_failure": "", "wanted_error": 1e-6}
        yield {**head, **measured, **more}
        for k, part in enumerate(ROUNDS):
            yield {**head, "case": f"{head['case']}-{k}", "round": k, "solve_time_s": part * time}


def standings(*of: Iterator[dict[str, Any]]) -> Standings:
    return Standings.of(frame([row for each in of for row in each]))


def said(*of: Iterator[dict[str, Any]]) -> str:
    return "\n".join(sentences(standings(*of), "mine.toml"))


def test_the_fastest_at_the_error_wanted_is_recommended_at_a_setting_that_was_run() -> None:
    text = said(rows("exudyn", FAST), rows("reference", SLOW, compared_until_s=0.45)).splitlines()
    assert text == [
        "Use exudyn (arm) at step_tolerance 1e-08.",
        "Command: crankslider simulate mine.toml --engine exudyn --set step_tolerance=1e-08 "
        "--samples 9 --step 0.01",
        "Slider position error: 100 nm; asked for: 1 µm.",
        "Next best engine: reference (arm) at step_tolerance 1e-06, 1.5x slower at equal error.",
        "Not good enough at step_tolerance 1e-06: slider position error 10 µm.",
        "Predictability horizon: 0.45 s of 1 s. Errors are compared up to there; beyond it only statistics "
        "are meaningful.",
    ]


#: At 1e-4 the fast engine is lucky and at 1e-6 ten times worse than asked for; sure of itself; never sure.
LUCKY = ((1e-7, 0.0001), (1e-5, 0.001), (1e-7, 0.004))
SURE = ((1e-7, 0.0001), (2e-7, 0.001), (1e-9, 0.004))
NEVER = ((1e-7, 0.0001), (1e-7, 0.001), (1e-5, 0.004))
WRONG = ((1e-2, 0.001), (1e-3, 0.002), (1e-4, 0.003))
TIGHT, LOOSEST = "Use exudyn (arm) at step_tolerance 1e-08", "Use exudyn (arm) at step_tolerance 0.0001."
OTHER = "Use reference (arm) at step_tolerance 1e-06."
DOUBTED = "Slider position error: below 200 nm, the reference solution's uncertainty; asked for: 1 µm."
NONE, CLOSEST = (
    "No engine reached a slider position error of 1 µm at any tested setting.",
    "Closest: exudyn (arm)",
)


@pytest.mark.parametrize(
    ("fast", "columns", "expected", "absent"),
    [
        (LUCKY, {}, [TIGHT], []),
        (SURE, {}, [LOOSEST], ["Not good enough"]),  # there is no coarser setting
        (NEVER, {}, [OTHER], ["Next best engine"]),
        (FAST, {"motion_alone": True}, [f"{TIGHT} (motion only"], []),
        (FAST, {"slider_position_uncertainty_m": 2e-7}, [DOUBTED], []),
        (FAST, {"slider_position_model_difference_m": 1e-5}, [OTHER], []),
        (FAST, {"quality_failure": "energy"}, [OTHER], []),
        (FAST, {"not_judged": "joint_A_force_N: zero; x: y"}, ["joint A force is not compared (zero)."], []),
        (FAST, REFUSED, ["exudyn: unsupported, it has no rods."], []),
        (SLOW, {}, ["1x the time, not resolved by the timing, at equal error."], []),
    ],
)
def test_the_recommendation_follows_what_the_fastest_run_was(
    fast: Any, columns: dict[str, Any], expected: list[str], absent: list[str]
) -> None:
    text = said(rows("exudyn", fast, **columns), rows("reference", SLOW))
    assert [line for line in expected if line not in text] == [line for line in absent if line in text] == []


def test_the_coarser_setting_that_fails_is_named_and_where_none_is_good_enough_the_nearest() -> None:
    """At 1e-6 the run is good enough but slower; at 1e-4 it fails."""
    of = [{**row} for row in rows("exudyn", ((1e-7, 0.001), (2e-7, 0.009), (1e-8, 0.004)))]
    of[0] |= {"status": "failed", "reason": "diverged at t = 0.1 s", "slider_position_error_m": None}
    assert "Not good enough at step_tolerance 0.0001: failed, diverged at t = 0.1 s." in said(iter(of))
    assert said(rows("exudyn", WRONG)).startswith(f"{NONE}\n{CLOSEST} at step_tolerance 1e-08.")


def test_without_a_run_or_without_the_signal_nothing_is_recommended() -> None:
    silent = (row for row in rows("pymunk", SLOW, **REFUSED) if row["status"] != "ok")
    assert "No recommendation: no run finished" in said(silent)
    unjudged = {"slider_position_error_m": math.nan, "not_judged": "slider_position_m: zero"}
    text = said(rows("exudyn", FAST, **unjudged))
    assert text.startswith("No recommendation: slider position is not compared (zero).")


def test_every_engine_has_its_numbers_in_the_table_under_their_heads() -> None:
    impacts = {"impacts_matched": 7, "impacts_missed": 2, "impact_force_relative_error": 0.0123}
    found = standings(
        rows("exudyn", FAST, **impacts, motion_alone=True),
        rows("reference", SLOW, impact_force_relative_error=1.0, impact_force_relative_uncertainty=2.0),
        rows("pymunk", FAST, quality_failure="energy"),
    )
    before = found.recorded.copy()
    lines = [[*line] for line in standings_table(found).cells().itertuples(index=False)]
    head = ["exudyn (arm)", "step_tolerance 1e-08", "4*", "–"]
    assert lines[0] == [*head, "1.0e-07", "1.0e-01", "1.2e+00", "1.0e-07", "7 of 9"]
    head = ["reference (arm)", "step_tolerance 1e-06", "6", "1.5"]
    assert lines[1] == [*head, "1.0e-06", "1.0e+00", "< 2.0e+02", "1.0e-07", "–"]
    assert lines[2] == ["pymunk", "no valid run", *["–"] * 7]
    pd.testing.assert_frame_equal(found.recorded, before)
