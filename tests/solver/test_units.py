"""The reference's results do not depend on units: powers of 4 in time, length and mass change no digit."""

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.scene.library import IDEAL_SCENES, SCENES
from engine_models.scene.scene import Scene
from tests.helpers.arrays import joint_forces
from tests.helpers.random_scenes import random_scene
from tests.helpers.units import Units, in_units

UNITS = [Units(4.0, 1.0, 1.0), Units(1.0, 1 / 16, 1.0), Units(1.0, 1.0, 64.0), Units(1 / 1024, 4.0, 1 / 4)]
METHODS = ["rk4", "dop853"]
SAMPLES = 20


def run(scene: Scene, method: str) -> Trajectory:
    """Run a scene by a method, RK4 in a thousand steps."""
    step = scene.end_time_s / 1000 if method == "rk4" else scene.end_time_s
    return make_engine("reference", method=method).simulate(scene, RunSettings(step, SAMPLES))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_an_ideal_run_is_the_same_bit_for_bit(name: str, method: str) -> None:
    scene = SCENES[name]()
    own = run(scene, method)
    for units in UNITS:
        other = run(in_units(scene, units), method)
        assert other.steps == own.steps
        length, angle = other.position[..., :2] / units.length, other.position[..., 2]
        np.testing.assert_array_equal(length, own.position[..., :2])
        np.testing.assert_array_equal(angle, own.position[..., 2])
        force = units.factor("force_N")
        np.testing.assert_array_equal(joint_forces(other) / force, joint_forces(own))


#: Library scenes and random ones, ended where round-off has not grown beyond what is allowed.
WITH_CONTACT = {
    "driven": (SCENES["clearance-driven-0.1mm"](), 0.006),
    "rigid": (SCENES["rigid-driven-0.1mm"](), 0.006),
    "a light crank that rubs": (random_scene(2, rigid=False), 0.014),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", WITH_CONTACT)
def test_a_run_with_contact_is_the_same_to_round_off(name: str, method: str) -> None:
    long, end = WITH_CONTACT[name]
    scene = long.model_copy(update={"end_time_s": end})
    own = run(scene, method)
    assert any(len(contact.impacts.time_s) for contact in own.contacts.values())
    for units in UNITS:
        other = run(in_units(scene, units), method)
        apart = np.abs(other.position[:, -1, 0] / units.length - own.position[:, -1, 0]).max()
        assert apart < 1e-12, f"{units}: {apart:.2g} m"
        # Error control at the edge of stability, where friction is stiff, rejects now and then by round-off.
        assert abs(other.steps - own.steps) <= 0.2 * own.steps
