"""The figures of the work-precision study."""

from collections.abc import Iterator
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from reports.equal_error import front, ladders
from reports.parts import Figure
from reports.plots.step_figures import engine_legend, grid
from reports.style import GREY, axis_label, line_styles, words


def figures(kind: str, rows: pd.DataFrame, column: str) -> Iterator[Figure]:
    """Yield errors of a column against run time and against steps, a panel per scene that has any."""
    if not ladders(rows, column):
        return
    name, unit = words(column)
    file = column.removesuffix(f"_{column.split('_')[-1]}").replace("_", "-")
    yield Figure(
        f"work-precision-{kind}-{file}-time",
        f"{name.capitalize()} against run time",
        "Down and to the left is better. The grey line is the front: what no engine beats in both error and "
        "time. The band is the truth's own uncertainty. Bars are the range of the rounds.",
        f"{name} in {unit} against run time in s, log-log, one panel per scene, one line per engine and arm",
        drawing(rows, column, against_time=True),
    )
    yield Figure(
        f"work-precision-{kind}-{file}-steps",
        f"{name.capitalize()} against steps",
        "The same errors against the number of steps, whatever a step costs.",
        f"{name} in {unit} against steps, log-log, one panel per scene, one line per engine and arm",
        drawing(rows, column, against_time=False),
    )


def drawing(rows: pd.DataFrame, column: str, against_time: bool) -> Drawing:
    """Return the figure of one column of errors."""
    by_scene = ladders(rows, column)
    figure, axes = grid(len(by_scene), height_in=3.0)
    styles = line_styles(rows)
    for ax, (scene, (rungs, floor)) in zip(axes, by_scene.items(), strict=True):
        for label, ladder in rungs.groupby("label", observed=True):
            _line(ax, ladder, against_time, styles[label])
        if against_time:
            best = front(rungs)
            ax.plot(
                best["time_s"],
                best["error"],
                color=GREY,
                linewidth=5,
                alpha=0.35,
                zorder=0.7,
                drawstyle="steps-post",
            )
        ax.set(xscale="log", yscale="log")
        if floor:
            bottom = rungs["error"].min() / 3
            ax.axhspan(bottom, floor, color=GREY, alpha=0.3, linewidth=0)
            ax.set_ylim(bottom=bottom)
        work = axis_label("solve_time_s") if against_time else "steps"
        ax.set(xlabel=work, ylabel=axis_label(column), title=scene)
    engine_legend(figure, rows, failures=False)
    return figure


def _line(ax: Axes, ladder: pd.DataFrame, against_time: bool, style: dict[str, Any]) -> None:
    ladder = ladder.sort_values("time_s" if against_time else "steps", kind="stable")
    if not against_time:
        ax.plot(ladder["steps"], ladder["error"], **style)
        return
    below = ladder["time_s"] - ladder["times_s"].map(min)
    above = ladder["times_s"].map(max) - ladder["time_s"]
    ax.errorbar(ladder["time_s"], ladder["error"], xerr=[below, above], elinewidth=0.7, **style)
