"""Pymunk's contacts tend to the reference's solution of the same scene as the step falls, at order 1."""

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings, Trajectory
from engine_models.pymunk.engine import PymunkEngine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import (
    RIGID_SCENES,
    clearance_driven_05,
    clearance_driven_damped,
    clearance_free,
    ideal_compressor,
    ideal_fluctuating,
)
from engine_models.scene.loads import Loads
from engine_models.scene.scene import Clearances, Scene
from studies.judges.metrics import energy_balance_residual_J
from tests.helpers.arrays import joint_forces

SAMPLES = 10
#: A contact is noticed up to a step late, by chance: a slope is that of the mean square over several steps.
COARSE = (200, 2000)
DECADES = {
    coarse: tuple(round(coarse * factor) for factor in (1.0, 1.07, 1.13, 1.21, 1.29, 1.37))
    for coarse in COARSE
}
#: What chance leaves of a slope over one decade with six runs at each end.
ORDER_TOLERANCE = 0.25


def rigid_driven() -> Scene:
    """Set R with rigid walls, e = 0.5: the bounces end within 0.7 ms, and the pin follows the wall."""
    scene = RIGID_SCENES["rigid-driven-0.5mm"]()
    assert scene.clearance.B is not None
    room = scene.clearance.B.model_copy(update={"restitution": 0.5})
    return scene.model_copy(update={"end_time_s": 3e-3, "clearance": Clearances(B=room)})


def rigid_free() -> Scene:
    return RIGID_SCENES["rigid-free-0.5mm"]().model_copy(update={"end_time_s": 0.02})


def compliant_damped() -> Scene:
    return clearance_driven_damped().model_copy(update={"end_time_s": 3e-3})


def fluctuating_pivot() -> Scene:
    """Set R with room at the crank's pivot, its speed rising and falling by a tenth in the time given."""
    room = compliant_damped().clearance.B
    scene = ideal_fluctuating().model_copy(update={"clearance": Clearances(O=room)})
    return scene.model_copy(update={"end_time_s": 3e-3})


def loaded_crank_pin() -> Scene:
    """The compressor with room at the crank pin, and a spring and a constant force beside its gas."""
    scene, room = ideal_compressor(), compliant_damped().clearance.B
    assert scene.load.slider is not None
    more = {"force_N": 30.0, "spring_N_m": 2000.0, "free_position_m": 0.1, "viscous_N_s_m": 50.0}
    load = Loads(slider=scene.load.slider.model_copy(update=more))
    update = {"end_time_s": 6e-3, "load": load, "clearance": Clearances(A=room)}
    return scene.model_copy(update=update)


SCENES = {
    scene.__name__: scene
    for scene in (rigid_driven, rigid_free, compliant_damped, fluctuating_pivot, loaded_crank_pin)
}
_truths: dict[str, Trajectory] = {}


def truth(scene: Scene) -> Trajectory:
    """Return the reference's run, once for each scene."""
    key = scene.model_dump_json()
    if key not in _truths:
        step = 5e-6 if scene.drive.kind == "free" else 1e-6
        _truths[key] = ReferenceEngine().simulate(scene, RunSettings(step, SAMPLES))
    return _truths[key]


def run(scene: Scene, steps_per_sample: int, engine: PymunkEngine | None = None) -> Trajectory:
    settings = RunSettings(scene.end_time_s / (SAMPLES * steps_per_sample), SAMPLES)
    return (engine or PymunkEngine()).simulate(scene, settings)


def errors(scene: Scene, trajectory: Trajectory) -> dict[str, float]:
    """Return the largest errors of position, in m and rad, and velocity."""
    true = truth(scene)
    return {
        "position": float(np.abs(trajectory.position - true.position).max()),
        "velocity": float(np.abs(trajectory.velocity - true.velocity).max()),
    }


@pytest.mark.parametrize("name", SCENES)
def test_motion_tends_to_the_references_at_order_one(name: str) -> None:
    scene = SCENES[name]()
    mean = {}
    for coarse, steps in DECADES.items():
        error_of = [errors(scene, run(scene, n)) for n in steps]
        mean[coarse] = {key: np.sqrt(np.mean([f[key] ** 2 for f in error_of])) for key in error_of[0]}
    slope = {key: float(np.log10(mean[COARSE[0]][key] / mean[COARSE[1]][key])) for key in mean[COARSE[0]]}
    assert slope["position"] == pytest.approx(1.0, abs=ORDER_TOLERANCE), (slope, mean)
    assert slope["velocity"] == pytest.approx(1.0, abs=ORDER_TOLERANCE), (slope, mean)


@pytest.mark.parametrize("name", ["fluctuating_pivot", "loaded_crank_pin"])
def test_forces_torques_and_works_of_drives_and_loads_tend_to_the_references_at_order_one(name: str) -> None:
    scene = SCENES[name]()
    runs = [signals(trajectory) for trajectory in (truth(scene), *(run(scene, n) for n in COARSE))]
    for signal, true in runs[0].items():
        error = [np.abs(one[signal] - true).max() for one in runs[1:]]
        assert np.log10(error[0] / error[1]) == pytest.approx(1.0, abs=ORDER_TOLERANCE), (signal, error)


def signals(trajectory: Trajectory) -> dict[str, FloatArray]:
    """Return the forces, the torque and the works by name."""
    assert trajectory.driver_torque_N_m is not None
    assert trajectory.driver_work_J is not None
    return {
        "joint_force_N": joint_forces(trajectory),
        "driver_torque_N_m": trajectory.driver_torque_N_m,
        "driver_work_J": trajectory.driver_work_J,
        **trajectory.load_work_J,
    }


@pytest.mark.parametrize("name", ["rigid_driven", "rigid_free"])
def test_impulses_of_impacts_tend_to_the_references(name: str) -> None:
    scene = SCENES[name]()
    true, impacts = truth(scene).contacts["B"].impacts, run(scene, 3000).contacts["B"].impacts
    count = 5
    for part, tolerance in (
        ("time_s", 1e-3),
        ("approach_speed_m_s", 1e-2),
        ("normal_impulse_N_s", 1e-2),
        ("energy_lost_J", 2e-2),
    ):
        ratio = getattr(impacts, part)[:count] / getattr(true, part)[:count]
        assert ratio == pytest.approx(1, abs=tolerance), f"{part}: {ratio}"


def test_the_compliant_hook_tends_to_the_reference_on_the_standard_case() -> None:
    scene = clearance_driven_05().model_copy(update={"end_time_s": 3e-3})
    error_m = {n: errors(scene, run(scene, n))["position"] for n in (300, 3000)}
    assert error_m[300] < 1e-3, error_m  # the rod's angle is 12 times as far off as the slider
    assert error_m[3000] < 5e-6, error_m
    free = clearance_free().model_copy(update={"end_time_s": 0.02})
    assert errors(free, run(free, 3000))["position"] < 5e-6
    impacts, true = run(scene, 3000).contacts["B"].impacts, truth(scene).contacts["B"].impacts
    for part in ("duration_s", "approach_speed_m_s", "normal_impulse_N_s", "energy_lost_J"):
        ratio = getattr(impacts, part)[:4] / getattr(true, part)[:4]
        assert ratio == pytest.approx(1, abs=0.01), f"{part}: {ratio}"


def test_ten_sweeps_as_in_the_library_never_converge_on_the_free_scene() -> None:
    free, library = rigid_free(), PymunkEngine.out_of_the_box()
    few = [errors(free, run(free, n, library))["position"] for n in (300, 3000)]
    right = errors(free, run(free, 3000))["position"]
    assert few[1] > 0.5 * few[0] > 100 * right, (few, right)


def test_penetrations_taken_back_within_a_step_make_a_following_pin_flicker() -> None:
    scene = rigid_driven()
    contacts, residual = {}, {}
    for bias in (0.0, 1e-300):
        trajectory = run(scene, 600, PymunkEngine(collision_bias=bias))
        contacts[bias] = len(trajectory.contacts["B"].impacts.time_s)
        residual[bias] = np.abs(energy_balance_residual_J(scene, trajectory)).max()
    assert contacts[1e-300] < 20 < 1000 < contacts[0.0], contacts
    assert residual[0.0] > 3 * residual[1e-300], residual
