"""Impulses of rigid joints: simultaneous contacts, support, friction and energy."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import Generator
from numpy.typing import NDArray

from reference_solver.equations import Equations
from reference_solver.failures import BlockedImpact
from reference_solver.mechanism.contacts import ClearanceJoint, RigidWall
from reference_solver.mechanism.data import GROUND, Body, FrictionLaw, Pin
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Impact
from tests.helpers.kernels import straight_guide
from tests.helpers.mechanism_energy import energy_residual_J, kinetic_energy_J, place
from tests.solver.pins import joint_force_N, run

FloatArray = NDArray[np.float64]
#: A product of a few numbers, of a system of a few equations.
ROUND_OFF = 256 * float(np.finfo(float).eps)
MASS, INERTIA, CLEARANCE, RADIUS, GRAVITY = 0.5, 2e-3, 5e-4, 0.01, 9.81
#: How long before a touch runs begin, and end after it: of that speeds of 1 m/s, and normals in a clearance
#: of 20 mm, change by 1e-10.
MOMENT_S, CHANGED, WIDE = 1e-11, 1e-9, 0.02


def hit(mechanism: Mechanism, q: FloatArray, v: FloatArray) -> tuple[FloatArray, tuple[Impact, ...]]:
    """Return the velocities after the pins that touch in a state have hit, and their impacts."""
    found = run(mechanism, q - v * MOMENT_S, v, 2 * MOMENT_S, 2, 1)
    return found.v[-1], found.impacts


def beam(arm: float, restitutions: tuple[float, float], inertia: float, y: float = 0.0) -> Mechanism:
    """Return a free beam with a pin at either side of its centre, each in a fixed bearing."""
    joints = (
        ClearanceJoint(GROUND, (x, y), 0, (x, 0.0), CLEARANCE, RADIUS, RigidWall(e))
        for x, e in zip((-arm, arm), restitutions, strict=True)
    )
    return Mechanism((Body(MASS, inertia),), (), (), GRAVITY, tuple(joints))


def test_two_pins_that_land_at_once_bounce_alike_and_come_to_rest_with_half_of_the_weight_each() -> None:
    e, weight = 0.5, MASS * GRAVITY
    found = run(beam(0.13, (e, e), INERTIA), [0.0] * 3, [0.0] * 3, 0.1, 1000)
    pairs = list(zip(found.impacts[::2], found.impacts[1::2], strict=True))
    assert all((a.contact, b.contact, a.time_s, a.kind) == (0, 1, b.time_s, b.kind) for a, b in pairs)
    speed = np.sqrt(2 * GRAVITY * CLEARANCE)
    for k, (a, b) in enumerate(pairs[:6]):
        for one in (a, b):
            # Up to six impacts, each a few units in the last place, and their times' error.
            assert one.approach_speed_m_s == pytest.approx(speed * e**k, rel=1e-12)
            rebound = 1 if one.kind == "closing" else 1 + e
            impulse = rebound * MASS * one.approach_speed_m_s / 2
            assert one.normal_impulse_N_s == pytest.approx(impulse, rel=1e-12)
        lost = (1 - e**2) / 2 * MASS * a.approach_speed_m_s**2
        assert a.energy_lost_J + b.energy_lost_J == pytest.approx(lost, rel=1e-12)
    assert pairs[-1][0].kind == "closing"
    assert found.closed[-1].all()
    assert np.abs(joint_force_N(found)[-1] - [0.0, weight / 2]).max() < ROUND_OFF * weight
    # Without symmetry lost to round-off the beam never turns; one unit in the last place may.
    assert np.abs(found.q[:, 2]).max() < 1e-12
    assert np.abs(energy_residual_J(found)).max() < 1e-12 * weight * CLEARANCE


@pytest.mark.parametrize(("inertia", "supports"), [(MASS * 0.1**2 / 3, True), (MASS * 0.1**2 * 2, False)])
def test_a_pin_that_follows_supports_an_impact_only_where_it_is_pressed(
    inertia: float, supports: bool
) -> None:
    # Pins at -a and +a on the lower walls; W is 1/m + a^2/J on the diagonal and 1/m - a^2/J beside it.
    a, e, speed = 0.1, 0.6, 0.8
    mechanism = beam(a, (0.0, e), inertia, CLEARANCE)
    v, impacts = hit(mechanism, np.zeros(3), np.array([0.0, -speed / 2, -speed / (2 * a)]))
    w, beside = 1 / MASS + a**2 / inertia, 1 / MASS - a**2 / inertia
    right = (1 + e) * speed * w / (w**2 - beside**2) if supports else (1 + e) * speed / w
    expected = [(0, "support", -beside / w * right)] * supports + [(1, "impact", right)]
    assert [(i.contact, i.kind) for i in impacts] == [each[:2] for each in expected]
    impulses = [each[2] for each in expected]
    assert [i.normal_impulse_N_s for i in impacts] == pytest.approx(impulses, rel=CHANGED)
    left_after, right_after = v[1] - a * v[2], v[1] + a * v[2]
    assert right_after == pytest.approx(e * speed, rel=CHANGED)
    assert abs(left_after) < CHANGED * speed if supports else left_after > 0.1 * speed, "thrown off"


@pytest.mark.parametrize("later_m", [1e-7, 1e-9, 1e-11])
def test_ends_of_a_beam_that_hit_in_turns_lose_all_speed_however_close_they_are(later_m: float) -> None:
    # A hit stops one end and throws the other out. Speeds fall by 0.77 from hit to hit, and distances by
    # 0.13, by the beam's two equations: round-off hides these while a third of the speed is left.
    arm = 0.1
    falling = beam(arm, (0.1, 0.1), MASS * arm**2 / 10)
    found = run(falling, [0.0, -CLEARANCE + 2 * later_m, later_m / arm], [0.0, -1.0, 0.0], 1e-6, 100, 2)
    kinetic = kinetic_energy_J(falling, found.v)
    assert kinetic[-1] < 1e-10 * kinetic[0], kinetic[-1] / kinetic[0]
    assert abs(energy_residual_J(found)[-1]) < 1e-9 * kinetic[0]


def chain(random: Generator) -> tuple[Mechanism, FloatArray, FloatArray, FloatArray]:
    """Return two bodies on a revolute joint at random, one's pin on the wall of a bearing and approaching.

    Beside coordinates and velocities there are the rows (2, n) of the pin's outward and its sliding speed.
    """
    bodies = tuple(Body(*10 ** random.uniform([-1, -4], [0, -1])) for _ in range(2))
    points, q, direction = (
        random.uniform(-0.2, 0.2, (3, 2)),
        random.uniform(-1, 1, 6),
        random.uniform(0, 6.28),
    )
    hinge = Pin(0, tuple(points[0]), 1, tuple(points[1]))
    q[3:5] += place(q[None], 0, hinge.point_i)[0] - place(q[None], 1, hinge.point_j)[0]
    n = np.array([np.cos(direction), np.sin(direction)])
    (pin,), radius = place(q[None], 1, tuple(points[2])), 0.05
    wall, friction = RigidWall(random.uniform(0, 1)), FrictionLaw("tanh", random.uniform(0.05, 2), 0.01)
    joint = ClearanceJoint(GROUND, tuple(pin - WIDE * n), 1, tuple(points[2]), WIDE, radius, wall, friction)
    arm, t = pin - q[3:5], np.array([-n[1], n[0]])
    turning = [arm[0] * way[1] - arm[1] * way[0] for way in (n, t)]
    rows = np.zeros((2, 6))
    rows[:, 3:] = [*n, turning[0]], [*t, turning[1] + radius - WIDE]
    mechanism = Mechanism(bodies, (hinge,), contacts=(joint,))
    B, v = Equations(mechanism, q).system(0.0, q).B, random.uniform(-1, 1, 6)
    v -= np.linalg.pinv(B) @ (B @ v)
    if abs(rows[0] @ v) < 0.05:  # so slow a pin would be on its wall from the start
        return chain(random)
    return mechanism, q, v if rows[0] @ v > 0 else -v, rows


def test_an_impact_with_friction_never_creates_energy_and_keeps_newtons_and_coulombs_laws() -> None:
    random, regimes = np.random.default_rng(1), {"sticks": 0, "slides": 0, "is held back": 0}
    for case in range(400):
        mechanism, q, v, rows = chain(random)
        (joint,) = mechanism.contacts
        after, (impact,) = hit(mechanism, q, v)
        before_J, after_J = kinetic_energy_J(mechanism, np.array([v, after]))
        scale = ROUND_OFF * 10 * before_J
        assert after_J <= before_J + scale, f"case {case}: {after_J - before_J:.1e} J created"
        assert abs(before_J - after_J - impact.energy_lost_J) <= scale, f"case {case}: the loss is not that"
        hinge = np.abs(Equations(mechanism, q).system(0.0, q).B @ after).max()
        assert hinge < CHANGED, f"case {case}: the hinge opens at {hinge:.1e} m/s"
        outward, sliding = rows @ after
        assert isinstance(joint.law, RigidWall)
        assert joint.friction is not None
        assert -outward == pytest.approx(joint.law.restitution * (rows @ v)[0], abs=CHANGED), f"case {case}"
        tangential, limit = (
            impact.tangential_impulse_N_s,
            joint.friction.coefficient * impact.normal_impulse_N_s,
        )
        assert abs(tangential) <= limit * (1 + 1e-9), f"case {case}: Coulomb's limit"
        if abs(sliding) < 1e-9:
            regimes["sticks"] += 1
        elif abs(tangential) > limit * (1 - 1e-9):
            regimes["slides"] += 1
            assert sliding * tangential < 0, f"case {case}: friction drives the sliding"
        else:
            regimes["is held back"] += 1
            assert abs(impact.energy_lost_J) <= scale, f"case {case}: held back without need"
    # All three regimes occur, the energy's own limit among them.
    assert min(regimes["sticks"], regimes["slides"]) > 50, regimes
    assert regimes["is held back"] > 0, regimes


def test_without_friction_the_loss_is_the_closed_form_of_the_mass_that_the_ideal_joints_leave() -> None:
    random = np.random.default_rng(2)
    for _ in range(50):
        mechanism, q, v, rows = chain(random)
        (joint,) = mechanism.contacts
        assert isinstance(joint.law, RigidWall)
        after, (impact,) = hit(replace(mechanism, contacts=(replace(joint, friction=None),)), q, v)
        equations, outward, e = Equations(mechanism, q), rows[0] @ v, joint.law.restitution
        # The paper's formula with the contact's row in B, by a full inverse.
        B = np.vstack([equations.system(0.0, q).B, rows[0]])
        inverse = np.linalg.inv((B * equations.inverse_mass) @ B.T)
        paper = v - equations.inverse_mass * (B.T @ (inverse[:, -1] * (1 + e) * outward))
        assert np.abs(after - paper).max() < CHANGED * np.abs(v).max()
        assert impact.effective_mass_kg == pytest.approx(inverse[-1, -1], rel=1e-10)
        assert impact.energy_lost_J == pytest.approx((1 - e**2) / 2 * outward**2 * inverse[-1, -1], rel=1e-10)


def test_an_impact_against_driven_motion_is_refused() -> None:
    below = ClearanceJoint(GROUND, (0.0, CLEARANCE), 0, (0.0, 0.0), CLEARANCE, RADIUS, RigidWall(0.5))
    pin = Pin(GROUND, (0.0, 0.0), 0, (0.0, 0.0))
    for held in ((pin,), straight_guide(0, (0.0, 0.0), 0.0)):
        with pytest.raises(BlockedImpact, match=r"t = 0 s"):
            hit(
                Mechanism((Body(1.0, 1.0),), held, contacts=(below,)),
                np.zeros(3),
                np.array([0.0, -1e-10, 0.0]),
            )
