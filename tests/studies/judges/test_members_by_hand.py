"""What is told of a member, a horizon, an exponent and a column, worked out on round numbers."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from engine_models.engine import Contact, Impacts, RunSettings, Trajectory
from engine_models.reference.watch import Watch
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.judges import horizon, lyapunov
from studies.predictability import cases, diagrams, ensemble, study
from studies.predictability.sweeps.gathered import gathered
from studies.running.case import Case

#: A crank that turns in 20 ms from an angle of 0.3 rad on; four turns with two samples in each.
SPEED_RAD_S, ANGLE_RAD, SAMPLES = 100 * math.pi, 0.3, 8
TIMES_S = [0.01 * k for k in range(SAMPLES + 1)]


def turning() -> Scene:
    scene = SCENES["clearance-driven-0.5mm"]()
    start = scene.start.model_copy(update={"crank_angle_rad": ANGLE_RAD, "crank_speed_rad_s": SPEED_RAD_S})
    return scene.model_copy(update={"start": start, "end_time_s": 0.08})


def member(scene: Scene) -> Trajectory:
    """In the last two turns: deviations of -3 to 2 µm, three touches, 4 N s, and 0.4 J lost.

    The third lasts at the end, and began half way between the last two samples.
    """
    crank, rod, _ = scene.crank_slider()
    angle = ANGLE_RAD + SPEED_RAD_S * np.array(TIMES_S)
    lift = crank.length_m * np.sin(angle)
    off = 1e-6 * np.array([90, 90, 90, 90, 1, -3, 0, 2, 1])
    position = np.zeros((SAMPLES + 1, 3, 3))
    position[:, 0, 2] = angle
    position[:, 2, 0] = crank.length_m * np.cos(angle) + np.sqrt(rod.length_m**2 - lift**2) + off
    depth = np.array([1, 1, 1, 1, -1, 1, 1, -1, 1]) * 1e-6
    sums = np.array([0, 1, 1, 2, 3, 3, 5, 6, 7], float)
    touches = np.array([0.015, 0.045, 0.062])
    speeds, impulses = np.array([5.0, 1.0, 2.0]), np.array([9.0, 1.0, 2.0])
    impacts = Impacts(touches, 0 * touches, speeds, impulses, touches, *[np.nan * touches] * 4)
    contact = Contact(
        np.zeros((9, 2)), depth, 0 * depth, None, 0 * depth, sums, sums / 10, None, None, impacts
    )
    return Trajectory(
        np.array(TIMES_S),
        position,
        0 * position,
        {joint: np.zeros((9, 2)) for joint in "OAB"},
        {"guide": np.zeros(9)},
        None,
        None,
        0.01,
        8,
        1.0,
        {"B": contact},
    )


def test_a_members_numbers_are_those_after_the_transient() -> None:
    row = gathered(Watch(2.0, 2.0), turning(), member(turning()))
    assert row.pop("impact_phase_rad") == pytest.approx(
        [0.3 + turns * math.pi for turns in (4.5 - 4, 6.2 - 6, 7.5 - 6)]
    )
    assert row.pop("strobe_m") == pytest.approx([0.0, 1e-6], abs=1e-12)
    assert row == pytest.approx(
        {
            "impacts_per_revolution": 1.5,
            "flight_part": 0.4,
            "impact_speed_m_s": 1.5,
            "impulse_N_s": 1.5,
            "impulse_per_revolution_N_s": 2.0,
            "largest_contact_force_N": 0.0,
            "dissipated_energy_per_revolution_J": 0.2,
            "slider_deviation_m": 3e-6,
            "rms_slider_deviation_m": 1e-6 * math.sqrt((1 + 9 + 0 + 4 + 1) / 5),
        }
    )


def test_an_ensembles_member_is_a_sweeps_row_with_the_mean_direction_of_its_impacts() -> None:
    known = next(case for case in study.cases(True) if case.columns["part"] == "exudyn (DOPRI5)")
    phases, row = [0.5, 1.5, 6.0], {"impacts_per_revolution": 1.5, "impulse_N_s": math.nan}
    told = {**row, "status": "ok", "reason": "", "strobe_m": [], "impact_phase_rad": phases}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ensemble, "_ran", lambda _: (told, {"quality_failure": ""}))
        found, curves = study.measure(known)
    assert curves["impact_phase_rad"].tolist() == phases
    assert found == pytest.approx(
        {
            "revolutions": 8.0,
            "quality_failure": "",
            "impacts_per_revolution": 1.5,
            "impact_phase_cosine": sum(map(math.cos, phases)) / 3,
            "impact_phase_sine": sum(map(math.sin, phases)) / 3,
        }
    )


def case_of(part: str, **columns: Any) -> Case:
    """Return a case of set R, whose turn takes 20 ms here."""
    known = next(each for each in cases.cases(full=False) if each.columns["part"] == part)
    scene = turning().model_copy(update={"end_time_s": 1.0})
    return replace(known, scene=scene, run=RunSettings(1e-4, 4), columns={**known.columns, **columns})


def test_a_horizon_has_its_median_and_its_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three twins are past a nanometre at 0.5, 0.25 and 1 s, past a micrometre one of them, at 1 s."""
    twins = np.array([[0, 0, 2e-9, 3e-9, 4e-9], [0, 2e-9, 5e-9, 5e-8, 6e-8], [0, 0, 0, 1e-9, 2e-6]])
    halved = np.array([0, 0, 1e-10, 2e-9, 2e-9])
    parted = horizon.Apart(np.array([0, 0.25, 0.5, 0.75, 1.0]), twins, halved)
    monkeypatch.setattr(horizon, "apart", lambda *_, **__: parted)
    row, _ = study.measure(case_of(cases.HORIZON))
    told = {name: value for name, value in row.items() if name.startswith("horizon_")}
    assert told == {
        "horizon_1nm_s": 0.5,
        "horizon_1nm_least_s": 0.25,
        "horizon_1nm_largest_s": 1.0,
        "horizon_halved_1nm_s": 0.75,
        "horizon_1um_least_s": 1.0,
    }
    assert (row["largest_distance_perturbed_m"], row["largest_distance_halved_m"]) == (2e-6, 2e-9)
    assert row["revolutions"] == pytest.approx(50.0)


def test_an_exponent_leaves_the_first_turn_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """5 in the first turn, then 2 a turn for 8, 1 for 8, and none for 16: in all of 32, 16 and 8 of them."""
    turns = np.arange(34.0)
    grown = np.concatenate([[0.0], np.cumsum([5.0, *[2.0] * 8, *[1.0] * 8, *[0.0] * 16])])
    growth = lyapunov.Growth(0.02 * turns, np.asarray(grown, dtype=float), settled=False)
    monkeypatch.setattr(lyapunov, "growth", lambda *_: growth)
    row, _ = study.measure(case_of(cases.EXPONENT))
    name = "lyapunov_exponent_per_revolution"
    # The end of a part is left out, and with it a turn.
    assert row[f"{name}_quarter"] == pytest.approx(2.0)
    assert row[f"{name}_half"] == pytest.approx(1.5, abs=0.05)
    assert row[name] == pytest.approx(0.75, abs=0.05)


def test_a_columns_exponent_is_found_from_all_revolutions_and_from_half(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def rows(_: Case, values: Any, revolutions: float, exponent: bool = False) -> pd.DataFrame:
        strobe = [[0.0] * int(revolutions)] * len(values)
        columns = {"strobe_m": strobe, "impacts_per_revolution": 1.0, "status": "ok"}
        columns["largest_contact_force_N"] = 1e3 + revolutions
        return pd.DataFrame({**columns, "exponent_1_s": revolutions if exponent else math.nan})

    monkeypatch.setattr(diagrams, "_rows", rows)
    case = case_of(diagrams.CLEARANCES, exponent_revolutions=24)
    _, curves = diagrams.measure(case)
    assert set(curves["exponent_1_s"]) == {24.0}
    assert set(curves["exponent_half_1_s"]) == {12.0}
    assert set(curves["largest_contact_force_N"]) == {1e3 + int(str(case.columns["revolutions"]))}
    values = curves["value"]
    assert values[1:] / values[:-1] == pytest.approx(100 ** (1 / 99)), "equal ratios, of 100 in all"
