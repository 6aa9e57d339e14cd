"""Impulses of rigid joints: simultaneous contacts, support, friction and energy."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.equations import Equations
from reference_solver.failures import BlockedImpact
from reference_solver.impacts import complementary
from reference_solver.impacts import solve as solve_small
from reference_solver.mechanism.contacts import ClearanceJoint, RigidWall, separation
from reference_solver.mechanism.data import GROUND, Body, FrictionLaw, Pin
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.points import State
from reference_solver.run import Impact
from reference_solver.solver import LOWEST_FLIGHT, solve
from tests.helpers.kernels import straight_guide
from tests.helpers.mechanism_energy import energy_residual_J
from tests.solver.rebounds import Rebounds

FloatArray = NDArray[np.float64]
#: A product of a few numbers, of a system of a few equations.
ROUND_OFF = 256 * float(np.finfo(float).eps)
MASS, INERTIA, CLEARANCE, RADIUS, GRAVITY = 0.5, 2e-3, 5e-4, 0.01, 9.81


def settled(
    mechanism: Mechanism, q: FloatArray, v: FloatArray, time_s: float = 0.0
) -> tuple[FloatArray, list[Impact]]:
    """Return the velocities after the pins that touch have hit, and their impacts."""
    after = Rebounds(mechanism, q, LOWEST_FLIGHT)(time_s, q, v)
    return after.v, after.impacts


def beam(arm: float, restitution: float) -> Mechanism:
    """Return a free beam with a pin at either side of its centre, each in a fixed bearing."""
    wall = RigidWall(restitution)
    joints = (ClearanceJoint(GROUND, (x, 0.0), 0, (x, 0.0), CLEARANCE, RADIUS, wall) for x in (-arm, arm))
    return Mechanism((Body(MASS, INERTIA),), (), (), GRAVITY, tuple(joints))


def test_two_pins_that_land_at_once_bounce_alike_and_come_to_rest_with_half_of_the_weight_each() -> None:
    e, end, steps = 0.5, 0.1, 1000
    start = np.zeros(3), np.zeros(3)
    found = solve(beam(0.13, e), *start, end_time_s=end, samples=10, step=end / steps)
    assert len(found.impacts) % 2 == 0
    pairs = list(zip(found.impacts[::2], found.impacts[1::2], strict=True))
    assert all((a.contact, b.contact, a.time_s, a.kind) == (0, 1, b.time_s, b.kind) for a, b in pairs), (
        "each pair lands at one time"
    )
    speed = np.sqrt(2 * GRAVITY * CLEARANCE)
    for k, (a, b) in enumerate(pairs[:6]):
        for one in (a, b):
            # Up to six impacts, each a few units in the last place, and their times' error.
            assert one.approach_speed_m_s == pytest.approx(speed * e**k, rel=1e-12)
            share = MASS * one.approach_speed_m_s / 2
            rebound = 1 if one.kind == "closing" else 1 + e
            assert one.normal_impulse_N_s == pytest.approx(rebound * share, rel=1e-12)
        lost = (1 - e**2) / 2 * MASS * a.approach_speed_m_s**2
        assert a.energy_lost_J + b.energy_lost_J == pytest.approx(lost, rel=1e-12)
    assert pairs[-1][0].kind == "closing"
    assert found.closed[-1].all()
    weight = MASS * GRAVITY
    assert np.abs(found.joint_force_N[-1] - [0.0, weight / 2]).max() < ROUND_OFF * weight
    # Without symmetry lost to round-off the beam never turns; one unit in the last place may.
    assert np.abs(found.q[:, 2]).max() < 1e-12
    assert np.abs(energy_residual_J(found)).max() < 1e-12 * weight * CLEARANCE


@pytest.mark.parametrize(("inertia", "supports"), [(MASS * 0.1**2 / 3, True), (MASS * 0.1**2 * 2, False)])
def test_a_pin_that_follows_supports_an_impact_only_where_it_is_pressed(
    inertia: float, supports: bool
) -> None:
    # Pins at -a and +a on the lower walls; W is 1/m + a^2/J on the diagonal and 1/m - a^2/J beside it.
    a, e, speed = 0.1, 0.6, 0.8
    joints = (
        ClearanceJoint(GROUND, (x, CLEARANCE), 0, (x, 0.0), CLEARANCE, RADIUS, RigidWall(restitution))
        for x, restitution in ((-a, 0.0), (a, e))
    )
    mechanism = Mechanism((Body(MASS, inertia),), (), contacts=tuple(joints))
    rows = np.array([[0.0, 1.0, -a], [0.0, 1.0, a]])
    v = np.array([0.0, -speed / 2, -speed / (2 * a)])
    after_v, impacts = settled(mechanism, np.zeros(3), v)
    w, beside = 1 / MASS + a**2 / inertia, 1 / MASS - a**2 / inertia
    right = (1 + e) * speed * w / (w**2 - beside**2) if supports else (1 + e) * speed / w
    assert [(impact.contact, impact.kind) for impact in impacts] == [(0, "support")] * supports + [
        (1, "impact")
    ]
    impulses = [-beside / w * right] * supports + [right]
    assert [impact.normal_impulse_N_s for impact in impacts] == pytest.approx(impulses, rel=ROUND_OFF)
    after = rows @ after_v
    assert after[1] == pytest.approx(e * speed, rel=ROUND_OFF)
    if supports:
        assert abs(after[0]) < ROUND_OFF * speed
    else:
        assert after[0] > 0.1 * speed, "the pin is thrown off its wall"


def chain(generator: np.random.Generator) -> tuple[Mechanism, FloatArray, FloatArray, ClearanceJoint]:
    """Return two bodies on a revolute joint at random, one's pin on the wall of a bearing and approaching."""
    bodies = tuple(Body(*10 ** generator.uniform([-1, -4], [0, -1])) for _ in range(2))
    points = generator.uniform(-0.2, 0.2, (3, 2))
    q = generator.uniform(-1, 1, 6)
    hinge = Pin(0, tuple(points[0]), 1, tuple(points[1]))
    gap = Equations(Mechanism(bodies, (hinge,)), q).violation(0.0, q)
    q[3:5] -= gap
    direction = generator.uniform(0, 2 * np.pi)
    centre = CLEARANCE * np.array([np.cos(direction), np.sin(direction)])
    cos, sin = np.cos(q[5]), np.sin(q[5])
    pin = q[3:5] + np.array([[cos, -sin], [sin, cos]]) @ points[2]
    e, mu = generator.uniform(0, 1), generator.uniform(0.05, 2)
    wall, friction = RigidWall(e), FrictionLaw("tanh", mu, 0.01)
    joint = ClearanceJoint(GROUND, tuple(pin - centre), 1, tuple(points[2]), CLEARANCE, 0.05, wall, friction)
    mechanism = Mechanism(bodies, (hinge,))
    equations = Equations(mechanism, q)
    B, v = equations.constraint_matrix(q), generator.uniform(-1, 1, 6)
    v -= np.linalg.pinv(B) @ (B @ v)
    if separation(joint, State(q, v)).rate < 0:
        v = -v
    return replace(mechanism, contacts=(joint,)), q, v, joint


def coefficient(joint: ClearanceJoint) -> float:
    """Return Coulomb's coefficient of a joint."""
    return 0.0 if joint.friction is None else joint.friction.coefficient


def speeds_of(joint: ClearanceJoint, q: FloatArray, v: FloatArray) -> tuple[float, float]:
    """Return a pin's outward and sliding speeds."""
    at = separation(joint, State(q, v))
    return float(at.rate), float(at.tangent @ v)


def test_an_impact_with_friction_never_creates_energy_and_keeps_newtons_and_coulombs_laws() -> None:
    generator = np.random.default_rng(1)
    sticking = sliding = held_back = 0
    for case in range(400):
        mechanism, q, v, joint = chain(generator)
        after_v, (impact,) = settled(mechanism, q, v)
        masses = 1 / Equations(mechanism, q).inverse_mass
        before_J, after_J = masses @ v**2 / 2, masses @ after_v**2 / 2
        scale = ROUND_OFF * 10 * before_J
        assert after_J <= before_J + scale, f"case {case}: {after_J - before_J:.1e} J created"
        assert abs(before_J - after_J - impact.energy_lost_J) <= scale, f"case {case}: the loss is not that"
        hinge = Equations(mechanism, q).constraint_matrix(q) @ after_v
        assert np.abs(hinge).max() < 1e-10, f"case {case}: the hinge opens at {np.abs(hinge).max():.1e} m/s"
        outward, sliding_speed = speeds_of(joint, q, after_v)
        rebound = joint.law.restitution * speeds_of(joint, q, v)[0]
        assert -outward == pytest.approx(rebound, abs=1e-10), f"case {case}: Newton's law"
        normal, tangential = impact.normal_impulse_N_s, impact.tangential_impulse_N_s
        limit = coefficient(joint) * normal
        assert abs(tangential) <= limit * (1 + 1e-9), f"case {case}: Coulomb's limit"
        if abs(sliding_speed) < 1e-9:
            sticking += 1
        elif abs(tangential) > limit * (1 - 1e-9):
            sliding += 1
            assert sliding_speed * tangential < 0, f"case {case}: friction drives the sliding"
        else:
            held_back += 1
            assert abs(impact.energy_lost_J) <= scale, f"case {case}: held back without need"
    # All three regimes occur, the energy's own limit among them.
    assert min(sticking, sliding) > 50, (sticking, sliding, held_back)
    assert held_back > 0, (sticking, sliding, held_back)


def test_without_friction_the_loss_is_the_closed_form_of_the_mass_that_the_ideal_joints_leave() -> None:
    generator = np.random.default_rng(2)
    for _ in range(50):
        mechanism, q, v, joint = chain(generator)
        smooth = replace(joint, friction=None)
        after_v, (impact,) = settled(replace(mechanism, contacts=(smooth,)), q, v)
        outward, normal = speeds_of(smooth, q, v)[0], separation(smooth, State(q, v)).normal
        B = np.vstack([Equations(mechanism, q).constraint_matrix(q), normal])
        inverse = np.linalg.inv((B * Equations(mechanism, q).inverse_mass) @ B.T)
        assert impact.effective_mass_kg == pytest.approx(inverse[-1, -1], rel=1e-10)  # a full inverse
        exact = (1 - smooth.law.restitution**2) / 2 * outward**2 * impact.effective_mass_kg
        assert impact.energy_lost_J == pytest.approx(exact, rel=1e-10)
        # The paper's formula with the contact's row in B.
        right = np.zeros(len(B))
        right[-1] = (1 + smooth.law.restitution) * outward
        paper = v - Equations(mechanism, q).inverse_mass * (B.T @ (inverse @ right))
        assert np.abs(after_v - paper).max() < 1e-10 * np.abs(v).max()


def test_an_impact_against_driven_motion_is_refused() -> None:
    guided = Mechanism((Body(1.0, 1.0),), straight_guide(0, (0.0, 0.0), 0.0))
    held = Mechanism((Body(1.0, 1.0),), (Pin(GROUND, (0.0, 0.0), 0, (0.0, 0.0)),))
    below = ClearanceJoint(GROUND, (0.0, CLEARANCE), 0, (0.0, 0.0), CLEARANCE, RADIUS, RigidWall(0.5))
    for rigid in (held, guided):
        with pytest.raises(BlockedImpact, match=r"t = 0\.25 s"):
            settled(replace(rigid, contacts=(below,)), np.zeros(3), np.array([0.0, -1.0, 0.0]), 0.25)


def test_the_complementary_solution_keeps_all_its_conditions() -> None:
    generator = np.random.default_rng(3)
    for _ in range(200):
        A, b = generator.normal(size=(4, 4)), generator.normal(size=4)
        W = A @ A.T + 0.1 * np.eye(4)
        z = complementary(W, b)
        y = W @ z + b
        assert z.min() >= 0
        assert y.min() > -1e-12
        assert np.abs(z * y).max() < 1e-12


def test_equations_that_depend_on_each_other_have_a_solution_all_the_same() -> None:
    generator = np.random.default_rng(4)
    for rank in (1, 2, 3, 4):
        A = generator.normal(size=(4, rank))
        W, right = A @ A.T, A @ generator.normal(size=rank)
        x, full = solve_small(W, right)
        assert full == (rank == 4)
        assert np.abs(W @ x - right).max() < 1e-12 * np.linalg.cond(A)
