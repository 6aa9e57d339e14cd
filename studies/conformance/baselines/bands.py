"""How far a number may be from its baseline, to both sides.

A band is wide enough for another processor and narrow enough for another result: a part of the number, or so
many times what processors move it by, whichever is more. The lowest supported versions of all libraries
were held to these bands, too: of ten thousand numbers they move a hundred further, most of LSODA's, whose
bands are wider by the same rule, as the tables say of each. What is made of round-off alone has no more to
keep than its size, which is that of the truth's uncertainty, or of ``ROUND_OFF``.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from studies.conformance.baselines.measured import Number

#: A number half again as large is seen, and one smaller by a third; a count that is off by more than a tenth,
#: and an order by more than ``conform`` lets one be from what an engine states.
PART, COUNTS, ORDER = 0.25, 0.1, 0.1
#: What processors and versions were seen to move a number by counts so many times, for those not seen.
TIMES_MOVED = 5.0
#: Uncertainties are distances of two solutions that ought to be one: whoever rounds otherwise has another.
UNCERTAINTY, UNCERTAIN = 10.0, ("_uncertainty_", "_cross_check_")
#: Below these sizes, in the column's unit, there is nothing but round-off: some hundred units in the last
#: place of a mechanism of 0.1 m, or of some 100 J.
ROUND_OFF = {
    "constraint_violation_m": 1e-14,
    "constraint_speed_m_s": 1e-12,
    "ideal_gap_part": 1e-12,
    "penetration_part": 1e-12,
    "energy_balance_residual_J": 1e-11,
    "largest_numerical_gain_J": 1e-11,
    "unaccounted_energy_part": 1e-12,
    "stabilisation_loss_J": 1e-11,
    "stabilisation_power_W": 1e-10,
    "hidden_power_W": 1e-10,
    "hidden_power_low_W": 1e-10,
    "hidden_power_high_W": 1e-10,
    "mean_hidden_power_W": 1e-10,
}


@dataclass(frozen=True)
class Band:
    """From ``low`` to ``high``, both within."""

    low: float
    high: float


def band(name: str, number: Number, others: Sequence[float]) -> Band:
    """Return the band of a number that processors of other kinds find to be ``others``."""
    value = number.value
    if any(word in name for word in UNCERTAIN):
        found = (value, *others)
        return Band(min(found) / UNCERTAINTY, max(found) * UNCERTAINTY)
    half = max(TIMES_MOVED * moved(value, others), TIMES_MOVED * number.known_to, _usual(name, number))
    return Band(value - half, value + half)


def moved(value: float, others: Sequence[float]) -> float:
    """Return the most by which other processors move a number."""
    return max((abs(other - value) for other in others), default=0.0)


def _usual(name: str, number: Number) -> float:
    """Return half the width of a band if no processor moves the number and its truth is certain."""
    if name.endswith(("_order", "_exponent")):
        return ORDER
    return max((COUNTS if number.count else PART) * abs(number.value), ROUND_OFF.get(name, 0.0))
