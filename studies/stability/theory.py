"""What theory says of stability: step matrices of the methods, their limits, and a contact's frequency.

A mass on a spring and a damper, y'' + 2 zeta omega y' + omega^2 y = 0, is what every contact is near a state.
A method of fixed step h takes it from one step to the next by a matrix that depends on omega h and zeta
alone; the motion grows where the largest magnitude of its eigenvalues, the spectral radius, exceeds 1.
"""

from collections.abc import Callable
from functools import cache
from math import sqrt

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.contact_law import exponent_of, stiffness_of
from engine_models.scene.scene import Scene

RK4, EULER, TRAPEZOIDAL, ALPHA = "RK4", "semi-implicit Euler", "trapezoidal", "generalized-alpha"

#: No limit is looked for beyond this omega h, and none below the first step of the search.
LARGEST, SMALLEST = 64.0, 0.125
#: A limit is found to this part of itself.
RESOLUTION = 2e-4


def step_matrix(method: str, frequency_step: float, damping_ratio: float, radius: float = 0.5) -> FloatArray:
    """Return the matrix of a step, (2, 2) on (omega y, y') or (3, 3) on (omega^2 y, omega y', y'').

    ``frequency_step`` is omega h; ``radius`` is the generalized-alpha method's at infinite frequency.
    """
    x, d = frequency_step, 2 * damping_ratio
    slope = x * np.array([[0.0, 1.0], [-1.0, -d]])
    one = np.eye(2)
    if method == RK4:
        return np.asarray(one + slope @ (one + slope / 2 @ (one + slope / 3 @ (one + slope / 4))))
    if method == EULER:  # y first, then y' with the new y and, in the damper, the old y'
        return np.array([[1.0, x], [-x, 1 - d * x - x * x]])
    if method == TRAPEZOIDAL:
        return np.asarray(np.linalg.solve(one - slope / 2, one + slope / 2))
    return _alpha_matrix(x, d, radius)


def _alpha_matrix(x: float, d: float, radius: float) -> FloatArray:
    """Return the step of Chung and Hulbert's (1993) method, a the auxiliary acceleration.

    (1 - am) a+ + am a = (1 - af) y''+ + af y'', y'' = -omega^2 y - d omega y', and Newmark's formulas.
    """
    am, af = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    gamma = 0.5 + af - am
    beta = (gamma + 0.5) ** 2 / 4
    # On (omega^2 y, omega y', a): old and new side of Newmark's two formulas and of the balance.
    new = np.array([[1, 0, -beta * x * x], [0, 1, -gamma * x], [1 - af, (1 - af) * d, 1 - am]])
    old = np.array([[1, x, (0.5 - beta) * x * x], [0, 1, (1 - gamma) * x], [-af, -af * d, -am]])
    return np.asarray(np.linalg.solve(new, old))


def growth(method: str, frequency_step: float, damping_ratio: float, radius: float = 0.5) -> float:
    """Return the spectral radius of a step."""
    matrix = step_matrix(method, frequency_step, damping_ratio, radius)
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def leading_loss(method: str, frequency_step: float, radius: float) -> float:
    """Return the part of the energy that a step loses without damper, to leading order; 0 if it keeps all."""
    if method == ALPHA:
        return float(((1 - radius) / (1 + radius)) ** 3 * frequency_step**4)
    return frequency_step**6 / 72 if method == RK4 else 0.0


@cache
def limit(method: str, damping_ratio: float) -> float | None:
    """Return the omega h from which on the method's motion grows, None if there is none."""
    return first_growth(lambda x: growth(method, x, damping_ratio) > 1 + 1e-9, 1e-9)


def first_growth(grows: Callable[[float], bool], resolution: float = RESOLUTION) -> float | None:
    """Return the omega h from which on ``grows`` holds, by doubling and bisection, None if it never does."""
    high = SMALLEST
    while not grows(high):
        high *= 2
        if high > LARGEST:
            return None
    low = high / 2
    while high - low > resolution * high:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return (low + high) / 2


def first_impact(scene: Scene) -> tuple[float, float]:
    """Return energy in J and frequency in rad/s at the bottom of the first impact of slider and rod.

    The crank turns at constant speed w from 0 with clearance c at B alone: the rod draws away from the
    slider, of mass m, with a0 = r w^2 (1 + r/L), so that the slider falls through c and the penetration
    delta: m a0 (c + delta) = K delta^(n+1)/(n+1), its frequency then sqrt(n K delta^(n-1)/m).
    """
    crank, rod, slider = scene.crank_slider()
    clearance = scene.clearance.B
    assert clearance is not None
    n, stiffness, m = exponent_of(clearance), stiffness_of(clearance), slider.mass_kg
    a0 = crank.length_m * scene.start.crank_speed_rad_s**2 * (1 + crank.length_m / rod.length_m)
    delta = 0.0
    for _ in range(60):  # contracts: the right side grows by less than delta does
        energy = m * a0 * (clearance.radial_clearance_m + delta)
        delta = ((n + 1) * energy / stiffness) ** (1 / (n + 1))
    return energy, sqrt(n * stiffness * delta ** (n - 1) / m)
