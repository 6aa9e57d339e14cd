"""Errors against one setting of an engine: one line per scene."""

import math

import pandas as pd
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from reports.plots.series import mark
from reports.plots.step_figures import failed_entry, grid, mark_failures
from reports.quantities import value
from reports.style import axis_label, variant


def against_setting(rows: pd.DataFrame, setting: str, column: str) -> Drawing:
    """Return the figure for runs of one engine; a crossed-out marker is a run that failed."""
    drawing, (ax,) = grid(1)
    rows = rows.assign(at=rows[f"setting_{setting}"], failed=rows["status"] != "ok").sort_values(
        "at", kind="stable"
    )
    scenes = list(rows.groupby("scene"))
    styles = {scene: variant(of["engine"].iloc[0], place) for place, (scene, of) in enumerate(scenes)}
    values = rows["at"].unique().tolist()
    ax.set(xlabel=setting, ylabel=axis_label(column), xscale="log", yscale="log")
    ax.set_xticks(values, [str(each) for each in values], rotation=90)
    ax.set_xticks([], minor=True)
    row = 0
    for scene, of_scene in scenes:
        points = of_scene.assign(error=value(of_scene, column)).query("error > 0")
        if len(points):
            mark(ax.plot(points["at"], points["error"], **styles[scene]), scene)
        if of_scene["failed"].any():
            mark_failures(ax, of_scene["at"][of_scene["failed"]], row, styles[scene], scene)
            row += 1
    low, high = ax.get_ylim()
    ax.set_ylim(10 ** math.floor(math.log10(low)), 10 ** math.ceil(math.log10(high)))
    ax.yaxis.set_minor_locator(NullLocator())
    handles = [Line2D([], [], label=scene, **style) for scene, style in styles.items()]
    if rows["failed"].any():
        handles.append(failed_entry())
    drawing.legend(handles=handles, loc="outside lower center", ncols=3, handlelength=3.2)
    return drawing
