"""Any mechanism by SciPy's integrators."""

import numpy as np
import pytest

from engine_models.convergence.step_halving import simulate_to_tolerance
from engine_models.engine import RunSettings
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.scipy_ivp.engine import ScipyEngine
from tests.engines.mechanism_texts import ENDS, TEXTS, scene

#: Largest errors in m and rad: 1.5e-10 measured with ideal joints, 2.7e-10 after 37 impacts.
IDEAL, LOOSE = 3e-10, 1e-9


@pytest.mark.parametrize("name", TEXTS)
def test_scipy_ends_where_an_independent_integration_does(name: str) -> None:
    of = scene(TEXTS[name])
    run = ScipyEngine(rtol=1e-12, atol=1e-13).simulate(of, RunSettings(of.end_time_s, 20))
    off = np.abs(run.position[-1] - [ENDS[name][body] for body in of.mechanism.names]).max()
    assert off < (LOOSE if of.joints_with_clearance else IDEAL)
    residual = np.abs(energy_balance_residual_J(of, run)).max()
    assert residual <= 1e-9 * energy_in_play_J(of, run)


def test_a_tolerance_is_kept_by_scipy_too() -> None:
    of = scene(TEXTS["quick-return"])
    run = simulate_to_tolerance(ScipyEngine(), of, 1e-8, 20)
    assert abs(run.position[-1, -1, 0] - ENDS["quick-return"]["ram"][0]) <= 1e-8
