"""A map of one number over two fields: cells where the members are a grid, dots where they were drawn."""

from typing import Literal

import numpy as np
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.collections import QuadMesh
from matplotlib.colors import Colormap, LogNorm, Normalize
from matplotlib.patches import Patch

from reports.plots.sweeps.scales import Scale, scale_of
from reports.results import FloatArray
from reports.run.picture import Picture
from reports.style import GREY

#: Width and height in inches.
SIZE_IN = (6.2, 4.6)
#: Told apart by the colour-blind: of a size, and of what is on both sides of zero.
SIZES, SIGNED = "cividis", "PuOr_r"
#: Colours end at the percentile within which so many of the numbers are, so that a few far ones pale no map.
MOST = 99


def draw_map(rows: pd.DataFrame, fields: tuple[str, str], column: str) -> Picture:
    """Return the map of a column; where several members share a place, of their mean."""
    of = scale_of(column, rows[column].dropna())
    norm, colours = _norm(of, rows[column])
    picture, drawn = draw_places(
        rows.assign(**{column: of.drawn(rows[column])}), fields, column, norm, colours
    )
    if rows.groupby(list(fields))[column].mean().isna().any() and isinstance(drawn, QuadMesh):
        handles = [Patch(color=GREY, label="no number: failed, or not defined")]
        picture.legend(handles=handles, loc="outside lower center")
    picture.colorbar(drawn, label=of.label, pad=0.02, extend=_extend(drawn))
    return picture


def colour_ends(numbers: FloatArray) -> tuple[float, float]:
    """Return the numbers at which colours end: the same on both sides of zero where there are some on both.

    There are ``numbers`` (n,), of which some hundred are needed for any to lie beyond.
    """
    if not len(numbers):
        return 0.0, 1.0
    if numbers.min() < 0 < numbers.max():
        sizes = np.abs(numbers)
        most = float(np.percentile(sizes, MOST, method="higher")) or float(sizes.max())
        return -most, most
    low = np.percentile(numbers, 100 - MOST, method="lower")
    return float(low), float(np.percentile(numbers, MOST, method="higher"))


def draw_places(
    rows: pd.DataFrame, fields: tuple[str, str], column: str, norm: Normalize, colours: Colormap | str
) -> tuple[Picture, ScalarMappable]:
    """Return a picture of numbers over two fields, and what of it a bar of colours goes by."""
    width, height = SIZE_IN
    picture = Picture(height, width)
    ax = picture.add_subplot()
    points = rows.groupby(list(fields))[column].mean().reset_index()
    across, up = (scale_of(field, rows[field]) for field in fields)
    x, y = (scale.drawn(points[field]) for scale, field in zip((across, up), fields, strict=True))
    drawn: ScalarMappable
    if len(np.unique(x)) * len(np.unique(y)) == len(points):
        cells = points.pivot_table(column, fields[1], fields[0], dropna=False).to_numpy()
        edges = (_edges(np.unique(values), scale.log) for values, scale in ((x, across), (y, up)))
        drawn = ax.pcolormesh(*edges, np.ma.masked_invalid(cells), norm=norm, cmap=colours, rasterized=True)
        ax.set_facecolor(GREY)
        ax.grid(visible=False)
    else:
        drawn = ax.scatter(x, y, c=points[column], norm=norm, cmap=colours, s=9, linewidths=0)
    ax.set(xlabel=across.label, ylabel=up.label, xscale=across.kind, yscale=up.kind)
    if not across.log:
        ax.ticklabel_format(axis="x", useOffset=False)
    if not up.log:
        ax.ticklabel_format(axis="y", useOffset=False)
    return picture, drawn


def _norm(of: Scale, values: pd.Series) -> tuple[Normalize, str]:
    """Return how numbers become colours: zero in the middle where there are some on both sides."""
    low, high = colour_ends(of.drawn(values.dropna()))
    return (LogNorm if of.log else Normalize)(low, high), SIGNED if low < 0 < high else SIZES


def _extend(drawn: ScalarMappable) -> Literal["neither", "min", "max", "both"]:
    """Return at which ends of its bar of colours numbers lie beyond."""
    numbers: FloatArray = np.ma.filled(np.ma.asarray(drawn.get_array()), np.nan)
    low, high = drawn.get_clim()
    below, above = (numbers < low).any(), (numbers > high).any()
    return "both" if below and above else "min" if below else "max" if above else "neither"


def _edges(middles: FloatArray, log: bool) -> FloatArray:
    """Return the n + 1 edges of cells around n places."""
    places = np.log(middles) if log else middles
    half = np.diff(places) / 2 if len(places) > 1 else np.array([0.5])
    edges = np.concatenate(
        [places[:1] - half[:1], places[:-1] + half[: len(places) - 1], places[-1:] + half[-1:]]
    )
    return np.asarray(np.exp(edges) if log else edges)
