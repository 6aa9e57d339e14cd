"""Error control: its order, its tolerance, located events, crank-sliders, and where it ends."""

import ctypes
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from engine_models.engine import RunSettings, SimulationFailed
from engine_models.engines import make_engine
from engine_models.mechanics.start import start_state
from engine_models.reference.solution import mechanism_of
from engine_models.scene.library import CLEARANCE_SCENES
from reference_solver.kernel import Kernel, Topology
from reference_solver.loop import Step, estimated
from reference_solver.mechanism.contacts import ContactLaw, RigidWall
from reference_solver.mechanism.data import GROUND, Body, FrictionLaw, Pin
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.methods import dop853
from reference_solver.run import SLOPES, WEIGHT, new_run
from reference_solver.solution import Solution
from reference_solver.solver import ErrorControl, StepChoice, solve
from studies.extremes import gallery
from studies.judges.horizon import moved
from tests.solver.pins import CLEARANCE, GRAVITY, INERTIA, MASS, RADIUS, bearing, disc, lambert, run

FloatArray = NDArray[np.float64]

EPS = float(np.finfo(float).eps)
HERTZ, FACTOR = 1e10, 0.5
DAMPED, ELASTIC = ContactLaw(HERTZ, 1.5, FACTOR), ContactLaw(HERTZ, 1.5)
ARM, SPIN = 0.1, 30.0


PENDULUM = Mechanism((Body(MASS, INERTIA),), (Pin(GROUND, (0.0, 0.0), 0, (0.0, ARM)),), (), GRAVITY)


def controlled(
    mechanism: Mechanism, q: list[float], v: list[float], end: float, tolerance: float, samples: int = 10
) -> Solution:
    return run(mechanism, q, v, end, ErrorControl(tolerance), samples)


def swung(end: float, control: ErrorControl) -> Solution:
    """Return the run of a pendulum that turns over, from its lowest point."""
    return run(PENDULUM, [0.0, -ARM, 0.0], [SPIN * ARM, 0.0, SPIN], end, control, 1)


def turn_s() -> float:
    """Return the time of a whole turn of it, in closed form."""
    inertia = INERTIA + MASS * ARM**2
    k2 = 4 * MASS * GRAVITY * ARM / (inertia * SPIN**2)
    return float(4 * ellipk(k2) / SPIN)


def test_steps_of_one_length_converge_at_order_eight_to_the_closed_form() -> None:
    # With no limit but the longest step, all but the first few are equal.
    end, counts, errors = 4 * turn_s(), [24, 48, 96], []
    for count in counts:
        found = swung(end, ErrorControl(0.999, end / count))
        assert count <= found.steps <= count + 4
        errors.append(abs(found.q[-1, 2] - 8 * np.pi))
    assert errors[-1] > 1e3 * EPS * 8 * np.pi, "above round-off"
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert abs(order - 8) < 0.7, f"order {order:.2f} of {errors}"


def test_the_error_follows_the_tolerance_down_to_round_off() -> None:
    end = 4 * turn_s()
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13):
        found = swung(end, ErrorControl(tolerance))
        error = abs(found.q[-1, 2] - 8 * np.pi)
        assert error < 30 * tolerance, f"{error:.1e} at {tolerance:.0e}"


def test_a_start_next_to_an_equilibrium_does_not_make_the_tolerance_of_speeds_vanish() -> None:
    # Upright and all but at rest: of its own it has neither speed nor acceleration to weigh errors by.
    slow = 1e-6
    found = controlled(PENDULUM, [0.0, ARM, np.pi], [-slow * ARM, 0.0, slow], 4.0, 1e-13)
    assert abs(found.v[:, 2]).max() > 1.0, "it has fallen"
    assert found.steps < 1000, f"{found.steps}: some 150 when this was written, millions by its own speed"


@pytest.mark.parametrize(("q", "v"), [(0.0, 0.0), (0.0, 3.0)])
def test_a_free_body_crosses_any_time_in_a_few_steps(q: float, v: float) -> None:
    body = Mechanism((Body(MASS, INERTIA),), ())
    found = controlled(body, [q] * 3, [v] * 3, 1e3, 1e-9)
    assert found.steps < 20
    assert found.q[-1] == pytest.approx([q + 1e3 * v] * 3, rel=8 * EPS)


def bounce(tolerance: float, law: ContactLaw = DAMPED) -> Solution:
    return controlled(disc(bearing(law)), [0.0] * 3, [1.0, 0.0, 0.0], 1.6 * CLEARANCE, tolerance, 1)


def test_a_bounce_meets_its_closed_form_to_every_tolerance() -> None:
    # The tolerance of a speed is that of an angle times bearing and rate, here the speed of 1 m/s. Ten to
    # fifty steps: 330 times it at 1e-5, less than 0.3 from there to 1e-9, 16 at 1e-11 when this was written.
    for tolerance, times in ((1e-5, 1e3), (1e-6, 5.0), (1e-7, 5.0), (1e-8, 5.0), (1e-9, 5.0), (1e-11, 50.0)):
        error = abs(-bounce(tolerance).v[-1, 0] - lambert(FACTOR))
        assert error < times * tolerance, f"{error:.1e} at {tolerance:.0e}"


def test_below_the_round_off_of_a_stiff_wall_a_sharper_tolerance_takes_no_more_steps() -> None:
    stiff = ContactLaw(1e14, 1.5, FACTOR)
    sharp, sharper = (bounce(tolerance, law=stiff).steps for tolerance in (1e-12, 1e-14))
    # As long as round-off did not count, 49 and 30 when this was written.
    assert sharper <= 1.2 * sharp, f"{sharper} steps, {sharp} at a hundred times the tolerance"


@pytest.mark.parametrize("depth", [1e-4, 1e-6, 1e-8, 1e-10, -1e-10, -1e-8])
def test_a_graze_is_found_however_shallow_and_a_near_miss_is_none(depth: float) -> None:
    # Thrown up so as to turn at this part of the clearance past the wall, or short of it.
    speed = np.sqrt(2 * GRAVITY * CLEARANCE * (1 + depth))
    end = 1.9 * speed / GRAVITY
    for tolerance in (1e-4, 1e-8, 1e-12):
        found = controlled(
            disc(bearing(DAMPED), gravity=GRAVITY), [0.0] * 3, [0.0, speed, 0.0], end, tolerance
        )
        assert found.events["what"].tolist() == ([1, -1] if depth > 0 else [])
        free = speed * found.time_s - GRAVITY / 2 * found.time_s**2
        moved = np.abs(found.q[:, 1] - free).max()
        # The wall returns what it takes sooner: by no more than that of a wall at the height of touch.
        approach = np.sqrt(2 * GRAVITY * CLEARANCE * max(depth, 0.0))
        assert moved <= 2 * approach * end + 100 * EPS * CLEARANCE


def test_a_step_that_crosses_a_whole_flight_finds_its_end() -> None:
    # Between its bounces a ball is as free as can be, and a step after a release goes beyond the next touch.
    speed = np.sqrt(2 * GRAVITY * CLEARANCE)
    end, flight = 0.5, 2 * speed / GRAVITY
    found = controlled(disc(bearing(ContactLaw(1e9, 1.0)), gravity=GRAVITY), [0.0] * 3, [0.0] * 3, end, 1e-9)
    touches = found.events["time_s"][found.events["what"] == 1]
    half = np.pi * np.sqrt(MASS / 1e9)
    # A linear contact in closed form: its half period, and what gravity adds at both its ends.
    lasts = half + 2 * np.arctan(GRAVITY * np.sqrt(MASS / 1e9) / speed) * np.sqrt(MASS / 1e9)
    expected = speed / GRAVITY + (flight + lasts) * np.arange(len(touches))
    assert len(touches) == 1 + int((end - speed / GRAVITY) / (flight + lasts))
    # Every bounce adds its error to the speed, and that to all flights after it: 1.7e-9 after 24.
    assert np.abs(touches - expected).max() < 1e-8
    assert found.steps < 30 * len(touches)


def test_a_lasting_contact_is_followed_though_its_release_is_foreseen_wrongly() -> None:
    # A pin on a soft wall slides from side to side and swings in and out, now and then nearly off.
    law, side = ContactLaw(1e6, 1.5), 0.4
    deep = (MASS * GRAVITY / 1e6) ** (2 / 3)
    place = (CLEARANCE + 0.02 * deep) * np.array([np.sin(side), -np.cos(side)])

    def rates(_: float, y: FloatArray) -> FloatArray:
        distance = np.hypot(y[0], y[1])
        push = 1e6 * max(distance - CLEARANCE, 0.0) ** 1.5 / (MASS * distance)
        return np.array([y[2], y[3], -push * y[0], -push * y[1] - GRAVITY])

    end, times = 0.06, np.linspace(0, 0.06, 61)
    y = solve_ivp(rates, (0, end), [*place, 0, 0], "DOP853", times, rtol=1e-12, atol=1e-15, max_step=1e-4).y.T
    for tolerance in (1e-6, 1e-8, 1e-10):
        found = controlled(disc(bearing(law), gravity=GRAVITY), [*place, 0.0], [0.0] * 3, end, tolerance, 60)
        error = np.abs(found.q[:, :2] - y[:, :2]).max()
        assert error < 100 * tolerance * RADIUS, f"{error:.1e} at {tolerance:.0e}"
        # It turns inwards again and again with a release ahead that does not come.
        assert len(found.events) < 8


def test_contacts_that_touch_at_once_share_the_push() -> None:
    # Two bearings alike and a third that is wider by less than a penetration.
    wider = CLEARANCE * (1 + 1e-9)
    for clearances in ((CLEARANCE,) * 3, (CLEARANCE, CLEARANCE, wider)):
        one = disc(bearing(replace(ELASTIC, stiffness=3 * HERTZ)))
        three = disc(*(bearing(ELASTIC, clearance=c) for c in clearances))
        alone, found = (
            controlled(of, [0.0] * 3, [1.0, 0.0, 0.0], 1.6 * CLEARANCE, 1e-11) for of in (one, three)
        )
        assert sorted(found.events["contact"].tolist()) == [0, 0, 1, 1, 2, 2]
        assert np.abs(found.q - alone.q).max() < 1e-8 * CLEARANCE


@pytest.mark.parametrize("controlled", [False, True], ids=["rk4", "dop853"])
@pytest.mark.parametrize("rigid", [False, True], ids=["compliant", "rigid"])
def test_other_units_change_nothing(rigid: bool, controlled: bool) -> None:
    """Units by powers of two: only roots and powers of theirs are rounded otherwise."""

    def rubbed(T: float, L: float, M: float) -> Solution:
        soft = ContactLaw(HERTZ * M / (T**2 * np.sqrt(L)), 1.5, FACTOR, minimum_impact_speed_m_s=1e-6 * L / T)
        law, friction = RigidWall(0.6) if rigid else soft, FrictionLaw("tanh", 0.2, 0.05 * L / T)
        joint = bearing(law, friction, clearance=CLEARANCE * L, radius=RADIUS * L, point=(0.01 * L, 0.0))
        body = Body(MASS * M, INERTIA * M * L**2)
        rod = Mechanism((body,), (), (), GRAVITY * L / T**2, (joint,))
        step = ErrorControl(1e-9) if controlled else StepChoice(2e-5 * T)
        v = [0.1 * L / T, 0.0, 1.0 / T]
        return run(rod, [-0.01 * L, 0.0, 0.0], v, 0.05 * T, step)

    expected = rubbed(1.0, 1.0, 1.0)
    assert len(expected.impacts) > 3
    for time, length, mass in ((4, 0, 0), (0, 4, 0), (0, 0, 5), (-6, 8, 3), (7, -9, 20)):
        T, L, M = 2.0**time, 2.0**length, 2.0**mass
        found = rubbed(T, L, M)
        assert found.steps == expected.steps
        assert np.abs(found.q / np.array([L, L, 1.0]) - expected.q).max() < 1e-11 * RADIUS
        times = [impact.time_s / T for impact in found.impacts]
        np.testing.assert_allclose(times, [impact.time_s for impact in expected.impacts], rtol=1e-11)


def test_a_step_whose_error_overflows_is_no_step_without_error() -> None:
    # The estimate of order 5 is finite here, that of order 3, by which it is divided, is not.
    assert dop853().embedded is not None
    fifth, third = np.array(dop853().embedded.estimates)  # type: ignore[union-attr]
    row = 1 + int(np.argmax(np.abs(third[1:]) - np.abs(fifth[1:])))
    huge = 1.5e154 / abs(third[row])
    assert abs(third[row]) > 2 * abs(fifth[row]) > 0

    disc = Mechanism((Body(1.0, 1.0),), (), (), 0.0)
    kernel = Kernel(Topology(disc, method=dop853()), np.zeros(3))
    run = new_run(dop853(), (), ["drivers", "removed"], (3, 0), np.zeros(0))
    kernel.bind(run)
    run.rows[WEIGHT, :6] = 1.0
    (state,) = run.state

    def rates(*given: Any) -> float:
        number = (given[-1] - state["at"]) // state["width"]
        run.rows[number, 0] = huge if number == SLOPES + row else 0.0
        return 1.0

    number = ctypes.c_int64
    called = ctypes.CFUNCTYPE(ctypes.c_double, number, number, ctypes.c_double, number, number)(rates)
    state["rates"] = ctypes.cast(called, ctypes.c_void_p).value
    step = Step(0.0, 0.0, 0.0, 1.0, 1.0)
    error = njit(lambda state, rows, method: estimated(state[0], rows, method, step), error_model="numpy")
    assert error(run.state, run.rows, run.method) == np.inf


# Crank-sliders


def test_a_fold_that_no_step_passes_is_named_with_its_time() -> None:
    scene = gallery()["L = r through the fold"].scene
    engine = make_engine("reference", method="dop853", step_tolerance=1e-12)
    # No step there meets the tolerance, or one has ended right there, by round-off.
    fold = r"no step from t = 0\.\d+ s meets the tolerance|rank 8 of 9 at t = 0\.\d+ s"
    with pytest.raises(SimulationFailed, match=fold):
        engine.simulate(scene, RunSettings(scene.end_time_s, 10))


#: By how much the crank angle is moved in rad: the first starts a flight that comes back within one step.
MOVED_RAD = (2.0181418341130538e-05, *np.geomspace(1e-6, 1e-4, 9))


def test_no_pin_flies_inside_its_wall_however_a_run_begins() -> None:
    scene = CLEARANCE_SCENES["clearance-driven-0.5mm"]().model_copy(update={"end_time_s": 0.096})
    for by in MOVED_RAD:
        begun = moved(scene, float(by))
        q, v = (part.ravel() for part in start_state(begun))
        mechanism = mechanism_of(begun)
        found = solve(mechanism, q, v, end_time_s=scene.end_time_s, samples=1600, step=ErrorControl(1e-7))
        depth = np.hypot(*found.gap_m[:, 0].T) - mechanism.contacts[0].radial_clearance_m
        inside = depth[~found.closed[:, 0]].max()
        assert inside < 2e-9, f"{inside:.1e} m past the wall, begun {by:.1e} rad beside"
