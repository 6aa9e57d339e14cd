"""Every study's rows tell what the check found; a run that it fails keeps its row, and the page says so."""

import pytest

from engine_models import arms
from engine_models.scene.scene import Scene
from reports.results import frame
from reports.shared_tables import reliability, runs_tables
from studies.case import Case, load_study, run_case
from studies.registry import STUDIES

COLUMNS = ("unaccounted_energy_part", "ideal_gap_part", "penetration_part")


def of_pymunk(study: str) -> list[Case]:
    """Return a study's runs of Pymunk: they are cheap, and nothing is compiled for them."""
    for full in (False, True):
        cases = load_study(study).cases(full)
        if found := [case for case in cases if case.engine == "pymunk" and not case.timed]:
            return found
    return []


@pytest.mark.parametrize("study", STUDIES)
def test_a_row_of_any_study_has_the_columns_of_the_check(study: str) -> None:
    ran = ((case.scene, run_case(case)[0]) for case in reversed(of_pymunk(study)))
    scene, row = next((scene, row) for scene, row in ran if row["status"] == "ok")
    assert [isinstance(row.get(column), float) for column in COLUMNS] == [
        True,
        isinstance(scene, Scene) and scene.is_crank_slider,
        bool(scene.joints_with_clearance),
    ]
    assert isinstance(row["quality_failure"], str)


def test_a_run_that_the_check_fails_keeps_its_row_and_is_on_the_page() -> None:
    """Pymunk out of the box at 2.5 ms, at which it loses a fifth of its energy even if tuned."""
    cases = load_study("agreement").cases(full=True)
    bad, _ = run_case(next(case for case in cases if case.arm == arms.OUT_OF_THE_BOX))
    assert bad["status"] == "ok"
    assert isinstance(bad["slider_position_error_m"], float)
    part, failure = bad["unaccounted_energy_part"], str(bad["quality_failure"])
    assert isinstance(part, float)
    assert part > 0.1
    assert failure.startswith(f"energy off by {100 * part:.3g} % of that in play, past 10 % at t = ")
    good = bad | {"label": "good", "quality_failure": ""}
    rows = frame([{**row, "case": str(k)} for k, row in enumerate((good, bad))])
    assert "1 of those that finished fail the check" in reliability(rows)
    (table,) = (each for each in runs_tables(rows, "agreement") if each.name == "agreement-quality")
    assert [row[-1] for row in table.rows] == [failure]
    of_good = frame([{**good, "case": "0"}])
    for sound in (of_good, of_good.drop(columns="quality_failure")):  # rows from before there was a check
        assert [each.name for each in runs_tables(sound, "agreement")] == []
