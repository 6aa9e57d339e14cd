"""How things look: colours, names from columns, numbers as text, units of axes, and Matplotlib's settings.

Colours are Okabe and Ito's (2008), told apart by the colour-blind. In greyscale the markers tell the engines
apart, line style and fill the configurations of one.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from matplotlib.axis import Axis
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import FixedLocator, LogFormatterSciNotation, MaxNLocator, NullFormatter
from numpy.typing import NDArray

BLACK, VERMILLION, BLUE, GREY = "#000000", "#D55E00", "#0072B2", "#8C8C8C"

#: Colour and marker of each engine, in the order of legends.
ENGINES = {
    "reference": (BLACK, "o"),
    "exudyn": (VERMILLION, "s"),
    "pymunk": (BLUE, "^"),
    "scipy": ("#009E73", "D"),
}

#: Those of engines without a line above, each picked by the engine's name: the same in every figure.
NEWCOMERS = (("#CC79A7", "v"), ("#E69F00", "P"), ("#56B4E9", "X"))

#: Arms in the order of legends, each engine's best practice first; others follow by number and name.
ARMS = ("projection", "Baumgarte", "none", "trapezoidal", "generalized-alpha", "tuned", "out of the box")

#: Line style and marker fill of an engine's first arm, second arm, ...
VARIANTS = (("-", "full"), ("--", "none"), (":", "left"), ("-.", "bottom"), ((0, (1, 4)), "top"))

#: Matplotlib settings of every figure; sizes are those of a page 7.5 inches wide.
RC: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.5,
    "lines.markeredgewidth": 1.0,
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.h_pad": 0.08,
    "savefig.dpi": 200,
    "path.simplify_threshold": 0.25,  # of a pixel, which nobody sees; curves are a third as large
    "svg.hashsalt": "crankslider",
    "svg.fonttype": "path",
}
#: The width of a figure.
WIDTH_IN = 7.5

#: Units at the end of column names as they are written, longest first.
UNITS = {
    "percent": "%",
    "rad_s2": "rad/s²",
    "kg_m2": "kg·m²",
    "N_s_m": "N·s/m",
    "N_m_s": "N·m·s",
    "rad_s": "rad/s",
    "1_s": "1/s",
    "m_s2": "m/s²",
    "m_s": "m/s",
    "N_m": "N·m",
    "N_s": "N·s",
    "rad": "rad",
    "kg": "kg",
    "Hz": "Hz",
    "Pa": "Pa",
    "m": "m",
    "N": "N",
    "J": "J",
    "s": "s",
}


#: The beginnings of column names that are not their own words.
WORDS = {
    "largest_numerical_gain": "largest energy-balance error",
    "impact_force_in_phase": "impact force at equal phase",
    "impact_force_relative": "relative peak force",
    "impact_force": "peak force",
    "impact_penetration_relative": "relative penetration",
    "impact_duration_relative": "relative duration",
}


def legend_place(engine: str, arm: str) -> tuple[int, str, int, int, str]:
    """Return what sorts arms into the order of legends and tables."""
    engines = list(ENGINES)
    number = re.match(r"\d+", arm)
    known = ARMS.index(arm) if arm in ARMS else len(ARMS)
    place = engines.index(engine) if engine in engines else len(engines)
    return place, engine, known, int(number[0]) if number else 0, arm


def in_legend_order(rows: pd.DataFrame) -> pd.Categorical:
    """Return the labels of rows as categories in the order of legends."""
    arms = rows[["engine", "arm", "label"]].drop_duplicates("label").itertuples(index=False)
    order = sorted(arms, key=lambda each: legend_place(each.engine, each.arm))
    return pd.Categorical(rows["label"], [each.label for each in order], ordered=True)


def labels(rows: pd.DataFrame) -> list[str]:
    """Return the labels among rows, each once, in the order of legends."""
    return list(rows["label"].drop_duplicates().sort_values())


def line_styles(rows: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Return colour, marker, line style and fill of each label among rows, as Matplotlib takes them.

    Labels are in the order of legends; an engine's first one has the engine's first line style, and so on.
    """
    arms = rows[["engine", "label"]].drop_duplicates("label").sort_values("label")
    places = arms.groupby("engine").cumcount()
    engines = zip(arms["label"], arms["engine"], places, strict=True)
    return {label: variant(engine, place) for label, engine, place in engines}


def variant(engine: str, place: int) -> dict[str, Any]:
    """Return the style of an engine's first line, second line, ... (counted from 0)."""
    colour, marker = ENGINES.get(engine) or NEWCOMERS[crc32(engine.encode()) % len(NEWCOMERS)]
    dashes, fill = VARIANTS[place % len(VARIANTS)]
    return {
        "color": colour,
        "marker": marker,
        "linestyle": dashes,
        "fillstyle": fill,
        "markerfacecoloralt": "white",
    }


def words(column: str) -> tuple[str, str]:
    """Return a column's name in words and its unit: slider_position_error_m is slider position error, m."""
    for ending, unit in UNITS.items():
        if column.endswith(f"_{ending}"):
            return _in_words(column[: -len(ending) - 1]), unit
    return _in_words(column), ""


def _in_words(name: str) -> str:
    """Return a column's name without its unit in words, of what a scene observes by that alone: B x error."""
    name = name.removeprefix("observed_")
    begin = next((begin for begin in WORDS if f"{name}_".startswith(f"{begin}_")), "")
    return WORDS.get(begin, begin) + name[len(begin) :].replace("_", " ")


def axis_label(column: str) -> str:
    """Return an axis label: slider_position_error_m is slider position error [m]."""
    name, unit = words(column)
    return f"{name} [{unit}]" if unit else name


# Numbers as text

#: What stands for a number that a scene or an engine does not have.
ABSENT = "–"
#: SI prefixes, by the power of ten of each; and the units that take them.
PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
PREFIXED = ("m", "s", "N", "W", "J", "N·m")


def quantity(value: float, unit: str = "") -> str:
    """Return a number with two significant digits and its unit: 0.12 µm, 4.4 %, 1.2×10⁻⁵; a count has all."""
    if not unit and float(value).is_integer() and abs(value) < 1e5:
        return f"{value:.0f}"
    rounded = float(f"{value:.2g}")
    power = int(f"{abs(rounded):e}".partition("e")[2]) // 3 * 3
    if unit in PREFIXED and rounded and power in PREFIXES:
        value, unit, rounded = value / 10.0**power, PREFIXES[power] + unit, rounded / 10.0**power
    plainly = not rounded or 1e-3 <= abs(rounded) < 1e5
    digits, raised = f"{value:.1e}".split("e")
    text = f"{float(f'{value:.2g}'):g}" if plainly else f"{digits}×10{str(int(raised)).translate(_RAISED)}"
    return f"{text}{unit and ' ' + unit}"


def number(value: float) -> str:
    """Return a number with two significant digits, 0.00123 as 1.2e-03, and NaN as a dash."""
    return ABSENT if math.isnan(value) else f"{value:.1e}"


def plain(value: float) -> str:
    """Return a number of ordinary size with two significant digits and no exponent: 140, 0.12."""
    return ABSENT if math.isnan(value) else f"{float(f'{value:.2g}'):g}"


def setting(name: str, *values: float) -> str:
    """Return a setting with its value or its range as it is typed: step_tolerance 1e-10, step 0.001 s."""
    ends = " to ".join(dict.fromkeys(f"{value:.3g}" for value in values))
    return f"{name} {ends}{' s' if name == 'step' else ''}"


def span(values: Iterable[float], form: str = "") -> str:
    """Return the least and the largest of some numbers, as one number if they read the same; NaN is left out.

    They are ``plain``, or by a format.
    """
    known = sorted(value for value in values if not math.isnan(value))
    texts = [f"{end:{form}}" if form else plain(end) for end in (*known[:1], *known[-1:])]
    return " to ".join(dict.fromkeys(texts)) or ABSENT


def error(value: float, uncertainty: float = math.nan) -> str:
    """Return an error with two significant digits, never with digits below the reference's uncertainty.

    An error below the uncertainty u is shown as ``< u``; NaN as a dash.
    """
    return f"< {number(uncertainty)}" if value < uncertainty else number(value)


def listed(parts: Iterable[str]) -> str:
    """Return parts as a list in a sentence: a, b and c."""
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last


# Axes

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

    def apply(self, values: pd.Series) -> NDArray[np.float64]:
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
    own, unit = _path_in_words(column)
    name = name or own
    factor, unit = _handy(unit, largest)
    log = bool((numbers > 0).all()) and largest >= DECADES * sizes.min()
    return Scale(factor, f"{name} [{unit}]" if unit else name, log)


def _path_in_words(path: str) -> tuple[str, str]:
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
