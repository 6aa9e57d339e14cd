"""Set R with a rigid clearance joint at B: the ledger, the pin in its bearing, the limit of no clearance."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.mechanism import (
    GROUND,
    Body,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    StraightGuide,
)
from reference_solver.rigid_contact import solve_rigid
from reference_solver.rigid_joint import RigidJoint
from reference_solver.rigid_solution import RigidSolution
from reference_solver.solver import solve

FloatArray = NDArray[np.float64]
CRANK, ROD, SPEED = 0.05, 0.12, 2 * np.pi * 5000 / 60
#: RK4's theory is 4; the steps are cut at events, differently for each step, which scatters the order.
ORDER_TOLERANCE = 0.2


def mechanism(closed: bool) -> Mechanism:
    """Return crank, rod and slider, with the ideal joint at B or without it."""
    joints = (
        RevoluteJoint(GROUND, (0.0, 0.0), 0, (-CRANK / 2, 0.0)),
        RevoluteJoint(0, (CRANK / 2, 0.0), 1, (-ROD / 2, 0.0)),
        StraightGuide(2, (0.0, 0.0), 0.0),
        PrescribedSpeed(0, SPEED),
    )
    at_B = (RevoluteJoint(1, (ROD / 2, 0.0), 2, (0.0, 0.0)),) if closed else ()
    return Mechanism((Body(0.30, 1e-4), Body(0.21, 2.5e-4), Body(0.14, 1e-4)), (*joints, *at_B), (), 9.81)


def start() -> tuple[FloatArray, FloatArray]:
    """Return the concentric start with the ideal joint's velocities."""
    rod_rate = -CRANK * SPEED / ROD
    q = np.array([CRANK / 2, 0, 0, CRANK + ROD / 2, 0, 0, CRANK + ROD, 0, 0])
    v = [0, SPEED * CRANK / 2, SPEED, 0, SPEED * CRANK / 2, rod_rate, 0, 0, 0]
    return q, np.array(v)


@cache
def run(
    clearance: float, restitution: float, end: float, steps: int, samples: int = 100, compiled: bool = True
) -> RigidSolution:
    joint = RigidJoint(1, (ROD / 2, 0.0), 2, (0.0, 0.0), clearance, 0.01, restitution)
    return solve_rigid(
        mechanism(False),
        (joint,),
        *start(),
        end_time_s=end,
        samples=samples,
        steps_per_sample=steps // samples,
        compiled=compiled,
    )


def test_the_readable_and_the_compiled_run_have_the_same_impacts() -> None:
    readable, compiled = (run(5e-4, 0.9, 1.2e-3, 300, 10, face) for face in (False, True))
    assert len(readable.impacts) == len(compiled.impacts) == 6
    for one, other in zip(readable.impacts, compiled.impacts, strict=True):
        assert one.time_s == pytest.approx(other.time_s, abs=1e-14)  # round-off, grown by six impacts
    assert np.abs(readable.q - compiled.q).max() < 1e-12


def test_the_ledger_closes_at_order_four_over_a_revolution_with_impacts_closings_and_following() -> None:
    counts = [6000, 12000, 24000]
    runs = [run(5e-4, 0.5, 0.012, count) for count in counts]
    kinds = {impact.kind for impact in runs[-1].impacts}
    assert kinds == {"impact", "closing"}
    assert len(runs[-1].mode_changes) > 2
    residuals = [float(np.abs(one.energy_residual_J).max()) for one in runs]
    order = float(-np.polyfit(np.log(counts), np.log(residuals), 1)[0])
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.2f} of {residuals} J"
    assert runs[-1].impact_loss_J[-1, 0] > 1.0
    assert 0 < runs[-1].closing_loss_J[-1, 0] < 1e-6


def test_the_pin_stays_in_its_bearing_and_is_only_pushed() -> None:
    found = run(5e-4, 0.5, 0.012, 12000)
    q = found.q
    bearing = q[:, 3:5] + ROD / 2 * np.column_stack([np.cos(q[:, 5]), np.sin(q[:, 5])])
    d = q[:, 6:8] - bearing
    past = np.hypot(d[:, 0], d[:, 1]) - 5e-4
    assert past.max() < 1e-14, f"{past.max():.1e} m past the wall"  # round-off of 0.17 m
    following = found.following[:, 0]
    assert 0.1 < following.mean() < 0.9
    inward = -np.sum(found.joint_force_N[:, 0] * d, axis=1)
    assert inward[following].min() > 0
    assert not found.joint_force_N[~following].any()


def test_without_clearance_it_tends_to_the_ideal_mechanism() -> None:
    end, steps = 0.012, 12000
    ideal = solve(mechanism(True), *start(), end_time_s=end, samples=100, steps_per_sample=steps // 100)
    for clearance in (5e-4, 5e-5, 5e-6):
        found = run(clearance, 0.0, end, steps)
        deviation = float(np.abs(found.q[:, 6] - ideal.q[:, 6]).max())
        # x = r cos(theta) + d_x + sqrt(L^2 - (r sin(theta) + d_y)^2), |d| = c, moves by c/cos(phi) at most.
        bound = clearance / np.sqrt(1 - ((CRANK + clearance) / ROD) ** 2)
        assert 0.5 * clearance < deviation <= bound, f"{deviation:.2e} m with a clearance of {clearance} m"


def test_two_joints_that_throw_each_other_off_in_turns_come_to_rest_on_their_walls() -> None:
    # Clearance at A and B without rebound: each closing throws the other pin off by less at every turn.
    at_A = RigidJoint(0, (CRANK / 2, 0.0), 1, (-ROD / 2, 0.0), 5e-4, 0.01, 0.0)
    at_B = RigidJoint(1, (ROD / 2, 0.0), 2, (0.0, 0.0), 5e-4, 0.01, 0.0)
    ideal = mechanism(False)
    held = Mechanism(
        ideal.bodies, tuple(c for k, c in enumerate(ideal.constraints) if k != 1), (), ideal.gravity_m_s2
    )
    found = solve_rigid(
        held,
        (at_A, at_B),
        *start(),
        end_time_s=0.012,
        samples=100,
        steps_per_sample=30,
        compiled=False,  # four sets of modes would be compiled for a short run
    )
    assert len(found.impacts) < 200, f"{len(found.impacts)} impacts: no end to the turns"
    assert found.following.all(axis=1).any(), "both pins follow their walls at some sample"
    # Measured: 1.1e-5 J at half the step, of order four; a lost impulse would leave a part of the 6.5 J lost.
    assert np.abs(found.energy_residual_J).max() < 1e-3
