"""The largest force and penetration of every contact, between steps as well, against closed forms."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from reference_solver.contact.types import Impact
from reference_solver.mechanism.contact_laws import ContactLaw, RigidWall
from reference_solver.mechanism.mechanism import GROUND, Body, ClearanceJoint, Mechanism
from reference_solver.solver import ErrorControl, StepChoice, solve

FloatArray = NDArray[np.float64]
MASS, SPEED, CLEARANCE, STIFFNESS = 0.1, 1.0, 5e-4, 6.61e10
#: RK4 with some steps in a contact, and DOP853 with a handful of long ones.
CHOICES: dict[str, tuple[StepChoice | ErrorControl, float]] = {
    "20 steps": (StepChoice(1e-5, 20.0), 3e-5),
    "100 steps": (StepChoice(1e-5, 100.0), 1e-7),
    "dop853, loose": (ErrorControl(1e-6), 1e-4),
    "dop853, sharp": (ErrorControl(1e-12), 1e-9),
}


def impacts(law: ContactLaw | RigidWall, choice: StepChoice | ErrorControl, flights: float) -> list[Impact]:
    """Return the impacts of a pin that crosses its bearing along x for so many clearances' time."""
    joint = ClearanceJoint(GROUND, (0.0, 0.0), 0, (0.0, 0.0), CLEARANCE, 0.01, law)
    pin = Mechanism((Body(MASS, 1e-4),), (), contacts=(joint,))
    start, velocity = np.zeros(3), np.array([SPEED, 0.0, 0.0])
    end_s = flights * CLEARANCE / SPEED
    run = solve(pin, start, velocity, end_time_s=end_s, samples=1, step=choice)
    return list(run.impacts)


@cache
def largest(law: ContactLaw) -> tuple[float, float, float, float]:
    """Return largest force, its time after the touch, largest penetration, its time, by quadrature."""

    def force(depth: float, rate: float) -> float:
        depth = max(depth, 0.0)
        if law.kind == "kuwabara-kono":
            return float(law.stiffness * depth**1.5 + law.damping_N_s_m * depth**0.5 * rate)
        elastic = law.stiffness * depth**law.exponent
        return float(elastic * (1 + law.damping_factor * rate / SPEED) + law.damping_N_s_m * rate)

    def rates(_: float, y: FloatArray) -> list[float]:
        return [y[1], -force(y[0], y[1]) / MASS]

    deepest = (5 * MASS * SPEED**2 / (4 * law.stiffness)) ** 0.4
    span = (0.0, 2.0 * deepest / SPEED)
    way = solve_ivp(rates, span, [0.0, SPEED], "DOP853", rtol=1e-13, atol=1e-18, dense_output=True).sol

    def peak(of: int) -> tuple[float, float]:
        def value(t: float) -> float:
            depth, rate = way(t)
            return -(force(depth, rate) if of == 0 else depth)

        rough = float(np.linspace(*span, 400)[np.argmin([value(t) for t in np.linspace(*span, 400)])])
        width = span[1] / 400
        bounds = (max(rough - width, 0.0), rough + width)
        found = minimize_scalar(value, bounds=bounds, method="bounded", options={"xatol": 1e-15})
        return -float(found.fun), float(found.x)

    return *peak(0), *peak(1)


LAWS = {
    "hertz": ContactLaw(STIFFNESS),
    "dissipative": ContactLaw(STIFFNESS, 1.5, damping_factor=0.8),
    "kuwabara-kono": ContactLaw(STIFFNESS, damping_N_s_m=4e5, kind="kuwabara-kono"),
}


@pytest.mark.parametrize("choice", CHOICES)
@pytest.mark.parametrize("name", LAWS)
def test_largest_force_and_penetration_are_those_of_the_law(name: str, choice: str) -> None:
    how, close = CHOICES[choice]
    (impact,) = impacts(LAWS[name], how, 1.5)
    force_N, force_s, depth_m, depth_s = largest(LAWS[name])
    assert impact.largest_normal_force_N == pytest.approx(force_N, rel=close)
    assert impact.largest_penetration_m == pytest.approx(depth_m, rel=close)
    for found, expected in (
        (impact.largest_normal_force_time_s, force_s),
        (impact.largest_penetration_time_s, depth_s),
    ):
        assert abs(found - impact.time_s - expected) < 0.02 * impact.duration_s


def test_hertz_has_the_closed_form() -> None:
    (impact,) = impacts(LAWS["hertz"], CHOICES["dop853, sharp"][0], 1.5)
    deepest = (5 * MASS * SPEED**2 / (4 * STIFFNESS)) ** 0.4
    assert impact.largest_penetration_m == pytest.approx(deepest, rel=1e-9)
    assert impact.largest_normal_force_N == pytest.approx(STIFFNESS * deepest**1.5, rel=1e-9)


@pytest.mark.parametrize("choice", CHOICES)
def test_a_damper_is_strongest_at_the_touch(choice: str) -> None:
    law = ContactLaw(1e6, 1.0, damping_N_s_m=400.0)
    impact = impacts(law, CHOICES[choice][0], 5.0)[0]
    assert impact.largest_normal_force_N == pytest.approx(400.0 * SPEED, rel=0.02)
    assert impact.largest_normal_force_time_s - impact.time_s < 0.05 * impact.duration_s


@pytest.mark.parametrize("choice", CHOICES)
def test_each_impact_has_its_own(choice: str) -> None:
    first, second = impacts(LAWS["dissipative"], CHOICES[choice][0], 4.5)[:2]
    slower = second.approach_speed_m_s / first.approach_speed_m_s
    assert slower < 0.8
    scale = slower**1.2  # of every force of one restitution
    assert second.largest_normal_force_N == pytest.approx(scale * first.largest_normal_force_N, rel=1e-4)
    assert second.time_s < second.largest_normal_force_time_s < second.time_s + second.duration_s


def test_a_rigid_wall_has_none() -> None:
    (impact, *_) = impacts(RigidWall(0.5), StepChoice(1e-5), 1.5)
    assert np.isnan([impact.largest_normal_force_N, impact.largest_penetration_m]).all()
