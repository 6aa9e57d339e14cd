"""Any mechanism by heyoka, where an independent integration ends; and what ends at a singular position."""

import re

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.heyoka.engine import HeyokaEngine
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.scene.library import SCENES
from tests.engine_models.reference.mechanism_texts import ENDS, FOUR_BAR, TEXTS, scene
from tests.engine_models.scipy_ivp.loaded_mechanisms import FLAT, FLAT_S, FLAT_WITHIN_S
from tests.engine_models.scipy_ivp.loaded_mechanisms import scene as loaded

pytest.importorskip("heyoka", reason="heyoka is not installed")

SHARP = HeyokaEngine(step_tolerance=1e-15)
#: In m and rad, what the independent integration leaves: 2e-12 is measured.
END = 1e-11


@pytest.mark.parametrize("name", TEXTS)
def test_heyoka_ends_where_an_independent_integration_does(name: str) -> None:
    of = scene(TEXTS[name])
    run = SHARP.simulate(of, RunSettings(of.end_time_s, 20))
    off = np.abs(run.position[-1] - [ENDS[name][body] for body in of.mechanism.names]).max()
    assert off < END, f"{off:.1e}"
    residual = np.abs(energy_balance_residual_J(of, run)).max()
    assert residual <= 1e-12 * energy_in_play_J(of, run)


def test_a_tolerance_buys_accuracy_where_other_coordinates_become_independent() -> None:
    of = loaded("swinging")
    settings = RunSettings(of.end_time_s, 20)
    true = SHARP.simulate(of, settings).position
    off = [
        np.abs(HeyokaEngine(step_tolerance=t).simulate(of, settings).position - true).max()
        for t in (1e-5, 1e-9, 1e-13)
    ]
    assert off[1] < off[0] / 1e3, f"{off}"
    assert off[2] < off[1] / 1e3, f"{off}"


def test_a_singular_position_ends_a_run_with_its_time() -> None:
    scene = SCENES["ideal-free"]()
    scene = scene.replace({"rod.length_m": scene.crank.length_m, "rod.centre_of_mass_m": 0.02})
    with pytest.raises(SimulationFailed, match=r"ends at t = 0\.0\d+ s: the mechanism is at a singular"):
        HeyokaEngine().simulate(scene, RunSettings(1.0, 20))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-8, 1e-15])
def test_a_parallelogram_ends_where_it_is_flat(tolerance: float) -> None:
    with pytest.raises(SimulationFailed, match="singular position") as refused:
        HeyokaEngine(step_tolerance=tolerance).simulate(scene(FLAT), RunSettings(1.0, 20))
    (found,) = re.findall(r"t = (\S+) s", str(refused.value))
    assert abs(float(found) - FLAT_S) < FLAT_WITHIN_S, f"{float(found) - FLAT_S:.1e} s"


def test_a_mechanism_whose_motion_is_prescribed_is_refused() -> None:
    driven = FOUR_BAR + '[drive]\nkind = "constant-speed"\nbody = "crank"\n'
    with pytest.raises(UnsupportedScene, match="no ODE to integrate"):
        HeyokaEngine().check(scene(driven))
