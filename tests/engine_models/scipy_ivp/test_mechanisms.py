"""Any mechanism by SciPy's integrators, in multipliers, where an independent integration ends."""

import numpy as np
import pytest

from engine_models.convergence.step_halving import simulate_to_tolerance
from engine_models.engine import RunSettings, UnsupportedScene
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.scipy_ivp.engine import ScipyEngine
from tests.engine_models.reference.mechanism_texts import ENDS, OFFSET_CRANK_SLIDER, TEXTS, scene

SHARP = ScipyEngine(rtol=1e-12, atol=1e-13)
#: Largest errors in m and rad: 5.9e-11 measured with ideal joints, 1.5e-10 after 37 impacts.
IDEAL, LOOSE = 2e-10, 1e-9


@pytest.mark.parametrize("name", TEXTS)
def test_scipy_ends_where_an_independent_integration_does(name: str) -> None:
    of = scene(TEXTS[name])
    run = SHARP.simulate(of, RunSettings(of.end_time_s, 20))
    off = np.abs(run.position[-1] - [ENDS[name][body] for body in of.mechanism.names]).max()
    assert off < (LOOSE if of.joints_with_clearance else IDEAL)
    residual = np.abs(energy_balance_residual_J(of, run)).max()
    assert residual <= 1e-9 * energy_in_play_J(of, run)


def test_a_tolerance_is_kept_by_scipy_too() -> None:
    of = scene(TEXTS["quick-return"])
    run = simulate_to_tolerance(ScipyEngine(), of, 1e-8, 20)
    assert abs(run.position[-1, -1, 0] - ENDS["quick-return"]["ram"][0]) <= 1e-8


def test_minimal_coordinates_are_of_plain_crank_sliders() -> None:
    for text in (TEXTS["four-bar"], OFFSET_CRANK_SLIDER):
        with pytest.raises(UnsupportedScene, match="coordinates = minimal runs crank-sliders"):
            ScipyEngine(coordinates="minimal").check(scene(text))
