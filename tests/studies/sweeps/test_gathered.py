"""What a row says of a member, recomputed from its run by formulas of this file."""

import math
from typing import Any

import numpy as np
import pytest

import crankslider as cs
from engine_models.reference.watch import Watch
from studies.predictability.sweeps.gathered import row_of
from studies.predictability.sweeps.task import Task

SCENE = cs.scenes["clearance-driven-0.5mm"]
SETTINGS: dict[str, object] = {"method": "dop853", "step_tolerance": 1e-11}
TRANSIENT, TURNS = 1, 2
PERIOD_S = 2 * math.pi / SCENE.start.crank_speed_rad_s
#: Both come from one run of the same samples: nothing but rounding lies between them.
ROUND_OFF = 1e-12
#: The part of a touch's interval between two samples, by a straight line, is off by less than this in rad.
BETWEEN_SAMPLES_RAD = 2e-3


@pytest.fixture(scope="module")
def row() -> dict[str, Any]:
    return row_of(Task(SCENE, "reference", SETTINGS, None, Watch(TRANSIENT, TURNS)), {})


@pytest.fixture(scope="module")
def run() -> cs.Run:
    end = (TRANSIENT + TURNS) * PERIOD_S
    return cs.simulate(SCENE, end=end, samples=3000, settings=SETTINGS, step=end)


@pytest.fixture(scope="module")
def deviation_m(run: cs.Run) -> np.ndarray:
    """Return the slider's distance from where a closed form puts it at the crank's angle, (n,)."""
    assert SCENE.rod is not None
    r, length, angle = SCENE.crank.length_m, SCENE.rod.length_m, run.frame["crank_angle_rad"].to_numpy()
    ideal = r * np.cos(angle) + np.sqrt(length**2 - (r * np.sin(angle)) ** 2)
    return np.asarray(run.frame["slider_position_m"].to_numpy() - ideal)


def test_the_strobe_is_the_sliders_deviation_at_the_end_of_each_turn(
    row: dict[str, Any], deviation_m: np.ndarray
) -> None:
    np.testing.assert_allclose(row["strobe_m"], deviation_m[[2000, 3000]], rtol=1e-9, atol=ROUND_OFF)
    assert row["slider_deviation_m"] == pytest.approx(np.abs(deviation_m[1000:]).max(), abs=ROUND_OFF)


def test_impacts_are_those_that_touch_after_the_transient(row: dict[str, Any], run: cs.Run) -> None:
    late = run.impacts[run.impacts["time_s"] >= TRANSIENT * PERIOD_S]
    touching = bool(run.frame["contact_B_penetration_m"].iloc[-1] >= 0)
    assert row["impacts_per_revolution"] == (len(late) + touching) / TURNS
    assert row["impulse_N_s"] == pytest.approx(late["normal_impulse_N_s"].mean(), rel=ROUND_OFF)
    phases = SCENE.start.crank_angle_rad + SCENE.start.crank_speed_rad_s * late["time_s"]
    found = np.array(row["impact_phase_rad"])[: len(late)]
    np.testing.assert_allclose(found, phases % (2 * math.pi), atol=BETWEEN_SAMPLES_RAD)


def test_losses_forces_and_flight_are_those_after_the_transient(row: dict[str, Any], run: cs.Run) -> None:
    lost, after = run.frame["dissipated_energy_J"], run.frame.iloc[1000:]
    per_turn = (lost.iloc[-1] - lost.iloc[1000]) / TURNS
    assert row["dissipated_energy_per_revolution_J"] == pytest.approx(per_turn, rel=ROUND_OFF)
    assert row["largest_contact_force_N"] == pytest.approx(after["contact_B_normal_force_N"].max())
    assert row["flight_part"] == pytest.approx((after["contact_B_penetration_m"] < 0).mean())


def test_a_pin_that_stays_at_the_wall_never_touches_and_comes_back_every_turn() -> None:
    task = Task(SCENE, "reference", SETTINGS, None, Watch(6, 2))
    row = row_of(task, {"clearance.B.radial_clearance_m": 1e-5})
    assert row["impacts_per_revolution"] == row["flight_part"] == 0
    assert row["impact_phase_rad"] == []
    first, second = np.array(row["strobe_m"])
    assert first == pytest.approx(second, rel=1e-6)  # what is left of the start after six turns


def test_a_member_that_is_no_scene_is_a_row_with_the_reason() -> None:
    row = row_of(Task(SCENE, "reference", SETTINGS, None, Watch()), {"clearance.B.radial_clearance_m": 0.5})
    assert row["status"] == "failed"
    assert row["reason"] == (
        "clearance.B.radial_clearance_m: expected a number < bearing_radius_m = 0.01, got 0.5"
    )
