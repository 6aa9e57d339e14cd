"""The picture of a sweep: a column of its rows over one field, or as a map over two."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize

from reports.look import BLACK, GREY, RC, scale_of
from reports.plots.picture import Picture
from reports.results import FloatArray

FORCE, JOINT_FORCE = "largest_contact_force_N", "largest_joint_"
#: Height of a picture over one field, and size of a map, in inches; the map's colours.
HEIGHT_IN, MAP_IN, COLOURS = 3.5, (4.6, 6.2), "cividis"


class NoPicture(ValueError):
    """There is no picture of this; the message says of what there is one."""


def sweep_picture(frame: pd.DataFrame, fields: Sequence[str], title: str, show: str | None = None) -> Picture:
    """Return the picture of a sweep's rows over the one or two fields that differ.

    It shows the column ``show``, or the largest contact force, or that of the first joint.

    Raises:
        NoPicture: other numbers of fields differ, or no member has a number in the column.
    """
    if not 1 <= len(fields) <= 2:
        raise NoPicture(f"expected one or two fields that differ, got {len(fields)}")
    first = [FORCE, *(name for name in frame if name.startswith(JOINT_FORCE))]
    column = show or next((name for name in first if name in frame), FORCE)
    if column not in frame or frame[column].isna().all():
        raise NoPicture(f"expected members with a number in {column}, got none")
    with mpl.rc_context(RC):
        picture = _points(frame, fields[0], column) if len(fields) == 1 else _map(frame, fields, column)
        failed = int((frame["status"] != "ok").sum())
        picture.suptitle(f"{title}: {len(frame)} members" + (f", {failed} failed" if failed else ""), size=9)
    return picture


def _points(rows: pd.DataFrame, field: str, column: str) -> Picture:
    """Return a point for each member that has a number."""
    picture = Picture(HEIGHT_IN)
    ax = picture.add_subplot()
    rows = rows.dropna(subset=[column])
    across, up = scale_of(field, rows[field]), scale_of(column, rows[column])
    ax.plot(across.apply(rows[field]), up.apply(rows[column]), ".", color=BLACK)
    ax.set(xlabel=across.label, ylabel=up.label, xscale=across.kind, yscale=up.kind)
    return picture


def _map(rows: pd.DataFrame, fields: Sequence[str], column: str) -> Picture:
    """Return cells where members are a grid, or else dots; of several members at a place the mean."""
    picture = Picture(*MAP_IN)
    ax = picture.add_subplot()
    points = rows.groupby(list(fields))[column].mean().reset_index()
    across, up = (scale_of(field, points[field]) for field in fields)
    scale = scale_of(column, points[column].dropna())
    x, y, numbers = across.apply(points[fields[0]]), up.apply(points[fields[1]]), scale.apply(points[column])
    norm = (LogNorm if scale.log else Normalize)(np.nanmin(numbers), np.nanmax(numbers))
    drawn: ScalarMappable
    if len(np.unique(x)) * len(np.unique(y)) == len(points):
        cells = numbers.reshape(len(np.unique(x)), len(np.unique(y))).T  # groups are in order
        edges = _edges(np.unique(x), across.log), _edges(np.unique(y), up.log)
        drawn = ax.pcolormesh(*edges, np.ma.masked_invalid(cells), norm=norm, cmap=COLOURS, rasterized=True)
        ax.set_facecolor(GREY)  # of members without a number
        ax.grid(visible=False)
    else:
        drawn = ax.scatter(x, y, c=numbers, norm=norm, cmap=COLOURS, s=9, linewidths=0)
    ax.set(xlabel=across.label, ylabel=up.label, xscale=across.kind, yscale=up.kind)
    picture.colorbar(drawn, label=scale.label, pad=0.02)
    return picture


def _edges(middles: FloatArray, log: bool) -> FloatArray:
    """Return the n + 1 edges of cells around n places, halfway between them."""
    places = np.log(middles) if log else middles
    gaps = np.diff(places) if len(places) > 1 else np.ones(1)
    ends = places[:1] - gaps[0] / 2, places[-1:] + gaps[-1] / 2
    edges = np.concatenate([ends[0], (places[:-1] + places[1:]) / 2, ends[1]])
    return np.asarray(np.exp(edges) if log else edges)
