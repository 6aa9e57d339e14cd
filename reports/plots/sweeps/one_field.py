"""What members do over one field: a point for each, or for each turn of each, as in bifurcation diagrams."""

from collections.abc import Sequence

import pandas as pd
from matplotlib.lines import Line2D

from reports.plots.sweeps.scales import Scale, scale_of
from reports.run.picture import Picture
from reports.style import BLACK, BLUE, VERMILLION

#: Height of a panel in inches; so many points on it are opaque, of more each is fainter.
PANEL_IN, OPAQUE = 2.6, 3000
#: The size of a point where there are up to so many, and where there are more than are opaque.
SIZES, SMALLEST = {600: 5.0, OPAQUE: 2.5}, 1.2
#: The size of a point in a legend.
KEY_PT = 5.0
#: Colours and sizes of the points of chains, so that one shows below the other, and of members without one.
WAYS = {None: (BLACK, 1.0), "up": (BLUE, 1.0), "down": (VERMILLION, 2.0)}


def draw_over_field(rows: pd.DataFrame, field: str, columns: Sequence[str]) -> Picture:
    """Return a panel of points for each column, one below the other; chains up and down in two colours."""
    picture = Picture(PANEL_IN * len(columns) + 0.9)
    axes = picture.subplots(len(columns), 1, sharex=True, squeeze=False)[:, 0]
    across = scale_of(field, rows[field])
    ways = dict(iter(rows.groupby("direction"))) if "direction" in rows else {None: rows}
    for ax, column in zip(axes, columns, strict=True):
        points = rows[[field, column]].explode(column).dropna()
        up = _upwards(points, field, column)
        for way, members in ways.items():
            own = members[[field, column]].explode(column).dropna()
            colour, size = WAYS[way]
            ax.plot(
                across.drawn(own[field]),
                up.drawn(own[column] / own[field] if _is_part(field, column) else own[column]),
                label=f"members {way}wards" if way else "members",
                linestyle="",
                marker=".",
                markersize=size * next((pt for most, pt in SIZES.items() if len(points) <= most), SMALLEST),
                markeredgewidth=0,
                color=colour,
                alpha=max(0.25, min(1.0, (OPAQUE / max(len(points), 1)) ** 0.5)),
                rasterized=len(points) > OPAQUE,
            )
        ax.set(ylabel=up.label, yscale=up.kind)
        if column.startswith("exponent"):
            ax.axhline(0.0, color=VERMILLION, linewidth=0.8, linestyle="--")
    axes[-1].set(xlabel=across.label, xscale=across.kind)
    if None not in ways:
        lines = [line for line in axes[0].get_lines() if line.get_linestyle() == "None"]
        explain(picture, lines)
    return picture


def explain(picture: Picture, points: Sequence[Line2D]) -> None:
    """Put a legend of points below a picture, all of a size to be seen however small they are drawn."""
    legend = picture.legend(handles=points, loc="outside lower center", ncols=len(points))
    for handle in legend.legend_handles:
        assert isinstance(handle, Line2D), "points are lines without strokes"
        handle.set(marker="o", markersize=KEY_PT, alpha=1.0)


def _upwards(points: pd.DataFrame, field: str, column: str) -> Scale:
    """Return how a column is drawn: lengths over a clearance as its parts."""
    if _is_part(field, column):
        name = scale_of(column, points[column] / points[field]).label.partition(" [")[0]
        return Scale(1.0, f"{name} / clearance", log=False)
    return scale_of(column, points[column])


def _is_part(field: str, column: str) -> bool:
    return column.endswith("_m") and field.endswith("radial_clearance_m")
