"""The order at which errors fall with the step."""

from collections.abc import Sequence

import numpy as np

#: A regression over three halvings in the asymptotic range; RK4's next term bends it by less than this.
ORDER_TOLERANCE = 0.05


def slope(steps: Sequence[float], errors: Sequence[float]) -> float:
    """Return the order: the slope of a straight line through errors over steps, both in logarithms."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
