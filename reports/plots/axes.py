"""Axes: the unit in which a column is drawn, and labels of logarithmic axes in plain letters."""

import math
import re
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axis import Axis
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import FixedLocator, LogFormatterSciNotation, MaxNLocator, NullFormatter

from reports.results import FloatArray
from reports.style import words

#: The digits that are labelled on an axis of less than two powers of ten, the fewest labels first.
DIGITS = ((1, 3), (1, 2, 5))
#: The ratio of the largest to the smallest number from which on an axis is logarithmic.
DECADES = 30.0
#: Labels of columns whose names say too little.
NAMES = {
    "slider_deviation_m": "largest deviation of the slider",
    "observed_deviation_m": "largest deviation from ideal joints",
    "rms_observed_deviation_m": "rms deviation from ideal joints",
    "flight_part": "part of time in flight",
}
#: Quantities per metre; a torque has the same ending.
PER_METRE = ("stiffness", "spring")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Scale:
    """How the numbers of a column are drawn: times ``factor``, under ``label``, logarithmic or not."""

    factor: float
    label: str
    log: bool

    def apply(self, values: pd.Series) -> FloatArray:
        """Return the numbers as they are drawn, (n,)."""
        return np.asarray(values, dtype=float) * self.factor

    @property
    def kind(self) -> str:
        """The kind of axis, as Matplotlib calls it."""
        return "log" if self.log else "linear"


def scale_of(column: str, values: pd.Series, name: str | None = None) -> Scale:
    """Return how the numbers of a column, or of a scene's field by its path, are drawn, under a ``name``."""
    numbers = np.asarray(values, dtype=float)
    sizes = np.abs(numbers[np.isfinite(numbers)])
    largest = float(sizes.max()) if len(sizes) else 1.0
    own, unit = _in_words(column)
    name = name or own
    factor, unit = _handy(unit, largest)
    log = bool((numbers > 0).all()) and largest >= DECADES * sizes.min()
    return Scale(factor, f"{name} [{unit}]" if unit else name, log)


def _in_words(path: str) -> tuple[str, str]:
    """Return a column, or a field of a scene by its path, in words, and its unit."""
    *owners, last = path.split(".")
    if owners and words(owners[-1])[1] and not words(last)[1]:  # start.angle_rad.crank, body.crank.pins_m.A
        owners[-1], last = last, owners[-1]
    name, unit = words(last)
    if last == "pins_m":
        name = f"pin {owners.pop()}"
    if unit and name in PER_METRE:
        unit = "N/m"
    match owners:
        case [] | ["start"]:
            return NAMES.get(path, name), unit
        case ["start", *_, owner]:
            return f"{owner}'s {name} at the start", unit
        case ["clearance", joint, *_]:
            return f"{name} at {joint}", unit
        case ["load", body, *_]:
            return f"{name} on {body}", unit
        case _:
            return f"{name} of {owners[-1]}", unit


def _handy(unit: str, largest: float) -> tuple[float, str]:
    """Return a unit in which numbers up to ``largest`` have few digits, and the factor to it."""
    if unit == "m" and largest < 1:
        return (1e6, "µm") if largest < 1e-3 else (1e3, "mm")
    if unit == "N" and largest >= 1e4:
        return 1e-3, "kN"
    return (180 / np.pi, "°") if unit == "rad" else (1.0, unit)


class Powers(LogFormatterSciNotation):
    """Powers of ten as plain letters, which are found as text and need no formula to be set."""

    def __init__(self) -> None:
        super().__init__(minor_thresholds=(math.inf, math.inf))  # a label for every tick

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of a tick, 10⁻³ or 2×10⁻³."""
        text = re.sub(r"\$|\\mathdefault", "", super().__call__(x, pos)).replace(r"\times", "×")
        text = re.sub(r"\^\{(-?\d+)\}", lambda m: m[1].translate(_RAISED), text)
        return re.sub(r"[{}\s]", "", text)


def set_plainly(drawing: Drawing) -> None:
    """Label the logarithmic axes of a drawing that have Matplotlib's labels, once their ends are known."""
    for axis in (axis for ax in drawing.axes for axis in (ax.xaxis, ax.yaxis)):
        if type(axis.get_major_formatter()) is LogFormatterSciNotation:
            _label(axis)


def _label(axis: Axis) -> None:
    low, high = sorted(axis.get_view_interval())
    if len(_within(low, high, (1,))) < 2:
        places = [_within(low, high, digits) for digits in DIGITS]
        even = [value for value in MaxNLocator(9).tick_values(low, high) if low <= value <= high]
        axis.set_major_locator(FixedLocator(next((of for of in places if len(of) > 1), [even[0], even[-1]])))
    axis.set_major_formatter(Powers())
    axis.set_minor_formatter(NullFormatter())


def _within(low: float, high: float, digits: tuple[int, ...]) -> list[float]:
    """Return the numbers between two ends that are one of some digits times a power of ten."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [value for k in powers for digit in digits if low <= (value := digit * 10.0**k) <= high]
