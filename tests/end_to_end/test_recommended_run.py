"""What is said of the run that is recommended, on rows with round numbers, and what its command asks for."""

import math
from pathlib import Path
from shlex import split
from typing import Any, NoReturn

import pytest

from engine_models.engines import make_engine
from reports.chapters.answer.picks import races
from reports.chapters.comparison.recommendation import sentences
from reports.chapters.comparison.sections import standings_table
from reports.chapters.comparison.standing import Standings
from reports.results import Results, frame
from studies.command import simulation
from studies.running.failures import Failed
from studies.work_precision.study import cases
from tests.end_to_end.written_rows import row
from tests.helpers.command import crankslider

ASKED: dict[str, Any] = {"judged_by": "slider_position_error_m", "wanted_error": 1e-6}


def standings(**of_reference: Any) -> Standings:
    """Return where they stand: the reference, 0.2 µm off in 3 ms, and Exudyn, 0.4 µm off in 9 ms."""
    rows: list[dict[str, Any]] = []
    for engine, error_m, time_s, columns in (
        ("reference", 2e-7, 0.003, of_reference),
        ("exudyn", 4e-7, 0.009, {"compared_until_s": 0.45}),
    ):
        common: dict[str, Any] = {**ASKED, "end_time_s": 0.5}
        measured: dict[str, Any] = {"steps": 100, "compared_until_s": 0.5, "slider_position_error_m": error_m}
        measured |= {
            "joint_A_force_error_N": 0.25,
            "joint_B_force_error_N": 0.5,
            "unaccounted_energy_part": 2e-4,
        }
        measured |= {"slider_position_uncertainty_m": 1e-12, "quality_failure": "", **columns}
        rows.append(row(len(rows), "mine", engine, "arm", 0.01, **{**common, **measured}))
        for n, part in enumerate((1.0, 0.9, 1.1)):
            timed = {"timed": True, "round": n, "solve_time_s": part * time_s, "build_time_s": 0.04}
            rows.append(row(len(rows), "mine", engine, "arm", 0.01, **{**common, **timed}))
    return Standings.of(frame(rows))


def said(**of_reference: Any) -> tuple[str, ...]:
    """Return the sentences on these."""
    return tuple(sentences(standings(**of_reference), "mine.toml --with end_time_s=0.5"))


def test_every_engine_has_its_numbers_in_the_table_under_their_heads() -> None:
    table = standings_table(standings())
    assert table.head == ("engine and arm", "setting", "time [ms]", "ratio", "error [m]", "force error [N]")
    assert table.rows == (
        ("reference (arm)", "step 0.01 s", "3", "–", "2.0e-07", "5.0e-01"),
        ("exudyn (arm)", "step 0.01 s", "9", "3 (3 to 3)", "4.0e-07", "5.0e-01"),
    )


def test_every_sentence_has_its_numbers() -> None:
    impacts = {"impacts_matched": 7, "impacts_missed": 2, "impacts_unmatched": 3, "impact_time_error_s": 4e-6}
    peaks = {"impact_force_error_N": 3.0, "impact_force_relative_error": 1.0}
    assert said(**impacts, **peaks) == (
        "Take reference (arm) at step 0.01 s.",
        "To run it: crankslider simulate mine.toml --with end_time_s=0.5 --engine reference --step 0.01",
        "Its slider position error is 2.0×10⁻⁷ m at most; 1.0×10⁻⁶ m is what is asked for.",
        "Its solve takes 3 ms; building the model and reading out take 40 ms more.",
        "Without reference, take exudyn (arm) at step 0.01 s: it takes 3 times as long at equal error.",
        "To run it: crankslider simulate mine.toml --with end_time_s=0.5 --engine exudyn --step 0.01",
        "Its joint forces are off by up to 0.5 N, pointwise through the impacts.",
        "The peak forces of its impacts are off by up to 100 %; one that is missed counts as 100 %.",
        # Two of nine are missed, and three are none.
        "It has 7 of 9 impacts, bounces that die away included.",
        "3 of its impacts are none of the truth's.",
        "No physics accounts for 2.0×10⁻⁴ of the energy in play.",
        # Exudyn's is the shortest comparison.
        "No run is to be trusted moment by moment past 0.45 s of 0.5 s: starts moved by a hair part "
        "there, so errors "
        "are those before, and only averages mean something after.",
    )


def test_peak_forces_are_told_in_percent_as_far_as_the_truth_knows_them() -> None:
    impacts: dict[str, Any] = {"impacts_matched": 7, "impacts_missed": 0, "impacts_unmatched": 0}
    impacts |= {"impact_time_error_s": 4e-6, "impact_force_relative_error": 0.0123}
    assert "The peak forces of its impacts are off by up to 1.2 %." in said(
        **impacts, impact_force_error_N=3.0
    )
    doubted = said(**impacts, impact_force_error_N=3.0, impact_force_uncertainty_N=5.0)
    known = "less than the 5 N to which the truth is known"
    assert f"The peak forces of its impacts are off by {known}." in doubted
    table = standings_table(standings(**impacts))
    assert table.head[-1] == "peak force error [%]"
    assert [row[-1] for row in table.rows] == ["1.2e+00", "–"]


def test_forces_that_are_not_judged_are_told_with_why() -> None:
    reasons = "joint_A_force_N: zero; joint_B_force_N: 93 % of its peak is seen"
    absent = {"joint_A_force_error_N": None, "joint_B_force_error_N": None}
    none = said(**absent, not_judged=reasons)
    assert "Joint forces are not judged: joint A, zero; joint B, 93 % of its peak is seen." in none
    assert not [text for text in none if "forces are off" in text]
    one = said(joint_A_force_error_N=None, not_judged="contact_B_normal_force_N: zero; joint_A_force_N: zero")
    assert "Its joint forces are off by up to 0.5 N at the samples compared." in one
    assert "Some joint forces are not judged: joint A, zero." in one
    assert standings_table(standings(**absent)).rows[0][-1] == "–"


def test_a_signal_asked_for_that_is_not_judged_is_told_in_place_of_a_recommendation() -> None:
    unjudged = {"slider_position_error_m": math.nan, "not_judged": "slider_position_m: zero"}
    first, *_ = sentences(Standings.of(standings().rows.assign(**unjudged)), "mine.toml")
    assert first == "Nothing can be recommended: its slider position is not judged: zero."


def test_impacts_that_are_all_found_are_told_with_their_time() -> None:
    found = said(impacts_matched=7, impacts_missed=0, impacts_unmatched=0, impact_time_error_s=4e-6)
    assert "It finds every impact, 7 of them, at times that are off by 4.0×10⁻⁶ s at most." in found


def test_every_command_of_the_answer_typed_asks_for_the_rung_it_is_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All rungs of all engines are as good here, so that each may be recommended."""
    rungs = [case for case in cases(full=False) if "compiled_anew" not in case.columns]
    recorded: dict[str, Any] = {"slider_position_error_m": 1e-9}
    timed: dict[str, Any] = {"solve_time_s": 1e-3, "build_time_s": 1e-3}
    rows = [
        {
            **row(n, case.scene.name, case.engine, case.arm.name, 0.0),
            **case.head(),
            **(timed if case.timed else recorded),
        }
        for n, case in enumerate(rungs)
    ]
    asked = set()

    def hear(scene: Any, name: str, engine: Any, options: Any) -> NoReturn:
        asked.add((scene.name, scene.end_time_s, name, engine, options.step))
        raise Failed("heard")

    monkeypatch.setattr(simulation, "simulated", hear)
    for race in races(Results(tmp_path, frame(rows), None)):
        for pick in race.within:
            done = crankslider(*split(pick.command)[1:])
            assert done.stderr == "error: heard\n", pick.command
    heads = [(case, case.head()["step_s"]) for case in rungs if not case.timed]
    assert asked == {
        (
            case.scene.name,
            case.scene.end_time_s,
            case.engine,
            make_engine(case.engine, **case.settings),
            float(f"{step:.6g}"),
        )
        for case, step in heads
    }
