"""The reference solver is general: other mechanisms, built with its public API, against own derivations."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.equations import Equations
from reference_solver.failures import InconsistentStart, NonFiniteState
from reference_solver.mechanism.mechanism import (
    GROUND,
    Body,
    MasslessLink,
    Mechanism,
    PrescribedMotion,
    PrescribedSlide,
    PrescribedSpeed,
    RevoluteJoint,
    SameAngle,
    Slot,
    SpringDamper,
    Torque,
)
from reference_solver.mechanism.motions import Fluctuation
from reference_solver.solution import Solution
from reference_solver.solver import solve
from tests.helpers.kernels import straight_guide
from tests.helpers.orders import ORDER_TOLERANCE, slope
from tests.studies.truth.closed_forms.linkages import GRAVITY, Rod, TriplePendulum

FloatArray = NDArray[np.float64]

# Rows of [B]


def test_rows_of_constraints_are_the_derivatives_of_their_gaps() -> None:
    """By central differences with a step of 1e-6 of functions of order 1 to 10."""
    h, at, motion = 1e-6, 0.37, Fluctuation(0.4, 1.3, 5.0, 0.2)
    line = (0, (0.1, -0.2), 1, (0.3, 0.05), 0.7)
    constraints = (
        RevoluteJoint(1, (0.2, 0.3), 2, (-0.4, 0.1)),
        Slot(*line),
        Slot(GROUND, (0.4, 0.1), 2, (-0.1, 0.2), -1.1),
        Slot(2, (0.0, 0.3), GROUND, (0.5, -0.6), 2.0),
        SameAngle(0, 2),
        SameAngle(GROUND, 1),
        SameAngle(2, GROUND),
        PrescribedSpeed(0, 4.0),
        PrescribedMotion(1, motion),
        PrescribedSlide(*line, motion),
        PrescribedSlide(GROUND, (0.4, 0.1), 1, (0.3, 0.05), -1.1, motion),
        PrescribedSlide(1, (0.2, 0.1), GROUND, (1.0, 0.3), 0.2, motion),
        MasslessLink(0, (0.05, -0.1), 1, (-0.3, 0.02), 0.5),
        MasslessLink(GROUND, (0.5, 0.7), 2, (0.1, 0.0), 0.3),
    )
    q, v, start = np.linspace(-1.0, 1.4, 9), np.linspace(2.0, -1.5, 9), np.linspace(0.3, -0.2, 9)
    equations = Equations(Mechanism((Body(1.0, 1.0),) * 3, constraints), start)
    assert not equations.violation(0.0, start)[5:13].any(), "angles and ways count from the start"
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


@dataclass(frozen=True)
class Case:
    """A mechanism with its start and end, and the numbers of runs that are to be those of its closed form."""

    mechanism: Mechanism
    q: FloatArray
    v: FloatArray
    end_s: float
    numbers: Callable[[Solution], dict[str, FloatArray]]
    exact: dict[str, FloatArray]
    counts: tuple[int, ...] = (40, 80, 160)

    def errors(self, count: int) -> dict[str, float]:
        """Return the largest errors with so many steps in each of ten samples."""
        end, step = self.end_s, self.end_s / 10 / count
        run = solve(
            self.mechanism, self.q, self.v, end_time_s=end, samples=10, step=step, stabilisation="none"
        )
        return {name: float(np.abs(x - self.exact[name]).max()) for name, x in self.numbers(run).items()}


RODS = Rod(0.3, 0.5, 4e-3, 0.12), Rod(0.2, 0.4, 2e-3, 0.1), Rod(0.25, 0.3, 2e-3, 0.15)
ANGLES, RATES = np.array([-0.3, -1.2, 0.4]), np.array([1.0, -2.0, 3.0])


def places(run: Solution) -> FloatArray:
    """Return where the centres of mass are, (s, bodies, 2)."""
    return run.q.reshape(len(run.q), -1, 3)[:, :, :2]


def pendulum(massless: bool = False) -> Case:
    """Return a triple pendulum, whose first rod may be a link without mass."""
    rods = (Rod(0.3, 0.0, 0.0, 0.0), *RODS[1:]) if massless else RODS
    of, angles = TriplePendulum(rods), ANGLES - [0.5 * massless, 0, 0]
    hung = RevoluteJoint(GROUND, (0.0, 0.0), 0, (-rods[0].s, 0.0))
    link = MasslessLink(GROUND, (0.0, 0.0), 0, (-rods[1].s, 0.0), rods[0].length)
    others = rods[massless:]
    joints = [
        RevoluteJoint(k, (one.length - one.s, 0.0), k + 1, (-other.s, 0.0))
        for k, (one, other) in enumerate(pairwise(others))
    ]
    bodies = tuple(Body(rod.mass, rod.inertia) for rod in others)
    mechanism = Mechanism(bodies, (link if massless else hung, *joints), gravity_m_s2=GRAVITY)
    states = of.motion(angles, RATES, np.linspace(0, 0.5, 11))
    exact = {
        "places": np.array([of.centres(s[:3])[massless:] for s in states]),
        "hanging force": np.array([of.hanging_force(s[:3], s[3:]) for s in states]),
    }
    q = np.column_stack([of.centres(angles), angles])[massless:].ravel()
    v = np.column_stack([of.centre_rates(angles, RATES), RATES])[massless:].ravel()

    def numbers(run: Solution) -> dict[str, FloatArray]:
        force = run.multipliers[:, :2]
        if massless:
            arm = np.column_stack([np.cos(run.q[:, 2]), np.sin(run.q[:, 2])])
            force = run.multipliers[:, :1] * (run.q[:, :2] - rods[1].s * arm)
        return {"places": places(run), "hanging force": force}

    return Case(mechanism, q, v, 0.5, numbers, exact)


ALONG = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0.0])


def oscillator(damping: float) -> Mechanism:
    """A block of 2 kg on a guide at 30 degrees, held by a spring of 200 N/m and free length 0.4 m."""
    guide, end = straight_guide(0, (0.0, 0.0), np.pi / 6), (float(ALONG[0]), float(ALONG[1]))
    spring = SpringDamper(GROUND, end, 0, (0.0, 0.0), 200.0, damping, 0.4)
    return Mechanism((Body(2.0, 1.0),), guide, (spring,))


def block() -> Case:
    times, rest, offset, decay = np.linspace(0, 1.0, 11), 0.6, 0.05, 1.0
    frequency = np.sqrt(100.0 - decay**2)
    swing = np.cos(frequency * times) + decay / frequency * np.sin(frequency * times)
    exact = {"q": np.outer(rest + offset * np.exp(-decay * times) * swing, ALONG)}
    start = (rest + offset) * ALONG, np.zeros(3)
    return Case(oscillator(4.0), *start, 1.0, lambda run: {"q": run.q}, exact, counts=(10, 20, 40))


CASES: dict[str, Callable[[], Case]] = {
    "triple pendulum": pendulum,
    "damped block on an inclined guide": block,
    "link without mass": lambda: pendulum(massless=True),
}


@pytest.mark.parametrize("name", CASES)
def test_a_mechanism_converges_at_order_four_to_its_closed_form(name: str) -> None:
    case = CASES[name]()
    found = [case.errors(count) for count in case.counts]
    for of in case.exact:
        errors = [each[of] for each in found]
        order = -slope(case.counts, errors)
        assert abs(order - 4) < ORDER_TOLERANCE, f"{of}: order {order:.3f} from errors {errors}"


# What is refused, and where runs end


def test_a_torque_on_a_pinned_wheel_gives_the_textbook_angle_exactly() -> None:
    wheel = Mechanism(
        (Body(1.0, 0.5),), (RevoluteJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0)),), (Torque(0, 2.0),)
    )
    run = solve(wheel, np.zeros(3), np.zeros(3), end_time_s=1.0, samples=1, step=1 / 8)
    # RK4 integrates a quadratic exactly: only round-off is left.
    assert run.q[-1, 2] == pytest.approx(2.0, abs=1e-14)


@pytest.mark.parametrize(("dq", "dv", "message"), [(1e-6, 0.0, "positions"), (0.0, 1e-3, "velocities")])
def test_an_inconsistent_start_is_refused(dq: float, dv: float, message: str) -> None:
    case = pendulum()
    with pytest.raises(InconsistentStart, match=message):
        solve(case.mechanism, case.q + dq, case.v + dv, end_time_s=1.0, samples=1, step=1.0)


def test_an_unstable_step_ends_in_an_error_that_says_when() -> None:
    # omega h = 10 * 0.5 is past RK4's limit of 2.8284, so the state grows until it overflows.
    with pytest.raises(NonFiniteState, match=r"t = .* s with step 0\.5 s"):
        solve(oscillator(0.0), 0.65 * ALONG, np.zeros(3), end_time_s=500.0, samples=1, step=0.5)


@pytest.mark.parametrize("stabilisation", ["none", "projection"])
def test_an_overflow_is_found_in_its_step_where_each_constraint_has_a_coordinate_of_its_own(
    stabilisation: Literal["none", "projection"],
) -> None:
    far_too_stiff = SpringDamper(GROUND, (1.0, 0.3), 2, (0.1, 0.0), 1e12, 0.0, 0.1)
    case = pendulum()
    swing = replace(case.mechanism, loads=(far_too_stiff,))
    with pytest.raises(NonFiniteState, match=r"t = 0\.00[1-9] s"):
        solve(swing, case.q, case.v, end_time_s=1.0, samples=1, step=1e-3, stabilisation=stabilisation)
