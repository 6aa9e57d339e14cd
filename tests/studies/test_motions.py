"""The study of motions: its curves against closed forms, and against the law's own mechanics."""

import math

import numpy as np
import pytest

from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies import motions
from studies.running.case import Case, Curves, Row
from studies.running.outcome import run_case

#: Curves are kept in single precision, whose unit in the last place is 6e-8 of a value.
SINGLE = 1.2e-7
#: Converged by an independent solver to the digits given: the first touch of set R in s, its peak in N.
TOUCH_S, PEAK_N = 0.000227285, 45870.0
#: Hertz's stiffness of steel on steel, 10 mm in 9.5 mm, in N/m^1.5, to the digits given.
HERTZ = 6.610e10


def case(view: str, engine: str, scene: str) -> Case:
    """Return the full set's case of a view."""
    found = [c for c in motions.cases(full=True) if c.columns["view"] == view and c.engine == engine]
    return next(c for c in found if c.scene.name == scene)


@pytest.fixture(scope="module")
def driven() -> tuple[Row, Curves]:
    return run_case(case("revolution", "exudyn", "ideal-driven"))


def crank_rad(time_s: np.ndarray) -> np.ndarray:
    return np.asarray(SCENES["ideal-driven"]().start.crank_speed_rad_s * time_s)


def test_the_truth_beside_a_driven_run_is_the_closed_form(driven: tuple[Row, Curves]) -> None:
    _, curves = driven
    theta = crank_rad(np.linspace(0, motions.TURN_S, motions.SAMPLES + 1))
    r, length = 0.05, 0.12
    x = r * np.cos(theta) + np.sqrt(length**2 - (r * np.sin(theta)) ** 2)
    assert np.abs(curves["true_slider_position_m"] - x).max() < SINGLE * (r + length)
    assert curves["true_joint_B_force_N"][0] == pytest.approx(2718.71, abs=0.01)
    weight = 0.3 * 9.81 * 0.025 * np.cos(theta)  # of the crank, which the known peak is without
    assert (curves["true_driver_torque_N_m"] - weight).max() == pytest.approx(138.56, abs=0.01)


def test_the_largest_error_in_the_row_is_that_of_the_curves(driven: tuple[Row, Curves]) -> None:
    row, curves = driven
    off = np.abs(curves["slider_velocity_m_s"] - curves["true_slider_velocity_m_s"]).max()
    size = np.abs(curves["slider_velocity_m_s"]).max()
    assert row["slider_velocity_error_m_s"] == pytest.approx(off, abs=SINGLE * size)
    assert row["slider_velocity_error_m_s"] == pytest.approx(
        curves["slider_velocity_error_m_s"].max(), rel=SINGLE
    )


def test_an_ideal_mechanism_is_where_ideal_joints_have_it(driven: tuple[Row, Curves]) -> None:
    row, curves = driven
    # The run's own slider, at its own crank angle: only what its joints are open by.
    assert isinstance(row["constraint_violation_m"], float)
    assert np.abs(curves["slider_deviation_m"]).max() <= 4 * row["constraint_violation_m"] + 1e-15


def test_one_impact_touches_when_and_presses_as_hard_as_the_converged_one() -> None:
    _, curves = run_case(case("impact", "scipy", "clearance-driven-0.5mm-first-impact"))
    time, depth = curves["time_s"], curves["contact_B_penetration_m"]
    after = int(np.argmax(depth >= 0))
    assert time[after - 1] < TOUCH_S * (1 + 1e-6)
    assert time[after] > TOUCH_S * (1 - 1e-6)
    # A sample lies within 0.25 us of the peak of a contact of 52 us: within 0.01 % of it.
    assert curves["contact_B_normal_force_N"].max() == pytest.approx(PEAK_N, rel=2e-4)
    assert curves["true_contact_B_normal_force_N"].max() == pytest.approx(PEAK_N, rel=2e-4)


@pytest.mark.parametrize("law", ["hertz", "flores"])
def test_the_area_of_a_laws_loop_is_the_energy_that_the_ledger_has_lost(law: str) -> None:
    row, curves = run_case(case("law", "reference", f"clearance-driven-0.5mm-{law}"))
    depth, force = curves["contact_B_penetration_m"], curves["contact_B_normal_force_N"]
    inside = depth >= 0
    area = np.trapezoid(force[inside], depth[inside])
    deepest = float(depth.max())
    stored = HERTZ * deepest**2.5 / 2.5
    assert isinstance(row["dissipated_energy_J"], float)
    # A loop of 100 samples, both ends cut by less than one: a hundredth of what is stored at most.
    assert area == pytest.approx(row["dissipated_energy_J"], abs=0.01 * stored)
    if law == "hertz":
        away = HERTZ * np.maximum(depth, 0) ** 1.5 - force
        assert np.abs(away).max() < 1e-3 * force.max()  # the stiffness has four digits
    else:
        assert area > 0.5 * stored  # at restitution 0.5 more than half of it is lost


def test_every_scene_of_the_library_has_a_whole_run_with_its_own_definition() -> None:
    whole = [c for c in motions.cases(full=True) if c.columns["view"] == "whole"]
    assert [c.scene.name for c in whole] == list(SCENES)
    one = next(c for c in whole if c.scene.name == "clearance-pendulum")
    row, curves = run_case(one)
    assert Scene.model_validate_json(str(row["scene_json"])) == SCENES["clearance-pendulum"]()
    assert row["contacts_ended"] > 1  # type: ignore[operator]
    gap = np.hypot(curves["clearance_O_x_m"], curves["clearance_O_y_m"])
    assert np.abs(gap - curves["contact_O_penetration_m"] - 5e-4).max() < 4 * SINGLE * 5e-4


def test_a_refusal_is_a_row_with_its_reason_and_who_says_it() -> None:
    row, curves = run_case(case("revolution", "exudyn", "rigid-driven-0.5mm"))
    assert row["status"] == "unsupported"
    assert row["reason"]
    assert row["exception"] == "UnsupportedScene"
    assert not curves


def test_no_scene_is_followed_past_a_revolution() -> None:
    for of in motions.cases(full=True):
        if of.columns["view"] == "revolution" and of.scene.speed_is_prescribed:
            assert of.scene.end_time_s * of.plain_scene.start.crank_speed_rad_s <= 2 * math.pi * (1 + 1e-12)
