"""Loads along lines of moving bodies, loads by time and speed, and slides by a function of time."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.energy import created_J, kinetic_J, swing_s
from reference_solver.equations import Equations
from reference_solver.failures import SingularConfiguration
from reference_solver.mechanism.constraints import Constraint, PrescribedMotion, PrescribedSlide
from reference_solver.mechanism.data import GROUND, Body, ConstantSpeed, Pin, Spring
from reference_solver.mechanism.loads import (
    AlongLine,
    ConstantForce,
    ForceByTime,
    GasForce,
    LineDamper,
    LineSpring,
    Load,
    Torque,
    TorqueByTime,
    TurningDamper,
)
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.motions import PiecewiseCubic
from reference_solver.mechanism.scales import scales_of
from reference_solver.solution import Solution
from reference_solver.solver import ErrorControl, solve
from tests.helpers.kernels import straight_guide

FloatArray = NDArray[np.float64]
#: Central differences with a step of 1e-6 of functions of order 1 to 10.
STEP, DIFFERENCE = 1e-6, 1e-7
BODIES = (Body(1.0, 0.3), Body(2.0, 0.5))
#: A line of body 0, and a point of body 1 that is not on it.
ENDS = (0, (0.1, -0.2), 1, (0.3, 0.05), 0.7)
#: A line of the frame.
FIXED = (GROUND, (0.4, 0.1), 1, (0.3, 0.05), -1.1)
Q, V = np.array([0.2, -0.3, 0.5, 1.1, 0.4, -0.8]), np.array([0.7, -0.4, 1.9, -0.6, 0.3, -1.2])
NOW = 0.37
#: Straight lines with kinks, at times that no step of a run without them lands on.
TIMES, VALUES = (0.0, 0.21, 0.34, 0.55, 0.8), (1.0, -6.0, 4.0, 5.0, 0.0)


def lines(x: tuple[float, ...], y: tuple[float, ...]) -> PiecewiseCubic:
    """Return straight lines between points, the last of which goes on as it is."""
    slopes = [*(np.diff(y) / np.diff(x)), 0.0]
    return PiecewiseCubic(tuple(float(part) for row in zip(x, y, slopes) for part in (*row, 0.0, 0.0)))  # noqa: B905


TABLE = lines(TIMES, VALUES)


def cubic(x: float) -> float:
    """Return what ``CUBIC`` is."""
    return 2.0 - 0.5 * x + 0.3 * x**2 - 0.04 * x**3


CUBIC = PiecewiseCubic((0.0, 2.0, -0.5, 0.3, -0.04))
RISING = PiecewiseCubic((0.0, 0.0, 4.0, 0.0, 0.0))


def way(line: AlongLine, q: FloatArray) -> float:
    """Return s: how far along the line, from its point, the point of body j is."""

    def place(body: int, point: tuple[float, float]) -> complex:
        x, y, angle = (0.0, 0.0, 0.0) if body == GROUND else q[3 * body : 3 * body + 3]
        return complex(complex(x, y) + complex(*point) * np.exp(1j * angle))

    angle = line.angle_rad + (0.0 if line.body_i == GROUND else q[3 * line.body_i + 2])
    apart = place(line.body_j, line.point_j) - place(line.body_i, line.point_i)
    return float((apart * np.exp(-1j * angle)).real)


def gradient(function: Callable[[FloatArray], float], q: FloatArray) -> FloatArray:
    """Return the derivatives of a function by the coordinates."""
    steps = STEP * np.eye(len(q))
    return np.array([(function(q + step) - function(q - step)) / (2 * STEP) for step in steps])


ALONG: list[Load] = [
    load
    for line in (ENDS, FIXED)
    for load in (
        ConstantForce(*line, 3.0),
        LineSpring(*line, 40.0, 0.2),
        LineDamper(*line, 5.0),
        GasForce(*line, 1, CUBIC),
        ForceByTime(*line, CUBIC),
    )
]


@pytest.mark.parametrize("load", ALONG, ids=lambda load: type(load).__name__)
def test_a_load_along_a_line_does_the_work_of_its_force_on_s(load: AlongLine) -> None:
    row = gradient(lambda q: way(load, q), Q)
    forces = {
        ConstantForce: 3.0,
        LineSpring: -40.0 * (way(load, Q) - 0.2),
        LineDamper: -5.0 * (row @ V),
        GasForce: cubic(Q[5]),
        ForceByTime: cubic(NOW),
    }
    expected = forces[type(load)] * row
    equations = Equations(Mechanism(BODIES, (), (load,)), Q)
    assert np.abs(equations.applied_force(NOW, Q, V) - expected).max() < 10 * DIFFERENCE
    if isinstance(load, ConstantForce | LineSpring):
        assert np.abs(equations.stored_force(Q) - expected).max() < 10 * DIFFERENCE
    else:
        assert not equations.stored_force(Q).any()
        power = equations.answer(NOW, Q, V).powers["load0"]
        assert power == pytest.approx(expected @ V, abs=10 * DIFFERENCE)


def run(mechanism: Mechanism, q: FloatArray, v: FloatArray, **settings: Any) -> Solution:
    """Return a run of 1 s with ten samples."""
    return solve(mechanism, q, v, **{"end_time_s": 1.0, "samples": 10, "step": 0.007} | settings)


SETTINGS = pytest.mark.parametrize(
    "settings",
    [{}, {"step": ErrorControl(1e-12)}],
    ids=["rk4", "dop853"],
)


def test_loads_between_free_bodies_keep_momentum_and_the_ledger_closes() -> None:
    loads = *ALONG[:4], ForceByTime(*ENDS, TABLE)
    mechanism = Mechanism(BODIES, (), (*loads, Spring(0, (0.1, 0.0), 1, (0.0, 0.2), 30.0, 4.0, 0.5)))
    found = run(mechanism, Q, V, step=2e-3)
    masses = np.array([body.mass_kg for body in BODIES])
    inertias = np.array([body.inertia_kg_m2 for body in BODIES])
    x, y, _ = found.q.reshape(-1, 2, 3).transpose(2, 0, 1)
    x_rate, y_rate, spin = found.v.reshape(-1, 2, 3).transpose(2, 0, 1)
    momenta = x_rate @ masses, y_rate @ masses, (x * y_rate - y * x_rate) @ masses + spin @ inertias
    assert np.ptp(spin, axis=0).min() > 0.3, "there is something to keep"
    for momentum in momenta[:2]:
        assert np.abs(momentum - momentum[0]).max() < 1e-12, "linear ones RK4 keeps to round-off"
    assert np.abs(momenta[2] - momenta[2][0]).max() < 1e-8
    assert created_J(found).max() < 1e-7 * kinetic_J(mechanism, found.v).max()


@SETTINGS
def test_a_force_by_time_is_exact_where_its_lines_are_since_steps_land_on_its_kinks(
    settings: dict[str, Any],
) -> None:
    mass, tilt, g, g_x = 2.0, 0.4, 9.81, 3.0
    force = ForceByTime(GROUND, (0.0, 0.0), 0, (0.0, 0.0), tilt, TABLE)
    guide = straight_guide(0, (0.0, 0.0), tilt)
    block = Mechanism((Body(mass, 1.0),), guide, (force,), g, gravity_x_m_s2=g_x)
    found = run(block, np.zeros(3), np.zeros(3), **settings)
    u, expected = np.array([np.cos(tilt), np.sin(tilt), 0.0]), []
    for end in found.time_s:
        cuts = np.unique(np.clip([0.0, *TIMES, end], 0.0, end))
        s = speed = 0.0
        for a, b in pairwise(cuts):
            first, last = np.interp([a, b], TIMES, VALUES) / mass - g * u[1] + g_x * u[0]
            h = b - a
            s, speed = s + h * speed + h**2 * (2 * first + last) / 6, speed + h * (first + last) / 2
        expected.append((s, speed))
    s, speed = np.array(expected).T
    bound = 1e-10 if "step" in settings else 1e-13
    assert np.abs(found.q - np.outer(s, u)).max() < bound
    assert np.abs(found.v - np.outer(speed, u)).max() < bound
    gained = mass * speed**2 / 2 + mass * (g * u[1] - g_x * u[0]) * s
    assert np.abs(found.sums["load0"] - gained).max() < 10 * bound


def test_a_dependence_is_told_by_the_names_of_the_joints_in_it() -> None:
    ends, far = (GROUND, (0.0, 0.0), 0, (0.0, 0.0)), Pin(0, (1.0, 0.0), 1, (0.0, 0.0), "A")
    drive = PrescribedMotion(0, ConstantSpeed(1.0))

    def pinned(one: str, other: str) -> Mechanism:
        return Mechanism(BODIES, (Pin(*ends, one), far, Pin(*ends, other)))

    driven = Mechanism(BODIES, (Pin(*ends), drive, drive))
    q, v = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0]), np.zeros(6)
    for mechanism, rank, rows, joints in (
        (pinned("", ""), 4, 6, ("Pin 0", "Pin 2")),
        (pinned("C", "C"), 4, 6, ("C",)),
        (pinned("O", "P"), 4, 6, ("O", "P")),
        (driven, 3, 4, ("drive",)),
    ):
        turning = v + (mechanism is driven) * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        with pytest.raises(SingularConfiguration) as refusal:
            run(mechanism, q, turning)
        assert (refusal.value.rank, refusal.value.rows, refusal.value.joints) == (rank, rows, joints)
        told = f"the joints' rows have rank {rank} of {rows} at t = 0 s, those of {', '.join(joints)} depend"
        assert str(refusal.value).startswith(told)


def test_scales_know_slides_by_their_length_and_loads_by_what_they_will_do() -> None:
    def rate(*constraints: Constraint, loads: tuple[Load, ...] = (), g_x: float = 0.0) -> float:
        mechanism = Mechanism(BODIES, constraints, loads, gravity_x_m_s2=g_x)
        return scales_of(mechanism, np.zeros(6), np.zeros(6), np.zeros(6), 1.0).rate_s

    line = (GROUND, (0.0, 0.0), 0, (0.5, 0.0), 0.0)
    slide, turn = PrescribedSlide(*line, ConstantSpeed(-3.0)), PrescribedMotion(0, ConstantSpeed(2.0))
    assert rate(slide) == pytest.approx(3.0 / 0.5)
    assert rate(slide, turn) == pytest.approx(6.0)
    assert rate(turn, Pin(*line[:4])) == pytest.approx(2.0)
    assert rate(loads=(ForceByTime(*line, TABLE),)) == pytest.approx(np.sqrt(6.0 / 1.0 / 0.5))
    assert rate(loads=(ConstantForce(0, (0.0, 0.0), 1, (0.5, 0.0), 0.0, 6.0),)) == pytest.approx(
        np.sqrt(12.0)
    )
    assert rate(loads=(TorqueByTime(1, RISING),)) == pytest.approx(np.sqrt(4.0 / 0.5))
    assert rate(loads=(Torque(1, 0.0),), g_x=-9.0) == pytest.approx(3.0)
    free = Mechanism(BODIES, ())
    assert swing_s(TurningDamper(1, 3.0), free) == pytest.approx(6.0)
    both = 1 / 1.0 + 0.05 / 0.3 + 1 / 2.0 + (0.3**2 + 0.05**2) / 0.5
    assert swing_s(LineSpring(*ENDS, 40.0, 0.0), free) == pytest.approx(np.sqrt(40.0 * both))
