"""Any mechanism by SciPy's integrators, in multipliers and in minimal coordinates."""

import re
from typing import Literal

import numpy as np
import pytest

from engine_models.convergence.step_halving import simulate_to_tolerance
from engine_models.engine import RunSettings, SimulationFailed
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.scipy_ivp.engine import ScipyEngine
from tests.engine_models.reference.mechanism_texts import ENDS, TEXTS, scene
from tests.engine_models.scipy_ivp.loaded_mechanisms import FLAT, FLAT_S, FLAT_WITHIN_S
from tests.engine_models.scipy_ivp.loaded_mechanisms import scene as loaded

#: Largest errors in m and rad: 1.5e-10 measured with ideal joints, 2.7e-10 after 37 impacts.
IDEAL, LOOSE = 3e-10, 1e-9


@pytest.mark.parametrize("coordinates", ["absolute", "minimal"])
@pytest.mark.parametrize("name", TEXTS)
def test_scipy_ends_where_an_independent_integration_does(
    name: str, coordinates: Literal["absolute", "minimal"]
) -> None:
    of = scene(TEXTS[name])
    run = ScipyEngine(rtol=1e-12, atol=1e-13, coordinates=coordinates).simulate(
        of, RunSettings(of.end_time_s, 20)
    )
    off = np.abs(run.position[-1] - [ENDS[name][body] for body in of.mechanism.names]).max()
    assert off < (LOOSE if of.joints_with_clearance else IDEAL)
    residual = np.abs(energy_balance_residual_J(of, run)).max()
    assert residual <= 1e-9 * energy_in_play_J(of, run)


def test_a_tolerance_is_kept_by_scipy_too() -> None:
    of = scene(TEXTS["quick-return"])
    run = simulate_to_tolerance(ScipyEngine(), of, 1e-8, 20)
    assert abs(run.position[-1, -1, 0] - ENDS["quick-return"]["ram"][0]) <= 1e-8


def test_loops_of_compiled_methods_say_what_takes_events() -> None:
    of = loaded("swinging")
    for method in ("odeint", "dop853"):
        with pytest.raises(
            SimulationFailed, match=r"become independent, which takes events: method = DOP853"
        ):
            ScipyEngine(method=method, coordinates="minimal").simulate(of, RunSettings(of.end_time_s, 20))


@pytest.mark.parametrize("rtol", [1e-3, 1e-7, 1e-11])
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau"])
def test_a_parallelogram_ends_where_it_is_flat(
    method: Literal["DOP853", "RK45", "Radau"], rtol: float
) -> None:
    engine = ScipyEngine(method=method, rtol=rtol, atol=rtol / 100, coordinates="minimal")
    with pytest.raises(SimulationFailed, match="singular position") as refused:
        engine.simulate(scene(FLAT), RunSettings(1.0, 20))
    (found,) = re.findall(r"t = (\S+) s", str(refused.value))
    assert abs(float(found) - FLAT_S) < FLAT_WITHIN_S, f"{float(found) - FLAT_S:.1e} s"
