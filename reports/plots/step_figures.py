"""Errors against the step or the tolerance, log-log: one panel per scene and quantity."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator
from matplotlib.transforms import ScaledTranslation

from reports.plots.series import mark
from reports.quantities import floor, knobs, tolerances, value
from reports.results import NEVER_BEGUN
from reports.style import GREY, WIDTH_IN, axis_label, line_styles
from reports.tables import setting

#: A panel: its scene, and the column that it shows.
Panel = tuple[str, str]
ORDERS = (1, 2, 4)
#: Height of a row of crossed-out markers.
ROW_POINTS = 9
#: Height of an entry of the legend, and how many below each other a figure has room for.
ENTRY_IN, FITTING = 0.17, 4


def panels_of(rows: pd.DataFrame, column: str) -> list[Panel]:
    """Return a panel for each scene that has a column."""
    return [(scene, column) for scene, of in rows.groupby("scene") if value(of, column).notna().any()]


def against_step(rows: pd.DataFrame, panels: Sequence[Panel], orders: Sequence[int] = ORDERS) -> Drawing:
    """Return the figure: every label a line, guides of the given orders, the truth's uncertainty shaded."""
    return _against(rows, panels, orders, "step_s", "mean_step_s")


def against_tolerance(rows: pd.DataFrame, panels: Sequence[Panel]) -> Drawing:
    """Return the same over the tolerance asked for, with a guide of errors in proportion to it."""
    asked = rows.assign(tolerance=tolerances(rows))
    return _against(asked, panels, (1,), "tolerance", "tolerance")


def _against(
    rows: pd.DataFrame, panels: Sequence[Panel], orders: Sequence[int], asked: str, at: str
) -> Drawing:
    """Return the figure over the column ``at``; a run that failed has only what it was asked for."""
    drawing, axes = grid(len(panels))
    styles = line_styles(rows)
    failed = rows[~rows["status"].isin(["ok", *NEVER_BEGUN])]
    missing = {
        scene: failed[failed["scene"] == scene].groupby("label", observed=True)[asked] for scene, _ in panels
    }
    rise = ROW_POINTS * max(map(len, missing.values()))
    for ax, (scene, column) in zip(axes, panels, strict=True):
        of_scene = rows[rows["scene"] == scene]
        ax.set(xlabel=axis_label(asked), ylabel=axis_label(column))
        points = of_scene.assign(error=value(of_scene, column)).query("error > 0")
        for label, line in points.sort_values([at, "error"]).groupby("label", observed=True):
            drawn = ax.loglog(line[at], line["error"], **styles[label])
            mark(drawn, label, settings_in_words(line))
        _finish(ax, floor(of_scene, column), orders)
        ax.set_title(scene, pad=6 + rise)
        for row, (label, steps) in enumerate(missing[scene]):
            mark_failures(ax, steps, row, styles[label], label)
    engine_legend(drawing, rows, failures=not failed.empty)
    return drawing


def grid(count: int, height_in: float = 2.7) -> tuple[Drawing, list[Axes]]:
    """Return a figure of ``count`` panels, up to three in a row, and its axes."""
    across = count if count <= 3 else math.ceil(count / math.ceil(count / 3))
    down = math.ceil(count / across)
    width = WIDTH_IN if across > 1 else 0.6 * WIDTH_IN
    drawing = Drawing(figsize=(width, height_in * down + 0.7))
    return drawing, [drawing.add_subplot(down, across, place + 1) for place in range(count)]


def settings_in_words(rows: pd.DataFrame) -> list[str]:
    """Return what each run was set to, as a reader of its point wants it: the step, a tolerance."""
    return [
        setting(knob, step) if knob == "step" else f"{setting(knob, of)}, mean {setting('step', step)}"
        for knob, of, step in zip(knobs(rows), tolerances(rows), rows["mean_step_s"], strict=True)
    ]


def mark_failures(ax: Axes, at: pd.Series, row: int, style: Mapping[str, Any], label: str) -> None:
    """Put crossed-out markers above a panel where a label's runs failed, in the row of their line."""
    drawing = ax.get_figure(root=True)
    assert drawing is not None, "the panel is on a figure"
    up = ScaledTranslation(0.0, (0.6 + row) * ROW_POINTS / 72, drawing.dpi_scale_trans)
    place = {"transform": ax.get_xaxis_transform() + up, "clip_on": False, "linestyle": ""}
    cross = {**place, "marker": "x", "markersize": 7, "color": style["color"]}
    for how in ({**style, **place}, cross):
        mark(ax.plot(at, [1.0] * len(at), **how), label, ["not finished"] * len(at))


def failed_entry() -> Line2D:
    """Return the legend's entry for crossed-out markers."""
    return Line2D([], [], linestyle="", marker="x", markersize=7, color=GREY, label="not finished")


def engine_legend(drawing: Drawing, rows: pd.DataFrame, failures: bool) -> None:
    """Put a legend of all labels among rows below the figure, as wide as that needs: a column per engine.

    What stands for failures is below the last engine with the fewest arms.
    """
    arms, styles = rows.drop_duplicates("label").sort_values("label"), line_styles(rows)
    columns = [
        [Line2D([], [], label=label, **styles[label]) for label in labels]
        for _, labels in arms.groupby("engine", sort=False)["label"]
    ]
    if failures:
        min(reversed(columns), key=len).append(failed_entry())
    longest = max(map(len, columns))
    blank = Line2D([], [], linestyle="", label=" ")
    handles = [handle for column in columns for handle in [*column, *[blank] * (longest - len(column))]]
    if len(columns) > 2:
        drawing.set_figwidth(WIDTH_IN)
    drawing.set_figheight(drawing.get_figheight() + ENTRY_IN * max(0, longest - FITTING))
    narrow = {"fontsize": 7, "handlelength": 2.2, "columnspacing": 0.8}
    drawing.legend(
        handles=handles,
        loc="outside lower center",
        ncols=len(columns),
        **(narrow if len(columns) > 3 else {"handlelength": 3.2}),
    )


def _finish(ax: Axes, uncertainty: float, orders: Sequence[int]) -> None:
    """Shade the truth's uncertainty and draw the guides down from the coarsest step."""
    ax.set(xscale="log", yscale="log")
    if not ax.lines:
        return
    h, e = np.concatenate([line.get_xydata() for line in ax.lines]).T
    low, high = min(e.min(), uncertainty or e.min()) / 4, e.max() * 6
    ax.set_ylim(low, high)
    ax.set_xmargin(0.1)  # room for the guides' numbers
    ax.yaxis.set_minor_locator(NullLocator())
    if uncertainty:
        ax.axhspan(low, uncertainty, color=GREY, alpha=0.3, linewidth=0, zorder=0.5)
    for order in orders:
        top = high / 1.5
        fine = max(h.min(), h.max() * (2 * low / top) ** (1 / order))
        ends = np.array([fine, h.max()])
        ax.plot(ends, top * (ends / h.max()) ** order, color="#B3B3B3", linewidth=0.7, zorder=0.8)
        ax.annotate(
            str(order),
            (fine, top * (fine / h.max()) ** order),
            textcoords="offset points",
            xytext=(-1, 1),
            ha="right",
            va="bottom",
            fontsize=7,
            color="#595959",
        )
