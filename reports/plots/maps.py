"""Maps over two fields of a scene: of a number, or of the motion in which each member ends."""

from typing import Literal

import numpy as np
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.collections import QuadMesh
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.patches import Patch

from reports.plots.axes import scale_of
from reports.plots.motions import motions
from reports.plots.picture import Picture
from reports.results import FloatArray
from reports.style import BLACK, BLUE, GREY, VERMILLION

#: Width and height in inches.
WIDTH_IN, HEIGHT_IN = 6.2, 4.6
#: Colours of sizes, and of numbers on both sides of zero, which the colour-blind tell apart.
SIZES, SIGNED = "cividis", "PuOr_r"
#: Colours end at this percentile of the numbers, so that a few far ones do not pale the map.
MOST = 99
#: Colours of the motions in which most members end, and of all others.
MOTIONS, OTHERS = (BLUE, "#E69F00", "#009E73", VERMILLION, "#CC79A7", "#56B4E9", "#F0E442"), BLACK


def draw_map(rows: pd.DataFrame, fields: tuple[str, str], column: str) -> Picture:
    """Return the map of a column; where several members share a place, of their mean."""
    scale = scale_of(column, rows[column].dropna())
    rows = rows.assign(**{column: scale.apply(rows[column])})
    low, high = colour_ends(rows[column].dropna().to_numpy())
    norm = (LogNorm if scale.log else Normalize)(low, high)
    picture, drawn = _draw_places(rows, fields, column, norm, SIGNED if low < 0 < high else SIZES)
    numbers: FloatArray = np.ma.filled(np.ma.asarray(drawn.get_array()), np.nan)
    if np.isnan(numbers).any() and isinstance(drawn, QuadMesh):
        handles = [Patch(color=GREY, label="no number: failed, or not defined")]
        picture.legend(handles=handles, loc="outside lower center")
    beyond = bool((numbers < low).any()), bool((numbers > high).any())
    ends: dict[tuple[bool, bool], Literal["neither", "min", "max", "both"]] = {
        (False, False): "neither",
        (True, False): "min",
        (False, True): "max",
        (True, True): "both",
    }
    picture.colorbar(drawn, label=scale.label, pad=0.02, extend=ends[beyond])
    return picture


def draw_basins(rows: pd.DataFrame, fields: tuple[str, str]) -> Picture:
    """Return the map of the motions in which members that did not fail end, the most frequent first."""
    found = motions(rows[rows["status"] == "ok"])
    counts = found.value_counts()
    names, others = [*counts.index[: len(MOTIONS)]], counts.iloc[len(MOTIONS) :]
    numbers = found.map({name: k for k, name in enumerate(names)}).fillna(len(names))
    members = [(colour, name, int(counts[name])) for colour, name in zip(MOTIONS, names, strict=False)]
    if len(others):
        members.append((OTHERS, f"{len(others)} other motions", int(others.sum())))
    colours = [colour for colour, _, _ in members]
    norm = BoundaryNorm(np.arange(len(colours) + 1) - 0.5, len(colours))
    rows = rows.assign(motion=numbers)
    picture, _ = _draw_places(rows, fields, "motion", norm, ListedColormap(colours))
    handles = [
        Patch(color=colour, label=f"{name}: {count} member{'s' * (count != 1)}")
        for colour, name, count in members
    ]
    picture.legend(handles=handles, loc="outside lower center", ncols=2)
    return picture


def colour_ends(numbers: FloatArray) -> tuple[float, float]:
    """Return the ends of the colours of ``numbers`` (n,): symmetric if there are some on both sides of zero.

    Of less than a hundred numbers none lies beyond.
    """
    if not len(numbers):
        return 0.0, 1.0
    if numbers.min() < 0 < numbers.max():
        sizes = np.abs(numbers)
        most = float(np.percentile(sizes, MOST, method="higher")) or float(sizes.max())
        return -most, most
    low = np.percentile(numbers, 100 - MOST, method="lower")
    return float(low), float(np.percentile(numbers, MOST, method="higher"))


def _draw_places(
    rows: pd.DataFrame, fields: tuple[str, str], column: str, norm: Normalize, colours: Colormap | str
) -> tuple[Picture, ScalarMappable]:
    """Return a picture of numbers over two fields: cells where members are a grid, or else dots."""
    picture = Picture(HEIGHT_IN, WIDTH_IN)
    ax = picture.add_subplot()
    points = rows.groupby(list(fields))[column].mean().reset_index()
    across, up = (scale_of(field, rows[field]) for field in fields)
    x, y = across.apply(points[fields[0]]), up.apply(points[fields[1]])
    drawn: ScalarMappable
    if len(np.unique(x)) * len(np.unique(y)) == len(points):
        cells = points.pivot_table(column, fields[1], fields[0], dropna=False).to_numpy()
        edges = _edges(np.unique(x), across.log), _edges(np.unique(y), up.log)
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


def _edges(middles: FloatArray, log: bool) -> FloatArray:
    """Return the n + 1 edges of cells around n places, halfway between them."""
    places = np.log(middles) if log else middles
    gaps = np.diff(places) if len(places) > 1 else np.ones(1)
    ends = places[:1] - gaps[0] / 2, places[-1:] + gaps[-1] / 2
    edges = np.concatenate([ends[0], (places[:-1] + places[1:]) / 2, ends[1]])
    return np.asarray(np.exp(edges) if log else edges)
