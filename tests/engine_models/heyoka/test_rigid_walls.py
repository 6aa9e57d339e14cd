"""heyoka on rigid walls: the reference's impacts and what follows them, and where its model ends."""

from functools import cache

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed, Trajectory
from engine_models.heyoka.engine import HeyokaEngine
from engine_models.mechanics.assembly import start_state, started_from
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.judges.metrics import energy_balance_residual_J, kinetic_energy_J
from tests.helpers.arrays import joint_forces

pytest.importorskip("heyoka", reason="heyoka is not installed")

SAMPLES = 40
#: Up to several accumulations of bounces; with clearance at two pins up to where both begin to follow.
END_S = {
    "rigid-free-0.5mm": 0.1,
    "rigid-driven-0.5mm": 0.01,
    "rigid-driven-A": 0.004,
    "rigid-driven-AB": 0.003,
    "rigid-free-OAB": 0.008,
    "rigid-pendulum": 0.3,
    "rigid-start-up": 0.02,
    "rigid-compressor": 0.02,
}
#: What the reference's tolerance of 1e-12 leaves; 2e-12 m are measured at times without chaos.
POSITION_M, TIME_S, SPEED = 1e-9, 1e-8, 1e-6


def scene_of(name: str) -> Scene:
    return SCENES[name]().model_copy(update={"end_time_s": END_S[name]})


@cache
def runs(name: str) -> tuple[Trajectory, Trajectory]:
    scene, settings = scene_of(name), RunSettings(1.0, SAMPLES)
    reference = ReferenceEngine(method="dop853", step_tolerance=1e-12)
    return HeyokaEngine(step_tolerance=1e-14).simulate(scene, settings), reference.simulate(scene, settings)


@pytest.mark.parametrize("name", END_S)
def test_the_motion_is_the_references_also_past_accumulations(name: str) -> None:
    own, other = runs(name)
    off = np.abs(own.position[:, -1, 0] - other.position[:, -1, 0]).max()
    assert off < POSITION_M, f"{off:.1e} m"
    assert own.dissipated_energy_J is not None
    assert other.dissipated_energy_J is not None
    np.testing.assert_allclose(own.dissipated_energy_J, other.dissipated_energy_J, rtol=1e-6, atol=1e-12)
    scale = np.abs(joint_forces(other)).max()
    np.testing.assert_allclose(joint_forces(own), joint_forces(other), rtol=0, atol=max(1e-4 * scale, 1e-6))


@pytest.mark.parametrize("name", END_S)
def test_impacts_to_the_first_accumulation_are_the_references_one_by_one(name: str) -> None:
    own, other = runs(name)
    for joint, contact in other.contacts.items():
        mine, theirs = own.contacts[joint].impacts, contact.impacts
        bounces = np.flatnonzero(np.diff(theirs.time_s) < 1e-6)
        count = int(bounces[0]) if len(bounces) else len(theirs.time_s)
        assert count > 0
        assert len(mine.time_s) >= count
        np.testing.assert_allclose(mine.time_s[:count], theirs.time_s[:count], rtol=0, atol=TIME_S)
        for column in ("approach_speed_m_s", "normal_impulse_N_s"):
            found, true = getattr(mine, column)[:count], getattr(theirs, column)[:count]
            np.testing.assert_allclose(found, true, rtol=0, atol=SPEED * true.max())


@pytest.mark.parametrize("name", END_S)
def test_the_ledger_of_impacts_closes(name: str) -> None:
    scene, (own, _) = scene_of(name), runs(name)
    residual = np.abs(energy_balance_residual_J(scene, own)).max() / kinetic_energy_J(scene, own).max()
    assert residual < 1e-10, f"{residual:.1e}"


def test_a_slow_approach_closes_without_rebound() -> None:
    scene = scene_of("rigid-pendulum")
    room = scene.clearance.O
    assert room is not None
    scene = scene.replace("clearance.O.minimum_impact_speed_m_s", 10.0)
    own = HeyokaEngine(step_tolerance=1e-14).simulate(scene, RunSettings(1.0, SAMPLES))
    first = own.contacts["O"].impacts
    whole, _ = runs("rigid-pendulum")
    assert first.time_s[0] == pytest.approx(whole.contacts["O"].impacts.time_s[0], rel=1e-9)
    # All the approach's energy is lost, of which a rebound of e leaves the part e^2.
    restitution = room.restitution or 0.0
    lost = whole.contacts["O"].impacts.energy_lost_J[0] / (1 - restitution**2)
    assert first.energy_lost_J[0] == pytest.approx(lost, rel=1e-9)


def together(name: str) -> Scene:
    """Return a rod that flies along the guide, and hits both its bearings at once."""
    scene = SCENES[name]().model_copy(update={"gravity_m_s2": 0.0}).replace("drive", {"kind": "free"})
    position, velocity = start_state(scene)
    velocity = np.zeros_like(velocity)
    velocity[1, 0], velocity[2, 0] = 1.0, 2.0
    return started_from(scene, position, velocity, end_time_s=0.001)


def test_two_pins_that_hit_at_one_time_are_refused_with_the_time() -> None:
    with pytest.raises(SimulationFailed, match=r"ends at t = 0\.0005 s: two pins hit .* at one time"):
        HeyokaEngine().simulate(together("rigid-driven-AB"), RunSettings(1.0, SAMPLES))


def test_two_pins_touch_compliant_walls_at_one_time() -> None:
    scene = together("clearance-driven-AB")
    own = HeyokaEngine(step_tolerance=1e-14).simulate(scene, RunSettings(1.0, SAMPLES))
    other = ReferenceEngine(method="dop853", step_tolerance=1e-12).simulate(scene, RunSettings(1.0, SAMPLES))
    for joint, contact in own.contacts.items():
        assert contact.impacts.time_s[0] == pytest.approx(0.0005, rel=1e-9)
        assert contact.impacts.duration_s[0] == pytest.approx(
            other.contacts[joint].impacts.duration_s[0], rel=1e-6
        )
    assert np.abs(own.position[:, -1, 0] - other.position[:, -1, 0]).max() < POSITION_M


def test_two_pins_leave_compliant_walls_at_one_time() -> None:
    """A rod between a crank at its dead centre and a slider that hardly moves: both its ends do the same."""
    scene = together("clearance-driven-AB")
    scene = scene.replace(
        {"slider.mass_kg": 1e9, "rod.centre_of_mass_m": scene.crank_slider()[1].length_m / 2}
    )
    position, velocity = start_state(scene)
    velocity = np.zeros_like(velocity)
    velocity[1, 0] = 1.0
    run = HeyokaEngine().simulate(
        started_from(scene, position, velocity, end_time_s=0.001), RunSettings(1.0, 20)
    )
    first, second = (contact.impacts for contact in run.contacts.values())
    assert first.duration_s[0] == pytest.approx(second.duration_s[0], rel=1e-6)
    assert run.steps < 100


def test_an_impact_while_another_pin_follows_is_refused_with_the_time() -> None:
    scene = SCENES["rigid-driven-AB"]()
    with pytest.raises(
        SimulationFailed, match=r"ends at t = 0\.\d+ s: a pin hits its rigid wall while another"
    ):
        HeyokaEngine().simulate(scene, RunSettings(1.0, SAMPLES))
