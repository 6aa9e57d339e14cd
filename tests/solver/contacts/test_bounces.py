"""A pin that crosses its bearing and bounces, against the closed forms of every contact law."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reference_solver.mechanism.contacts import DAMPING_FACTORS, ContactLaw
from reference_solver.mechanism.data import Body, Spring
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Solution
from reference_solver.solver import ErrorControl, StepChoice
from tests.helpers.kernels import straight_guide
from tests.helpers.orders import slope
from tests.solver.pins import CLEARANCE, INERTIA, MASS, bearing, disc, lambert, run

FloatArray = NDArray[np.float64]

SPEED = 1.0
HERTZ, LINEAR = 6.61e10, 1e9
#: What is asked of laws, ledger and Hertz's closed forms.
CLOSED_FORM = 1e-8
#: Steps per contact at which RK4's error, falling as N^-4 from 3e-5 at 20, is far below CLOSED_FORM.
FINE = StepChoice(1e-5, 320.0)
ORDER_TOLERANCE = 0.1


@cache
def bounce(law: ContactLaw, step: StepChoice | ErrorControl = FINE, flights: float = 1.5) -> Solution:
    """Return a pin's way from the centre along x to the wall and back, for so many clearances' time."""
    return run(disc(bearing(law)), [0.0] * 3, [SPEED, 0.0, 0.0], flights * CLEARANCE / SPEED, step, 1)


def restitution(run: Solution) -> float:
    return float(-run.v[-1, 0] / SPEED)


#: By law, the restitutions printed of a nominal 0.9 and 0.5.
PRINTED = {
    "hunt-crossley": ("0.9090", "0.663"),
    "lankarani-nikravesh": ("0.9132", "0.7252"),
    "gonthier": ("0.8764", "0.4877"),
    "flores": ("0.8939", "0.4704"),
    "hu-guo": ("0.8999", "0.4877"),
}


@pytest.mark.parametrize("nominal", [0.9, 0.5])
@pytest.mark.parametrize("name", DAMPING_FACTORS)
def test_every_laws_restitution_and_loss_meet_the_lambert_w_formula(name: str, nominal: float) -> None:
    a, energy = DAMPING_FACTORS[name](nominal), MASS * SPEED**2 / 2
    for exponent in (1.0, 1.5, 2.2):
        stiffness = HERTZ * 1e-5 ** (1.5 - exponent)  # the same force at 10 micrometres
        run = bounce(ContactLaw(stiffness, exponent, a))
        assert abs(restitution(run) - lambert(a)) < CLOSED_FORM, f"{restitution(run)} against {lambert(a)}"
        lost, expected = run.sums["loss0"][-1], (1 - lambert(a) ** 2) * energy
        assert abs(lost - expected) < CLOSED_FORM * energy, f"lost {lost} J against {expected} J"
        assert run.sums["clip0"][-1] == 0, "a single bounce never pulls"
        if name in PRINTED and exponent == 1.5:
            printed = PRINTED[name][nominal == 0.5]
            assert f"{restitution(run):.{len(printed) - 2}f}" == printed


def test_a_hertz_bounce_and_its_record_meet_their_closed_forms() -> None:
    run = bounce(ContactLaw(HERTZ, 1.5))
    (impact,) = run.impacts
    deepest = (5 * MASS * SPEED**2 / (4 * HERTZ)) ** 0.4
    for value, expected in (
        (impact.duration_s, 2.94327518 * deepest / SPEED),  # digits of the factor
        (impact.largest_penetration_m, deepest),
        (impact.largest_normal_force_N, 1.25 * MASS * SPEED**2 / deepest),
        (impact.approach_speed_m_s, SPEED),
        (impact.normal_impulse_N_s, 2 * MASS * SPEED),
        (run.sums["normal0"][-1], 2 * MASS * SPEED),
        (restitution(run), 1.0),
    ):
        assert value == pytest.approx(expected, rel=CLOSED_FORM)
    assert (impact.contact, impact.kind, impact.energy_lost_J) == (0, "contact", 0.0)


ZETA = 0.2
KELVIN_VOIGT = ContactLaw(LINEAR, 1.0, damping_N_s_m=2 * ZETA * np.sqrt(MASS * LINEAR))
RETURNED = float(np.exp(-np.pi * ZETA / np.sqrt(1 - ZETA**2)))
FLORES = DAMPING_FACTORS["flores"](0.5)


def linear_duration_part(step: StepChoice) -> float:
    """Return by what part a linear contact lasts longer than half a period."""
    lasts = np.diff(bounce(ContactLaw(LINEAR, 1.0), step).events["time_s"])[0]
    return float(lasts / (np.pi * np.sqrt(MASS / LINEAR)) - 1)


#: What converges to zero. The power 1.5 of the penetration is not smooth at touch and release; the graded
#: grid (i/N)^2 restores the order there.
CONVERGING: dict[str, tuple[Callable[[StepChoice], float], int]] = {
    "duration of a linear bounce": (linear_duration_part, 20),
    "Kelvin and Voigt's": (lambda step: restitution(bounce(KELVIN_VOIGT, step)) - RETURNED, 40),
    "dissipative Hertz": (
        lambda step: restitution(bounce(ContactLaw(HERTZ, 1.5, FLORES), step)) - lambert(FLORES),
        80,
    ),
}


@pytest.mark.parametrize("name", CONVERGING)
def test_a_bounce_converges_at_order_four_to_its_closed_form(name: str) -> None:
    error, fewest = CONVERGING[name]
    counts = [fewest, 2 * fewest, 4 * fewest]
    errors = [abs(error(StepChoice(1e-5, count))) for count in counts]
    assert abs(-slope(counts, errors) - 4) < ORDER_TOLERANCE, errors
    assert abs(error(FINE)) < CLOSED_FORM


@pytest.mark.parametrize(
    ("law", "expected"),
    [(ContactLaw(LINEAR, 1.0), 2.0), (ContactLaw(HERTZ, 1.5), 2.5)],
    ids=["linear", "hertz"],
)
def test_the_plain_algorithm_takes_equal_steps_and_falls_to_the_order_of_its_unlocated_events(
    law: ContactLaw, expected: float
) -> None:
    end = 1.5 * CLEARANCE / SPEED
    counts, errors = [5000, 20_000, 80_000], []
    for count in counts:
        lost = []
        for steps in range(count, count + 175, 7):  # touch and release fall anywhere within a step
            found = bounce(law, StepChoice(end / steps, locate_events=False))
            assert found.steps == steps
            lost.append(1 - restitution(found))
        errors.append(float(np.sqrt(np.mean(np.square(lost)))))
    assert abs(-slope(counts, errors) - expected) < ORDER_TOLERANCE, errors


@pytest.mark.parametrize("may_pull", [False, True])
def test_a_law_that_would_pull_is_clipped_on_a_line_of_its_own_or_pulls(may_pull: bool) -> None:
    # A carriage on a guide moves up and takes a spring along that first presses the pin into its bearing,
    # then lifts it. The pin came slowly and leaves as fast as the spring unloads: 1 + a delta'/v0 turns
    # negative, and the law would hold the pin back.
    stiffness, carriage, rise, came, free_length, spring = 1e6, 1.0, 0.02, 1e-4, 0.1, 1e3
    law = ContactLaw(stiffness, 1.5, DAMPING_FACTORS["hunt-crossley"](0.1), may_pull=may_pull)
    mechanism = Mechanism(
        (Body(MASS, INERTIA), Body(carriage, 1.0)),
        straight_guide(1, (0.0, 0.0), np.pi / 2),
        (Spring(0, (0.0, 0.0), 1, (0.0, 0.0), spring, 0.0, free_length),),
        contacts=(bearing(law),),
    )
    start = [0.0, -CLEARANCE + 1e-9, 0.0, 0.0, -CLEARANCE + free_length - 1e-3, 0.0]
    found = run(mechanism, start, [0.0, -came, 0.0, 0.0, rise, 0.0], 0.1, StepChoice(2e-5, 1000), 50)
    q, v = found.q, found.v
    stretch = np.hypot(q[:, 3] - q[:, 0], q[:, 4] - q[:, 1]) - free_length
    depth = np.maximum(np.hypot(*found.gap_m[:, 0].T) - CLEARANCE, 0.0)
    kinetic = MASS * (v[:, 0] ** 2 + v[:, 1] ** 2) / 2 + carriage * v[:, 4] ** 2 / 2
    balance = kinetic + spring * stretch**2 / 2 + stiffness * depth**2.5 / 2.5 + found.losses_J()
    clipped, least = (found.events["what"] == 2).any(), found.normal_force_N.min()
    assert (least < 0, clipped, "clip0" in found.sums) == (may_pull, not may_pull, not may_pull), least
    assert may_pull or found.sums["clip0"][-1] > 0
    residual = np.abs(balance - balance[0]).max()
    assert residual < 1e-9 * balance[0], f"residual {residual:.1e} of {balance[0]:.1e} J"


# The largest force and penetration of every contact, between steps as well

#: RK4 with some steps in a contact, and DOP853 with a handful of long ones.
CHOICES: dict[str, tuple[StepChoice | ErrorControl, float]] = {
    "20 steps": (StepChoice(1e-5, 20.0), 3e-5),
    "100 steps": (StepChoice(1e-5, 100.0), 1e-7),
    "dop853, loose": (ErrorControl(1e-6), 1e-4),
    "dop853, sharp": (ErrorControl(1e-12), 1e-9),
}
DISSIPATIVE = ContactLaw(HERTZ, 1.5, damping_factor=0.8)
KUWABARA_KONO = ContactLaw(HERTZ, damping_N_s_m=4e5, kind="kuwabara-kono")


def force_N(law: ContactLaw, depth: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the force of either law at depths below zero, too."""
    root = np.sqrt(np.maximum(depth, 0.0))
    damping = law.damping_N_s_m or law.stiffness * depth * law.damping_factor / SPEED
    return root * (law.stiffness * depth + damping * rate)


@pytest.mark.parametrize("law", [DISSIPATIVE, KUWABARA_KONO], ids=["dissipative", "kuwabara-kono"])
def test_largest_force_and_penetration_are_those_of_the_law(law: ContactLaw) -> None:
    def rates(_: float, y: FloatArray) -> FloatArray:
        return np.array([y[1], -force_N(law, *y) / MASS])

    span = 0.0, 2.0 * (5 * MASS * SPEED**2 / (4 * HERTZ)) ** 0.4 / SPEED
    times = np.linspace(*span, 200_001)
    way = solve_ivp(rates, span, [0.0, SPEED], "DOP853", times, rtol=1e-13, atol=1e-18).y
    for step, close in CHOICES.values():
        (impact,) = bounce(law, step).impacts
        for value, course, when in (
            (impact.largest_normal_force_N, force_N(law, *way), impact.largest_normal_force_time_s),
            (impact.largest_penetration_m, way[0], impact.largest_penetration_time_s),
        ):
            assert value == pytest.approx(course.max(), rel=close)
            assert abs(when - impact.time_s - times[course.argmax()]) < 0.02 * impact.duration_s
