"""The figures of the work-precision study."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from reports.equal_error import Judged, front, is_force, saturated
from reports.parts import Figure
from reports.plots.series import mark
from reports.plots.step_figures import engine_legend, grid
from reports.quantities import PEAK
from reports.shared_tables import followed
from reports.style import GREY, axis_label, line_styles, words
from reports.tables import listed, setting

#: What an error may cost, by its column among the rungs: the axis, and how to read a figure of it.
COSTS = {
    "time_s": (
        "run time",
        "run time [s]",
        "Down and to the left is better. The grey line is the front: what no engine beats in both error and "
        "time. The band is the truth's own uncertainty. Bars are the range of the rounds.",
    ),
    "steps": ("steps", "steps", "The same errors against the number of steps, whatever a step costs."),
    "evaluations": (
        "evaluations",
        "evaluations",
        "The same errors against the number of evaluations of the equations of motion, whatever one costs, "
        "of engines that count them.",
    ),
}


def figures(judged: Judged) -> Iterator[Figure]:
    """Yield errors against what they cost where two engines tell it, a panel per scene that has any.

    Peak forces are shown against run time alone.
    """
    name, unit = words(judged.column)
    for cost, (what, axis, reading) in COSTS.items():
        if (cost == "time_s" or judged.column != PEAK) and any(
            len({*rungs.dropna(subset=cost)["engine"]}) > 1 for rungs, _ in judged.ladders.values()
        ):
            yield Figure(
                f"{judged.name}-{what.split()[-1]}",
                f"{name.capitalize()} against {what}",
                " ".join([reading, *_saturated(judged, cost), followed(judged.rows)]),
                f"{name} in {unit} against {axis}, log-log, one panel per scene, one line per engine and arm",
                drawing(judged, cost),
            )


def _saturated(judged: Judged, cost: str) -> Iterator[str]:
    """Yield what a caption says of errors that rank nobody, and of times that leave out forces."""
    rungs = pd.concat([rungs for rungs, _ in judged.ladders.values()])
    if saturated(judged.rows, judged.column).any():
        yield "Errors that have grown to a tenth of the clearance are shown, and are on no front."
    if cost == "time_s" and is_force(judged.column) and rungs["motion_alone"].any():
        alone = listed(sorted(set(rungs["label"][rungs["motion_alone"]])))
        yield f"Forces are left out of the run times of {alone}."


#: Until when a slider is where it should be, by the column of that time.
REACHED = {
    "reached_1um_s": "within 1 µm",
    "reached_clearance_s": "within a tenth of the clearance",
}


def horizons(rows: pd.DataFrame, name: str) -> Iterator[Figure]:
    """Yield until when the slider is where it should be against run time, with clearance."""
    for column, how in REACHED.items():
        judged = Judged(f"{name}-{column.removesuffix('_s').replace('_', '-')}", rows, column)
        if judged.ladders:
            yield Figure(
                judged.name,
                f"Until when the slider is {how}, against run time",
                f"The time up to which a setting has the slider {how} of the truth: up and to the left is "
                f"better. Dashed is the time up to which runs are compared. {followed(rows)}",
                f"time until the slider leaves being {how} in s against run time, one panel per scene, one "
                "line per engine and arm",
                horizon_drawing(judged),
            )


def horizon_drawing(judged: Judged) -> Drawing:
    """Return the figure of times reached, of rungs whose ``error`` they are."""
    figure, axes = grid(len(judged.ladders), height_in=3.0)
    rows = judged.rows[
        judged.rows["label"].isin({*pd.concat(r for r, _ in judged.ladders.values())["label"]})
    ]
    styles = line_styles(rows)
    for ax, (scene, (rungs, _)) in zip(axes, judged.ladders.items(), strict=True):
        for label, ladder in rungs.groupby("label", observed=True):
            _line(ax, ladder, "time_s", label, styles[label])
        ax.axhline(
            judged.rows.loc[rungs.index, "compared_until_s"].max(), color=GREY, linestyle="--", linewidth=1.0
        )
        ax.set(xscale="log", ylim=(0, None), title=scene)
        ax.set(xlabel=COSTS["time_s"][1], ylabel=f"{REACHED[judged.column]} until [s]")
    engine_legend(figure, rows, failures=False)
    return figure


def file_name(column: str) -> str:
    """Return a column of errors as it is part of a file's name: slider-position."""
    return column.rpartition("_error")[0].replace("_", "-")


def drawing(judged: Judged, cost: str) -> Drawing:
    """Return the figure of errors against one of ``COSTS``, with the scenes and arms that tell it."""
    drawn = {scene: {*rungs.dropna(subset=cost)["label"]} for scene, (rungs, _) in judged.ladders.items()}
    told = [
        (scene, rungs[rungs["label"].isin(drawn[scene])], floor)
        for scene, (rungs, floor) in judged.ladders.items()
        if drawn[scene]
    ]
    rows = judged.rows[judged.rows["label"].isin(set().union(*drawn.values()))]
    figure, axes = grid(len(told), height_in=3.0)
    styles = line_styles(rows)
    for ax, (scene, rungs, floor) in zip(axes, told, strict=True):
        for label, ladder in rungs.groupby("label", observed=True):
            _line(ax, ladder, cost, label, styles[label])
        if cost == "time_s":
            best = front(rungs)
            ax.plot(
                best["time_s"],
                best["kept"],
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
        ax.set(xlabel=COSTS[cost][1], ylabel=axis_label(judged.column), title=scene)
    engine_legend(figure, rows, failures=False)
    return figure


def _line(ax: Axes, ladder: pd.DataFrame, cost: str, label: str, style: dict[str, Any]) -> None:
    ladder = ladder.sort_values(cost, kind="stable")
    spread: dict[str, Any] = {}
    if cost == "time_s":
        below = ladder["time_s"] - ladder["times_s"].map(np.nanmin)
        spread = {"xerr": [below, ladder["times_s"].map(np.nanmax) - ladder["time_s"]], "elinewidth": 0.7}
    drawn = ax.errorbar(ladder[cost], ladder["error"], **spread, **style)
    mark(drawn.get_children(), label, [*map(setting, ladder["knob"], ladder["value"])])
