"""What a comparison says of the run it recommends, on rows with round numbers."""

from typing import Any

from reports.chapters.comparison.recommendation import sentences
from reports.chapters.comparison.sections import standings_table
from reports.chapters.comparison.standing import Standings
from reports.results import frame
from tests.end_to_end.written_rows import row

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
    return tuple(sentences(standings(**of_reference)))


def test_every_engine_has_its_numbers_in_the_table_under_their_heads() -> None:
    table = standings_table(standings())
    assert table.head == ("engine and arm", "setting", "time [ms]", "ratio", "error [m]", "force error [N]")
    assert table.rows == (
        ("reference (arm)", "step 1.0e-02 s", "3", "–", "2.0e-07", "5.0e-01"),
        ("exudyn (arm)", "step 1.0e-02 s", "9", "3 (3 to 3)", "4.0e-07", "5.0e-01"),
    )


def test_every_sentence_has_its_numbers() -> None:
    assert said(impacts_matched=7, impacts_missed=2, impacts_unmatched=3, impact_time_error_s=4e-6) == (
        "Take reference (arm) at a step of 0.01 s.",
        "Its slider position error is 2.0×10⁻⁷ m at most; 1.0×10⁻⁶ m is what is asked for.",
        "Its solve takes 3 ms; building the model and reading out take 40 ms more.",
        "Without reference, take exudyn (arm) at a step of 0.01 s: it takes 3 times as long at equal error.",
        "Its joint forces are off by up to 0.5 N at the samples compared.",
        # Two of nine are missed, and three are none.
        "It has 7 of 9 impacts, bounces that die away included.",
        "3 of its impacts are none of the truth's.",
        "No physics accounts for 2.0×10⁻⁴ of the energy in play.",
        # Exudyn's is the shortest comparison.
        "No run is to be trusted moment by moment past 0.45 s of 0.5 s: starts moved by a hair part "
        "there, so errors "
        "are those before, and only averages mean something after.",
    )


def test_impacts_that_are_all_found_are_told_with_their_time() -> None:
    found = said(impacts_matched=7, impacts_missed=0, impacts_unmatched=0, impact_time_error_s=4e-6)
    assert "It finds every impact, 7 of them, at times that are off by 4.0×10⁻⁶ s at most." in found
