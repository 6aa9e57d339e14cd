"""The Taylor series of an integration, step by step, kept as their coefficients."""

from functools import cached_property
from typing import Any

import numpy as np

from engine_models.engine import FloatArray


class Series:
    """A state as a function of its independent variable, which has been called after every step.

    heyoka's own continuous output is compiled anew for every integration, which takes as long as thousands of
    steps. ``times`` are the steps' ends, the first one's beginning among them.
    """

    def __init__(self, begin: float) -> None:
        self._ends, self._coefficients = [begin], list[FloatArray]()

    def __call__(self, integrator: Any) -> bool:
        """Keep the step that an integrator has just taken; as its callback, have it go on."""
        self._ends.append(integrator.time)
        self._coefficients.append(integrator.tc.copy())
        return True

    @cached_property
    def times(self) -> FloatArray:
        """The ends of the steps, (n + 1,), when all have been taken."""
        return np.array(self._ends)

    @cached_property
    def _all(self) -> FloatArray:
        return np.array(self._coefficients)

    def at(self, own: FloatArray) -> FloatArray:
        """Return the states (m, size) at values (m,) of the independent variable."""
        ends = self.times
        steps = np.clip(np.searchsorted(ends, own, "right") - 1, 0, len(self._coefficients) - 1)
        coefficients = self._all[steps]
        h = (own - ends[steps])[:, None]
        states = coefficients[:, :, -1].copy()
        for k in reversed(range(coefficients.shape[-1] - 1)):
            states = states * h + coefficients[:, :, k]
        return np.asarray(states)
