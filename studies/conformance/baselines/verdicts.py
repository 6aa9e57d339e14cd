"""What was measured held against the tables: whatever left its band, to either side, and whatever has none.

A number that got better fails as one that got worse does: either may be a bug, and only a baseline at what is
now the best shows when it is lost again. Whoever knows why accepts it.
"""

from collections.abc import Mapping

from studies.conformance.baselines.measured import Key, Number
from studies.conformance.baselines.table import Baseline

#: Words of the columns in which less is better; in others, as works and counts, neither side is.
LESS_IS_BETTER = ("error", "residual", "unaccounted", "gap_part", "violation", "missed", "unmatched")
#: An order appears where rounding moves its error past a limit; the error itself has a baseline.
MAY_APPEAR = "_order"
ACCEPT = 'where that is meant, accept it by --accept --why "..."'


def verdicts(numbers: Mapping[Key, Number], baselines: Mapping[Key, Baseline]) -> list[str]:
    """Return a line for each number that its baseline contradicts, or that has none, or that is gone."""
    lines = [verdict(key, numbers[key], baselines[key]) for key in numbers if key in baselines]
    new = {key for key in numbers.keys() - baselines.keys() if not key.quantity.endswith(MAY_APPEAR)}
    for key in sorted(new):
        lines.append(f"{_name(key)}: expected a baseline, got none for {numbers[key].value:.4g}: {ACCEPT}")
    for key in sorted(baselines.keys() - numbers.keys()):
        lines.append(f"{_name(key)}: expected {baselines[key].value:.4g}, got no such number: {ACCEPT}")
    return [line for line in lines if line]


def verdict(key: Key, number: Number, baseline: Baseline) -> str:
    """Return "" for a number within its band, or else in a line what became of it."""
    if baseline.low <= number.value <= baseline.high:
        return ""
    larger, judged = number.value > baseline.high, any(word in key.quantity for word in LESS_IS_BETTER)
    became = ("worse" if larger else "better") if judged else ("larger" if larger else "smaller")
    expected = f"{baseline.low:.4g} to {baseline.high:.4g} {baseline.unit}"
    return f"{_name(key)} is {became}: expected {expected}, got {number.value:.4g}: {ACCEPT}"


def _name(key: Key) -> str:
    return f"{key.quantity} of {key.arm} on {key.scene}, {key.resolution} ({key.study})"
