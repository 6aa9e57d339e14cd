"""Curves over time at one step: one panel per scene."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import NullLocator

from reports.plots.series import mark
from reports.plots.step_figures import engine_legend, grid
from reports.results import FloatArray, Results
from reports.style import axis_label, line_styles

#: Markers on a curve; those of the next label are moved so that they do not lie on each other.
MARKERS = 7


def over_time(results: Results, rows: pd.DataFrame, column: str, axis: str) -> Drawing:
    """Return the figure of the largest size of a curve up to each time, on a logarithmic axis.

    ``axis`` is its label. A curve of errors ends at its scene's horizon. ``rows`` are of finished runs; later
    ones lie on top.
    """
    scenes = list(rows.groupby("scene"))
    styles = line_styles(rows)
    drawing, axes = grid(len(scenes))
    for ax, (scene, of_scene) in zip(axes, scenes, strict=True):
        ax.set(title=scene, xlabel=axis_label("time_s"), ylabel=axis, yscale="log")
        for _, row in of_scene.iterrows():
            size = so_far(results.curve(row["case"], column))
            every = max(1, len(size) // MARKERS)
            start = every * list(styles).index(row["label"]) // len(styles)
            drawn = ax.plot(
                results.curve(row["case"], "time_s")[: len(size)],
                np.where(size > 0, size, np.nan),
                markevery=(start, every),
                **styles[row["label"]],
            )
            mark(drawn, row["label"])
        ax.yaxis.set_minor_locator(NullLocator())
    engine_legend(drawing, rows, failures=False)
    return drawing


def so_far(curve: FloatArray) -> FloatArray:
    """Return the largest size of a curve up to each time: falls back at no zero crossing."""
    return np.asarray(np.maximum.accumulate(np.abs(curve)))
