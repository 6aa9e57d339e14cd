import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import crankslider as cs
from engine_models.engine import RunSettings
from engine_models.engines import ENGINES, make_engine
from engine_models.scene.library import IDEAL_SCENES, SCENES
from engine_models.scene.library.mechanisms import ALL_SCENES
from studies.command.trajectory_table import sample_columns
from tests.helpers.command import crankslider, table_of
from tests.helpers.engines import supporting
from tests.helpers.running import HEAR
from tests.studies.truth.closed_forms.crank_slider import exact

IDEAL = list(IDEAL_SCENES)
SHORT = ("--end", 0.01, "--samples", 4)
COMMAND = (sys.executable, "-c", "from studies.command.main import main; main()")

MOTION = "time_s,crank_angle_rad,crank_speed_rad_s,slider_position_m,slider_velocity_m_s"
FORCES = (
    ",".join(f"joint_{joint}_force_{axis}_N" for joint in "OAB" for axis in "xy") + ",guide_normal_force_N"
)

LAST = (
    "slider_acceleration_m_s2,rod_angle_rad,rod_speed_rad_s"
    ",ground_force_x_N,ground_force_y_N,ground_moment_N_m"
)


def test_scenes_lists_every_scene_with_its_description() -> None:
    listed = crankslider("scenes")
    lines = listed.stdout.splitlines()
    assert (listed.code, listed.stderr) == (0, "")
    assert [line.split()[0] for line in lines] == ["scene", *ALL_SCENES]
    for make, line in zip(ALL_SCENES.values(), lines[1:], strict=True):
        scene = make()
        assert scene.driven_by.kind in line
        assert f"{scene.end_time_s:g} s" in line
        assert (make.__doc__ or "").splitlines()[0] in line


def test_engines_lists_every_setting_and_what_runs() -> None:
    listed = crankslider("engines")
    assert (listed.code, listed.stderr) == (0, "")
    for name in ENGINES:
        assert f"{name}: " in listed.stdout
    line = next(line for line in listed.stdout.splitlines() if line.startswith("  stabilisation "))
    assert '"none", "baumgarte" or "projection"' in line.partition('"projection"')[2]
    for block in listed.stdout.split("\n\n"):
        assert "  runs " in block
        runs = next(line for line in block.splitlines() if line.startswith("  runs "))
        assert all(scene in runs for scene in IDEAL)
        refused = [line for line in block.splitlines() if line.startswith("  not ")]
        run_or_refused = [scene in runs or any(scene in line for line in refused) for scene in ALL_SCENES]
        assert all(run_or_refused), "every scene is run or refused with a reason"


def imported_by(*command: str) -> set[str]:
    """Return the modules that a process has imported which ran ``crankslider`` with these arguments."""
    code = (
        "import atexit, json, sys; from studies.command.main import main; sys.argv[0] = 'crankslider';"
        "atexit.register(lambda: print(json.dumps(sorted(sys.modules)), file=sys.stderr)); main()"
    )
    done = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True, check=True)
    return set(json.loads(done.stderr.splitlines()[-1]))


@pytest.mark.parametrize("command", [["--help"], ["scenes"], ["show", "ideal-free"]])
def test_a_quick_command_imports_nothing_heavy(command: list[str]) -> None:
    heavy = {"exudyn", "pymunk", "numba", "scipy", "pandas", "matplotlib"}
    assert not heavy & imported_by(*command)


def test_a_run_by_rk4_does_not_wait_for_what_error_control_alone_needs() -> None:
    simulated = ("simulate", "ideal-free", "--end", "0.01", "--samples", "2")
    control = "reference_solver.contact.controlled_step"
    assert control not in imported_by(*simulated)
    assert control in imported_by(*simulated, "--set", "method=dop853")


#: Columns of works, where the driver's speed changes or the slider is loaded.
WORKS = {
    "ideal-fluctuating": "driver_work_J,",
    "ideal-compressor": "driver_work_J,slider_viscous_work_J,slider_gas_work_J,",
}


@pytest.mark.parametrize(
    ("name", "engine"), [(name, own) for name in IDEAL for own in supporting(SCENES[name]())]
)
def test_simulate_writes_the_fixed_columns(name: str, engine: str) -> None:
    done = crankslider("simulate", name, "--engine", engine, *SHORT)
    scene = SCENES[name]().model_copy(update={"end_time_s": 0.01})
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
    pd.testing.assert_frame_equal(
        table_of(done.stdout), pd.DataFrame(sample_columns(scene, run)), check_exact=True
    )


@pytest.mark.parametrize("name", IDEAL)
def test_each_column_holds_what_its_name_says(name: str) -> None:
    # The reference at this step is off by 1e-9 of each signal's size at most: a wrong column is off by 1.
    scene = SCENES[name]().model_copy(update={"end_time_s": 0.01})
    samples = table_of(crankslider("simulate", name, *SHORT).stdout)
    true = pd.DataFrame(sample_columns(scene, exact(scene, 4)))
    for column in true.columns:
        measure = "kinetic_energy_J" if column == "energy_balance_residual_J" else column
        scale = np.abs(true[measure]).max()
        np.testing.assert_allclose(samples[column], true[column], rtol=0, atol=1e-6 * scale, err_msg=column)


def test_the_crank_angle_is_unwrapped() -> None:
    angle = table_of(crankslider("simulate", "ideal-driven").stdout)["crank_angle_rad"]
    assert angle.iloc[-1] == pytest.approx(4 * np.pi)


def test_without_gravity_there_is_no_potential_energy(tmp_path: Path) -> None:
    file = tmp_path / "light.toml"
    file.write_text(crankslider("show", "ideal-free").stdout.replace("= 9.81", "= 0.0"))
    columns = table_of(crankslider("simulate", file, *SHORT).stdout).columns
    assert "potential_energy_J" not in columns
    assert "kinetic_energy_J" in columns


CONTACT = """
[clearance.B]
radial_clearance_m = 5e-4
bearing_radius_m = 0.01
law = "lankarani-nikravesh"
stiffness = 1e9
restitution = 0.9
"""
FRICTION = """
[clearance.B.friction]
law = "tanh"
coefficient = 0.03
regularisation_speed_m_s = 0.1
"""


@pytest.mark.parametrize("friction", ["", FRICTION])
def test_a_joint_with_clearance_has_its_own_columns(friction: str, tmp_path: Path) -> None:
    file = tmp_path / "loose.toml"
    ideal = crankslider("show", "ideal-driven").stdout.replace("gravity_m_s2 = 9.81", "gravity_m_s2 = 0.0")
    file.write_text(ideal + CONTACT + friction)
    done = crankslider("simulate", file, "--end", 0.001, "--samples", 50)
    assert done.code == 0, done.stderr
    force = "contact_B_normal_force_N," + ("contact_B_friction_force_N," if friction else "")
    assert done.stdout.splitlines()[0] == (
        f"{MOTION},{FORCES},driver_torque_N_m,kinetic_energy_J,potential_energy_J,energy_balance_residual_J,"
        f"clearance_B_x_m,clearance_B_y_m,contact_B_penetration_m,{force}dissipated_energy_J,{LAST}"
    )
    samples = table_of(done.stdout)
    gap = np.hypot(samples["clearance_B_x_m"], samples["clearance_B_y_m"])
    np.testing.assert_allclose(samples["contact_B_penetration_m"], gap - 5e-4, rtol=0, atol=1e-12)
    flying = samples["contact_B_penetration_m"] < 0
    assert flying.any()
    assert (samples.loc[flying, "contact_B_normal_force_N"] == 0).all()


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_that_is_shown_reads_as_it_was(name: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(crankslider("show", name).stdout)
    assert crankslider("show", file).stdout == file.read_text()
    assert cs.load(file) == SCENES[name]()


@pytest.mark.parametrize("name", ["ideal-compressor", "clearance-start-up", "rigid-driven-A"])
def test_a_users_file_works_like_the_library_scene(name: str, tmp_path: Path) -> None:
    file, out = tmp_path / "mine.toml", tmp_path / "out.csv"
    file.write_text(crankslider("show", name).stdout)
    library, users = (
        crankslider("simulate", name, *SHORT),
        crankslider("simulate", file, *SHORT, "--out", out),
    )
    assert (users.code, users.stdout, users.stderr) == (0, "", library.stderr)
    assert out.read_text() == library.stdout
    assert sorted(tmp_path.iterdir()) == [file, out]


@pytest.mark.parametrize(("settings", "method"), [([], "dop853"), (["--set", "method=rk4"], "rk4")])
def test_a_tolerance_takes_error_control_unless_the_method_is_set(settings: list[str], method: str) -> None:
    done = crankslider("simulate", "ideal-free", "--tolerance", 1e-9, "--end", 0.1, "--samples", 4, *settings)
    assert (done.code, f" steps of {method}, " in done.stderr) == (0, True)
    scene = SCENES["ideal-free"]().model_copy(update={"end_time_s": 0.1})
    slider = [float(line.split(",")[3]) for line in done.stdout.splitlines()[1:]]
    assert np.abs(slider - exact(scene, 4).position[:, -1, 0]).max() < 1e-9


def test_settings_reach_the_engine() -> None:
    plain = crankslider("simulate", "ideal-free", *SHORT, "--step", 1e-3)
    other = crankslider("simulate", "ideal-free", *SHORT, "--step", 1e-3, "--set", "stabilisation=none")
    assert other.code == 0
    assert other.stdout != plain.stdout


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


@pytest.mark.parametrize("engine", ENGINES)
def test_the_tolerance_is_kept(engine: str) -> None:
    done = crankslider("simulate", "ideal-torque", *SHORT, "--engine", engine, "--tolerance", 1e-7)
    scene = SCENES["ideal-torque"]().model_copy(update={"end_time_s": 0.01})
    error = np.abs(table_of(done.stdout)["slider_position_m"] - exact(scene, 4).position[:, -1, 0]).max()
    assert error <= 1e-7, f"{error:.3g} m"


def test_an_output_file_is_replaced_and_a_device_is_not(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_text("before")
    link = tmp_path / "link.csv"
    link.symlink_to(out)
    assert crankslider("simulate", "ideal-free", *SHORT, "--out", link).code == 0
    assert link.is_symlink()
    assert out.read_text().startswith(MOTION)
    assert crankslider("simulate", "ideal-free", *SHORT, "--out", "/dev/null").code == 0
    assert Path("/dev/null").is_char_device()


def test_a_failed_run_says_when_and_leaves_an_existing_file_alone(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_text("before")
    coarse = ("--engine", "pymunk", "--set", "iterations=1", "--step", 0.01)
    done = crankslider("simulate", "ideal-free", *coarse, "--out", out)
    assert (done.code, done.stdout) == (1, "")
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert "at t = " in done.stderr
    assert out.read_text() == "before"
    assert list(tmp_path.iterdir()) == [out]


#: What to say first, so that a run says when it begins.
TELL = """
from studies.command import simulation
simulated = simulation.simulated
simulation.simulated = lambda *asked: print("it runs", flush=True) or simulated(*asked)
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_an_interrupted_run_leaves_an_existing_file_alone(engine: str, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_text("before")
    long = ("simulate", "ideal-free", "--engine", engine, "--end", "1000", "--out", str(out))
    command = [sys.executable, "-c", HEAR + TELL + COMMAND[-1], *long]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert run.stdout
    assert run.stdout.readline() == "it runs\n"
    assert list(tmp_path.iterdir()) == [out], "a kill now would leave nothing"
    run.send_signal(signal.SIGINT)
    stdout, stderr = run.communicate(timeout=60)
    assert (run.returncode, stdout, stderr) == (130, "", "error: interrupted\n")
    assert out.read_text() == "before"
    assert list(tmp_path.iterdir()) == [out]


#: An object that Ctrl-C finds half made, one whose destructor it strikes, and a command that meets them.
HALF_MADE = """
import signal, sys, time
from studies.running import failures
from studies.command import main

class HalfMade:
    def __init__(self):
        if "made" in sys.argv:
            signal.raise_signal(signal.SIGINT)
        self.made = True

    def __del__(self):
        if "deleted" in sys.argv:
            signal.raise_signal(signal.SIGINT)
        self.made

@main.app.command()
def meet(how: str) -> None:
    HalfMade()
    time.sleep(30)

main.main()
"""


@pytest.mark.parametrize("how", ["made", "deleted"])
def test_an_interrupt_that_strikes_in_another_library_is_said_in_one_line_and_never_lost(how: str) -> None:
    command = [sys.executable, "-c", HEAR + HALF_MADE, "meet", how]
    run = subprocess.run(command, capture_output=True, text=True, timeout=25, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (130, "", "error: interrupted\n")


#: A command that Ctrl-C strikes in the function by which LLVM hands its machine code over.
COMPILED = """
import signal
from llvmlite.binding.executionengine import ExecutionEngine
from studies.command import main

find = ExecutionEngine._find_module_ptr

def struck(*arguments):
    signal.raise_signal(signal.SIGINT)
    return find(*arguments)

ExecutionEngine._find_module_ptr = struck
main.main()
"""


def test_an_interrupt_while_a_kernel_is_compiled_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CRANKSLIDER_CACHE", str(tmp_path))
    command = [sys.executable, "-c", HEAR + COMPILED, "simulate", "ideal-free", "--engine", "scipy"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (130, "", "error: interrupted\n")


def test_a_reader_that_has_seen_enough_causes_no_complaint() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [*COMMAND, "scenes"], stdout=writing, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (1, "")


def test_run_passes_on_what_was_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from studies.running import runner
    from studies.running.registry import STUDIES

    calls: list[tuple[object, ...]] = []
    monkeypatch.setattr(runner, "run_studies", lambda *arguments: calls.append(arguments))
    assert crankslider("run").code == 0
    assert (
        crankslider("run", "agreement", "--full", "--retry-failed", "--jobs", 3, "--out", tmp_path).code == 0
    )
    assert calls == [
        (list(STUDIES), False, os.cpu_count(), Path("results"), None, False, ()),
        (["agreement"], True, 3, tmp_path, None, True, ()),
    ]


def test_report_passes_on_what_was_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from reports import page
    from reports.page.build import Report
    from reports.parts import Finding

    calls: list[tuple[object, ...]] = []

    def write_report(*arguments: object) -> Report:
        calls.append(arguments)
        return Report((Finding("answer", "The answer."),), ("a note",), ())

    monkeypatch.setattr(page, "write_report", write_report)
    monkeypatch.chdir(tmp_path)
    done = crankslider("report")
    assert done.stderr == "note: a note\nnote: the report is report/index.html\n"
    assert done.stdout == "The answer.\n"
    assert crankslider("report", "--results", tmp_path, "--out", tmp_path / "r").code == 0
    assert [results for results, _ in calls] == [Path("results"), tmp_path]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["r", "report"]


def test_the_scene_is_not_overwritten_by_its_own_output(tmp_path: Path) -> None:
    file = tmp_path / "mine"
    file.write_text(crankslider("show", "ideal-free").stdout)
    before = file.read_text()
    done = crankslider("simulate", file, *SHORT, "--out", file)
    assert (done.code, file.read_text()) == (2, before)
    assert "--out: expected another file than the scene" in done.stderr
