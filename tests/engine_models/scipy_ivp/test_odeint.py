"""LSODA by ``odeint``: the method that ``solve_ivp`` has, in fewer calls of Python."""

from typing import Literal, get_args

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings, SimulationFailed, UnsupportedScene
from engine_models.scene.library import SCENES
from engine_models.scipy_ivp.engine import ScipyEngine
from engine_models.scipy_ivp.model import Derivative
from studies.judges.converged_truth import converged

Coordinates = Literal["absolute", "minimal"]
SAMPLES = 24
#: Errors over a second of ideal-free were 60 to 300 times the tolerance, measured; ten times that.
ERROR_PER_TOLERANCE = 3e3


@pytest.mark.parametrize("coordinates", get_args(Coordinates))
@pytest.mark.parametrize("tolerance", [1e-7, 1e-10])
def test_odeint_is_as_accurate_as_its_tolerance(coordinates: Coordinates, tolerance: float) -> None:
    scene = SCENES["ideal-free"]()
    engine = ScipyEngine(method="odeint", coordinates=coordinates, rtol=tolerance, atol=tolerance)
    run = engine.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
    truth, _ = converged(scene, SAMPLES)
    error = np.abs(run.slider_position_m - truth.slider_position_m).max()
    assert error < ERROR_PER_TOLERANCE * tolerance, f"{error:.1e} m"


def test_the_evaluations_told_are_the_calls_of_the_right_hand_side(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = 0
    right = Derivative.right

    def counted(self: Derivative, t: float, y: FloatArray) -> FloatArray:
        nonlocal calls
        calls += 1
        return right(self, t, y)

    monkeypatch.setattr(Derivative, "right", counted)
    scene = SCENES["ideal-free"]()
    run = ScipyEngine(method="odeint").simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
    assert run.evaluations == calls


def test_odeint_refuses_contacts_and_says_what_has_events() -> None:
    with pytest.raises(UnsupportedScene, match=r"no events.*DOP853 or LSODA"):
        ScipyEngine(method="odeint").check(SCENES["clearance-free-0.5mm"]())


def test_a_run_of_more_steps_than_allowed_between_samples_fails_as_one() -> None:
    scene = SCENES["ideal-free"]()
    with pytest.raises(SimulationFailed, match="odeint stopped"):
        ScipyEngine(method="odeint", max_evaluations=20).simulate(scene, RunSettings(1.0, 2))
