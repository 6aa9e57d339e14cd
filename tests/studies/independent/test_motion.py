"""The integration behind the truths of random scenes: closed forms, energy, mechanics in other coordinates.

It is compiled, which takes most of the time here.
"""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import lambertw

from engine_models.engine import RunSettings
from engine_models.scene.library import clearance, ideal_driven, ideal_free
from engine_models.scene.scene import Clearance, Clearances, ContactLaw, Friction, Scene
from studies.independent.mechanism import SIZE, damping_of
from studies.independent.motion import Motion
from studies.independent.solver import IndependentSolver
from studies.independent.stepping import collocated, extrapolated, extrapolation, radau
from studies.judges.metrics import energy_balance_residual_J, kinetic_energy_J, potential_energy_J
from tests.random_scenes.recipe import COMPLIANT, WITH_RESTITUTION, random_scene

#: Approach speed in m/s, stiffness in N/m^n and clearance in m of the bounces below.
SPEED, STIFFNESS, ROOM = 1.5, {1.0: 1e8, 1.5: 1e10}, 1e-3


def moving(scene: Scene) -> Motion:
    return Motion(scene, extrapolated, extrapolation(1e-14))


def places(motion: Motion, times: NDArray[np.float64]) -> NDArray[np.float64]:
    found = []
    for t in times.tolist():
        assert motion.to(t)
        found.append(motion.slider_m)
    return np.array(found)


def in_joints(scene: Scene, end_s: float, **joints: Clearance) -> Scene:
    return scene.model_copy(update={"end_time_s": end_s, "clearance": Clearances(**joints)})


def hertz(room_m: float, rub: Friction | None = None) -> Clearance:
    return Clearance(
        radial_clearance_m=room_m, bearing_radius_m=0.01, law="hertz", stiffness=1e10, friction=rub
    )


def bounced(law: ContactLaw, **constants: Any) -> tuple[float, float, float]:
    """Return a slider's speed back from a rod that lies on the guide, its contact's time, and its mass.

    The crank stands still, without gravity: all forces are along the guide, and the slider alone moves.
    """
    wall = Clearance(radial_clearance_m=ROOM, bearing_radius_m=0.01, law=law, **constants)
    scene = in_joints(ideal_driven(), 1.0, B=wall)
    start = scene.start.model_copy(update={"crank_speed_rad_s": 1e-30})
    motion = moving(scene.model_copy(update={"start": start, "gravity_m_s2": 0.0}))
    motion.z[SIZE + 5] = motion.scale[SIZE:] = SPEED
    motion.begin_s = motion.clock[0] = 1e-3 * ROOM / SPEED
    motion.shortest_s = 1e-11 * ROOM / SPEED
    assert motion.to(1.5 * ROOM / SPEED)  # the contact is over long before, the next wall is not reached
    came_back = -float(motion.z[SIZE + 5])
    # It left the wall at the place ROOM, and has flown since.
    released = motion.time_s - (ROOM - motion.z[5]) / came_back
    return came_back, float(released) - ROOM / SPEED, scene.crank_slider()[2].mass_kg


@pytest.mark.parametrize("law", WITH_RESTITUTION)
def test_a_bounce_has_the_restitution_of_its_law(law: ContactLaw) -> None:
    """e_out = [1 + W0(-(1 + a) exp(-(1 + a)))]/a, whatever mass and stiffness."""
    a = damping_of(law, 0.7)
    expected = (1 + lambertw(-(1 + a) * math.exp(-(1 + a))).real) / a
    came_back, _, _ = bounced(law, restitution=0.7, stiffness=STIFFNESS[1.5])
    assert came_back / SPEED == pytest.approx(expected, rel=1e-12)


def test_bounces_without_restitution_last_as_long_as_they_do() -> None:
    """A half-wave of a spring, Hertz's 2.94327518 delta_max/v0, the damped wave of Kelvin and Voigt."""
    came_back, lasted, m = bounced("linear", stiffness=STIFFNESS[1.0])
    rate = math.sqrt(STIFFNESS[1.0] / m)
    assert came_back == pytest.approx(SPEED, rel=1e-12)
    assert lasted == pytest.approx(math.pi / rate, rel=1e-10)
    came_back, lasted, m = bounced("hertz", stiffness=STIFFNESS[1.5])
    deepest = (5 * m * SPEED**2 / (4 * STIFFNESS[1.5])) ** 0.4
    assert came_back == pytest.approx(SPEED, rel=1e-12)
    assert lasted == pytest.approx(2.94327518 * deepest / SPEED, rel=1e-8)  # the digits given
    zeta = 0.2
    came_back, lasted, _ = bounced(
        "kelvin-voigt", stiffness=STIFFNESS[1.0], damping_N_s_m=2 * zeta * rate * m
    )
    assert came_back / SPEED == pytest.approx(math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)), rel=1e-12)
    assert lasted == pytest.approx(math.pi / rate / math.sqrt(1 - zeta**2), rel=1e-10)


def test_a_pin_in_flight_leaves_the_slider_its_speed() -> None:
    """Set R from 60 degrees, with a clearance at B that is not crossed: the slider goes on as it began."""
    scene = in_joints(ideal_driven(), 1e-4, B=clearance(5e-3))
    scene = scene.model_copy(update={"start": scene.start.model_copy(update={"crank_angle_rad": np.pi / 3})})
    crank, rod, _ = scene.crank_slider()
    r, length, omega = crank.length_m, rod.length_m, scene.start.crank_speed_rad_s
    sin, cos = math.sqrt(3) / 2, 0.5
    cos_phi = math.sqrt(1 - (r / length * sin) ** 2)
    begin = r * cos + length * cos_phi
    speed = -r * omega * sin - r**2 * sin * cos * omega / (length * cos_phi)
    motion, times = moving(scene), np.linspace(2e-5, 1e-4, 5)
    np.testing.assert_allclose(places(motion, times), begin + speed * times, rtol=0, atol=1e-15)
    assert not motion.contacts[2]


def test_energy_is_kept_by_springs_and_lost_to_friction() -> None:
    solver = IndependentSolver("extrapolation", 1e-14)
    scene = in_joints(ideal_free(), 0.05, O=hertz(5e-4), B=hertz(1e-4))
    run = solver.simulate(scene, RunSettings(0.05, 5))
    energy = kinetic_energy_J(scene, run)[0]
    assert sum(len(contact.impacts.time_s) for contact in run.contacts.values()) > 10
    assert run.dissipated_energy_J is not None
    assert not run.dissipated_energy_J.any()
    # Some thousand steps, each in error by 1e-14 of its speeds.
    gain = np.abs(energy_balance_residual_J(scene, run)).max() / energy
    assert gain < 1e-11, f"{gain:.1e} of it lost or made"
    rub = Friction(law="ambrosio", coefficient=0.2, regularisation_speed_m_s=0.05, dead_band_speed_m_s=0.01)
    scene = in_joints(ideal_free(), 0.05, A=hertz(5e-4, rub))
    run = solver.simulate(scene, RunSettings(0.05, 100))
    energies = kinetic_energy_J(scene, run) + potential_energy_J(scene, run)
    assert energies[1] == pytest.approx(energies[0], rel=1e-14)
    assert max(np.diff(energies)) < 1e-14 * energy
    assert energies[-1] < energies[0] - 0.001 * energy


def test_both_steps_agree_on_every_law() -> None:
    """A kink that one of them steps over, or a touch, is worth 1e-11 m and more."""
    seen: set[str] = set()
    for seed in (1, 6, 8, 10, 12, 16, 25, 28, 29, 32, 33, 40, 51):
        scene = random_scene(seed, rigid=False)
        times = np.array([0.3, 0.6]) * scene.end_time_s
        explicit = places(moving(scene), times)
        implicit = places(Motion(scene, collocated, radau(7, 1e-11)), times)
        assert np.abs(explicit - implicit).max() < 1e-12, f"seed {seed}: {explicit - implicit} m"
        joints = (scene.clearance.O, scene.clearance.A, scene.clearance.B)
        seen |= {joint.law for joint in joints if joint is not None}
        seen |= {joint.friction.law for joint in joints if joint is not None and joint.friction is not None}
    assert seen == {*COMPLIANT, "saturated-linear", "ambrosio", "tanh"}
