"""Loads, springs and drives of all kinds in minimal coordinates, against the reference's multipliers."""

from functools import cache

import numpy as np
import pytest
from engine_models.heyoka.engine import HeyokaEngine

from engine_models.engine import Engine, RunSettings, Trajectory
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.reference.engine import ReferenceEngine
from engine_models.scipy_ivp.engine import ScipyEngine
from tests.engine_models.scipy_ivp.loaded_mechanisms import TEXTS, scene

SAMPLES = 20
ENGINES: dict[str, Engine] = {
    "scipy": ScipyEngine(rtol=1e-12, atol=1e-13, coordinates="minimal"),
    "heyoka": HeyokaEngine(step_tolerance=1e-15),
}
#: Errors in m and rad, and parts of the largest of forces and works: 9e-11 and 6e-9 are measured.
#: The reference and SciPy go over the kinks of a motor's table and of gas by straight lines: 8e-10 m.
#: With clearance at two pins, errors grow to 3e-9 m and 2e-7 of the forces within a few impacts.
POSITION, OVER_KINKS, PART = 2e-10, 3e-9, 1e-7
GROWN = {"floating": 100.0}


@cache
def reference(name: str) -> Trajectory:
    of = scene(name)
    return ReferenceEngine(method="dop853", step_tolerance=1e-13).simulate(of, RunSettings(1.0, SAMPLES))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", TEXTS)
def test_motion_forces_and_works_are_the_references(name: str, engine: str) -> None:
    if engine == "heyoka":
        pytest.importorskip("heyoka", reason="heyoka is not installed")
    of, other = scene(name), reference(name)
    own = ENGINES[engine].simulate(of, RunSettings(1.0, SAMPLES))
    off = np.abs(own.position - other.position).max()
    grown = GROWN.get(name, 1.0)
    assert off < grown * (OVER_KINKS if name == "engine" else POSITION), f"{off:.1e}"
    for column in ("joint_force_N", "guide_force_N", "load_work_J"):
        found, true = getattr(own, column), getattr(other, column)
        scale = max((np.abs(value).max() for value in true.values()), default=0.0)
        for key, value in true.items():
            np.testing.assert_allclose(found[key], value, rtol=0, atol=grown * PART * scale, err_msg=key)
    if other.driver_torque_N_m is not None and own.driver_torque_N_m is not None:
        scale = np.abs(other.driver_torque_N_m).max()
        np.testing.assert_allclose(
            own.driver_torque_N_m, other.driver_torque_N_m, rtol=0, atol=grown * PART * scale
        )
    residual = np.abs(energy_balance_residual_J(of, own)).max()
    assert residual <= 1e-10 * energy_in_play_J(of, own)
