"""What ``simulate`` writes and says: its columns, by which method in which steps, and how exact it is."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from engine_models.engine import RunSettings
from engine_models.engines import ENGINES, make_engine
from engine_models.scene.library import IDEAL_SCENES, SCENES
from studies.judges.columns import sample_columns
from tests.helpers.command import crankslider, table_of
from tests.studies.truth.closed_forms.crank_slider import exact

SHORT = ("--end", 0.01, "--samples", 4)
MOTION = "time_s,crank_angle_rad,crank_speed_rad_s,slider_position_m,slider_velocity_m_s"
FORCES = (
    ",".join(f"joint_{joint}_force_{axis}_N" for joint in "OAB" for axis in "xy") + ",guide_normal_force_N"
)
LAST = (
    "slider_acceleration_m_s2,rod_angle_rad,rod_speed_rad_s"
    ",ground_force_x_N,ground_force_y_N,ground_moment_N_m"
)
#: Columns of works, where the driver's speed changes or the slider is loaded.
WORKS = {
    "ideal-fluctuating": "driver_work_J,",
    "ideal-compressor": "driver_work_J,slider_viscous_work_J,slider_gas_work_J,",
}
FRICTION = '{law = "tanh", coefficient = 0.03, regularisation_speed_m_s = 0.1}'


def slider_error_m(name: str, end: float, csv: str) -> float:
    """Return how far a slider is off its closed form at most."""
    true = exact(SCENES[name]().replace("end_time_s", end), 4).position[:, -1, 0]
    return float(np.abs(table_of(csv)["slider_position_m"] - true).max())


@pytest.mark.parametrize(
    ("name", "engine"),
    [*((name, "reference") for name in IDEAL_SCENES), *(("ideal-compressor", name) for name in ENGINES)],
)
def test_simulate_writes_the_fixed_columns_of_the_engines_run(name: str, engine: str) -> None:
    done = crankslider("simulate", name, "--engine", engine, *SHORT)
    scene = SCENES[name]().replace("end_time_s", 0.01)
    torque = "" if scene.drive.kind == "free" else ",driver_torque_N_m"
    torque += ",slider_viscous_force_N,slider_gas_force_N" * (name == "ideal-compressor")
    run = make_engine(engine).simulate(scene, RunSettings(step_s=1e-5, samples=4))
    shorter = engine == "scipy" or (engine == "reference" and name == "ideal-compressor")
    assert run.steps == 1000 or (shorter and run.steps > 1000), "at SciPy's start, and before knots of gas"
    of = {"reference": " of rk4", "scipy": " of DOP853"}.get(engine, "")
    assert done.code == 0
    assert done.stderr.endswith(f"\nnote: {run.steps} steps{of}, the longest 1e-05 s\n")
    assert done.stdout.splitlines()[0] == (
        f"{MOTION},{FORCES}{torque},kinetic_energy_J,potential_energy_J,{WORKS.get(name, '')}"
        f"energy_balance_residual_J,{LAST}"
    )
    table = pd.DataFrame(sample_columns(scene, run))
    pd.testing.assert_frame_equal(table_of(done.stdout), table, check_exact=True)


def test_the_crank_angle_is_unwrapped() -> None:
    angle = table_of(crankslider("simulate", "ideal-driven").stdout)["crank_angle_rad"]
    assert angle.iloc[-1] == pytest.approx(4 * np.pi)


def test_without_gravity_there_is_no_potential_energy() -> None:
    header = crankslider("simulate", "ideal-free", *SHORT, "--with", "gravity_m_s2=0").stdout.splitlines()[0]
    assert "potential_energy_J" not in header
    assert "kinetic_energy_J" in header


@pytest.mark.parametrize("friction", [(), ("--with", f"clearance.B.friction={FRICTION}")])
def test_a_joint_with_clearance_has_its_own_columns(friction: tuple[str, ...]) -> None:
    short = ("clearance-driven-0.5mm", "--end", 0.001, "--samples", 50)
    done = crankslider("simulate", *short, "--with", "gravity_m_s2=0", *friction)
    assert done.code == 0, done.stderr
    force = "contact_B_normal_force_N," + ("contact_B_friction_force_N," if friction else "")
    assert done.stdout.splitlines()[0] == (
        f"{MOTION},{FORCES},driver_torque_N_m,kinetic_energy_J,potential_energy_J,energy_balance_residual_J,"
        f"clearance_B_x_m,clearance_B_y_m,contact_B_penetration_m,{force}dissipated_energy_J,{LAST}"
    )


def test_general_files_are_simulated_and_checked(tmp_path: Path) -> None:
    file = tmp_path / "four-bar.toml"
    file.write_text(crankslider("show", "four-bar").stdout)
    columns = table_of(crankslider("simulate", file, "--end", 0.002, "--samples", 5).stdout)
    assert columns["observed_B_x_m"].notna().all()
    assert {"crank_angle_rad", "rocker_speed_rad_s", "joint_B_force_x_N"} <= {*columns}
    assert crankslider("check", file).stdout.startswith("four-bar: 3 bodies, 4 joints; 8 rows of rank 8, 1 ")


# Steps and tolerances


@pytest.mark.parametrize(("settings", "method"), [([], "dop853"), (["--set", "method=rk4"], "rk4")])
def test_a_tolerance_takes_error_control_unless_the_method_is_set(settings: list[str], method: str) -> None:
    done = crankslider("simulate", "ideal-free", "--tolerance", 1e-9, "--end", 0.1, "--samples", 4, *settings)
    assert (done.code, f" steps of {method}, " in done.stderr) == (0, True)
    assert slider_error_m("ideal-free", 0.1, done.stdout) < 1e-9


@pytest.mark.parametrize("engine", ENGINES)
def test_the_tolerance_is_kept(engine: str) -> None:
    done = crankslider("simulate", "ideal-torque", *SHORT, "--engine", engine, "--tolerance", 1e-7)
    assert slider_error_m("ideal-torque", 0.01, done.stdout) <= 1e-7


def test_the_note_tells_the_step_that_was_taken() -> None:
    done = crankslider("simulate", "ideal-free", "--end", 0.01, "--samples", 3, "--step", 1e-3)
    assert done.stderr.endswith("\nnote: 12 steps of rk4, the longest 0.000833333 s\n")


def test_of_a_method_that_chooses_its_steps_the_note_tells_their_mean() -> None:
    """The longest of a few steps in a run of 0.1 s was told as 0.1 s, which is what they were allowed."""
    method = ("--set", "method=dop853", "--step", 0.1)
    done = crankslider("simulate", "ideal-free", "--end", 0.1, "--samples", 3, *method)
    (note,) = [line for line in done.stderr.splitlines() if " steps of " in line]
    steps, mean = note.removeprefix("note: ").split(" steps of dop853, ")
    mean, allowed = mean.split(" s on average, ")
    assert float(mean) == pytest.approx(0.1 / int(steps), rel=5e-3)
    assert allowed == "up to 0.1 s allowed"


@pytest.mark.parametrize("end", [0.00043, 0.0123, 0.03])
@pytest.mark.parametrize("name", ["ideal-driven", "ideal-fluctuating"])
def test_runs_of_any_length_come_to_their_end(name: str, end: float) -> None:
    for samples in range(1, 40):
        done = crankslider("simulate", name, "--end", end, "--samples", samples, "--step", 3e-5)
        assert done.code == 0, done.stderr
