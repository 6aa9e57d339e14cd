"""Steps that are shorter in contact than in flight: the same order, and far fewer of them."""

from typing import Any

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory, UnsupportedScene
from engine_models.pymunk.engine import PymunkEngine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES, clearance_free
from engine_models.scene.scene import Clearances, Scene
from tests.helpers.arrays import joint_forces

SAMPLES = 6
#: Touch and release fall anywhere within a step: an error is the mean square of several steps.
FACTORS = (1.0, 1.07, 1.13, 1.21, 1.29, 1.37)
#: What chance leaves of a slope over a factor of 8 in the step; measured 2.00.
ORDER_TOLERANCE = 0.15


def hertzian(stiffness: float) -> Scene:
    """Return the free scene with a smooth lossless law, four contacts in 12 ms."""
    room = clearance_free().clearance.B
    assert room is not None
    law = {"law": "hertz", "stiffness": stiffness}
    none = dict.fromkeys(("restitution", "young_modulus_Pa", "poisson_ratio"))
    changed = Clearances(B=room.model_copy(update={**none, **law}))
    return clearance_free().model_copy(update={"clearance": changed, "end_time_s": 0.012})


def truth(scene: Scene) -> Trajectory:
    engine = ReferenceEngine(method="dop853", step_tolerance=1e-13)
    return engine.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))


def errors_and_steps(scene: Scene, true: Trajectory, shorter: float, steps: int) -> tuple[float, float]:
    """Return the mean square error of the slider's position in m, and the mean number of steps."""
    engine, squares, taken = PymunkEngine(shorter_in_contact=shorter), [], []
    for factor in FACTORS:
        run = engine.simulate(scene, RunSettings(scene.end_time_s / (steps * factor), SAMPLES))
        squares.append(np.square(run.position[:, -1, 0] - true.position[:, -1, 0]).max())
        taken.append(run.steps)
    return float(np.sqrt(np.mean(squares))), float(np.mean(taken))


def test_the_order_is_two_in_flight_and_contact() -> None:
    scene = hertzian(1e11)
    true = truth(scene)
    (coarse, _), (fine, _) = (errors_and_steps(scene, true, 16.0, steps) for steps in (1600, 12800))
    assert np.log(coarse / fine) / np.log(8) == pytest.approx(2.0, abs=ORDER_TOLERANCE), (coarse, fine)


def test_brief_contacts_take_an_eighth_of_the_steps_for_a_smaller_error() -> None:
    scene = hertzian(1e13)
    true = truth(scene)
    one, steps_of_one_length = errors_and_steps(scene, true, 1.0, 50000)
    shorter, steps = errors_and_steps(scene, true, 16.0, 4800)
    assert shorter < one, (shorter, one)
    assert steps < steps_of_one_length / 8, (steps, steps_of_one_length)


def test_samples_are_landed_on_and_tell_forces_and_impulses() -> None:
    scene = hertzian(1e11)
    true = truth(scene)
    run = PymunkEngine(shorter_in_contact=16.0).simulate(scene, RunSettings(1e-6, SAMPLES))
    assert np.array_equal(run.time_s, true.time_s)
    own, other = joint_forces(run), joint_forces(true)
    assert own == pytest.approx(other, abs=1e-2 * np.abs(other).max())
    assert np.abs(run.velocity - true.velocity).max() < 1e-3 * np.abs(true.velocity).max()
    for part, accuracy in (("time_s", 1e-4), ("duration_s", 0.02), ("normal_impulse_N_s", 1e-4)):
        own, other = (getattr(one.contacts["B"].impacts, part) for one in (run, true))
        assert own == pytest.approx(other, rel=accuracy), part


def test_the_driver_does_the_work_that_the_energy_needs() -> None:
    scene = SCENES["clearance-driven-0.5mm"]().model_copy(update={"end_time_s": 2e-3})
    true = truth(scene)
    run = PymunkEngine(shorter_in_contact=8.0).simulate(scene, RunSettings(5e-7, SAMPLES))
    assert run.driver_work_J is not None
    assert true.driver_work_J is not None
    assert run.driver_work_J == pytest.approx(true.driver_work_J, abs=2e-3 * np.abs(true.driver_work_J).max())


@pytest.mark.parametrize(
    ("name", "settings", "reason"),
    [
        ("clearance-start-up", {}, "got drive.kind = ramp"),
        ("rigid-driven-0.5mm", {}, "got clearance.B.law = rigid"),
        ("clearance-driven-AB", {"contact": "rigid"}, "got clearance.A.law = rigid, clearance.B.law = rigid"),
        ("clearance-free-0.5mm", {"half_kick_start": False}, "got half_kick_start = False"),
    ],
)
def test_what_needs_steps_of_one_length_is_refused(name: str, settings: dict[str, Any], reason: str) -> None:
    engine = PymunkEngine(shorter_in_contact=8.0, **settings)
    with pytest.raises(UnsupportedScene, match=reason):
        engine.check(SCENES[name]())


def test_without_a_contact_it_is_the_run_of_one_length() -> None:
    scene = SCENES["ideal-driven"]()
    one, two = (
        PymunkEngine(shorter_in_contact=shorter).simulate(scene, RunSettings(1e-5, 10))
        for shorter in (1.0, 8.0)
    )
    assert one.steps == two.steps
    assert np.abs(one.position - two.position).max() < 1e-11
