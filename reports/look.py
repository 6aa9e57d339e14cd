"""How things look: colours, names from columns, numbers as text, and Matplotlib's settings.

Colours are Okabe and Ito's (2008), told apart by the colour-blind. In greyscale the markers tell the engines
apart, line style and fill the configurations of one.
"""

import io
import math
import re
from collections.abc import Iterable
from typing import Any
from zlib import crc32

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogFormatterSciNotation, LogLocator, NullLocator

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
    "legend.fontsize": 8,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E6E6E6",
    "axes.axisbelow": True,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.5,
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.h_pad": 0.08,
    "savefig.dpi": 200,
    "svg.hashsalt": "crankslider",
    "svg.fonttype": "none",
}
#: The width of a figure.
WIDTH_IN = 7.5

#: Units at the end of column names as they are written, longest first.
UNITS = {"percent": "%", "rad_s2": "rad/s²", "kg_m2": "kg·m²", "N_s_m": "N·s/m", "N_m_s": "N·m·s"}
UNITS |= {"rad_s": "rad/s", "1_s": "1/s", "m_s2": "m/s²", "m_s": "m/s", "N_m": "N·m", "N_s": "N·s"}
UNITS |= {unit: unit for unit in ("rad", "kg", "Hz", "Pa", "m", "N", "J", "s")}
#: The beginnings of column names that are not their own words.
WORDS = {
    "largest_numerical_gain": "largest energy-balance error",
    "impact_force_in_phase": "impact force at equal phase",
    "impact_force_relative": "relative peak force",
    "impact_force": "peak force",
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


def line_styles(rows: pd.DataFrame) -> dict[str, dict[str, Any]]:
    """Return colour, marker, line style and fill of each label among rows, as Matplotlib takes them.

    Labels are in the order of legends; an engine's first one has the engine's first line style, and so on.
    """
    arms = rows[["label", "engine"]].drop_duplicates("label").sort_values("label")
    arms["place"] = arms.groupby("engine").cumcount()
    return {arm.label: variant(arm.engine, arm.place) for arm in arms.itertuples()}


def variant(engine: str, place: int) -> dict[str, Any]:
    """Return the style of an engine's first line, second line, ... (counted from 0)."""
    colour, marker = ENGINES.get(engine) or NEWCOMERS[crc32(engine.encode()) % len(NEWCOMERS)]
    dashes, fill = VARIANTS[place % len(VARIANTS)]
    style: dict[str, Any] = {"color": colour, "marker": marker, "linestyle": dashes}
    return style | {"fillstyle": fill, "markerfacecoloralt": "white"}


def words(column: str) -> tuple[str, str]:
    """Return a column's name in words and its unit: slider_position_error_m is slider position error, m."""
    ending = next((ending for ending in UNITS if column.endswith(f"_{ending}")), "")
    name = column.removesuffix(f"_{ending}").removeprefix("observed_")
    begin = next((begin for begin in WORDS if f"{name}_".startswith(f"{begin}_")), "")
    return WORDS.get(begin, begin) + name[len(begin) :].replace("_", " "), UNITS.get(ending, "")


def axis_label(column: str) -> str:
    """Return an axis label: slider_position_error_m is slider position error [m]."""
    name, unit = words(column)
    return f"{name} [{unit}]" if unit else name


# Numbers as text

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
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


def plain(value: float, digits: int = 2) -> str:
    """Return a number of ordinary size with so many significant digits and no exponent: 140, 0.12."""
    return ABSENT if math.isnan(value) else f"{float(f'{value:.{digits}g}'):g}"


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


def listed(parts: Iterable[str]) -> str:
    """Return parts as a list in a sentence: a, b and c."""
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last


def command(row: pd.Series, scene: str) -> str:
    """Return the command that makes a row's run, with all settings that the row has.

    ``scene`` is what is typed after ``crankslider simulate``: a library scene's name or a file, with options.
    """
    settings = row.filter(regex="^setting_").dropna()
    words = [f"--set {name.removeprefix('setting_')}={value}" for name, value in settings.items()]
    step = f"--samples {row['samples']:.0f} --step {row['step_s']:.10g}"  # rounded it may be another
    return " ".join(["crankslider simulate", scene, f"--engine {row['engine']}", *words, step])


# Figures


class Picture(Figure):
    """A figure ``height_in`` high, as wide as a page unless told otherwise, that notebooks show."""

    def __init__(self, height_in: float, width_in: float = WIDTH_IN) -> None:
        super().__init__(figsize=(width_in, height_in))

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows."""
        return picture_bytes(self, ".png")


def picture_bytes(figure: Figure, ending: str) -> bytes:
    """Return a figure as the bytes of a file whose name ends in .png, .svg or .pdf, without a date."""
    content = io.BytesIO()
    dates = {".png": None, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    _label_powers(figure)
    with mpl.rc_context(RC):
        if layout := figure.get_layout_engine():
            layout.execute(figure)
            figure.set_layout_engine("none")  # which would draw all of it only to be laid out
        figure.savefig(content, format=ending[1:], metadata=dates[ending])
    return content.getvalue()


def _label_powers(figure: Figure) -> None:
    """Label logarithmic axes in plain letters, which need no formula to be set; short ones at more digits."""
    for axis in (axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)):
        if isinstance(axis.get_major_formatter(), LogFormatterSciNotation):
            low, high = sorted(axis.get_view_interval())
            if high < 100 * low:
                axis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high > 10 * low else (1.0, 2.0, 5.0)))
            axis.set_major_formatter(FuncFormatter(_power))
            axis.set_minor_locator(NullLocator())


def _power(value: float, _: object = None) -> str:
    """Return a number at a logarithmic axis: 10⁻³ or 2×10⁻³."""
    digits, power = f"{value:.0e}".split("e")
    return f"{'' if digits == '1' else f'{digits}×'}10{str(int(power)).translate(_RAISED)}"
