"""Pymunk under speeds that change, motors, and loads on the slider: at the order of its arms, natively."""

import math
from typing import Any

import numpy as np
import pymunk
import pytest

from engine_models.engine import RunSettings, SimulationFailed, Trajectory
from engine_models.mechanics.assembly import started_from
from engine_models.pymunk import workspace
from engine_models.pymunk.compiled import loads
from engine_models.pymunk.engine import PymunkEngine
from engine_models.pymunk.inputs import Inputs
from engine_models.scene.drives import Drive, FluctuatingDrive, MotorDrive, RampDrive, TableDrive, TorqueDrive
from engine_models.scene.library import ideal_driven, ideal_free, ideal_torque
from engine_models.scene.loads import Gas, Loads, SliderLoad
from engine_models.scene.scene import Scene
from tests.engine_models.pymunk.ideal_errors import ORDER_TOLERANCE, orders, run, worst
from tests.helpers.arrays import joint_forces
from tests.studies.truth.closed_forms.crank_slider import exact

#: Relative to the largest force; as in the scenes of constant speed.
FIRST_FORCES = 5e-5


def varied(
    scene: Scene,
    drive: Drive | None = None,
    load: SliderLoad | None = None,
    end_time_s: float | None = None,
    **start: float,
) -> Scene:
    """Return the scene with another drive, load, end or start."""
    return scene.model_copy(
        update={
            "drive": drive or scene.drive,
            "load": Loads(slider=load),
            "end_time_s": end_time_s or scene.end_time_s,
            "start": scene.start.model_copy(update=start),
        }
    )


def gas(largest_N: float) -> Gas:
    """Return a smooth push once a revolution, 0.4 rad after the outer dead centre."""
    angle = np.linspace(0.0, 2 * math.pi, 25)
    force = largest_N * np.exp(2 * (np.cos(angle - 0.4) - 1))
    return Gas(crank_angle_rad=tuple(angle.tolist()), force_N=(*force[:-1].tolist(), float(force[0])))


def table(entries: int, wave_rad: float) -> TableDrive:
    """Return a table over 30 ms of 360 rad/s and more, with a wave on it."""
    t = np.linspace(0.0, 0.03, entries)
    angle = 1.0 + 360 * t + 1e4 * t**2 + wave_rad * np.sin(200 * t)
    return TableDrive(kind="table", time_s=tuple(t.tolist()), angle_rad=tuple(angle.tolist()))


ROUGH_RAD = (0.0, 1.0, 2.7, 4.2, 5.2, 7.4, 9.2, 10.6, 13.0)
FLUCTUATING = FluctuatingDrive(kind="fluctuating", amplitude_rad_s=60.0, frequency_Hz=150.0, phase_rad=0.3)
WEAK, STRONG = (
    MotorDrive(kind="motor", stall_torque_N_m=torque, no_load_speed_rad_s=speed)
    for torque, speed in ((0.6, 60.0), (20.0, 300.0))
)
ALL = SliderLoad(force_N=30.0, viscous_N_s_m=5.0, spring_N_m=2000.0, free_position_m=0.1, gas=gas(-800.0))
DRIVEN, FREE, TORQUE = ideal_driven(), ideal_free(), ideal_torque()
#: Ramps that end after the run, and amid it; drives whose clock is on its way; a part of the load each, and
#: all of them under every kind of drive.
SCENES = {
    "ramp": varied(
        DRIVEN, RampDrive(kind="ramp", final_speed_rad_s=600.0, ramp_time_s=0.03), crank_speed_rad_s=50.0
    ),
    "ramp from rest": varied(
        DRIVEN, RampDrive(kind="ramp", final_speed_rad_s=600.0, ramp_time_s=0.0153), crank_speed_rad_s=0.0
    ),
    "fluctuating": varied(DRIVEN, FLUCTUATING, time_s=0.001),
    "table": varied(DRIVEN, table(61, 0.3), time_s=0.004, crank_speed_rad_s=480.0),
    "motor": varied(TORQUE, WEAK),
    "force": varied(FREE, load=SliderLoad(force_N=5.0), end_time_s=0.3),
    "viscous": varied(FREE, load=SliderLoad(viscous_N_s_m=1.0), end_time_s=0.3),
    "spring": varied(FREE, load=SliderLoad(spring_N_m=200.0, free_position_m=0.1), end_time_s=0.3),
    "gas": varied(FREE, load=SliderLoad(gas=gas(-30.0)), end_time_s=0.15),
    "driven, all": varied(DRIVEN, load=ALL),
    "fluctuating, all": varied(DRIVEN, FLUCTUATING, ALL),
    "motor, all": varied(TORQUE, STRONG, ALL, end_time_s=0.1),
    "torque, all": varied(TORQUE, TorqueDrive(kind="torque", torque_N_m=3.0), ALL, end_time_s=0.05),
}


def steps_of(scene: Scene, factor: int = 1) -> tuple[int, ...]:
    """Return odd numbers of steps between samples, as many more as the scene is longer.

    None is shorter than 1e-6 s: there the round-off of places shows in the first forces (see ``test_ideal``).
    """
    steps = (21, 41, 81) if scene.end_time_s < 0.03 else (81, 161, 321)
    return tuple(factor * n for n in steps)


@pytest.mark.parametrize("name", SCENES)
def test_tuned_every_signal_and_work_converges_at_order_two(name: str) -> None:
    slopes = orders(SCENES[name], PymunkEngine(), steps_of(SCENES[name]))
    assert slopes == pytest.approx(dict.fromkeys(slopes, 2.0), abs=ORDER_TOLERANCE), slopes


#: Every drive, and all loads together.
SOME = ("ramp", "fluctuating, all", "table", "motor, all")


@pytest.mark.parametrize("name", SOME)
def test_out_of_the_box_every_signal_and_work_converges_at_order_one_once_started(name: str) -> None:
    scene = SCENES[name]
    slopes = orders(scene, PymunkEngine.out_of_the_box(), steps_of(scene, 3), since=1)
    assert slopes == pytest.approx(dict.fromkeys(slopes, 1.0), abs=ORDER_TOLERANCE), slopes


@pytest.mark.parametrize("name", SCENES)
def test_all_works_there_are_are_told_and_no_others(name: str) -> None:
    scene = SCENES[name]
    trajectory = run(scene, PymunkEngine(), 21)
    parts = ("force", "viscous", "spring", "gas")
    there = [part for part in parts if part == name] or list(parts) * name.endswith("all")
    assert list(trajectory.load_work_J) == there
    assert (trajectory.driver_work_J is None) == (trajectory.driver_torque_N_m is None)
    assert (trajectory.driver_work_J is None) == (scene.drive.kind == "free")


@pytest.mark.parametrize("name", [*(name for name in SCENES if "all" in name), "fluctuating", "motor"])
def test_tuned_the_first_forces_are_as_good_as_the_later_ones(name: str) -> None:
    scene = varied(SCENES[name], load=SCENES[name].load.slider, end_time_s=12e-5)
    trajectory, truth = run(scene, PymunkEngine(), samples=12), exact(scene, 12)
    error = np.abs(joint_forces(trajectory) - joint_forces(truth)).max(axis=(1, 2))
    assert (error[:2] < FIRST_FORCES * np.abs(joint_forces(truth)).max()).all(), error


def test_forces_in_the_two_steps_after_a_tables_entry_are_of_order_one_and_all_else_of_two() -> None:
    rough = TableDrive(kind="table", time_s=tuple(3e-3 * k for k in range(9)), angle_rad=ROUGH_RAD)
    scene = varied(DRIVEN, rough, crank_speed_rad_s=float(rough.spline()(0.0, 1)))
    between, at = {}, {}
    for steps in (1600, 3200, 6400):
        force = joint_forces(run(scene, PymunkEngine(iterations=20), samples=steps))
        error = np.abs(force - joint_forces(exact(scene, steps))).max(axis=(1, 2))
        entry = np.arange(0, steps, steps // 8)[1:]
        after = np.concatenate([entry, entry + 1])
        at[steps], between[steps] = error[after].max(), np.delete(error, after).max()
    halved = np.log2([[e[1600] / e[3200], e[3200] / e[6400]] for e in (at, between)])
    assert halved[0] == pytest.approx(1.0, abs=0.1), (halved, at)
    assert halved[1] == pytest.approx(2.0, abs=0.1), (halved, between)


@pytest.mark.parametrize("name", ["fluctuating, all", "motor, all", "table"])
def test_a_run_does_not_depend_on_blocks_or_on_how_often_it_is_looked_at(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = SCENES[name]
    often, seldom = (run(scene, PymunkEngine(), 4000 // n, n) for n in (200, 20))
    monkeypatch.setattr(workspace, "BLOCK_KICKS", 257)
    blocks = run(scene, PymunkEngine(), 20, 200)
    for one, other, every in ((often, seldom, 10), (often, blocks, 1)):
        for signal, value in signals(one).items():
            assert np.array_equal(value[::every], signals(other)[signal]), signal


def signals(trajectory: Trajectory) -> dict[str, Any]:
    """Return motion, forces, torque and works by name."""
    names = ("position", "velocity", "driver_torque_N_m", "driver_work_J")
    own = {name: getattr(trajectory, name) for name in names} | dict(trajectory.load_work_J)
    return own | {"joint_force_N": joint_forces(trajectory)}


@pytest.mark.parametrize("name", ["fluctuating, all", "table", "ramp"])
def test_a_run_goes_on_from_its_middle_at_the_drives_own_time(name: str) -> None:
    scene = SCENES[name]
    half = scene.end_time_s / 2
    truth = exact(scene, 2)
    second = started_from(scene, truth.position[1], truth.velocity[1], half, half)
    error = run(second, PymunkEngine(), 4001, 1).position[-1] - truth.position[-1]
    assert np.abs(error).max() < 1e-6, error


@pytest.mark.parametrize(
    ("scene", "joints", "loaded", "lines", "torques", "pieces"),
    [
        (FREE, 3, 1, 0, 0, 0),
        (DRIVEN, 3, 0, 0, 0, 0),
        (TORQUE, 3, 1, 0, 1, 0),
        (SCENES["fluctuating"], 3, 0, 0, 0, 0),
        (SCENES["motor"], 3, 1, 0, 1, 0),
        (SCENES["force"], 3, 2, 1, 0, 0),
        (SCENES["gas"], 3, 2, 1, 0, 24),
        (SCENES["fluctuating, all"], 3, 1, 1, 0, 24),
    ],
)
def test_only_what_a_scene_needs_is_built_and_set(
    scene: Scene, joints: int, loaded: int, lines: int, torques: int, pieces: int
) -> None:
    model = PymunkEngine()._model(scene, RunSettings(1e-5, 1))
    of = model.inputs
    assert (len(model.space.constraints), len(model.space.bodies), len(model.space.shapes)) == (joints, 3, 0)
    assert (of.loaded, len(of.lines), len(of.torques), len(of.pieces)) == (loaded, lines, torques, pieces)
    changes = len(of.turns(np.arange(1, 11), 1e-5, model.start[0])) > 0
    assert changes == (scene.drive.kind == "fluctuating")


def test_the_crank_of_a_prescribed_speed_is_kinematic_and_where_its_drive_says() -> None:
    scene = SCENES["fluctuating"]
    assert PymunkEngine()._model(scene, RunSettings(1e-5, 1)).bodies[0].body_type == pymunk.Body.KINEMATIC
    trajectory, truth = run(scene, PymunkEngine(), 21), exact(scene, 160)
    for one, other in ((trajectory.position, truth.position), (trajectory.velocity, truth.velocity)):
        assert np.abs(one[:, 0] - other[:, 0]).max() < 1e-11, np.abs(one[:, 0] - other[:, 0]).max()


@pytest.mark.parametrize("iterations", [20, 100])
@pytest.mark.parametrize(
    ("scene", "bound"),
    [
        (varied(FREE, load=SliderLoad(viscous_N_s_m=1000.0), end_time_s=0.1), 2e-6),
        (varied(TORQUE, MotorDrive(kind="motor", stall_torque_N_m=10.0, no_load_speed_rad_s=60.0)), 2e-4),
    ],
)
def test_a_damper_near_the_strongest_that_a_step_takes_is_as_good_as_the_step(
    scene: Scene, bound: float, iterations: int
) -> None:
    engine, samples = PymunkEngine(iterations=iterations), round(scene.end_time_s / 1e-4)
    error = worst(scene, engine.simulate(scene, RunSettings(1e-4, samples)))["slider_position_error_m"]
    assert error < bound, error


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (
            varied(FREE, load=SliderLoad(viscous_N_s_m=1e5)),
            r"load.slider.viscous_N_s_m too .* below 2\.8e-06 s",
        ),
        (
            varied(FREE, MotorDrive(kind="motor", stall_torque_N_m=6000.0, no_load_speed_rad_s=60.0)),
            r"drive.motor too strong .* below 3\.95e-06 s",
        ),
    ],
)
def test_a_damper_too_strong_for_the_step_fails_in_one_line_and_runs_out_of_the_box(
    scene: Scene, reason: str, capfd: pytest.CaptureFixture[str]
) -> None:
    scene = scene.model_copy(update={"end_time_s": 0.01})
    with pytest.raises(SimulationFailed, match=rf"^{reason}$"):
        run(scene, PymunkEngine(), samples=200)
    assert capfd.readouterr() == ("", "")
    assert len(run(scene, PymunkEngine.out_of_the_box(), samples=200).time_s) == 201


def test_the_gas_of_one_angle_is_the_spline_of_it_at_any_turn() -> None:
    scene = varied(FREE, load=SliderLoad(gas=gas(-800.0)))
    of: Inputs = PymunkEngine()._model(scene, RunSettings(1e-5, 1)).inputs
    spline, curve = gas(-800.0).spline(), np.rec.array(of.curves)[0]
    angles = np.random.default_rng(3).uniform(-50.0, 50.0, 1000)
    angles = np.concatenate([angles, spline.x, -spline.x, [-1e-17, 2 * math.pi - 1e-16]])
    assert [loads.value(curve, of.pieces, angle) for angle in angles] == pytest.approx(
        spline(angles), abs=1e-9
    )
    assert math.isnan(loads.value(curve, of.pieces, np.float64(math.nan)))
