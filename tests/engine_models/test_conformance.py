"""What every engine owes on every scene that it supports, whatever its method."""

from functools import cache

import numpy as np
import pytest

from engine_models.engine import Engine, RunSettings, Trajectory, UnsupportedScene
from engine_models.engines import ENGINES, make_engine
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.slider_load import slider_forces
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.judges.ideal_truth import exact
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J

#: Driven scenes up to just before their second impact, free ones through their first: in s, and the steps.
END_S, STEP_S = {True: 0.0006, False: 0.004}, {True: 1e-6, False: 4e-6}
SAMPLES = 40
#: Every ideal joint and the guide are closed to within this in m: Pymunk's sweeps leave the most, 6e-7.
CLOSED_M = 5e-6
#: Energy that no line of the ledger explains, as a part of the kinetic energy: first-order engines leave the
#: most, at their first impact.
LEDGER = 2e-3
#: Forces and accelerations by central differences over two samples, as a part of the largest force.
FORCES = 0.02


#: The reference's second method owes the same.
CONTROLLED = "reference by DOP853"


def engine_of(engine: str) -> Engine:
    """Return an engine at its defaults, or the reference with error control."""
    return make_engine("reference", method="dop853") if engine == CONTROLLED else make_engine(engine)


def supported() -> list[tuple[str, str]]:
    pairs = []
    for engine in (*ENGINES, CONTROLLED):
        for name, make in SCENES.items():
            try:
                engine_of(engine).check(make())
            except UnsupportedScene:
                continue
            pairs.append((engine, name))
    return pairs


def short(name: str) -> Scene:
    scene = SCENES[name]()
    return scene.model_copy(update={"end_time_s": END_S[scene.drive.kind == "constant-speed"]})


@cache
def run(engine: str, name: str) -> Trajectory:
    scene = short(name)
    step = STEP_S[scene.drive.kind == "constant-speed"]
    return engine_of(engine).simulate(scene, RunSettings(step, SAMPLES))


ALL = pytest.mark.parametrize(("engine", "name"), supported())


def test_every_engine_runs_some_scene_of_every_kind_it_claims() -> None:
    kinds: dict[str, set[str]] = {engine: set() for engine in (*ENGINES, CONTROLLED)}
    for engine, name in supported():
        kinds[engine].add(name.partition("-")[0])
    assert all(kinds.values())
    without_rigid = {"ideal", "clearance"}
    known = {engine: {*without_rigid, "rigid"} for engine in ("reference", CONTROLLED, "pymunk")}
    known |= dict.fromkeys(("exudyn", "scipy"), without_rigid)
    assert {engine: kinds[engine] for engine in known} == known


@ALL
def test_arrays_have_the_scenes_shapes_and_the_grids_times(engine: str, name: str) -> None:
    scene, trajectory = short(name), run(engine, name)
    n, bodies = SAMPLES + 1, len(scene.bodies)
    assert trajectory.position.shape == trajectory.velocity.shape == (n, bodies, 3)
    assert trajectory.joint_force_N.shape == (n, len(scene.joints), 2)
    assert (trajectory.guide_normal_force_N is None) == (not scene.is_crank_slider)
    assert (
        (trajectory.driver_torque_N_m is None)
        == (trajectory.driver_work_J is None)
        == (scene.drive.kind == "free")
    )
    np.testing.assert_allclose(trajectory.time_s, np.linspace(0, scene.end_time_s, n), rtol=1e-12, atol=0)
    assert tuple(trajectory.contacts) == scene.joints_with_clearance
    for joint, contact in trajectory.contacts.items():
        rubs = getattr(engine_scene(engine, scene).clearance, joint).friction is not None
        assert (contact.friction_force_N is not None) == rubs
        assert contact.gap_m.shape == (n, 2)
        for array in (contact.penetration_m, contact.normal_force_N, contact.normal_impulse_N_s):
            assert array.shape == (n,)
    assert trajectory.steps > 0
    assert trajectory.solve_time_s > 0


def engine_scene(engine: str, scene: Scene) -> Scene:
    return engine_of(engine).twin(scene)


@ALL
def test_the_run_begins_in_the_scenes_own_state(engine: str, name: str) -> None:
    position, velocity = start_state(short(name))
    trajectory = run(engine, name)
    np.testing.assert_allclose(trajectory.position[0], position, rtol=0, atol=1e-12)
    scale = 1 + np.abs(velocity).max()
    np.testing.assert_allclose(trajectory.velocity[0], velocity, rtol=0, atol=1e-9 * scale)


@ALL
def test_ideal_joints_stay_closed_and_the_ledger_closes(engine: str, name: str) -> None:
    scene, trajectory = short(name), run(engine, name)
    apart = constraint_violation_m(scene, trajectory).max()
    assert apart < CLOSED_M, f"{apart:.1e} m"
    scale = max(float(kinetic_energy_J(scene, trajectory).max()), 1e-6)
    left = np.abs(energy_balance_residual_J(scene, trajectory)).max() / scale
    assert left < LEDGER, f"{left:.1e} of the kinetic energy"


@ALL
def test_forces_are_those_that_the_accelerations_need(engine: str, name: str) -> None:
    scene, trajectory = short(name), run(engine, name)
    interval = trajectory.time_s[1]
    quiet = np.ones(SAMPLES - 1, dtype=bool)  # no contact from the sample before to the one after
    for contact in trajectory.contacts.values():
        quiet &= contact.normal_impulse_N_s[2:] == contact.normal_impulse_N_s[:-2]
    quiet[:2] = False  # a start from rest forces on the first steps (Pymunk's kicks)
    force = np.zeros_like(trajectory.position[:, :, :2])
    force[:, 0] = trajectory.joint_force_N[:, 0]
    if scene.is_crank_slider:
        force[:, 0] -= trajectory.joint_force_N[:, 1]
        force[:, 1] = trajectory.joint_force_N[:, 1] - trajectory.joint_force_N[:, 2]
        force[:, 2] = trajectory.joint_force_N[:, 2]
        assert trajectory.guide_normal_force_N is not None
        force[:, 2, 1] += trajectory.guide_normal_force_N
    for load in slider_forces(scene, trajectory.position, trajectory.velocity).values():
        force[:, 2, 0] += load
    masses = np.array([body.mass_kg for body in scene.bodies])[:, None]
    force[:, :, 1] -= masses[:, 0] * scene.gravity_m_s2
    needed = masses * (trajectory.velocity[2:, :, :2] - trajectory.velocity[:-2, :, :2]) / (2 * interval)
    scale = max(np.abs(force[1:-1][quiet]).max(initial=0.0), float((masses * 9.81).max()))
    off = np.abs(needed - force[1:-1])[quiet].max(initial=0.0) / scale
    assert off < FORCES, f"{off:.1e} of the largest force"


@ALL
def test_a_second_run_is_the_same_to_the_last_bit(engine: str, name: str) -> None:
    first = run(engine, name)
    second = run.__wrapped__(engine, name)
    assert np.array_equal(first.position, second.position)
    assert np.array_equal(first.joint_force_N, second.joint_force_N)


#: Longest step, and the order of the slider's position, on set F without clearance.
ORDERS = {"reference": (2e-4, 4), "exudyn": (2e-4, 2), "pymunk": (1e-4, 2)}


@pytest.mark.parametrize("engine", ORDERS)
def test_errors_fall_at_the_methods_order_on_the_free_ideal_scene(engine: str) -> None:
    scene = SCENES["ideal-free"]().model_copy(update={"end_time_s": 0.1})
    step, order = ORDERS[engine]
    truth = exact(scene, SAMPLES).slider_position_m
    steps = step / 2.0 ** np.arange(4)
    runs = [make_engine(engine).simulate(scene, RunSettings(h, SAMPLES)) for h in steps]
    errors = [np.abs(trajectory.slider_position_m - truth).max() for trajectory in runs]
    slope = np.polyfit(np.log([trajectory.step_s for trajectory in runs]), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.1), f"{slope:.3f}: {errors}"


@pytest.mark.parametrize(
    "engine",
    [
        make_engine("scipy", rtol=1e-6, atol=1e-6),
        make_engine("reference", method="dop853", tolerance=1e-6),
    ],
)
def test_an_engine_with_a_tolerance_of_its_own_errs_less_when_it_is_sharper(engine: Engine) -> None:
    scene = SCENES["ideal-free"]().model_copy(update={"end_time_s": 0.1})
    truth, errors = exact(scene, SAMPLES).slider_position_m, []
    for _ in range(4):
        trajectory = engine.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
        errors.append(float(np.abs(trajectory.slider_position_m - truth).max()))
        engine = engine.sharper()
    assert errors[3] < errors[0] / 100, f"three tenths of the tolerance: {errors}"
