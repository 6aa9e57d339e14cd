"""What members do over one field: a point for each, or for each turn of each, as in bifurcation diagrams."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from reports.plots.sweeps.scales import Scale, scale_of
from reports.results import FloatArray
from reports.run.picture import Picture
from reports.style import BLACK, VERMILLION

#: Height of a panel in inches; so many points on it are opaque, of more each is fainter.
PANEL_IN, OPAQUE = 2.6, 3000


def draw_over_field(rows: pd.DataFrame, field: str, columns: Sequence[str]) -> Picture:
    """Return a panel of points for each column, one below the other."""
    picture = Picture(PANEL_IN * len(columns) + 0.6)
    axes = picture.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    across = scale_of(field, rows[field])
    for ax, column in zip(axes, columns, strict=True):
        points = rows[[field, column]].explode(column).dropna()
        up, heights = _upwards(points, field, column)
        ax.plot(
            across.drawn(points[field]),
            heights,
            linestyle="",
            marker=".",
            markersize=2.5 if len(points) <= OPAQUE else 1.2,
            markeredgewidth=0,
            color=BLACK,
            alpha=max(0.25, min(1.0, (OPAQUE / max(len(points), 1)) ** 0.5)),
            rasterized=len(points) > OPAQUE,
        )
        ax.set(ylabel=up.label, yscale=up.kind)
        if column.startswith("exponent"):
            ax.axhline(0.0, color=VERMILLION, linewidth=0.8, linestyle="--")
    axes[-1].set(xlabel=across.label, xscale=across.kind)
    return picture


def _upwards(points: pd.DataFrame, field: str, column: str) -> tuple[Scale, FloatArray]:
    """Return how a column is drawn, and where its points are: lengths over a clearance as its parts."""
    if column.endswith("_m") and field.endswith("radial_clearance_m"):
        parts = points[column].astype(float) / points[field]
        name = scale_of(column, parts).label.partition(" [")[0]
        return Scale(1.0, f"{name} / clearance", log=False), np.asarray(parts)
    scale = scale_of(column, points[column])
    return scale, scale.drawn(points[column])
