"""Random crank-sliders with clearance, for which nothing was tuned, held against the independent solution.

They have several joints with clearance, light links, friction, and walls between which bounces do not end.
"""

import numpy as np
import pytest

from engine_models.convergence.own_uncertainty import simulate_with_uncertainty
from engine_models.convergence.step_halving import simulate_to_tolerance
from engine_models.engine import RunSettings, Trajectory
from engine_models.scene.parts import AnyScene
from studies.command.options import DEFAULT_STEP_S, read_engine
from studies.judges.converged_truth import converged, followed
from studies.judges.metrics import errors, uncertainties
from tests.helpers.random_scenes import random_scene

#: Seeds, and whether walls are rigid.
DRAWN = [*((seed, False) for seed in (2, 3, 9, 13, 57, 61, 73, 117)), *((s, True) for s in (12, 16, 40, 72))]
SAMPLES, TOLERANCE_M, POSITION = 20, 1e-7, "slider_position_error_m"


def error_m(scene: AnyScene, run: Trajectory) -> float:
    """Return the slider's largest error, less what the solution is uncertain by."""
    truth, repeats = converged(scene, SAMPLES)
    known_to = uncertainties(scene, truth, list(repeats))["slider_position_uncertainty_m"]
    assert known_to < TOLERANCE_M / 2
    return float(np.max(errors(scene, run, truth)[POSITION])) - known_to


@pytest.mark.accuracy
@pytest.mark.parametrize(("seed", "rigid"), DRAWN)
def test_tolerance_and_bound_of_the_reference_hold(seed: int, rigid: bool) -> None:
    scene = random_scene(seed, rigid)
    predictable = (followed(scene, SAMPLES) - 1) / SAMPLES
    scene = scene.replace("end_time_s", 0.5 * predictable * scene.end_time_s)
    sharp = simulate_to_tolerance(
        read_engine("reference", {}, to_tolerance=True), scene, TOLERANCE_M, SAMPLES
    )
    assert error_m(scene, sharp) < TOLERANCE_M
    settings = RunSettings(min(DEFAULT_STEP_S, scene.end_time_s), SAMPLES)
    run, bounds = simulate_with_uncertainty(read_engine("reference", {}), scene, settings)
    assert error_m(scene, run) < float(bounds["slider_position_m"])
