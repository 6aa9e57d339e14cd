"""Sweeps: which members there are, that each is what ``simulate`` makes of its scene, and how they resume."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest

import crankslider as cs
from engine_models.scene.scene import Scene
from studies.running.store import Store
from studies.sweep import draw_values
from tests.helpers.ideal_crank_slider import configuration
from tests.helpers.running import Here

NAME, CLEARANCE = "clearance-driven-0.5mm", "clearance.B.radial_clearance_m"
SPEED, ANGLE = "start.crank_speed_rad_s", "start.crank_angle_rad"
SCENE: Any = cs.scenes[NAME]
#: One that does not start at an angle of zero.
TURNED = SCENE.replace(ANGLE, 0.4)
PERIOD_S = 2 * math.pi / SCENE.short.start.crank_speed_rad_s
#: A logarithm and its inverse are each right to some units in the last place.
ROUND_OFF = 1e-14


# Members


def test_a_grid_has_every_value_of_one_field_with_every_one_of_the_other_and_the_last_goes_fastest() -> None:
    grid = draw_values(SCENE, {CLEARANCE: "10 um:1 mm:log:3", SPEED: "100:300:3"})
    np.testing.assert_allclose(grid[CLEARANCE], np.repeat([1e-5, 1e-4, 1e-3], 3), rtol=ROUND_OFF)
    assert grid[SPEED].tolist() == [100.0, 200.0, 300.0] * 3


def test_a_jitter_moves_each_start_of_the_grid_around_the_scenes_own_angle() -> None:
    turned = SCENE.replace(ANGLE, 0.7)
    one, other = (draw_values(turned, {CLEARANCE: [1e-5, 1e-4]}, "grid", 50, 1e-6, seed) for seed in (0, 1))
    moves = one[ANGLE] - 0.7
    assert len(set(moves)) == 100
    assert 0.9e-6 < np.abs(moves).max() <= 1e-6
    assert one[CLEARANCE].tolist() == [1e-5] * 50 + [1e-4] * 50
    assert (one[ANGLE] != other[ANGLE]).all()


# Rows


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run members in this process."""
    monkeypatch.setattr("crankslider.library._workers", lambda *_: Here())


def simulated(scene: Scene) -> cs.Run:
    chosen = {"method": "dop853", "step_tolerance": 1e-6}  # as members have it by default
    return cs.simulate(scene, end=3 * PERIOD_S, samples=300, settings=chosen, quick=True)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    out = tmp_path_factory.mktemp("sweep") / "rows.parquet"
    with mock.patch("crankslider.library._workers", return_value=Here()):
        return cs.sweep(TURNED, {CLEARANCE: [2e-4, 4e-4, 1e-3]}, transient=1, out=out, jobs=1).frame


def test_a_member_has_the_numbers_and_the_warnings_of_its_own_simulation(swept: pd.DataFrame) -> None:
    assert (swept["status"] == "ok").all()
    for _, row in swept.iterrows():
        run = simulated(TURNED.replace(CLEARANCE, row[CLEARANCE]))
        impacts, late = run.impacts, run.frame.iloc[100:]
        from_s = late.index[0]
        assert row["warnings"] == "; ".join(run.warnings)
        assert row["largest_contact_force_N"] == max(
            impacts["largest_normal_force_N"][impacts["largest_normal_force_time_s"] >= from_s].max(),
            late["contact_B_normal_force_N"].max(),
        )
        ended = impacts[impacts["time_s"] >= from_s]
        touching = bool(late["contact_B_penetration_m"].iloc[-1] >= 0)
        assert row["impacts_per_revolution"] == (len(ended) + touching) / 2
        assert row["impulse_N_s"] == ended["normal_impulse_N_s"].mean()
        assert row["flight_part"] == (late["contact_B_penetration_m"] < 0).mean()
        lost = late["dissipated_energy_J"]
        assert row["dissipated_energy_per_revolution_J"] == (lost.iloc[-1] - lost.iloc[0]) / 2
        assert row["penetration_part"] == run.quality.parts()["penetration_part"]
        before = [late.index[late["contact_B_penetration_m"] < 0][-1], *ended["time_s"] + ended["duration_s"]]
        lasting = [max(before)] * touching  # within a sample of its touch
        touch_s = np.append(ended["time_s"], lasting)
        phase = TURNED.short.start.crank_angle_rad + SCENE.short.start.crank_speed_rad_s * touch_s
        a_sample = 2 * math.pi / 100 / len(phase) if touching else 1e-9
        assert row["impact_phase_cosine"] == pytest.approx(np.cos(phase).mean(), abs=a_sample)


def test_the_deviation_is_that_from_the_closed_form_of_ideal_joints(swept: pd.DataFrame) -> None:
    late = simulated(TURNED.replace(CLEARANCE, 1e-3)).frame.iloc[100:]
    ideal, *_ = configuration(TURNED, late["crank_angle_rad"].to_numpy())
    deviation = late["slider_position_m"].to_numpy() - ideal[:, -1, 0]
    assert swept["slider_deviation_m"][2] == pytest.approx(np.abs(deviation).max(), abs=1e-12)
    assert swept["rms_slider_deviation_m"][2] == pytest.approx(np.sqrt(np.mean(deviation**2)), abs=1e-12)


@pytest.mark.usefixtures("here")
def test_members_with_warnings_are_counted(tmp_path: Path) -> None:
    vary, said = {"crank.length_m": [0.05, 0.04]}, r"^[12] of 2 members have .*: member 0: energy off by"
    options: Any = {"settings": {"iterations": 10}, "out": tmp_path / "rows.csv", "jobs": 1}
    with pytest.warns(UserWarning, match=said):
        cs.sweep("ideal-free", vary, "pymunk", revolutions=60, step=2e-3, **options)


@pytest.mark.usefixtures("here")
def test_an_ideal_scene_in_another_engine_has_its_forces(tmp_path: Path) -> None:
    vary, out = {"crank.length_m": [0.02, 0.03]}, tmp_path / "rows.csv"
    swept = cs.sweep("ideal-driven", vary, "pymunk", revolutions=1, step=1e-4, out=out, jobs=1)
    scene = cs.scenes["ideal-driven"].replace("crank.length_m", 0.03)
    run = cs.simulate(scene, "pymunk", end=PERIOD_S, samples=200, step=1e-4)
    force = np.hypot(run.frame["joint_B_force_x_N"], run.frame["joint_B_force_y_N"])
    assert swept.frame["largest_joint_B_force_N"][1] == force.max()
    assert swept.frame["largest_driver_torque_N_m"][1] == run.frame["driver_torque_N_m"].abs().max()
    assert "flight_part" not in swept.frame
    read = pd.read_csv(out, keep_default_na=False)  # whose last digit old pandas rounds
    pd.testing.assert_frame_equal(read, swept.frame, rtol=1e-12, check_dtype=False)
    assert swept.plot().axes[0].get_ylabel() == "largest joint O force [N]"


# Runs


def sweep(out: Path, values: list[float]) -> pd.DataFrame:
    return cs.sweep(NAME, {CLEARANCE: values}, "pymunk", revolutions=0.02, out=out, jobs=1).frame


@pytest.mark.usefixtures("here")
def test_what_was_finished_before_an_interrupt_is_not_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, keep, values = list[str](), Store.keep, np.geomspace(1e-5, 1e-3, 5).tolist()

    def noted(store: Store, key: str, *row: Any) -> None:
        if len(kept) == 3:
            kept.clear()
            raise KeyboardInterrupt
        keep(store, key, *row)
        kept.append(key)

    monkeypatch.setattr(Store, "keep", noted)
    with pytest.raises(KeyboardInterrupt):
        sweep(tmp_path / "rows.csv", values)
    assert not (tmp_path / "rows.csv").exists()
    found = sweep(tmp_path / "rows.csv", values)
    assert len(kept) == 2
    monkeypatch.undo()
    pd.testing.assert_frame_equal(found, sweep(tmp_path / "whole.csv", values), check_exact=True)
    others = sweep(tmp_path / "rows.csv", [2e-3, values[1]])  # of which one is there
    assert others[CLEARANCE].tolist() == [2e-3, values[1]]
    assert others["flight_part"][1] == found["flight_part"][1]


@pytest.mark.usefixtures("here")
def test_a_member_that_is_no_scene_is_a_row_with_the_reason(tmp_path: Path) -> None:
    vary = {"clearance.B.bearing_radius_m": [1e-2, 1e-3], CLEARANCE: [1e-4, 5e-3]}
    swept = cs.sweep(NAME, vary, "pymunk", revolutions=0.02, out=tmp_path / "a.parquet", jobs=1).frame
    assert swept["status"].tolist() == ["ok", "ok", "ok", "failed"]
    assert swept["reason"][3] == f"{CLEARANCE}: expected a number < bearing_radius_m = 0.001, got 0.005"
    assert swept["flight_part"].notna().tolist() == [True, True, True, False]


@pytest.mark.system
def test_a_script_needs_no_main_guard(tmp_path: Path) -> None:
    """No process imports it."""
    script = tmp_path / "script.py"
    sweep = f'cs.sweep("{NAME}", {{"{SPEED}": [300, 400]}}, "pymunk", revolutions=0.02, jobs=2)'
    script.write_text(f"import crankslider as cs\nprint(len({sweep}.frame))\n")
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "2\n"), done.stderr
