"""Every study's rows tell what the check found; a run that it fails keeps its row."""

import pytest

from engine_models import arms
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


@pytest.mark.parametrize("study", [name for name in STUDIES if name != "cost"])
def test_a_row_of_any_study_has_the_columns_of_the_check(study: str) -> None:
    ran = ((case.scene, run_case(case)[0]) for case in reversed(of_pymunk(study)))
    scene, row = next((scene, row) for scene, row in ran if row["status"] == "ok")
    assert [isinstance(row.get(column), float) for column in COLUMNS] == [
        True,
        scene.is_crank_slider,
        bool(scene.joints_with_clearance),
    ]
    assert isinstance(row["quality_failure"], str)


def test_a_run_that_the_check_fails_keeps_its_row() -> None:
    """Pymunk out of the box at 5 ms, at which it loses a fifth of its energy even if tuned."""
    cases = [case for case in load_study("accuracy").cases(full=True) if case.arm == arms.OUT_OF_THE_BOX]
    bad, _ = run_case(max(cases, key=lambda case: case.run.step_s))
    assert bad["status"] == "ok"
    assert isinstance(bad["slider_position_error_m"], float)
    part, failure = bad["unaccounted_energy_part"], str(bad["quality_failure"])
    assert isinstance(part, float)
    assert part > 0.1
    assert failure.startswith(f"energy off by {100 * part:.3g} % of that in play, past 10 % at t = ")
