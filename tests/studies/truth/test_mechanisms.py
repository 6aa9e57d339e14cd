"""The truth of mechanisms by closed forms."""

import math

import numpy as np
import pytest

from engine_models.engine import RunSettings
from engine_models.exudyn.engine import ExudynEngine
from engine_models.reference.engine import ReferenceEngine
from studies.extremes import gallery
from studies.judges.columns import sample_columns
from studies.judges.converged_truth import CONFIRMING, TRUE
from studies.judges.metrics import energy_balance_residual_J
from studies.judges.run_cache import Solver
from tests.engines.mechanism_texts import scene


def test_a_rod_that_turns_while_the_crank_swings_changes_coordinates() -> None:
    """With a rod of 0.8 crank lengths neither angle makes the other follow all the way round."""
    of = gallery()["L = 0.8 r, free"].scene
    run, absolute = (solver.simulate(of, RunSettings(of.end_time_s, 40)) for solver in (TRUE, CONFIRMING))
    assert abs(run.position[-1, 1, 2]) > 2 * math.pi
    off = np.abs(run.position[:, 2, 0] - absolute.position[:, 2, 0]).max()
    assert off < 1e-9, f"off by {off:.1e} m"
    assert np.abs(energy_balance_residual_J(of, run)).max() < 1e-12


#: A spring of free length 0 whose ends are at one place at the start, from a cart to the ground.
COINCIDENT = """
name = "coincident"
end_time_s = 0.01
gravity_m_s2 = 10.0
observe = "P.x"
ground.pins_m = { O = [0.0, 0.0] }
body.cart = { pins_m = { S = 0.0 }, mass_kg = 1.0, inertia_kg_m2 = 1.0 }
start = { angle_rad = { pendulum = 0.0 }, position_m = { rail = 0.0 }, hold = ["pendulum", "rail"] }
drive.kind = "free"
guide.rail = { body = "cart", pin = "S" }
[body.pendulum]
pins_m = { S = 0.0, P = 0.5 }
mass_kg = 1.0
inertia_kg_m2 = 1.0
centre_of_mass_m = 0.5
[spring.s]
between = ["ground.O", "cart.S"]
stiffness_N_m = 10.0
free_length_m = 0.0
"""


@pytest.mark.parametrize("solver", [TRUE, ReferenceEngine(), ExudynEngine()], ids=str)
def test_a_spring_without_a_length_does_not_pull(solver: Solver) -> None:
    """The pendulum's angular acceleration is m g l/(I + m l^2) = 4: of 20 N the rail bears 18."""
    of = scene(COINCIDENT)
    columns = sample_columns(of, solver.simulate(of, RunSettings(1e-4, 2)))
    assert all(np.isfinite(column).all() for column in columns.values())
    expected = {"spring_s_force_N": 0.0, "cart_acceleration_x_m_s2": 0.0, "ground_force_x_N": 0.0}
    for name, value in (expected | {"ground_force_y_N": -18.0}).items():
        assert columns[name][0] == pytest.approx(value, abs=1e-9), name
