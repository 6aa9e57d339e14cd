"""Numbers of a sweep as they are drawn: in handy units, and in equal ratios where they span decades."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from reports.results import FloatArray
from reports.style import words

#: From this ratio of largest to smallest on an axis is logarithmic.
DECADES = 30.0
#: Fields of the start of single bodies.
BODIES = ("start.crank.", "start.rod.", "start.slider.")
#: What is said of columns in more words than their names have.
NAMES = {
    "strobe_m": "slider's deviation once a turn",
    "slider_deviation_m": "largest deviation of the slider",
    "impact_phase_rad": "crank angle at impact",
    "flight_part": "part of time in flight",
    "exponent_1_s": "finite-time exponent",
    "exponent_per_revolution": "exponent in a revolution",
}


@dataclass(frozen=True)
class Scale:
    """How the numbers of a column are drawn: times ``factor``, under ``label``, logarithmic or not."""

    factor: float
    label: str
    log: bool

    def drawn(self, values: pd.Series) -> FloatArray:
        """Return the numbers as they are drawn, (n,)."""
        return np.asarray(values, dtype=float) * self.factor

    @property
    def kind(self) -> str:
        """The kind of axis, as Matplotlib calls it."""
        return "log" if self.log else "linear"


def scale_of(column: str, values: pd.Series) -> Scale:
    """Return how the numbers of a column, or of a field by its path, are drawn."""
    numbers = np.abs(np.asarray(values, dtype=float))
    largest = float(np.nanmax(numbers)) if np.isfinite(numbers).any() else 1.0
    name, unit = words(column.rpartition(".")[2])
    name = NAMES.get(column, name)
    if column.startswith("clearance."):
        name = f"{name} at {column.split('.')[1]}"
    if column.startswith(BODIES):
        name = f"{column.split('.')[1]}'s {name} at the start"
    factor, unit = _handy(unit, largest)
    positive = bool((np.asarray(values, dtype=float) > 0).all())
    log = positive and largest >= DECADES * float(np.nanmin(numbers))
    return Scale(factor, f"{name} [{unit}]" if unit else name, log)


def _handy(unit: str, largest: float) -> tuple[float, str]:
    """Return the factor to a unit in which numbers up to so large are easily read, and that unit."""
    if unit == "m" and largest < 1:
        return (1e6, "µm") if largest < 1e-3 else (1e3, "mm")
    if unit == "N" and largest >= 1e4:
        return 1e-3, "kN"
    return (180 / np.pi, "°") if unit == "rad" else (1.0, unit)
