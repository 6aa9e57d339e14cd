"""Set R with a rigid clearance joint at B: the ledger, the pin in its bearing, the limit of no clearance."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.mechanism.contact_laws import RigidWall
from reference_solver.mechanism.mechanism import (
    GROUND,
    Body,
    ClearanceJoint,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
)
from reference_solver.solution import Solution
from reference_solver.solver import solve
from tests.helpers.kernels import straight_guide
from tests.helpers.mechanism_energy import energy_residual_J

FloatArray = NDArray[np.float64]
CRANK, ROD, SPEED = 0.05, 0.12, 2 * np.pi * 5000 / 60
#: RK4's theory is 4; the steps are cut at events, differently for each step, which scatters the order.
ORDER_TOLERANCE = 0.2


def at_A(clearance: float, restitution: float) -> ClearanceJoint:
    pin = (CRANK / 2, 0.0), 1, (-ROD / 2, 0.0)
    return ClearanceJoint(0, *pin, clearance, 0.01, RigidWall(restitution))


def at_B(clearance: float, restitution: float) -> ClearanceJoint:
    pin = (ROD / 2, 0.0), 2, (0.0, 0.0)
    return ClearanceJoint(1, *pin, clearance, 0.01, RigidWall(restitution))


def mechanism(*loose: ClearanceJoint) -> Mechanism:
    """Return crank, rod and slider; joints that are not loose are ideal."""
    constraints = (
        RevoluteJoint(GROUND, (0.0, 0.0), 0, (-CRANK / 2, 0.0)),
        RevoluteJoint(0, (CRANK / 2, 0.0), 1, (-ROD / 2, 0.0)),
        *straight_guide(2, (0.0, 0.0), 0.0),
        PrescribedSpeed(0, SPEED),
        RevoluteJoint(1, (ROD / 2, 0.0), 2, (0.0, 0.0)),
    )
    gone = {(joint.body_i, joint.body_j) for joint in loose}
    ideal = tuple(
        c for c in constraints if not (isinstance(c, RevoluteJoint) and (c.body_i, c.body_j) in gone)
    )
    bodies = Body(0.30, 1e-4), Body(0.21, 2.5e-4), Body(0.14, 1e-4)
    return Mechanism(bodies, ideal, (), 9.81, loose)


def start() -> tuple[FloatArray, FloatArray]:
    """Return the concentric start with the ideal joint's velocities."""
    rod_rate = -CRANK * SPEED / ROD
    q = np.array([CRANK / 2, 0, 0, CRANK + ROD / 2, 0, 0, CRANK + ROD, 0, 0])
    v = [0, SPEED * CRANK / 2, SPEED, 0, SPEED * CRANK / 2, rod_rate, 0, 0, 0]
    return q, np.array(v)


@cache
def run(
    clearance: float, restitution: float, end: float, steps: int, samples: int = 100, compiled: bool = True
) -> Solution:
    return solve(
        mechanism(at_B(clearance, restitution)),
        *start(),
        end_time_s=end,
        samples=samples,
        step=end / steps,
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
    residuals = [float(np.abs(energy_residual_J(one)).max()) for one in runs]
    order = float(-np.polyfit(np.log(counts), np.log(residuals), 1)[0])
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.2f} of {residuals} J"
    assert runs[-1].sums["impact0"][-1] > 1.0
    assert 0 < runs[-1].sums["closing0"][-1] < 1e-6


def test_the_pin_stays_in_its_bearing_and_is_only_pushed() -> None:
    found = run(5e-4, 0.5, 0.012, 12000)
    q = found.q
    bearing = q[:, 3:5] + ROD / 2 * np.column_stack([np.cos(q[:, 5]), np.sin(q[:, 5])])
    d = q[:, 6:8] - bearing
    past = np.hypot(d[:, 0], d[:, 1]) - 5e-4
    assert past.max() < 1e-14, f"{past.max():.1e} m past the wall"  # round-off of 0.17 m
    following = found.closed[:, 0]
    assert 0.1 < following.mean() < 0.9
    inward = -np.sum(found.joint_force_N[:, 0] * d, axis=1)
    assert inward[following].min() > 0
    assert not found.joint_force_N[~following].any()


def test_without_clearance_it_tends_to_the_ideal_mechanism() -> None:
    end, steps = 0.012, 12000
    ideal = solve(mechanism(), *start(), end_time_s=end, samples=100, step=end / steps)
    for clearance in (5e-4, 5e-5, 5e-6):
        found = run(clearance, 0.0, end, steps)
        deviation = float(np.abs(found.q[:, 6] - ideal.q[:, 6]).max())
        # x = r cos(theta) + d_x + sqrt(L^2 - (r sin(theta) + d_y)^2), |d| = c, moves by c/cos(phi) at most.
        bound = clearance / np.sqrt(1 - ((CRANK + clearance) / ROD) ** 2)
        assert 0.5 * clearance < deviation <= bound, f"{deviation:.2e} m with a clearance of {clearance} m"


def test_two_joints_that_throw_each_other_off_in_turns_come_to_rest_on_their_walls() -> None:
    # Clearance at A and B without rebound: each closing throws the other pin off by less at every turn.
    found = solve(
        mechanism(at_A(5e-4, 0.0), at_B(5e-4, 0.0)),
        *start(),
        end_time_s=0.006,
        samples=100,
        step=0.006 / 1500,
        compiled=False,  # four sets of modes would be compiled for a short run
    )
    assert len(found.impacts) < 200, f"{len(found.impacts)} impacts: no end to the turns"
    assert found.closed.all(axis=1).any(), "both pins follow their walls at some sample"
    # Measured: 1.1e-5 J at half the step, of order four; a lost impulse would leave a part of the 6.5 J lost.
    assert np.abs(energy_residual_J(found)).max() < 1e-3
