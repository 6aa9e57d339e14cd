"""Bounces on rigid walls that steps leave out, or round-off hides, have had their effect all the same."""

import numpy as np
import pytest

from reference_solver.mechanism.contact_laws import FrictionLaw, RigidWall
from reference_solver.mechanism.mechanism import GROUND, Body, ClearanceJoint, Mechanism
from reference_solver.solver import StepChoice, solve
from tests.helpers.mechanism_energy import energy_residual_J, kinetic_energy_J

GRAVITY, MASS = 9.81, 0.5
#: A bearing so large that its wall is flat, a disc so inert that it does not turn, and a friction that
#: is none for a pin that follows: it slides within the law's dead band.
CLEARANCE, RADIUS, INERTIA = 100.0, 200.0, 1e8
COEFFICIENT, RESTITUTION = 0.1, 0.5
FRICTION = FrictionLaw("ambrosio", COEFFICIENT, 1.0, 0.5)
FALLING, SLIDING, HEIGHT = 0.01, 0.02, 1e-9
#: How far the wall's slope, the way slid over the clearance, turns the speed of the fall, with room for two.
FLAT = 2 * SLIDING * 4e-3 / CLEARANCE * FALLING
#: Sums of a few numbers.
ROUND_OFF = 64 * float(np.finfo(float).eps)
#: Half the length of a beam whose ends rattle.
ARM = 0.1


@pytest.mark.parametrize("shortest_s", [1e-5, 1e-4, 1e-3])
def test_bounces_that_are_left_out_have_rubbed(shortest_s: float) -> None:
    # All bounces push by m v (1 + e)/(1 - e), and rub by the coefficient's part of that (Coulomb).
    pin = ClearanceJoint(GROUND, (0, 0), 0, (0, 0), CLEARANCE, RADIUS, RigidWall(RESTITUTION), FRICTION)
    disc = Mechanism((Body(MASS, INERTIA),), (), (), GRAVITY, (pin,))
    start = np.array([0.0, HEIGHT - CLEARANCE, 0.0]), np.array([SLIDING, -FALLING, 0.0])
    step = StepChoice(1e-3, closing_flight_fraction=shortest_s / 1e-3)
    found = solve(disc, *start, end_time_s=4e-3, samples=8, step=step, compiled=False)
    assert found.closed[-1].all()
    arrives = np.sqrt(FALLING**2 + 2 * GRAVITY * HEIGHT)
    rubbed = COEFFICIENT * arrives * (1 + RESTITUTION) / (1 - RESTITUTION)
    assert abs(found.v[-1, 0] - (SLIDING - rubbed)) < FLAT, found.v[-1, 0] - (SLIDING - rubbed)
    assert np.abs(energy_residual_J(found)).max() < ROUND_OFF * MASS * GRAVITY * CLEARANCE


@pytest.mark.parametrize("later_m", [1e-7, 1e-9, 1e-11])
def test_ends_of_a_beam_that_hit_in_turns_lose_all_speed_however_close_they_are(later_m: float) -> None:
    # A hit stops one end and throws the other out. Speeds fall by 0.77 from hit to hit, and distances by
    # 0.13, by the beam's two equations: round-off hides these while a third of the speed is left.
    walls = (ClearanceJoint(GROUND, (x, 0.0), 0, (x, 0.0), 5e-4, 0.01, RigidWall(0.1)) for x in (-ARM, ARM))
    beam = Mechanism((Body(MASS, MASS * ARM**2 / 10),), (), (), GRAVITY, tuple(walls))
    start = np.array([0.0, -5e-4 + 2 * later_m, later_m / ARM]), np.array([0.0, -1.0, 0.0])
    found = solve(beam, *start, end_time_s=1e-6, samples=2, step=1e-8, compiled=False)
    kinetic = kinetic_energy_J(beam, found.v)
    assert kinetic[-1] < 1e-10 * kinetic[0], kinetic[-1] / kinetic[0]
    assert abs(energy_residual_J(found)[-1]) < 1e-9 * kinetic[0]
