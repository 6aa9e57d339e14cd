"""SciPy on minimal coordinates: the same motion and forces as the truths, fewer numbers, what is refused."""

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.mechanics.equations.derivative import Derivative
from engine_models.scene.drives import FluctuatingDrive
from engine_models.scene.library import CLEARANCE_SCENES, IDEAL_SCENES, SCENES, clearance, ideal_driven
from engine_models.scene.scene import Clearances, Scene
from engine_models.scipy_ivp.engine import ScipyEngine
from studies.judges.metrics import energy_balance_residual_J, errors, kinetic_energy_J
from tests.helpers.arrays import joint_forces
from tests.helpers.crank_sliders import in_minimal_coordinates
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES = 20
#: At the tightest tolerance; over the knots of the compressor's gas, which no method stops at, 2e-9 m.
POSITION_M, OVER_KNOTS_M, FORCE = 1e-9, 1e-8, 1e-7
#: One joint with clearance, two and three, and how far they are predictable within 1e-9 m.
HORIZON_S = {
    "clearance-driven-0.5mm": 0.002,
    "clearance-driven-A": 0.002,
    "clearance-driven-AB": 0.0012,
    "clearance-driven-damped": 0.002,
    "clearance-free-0.5mm": 0.016,
    "clearance-free-OAB": 0.01,
}


def run(scene: Scene, rtol: float = 1e-12) -> Trajectory:
    engine = ScipyEngine(rtol=rtol, atol=rtol / 100, coordinates="minimal")
    return engine.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))


def loose(*joints: str) -> Scene:
    """Return set R without a driver and with clearance in these joints."""
    scene = SCENES["ideal-free"]().model_copy(update={"end_time_s": 0.01})
    return scene.model_copy(update={"clearance": Clearances(**dict.fromkeys(joints, clearance(5e-4)))})


@pytest.mark.parametrize("name", ["ideal-free", "ideal-torque", "ideal-compressor"])
def test_ideal_scenes_without_a_prescribed_speed_are_met(name: str) -> None:
    scene = IDEAL_SCENES[name]()
    trajectory, truth = run(scene), exact(scene, SAMPLES)
    error = errors(scene, trajectory, truth)
    worst = error["slider_position_error_m"].max()
    assert worst < (OVER_KNOTS_M if name == "ideal-compressor" else POSITION_M), f"{worst:.1e} m"
    force = error["joint_B_force_error_N"].max() / np.abs(joint_forces(truth)).max()
    assert force < FORCE, f"force off by {force:.1e} of the largest"


@pytest.mark.parametrize("name", HORIZON_S)
def test_clearance_is_met_and_the_ledger_closes(name: str) -> None:
    scene = CLEARANCE_SCENES[name]().model_copy(update={"end_time_s": HORIZON_S[name]})
    trajectory = run(scene)
    truth = in_minimal_coordinates(scene, SAMPLES)
    assert sum(len(contact.impacts.time_s) for contact in truth.contacts.values()) > 0
    off = np.abs(trajectory.position[:, -1, 0] - truth.position[:, -1, 0]).max()
    assert off < POSITION_M, f"{off:.1e} m"
    play = kinetic_energy_J(scene, trajectory).max()
    residual = np.abs(energy_balance_residual_J(scene, trajectory)).max() / play
    assert residual < 1e-9, f"residual {residual:.1e} of {play:.3g} J"


@pytest.mark.parametrize("joints", ["O", "A", "B", "OA", "OB", "AB", "OAB"])
def test_every_tree_moves_as_the_multiplier_equations_say(joints: str) -> None:
    scene = loose(*joints)
    absolute = ScipyEngine(rtol=1e-12, atol=1e-14).simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
    minimal = run(scene)
    off = np.abs(absolute.position - minimal.position).max()
    assert off < POSITION_M, f"{off:.1e}"
    assert sum(len(contact.impacts.time_s) for contact in minimal.contacts.values()) > 0


@pytest.mark.parametrize(
    ("scene", "coordinates"),
    [
        (SCENES["ideal-free"](), 1),
        (SCENES["clearance-pendulum"](), 3),
        (loose("O"), 3),
        (loose("A"), 3),
        (loose("B"), 3),
        (loose("O", "B"), 5),
        (loose("O", "A", "B"), 7),
    ],
    ids=["ideal", "pendulum", "O", "A", "B", "OB", "OAB"],
)
def test_there_are_as_many_coordinates_as_freedoms(scene: Scene, coordinates: int) -> None:
    assert Derivative(scene, minimal=True).n == coordinates


def test_a_prescribed_speed_that_changes_is_followed_with_clearance() -> None:
    drive = FluctuatingDrive(kind="fluctuating", amplitude_rad_s=50.0, frequency_Hz=170.0)
    update = {"drive": drive, "end_time_s": 0.002, "clearance": Clearances(B=clearance(1e-4))}
    scene = ideal_driven().model_copy(update=update)
    trajectory = run(scene)
    truth = in_minimal_coordinates(scene, SAMPLES)
    assert np.abs(trajectory.position[:, -1, 0] - truth.position[:, -1, 0]).max() < POSITION_M
    assert trajectory.driver_torque_N_m is not None
    assert truth.driver_torque_N_m is not None
    torque = np.abs(truth.driver_torque_N_m)
    assert np.abs(trajectory.driver_torque_N_m - truth.driver_torque_N_m).max() < FORCE * torque.max()


def test_what_has_no_such_equation_is_refused_with_the_reason() -> None:
    with pytest.raises(UnsupportedScene, match=r"the motion is prescribed: there is no ODE to integrate"):
        ScipyEngine(coordinates="minimal").check(SCENES["ideal-driven"]())


def test_a_rod_shorter_than_its_crank_turns_round_as_the_multiplier_equations_say() -> None:
    scene = SCENES["ideal-free"]().replace({"rod.length_m": 0.03, "rod.centre_of_mass_m": 0.01})
    scene = scene.model_copy(update={"end_time_s": 0.2})
    absolute = ScipyEngine(rtol=1e-12, atol=1e-14).simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
    minimal = run(scene)
    assert np.ptp(minimal.position[:, 1, 2]) > 2 * np.pi
    off = np.abs(absolute.position - minimal.position).max()
    assert off < POSITION_M, f"{off:.1e}"


def test_a_singular_position_ends_a_run_with_its_time() -> None:
    """Links of one length meet at a right angle of the crank, and go on in one of two ways."""
    scene = SCENES["ideal-free"]()
    scene = scene.replace({"rod.length_m": scene.crank.length_m, "rod.centre_of_mass_m": 0.02})
    with pytest.raises(SimulationFailed, match=r"t = 0\.0\d+ s: the mechanism is at a singular position"):
        run(scene)
