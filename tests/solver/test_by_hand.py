"""Equations, contact forces, laws and methods on states simple enough for pencil and paper."""

import math

import numpy as np
import pytest

from engine_models import arms
from engine_models.engine import RunSettings
from engine_models.scene.format import Clearance
from reference_solver.equations import Baumgarte, Equations
from reference_solver.mechanism.contacts import (
    CONTACT,
    DAMPING_FACTORS,
    ClearanceJoint,
    ContactLaw,
    ambrosio,
    contact_force,
    stiffness_of,
)
from reference_solver.mechanism.data import GROUND, Body, FrictionLaw, Pin
from reference_solver.mechanism.loads import Constant, Torque
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.points import State
from reference_solver.methods import RK4, Method, dop853, dopri5

#: Mass, inertia, distance of the pin from the centre of mass, and gravity.
M, I, D, G = 2.0, 3.0, 0.5, 9.81  # noqa: E741  the letters of mechanics
PENDULUM = Mechanism((Body(M, I),), (Pin(GROUND, (0, 0), 0, (-D, 0)),), gravity_m_s2=G)
#: Level, to the right of its pivot.
LEVEL = np.array([D, 0.0, 0.0])


def test_a_free_body_falls_and_spins_up() -> None:
    free = Mechanism((Body(M, I),), (), loads=(Torque(0, Constant(6.0)),), gravity_m_s2=G)
    acceleration = Equations(free, np.zeros(3)).required(0.0, np.zeros(3), np.zeros(3)).accelerations
    np.testing.assert_allclose(acceleration, [0.0, -G, 6.0 / I])


def test_a_level_pendulum_falls_by_its_inertia_about_the_pivot_and_is_held_in_its_circle() -> None:
    speed = 4.0
    answer = Equations(PENDULUM, LEVEL).required(0.0, LEVEL, np.array([0, D * speed, speed]))
    spin = -M * G * D / (I + M * D * D)
    np.testing.assert_allclose(answer.accelerations, [-speed * speed * D, spin * D, spin])
    np.testing.assert_allclose(answer.multipliers, [-M * speed * speed * D, M * (spin * D + G)])


def test_a_projection_closes_the_joint_and_stops_what_would_open_it() -> None:
    """Its centre may move only as it turns, by D times the spin."""
    moved, velocity, *_ = Equations(PENDULUM, LEVEL).project(
        0.0, LEVEL + np.array([1e-6, 0, 0]), np.array([0.3, 0.2, 1.0])
    )
    assert moved[0] == pytest.approx(D, abs=1e-11)
    assert velocity[0] == pytest.approx(0.0, abs=1e-6)
    assert velocity[1] == pytest.approx(D * velocity[2])
    # The least change by energy keeps the momentum about the pivot.
    assert M * D * velocity[1] + I * velocity[2] == pytest.approx(M * D * 0.2 + I * 1.0, rel=1e-5)


def test_baumgartes_feedback_is_a_damped_oscillator_of_the_gap() -> None:
    """A joint at the centre of mass that is 0.01 m open and opens at 0.2 m/s."""
    pinned = Mechanism((Body(M, I),), (Pin(GROUND, (0, 0), 0, (0, 0)),))
    equations = Equations(pinned, np.zeros(3), Baumgarte(30.0, 50.0))
    acceleration = equations.required(0.0, np.array([0.01, 0, 0]), np.array([0.2, 0, 0])).accelerations
    np.testing.assert_allclose(acceleration, [-2 * 30.0 * 0.2 - 50.0**2 * 0.01, 0.0, 0.0])


# Contacts

#: Radial clearance, bearing's radius, and the depth at which the pin stands in the wall.
C, R, DEPTH = 5e-4, 0.01, 1e-5


def test_a_contact_pushes_damps_and_rubs_at_the_middle_of_its_depth() -> None:
    """The pin stands to the right, moves out at 0.1 m/s and up at 0.2 m/s, and turns at 5 rad/s."""
    friction = FrictionLaw("saturated-linear", 0.1, 1.0)
    law = ContactLaw(stiffness=1e9, damping_factor=0.3)
    pin = ClearanceJoint(GROUND, (0, 0), 0, (0, 0), C, R, law, friction)
    state = State(np.array([C + DEPTH, 0, 0]), np.array([0.1, 0.2, 5.0]))
    forces, (told, loss, clipped, rubbed), across = contact_force(pin, CONTACT, 0.6, state)
    elastic = 1e9 * DEPTH * math.sqrt(DEPTH)
    normal = elastic * (1 + 0.6 * 0.1)
    arm = R - C - DEPTH / 2
    sliding = 0.2 + 5.0 * arm
    assert told == pytest.approx(normal)
    assert across == pytest.approx(-0.1 * normal * sliding)
    np.testing.assert_allclose(forces[0], [-normal, across, arm * across], rtol=1e-9)
    assert loss == pytest.approx(elastic * 0.6 * 0.1**2)
    assert rubbed == pytest.approx(0.1 * normal * sliding**2)
    assert clipped == 0.0


def test_damping_factors_are_those_of_the_papers_at_a_restitution_of_eight_tenths() -> None:
    """Hunt and Crossley 1975, Lankarani and Nikravesh 1990, Gonthier et al. 2004, Zhiying and Qishao 2006,
    Flores et al. 2011, Hu and Guo 2015, Carvalho and Martins 2019, worked out by hand."""
    found = {name: factor(0.8) for name, factor in DAMPING_FACTORS.items()}
    assert found == pytest.approx(
        {
            "hunt-crossley": 0.3,
            "lankarani-nikravesh": 0.27,
            "gonthier": 0.45,
            "zhiying-qishao": 0.4027927,
            "flores": 0.4,
            "hu-guo": 0.375,
            "carvalho-martins": 0.3731707,
        },
        rel=1e-6,
    )


def test_a_steel_pin_is_as_stiff_as_hertz_has_it() -> None:
    """s = 0.91/207e9 = 4.396135e-12 1/Pa, 4/(6 s) = 1.516484e11, times sqrt(0.01 0.0095/5e-4) = 0.4358899."""
    pin = Clearance(
        radial_clearance_m=C, bearing_radius_m=R, law="hertz", young_modulus_Pa=207e9, poisson_ratio=0.3
    )
    assert stiffness_of(pin) == pytest.approx(6.6102e10, rel=1e-4)


def test_ambrosios_friction_is_a_ramp_past_its_dead_band() -> None:
    law = FrictionLaw("ambrosio", 0.1, 0.5, 0.1)
    found = [ambrosio(law, speed) for speed in (-9.0, -0.3, -0.1, 0.05, 0.1, 0.3, 0.5, 9.0)]
    assert found == pytest.approx([-1.0, -0.5, 0.0, 0.0, 0.0, 0.5, 1.0, 1.0])


# Methods and steps


@pytest.mark.parametrize("method", [RK4, dopri5(), dop853()], ids=["RK4", "DOPRI5", "DOP853"])
def test_weights_integrate_powers_of_time_up_to_the_order(method: Method) -> None:
    weights, nodes = np.array(method.weights), np.array(method.nodes[: len(method.weights)])
    for k in range(method.order):
        assert weights @ nodes**k == pytest.approx(1 / (k + 1), abs=1e-14), k
    for node, row in zip(method.nodes, method.matrix, strict=True):
        assert sum(row) == pytest.approx(node, abs=1e-14)


def test_a_step_is_never_longer_than_asked_for_nor_halved_for_round_off() -> None:
    """2.1 over 0.7 is 3.0000000000000004 in floating point."""
    settings = RunSettings(0.3, 1)
    assert (settings.steps_per_sample(1.0), settings.step_used_s(1.0)) == (4, 0.25)
    assert [RunSettings(step, 1).steps_per_sample(2.1) for step in (0.7, 0.6999)] == [3, 4]


def test_arms_set_what_their_names_say() -> None:
    settings = {arm.label: dict(arm.settings) for arm in vars(arms).values() if isinstance(arm, arms.Arm)}
    assert settings["reference (plain RK4)"] == {"locate_events": False, "stabilisation": "none"}
    for name, radius in (("generalized-alpha", 0.5), ("generalized-alpha 0.9", 0.9)):
        assert settings[f"exudyn ({name})"]["spectral_radius"] == radius
