"""Joints and loads against derivatives of their own, motions in closed form, and what is refused."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from reference_solver.energy import kinetic_J, ledger_J
from reference_solver.equations import Equations
from reference_solver.failures import InconsistentStart, NonFiniteState, SingularConfiguration
from reference_solver.mechanism.constraints import PrescribedMotion, PrescribedSlide
from reference_solver.mechanism.contacts import ClearanceJoint, RigidWall
from reference_solver.mechanism.data import GROUND, Body, ConstantSpeed, Fluctuation, Guide, Line, Pin, Spring
from reference_solver.mechanism.loads import ByAngle, ByTime, Constant, Damping, Force, Restoring
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.motions import PiecewiseCubic
from reference_solver.solver import ErrorControl
from tests.helpers.chains import chain, chain_start
from tests.helpers.kernels import straight_guide
from tests.solver.pins import run

FloatArray = NDArray[np.float64]
#: Central differences with a step of 1e-6 of functions of order 1 to 10.
STEP, DIFFERENCE = 1e-6, 1e-7
#: A line of body 0 with a point of body 1 that is not on it, and a line of the frame.
LINE, FIXED = (0, (0.1, -0.2), 1, (0.3, 0.05), 0.7), (GROUND, (0.4, 0.1), 1, (0.3, 0.05), -1.1)


def rate(function: Callable[[float], FloatArray]) -> FloatArray:
    return (function(STEP) - function(-STEP)) / (2 * STEP)


def test_rows_of_constraints_are_the_derivatives_of_their_gaps() -> None:
    at, motion, wall = 0.37, Fluctuation(0.4, 1.3, 5.0 / (2 * np.pi), 0.2), RigidWall(0.0)
    constraints = (
        Pin(1, (0.2, 0.3), 2, (-0.4, 0.1)),
        Guide(*LINE),
        Guide(GROUND, (0.4, 0.1), 2, (-0.1, 0.2), -1.1),
        Guide(2, (0.0, 0.3), GROUND, (0.5, -0.6), 2.0),
        PrescribedMotion(0, ConstantSpeed(4.0)),
        PrescribedMotion(1, motion),
        PrescribedSlide(*LINE, motion),
        PrescribedSlide(*FIXED, motion),
        PrescribedSlide(1, (0.2, 0.1), GROUND, (1.0, 0.3), 0.2, motion),
        ClearanceJoint(0, (0.05, -0.1), 1, (-0.3, 0.02), 0.5, 1.0, wall),
        ClearanceJoint(GROUND, (0.5, 0.7), 2, (0.1, 0.0), 0.3, 1.0, wall),
    )
    q, v, start = np.linspace(-1.0, 1.4, 9), np.linspace(2.0, -1.5, 9), np.linspace(0.3, -0.2, 9)
    equations = Equations(Mechanism((Body(1.0, 1.0),) * 3, constraints), start)
    of_angles_and_ways = [3, 5, *range(7, 13)]
    assert not equations.system(0.0, start).g[of_angles_and_ways].any(), "these count from the start"
    B, turned = equations.system(0.0, q).B, 0.4 * at + 1.3 / 5.0 * (np.cos(0.2) - np.cos(5.0 * at + 0.2))
    moved = equations.system(at, q).g - equations.system(0.0, q).g
    assert moved[8:] == pytest.approx([-4.0 * at, *[-turned] * 4, 0.0, 0.0])
    for column, way in enumerate(np.eye(9)):
        found = rate(lambda x, way=way: equations.system(0.0, q + x * way).g)  # type: ignore[misc]
        assert np.abs(found - B[:, column]).max() < DIFFERENCE, column
    found = rate(lambda x: equations.system(0.0, q + x * v).B @ v)
    assert np.abs(found - equations.system(0.0, q, v).B_dot_v).max() < DIFFERENCE
    assert (
        np.abs(rate(lambda x: equations.system(at + x, q).g) + equations.system(at, q).C).max() < DIFFERENCE
    )
    accelerated = equations.system(at, q, v).C_dot
    assert np.abs(rate(lambda x: equations.system(at + x, q).C) - accelerated).max() < DIFFERENCE


# Loads

BODIES = (Body(1.0, 0.3), Body(2.0, 0.5))
Q, V, NOW = np.array([0.2, -0.3, 0.5, 1.1, 0.4, -0.8]), np.array([0.7, -0.4, 1.9, -0.6, 0.3, -1.2]), 0.37
CUBIC = PiecewiseCubic((0.0, 2.0, -0.5, 0.3, -0.04))
#: Straight lines with kinks, at times that no step of a run without them lands on.
TIMES, VALUES = (0.0, 0.21, 0.34, 0.55, 0.8), (1.0, -6.0, 4.0, 5.0, 0.0)
SLOPES = (*(np.diff(VALUES) / np.diff(TIMES)).tolist(), 0.0)
TABLE = PiecewiseCubic(tuple(x for row in zip(TIMES, VALUES, SLOPES, strict=True) for x in (*row, 0.0, 0.0)))


def cubic(x: float) -> float:
    """Return what ``CUBIC`` is."""
    return 2.0 - 0.5 * x + 0.3 * x**2 - 0.04 * x**3


def way(line: Line, q: FloatArray) -> float:
    """Return s: how far along the line, from its point, the point of body j is."""

    def place(body: int, point: tuple[float, float]) -> complex:
        x, y, angle = (0.0, 0.0, 0.0) if body == GROUND else q[3 * body : 3 * body + 3]
        return complex(complex(x, y) + complex(*point) * np.exp(1j * angle))

    angle = line.angle_rad + (0.0 if line.body_i == GROUND else q[3 * line.body_i + 2])
    apart = place(line.body_j, line.point_j) - place(line.body_i, line.point_i)
    return float((apart * np.exp(-1j * angle)).real)


def along(line: tuple[int, tuple[float, float], int, tuple[float, float], float]) -> tuple[Force, ...]:
    laws = Constant(3.0), Restoring(40.0, 0.2), Damping(5.0), ByAngle(CUBIC, 1), ByTime(CUBIC)
    return tuple(Force(*line, law) for law in laws)


@pytest.mark.parametrize("load", [*along(LINE), *along(FIXED)], ids=lambda load: type(load.law).__name__)
def test_a_load_along_a_line_does_the_work_of_its_force_on_s(load: Force) -> None:
    row = np.array([rate(lambda x, by=by: np.float64(way(load, Q + x * by))) for by in np.eye(6)])  # type: ignore[misc]
    forces = {
        Constant: 3.0,
        Restoring: -40.0 * (way(load, Q) - 0.2),
        Damping: -5.0 * (row @ V),
        ByAngle: cubic(Q[5]),
        ByTime: cubic(NOW),
    }
    expected = forces[type(load.law)] * row
    equations = Equations(Mechanism(BODIES, (), (load,)), Q)
    assert np.abs(equations.forces(NOW, Q, V)[0] - expected).max() < 10 * DIFFERENCE
    if isinstance(load.law, Constant | Restoring):
        assert np.abs(equations.stored_force(Q) - expected).max() < 10 * DIFFERENCE
    else:
        assert not equations.stored_force(Q).any()
        power = equations.answer(NOW, Q, V).powers["load0"]
        assert power == pytest.approx(expected @ V, abs=10 * DIFFERENCE)


def test_loads_between_free_bodies_keep_momentum_and_the_ledger_closes() -> None:
    spring = Spring(0, (0.1, 0.0), 1, (0.0, 0.2), 30.0, 4.0, 0.5)
    mechanism = Mechanism(BODIES, (), (*along(LINE)[:4], Force(*LINE, ByTime(TABLE)), spring))
    found = run(mechanism, Q, V, 1.0, 500)
    masses, inertias = np.array([[body.mass_kg, body.inertia_kg_m2] for body in BODIES]).T
    x, y, _ = found.q.reshape(-1, 2, 3).transpose(2, 0, 1)
    x_rate, y_rate, spin = found.v.reshape(-1, 2, 3).transpose(2, 0, 1)
    momenta = x_rate @ masses, y_rate @ masses, (x * y_rate - y * x_rate) @ masses + spin @ inertias
    assert np.ptp(spin, axis=0).min() > 0.3, "there is something to keep"
    for momentum, bound in zip(momenta, (1e-12, 1e-12, 1e-8), strict=True):  # linear ones to round-off
        assert np.abs(momentum - momentum[0]).max() < bound
    assert np.abs(ledger_J(found).sum(axis=0)).max() < 1e-7 * kinetic_J(mechanism, found.v).max()


@pytest.mark.parametrize(("step", "bound"), [(143, 1e-13), (ErrorControl(1e-12), 1e-10)])
def test_a_force_by_time_is_exact_where_its_lines_are_since_steps_land_on_its_kinks(
    step: int | ErrorControl, bound: float
) -> None:
    mass, tilt, g, g_x = 2.0, 0.4, 9.81, 3.0
    force = Force(GROUND, (0.0, 0.0), 0, (0.0, 0.0), tilt, ByTime(TABLE))
    guide = straight_guide(0, (0.0, 0.0), tilt)
    block = Mechanism((Body(mass, 1.0),), guide, (force,), g, gravity_x_m_s2=g_x)
    found = run(block, np.zeros(3), np.zeros(3), 1.0, step)
    u, expected = np.array([np.cos(tilt), np.sin(tilt), 0.0]), []
    for end in found.time_s:
        s = speed = 0.0
        for a, b in pairwise(np.unique(np.clip([0.0, *TIMES, end], 0.0, end))):
            first, last = np.interp([a, b], TIMES, VALUES) / mass - g * u[1] + g_x * u[0]
            h = b - a
            s, speed = s + h * speed + h**2 * (2 * first + last) / 6, speed + h * (first + last) / 2
        expected.append((s, speed))
    s, speed = np.array(expected).T
    assert np.abs(found.q - np.outer(s, u)).max() < bound
    assert np.abs(found.v - np.outer(speed, u)).max() < bound
    gained = mass * speed**2 / 2 + mass * (g * u[1] - g_x * u[0]) * s
    assert np.abs(found.sums["load0"] - gained).max() < 10 * bound


# What is refused, and where runs end

SWING, START = chain(3), chain_start(np.array([-0.3, -1.2, 0.4]), np.array([1.0, -2.0, 3.0]))


def test_starts_off_the_constraints_and_steps_that_blow_up_are_refused() -> None:
    for dq, dv, message in ((1e-6, 0.0, "positions"), (0.0, 1e-3, "velocities")):
        with pytest.raises(InconsistentStart, match=message):
            run(SWING, START[0] + dq, START[1] + dv, 1.0, 1)
    far_too_stiff = Spring(GROUND, (1.0, 0.3), 2, (0.1, 0.0), 1e12, 0.0, 0.1)
    with pytest.raises(NonFiniteState, match=r"t = 0\.00[1-9] s"):
        run(replace(SWING, loads=(far_too_stiff,)), *START, 1.0, 1000, 1)


def test_a_dependence_is_told_by_the_names_of_the_joints_in_it() -> None:
    ends, far = (GROUND, (0.0, 0.0), 0, (0.0, 0.0)), Pin(0, (1.0, 0.0), 1, (0.0, 0.0), "A")
    drive = PrescribedMotion(0, ConstantSpeed(1.0))
    for constraints, rank, rows, joints in (
        ((Pin(*ends), far, Pin(*ends)), 4, 6, ("Pin 0", "Pin 2")),
        ((Pin(*ends, "C"), far, Pin(*ends, "C")), 4, 6, ("C",)),
        ((Pin(*ends, "O"), far, Pin(*ends, "P")), 4, 6, ("O", "P")),
        ((Pin(*ends), drive, drive), 3, 4, ("drive",)),
    ):
        turning = np.array([0.0, 0.0, float(drive in constraints), 0.0, 0.0, 0.0])
        with pytest.raises(SingularConfiguration) as refusal:
            run(Mechanism(BODIES, constraints), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0], turning, 1.0, 143)
        assert (refusal.value.rank, refusal.value.rows, refusal.value.joints) == (rank, rows, joints)
        told = f"the joints' rows have rank {rank} of {rows} at t = 0 s, those of {', '.join(joints)} depend"
        assert str(refusal.value).startswith(told)
