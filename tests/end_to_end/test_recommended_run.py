"""What is said of the run that is recommended, on rows with round numbers, and what its command asks for."""

import math
from shlex import quote, split
from typing import Any, NoReturn

import pandas as pd
import pytest

from crankslider import library
from engine_models.engines import make_engine
from reports.comparison.sentences import sentences
from reports.comparison.standing import Standings, standings_table
from reports.results import frame
from reports.run.command import command
from studies.accuracy import cases
from studies.failures import Failed
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
        for n, part in enumerate((1.1, 1.0, 1.2)):
            timed = {"timed": True, "round": n, "solve_time_s": part * time_s, "build_time_s": 0.04}
            rows.append(row(len(rows), "mine", engine, "arm", 0.01, **{**common, **timed}))
    return Standings.of(frame(rows))


def said(**of_reference: Any) -> tuple[str, ...]:
    """Return the sentences on these."""
    return tuple(sentences(standings(**of_reference), "mine.toml --with end_time_s=0.5"))


def test_every_engine_has_its_numbers_in_the_table_under_their_heads() -> None:
    table = standings_table(standings())
    assert table.cells().to_dict("records") == [
        {
            "configuration": label,
            "setting": "step 0.01 s",
            "time [ms]": time,
            "ratio": ratio,
            "error [m]": error,
            "joint force error [N]": "5.0e-01",
        }
        for label, time, ratio, error in (
            ("reference (arm)", "3", "–", "2.0e-07"),
            ("exudyn (arm)", "9", "3", "4.0e-07"),
        )
    ]


def test_every_sentence_has_its_numbers() -> None:
    impacts = {"impacts_matched": 7, "impacts_missed": 2, "impacts_unmatched": 3, "impact_time_error_s": 4e-6}
    peaks = {"impact_force_relative_error": 1.0}
    assert said(**impacts, **peaks) == (
        "Use reference (arm) at step 0.01 s.",
        "Command: crankslider simulate mine.toml --with end_time_s=0.5 --engine reference --step 0.01",
        "Slider position error: 200 nm; asked for: 1 µm.",
        "Time of the solve: 3 ms; building the model and reading out take 40 ms more.",
        "Next best engine: exudyn (arm) at step 0.01 s, 3x slower at equal error.",
        # Two of nine are missed, and three more are none of the reference solution's.
        "Other errors: joint force 500 mN pointwise through the impacts; 7 of 9 impacts found, 3 more are "
        "not in the reference solution; peak force of the impacts 100 % (a missed one counts as 100 %); "
        "unaccounted energy 2.0×10⁻⁴ of that in play.",
        # Exudyn's is the shortest comparison.
        "Predictability horizon: 0.45 s of 0.5 s. Errors are compared up to there; beyond it only statistics "
        "are meaningful.",
    )


def test_peak_forces_are_in_percent_and_bounded_by_the_reference_solutions_uncertainty() -> None:
    impacts: dict[str, Any] = {"impacts_matched": 7, "impacts_missed": 0, "impacts_unmatched": 0}
    impacts |= {"impact_time_error_s": 4e-6, "impact_force_relative_error": 0.0123}
    assert "; peak force of the impacts 1.2 %; " in " ".join(said(**impacts))
    doubted = " ".join(said(**impacts, impact_force_relative_uncertainty=0.05))
    assert "; peak force of the impacts below 5 %, the reference solution's uncertainty; " in doubted
    table = standings_table(standings(**impacts))
    assert list(table.cells()["peak force error [%]"]) == ["1.2e+00", "–"]


def test_forces_that_are_not_compared_are_named_with_why() -> None:
    reasons = "joint_A_force_N: zero; joint_B_force_N: 93 % of its peak is seen"
    absent = {"joint_A_force_error_N": None, "joint_B_force_error_N": None}
    none = " ".join(said(**absent, not_judged=reasons))
    assert "joint A force not compared (zero); joint B force not compared (93 % of its peak is seen)." in none
    assert "joint force" not in none
    one = " ".join(
        said(joint_A_force_error_N=None, not_judged="contact_B_normal_force_N: zero; joint_A_force_N: zero")
    )
    assert "Other errors: joint force 500 mN; " in one
    assert "joint A force not compared (zero)." in one
    assert "contact" not in one
    assert standings_table(standings(**absent)).cells().iloc[0, -1] == "–"


def test_a_signal_asked_for_that_is_not_compared_is_named_in_place_of_a_recommendation() -> None:
    unjudged = {"slider_position_error_m": math.nan, "not_judged": "slider_position_m: zero"}
    first, *_ = sentences(Standings.of(standings().rows.assign(**unjudged)), "mine.toml")
    assert first == "No recommendation: slider position is not compared (zero)."


def test_the_command_of_every_setting_typed_asks_for_that_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = [case for case in cases(full=False) if "view" not in case.columns]
    asked = set()

    def hear(scene: Any, name: str, *, step: str, settings: Any, **_: Any) -> NoReturn:
        asked.add((scene.name, scene.end_time_s, name, library.read_engine(name, settings), float(step)))
        raise Failed("heard")

    monkeypatch.setattr(library, "simulate", hear)
    for case in ran:
        given = f"{quote(case.scene.name)} --end {case.scene.end_time_s:.6g}"
        typed = command(pd.Series(case.head()), given)
        assert crankslider(*split(typed)[1:]).stderr == "error: heard\n", typed
    assert asked == {
        (
            case.scene.name,
            case.scene.end_time_s,
            case.engine,
            make_engine(case.engine, **case.settings),
            float(f"{case.head()['step_s']:.6g}"),
        )
        for case in ran
    }
