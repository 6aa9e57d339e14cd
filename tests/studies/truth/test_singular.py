"""Where the truth has no answer it says so: singular loops, open starts."""

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed
from engine_models.exudyn.engine import ExudynEngine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.format import SceneError
from engine_models.scene.scene import Scene
from studies.judges.columns import sample_columns
from studies.judges.converged_truth import CONFIRMING, TRUE
from studies.judges.run_cache import Solver
from tests.engines.mechanism_texts import FOUR_BAR, four_bars, scene
from tests.helpers.starts import started_from


@pytest.mark.parametrize("count", [1, 2])
def test_no_step_passes_a_singular_position(count: int) -> None:
    """All loops of a row are singular at once, where the sign of their determinant need not change."""
    with pytest.raises(SimulationFailed, match=r"at t = 0\.7[01].* s: its loops are singular"):
        TRUE.simulate(scene(four_bars(count, 0.8)), RunSettings(1.0, 1))


#: Three bars from a bearing with clearance; at the end other coordinates depend on the rest than before.
CHAIN = """
name = "chain"
end_time_s = 0.004
gravity_m_s2 = 9.81
observe = "B.y"
ground.pins_m = { O = 0.0 }
clearance.O = { radial_clearance_m = 2e-4, bearing_radius_m = 0.015, law = "linear", stiffness = 1e8 }
[body]
first = { pins_m = { O = 0.0, A = 0.2 }, mass_kg = 1.0, inertia_kg_m2 = 0.02, centre_of_mass_m = 0.1 }
second = { pins_m = { A = 0.0, B = 0.4 }, mass_kg = 1.0, inertia_kg_m2 = 0.02, centre_of_mass_m = 0.2 }
third = { pins_m = { B = 0.0 }, mass_kg = 1.0, inertia_kg_m2 = 0.02, centre_of_mass_m = 0.1 }
[start]
angle_rad = { first = -0.9, second = 1.1, third = 0.7 }
hold = ["first", "second", "third"]
speed_rad_s = { first = 6.0, second = 6.0, third = 6.0 }
"""


@pytest.mark.parametrize("third_rad", [0.55, 1.45, 1.6, 2.65, 4.0])
def test_a_new_choice_of_coordinates_is_no_singular_position(third_rad: float) -> None:
    of = scene(CHAIN, start__angle_rad__third=third_rad)
    run, other = (solver.simulate(of, RunSettings(of.end_time_s, 1)) for solver in (TRUE, CONFIRMING))
    assert np.abs(run.position - other.position).max() < 1e-12


def told(off_m: float) -> Scene:
    """Return a four-bar that begins with told states, its rocker a little aside."""
    of = scene(FOUR_BAR)
    run = TRUE.simulate(of, RunSettings(of.end_time_s, 1))
    position = run.position[0].copy()
    position[2, 0] += off_m
    return started_from(of, position, run.velocity[0])


def test_a_told_start_of_nine_digits_is_closed_and_one_of_fewer_is_refused() -> None:
    exact, near = (TRUE.simulate(told(off), RunSettings(1.0, 1)) for off in (0.0, 2e-10))
    assert np.abs(near.position - exact.position).max() < 1e-8
    with pytest.raises(SceneError, match="open by 2e-09 m"):
        told(2e-9)


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
