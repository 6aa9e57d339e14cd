"""Friction while a rigid pin follows its wall: closed forms, the ledger's order, what is refused."""

from typing import Literal

import numpy as np
import pytest

from reference_solver.failures import PainleveParadox
from reference_solver.mechanism.contacts import ClearanceJoint, RigidWall
from reference_solver.mechanism.data import Body, FrictionLaw
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Solution
from tests.helpers.mechanism_energy import energy_residual_J
from tests.helpers.orders import slope
from tests.solver.pins import GRAVITY, MASS, bearing, disc, joint_force_N, run

INERTIA, CLEARANCE, RADIUS = 4e-4, 0.05, 0.2
PIN, STILL = RADIUS - CLEARANCE, [0.0] * 3
#: A product of a few numbers, of a system of a few equations.
ROUND_OFF = 256 * float(np.finfo(float).eps)
#: RK4's theory is 4; the next term of the error bends the regression by less than this.
ORDER_TOLERANCE = 0.1


def wide(
    friction: FrictionLaw, centre: float = 0.0, point: tuple[float, float] = (0.0, 0.0)
) -> ClearanceJoint:
    """Return a wide bearing about (centre, 0)."""
    wall, about = RigidWall(0.5), (centre, 0.0)
    return bearing(wall, friction, clearance=CLEARANCE, radius=RADIUS, centre=about, point=point)


def test_a_disc_slides_around_its_bearing_at_order_four_to_the_closed_form() -> None:
    # Saturated friction without gravity: F_n = m u^2/c and u' = -mu u^2/c, of which the spin gets m R_j/J.
    mu, speed, spin, end = 0.3, 2.0, 60.0, 0.1
    counts, errors = [200, 400, 800], dict[str, list[float]]()
    for count in counts:
        law = FrictionLaw("saturated-linear", mu, 0.5)
        found = run(disc(wide(law), inertia=INERTIA), [CLEARANCE, 0.0, 0.0], [0.0, speed, spin], end, count)
        along = speed / (1 + mu * speed * found.time_s / CLEARANCE)
        turning = spin + MASS * PIN / INERTIA * (along - speed)
        assert (along + PIN * turning).min() > 0.5, "friction is saturated throughout"
        angle = np.log(1 + mu * speed * found.time_s / CLEARANCE) / mu
        kinetic = MASS / 2 * along**2 + INERTIA / 2 * turning**2
        for name, value, exact in (
            ("place", found.q[:, :2], CLEARANCE * np.column_stack([np.cos(angle), np.sin(angle)])),
            ("spin", found.v[:, 2], turning),
            ("normal force", found.normal_force_N[:, 0], MASS * along**2 / CLEARANCE),
            ("friction force", found.friction_force_N[:, 0], -mu * MASS * along**2 / CLEARANCE),
            ("impulse", found.sums["normal0"], MASS * (speed - along) / mu),
            ("loss", found.sums["slide0"], kinetic[0] - kinetic),
            ("ledger", energy_residual_J(found), 0.0),
        ):
            errors.setdefault(name, []).append(float(np.abs(value - exact).max()))
        assert not found.impacts
    for name, values in errors.items():
        assert abs(-slope(counts, values) - 4) < ORDER_TOLERANCE, f"{name}: {values}"


FEET, BELOW = 0.1, 0.06  # m: a block's two pins at (-+FEET, -BELOW)


def block(friction: FrictionLaw, speed: float) -> Solution:
    """Return the beginning of a block's slide on two pins at the bottoms of their bearings."""
    joints = tuple(wide(friction, x, (x, -BELOW)) for x in (-FEET, FEET))
    mechanism = Mechanism((Body(MASS, 1e-3),), (), (), GRAVITY, joints)
    return run(mechanism, [0.0, BELOW - CLEARANCE, 0.0], [speed, 0.0, 0.0], 1e-5, 10)


@pytest.mark.parametrize("speed", [0.7, -0.7])
def test_friction_shifts_the_weight_of_a_sliding_block_to_its_front_pin_and_lifts_the_rear_one(
    speed: float,
) -> None:
    # The pins' equal circles let the block translate only: no moment about its centre of mass remains.
    found = block(FrictionLaw("tanh", 0.3, 0.5), speed)
    share = 0.3 * np.tanh(speed / 0.5)
    shift = share * (BELOW + PIN) / FEET
    expected = MASS * (GRAVITY + speed**2 / CLEARANCE) / 2 * np.array([1 - shift, 1 + shift])
    assert found.closed[0].all()
    assert found.normal_force_N[0] == pytest.approx(expected, rel=ROUND_OFF)
    force = np.column_stack([-share * expected, expected])
    assert joint_force_N(found)[0] == pytest.approx(force, rel=ROUND_OFF)
    # It tips where mu f (BELOW + PIN)/FEET > 1: without friction in the complementarity both would follow.
    front = int(speed > 0)
    for coefficient, following in ((0.45, (0, 1)), (0.55, (front,))):
        tipping = block(FrictionLaw("tanh", coefficient, 0.05), speed)
        assert tipping.mode_changes[0].following == following


@pytest.mark.parametrize(("kind", "dead"), [("saturated-linear", 0.0), ("ambrosio", 0.1), ("tanh", 0.0)])
def test_a_step_too_long_for_the_friction_is_cut(
    kind: Literal["saturated-linear", "ambrosio", "tanh"], dead: float
) -> None:
    mu, full = 0.3, 0.2
    # A disc that spins at the bottom of its bearing: the pin's surface has the mobility 1/m + R_j^2/J.
    rate = mu * MASS * GRAVITY * (1 / MASS + PIN**2 / INERTIA) / (full - dead)
    end = 10 * 2.785 / rate  # of ten steps at the limit of RK4's stability
    spinning = disc(wide(FrictionLaw(kind, mu, full, dead)), gravity=GRAVITY, inertia=INERTIA)
    # The sliding of 0.12 m/s is damped in steps of half a decay time at most, and never grows.
    found = run(spinning, [0.0, -CLEARANCE, 0.0], [0.0, 0.0, 0.8], end, 10)
    assert end * rate / 0.5 <= found.steps < 4 * end * rate
    sliding = np.hypot(*found.v[:, :2].T) + PIN * np.abs(found.v[:, 2])
    assert sliding.max() <= sliding[0] * (1 + ROUND_OFF)


def test_the_painleve_paradox_is_refused() -> None:
    # A rod's end slides on the bottom of a wide bearing. Along the normal (J + m l^2 cos^2)/(m J) is its
    # mobility, of which friction takes mu l^2 cos sin/J: at 45 degrees and J = m l^2/3 from mu = 5/3 on.
    length, angle = 0.1, np.pi / 4
    q = [length * np.cos(angle), -CLEARANCE + length * np.sin(angle), angle]

    def slide(coefficient: float) -> None:
        # A pin of almost no radius, so that its friction has no arm but the rod's.
        law, radius = FrictionLaw("tanh", coefficient, 0.05), CLEARANCE + 1e-9
        joint = bearing(RigidWall(0.5), law, clearance=CLEARANCE, radius=radius, point=(-length, 0.0))
        rod = Mechanism((Body(MASS, MASS * length**2 / 3),), (), (), GRAVITY, (joint,))
        run(rod, q, [-1.0, 0.0, 0.0], 1e-6, 10)

    slide(1.6)
    with pytest.raises(PainleveParadox, match="rigid joints 0 at t = 0 s"):
        slide(1.7)
