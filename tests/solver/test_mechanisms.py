"""The reference solver is general: other mechanisms, built with its public API, against own derivations."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.failures import InconsistentStart, NonFiniteState, SingularConfiguration
from reference_solver.mechanism.mechanism import (
    GROUND,
    Body,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    SameAngle,
    SpringDamper,
    Torque,
)
from reference_solver.solver import solve
from tests.helpers.kernels import straight_guide
from tests.helpers.orders import ORDER_TOLERANCE, slope
from tests.studies.truth.closed_forms.linkages import GRAVITY, FourBar, Rod, TriplePendulum

PENDULUM = TriplePendulum((Rod(0.3, 0.5, 4e-3, 0.12), Rod(0.2, 0.4, 2e-3, 0.1), Rod(0.25, 0.3, 2e-3, 0.15)))
PENDULUM_ANGLES, PENDULUM_RATES = np.array([-0.3, -1.2, 0.4]), np.array([1.0, -2.0, 3.0])


def pendulum_mechanism() -> Mechanism:
    bodies = tuple(Body(rod.mass, rod.inertia) for rod in PENDULUM.rods)
    joints = [RevoluteJoint(GROUND, (0.0, 0.0), 0, (-PENDULUM.rods[0].s, 0.0))]
    for k in (0, 1):
        first, second = PENDULUM.rods[k : k + 2]
        joints.append(RevoluteJoint(k, (first.length - first.s, 0.0), k + 1, (-second.s, 0.0)))
    return Mechanism(bodies, tuple(joints), gravity_m_s2=GRAVITY)


def pendulum_start() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    centres = PENDULUM.centres(PENDULUM_ANGLES)
    rates = PENDULUM.centre_rates(PENDULUM_ANGLES, PENDULUM_RATES)
    return np.column_stack([centres, PENDULUM_ANGLES]).ravel(), np.column_stack(
        [rates, PENDULUM_RATES]
    ).ravel()


def test_a_triple_pendulum_and_its_hanging_force_converge_at_order_four() -> None:
    end, samples, counts = 0.5, 10, [40, 80, 160]
    times = np.linspace(0, end, samples + 1)
    states = PENDULUM.motion(PENDULUM_ANGLES, PENDULUM_RATES, times)
    centres = np.array([PENDULUM.centres(s[:3]) for s in states])
    forces = np.array([PENDULUM.hanging_force(s[:3], s[3:]) for s in states])
    position_errors, force_errors = [], []
    for count in counts:
        run = solve(
            pendulum_mechanism(),
            *pendulum_start(),
            end_time_s=end,
            samples=samples,
            step=end / (samples * count),
        )
        position_errors.append(np.abs(run.q.reshape(-1, 3, 3)[:, :, :2] - centres).max())
        force_errors.append(np.abs(run.multipliers[:, :2] - forces).max())
    steps = [end / samples / count for count in counts]
    for name, errors in (("position", position_errors), ("hanging force", force_errors)):
        order = slope(steps, errors)
        assert abs(order - 4) < ORDER_TOLERANCE, f"{name}: order {order:.3f} from errors {errors}"


FOUR_BAR = FourBar(Rod(0.1, 0.4, 4e-4, 0.04), Rod(0.25, 0.3, 2e-3, 0.1), Rod(0.2, 0.35, 1.2e-3, 0.09), 0.28)


def four_bar_mechanism() -> Mechanism:
    crank, coupler, rocker = FOUR_BAR.crank, FOUR_BAR.coupler, FOUR_BAR.rocker
    return Mechanism(
        bodies=tuple(Body(rod.mass, rod.inertia) for rod in (crank, coupler, rocker)),
        constraints=(
            RevoluteJoint(GROUND, (0.0, 0.0), 0, (-crank.s, 0.0)),
            RevoluteJoint(0, (crank.length - crank.s, 0.0), 1, (-coupler.s, 0.0)),
            RevoluteJoint(1, (coupler.length - coupler.s, 0.0), 2, (rocker.length - rocker.s, 0.0)),
            RevoluteJoint(2, (-rocker.s, 0.0), GROUND, (FOUR_BAR.base, 0.0)),
        ),
        gravity_m_s2=GRAVITY,
    )


def test_a_four_bar_linkage_converges_at_order_four() -> None:
    end, samples, counts, angle, rate = 0.5, 10, [40, 80, 160], 0.7, 20.0
    motion = FOUR_BAR.motion(angle, rate, np.linspace(0, end, samples + 1))
    centres = np.array([FOUR_BAR.bodies(theta)[0][:, :2] for theta in motion[:, 0]])
    X, X_1, _ = FOUR_BAR.bodies(angle)
    errors = []
    for count in counts:
        run = solve(
            four_bar_mechanism(),
            X.ravel(),
            (X_1 * rate).ravel(),
            end_time_s=end,
            samples=samples,
            step=end / (samples * count),
        )
        errors.append(np.abs(run.q.reshape(-1, 3, 3)[:, :, :2] - centres).max())
    order = slope([end / samples / count for count in counts], errors)
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.3f} from errors {errors}"


def oscillator(damping: float) -> Mechanism:
    """A block of 2 kg on a guide at 30 degrees, held by a spring of 200 N/m and free length 0.4 m."""
    end = (np.cos(np.pi / 6), np.sin(np.pi / 6))
    return Mechanism(
        (Body(2.0, 1.0),),
        straight_guide(0, (0.0, 0.0), np.pi / 6),
        (SpringDamper(GROUND, end, 0, (0.0, 0.0), 200.0, damping, 0.4),),
    )


def test_a_damped_block_on_an_inclined_guide_follows_the_closed_form_at_order_four() -> None:
    damping, samples, counts = 4.0, 10, [10, 20, 40]
    times = np.linspace(0, 1.0, samples + 1)
    rest, offset, decay = 0.6, 0.05, damping / 4.0
    frequency = np.sqrt(100.0 - decay**2)
    along = rest + offset * np.exp(-decay * times) * (
        np.cos(frequency * times) + decay / frequency * np.sin(frequency * times)
    )
    direction = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
    errors = []
    for count in counts:
        run = solve(
            oscillator(damping),
            (rest + offset) * direction,
            np.zeros(3),
            end_time_s=1.0,
            samples=samples,
            step=1.0 / (samples * count),
        )
        errors.append(np.abs(run.q - np.outer(along, direction)).max())
    order = slope([1.0 / samples / count for count in counts], errors)
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.3f} from errors {errors}"


def test_a_torque_on_a_pinned_wheel_gives_the_textbook_angle_exactly() -> None:
    wheel = Mechanism(
        (Body(1.0, 0.5),), (RevoluteJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0)),), (Torque(0, 2.0),)
    )
    run = solve(wheel, np.zeros(3), np.zeros(3), end_time_s=1.0, samples=1, step=1 / 8)
    # RK4 integrates a quadratic exactly: only round-off is left.
    assert run.q[-1, 2] == pytest.approx(2.0, abs=1e-14)


def test_redundant_constraints_raise_an_error_that_names_the_rank() -> None:
    pinned_twice = RevoluteJoint(GROUND, (0.0, 0.0), 0, (-PENDULUM.rods[0].s, 0.0))
    mechanism = pendulum_mechanism()
    redundant = Mechanism(mechanism.bodies, (*mechanism.constraints, pinned_twice), gravity_m_s2=GRAVITY)
    with pytest.raises(SingularConfiguration, match="rank 6 of 8 at t = 0 s") as caught:
        solve(redundant, *pendulum_start(), end_time_s=1.0, samples=1, step=1.0)
    assert (caught.value.rank, caught.value.rows) == (6, 8)


def test_two_drivers_on_one_body_raise_an_error_that_names_the_rank() -> None:
    wheel = Mechanism(
        (Body(1.0, 0.5),),
        (
            RevoluteJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0)),
            PrescribedSpeed(0, 1.0),
            PrescribedSpeed(0, 1.0),
        ),
    )
    with pytest.raises(SingularConfiguration, match="rank 3 of 4"):
        solve(wheel, np.zeros(3), np.array([0, 0, 1.0]), end_time_s=1.0, samples=1, step=1.0)


@pytest.mark.parametrize(("dq", "dv", "message"), [(1e-6, 0.0, "positions"), (0.0, 1e-3, "velocities")])
def test_an_inconsistent_start_is_refused(dq: float, dv: float, message: str) -> None:
    q, v = pendulum_start()
    with pytest.raises(InconsistentStart, match=message):
        solve(pendulum_mechanism(), q + dq, v + dv, end_time_s=1.0, samples=1, step=1.0)


def test_an_unstable_step_ends_in_an_error_that_says_when() -> None:
    # omega h = 10 * 0.5 is past RK4's limit of 2.8284, so the state grows until it overflows.
    direction = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
    with pytest.raises(NonFiniteState, match=r"t = .* s with step 0\.5 s"):
        solve(oscillator(0.0), 0.65 * direction, np.zeros(3), end_time_s=500.0, samples=1, step=0.5)


@pytest.mark.parametrize("stabilisation", ["none", "projection"])
def test_an_overflow_is_found_in_its_step_where_each_constraint_has_a_coordinate_of_its_own(
    stabilisation: Literal["none", "projection"],
) -> None:
    far_too_stiff = SpringDamper(GROUND, (1.0, 0.3), 2, (0.1, 0.0), 1e12, 0.0, 0.1)
    swing, (q, v) = replace(pendulum_mechanism(), loads=(far_too_stiff,)), pendulum_start()
    with pytest.raises(NonFiniteState, match=r"t = 0\.00[1-9] s"):
        solve(swing, q, v, end_time_s=1.0, samples=1, step=1e-3, stabilisation=stabilisation)


@pytest.mark.parametrize(
    ("mechanism", "field"),
    [
        (lambda: Mechanism((), ()), "bodies"),
        (lambda: Mechanism((Body(-1.0, 1.0),), ()), "Body.mass_kg"),
        (lambda: Mechanism((Body(1.0, float("nan")),), ()), "Body.inertia_kg_m2"),
        (lambda: Mechanism((Body(1.0, 1.0),), (SameAngle(0, 1),)), "SameAngle.body_j"),
        (
            lambda: Mechanism((Body(1.0, 1.0),), (RevoluteJoint(0, (0, 0), 7, (0, 0)),)),
            "RevoluteJoint.body_j",
        ),
    ],
)
def test_a_malformed_mechanism_is_refused_by_field(mechanism: object, field: str) -> None:
    assert callable(mechanism)
    with pytest.raises(ValueError, match=field):
        mechanism()
