"""Error control: its order, its tolerance, located events, other units, and where it ends."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ellipk

from reference_solver.mechanism.contacts import ContactLaw, RigidWall
from reference_solver.mechanism.data import GROUND, Body, FrictionLaw, Pin
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Solution
from reference_solver.solver import ErrorControl, StepChoice
from tests.helpers.orders import slope
from tests.solver.pins import CLEARANCE, GRAVITY, INERTIA, MASS, RADIUS, bearing, disc, lambert, run

FloatArray = NDArray[np.float64]

EPS = float(np.finfo(float).eps)
HERTZ, FACTOR = 1e10, 0.5
DAMPED = ContactLaw(HERTZ, 1.5, FACTOR)
STILL = [0.0] * 3
ARM, SPIN = 0.1, 30.0
PENDULUM = Mechanism((Body(MASS, INERTIA),), (Pin(GROUND, (0.0, 0.0), 0, (0.0, ARM)),), (), GRAVITY)
#: Of four whole turns from its lowest point, by a complete elliptic integral.
TURNS_S = 16 * float(ellipk(4 * MASS * GRAVITY * ARM / ((INERTIA + MASS * ARM**2) * SPIN**2))) / SPIN


def swing(control: ErrorControl) -> tuple[float, int]:
    """Return the error of a pendulum that turns over in rad, and its steps."""
    found = run(PENDULUM, [0.0, -ARM, 0.0], [SPIN * ARM, 0.0, SPIN], TURNS_S, control, 1)
    return abs(float(found.q[-1, 2]) - 8 * np.pi), found.steps


def test_steps_of_one_length_converge_at_order_eight_to_the_closed_form() -> None:
    # With no limit but the longest step, all but the first few are equal.
    counts = [24, 48, 96]
    errors, steps = zip(*(swing(ErrorControl(0.999, TURNS_S / count)) for count in counts), strict=True)
    assert all(0 <= own - count <= 4 for own, count in zip(steps, counts, strict=True))
    assert errors[-1] > 1e3 * EPS * 8 * np.pi, "above round-off"
    assert abs(-slope(counts, errors) - 8) < 0.7, errors


def test_the_error_follows_the_tolerance_down_to_round_off() -> None:
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13):
        error, _ = swing(ErrorControl(tolerance))
        assert error < 30 * tolerance, f"{error:.1e} at {tolerance:.0e}"


def test_a_start_next_to_an_equilibrium_does_not_make_the_tolerance_of_speeds_vanish() -> None:
    # Upright and all but at rest: of its own it has neither speed nor acceleration to weigh errors by.
    slow = 1e-6
    found = run(PENDULUM, [0.0, ARM, np.pi], [-slow * ARM, 0.0, slow], 4.0, ErrorControl(1e-13))
    assert abs(found.v[:, 2]).max() > 1.0, "it has fallen"
    assert found.steps < 1000, f"{found.steps}: some 150 when this was written, millions by its own speed"


def test_a_bounce_meets_its_closed_form_to_every_tolerance() -> None:
    # The tolerance of a speed is that of an angle times bearing and rate, here the speed of 1 m/s. Ten to
    # fifty steps: 330 times it at 1e-5, less than 0.3 from there to 1e-9, 16 at 1e-11 when this was written.
    pin = disc(bearing(DAMPED))
    for tolerance, times in ((1e-5, 1e3), (1e-6, 5.0), (1e-7, 5.0), (1e-8, 5.0), (1e-9, 5.0), (1e-11, 50.0)):
        found = run(pin, STILL, [1.0, 0.0, 0.0], 1.6 * CLEARANCE, ErrorControl(tolerance), 1)
        error = abs(-found.v[-1, 0] - lambert(FACTOR))
        assert error < times * tolerance, f"{error:.1e} at {tolerance:.0e}"


@pytest.mark.parametrize("depth", [1e-4, 1e-7, 1e-10, -1e-10, -1e-8])
def test_a_graze_is_found_however_shallow_and_a_near_miss_is_none(depth: float) -> None:
    # Thrown up so as to turn at this part of the clearance past the wall, or short of it.
    speed = np.sqrt(2 * GRAVITY * CLEARANCE * (1 + depth))
    end, thrown = 1.9 * speed / GRAVITY, disc(bearing(DAMPED), gravity=GRAVITY)
    for tolerance in (1e-4, 1e-8, 1e-12):
        found = run(thrown, STILL, [0.0, speed, 0.0], end, ErrorControl(tolerance))
        assert found.events["what"].tolist() == ([1, -1] if depth > 0 else [])
        free = speed * found.time_s - GRAVITY / 2 * found.time_s**2
        # The wall returns what it takes sooner: by no more than that of a wall at the height of touch.
        approach = np.sqrt(2 * GRAVITY * CLEARANCE * max(depth, 0.0))
        assert np.abs(found.q[:, 1] - free).max() <= 2 * approach * end + 100 * EPS * CLEARANCE


def test_a_step_that_crosses_a_whole_flight_finds_its_end() -> None:
    # Between its bounces a ball is as free as can be, and a step after a release goes beyond the next touch.
    speed, end, root = np.sqrt(2 * GRAVITY * CLEARANCE), 0.5, np.sqrt(MASS / 1e9)
    ball = disc(bearing(ContactLaw(1e9, 1.0)), gravity=GRAVITY)
    found = run(ball, STILL, STILL, end, ErrorControl(1e-9))
    touches = found.events["time_s"][found.events["what"] == 1]
    # A flight, and a linear contact in closed form: its half period, and what gravity adds at both its ends.
    apart = 2 * speed / GRAVITY + np.pi * root + 2 * np.arctan(GRAVITY * root / speed) * root
    assert len(touches) == 1 + int((end - speed / GRAVITY) / apart)
    # Every bounce adds its error to the speed, and that to all flights after it: 1.7e-9 after 24.
    assert np.abs(touches - speed / GRAVITY - apart * np.arange(len(touches))).max() < 1e-8
    assert found.steps < 30 * len(touches)


@pytest.mark.parametrize("controlled", [False, True], ids=["rk4", "dop853"])
@pytest.mark.parametrize("rigid", [False, True], ids=["compliant", "rigid"])
def test_other_units_change_nothing(rigid: bool, controlled: bool) -> None:
    """Units by powers of two: only roots and powers of theirs are rounded otherwise."""

    def rubbed(T: float, L: float, M: float) -> Solution:
        soft = ContactLaw(HERTZ * M / (T**2 * np.sqrt(L)), 1.5, FACTOR, minimum_impact_speed_m_s=1e-6 * L / T)
        law, friction = RigidWall(0.6) if rigid else soft, FrictionLaw("tanh", 0.2, 0.05 * L / T)
        joint = bearing(law, friction, clearance=CLEARANCE * L, radius=RADIUS * L, point=(0.01 * L, 0.0))
        rod = Mechanism((Body(MASS * M, INERTIA * M * L**2),), (), (), GRAVITY * L / T**2, (joint,))
        step = ErrorControl(1e-9) if controlled else StepChoice(2e-5 * T)
        return run(rod, [-0.01 * L, 0.0, 0.0], [0.1 * L / T, 0.0, 1.0 / T], 0.05 * T, step)

    expected = rubbed(1.0, 1.0, 1.0)
    assert len(expected.impacts) > 3
    for time, length, mass in ((4, 0, 0), (0, 4, 0), (0, 0, 5), (-6, 8, 3), (7, -9, 20)):
        T, L, M = 2.0**time, 2.0**length, 2.0**mass
        found = rubbed(T, L, M)
        assert found.steps == expected.steps
        assert np.abs(found.q / np.array([L, L, 1.0]) - expected.q).max() < 1e-11 * RADIUS
        times = [impact.time_s / T for impact in found.impacts]
        np.testing.assert_allclose(times, [impact.time_s for impact in expected.impacts], rtol=1e-11)
