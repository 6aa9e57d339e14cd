"""A run's own uncertainty covers its true error and is not absurdly large."""

import numpy as np
import pytest

from engine_models.convergence.own_uncertainty import simulate_with_uncertainty
from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.scene.library import CLEARANCE_SCENES, IDEAL_SCENES
from tests.helpers.arrays import joint_forces
from tests.helpers.crank_sliders import in_minimal_coordinates
from tests.helpers.engines import supporting
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES = 20
#: The solution that a run is held against is far sharper: what is left is its own uncertainty, which is below
#: a tenth here, and the truth's, which with clearance is 2 % of the error.
LEAST, MOST = 0.95, 1.25
#: Settings and longest step at which an engine's error is above round-off, and falls no faster than at order
#: 4: scipy's is set by its tolerance, in steps below these.
PLAIN: tuple[dict[str, object], float] = ({}, 2e-4)
COARSE: dict[str, tuple[dict[str, object], float]] = {
    "scipy": ({"method": "RK45", "rtol": 1e-8, "atol": 1e-10}, 5e-3),
}


@pytest.mark.parametrize("engine", supporting(IDEAL_SCENES["ideal-free"]()))
@pytest.mark.parametrize("name", ["ideal-free", "ideal-torque"])
def test_the_uncertainty_covers_the_true_error_of_an_ideal_scene(name: str, engine: str) -> None:
    scene = IDEAL_SCENES[name]().model_copy(update={"end_time_s": 0.1})
    settings, step = COARSE.get(engine, PLAIN)
    coarse = make_engine(engine, **settings)
    run, uncertainty = simulate_with_uncertainty(coarse, scene, RunSettings(step, SAMPLES))
    truth = exact(scene, SAMPLES)
    of_forces = np.stack([uncertainty[f"joint_{joint}_force_N"] for joint in scene.joints])
    for signal, found, error in (
        ("slider position", uncertainty["slider_position_m"], (run.position - truth.position)[:, -1, 0]),
        ("joint forces", of_forces, joint_forces(run) - joint_forces(truth)),
    ):
        ratio = found.max() / np.abs(error).max()
        assert LEAST < ratio < MOST, f"{signal}: uncertainty is {ratio:.6f} times the error"


def test_the_uncertainty_covers_the_true_error_with_clearance() -> None:
    scene = CLEARANCE_SCENES["clearance-driven-0.1mm"]().model_copy(update={"end_time_s": 0.002})
    run, uncertainty = simulate_with_uncertainty(make_engine("reference"), scene, RunSettings(1e-5, SAMPLES))
    truth = in_minimal_coordinates(scene, SAMPLES).position[:, -1, 0]
    ratio = uncertainty["slider_position_m"].max() / np.abs(run.position[:, -1, 0] - truth).max()
    assert LEAST < ratio < MOST, f"uncertainty is {ratio:.6f} times the error"
    assert uncertainty["contact_B_normal_force_N"].shape == ()
