"""The scalar test problem, a mass on a contact's spring and damper: engines by their methods' step matrices.

A pendulum hangs straight down and its weight presses the pin into the bearing. Moved a little it oscillates
there, always in contact: with the law F = K delta + c delta' exactly as a mass on a spring, with
zeta = c/(2 m omega), omega^2 = K/m. What a step multiplies its amplitude by follows from consecutive samples:
k states a step make their deviations z obey z_n = p_1 z_(n-1) + ... + p_k z_(n-k).
"""

import math

import numpy as np
import pytest

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import FloatArray, RunSettings
from engine_models.engines import make_engine
from engine_models.scene.format import BodyState, Clearance, Drive
from engine_models.scene.scene import Scene
from engine_models.scene.short import Link, Start
from studies.stability import ALPHA, ARMS, EULER, LIMIT, RK4
from studies.stability import TRAPEZOIDAL as TRAPEZOIDAL_RULE

#: Mass, frequency of the contact, and penetration at rest, which sets gravity. The pin can roll sideways too,
#: a tenth as fast where the clearance is a hundred times the penetration: never the first motion to grow.
MASS_KG, FREQUENCY_RAD_S, DEPTH_M = 0.2, 1000.0, 1e-4
CLEARANCE_M, CENTRE_M = 1e-2, 1e-2
#: Deviation at the start, and the largest fitted, as parts of the penetration at rest: a Runge-Kutta stage
#: goes further than its step, and must not leave the contact either. What a fit has no more of than the last
#: part is round-off.
DEVIATION, LARGEST_DEVIATION, ROUND_OFF = 1e-3, 0.1, 1e-6


def step_matrix(method: str, x: float, damping_ratio: float, radius: float = 0.5) -> FloatArray:
    """Return the matrix of a step x = omega h, (2, 2) on (omega y, y') or (3, 3) on (omega^2 y, omega y', a).

    The last is Chung and Hulbert's (1993), a its auxiliary acceleration:
    (1 - am) a+ + am a = (1 - af) y''+ + af y'', y'' = -omega^2 y - d omega y', and Newmark's formulas.
    """
    d, one = 2 * damping_ratio, np.eye(2)
    slope = x * np.array([[0.0, 1.0], [-1.0, -d]])
    if method == RK4:
        return np.asarray(one + slope @ (one + slope / 2 @ (one + slope / 3 @ (one + slope / 4))))
    if method == EULER:  # y first, then y' with the new y and, in the damper, the old y'
        return np.array([[1.0, x], [-x, 1 - d * x - x * x]])
    if method == TRAPEZOIDAL_RULE:
        return np.asarray(np.linalg.solve(one - slope / 2, one + slope / 2))
    am, af = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    gamma = 0.5 + af - am
    beta = (gamma + 0.5) ** 2 / 4
    new = np.array([[1, 0, -beta * x * x], [0, 1, -gamma * x], [1 - af, (1 - af) * d, 1 - am]])
    old = np.array([[1, x, (0.5 - beta) * x * x], [0, 1, (1 - gamma) * x], [-af, -af * d, -am]])
    return np.asarray(np.linalg.solve(new, old))


def growth(method: str, x: float, damping_ratio: float, radius: float = 0.5) -> float:
    """Return the spectral radius of a step."""
    return float(np.abs(np.linalg.eigvals(step_matrix(method, x, damping_ratio, radius))).max())


def oscillator(damping_ratio: float, step_s: float, steps: int) -> Scene:
    """Return the scene of so many steps."""
    depth = DEPTH_M * (1 + DEVIATION)
    place = {"y_m": -(CENTRE_M + CLEARANCE_M + depth), "angle_rad": -math.pi / 2}
    hanging = BodyState(**dict.fromkeys(BodyState.model_fields, 0.0) | place)
    bearing = Clearance(
        radial_clearance_m=CLEARANCE_M,
        bearing_radius_m=2 * CLEARANCE_M,
        law="kelvin-voigt",
        stiffness=MASS_KG * FREQUENCY_RAD_S**2,
        damping_N_s_m=2 * max(damping_ratio, 1e-18) * MASS_KG * FREQUENCY_RAD_S,
    )
    return Scene.checked(
        {
            "name": f"oscillator-{damping_ratio:g}",
            "end_time_s": step_s * steps,
            "gravity_m_s2": DEPTH_M * FREQUENCY_RAD_S**2,
            "crank": Link(length_m=0.12, mass_kg=MASS_KG, inertia_kg_m2=2.5e-4, centre_of_mass_m=CENTRE_M),
            "start": Start(crank_angle_rad=-math.pi / 2, crank_speed_rad_s=0.0, crank=hanging),
            "drive": Drive(kind="free"),
            "clearance": {"O": bearing},
        }
    )


def measured_growth(arm: Arm, x: float, damping_ratio: float, steps: int, order: int) -> float:
    """Return the factor by which a step x = omega h multiplies the deviation.

    It is the largest magnitude of the roots of the recurrence of k = ``order`` that penetrations obey.
    """
    step = x / FREQUENCY_RAD_S
    scene = oscillator(damping_ratio, step, steps)
    run = make_engine(arm.engine, **arm.settings).simulate(scene, RunSettings(step, steps))
    z = run.contacts["O"].penetration_m[1:] / DEPTH_M - 1  # methods begin differently
    inside = int(np.argmin(np.append(np.abs(z) <= LARGEST_DEVIATION, False)))
    rows = np.array([z[k : k + order + 1] for k in range(inside - order)])
    coefficients = np.linalg.lstsq(rows[:, :-1], rows[:, -1], rcond=ROUND_OFF)[0]
    return float(np.abs(np.roots([1.0, *-coefficients[::-1]])).max())


#: Configurations with their methods, and of implicit ones the spectral radius.
EXPLICIT = [(arms.PLAIN, RK4), (arms.RK44, RK4), (arms.AS_THE_SCENE, EULER)]
IMPLICIT = [
    (arms.TRAPEZOIDAL, TRAPEZOIDAL_RULE, 1.0),
    (arms.GENERALIZED_ALPHA, ALPHA, 0.5),
    (arms.GENERALIZED_ALPHA_09, ALPHA, 0.9),
]


def test_step_matrices_grow_from_the_studys_limits_on() -> None:
    assert {RK4: pytest.approx(2 * math.sqrt(2)), EULER: pytest.approx(2.0)} == LIMIT
    for method, limit in LIMIT.items():
        below, above = (growth(method, limit * part, 0.0) for part in (1 - 1e-6, 1 + 1e-6))
        assert below <= 1 + 1e-9 < above
    for method in (TRAPEZOIDAL_RULE, ALPHA):
        assert max(growth(method, x, 0.5) for x in np.geomspace(0.1, 1e3, 100)) <= 1 + 1e-9


@pytest.mark.parametrize("ratio", [0.0, 0.5, 2.0])
@pytest.mark.parametrize(("arm", "method"), EXPLICIT, ids=str)
def test_an_explicit_engine_grows_as_its_step_matrix_around_the_limit(
    arm: Arm, method: str, ratio: float
) -> None:
    """Below the limit by a hundredth nothing grows, above it by as much everything does."""
    assert (arm, method) in ARMS
    steps = np.geomspace(0.1, 4.0, 4000)
    limit = next(x for x in steps if growth(method, x, ratio) > 1 + 1e-9)
    for x in (0.99 * limit, 1.01 * limit):
        expected = growth(method, x, ratio)
        assert measured_growth(arm, x, ratio, 24, order=2) == pytest.approx(expected, rel=1e-4)
        assert (expected > 1 + 1e-4) == (x > limit)


@pytest.mark.parametrize(("arm", "method", "radius"), IMPLICIT, ids=str)
def test_an_implicit_engine_loses_what_its_matrix_says_and_has_no_limit(
    arm: Arm, method: str, radius: float
) -> None:
    order = 2 if arm is arms.TRAPEZOIDAL else 3
    for x in (0.1, 0.3, 1.0):
        loss = 1 - measured_growth(arm, x, 0.0, 120, order) ** 2
        assert loss == pytest.approx(1 - growth(method, x, 0.0, radius) ** 2, rel=0.01, abs=1e-6), x
    for x in (3.0, 60.0):
        assert measured_growth(arm, x, 0.0, 24, order) < 1 + 1e-4
