"""Curves over time at one step: one panel per scene."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import NullLocator

from reports.plots.step_figures import engine_legend, grid
from reports.results import FloatArray, Results, Run
from reports.style import label, line_style, ordered

#: Markers on a curve; those of the next arm are moved so that they do not lie on each other.
MARKERS = 7


def over_time(
    results: Results,
    runs: Sequence[Run],
    column: str,
    axis: str,
    shown: Callable[[FloatArray, Run], FloatArray],
) -> Drawing:
    """Return the figure of a curve of the given runs on a logarithmic axis.

    ``shown`` makes what is drawn, positive (n,), from the curve (n,) and its run.
    """
    found = [
        (run, time, curve)
        for run in runs
        if run.ok
        and (time := results.curve(run, "time_s")) is not None
        and (curve := results.curve(run, column)) is not None
    ]
    scenes = sorted({run.scene for run, *_ in found})
    names = ordered(run.name for run, *_ in found)
    drawing, axes = grid(len(scenes))
    for ax, scene in zip(axes, scenes, strict=True):
        ax.set_title(scene)
        ax.set_xlabel(label("time_s"))
        ax.set_ylabel(axis)
        ax.set_yscale("log")
        for run, time, curve in found:
            if run.scene == scene:
                drawn = shown(curve, run)
                every = max(1, len(drawn) // MARKERS)
                start = every * names.index(run.name) // len(names)
                ax.plot(
                    time,
                    np.where(drawn > 0, drawn, np.nan),
                    markevery=(start, every),
                    **line_style(run.name, names),
                )
        ax.yaxis.set_minor_locator(NullLocator())
    engine_legend(drawing, names, failures=False)
    return drawing


def so_far(curve: FloatArray) -> FloatArray:
    """Return the largest size of a curve up to each time: falls back at no zero crossing."""
    return np.asarray(np.maximum.accumulate(np.abs(curve)))
