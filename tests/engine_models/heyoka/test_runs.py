"""heyoka's runs against the truths: motion, contacts of every kind, energy, what a tolerance buys."""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed, Trajectory
from engine_models.heyoka.engine import HeyokaEngine
from engine_models.mechanics.assembly import started_from
from engine_models.mechanics.joints import joint_gap
from engine_models.scene.library import CLEARANCE_SCENES, IDEAL_SCENES, SCENES
from engine_models.scene.loads import Loads, SliderLoad
from engine_models.scene.scene import Clearance, Clearances, Friction, Scene
from engine_models.scipy_ivp.engine import ScipyEngine
from studies.judges.metrics import energy_balance_residual_J, errors, kinetic_energy_J
from tests.helpers.arrays import joint_forces
from tests.helpers.crank_sliders import in_minimal_coordinates
from tests.studies.truth.closed_forms.crank_slider import exact

pytest.importorskip("heyoka", reason="heyoka is not installed")

if TYPE_CHECKING:
    from engine_models.heyoka.run import Piece

SAMPLES = 20
#: At round-off: 1e-13 m is measured without clearance; with it chaos has 1e-16 grow to 1e-11 m.
IDEAL_M, POSITION_M = 1e-12, 1e-9
#: Part of the kinetic energy: 1e-14 is measured, with clearance at constant speed 1e-11.
LEDGER = 1e-10
#: How far scenes are predictable within 1e-9 m.
HORIZON_S = {
    "clearance-driven-0.5mm": 0.002,
    "clearance-driven-0.02mm": 0.002,
    "clearance-driven-A": 0.002,
    "clearance-driven-AB": 0.0012,
    "clearance-driven-damped": 0.002,
    "clearance-free-0.5mm": 0.016,
}


@cache
def run(name: str, tolerance: float = 1e-15) -> Trajectory:
    scene = scene_of(name)
    return HeyokaEngine(step_tolerance=tolerance).simulate(scene, RunSettings(scene.end_time_s, SAMPLES))


def scene_of(name: str) -> Scene:
    scene = SCENES[name]()
    return scene.model_copy(update={"end_time_s": HORIZON_S.get(name, scene.end_time_s)})


def residual(scene: Scene, trajectory: Trajectory) -> float:
    play = kinetic_energy_J(scene, trajectory).max()
    return float(np.abs(energy_balance_residual_J(scene, trajectory)).max() / play)


@pytest.mark.parametrize("name", ["ideal-free", "ideal-torque"])
def test_ideal_scenes_are_met_to_round_off(name: str) -> None:
    scene, trajectory = scene_of(name), run(name)
    truth = exact(scene, SAMPLES)
    error = errors(scene, trajectory, truth)
    assert error["slider_position_error_m"].max() < IDEAL_M, f"{error['slider_position_error_m'].max():.1e} m"
    force = error["joint_B_force_error_N"].max() / np.abs(joint_forces(truth)).max()
    assert force < 1e-10, f"force off by {force:.1e} of the largest"


def test_loads_and_a_motor_do_the_work_that_the_ledger_asks_for() -> None:
    load = SliderLoad(force_N=-30.0, viscous_N_s_m=4.0, spring_N_m=900.0, free_position_m=0.1)
    compressor = IDEAL_SCENES["ideal-compressor"]()
    scene = compressor.model_copy(update={"load": Loads(slider=load)})
    trajectory = HeyokaEngine(step_tolerance=1e-15).simulate(scene, RunSettings(1.0, SAMPLES))
    truth = exact(scene, SAMPLES)
    assert np.abs(trajectory.position[:, -1, 0] - truth.position[:, -1, 0]).max() < IDEAL_M
    assert residual(scene, trajectory) < LEDGER


def test_a_flight_that_begins_at_the_wall_to_the_last_digit_ends_there_again() -> None:
    scene, c, s, speed = SCENES["clearance-pendulum"](), 2.0**-11, 2.0**-5, 0.01
    assert scene.clearance.O is not None
    room = scene.clearance.O.model_copy(update={"radial_clearance_m": c})
    crank = scene.crank.model_copy(update={"centre_of_mass_m": s})
    scene = scene.model_copy(update={"crank": crank, "clearance": Clearances(O=room)})
    place, rates = np.array([[s, -c, 0.0]]), np.array([[0.0, speed, 0.0]])
    scene = started_from(scene, place, rates, end_time_s=0.004)  # thrown up from the lowest place, it falls
    for tolerance in (1e-8, 1e-12, 1e-15):
        run = HeyokaEngine(step_tolerance=tolerance).simulate(scene, RunSettings(0.004, SAMPLES))
        first = run.contacts["O"].impacts.time_s[0]
        assert first == pytest.approx(2 * speed / scene.weight_m_s2, rel=1e-6)


@pytest.mark.parametrize("name", HORIZON_S)
def test_clearance_is_met_and_the_ledger_closes(name: str) -> None:
    trajectory = run(name)
    truth = in_minimal_coordinates(scene_of(name), SAMPLES)
    assert sum(len(contact.impacts.time_s) for contact in truth.contacts.values()) > 0
    off = np.abs(trajectory.position[:, -1, 0] - truth.position[:, -1, 0]).max()
    assert off < POSITION_M, f"{off:.1e} m"
    assert residual(scene_of(name), trajectory) < LEDGER
    lost = trajectory.dissipated_energy_J
    assert lost is not None
    assert lost[-1] > 0


LAWS: dict[str, dict[str, object]] = {
    "linear": {"law": "linear", "restitution": None, "stiffness": 1e8},
    "kelvin-voigt": {"law": "kelvin-voigt", "restitution": None, "stiffness": 1e7, "damping_N_s_m": 100.0},
    "hertz": {"law": "hertz", "restitution": None},
    "clipped": {"law": "hu-guo", "restitution": 0.1},
    "pulling": {"law": "hu-guo", "restitution": 0.1, "may_pull": True},
    "square": {"exponent": 2.0, "stiffness": 1e12},
    "rubbed": {"friction": Friction(law="tanh", coefficient=0.1, regularisation_speed_m_s=0.1)},
}


@pytest.mark.parametrize("law", LAWS)
def test_every_kind_of_law_gives_what_scipy_gives(law: str) -> None:
    base: dict[str, object] = {
        "radial_clearance_m": 5e-4,
        "bearing_radius_m": 0.01,
        "law": "lankarani-nikravesh",
        "stiffness": 1e9,
        "restitution": 0.5,
    }
    room = Clearance.model_validate(base | LAWS[law])
    driven = SCENES["ideal-driven"]()
    scene = driven.model_copy(update={"end_time_s": 0.001, "clearance": Clearances(B=room)})
    settings = RunSettings(scene.end_time_s, SAMPLES)
    own = HeyokaEngine(step_tolerance=1e-15).simulate(scene, settings)
    other = ScipyEngine(rtol=1e-12, atol=1e-14).simulate(scene, settings)
    assert np.abs(own.position[:, -1, 0] - other.position[:, -1, 0]).max() < POSITION_M
    assert residual(scene, own) < LEDGER
    for column, value in vars(own.contacts["B"].impacts).items():
        np.testing.assert_allclose(
            value, getattr(other.contacts["B"].impacts, column), rtol=1e-6, err_msg=column
        )
    assert own.contacts["B"].normal_impulse_N_s[-1] > 0


def test_pins_that_touch_together_each_have_their_own_root() -> None:
    """At three joints, with contacts that overlap."""
    scene = CLEARANCE_SCENES["clearance-free-OAB"]().model_copy(update={"end_time_s": 0.008})
    settings = RunSettings(scene.end_time_s, SAMPLES)
    own = HeyokaEngine(step_tolerance=1e-15).simulate(scene, settings)
    truth = in_minimal_coordinates(scene, SAMPLES)
    assert sum(len(contact.impacts.time_s) for contact in truth.contacts.values()) > 2
    assert np.abs(own.position[:, -1, 0] - truth.position[:, -1, 0]).max() < POSITION_M


def test_a_run_begun_in_the_wall_goes_on_from_there() -> None:
    whole = run("clearance-driven-0.02mm")
    scene = scene_of("clearance-driven-0.02mm")
    gap = joint_gap(scene, "B", whole.position, whole.velocity)
    going_in = np.sum(gap.gap_m * gap.rate_m_s, axis=1) > 0
    inside = int(np.argmax(going_in & (whole.contacts["B"].penetration_m > 0)))
    assert inside > 0
    rest = started_from(scene, whole.position[inside], whole.velocity[inside], end_time_s=2e-4)
    settings = RunSettings(rest.end_time_s, SAMPLES)
    own, other = (
        engine.simulate(rest, settings)
        for engine in (HeyokaEngine(step_tolerance=1e-15), ScipyEngine(rtol=1e-12, atol=1e-14))
    )
    assert np.abs(own.position[:, -1, 0] - other.position[:, -1, 0]).max() < POSITION_M
    assert own.contacts["B"].normal_force_N[0] > 0


@pytest.mark.parametrize("name", ["ideal-free", "clearance-free-0.5mm"])
def test_the_error_falls_with_the_tolerance(name: str) -> None:
    # By rungs far apart: a series' order is a whole number, and steps are chosen one by one. 3e2 to 1e5 are
    # measured between these.
    errors_m = [
        np.abs(run(name, t).position[:, -1, 0] - run(name).position[:, -1, 0]).max()
        for t in (1e-4, 1e-8, 1e-12)
    ]
    assert errors_m[1] < errors_m[0] / 100, f"{errors_m}"
    assert errors_m[2] < errors_m[1] / 100, f"{errors_m}"


def test_no_order_is_worse_than_the_ones_before() -> None:
    """At 1e-11 heyoka's order would be 14, and 13 and 14 are in a gap of the series at a touch."""
    times = {t: run("clearance-free-0.5mm", t).contacts["B"].impacts.time_s for t in (1e-10, 1e-11, 1e-15)}
    off = [np.abs(times[t] - times[1e-15]).max() for t in (1e-10, 1e-11)]
    assert off[1] < 2 * off[0], f"{off[0]:.1e} s at 1e-10, {off[1]:.1e} s at 1e-11"


def test_a_bare_run_takes_the_steps_of_a_recorded_one() -> None:
    scene, settings = scene_of("clearance-free-0.5mm"), RunSettings(1.0, SAMPLES)
    engine, ends = HeyokaEngine(), []
    pieces: list[Piece] = []
    for take in (None, pieces.append):
        flight = engine._flight(scene, settings)
        flight.run(take)
        ends.append((flight.steps, flight.system.time_s, flight.system.state.tolist()))
    assert ends[0] == ends[1]
    assert len(pieces) > 10


@pytest.mark.parametrize("name", ["ideal-free", "clearance-driven-0.5mm"])
def test_samples_have_no_part_in_the_steps(name: str) -> None:
    scene = scene_of(name).model_copy(update={"end_time_s": 0.002})
    few, many = (HeyokaEngine().simulate(scene, RunSettings(1.0, count)) for count in (4, 40))
    assert few.steps == many.steps
    np.testing.assert_allclose(few.position, many.position[::10], rtol=0, atol=1e-14)


def test_steps_in_flight_are_no_longer_than_asked() -> None:
    scene = scene_of("ideal-free").model_copy(update={"end_time_s": 0.1})
    trajectory = HeyokaEngine().simulate(scene, RunSettings(1e-4, SAMPLES))
    assert 1000 <= trajectory.steps <= 1001


def test_a_run_that_takes_too_many_steps_fails() -> None:
    with pytest.raises(SimulationFailed, match=r"50 steps came no further than t = 0\.\d+ s: loosen"):
        HeyokaEngine(max_steps=50).simulate(scene_of("ideal-free"), RunSettings(1.0, SAMPLES))


def test_a_pendulum_with_clearance_keeps_its_ledger() -> None:
    scene = CLEARANCE_SCENES["clearance-pendulum"]().model_copy(update={"end_time_s": 0.07})
    trajectory = HeyokaEngine(step_tolerance=1e-15).simulate(scene, RunSettings(1.0, SAMPLES))
    assert len(trajectory.contacts["O"].impacts.time_s) > 3
    assert residual(scene, trajectory) < LEDGER
