"""Labels of logarithmic axes, set once for all: in plain letters, and so few that none lie on each other."""

import math
import re

from matplotlib.axis import Axis
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import FixedLocator, LogFormatterSciNotation, MaxNLocator, NullFormatter

#: What stands at an axis that has less than two powers of ten, the fewest labels first.
DIGITS = ((1, 3), (1, 2, 5))
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


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
    """Label all logarithmic axes of a drawing whose labels nobody has set, once their ends are known."""
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
