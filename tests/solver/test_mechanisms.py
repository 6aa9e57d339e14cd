"""The reference solver is general: other mechanisms, built with its public API, against own derivations."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reference_solver.equations import Equations
from reference_solver.failures import InconsistentStart, NonFiniteState
from reference_solver.mechanism.constraints import PrescribedMotion, PrescribedSlide
from reference_solver.mechanism.contacts import ClearanceJoint, RigidWall
from reference_solver.mechanism.data import GROUND, Body, ConstantSpeed, Fluctuation, Guide, Pin, Spring
from reference_solver.mechanism.loads import Torque
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.solution import Solution
from reference_solver.solver import solve
from tests.helpers.chains import chain, chain_start
from tests.helpers.kernels import straight_guide
from tests.helpers.orders import ORDER_TOLERANCE, slope

FloatArray = NDArray[np.float64]
#: A mechanism, coordinates and velocities.
Start = tuple[Mechanism, FloatArray, FloatArray]
GRAVITY = 9.81

# Rows of [B]


def test_rows_of_constraints_are_the_derivatives_of_their_gaps() -> None:
    """By central differences with a step of 1e-6 of functions of order 1 to 10."""
    h, at, motion = 1e-6, 0.37, Fluctuation(0.4, 1.3, 5.0 / (2 * np.pi), 0.2)
    line = (0, (0.1, -0.2), 1, (0.3, 0.05), 0.7)
    constraints = (
        Pin(1, (0.2, 0.3), 2, (-0.4, 0.1)),
        Guide(*line),
        Guide(GROUND, (0.4, 0.1), 2, (-0.1, 0.2), -1.1),
        Guide(2, (0.0, 0.3), GROUND, (0.5, -0.6), 2.0),
        PrescribedMotion(0, ConstantSpeed(4.0)),
        PrescribedMotion(1, motion),
        PrescribedSlide(*line, motion),
        PrescribedSlide(GROUND, (0.4, 0.1), 1, (0.3, 0.05), -1.1, motion),
        PrescribedSlide(1, (0.2, 0.1), GROUND, (1.0, 0.3), 0.2, motion),
        ClearanceJoint(0, (0.05, -0.1), 1, (-0.3, 0.02), 0.5, 1.0, RigidWall(0.0)),
        ClearanceJoint(GROUND, (0.5, 0.7), 2, (0.1, 0.0), 0.3, 1.0, RigidWall(0.0)),
    )
    q, v, start = np.linspace(-1.0, 1.4, 9), np.linspace(2.0, -1.5, 9), np.linspace(0.3, -0.2, 9)
    equations = Equations(Mechanism((Body(1.0, 1.0),) * 3, constraints), start)
    of_angles_and_ways = [3, 5, *range(7, 13)]
    assert not equations.violation(0.0, start)[of_angles_and_ways].any(), "these count from the start"
    B, turned = equations.constraint_matrix(q), 0.4 * at + 1.3 / 5.0 * (np.cos(0.2) - np.cos(5.0 * at + 0.2))
    moved = equations.violation(at, q) - equations.violation(0.0, q)
    assert moved[8:] == pytest.approx([-4.0 * at, *[-turned] * 4, 0.0, 0.0])

    def rate(function: Callable[[float], FloatArray]) -> FloatArray:
        return (function(h) - function(-h)) / (2 * h)

    for column, way in enumerate(np.eye(9)):
        found = rate(lambda x, way=way: equations.violation(0.0, q + x * way))  # type: ignore[misc]
        assert np.abs(found - B[:, column]).max() < 1e-8, column
    found = rate(lambda x: equations.constraint_matrix(q + x * v) @ v)
    assert np.abs(found - equations.centripetal(q, v)).max() < 1e-8 * np.abs(v).max() ** 2
    assert np.abs(rate(lambda x: equations.violation(at + x, q)) + equations.speeds(at)).max() < 1e-7
    assert np.abs(rate(lambda x: equations.speeds(at + x)) - equations.system(at, q, v).C_dot).max() < 1e-7


# Motion

ALONG = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])
TIMES = np.linspace(0.0, 1.0, 11)


def oscillator(damping: float) -> Mechanism:
    """A block of 2 kg on a guide at 30 degrees, held by a spring of 200 N/m and free length 0.4 m."""
    guide, end = straight_guide(0, (0.0, 0.0), np.pi / 6), (float(ALONG[0]), float(ALONG[1]))
    spring = Spring(GROUND, end, 0, (0.0, 0.0), 200.0, damping, 0.4)
    return Mechanism((Body(2.0, 1.0),), guide, (spring,))


def off_the_swing(run: Solution) -> list[float]:
    """Return the largest error of a block's place."""
    decay, frequency = 1.0, np.sqrt(99.0)
    swing = np.cos(frequency * TIMES) + decay / frequency * np.sin(frequency * TIMES)
    return [np.abs(run.q - np.outer(0.6 + 0.05 * np.exp(-decay * TIMES) * swing, ALONG)).max()]


def hung(length: float, angle: float, rate: float) -> tuple[Mechanism, FloatArray, FloatArray]:
    """Return a body on a link without mass from the ground to its centre of mass, which spins on its own."""
    link = ClearanceJoint(GROUND, (0, 0), 0, (0, 0), length, 1.0, RigidWall(0.0))
    mechanism = Mechanism((Body(2.0, 0.1),), (link,), (), GRAVITY)
    cos, sin = length * np.cos(angle), length * np.sin(angle)
    return mechanism, np.array([sin, -cos, 0.4]), np.array([cos * rate, sin * rate, 3.0])


def off_the_pendulum(run: Solution) -> list[float]:
    """Return the largest errors of place and angle, and of the pull along the link of 0.5 m."""

    def rates(_: float, y: FloatArray) -> list[float]:
        return [y[1], -GRAVITY / 0.5 * np.sin(y[0])]

    angle, rate = solve_ivp(rates, (0.0, 1.0), [1.2, 2.0], "DOP853", TIMES, rtol=1e-13, atol=1e-14).y
    place = np.column_stack([0.5 * np.sin(angle), -0.5 * np.cos(angle), 0.4 + 3.0 * TIMES])
    pull = 2.0 * (GRAVITY * np.cos(angle) + 0.5 * rate**2)
    return [np.abs(run.q - place).max(), np.abs(run.multipliers[:, 0] * 0.5 + pull).max()]


CASES: dict[str, tuple[Start, tuple[int, ...], Callable[[Solution], list[float]]]] = {
    "damped block on an inclined guide": (
        (oscillator(4.0), 0.65 * ALONG, np.zeros(3)),
        (10, 20, 40),
        off_the_swing,
    ),
    "link without mass": (hung(0.5, 1.2, 2.0), (20, 40, 80), off_the_pendulum),
}


@pytest.mark.parametrize("name", CASES)
def test_a_mechanism_converges_at_order_four_to_its_closed_form(name: str) -> None:
    start, counts, errors = CASES[name]
    runs = [solve(*start, end_time_s=1.0, samples=10, step=0.1 / n, stabilisation="none") for n in counts]
    for found in zip(*map(errors, runs), strict=True):
        order = -slope(counts, found)
        assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.3f} from errors {found}"


# What is refused, and where runs end

ANGLES, RATES = np.array([-0.3, -1.2, 0.4]), np.array([1.0, -2.0, 3.0])


def test_a_torque_on_a_pinned_wheel_gives_the_textbook_angle_exactly() -> None:
    wheel = Mechanism((Body(1.0, 0.5),), (Pin(GROUND, (0.0, 0.0), 0, (0.0, 0.0)),), (Torque(0, 2.0),))
    run = solve(wheel, np.zeros(3), np.zeros(3), end_time_s=1.0, samples=1, step=1 / 8)
    # RK4 integrates a quadratic exactly: only round-off is left.
    assert run.q[-1, 2] == pytest.approx(2.0, abs=1e-14)


@pytest.mark.parametrize(("dq", "dv", "message"), [(1e-6, 0.0, "positions"), (0.0, 1e-3, "velocities")])
def test_an_inconsistent_start_is_refused(dq: float, dv: float, message: str) -> None:
    q, v = chain_start(ANGLES, RATES)
    with pytest.raises(InconsistentStart, match=message):
        solve(chain(3), q + dq, v + dv, end_time_s=1.0, samples=1, step=1.0)


def test_an_unstable_step_ends_in_an_error_that_says_when() -> None:
    # omega h = 10 * 0.5 is past RK4's limit of 2.8284, so the state grows until it overflows.
    with pytest.raises(NonFiniteState, match=r"t = .* s with step 0\.5 s"):
        solve(oscillator(0.0), 0.65 * ALONG, np.zeros(3), end_time_s=500.0, samples=1, step=0.5)


@pytest.mark.parametrize("stabilisation", ["none", "projection"])
def test_an_overflow_is_found_in_its_step_where_each_constraint_has_a_coordinate_of_its_own(
    stabilisation: Literal["none", "projection"],
) -> None:
    far_too_stiff = Spring(GROUND, (1.0, 0.3), 2, (0.1, 0.0), 1e12, 0.0, 0.1)
    swing, start = replace(chain(3), loads=(far_too_stiff,)), chain_start(ANGLES, RATES)
    with pytest.raises(NonFiniteState, match=r"t = 0\.00[1-9] s"):
        solve(swing, *start, end_time_s=1.0, samples=1, step=1e-3, stabilisation=stabilisation)
