"""The truth of any mechanism: published and independent ends, and closed forms."""

import math
from types import ModuleType

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from studies.running.closure import closure

from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory
from engine_models.exudyn.engine import ExudynEngine
from engine_models.mechanics.states import observed
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.parts import AnyScene
from studies.command.trajectory_table import sample_columns
from studies.extremes import gallery
from studies.judges.converged_truth import COLLOCATION, EXTRAPOLATION
from studies.judges.metrics import energy_balance_residual_J
from studies.truth import equations, motion, rigid_walls, stepping
from studies.truth.solver import TrueSolver
from tests.engines.mechanism_texts import (
    ENDS,
    SCOTCH_YOKE,
    TEXTS,
    four_bars,
    scene,
)
from tests.studies.truth.closed_forms.wheels import turning_rod

METHODS = (COLLOCATION, EXTRAPOLATION)
#: Twice to ten times what is measured, with round-off of the integration that the ends come from.
ENDS_WITHIN = {
    "crank-slider": 2e-11,
    "offset-crank-slider": 2e-11,
    "four-bar": 2e-12,
    "andrews": 5e-12,
    "scotch-yoke": 3e-13,
    "quick-return": 1e-13,
    "v-twin": 1e-12,
    "four-bar-clearance": 1e-10,
    "crank-slider-clearance": 2e-12,
}


def solved(of: AnyScene, solver: TrueSolver = COLLOCATION, samples: int = 40) -> Trajectory:
    return solver.simulate(of, RunSettings(of.end_time_s, samples))


@pytest.mark.parametrize("solver", METHODS, ids=lambda solver: solver.method)
@pytest.mark.parametrize("name", TEXTS)
def test_it_ends_where_another_integration_ends(name: str, solver: TrueSolver) -> None:
    of = scene(TEXTS[name])
    run = solved(of, solver, 1)
    expected = np.array([ENDS[name][body] for body in of.mechanism.names])
    off = np.abs(run.position[-1] - expected).max()
    assert off < ENDS_WITHIN[name], f"off by {off:.1e}"
    if name == "four-bar-clearance":
        assert len(run.contacts["B"].impacts.time_s) == 36, "and one more that has not ended"


def test_andrews_squeezer_has_the_published_angles() -> None:
    """Those of the IVP test set at 0.03 s; they are right to 2.7e-10 of an angle."""
    of = scene(TEXTS["andrews"])
    angle = dict(zip(of.mechanism.names, solved(of, samples=1).position[-1, :, 2].tolist(), strict=True))
    found = {
        "beta": (angle["K1"], 15.81077119629904),
        "Theta": (angle["K2"] - angle["K1"], -15.75637105984298),
        "gamma": (angle["K3"], 0.04082224013073101),
        "phi": (angle["K4"] - angle["K5"], -0.5347301163226948),
        "delta": (angle["K5"], 0.5244099658805304),
        "Omega": (angle["K6"] - angle["K7"], 0.5347301163226948),
        "epsilon": (angle["K7"], 1.048080741042263),
    }
    for name, (mine, published) in found.items():
        off = abs(mine / published - 1)
        # gamma is the difference of the others: its relative error is their absolute one.
        assert off < (3e-9 if name == "gamma" else 5e-10), f"{name} off by {off:.1e} of it"


DOUBLE_PENDULUM = """
name = "double-pendulum"
end_time_s = 10.0
gravity_m_s2 = 9.81
observe = "B.x"
ground.pins_m = { O = 0.0 }
[body]
arm = { pins_m = { O = 0.0, A = 1.0 }, centre_of_mass_m = 1.0, mass_kg = 1.0, inertia_kg_m2 = 0.1 }
tip = { pins_m = { A = 0.0, B = 0.4 }, centre_of_mass_m = 0.4, mass_kg = 0.2, inertia_kg_m2 = 0.01 }
[start]
angle_rad = { arm = 0.0, tip = 0.0 }
speed_rad_s = { arm = 0.0, tip = 0.0 }
"""


def test_a_double_pendulum_swings_as_scipy_integrates_it() -> None:
    """DOP853 at 1e-12: angles of the first arm, and of the second against it, and their speeds."""
    run = solved(scene(DOUBLE_PENDULUM), samples=1)
    (first, second), (rate, other) = run.position[-1, :, 2], run.velocity[-1, :, 2]
    found = first, second - first, rate, other - rate
    np.testing.assert_allclose(found, (-0.449808, 2.722998, 2.358602, 9.483477), rtol=0, atol=2e-6)


def test_a_row_of_four_bars_is_a_pendulum_up_to_its_singular_position() -> None:
    """theta'' = -(G/I) cos theta, by links of one length; at theta = 0, after 0.717 s, loops are singular.

    There are two ways on from there, and round-off would choose: the truth says that it does not know.
    """
    count, end_s = 3, 0.7
    inertia, weight = (count + 1) / 3 + count, 9.81 * ((count + 1) / 2 + count)
    swing = solve_ivp(
        lambda _, y: [y[1], -weight / inertia * math.cos(y[0])],
        (0.0, end_s),
        [math.pi / 2, -1.0],
        "DOP853",
        rtol=1e-13,
        atol=1e-14,
    )
    angles = solved(scene(four_bars(count, end_s)), samples=1).position[-1, : count + 1, 2]
    off = np.abs(angles - swing.y[0, -1]).max()
    assert off < 1e-11, f"off by {off:.1e} rad"
    with pytest.raises(SimulationFailed, match=r"step.*by t = 0\.7084"):
        TrueSolver("extrapolation", 1e-14).simulate(scene(four_bars(1, 0.8)), RunSettings(1.0, 1))


@pytest.mark.parametrize("solver", METHODS, ids=lambda solver: solver.method)
def test_a_rod_that_turns_while_the_crank_swings_changes_coordinates(solver: TrueSolver) -> None:
    """With a rod of 0.8 crank lengths neither angle makes the other follow all the way round."""
    of = gallery()["L = 0.8 r, free"].scene
    run = solved(of, solver)
    assert abs(run.position[-1, 1, 2]) > 2 * math.pi
    off = np.abs(run.position[:, 2, 0] - turning_rod(of, run.time_s)).max()
    assert off < 1e-9, f"off by {off:.1e} m"  # by DOP853 at 1e-12
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


@pytest.mark.parametrize("solver", [*METHODS, ReferenceEngine(), ExudynEngine()], ids=str)
def test_a_spring_without_a_length_does_not_pull(solver: TrueSolver | Engine) -> None:
    """The pendulum's angular acceleration is m g l/(I + m l^2) = 4: of 20 N the rail bears 18."""
    of = scene(COINCIDENT)
    columns = sample_columns(of, solver.simulate(of, RunSettings(1e-4, 2)))
    assert all(np.isfinite(column).all() for column in columns.values())
    expected = {"spring_s_force_N": 0.0, "cart_acceleration_x_m_s2": 0.0, "ground_force_x_N": 0.0}
    for name, value in (expected | {"ground_force_y_N": -18.0}).items():
        assert columns[name][0] == pytest.approx(value, abs=1e-9), name


def test_a_turned_slot_observes_what_its_crank_does() -> None:
    """A Scotch yoke's way is r cos(theta), whatever acts."""
    of = scene(SCOTCH_YOKE + "[load.yoke]\nspring_N_m = 500.0\nfree_position_m = 0.0\nviscous_N_s_m = 2.0\n")
    run = solved(of)
    value, _ = observed(of, run)
    np.testing.assert_allclose(value, 0.05 * np.cos(run.position[:, 0, 2]), rtol=0, atol=1e-16)


@pytest.mark.parametrize("module", [equations, stepping, motion, rigid_walls], ids=lambda m: m.__name__)
def test_machine_code_is_kept_by_the_text_of_all_that_is_compiled_with_it(module: ModuleType) -> None:
    own = {name for name in closure(module.__name__).files if name.startswith("studies.truth.")}
    by_text = {module.__name__, *(part.__name__ for part in module.COMPILED_WITH)}
    python = {"studies.truth.mechanism", "studies.truth.rigid_walls"}
    if module is rigid_walls:  # of its pieces of friction Python runs the text
        python |= {"studies.truth.switches", "studies.truth.stepping"}
    assert own - by_text <= python, "which is Python"
