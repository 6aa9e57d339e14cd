"""Changing speeds, motors and loads on the slider in Exudyn, against truths of others, and without Python."""

import gc
import math
import subprocess
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings, Trajectory, UnsupportedScene
from engine_models.exudyn.drive import acceleration, speed
from engine_models.exudyn.engine import ExudynEngine
from engine_models.exudyn.loads import gas_force
from engine_models.exudyn.model import build_model
from engine_models.exudyn.solver import silence, simulation_settings
from engine_models.exudyn.symbolic import symbolic
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.drives import Drive, FluctuatingDrive, MotorDrive, RampDrive, TableDrive
from engine_models.scene.library import IDEAL_SCENES, clearance, ideal_driven, ideal_free
from engine_models.scene.loads import Gas, Loads, SliderLoad
from engine_models.scene.scene import Clearances, Scene
from studies.judges.metrics import energy_balance_residual_J, errors
from tests.studies.truth.closed_forms.crank_slider import exact

#: Both implicit solvers are of order 2; the rest is what a regression over a factor of 4 in the step leaves.
ORDER, ORDER_TOLERANCE = 2.0, 0.06
#: Odd numbers of steps between samples: an even one would hide a force that rings from step to step.
STEPS_PER_SAMPLE = (5, 9, 19)
SAMPLES = 160
SPEED = ideal_driven().start.crank_speed_rad_s


def gas_table(entries: int = 13, begin_rad: float = 0.3) -> Gas:
    """Return a push on the slider of 200 N once a revolution."""
    angle = begin_rad + np.linspace(0.0, 2 * np.pi, entries)
    force = 200 * np.exp(-(((angle - begin_rad - 1.0) / 0.8) ** 2)) - 20 * np.sin(angle) ** 2
    force[-1] = force[0]
    return Gas(crank_angle_rad=tuple(angle.tolist()), force_N=tuple(force.tolist()))


def table(entries: int, end_time_s: float = 0.024) -> TableDrive:
    """Return a crank's angle around that of set R, equally spaced in time."""
    time = np.linspace(0.0, end_time_s, entries)
    angle = SPEED * time + 0.3 * np.sin(2 * np.pi * 60 * time)
    return TableDrive(kind="table", time_s=tuple(time.tolist()), angle_rad=tuple(angle.tolist()))


def driven(drive: Drive, time_s: float | None = None) -> Scene:
    """Return set R by another drive, from an angle where no symmetry hides a force."""
    start = {"crank_angle_rad": 0.5, "time_s": time_s}
    if isinstance(drive, TableDrive):
        start["crank_speed_rad_s"] = float(drive.spline()(time_s or 0.0, 1))
    scene = ideal_driven()
    return scene.model_copy(update={"drive": drive, "start": scene.start.model_copy(update=start)})


def loaded(scene: Scene, **load: Any) -> Scene:
    return scene.model_copy(update={"load": Loads(slider=SliderLoad(**load))})


def shorter(scene: Scene, end_time_s: float) -> Scene:
    return scene.model_copy(update={"end_time_s": end_time_s})


def loose(scene: Scene, joints: str, end_time_s: float) -> Scene:
    law = clearance(1e-4, "hu-guo", 0.5)
    clearances = Clearances(**dict.fromkeys(joints, law))
    return shorter(scene.model_copy(update={"clearance": clearances}), end_time_s)


EVERY_LOAD: dict[str, Any] = {
    "force_N": 7.0,
    "viscous_N_s_m": 2.0,
    "spring_N_m": 500.0,
    "free_position_m": 0.1,
    "gas": gas_table(),
}
RAMP = RampDrive(kind="ramp", final_speed_rad_s=100.0, ramp_time_s=0.01)
FLUCTUATION = FluctuatingDrive(kind="fluctuating", amplitude_rad_s=50.0, frequency_Hz=90.0, phase_rad=0.4)
FREE = shorter(ideal_free(), 0.2)
MOTOR = FREE.model_copy(
    update={"drive": MotorDrive(kind="motor", stall_torque_N_m=0.6, no_load_speed_rad_s=90.0)}
)
PRESCRIBED = {
    "ramp": driven(RAMP),
    "ramp, later": loaded(driven(RAMP, 0.004), **EVERY_LOAD),
    "fluctuating": driven(FLUCTUATION),
    "fluctuating, later": loaded(driven(FLUCTUATION, 0.004), **EVERY_LOAD),
    # Entries at every tenth sample: there a step ends.
    "table": loaded(driven(table(17)), **EVERY_LOAD),
}
UNPRESCRIBED = {
    "motor": MOTOR,
    "force": loaded(FREE, force_N=7.0),
    "viscous": loaded(FREE, viscous_N_s_m=2.0),
    "spring": loaded(FREE, spring_N_m=500.0, free_position_m=0.1),
    "gas": loaded(FREE, gas=gas_table()),
    "all": loaded(MOTOR, **EVERY_LOAD),
}
LIBRARY = {name: IDEAL_SCENES[name]() for name in ("ideal-fluctuating", "ideal-compressor")}
IDEAL = PRESCRIBED | UNPRESCRIBED | LIBRARY


def run(scene: Scene, step_s: float, samples: int = SAMPLES, **settings: Any) -> Trajectory:
    return ExudynEngine(**settings).simulate(scene, RunSettings(step_s, samples))


def largest_errors(
    scene: Scene, trajectory: Trajectory, truth: Trajectory, first_sample: int = 0
) -> dict[str, float]:
    """Return the largest error of everything that a trajectory holds, from a sample on."""
    error = errors(scene, trajectory, truth)
    error["velocity"] = np.abs(trajectory.velocity - truth.velocity).max(axis=(1, 2))
    error["energy_balance_residual_J"] = np.abs(energy_balance_residual_J(scene, trajectory))
    assert trajectory.load_work_J.keys() == truth.load_work_J.keys()
    for part, work in truth.load_work_J.items():
        error[f"{part}_work_J"] = np.abs(trajectory.load_work_J[part] - work)
    if truth.driver_work_J is not None and truth.driver_torque_N_m is not None:
        assert trajectory.driver_work_J is not None
        assert trajectory.driver_torque_N_m is not None
        error["driver_work_J"] = np.abs(trajectory.driver_work_J - truth.driver_work_J)
        error["driver_torque_N_m"] = np.abs(trajectory.driver_torque_N_m - truth.driver_torque_N_m)
    return {name: float(values[first_sample:].max()) for name, values in error.items()}


def orders(scene: Scene, first_sample: int = 0, **settings: Any) -> dict[str, float]:
    """Return the slope of every error over the step in logarithms."""
    truth = exact(scene, SAMPLES)
    runs = [run(scene, scene.end_time_s / (SAMPLES * n), **settings) for n in STEPS_PER_SAMPLE]
    largest = [largest_errors(scene, each, truth, first_sample) for each in runs]
    steps = np.log([each.step_s for each in runs])
    return {
        name: float(np.polyfit(steps, np.log([e[name] for e in largest]), 1)[0])
        for name in largest[0]
        if largest[-1][name] > ROUND_OFF
    }


#: Errors below this are nobody's order: a prescribed angle may be exact. In m, rad, N, J.
ROUND_OFF = 1e-10


@pytest.mark.parametrize("name", IDEAL)
def test_every_signal_of_the_trapezoidal_rule_converges_with_order_two_from_the_start(name: str) -> None:
    found = orders(IDEAL[name])
    assert {"slider_position_error_m", "joint_A_force_error_N", "energy_balance_residual_J"} <= found.keys()
    for signal, order in found.items():
        assert abs(order - ORDER) < ORDER_TOLERANCE, f"{signal}: order {order:.3f}"


@pytest.mark.parametrize("name", ["fluctuating, later", "table", "all"])
def test_generalized_alpha_converges_with_order_two_past_its_first_steps(name: str) -> None:
    for signal, order in orders(IDEAL[name], first_sample=4, solver="GeneralizedAlpha").items():
        assert abs(order - ORDER) < ORDER_TOLERANCE, f"{signal}: order {order:.3f}"


def test_a_tables_entries_within_steps_leave_no_force_that_rings() -> None:
    """The rule would keep every jump of the acceleration's slope, with order one and for ever."""
    # What a step leaves in the speed goes by where in it the entry is, and forces go by the speed a little.
    reactions = {name: order for name, order in orders(driven(table(14))).items() if "_N" in name}
    assert len(reactions) >= 5
    for signal, order in reactions.items():
        assert abs(order - ORDER) < 0.3, f"{signal}: order {order:.3f}"


@pytest.mark.parametrize("name", ["ramp, later", "fluctuating"])
def test_a_prescribed_speed_is_exact_at_every_step_however_long(name: str) -> None:
    scene, motion = PRESCRIBED[name], crank_motion(PRESCRIBED[name])
    assert motion is not None
    trajectory = run(scene, 2e-4, 120)
    off = np.abs(trajectory.velocity[:, 0, 2] - motion.speed_rad_s(trajectory.time_s)).max()
    assert off < 1e-10, f"{off:.1e} of {SPEED:.0f} rad/s"


LOOSE = {
    "ramp B": loose(loaded(driven(RAMP, 0.004), **EVERY_LOAD), "B", 2e-3),
    "fluctuating A": loose(loaded(driven(FLUCTUATION), **EVERY_LOAD), "A", 2e-3),
    "table AB": loose(driven(table(14)), "AB", 2e-3),
    "fluctuating OA": loose(driven(FLUCTUATION), "OA", 1e-3),
    "motor and loads B": loose(UNPRESCRIBED["all"], "B", 5e-3),
    # The crank hangs from the slider: its angle is a sum of coordinates.
    "motor and loads O": loose(UNPRESCRIBED["all"], "O", 5e-3),
    "motor and loads OA": loose(UNPRESCRIBED["all"], "OA", 2e-3),
}


@lru_cache
def twin_run(scene: Scene) -> Trajectory:
    """Return the reference's converged solution of Exudyn's twin of a scene."""
    engine = ReferenceEngine(method="dop853", step_tolerance=1e-12)
    return engine.simulate(ExudynEngine().twin(scene), RunSettings(1e-4, 40))


@pytest.mark.parametrize("name", LOOSE)
def test_DOPRI5_meets_the_reference_with_clearance_in_every_signal_and_work(name: str) -> None:
    scene, truth = LOOSE[name], twin_run(LOOSE[name])
    trajectory = run(scene, 1e-5, 40, step_tolerance=1e-12)
    assert truth.driver_torque_N_m is not None
    assert truth.driver_work_J is not None
    assert sum(len(contact.impacts.time_s) for contact in truth.contacts.values()) > 0
    bounds = {
        # Measured up to 8e-7 of the forces, 1e-7 of the torque and 3e-9 of the works, 3e-11 m and 5e-6 m/s.
        "_N": 1e-5 * np.abs([*truth.joint_force_N.values()]).max(),
        "_N_m": 1e-5 * np.abs(truth.driver_torque_N_m).max(),
        "_J": 1e-6 * np.abs(truth.driver_work_J).max(),
        "_N_s": 1e-6,
        "_m": 1e-9,
        "_m_s": 1e-5,
        "velocity": 1e-4,
    }
    for signal, value in largest_errors(scene, trajectory, truth).items():
        bound = bounds[max((end for end in bounds if signal.endswith(end)), key=len)]
        assert value < bound, f"{signal}: {value:.1e}, more than {bound:.1e}"


@pytest.mark.parametrize("name", LOOSE)
def test_the_trapezoidal_rule_converges_to_the_explicit_tree_with_clearance(name: str) -> None:
    scene = shorter(LOOSE[name], LOOSE[name].end_time_s / 2)
    tree = run(scene, 1e-5, 20, step_tolerance=1e-12)
    coarse, fine = (
        largest_errors(scene, run(scene, scene.end_time_s / steps, 20, solver="TrapezoidalIndex2"), tree)
        for steps in (1000, 4000)
    )
    for signal in ("slider_position_error_m", "driver_work_J", "energy_balance_residual_J"):
        if signal in coarse:
            assert fine[signal] < coarse[signal] / 6, f"{signal}: {coarse[signal]:.1e} to {fine[signal]:.1e}"


@pytest.mark.parametrize("name", LOOSE)
def test_the_ledger_closes_with_clearance(name: str) -> None:
    scene = LOOSE[name]
    trajectory = run(scene, 1e-5, 20)
    residual = np.abs(energy_balance_residual_J(scene, trajectory)).max()
    exchanged = np.abs(trajectory.work_J).max()
    assert residual < 1e-6 * exchanged, f"{residual:.1e} of {exchanged:.1e} J"


def test_a_changing_speed_needs_a_coordinate_that_is_the_cranks_angle() -> None:
    scene = loose(driven(RAMP), "O", 1e-3)
    with pytest.raises(
        UnsupportedScene, match="no coordinate is the angle of crank, whose speed is prescribed"
    ):
        ExudynEngine(solver="DOPRI5").check(scene)
    assert ExudynEngine().solver_of(scene) == "TrapezoidalIndex2"
    trajectory = run(scene, 1e-6, 20)
    assert np.abs(energy_balance_residual_J(scene, trajectory)).max() < 1e-3 * np.abs(trajectory.work_J).max()


def test_the_crank_angle_starts_anywhere_and_the_gas_does_not_mind_whole_turns() -> None:
    scene = UNPRESCRIBED["gas"]
    angle = scene.start.crank_angle_rad - 200 * math.pi
    turned = scene.model_copy(update={"start": scene.start.model_copy(update={"crank_angle_rad": angle})})
    one, other = (run(each, 1e-5, 20) for each in (scene, turned))
    assert np.abs(one.load_work_J["gas"] - other.load_work_J["gas"]).max() < 1e-9
    assert other.position[0, 0, 2] == pytest.approx(angle, rel=1e-15)


def evaluated(expression: Callable[[Any], Any], at: FloatArray) -> FloatArray:
    """Return an expression of one variable at values (n,)."""
    x = symbolic.Real("x", 0.0)
    value, out = expression(x), []
    for number in at:
        x.SetValue(float(number))
        out.append(value.Evaluate())
    return np.array(out)


@pytest.mark.parametrize("name", PRESCRIBED)
def test_Exudyns_own_speed_and_acceleration_are_those_of_the_scene(name: str) -> None:
    scene, motion = PRESCRIBED[name], crank_motion(PRESCRIBED[name])
    assert motion is not None
    entries = [t for t in getattr(scene.drive, "time_s", ()) if t < scene.end_time_s]
    time = np.unique([*np.linspace(0.0, scene.end_time_s, 500), *entries])
    true = motion.acceleration_rad_s2(time)
    off = np.abs(evaluated(lambda t: acceleration(scene.mechanism.drive, t), time) - true).max()
    assert off < 1e-12 * np.abs(true).max()
    if not isinstance(scene.drive, TableDrive):
        off = np.abs(
            evaluated(lambda t: speed(scene.mechanism.drive, t), time) - motion.speed_rad_s(time)
        ).max()
        assert off < 1e-12 * SPEED


@pytest.mark.parametrize("entries", [4, 13, 362])
def test_Exudyns_own_gas_force_is_the_scenes_at_any_angle(entries: int) -> None:
    gas = gas_table(entries)
    angle = np.unique([*np.linspace(-30.0, 30.0, 1001), *gas.crank_angle_rad])
    true, data = gas.spline()(angle), loaded(FREE, gas=gas).mechanism.loads[0].gas
    assert data is not None
    off = np.abs(evaluated(lambda x: gas_force(data.table, x), angle) - true).max()
    # At a turn's end the angle's rounding decides for the last piece or the first: they meet there.
    assert off < 1e-12 * entries * np.abs(true).max(), f"{off:.1e} N"


def items_of(scene: Scene, tree: bool = False) -> dict[str, int]:
    model = build_model(scene, tree)
    system = model.mbs.systemData
    return {
        "nodes": system.NumberOfNodes(),
        "objects": system.NumberOfObjects(),
        "markers": system.NumberOfMarkers(),
        "loads": system.NumberOfLoads(),
    }


def test_a_model_has_no_item_for_what_its_scene_does_not_have() -> None:
    # Three bodies, two joints; two weights. The crank needs no joint.
    assert items_of(ideal_free()) == {"nodes": 3, "objects": 5, "markers": 6, "loads": 2}
    # The constraint of the speed and what it is against: two more markers.
    assert items_of(ideal_driven()) == {"nodes": 4, "objects": 6, "markers": 8, "loads": 2}
    # Tree and slider, the contact with its history: the tree weighs itself, and its flywheel has no item.
    assert items_of(loose(ideal_driven(), "B", 1e-3), tree=True) == {
        "nodes": 3,
        "objects": 3,
        "markers": 2,
        "loads": 0,
    }
    without = items_of(ideal_free())
    for name, scene in UNPRESCRIBED.items():
        assert items_of(scene) == without | {"objects": without["objects"] + 1}, name


@pytest.mark.parametrize("name", [*PRESCRIBED, "all", "fluctuating A", "motor and loads O"])
def test_no_python_runs_within_a_solve(name: str) -> None:
    """Whatever is called around it, ten times as many steps call no more."""
    scene = (IDEAL | LOOSE)[name]
    engine = ExudynEngine()
    counts, tree = [], engine.solver_of(scene) == "DOPRI5"
    for step in (scene.end_time_s / 100, scene.end_time_s / 1000):
        model = build_model(scene, tree)
        settings = simulation_settings(engine, scene, RunSettings(step, 10))
        called: list[str] = []

        def profile(_: Any, event: str, __: Any, called: list[str] = called) -> None:
            called.append(event)

        with silence():
            sys.setprofile(profile)
            try:
                model.mbs.SolveDynamic(settings)
            finally:
                sys.setprofile(None)
        counts.append(len(called))
    assert counts[0] == counts[1]


def test_user_functions_go_with_their_system() -> None:
    def alive() -> int:
        gc.collect()
        return int(getattr(symbolic.Real, "__newCount") - getattr(symbolic.Real, "__deleteCount"))

    before = alive()
    model = build_model(loaded(driven(table(100)), gas=gas_table(100)))
    assert alive() > before + 1000
    del model
    assert alive() == before


def test_a_large_table_costs_little_more_than_a_small_one() -> None:
    """The piece is found by halving: 20 times the entries are some four comparisons more."""
    small, large = (
        min(run(loaded(driven(table(n)), gas=gas_table(n)), 1e-5, 10).solve_time_s for _ in range(3))
        for n in (25, 500)
    )
    assert large < 2 * small, f"{large:.3f} and {small:.3f} s"


def test_the_fast_build_evaluates_the_same_functions() -> None:
    scene = shorter(loaded(driven(table(14)), **EVERY_LOAD), 0.004)
    code = f"""
from engine_models.engine import RunSettings
from engine_models.exudyn.engine import ExudynEngine
from engine_models.scene.scene import Scene
scene = Scene.model_validate_json('''{scene.model_dump_json()}''')
run = ExudynEngine(fast=True).simulate(scene, RunSettings(1e-5, 10))
print(run.driver_work_J[-1].hex(), run.load_work_J["gas"][-1].hex())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    here = run(scene, 1e-5, 10)
    assert here.driver_work_J is not None
    driver, gas = map(float.fromhex, done.stdout.split())
    assert driver == pytest.approx(here.driver_work_J[-1], rel=1e-9)
    assert gas == pytest.approx(here.load_work_J["gas"][-1], rel=1e-9)
