"""Exudyn on its own with a wide event gap: fewer steps at each touch, at errors that are in part luck."""

from tests.benchmarks.rivals import exudyn_alone
from tests.benchmarks.rivals.problem import Answer

#: The gap in parts of the tolerance, 300 times as wide as the usual one, and the safety factor to go with it:
#: by Exudyn's own 0.9 the same runs overflow.
GAP, SAFETY = 0.03, 0.8


def clearance_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position by DOPRI5, from event to event."""
    return exudyn_alone.clearance_free(tolerance, samples, GAP * tolerance, SAFETY)
