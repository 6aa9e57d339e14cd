"""Horizons and ensembles: the literature's horizons, draws, and members in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from engine_models.scene.scene import Scene
from studies import predictability as study
from studies.case import Case
from studies.judges.horizon import Apart, apart, first_beyond_s

SET_R, TIGHT = "clearance-driven-0.5mm", "clearance-driven-0.02mm"
REVOLUTION_S = 0.012


def following(name: str, revolutions: float) -> Scene:
    return study.SCENES[name]().model_copy(update={"end_time_s": revolutions * REVOLUTION_S})


def of_part(part: str, full: bool = True) -> list[Case]:
    return [case for case in study.cases(full) if case.columns["part"] == part]


# The horizon


def visible_after(name: str, size_m: float, tolerance_m: float, revolutions: int) -> float:
    """After how many revolutions a start moved by some m at the crank pin shows in the slider."""
    scene = following(name, revolutions)
    size = size_m / scene.short.crank.length_m / 1e-10
    parted = apart(scene, 100 * revolutions, (-size, size), fine_step_s=1e-5)
    return min(first_beyond_s(parted.time_s, run, tolerance_m) for run in parted.perturbed_m) / REVOLUTION_S


def test_in_set_R_a_change_of_1e_10_m_is_visible_after_two_revolutions() -> None:
    after = visible_after(SET_R, 1e-10, 1e-6, 4)
    assert 1.5 < after < 3, f"{after} revolutions"


def test_with_a_restitution_of_a_half_it_takes_seven_to_eight_revolutions() -> None:
    after = visible_after("clearance-driven-lossy", 1e-11, 1e-4, 9)
    assert 6.5 < after < 8.5, f"{after} revolutions"


def test_a_row_has_median_least_and_largest_of_the_perturbed_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """They reach 1 nm after 1, 2 and 3 s, 1 um after 2, 3 and never, the halved one 1 nm alone, after 3."""
    time, nm, um = np.arange(4.0), 2e-9, 2e-6
    perturbed = [[0, nm, um, um], [0, 0, nm, um], [0, 0, 0, nm]]
    parted = Apart(time, np.array(perturbed), np.array([0, 0, 0, nm]))
    monkeypatch.setattr("studies.judges.horizon.apart", lambda *_, **__: parted)
    row, curves = study.measure(of_part(study.HORIZON)[0])
    assert {name: row[name] for name in row if name.startswith("horizon_")} == {
        "horizon_1nm_s": 2.0,
        "horizon_1nm_least_s": 1.0,
        "horizon_1nm_largest_s": 3.0,
        "horizon_halved_1nm_s": 3.0,
        "horizon_1um_s": 3.0,
        "horizon_1um_least_s": 2.0,
    }
    assert (row["perturbations"], row["largest_distance_perturbed_m"]) == (3, um)
    assert row["revolutions"] == pytest.approx(5.0)
    assert curves["perturbed_2_m"].tolist() == [0, 0, 0, nm]


# Members


def test_a_member_in_continuous_contact_has_no_impacts_and_a_deviation_of_one_clearance() -> None:
    known = of_part("reference (DOP853)")[0]
    row, _ = study.measure(replace(known, scene=following(TIGHT, 12)))
    assert row["flight_part"] == row["impacts_per_revolution"] == 0
    assert not {"impact_speed_m_s", "impact_phase_cosine"} & row.keys()
    deviation = row["rms_slider_deviation_m"]
    assert isinstance(deviation, float)
    assert 0.5 * 2e-5 < deviation < 1.2 * 2e-5  # penetration is a tenth of this clearance
