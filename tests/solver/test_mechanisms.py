"""The reference solver is general: other mechanisms, built with its public API, against own derivations."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reference_solver.equations import Equations
from reference_solver.failures import InconsistentStart, NonFiniteState, SingularConfiguration
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
from tests.helpers.kernels import VARIANTS, straight_guide
from tests.helpers.orders import ORDER_TOLERANCE, slope
from tests.studies.truth.closed_forms.linkages import GRAVITY, FourBar, Rod, TriplePendulum

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
    stabilisation: str = "none"
    counts: tuple[int, ...] = (40, 80, 160)

    def errors(self, count: int) -> dict[str, float]:
        """Return the largest errors with so many steps in each of ten samples."""
        run = solve(
            self.mechanism, self.q, self.v, end_time_s=self.end_s, samples=10,
            step=self.end_s / 10 / count, stabilisation=VARIANTS[self.stabilisation],
        )  # fmt: skip
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


def four_bar() -> Case:
    of = FourBar(Rod(0.1, 0.4, 4e-4, 0.04), Rod(0.25, 0.3, 2e-3, 0.1), Rod(0.2, 0.35, 1.2e-3, 0.09), 0.28)
    crank, coupler, rocker = of.crank, of.coupler, of.rocker
    mechanism = Mechanism(
        bodies=tuple(Body(rod.mass, rod.inertia) for rod in (crank, coupler, rocker)),
        constraints=(
            RevoluteJoint(GROUND, (0.0, 0.0), 0, (-crank.s, 0.0)),
            RevoluteJoint(0, (crank.length - crank.s, 0.0), 1, (-coupler.s, 0.0)),
            RevoluteJoint(1, (coupler.length - coupler.s, 0.0), 2, (rocker.length - rocker.s, 0.0)),
            RevoluteJoint(2, (-rocker.s, 0.0), GROUND, (of.base, 0.0)),
        ),
        gravity_m_s2=GRAVITY,
    )
    angle, rate = 0.7, 20.0
    X, X_1, _ = of.bodies(angle)
    motion = of.motion(angle, rate, np.linspace(0, 0.5, 11))
    exact = {"places": np.array([of.bodies(theta)[0][:, :2] for theta in motion[:, 0]])}
    return Case(mechanism, X.ravel(), (X_1 * rate).ravel(), 0.5, lambda run: {"places": places(run)}, exact)


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


class ScotchYoke:
    """A crank whose pin slides and turns in an upright slot of a yoke, which slides along x."""

    radius, arm, mass, inertia, yoke = 0.05, 0.02, 0.4, 4e-4, 0.6
    start, rate, end = 0.4, 30.0, 0.3
    mechanism = Mechanism(
        (Body(mass, inertia), Body(yoke, 1e-3)),
        (
            RevoluteJoint(GROUND, (0.0, 0.0), 0, (-arm, 0.0)),
            *straight_guide(1, (0.0, 0.0), 0.0),
            Slot(1, (0.0, 0.0), 0, (radius - arm, 0.0), np.pi / 2),
        ),
        gravity_m_s2=GRAVITY,
    )

    def places(self, phi: FloatArray) -> FloatArray:
        """Return (..., 2, 3): places and angles of crank and yoke."""
        c, s, zero = np.cos(phi), np.sin(phi), 0 * phi
        crank = np.stack([self.arm * c, self.arm * s, phi], -1)
        return np.stack([crank, np.stack([self.radius * c, zero, zero], -1)], -2)

    def changes(self, phi: FloatArray) -> FloatArray:
        """Return their derivatives by phi."""
        c, s, zero = np.cos(phi), np.sin(phi), 0 * phi
        crank = np.stack([-self.arm * s, self.arm * c, zero + 1], -1)
        return np.stack([crank, np.stack([-self.radius * s, zero, zero], -1)], -2)


def turned(case: ScotchYoke) -> FloatArray:
    """Return the crank's angle at eleven times: it turns forwards, as fast as the energy lets it."""
    weights = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in case.mechanism.bodies])

    def inertia(phi: FloatArray) -> FloatArray:
        return np.asarray((weights * case.changes(phi) ** 2).sum((-1, -2)))

    def potential(phi: FloatArray) -> FloatArray:
        return np.asarray(GRAVITY * (weights[:, 0] * case.places(phi)[..., 1]).sum(-1))

    start, times = np.array([case.start]), np.linspace(0.0, case.end, 11)
    energy = inertia(start) * case.rate**2 / 2 + potential(start)

    def rate(_: float, phi: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(2 * (energy - potential(phi)) / inertia(phi)))

    found = solve_ivp(rate, (0.0, case.end), start, "DOP853", times, rtol=1e-13, atol=1e-13)
    return np.asarray(found.y[0])


def yoke(stabilisation: str = "none") -> Case:
    case = ScotchYoke()
    q, v = case.places(np.array(case.start)).ravel(), (case.changes(np.array(case.start)) * case.rate).ravel()

    def numbers(run: Solution) -> dict[str, FloatArray]:
        return {"q": run.q.reshape(len(run.q), -1, 3)}

    exact = {"q": case.places(turned(case))}
    return Case(case.mechanism, q, v, case.end, numbers, exact, stabilisation)


CASES: dict[str, Callable[[], Case]] = {
    "triple pendulum": pendulum,
    "four-bar": four_bar,
    "damped block on an inclined guide": block,
    "Scotch yoke": yoke,
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


@pytest.mark.parametrize("stabilisation", ["projection", "baumgarte"])
def test_slots_hold_with_stabilisation(stabilisation: str) -> None:
    assert yoke(stabilisation).errors(400)["q"] < 1e-8


# What is refused, and where runs end


def test_a_torque_on_a_pinned_wheel_gives_the_textbook_angle_exactly() -> None:
    wheel = Mechanism(
        (Body(1.0, 0.5),), (RevoluteJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0)),), (Torque(0, 2.0),)
    )
    run = solve(wheel, np.zeros(3), np.zeros(3), end_time_s=1.0, samples=1, step=1 / 8)
    # RK4 integrates a quadratic exactly: only round-off is left.
    assert run.q[-1, 2] == pytest.approx(2.0, abs=1e-14)


def test_redundant_constraints_raise_an_error_that_names_the_rank() -> None:
    case, pinned_twice = pendulum(), RevoluteJoint(GROUND, (0.0, 0.0), 0, (-RODS[0].s, 0.0))
    redundant = replace(case.mechanism, constraints=(*case.mechanism.constraints, pinned_twice))
    with pytest.raises(SingularConfiguration, match="rank 6 of 8 at t = 0 s") as caught:
        solve(redundant, case.q, case.v, end_time_s=1.0, samples=1, step=1.0)
    assert (caught.value.rank, caught.value.rows) == (6, 8)


def test_two_drivers_on_one_body_raise_an_error_that_names_the_rank() -> None:
    wheel = Mechanism(
        (Body(1.0, 0.5),),
        (RevoluteJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0)), PrescribedSpeed(0, 1.0), PrescribedSpeed(0, 1.0)),
    )
    with pytest.raises(SingularConfiguration, match="rank 3 of 4"):
        solve(wheel, np.zeros(3), np.array([0, 0, 1.0]), end_time_s=1.0, samples=1, step=1.0)


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
