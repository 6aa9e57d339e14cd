"""How things look: colour and marker per engine, line style and fill per arm, names from columns.

Colours are Okabe and Ito's (2008), told apart by the colour-blind. In greyscale the markers tell the engines
apart, line style and fill the arms of one.
"""

import re
from typing import Any
from zlib import crc32

import pandas as pd

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
    begin = next((begin for begin in WORDS if name.startswith(f"{begin}_")), "")
    return WORDS.get(begin, begin) + name[len(begin) :].replace("_", " ")


def axis_label(column: str) -> str:
    """Return an axis label: slider_position_error_m is slider position error [m]."""
    name, unit = words(column)
    return f"{name} [{unit}]" if unit else name
