"""Methods whose loop over steps is compiled: LSODA by ``odeint``, and DOP853 by ``ode``'s integrator."""

from typing import Literal, get_args

import numpy as np
import pytest

from engine_models.engine import FloatArray, RunSettings, SimulationFailed, UnsupportedScene
from engine_models.scene.library import SCENES
from engine_models.scipy_ivp.derivative import Derivative
from engine_models.scipy_ivp.engine import ScipyEngine
from studies.judges.converged_truth import converged

Method = Literal["odeint", "dop853"]
METHODS = get_args(Method)
SAMPLES = 24
#: Errors over a second of ideal-free were 60 to 300 times the tolerance, of DOP853 0.1 to 30 times, measured;
#: ten times the most.
ERROR_PER_TOLERANCE = 3e3


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tolerance", [1e-7, 1e-10])
def test_errors_are_of_the_tolerances_size(method: Method, tolerance: float) -> None:
    scene = SCENES["ideal-free"]()
    engine = ScipyEngine(method=method, rtol=tolerance, atol=tolerance)
    run = engine.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
    truth, _ = converged(scene, SAMPLES)
    error = np.abs(run.position[:, -1, 0] - truth.position[:, -1, 0]).max()
    assert error < ERROR_PER_TOLERANCE * tolerance, f"{error:.1e} m"


def counting(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return a list of the times at which SciPy calls the right-hand side that nobody watches."""
    calls, right = list[float](), Derivative.right

    def counted(self: Derivative, t: float, y: FloatArray) -> FloatArray:
        calls.append(t)
        return right(self, t, y)

    monkeypatch.setattr(Derivative, "right", counted)
    return calls


@pytest.mark.parametrize("name", ["ideal-free", "ideal-compressor"])
def test_samples_of_dop853_change_no_step(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The recorded run has the steps of the bare one, which goes straight to its end, to the last bit."""
    scene, calls = SCENES[name](), counting(monkeypatch)
    engine, whole = ScipyEngine(method="dop853", rtol=1e-8, atol=1e-8), None
    for samples in (SAMPLES, 7, 1):
        run = engine.simulate(scene, RunSettings(scene.end_time_s, samples))
        engine.bare_run(scene, RunSettings(scene.end_time_s, samples))  # once it is watched
        calls.clear()
        bare = engine.bare_run(scene, RunSettings(scene.end_time_s, samples))
        np.testing.assert_array_equal(bare.position, run.position[-1])
        whole = run.steps if whole is None else whole
        assert run.steps == whole
        # 12 evaluations in an accepted step, 11 in one that is not, and two to begin with.
        assert (len(calls) - 2 - 12 * run.steps) % 11 == 0


@pytest.mark.parametrize("method", METHODS)
def test_contacts_are_refused_with_what_has_events(method: Method) -> None:
    with pytest.raises(UnsupportedScene, match=rf"{method} has no events.*DOP853 or LSODA"):
        ScipyEngine(method=method).check(SCENES["clearance-free-0.5mm"]())


@pytest.mark.parametrize("method", METHODS)
def test_a_run_of_more_steps_than_allowed_fails_as_one(method: Method) -> None:
    scene = SCENES["ideal-free"]()
    limited = ScipyEngine(method=method, max_evaluations=20)
    with pytest.raises(SimulationFailed, match=f"{method} stopped"):
        limited.simulate(scene, RunSettings(1.0, 2))
    with pytest.raises(SimulationFailed, match=f"{method} stopped"):
        limited.bare_run(scene, RunSettings(1.0, 1))
