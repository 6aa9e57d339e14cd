"""Student's distribution by quadrature, which knows nothing of the library that reports use."""

import math
from collections.abc import Callable

#: Panels of Simpson's rule; densities are smooth, so that it is exact to some ten digits.
PANELS = 400


def student_tail(t: float, freedom: float) -> float:
    """Return the chance of more than t, by t = sqrt(freedom) tan x."""
    scale = math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) / math.sqrt(math.pi)
    return scale * _integral(
        lambda x: math.cos(x) ** (freedom - 1), math.atan(t / math.sqrt(freedom)), math.pi / 2
    )


def student_quantile(chance: float, freedom: float) -> float:
    """Return the t that is exceeded with a chance below a half, by bisection."""
    low, high = 0.0, 100.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if student_tail(middle, freedom) > chance else (low, middle)
    return low


def _integral(of: Callable[[float], float], low: float, high: float) -> float:
    h = (high - low) / PANELS
    inner = sum((4 if k % 2 else 2) * of(low + k * h) for k in range(1, PANELS))
    return h / 3 * (of(low) + inner + of(high))
