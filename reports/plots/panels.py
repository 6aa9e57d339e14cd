"""Panels of lines: errors against a step, a tolerance or a cost, and curves over time; one legend for all."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator
from matplotlib.transforms import ScaledTranslation

from reports.plots.series import mark
from reports.quantities import floor, knobs, tolerances, value
from reports.results import FloatArray
from reports.style import ENGINES, GREY, WIDTH_IN, axis_label, line_styles
from reports.tables import setting

#: A panel has no more lines than these; the other configurations are in the figure's tables.
MOST_LINES = 6
#: Height of a row of crossed-out markers, of an entry of the legend, and how many of these fit.
ROW_POINTS, ENTRY_IN, FITTING = 9, 0.17, 4
#: Columns of a legend that fit beside each other; more engines share one.
MOST_COLUMNS = 5
#: The slopes of the guides in a panel of errors against the step.
ORDERS = (1, 2, 4)


@dataclass(frozen=True)
class Line:
    """A line of the series ``label`` through points (n,), a note for each, and a ``spread`` (2, n) of x."""

    label: str
    x: Any
    y: Any
    style: Mapping[str, Any]
    notes: Sequence[str] = ()
    spread: Any = None


@dataclass(frozen=True)
class Panel:
    """One panel of a figure.

    ``log`` names the logarithmic axes. Below ``floor``, the reference's uncertainty, the panel is grey.
    ``orders`` are slopes of guides, ``level`` is a dashed line across, ``rings`` are points to be ringed.
    ``failed`` has the places along x of runs that did not finish, by label.
    """

    title: str
    x: str
    y: str
    lines: Sequence[Line]
    log: str = "xy"
    floor: float = 0.0
    orders: Sequence[int] = ()
    level: float | None = None
    rings: Sequence[tuple[float, float]] = ()
    failed: Mapping[str, Sequence[float]] = field(default_factory=dict)


def draw(panels: Sequence[Panel], height_in: float = 2.7, across: int | None = None) -> Drawing:
    """Return the figure of some panels, up to three in a row, with a legend of all series below."""
    drawing, axes = grid(len(panels), height_in, across)
    rise = ROW_POINTS * max(len(panel.failed) for panel in panels)
    styles: dict[str, Mapping[str, Any]] = {}
    for ax, panel in zip(axes, panels, strict=True):
        ax.set(xlabel=panel.x, ylabel=panel.y)
        for axis in panel.log:
            ax.set(**{f"{axis}scale": "log"})
        if "x" in panel.log:
            ax.xaxis.set_major_locator(LogLocator(numticks=6))
        for line in panel.lines:
            styles.setdefault(line.label, line.style)
            _draw_line(ax, line)
        _finish(ax, panel)
        ax.set_title(panel.title, pad=6 + rise)
        for row, (label, places) in enumerate(panel.failed.items()):
            _mark_failures(ax, places, row, styles.setdefault(label, {}), label)
    _label_once(axes)
    if styles:
        draw_legend(drawing, styles, any(panel.failed for panel in panels))
    return drawing


def _label_once(axes: Sequence[Axes]) -> None:
    """Show what panels have in common upwards in the first column, and across in the last row."""
    for axis in ("x", "y"):
        if len({getattr(ax, f"get_{axis}label")() for ax in axes}) > 1:
            return
    for place, ax in enumerate(axes):
        spec = ax.get_subplotspec()
        across = spec.get_gridspec().ncols if spec else 1
        ax.yaxis.label.set_visible(place % across == 0)
        ax.xaxis.label.set_visible(place + across >= len(axes))


def grid(count: int, height_in: float = 2.7, across: int | None = None) -> tuple[Drawing, list[Axes]]:
    """Return a figure of ``count`` panels, up to three in a row or so many ``across``, and its axes."""
    across = across or (count if count <= 3 else math.ceil(count / math.ceil(count / 3)))
    down = math.ceil(count / across)
    width = WIDTH_IN if across > 1 else 0.6 * WIDTH_IN
    drawing = Drawing(figsize=(width, height_in * down + 0.7))
    return drawing, [drawing.add_subplot(down, across, place + 1) for place in range(count)]


def draw_legend(drawing: Drawing, styles: Mapping[str, Mapping[str, Any]], failures: bool = False) -> None:
    """Put a legend below a figure, a column an engine: its lines are those of one colour."""
    columns: dict[Any, list[Line2D]] = {}
    for label, style in styles.items():
        columns.setdefault(style.get("color"), []).append(Line2D([], [], label=label, **style))
    place = {colour: k for k, (colour, _) in enumerate(ENGINES.values())}
    lists = [columns[colour] for colour in sorted(columns, key=lambda of: place.get(of, len(place)))]
    if failures:
        cross = Line2D([], [], linestyle="", marker="x", markersize=7, color=GREY, label="not finished")
        min(reversed(lists), key=len).append(cross)
    while len(lists) > MOST_COLUMNS:
        k = min(range(len(lists) - 1), key=lambda k: len(lists[k]) + len(lists[k + 1]))
        lists[k : k + 2] = [lists[k] + lists[k + 1]]
    longest, blank = max(map(len, lists)), Line2D([], [], linestyle="", label=" ")
    handles = [handle for column in lists for handle in [*column, *[blank] * (longest - len(column))]]
    if len(lists) > 2:
        drawing.set_figwidth(WIDTH_IN)
    drawing.set_figheight(drawing.get_figheight() + ENTRY_IN * max(0, longest - FITTING))
    narrow = {"fontsize": 7, "handlelength": 2.2, "columnspacing": 0.8}
    look = narrow if len(lists) > 3 else {"handlelength": 3.2}
    drawing.legend(handles=handles, loc="outside lower center", ncols=len(lists), **look)


def shown_labels(rows: pd.DataFrame) -> list[str]:
    """Return the configurations that a figure shows: each engine's first, its second, ..., six at most."""
    labels = rows[["label", "engine"]].drop_duplicates("label").sort_values("label")
    places = labels.groupby("engine", sort=False).cumcount()
    first = labels.assign(place=places).sort_values("place", kind="stable")["label"].head(MOST_LINES)
    return sorted(first, key=list(labels["label"]).index)


def by_signal(
    rows: pd.DataFrame, columns: Iterable[str], panels_of: Callable[[pd.DataFrame, str], Sequence[Panel]]
) -> Drawing | None:
    """Return the figure of the panels of some columns; of few scenes each column has a row of its own."""
    panels = [each for column in columns if (each := panels_of(rows, column))]
    across = max(map(len, panels), default=0)
    return draw([*chain(*panels)], across=across if across <= 3 else None) if panels else None


def against(
    rows: pd.DataFrame,
    column: str,
    at: str = "mean_step_s",
    asked: str = "step_s",
    orders: Sequence[int] = ORDERS,
) -> list[Panel]:
    """Return a panel for each scene of a column against the step, or against another column ``at``.

    A run that did not finish has only the step that was ``asked`` for. Scenes without the column have none.
    """
    labels = shown_labels(rows[value(rows, column).notna()]) if len(rows) else []
    rows, panels = rows[rows["label"].isin(labels)], []
    styles = line_styles(rows)
    for scene, of_scene in rows.groupby("scene"):
        points = of_scene.assign(error=value(of_scene, column)).query("error > 0").sort_values([at, "error"])
        if points.empty:
            continue
        failed = of_scene[~of_scene["status"].isin(["ok", "unsupported"])]
        lines = [
            Line(str(label), line[at], line["error"], styles[label], settings_in_words(line))
            for label, line in points.groupby("label", observed=True)
        ]
        crosses = {str(label): list(of[asked]) for label, of in failed.groupby("label", observed=True)}
        known = floor(of_scene, column)
        x, y = axis_label(asked), axis_label(column)
        panels.append(Panel(str(scene), x, y, lines, floor=known, orders=orders, failed=crosses))
    return panels


def against_tolerance(rows: pd.DataFrame, column: str) -> list[Panel]:
    """Return the same over the tolerance asked for, with a guide of errors in proportion to it."""
    return against(rows.assign(tolerance=tolerances(rows)), column, "tolerance", "tolerance", (1,))


def settings_in_words(rows: pd.DataFrame) -> list[str]:
    """Return what each run was set to, as a reader of its point wants it: the step, a tolerance."""
    return [
        setting(knob, step) if knob == "step" else f"{setting(knob, of)}, mean {setting('step', step)}"
        for knob, of, step in zip(knobs(rows), tolerances(rows), rows["mean_step_s"], strict=True)
    ]


def so_far(curve: FloatArray) -> FloatArray:
    """Return the largest size of a curve up to each time: falls back at no zero crossing."""
    return np.asarray(np.maximum.accumulate(np.abs(curve)))


def _draw_line(ax: Axes, line: Line) -> None:
    if line.spread is None:
        mark(ax.plot(line.x, line.y, **line.style), line.label, line.notes)
    else:
        drawn = ax.errorbar(line.x, line.y, xerr=line.spread, elinewidth=0.7, **line.style)
        mark(drawn.get_children(), line.label, line.notes)


def _mark_failures(ax: Axes, at: Iterable[float], row: int, style: Mapping[str, Any], label: str) -> None:
    """Put crossed-out markers above a panel where a configuration's runs failed, in the row of its line."""
    drawing, at = ax.get_figure(root=True), list(at)
    assert drawing is not None, "the panel is on a figure"
    up = ScaledTranslation(0.0, (0.6 + row) * ROW_POINTS / 72, drawing.dpi_scale_trans)
    place = {"transform": ax.get_xaxis_transform() + up, "clip_on": False, "linestyle": ""}
    cross = {**place, "marker": "x", "markersize": 7, "color": style.get("color", GREY)}
    for how in ({**style, **place}, cross):
        mark(ax.plot(at, [1.0] * len(at), **how), label, ["not finished"] * len(at))


def _finish(ax: Axes, panel: Panel) -> None:
    """Shade the reference's uncertainty, draw the guides down from the coarsest step, and what is marked."""
    if panel.level is not None:
        ax.axhline(panel.level, color=GREY, linestyle="--", linewidth=1.0)
    for x, y in panel.rings:
        ax.plot(x, y, "o", markersize=13, markerfacecolor="none", markeredgecolor=GREY)
    if not panel.lines or "y" not in panel.log:
        return
    h, e = np.concatenate([np.transpose([line.x, line.y]) for line in panel.lines]).T.astype(float)
    h, e = h[e > 0], e[e > 0]
    ax.yaxis.set_minor_locator(NullLocator())
    if panel.floor or panel.orders:
        low, high = min(e.min(), panel.floor or e.min()) / 4, e.max() * 6
        ax.set_ylim(low, high)
        if panel.floor:
            ax.axhspan(low, panel.floor, color=GREY, alpha=0.3, linewidth=0, zorder=0.5)
        for order in panel.orders:
            _guide(ax, order, h, low, high)


def _guide(ax: Axes, order: int, h: FloatArray, low: float, high: float) -> None:
    """Draw a line of a slope from the coarsest step down, with its order at the fine end."""
    ax.set_xmargin(0.1)  # room for the guides' numbers
    top = high / 1.5
    fine = max(h.min(), h.max() * (2 * low / top) ** (1 / order))
    ends = np.array([fine, h.max()])
    ax.plot(ends, top * (ends / h.max()) ** order, color="#B3B3B3", linewidth=0.7, zorder=0.8)
    offset: dict[str, Any] = {"textcoords": "offset points", "xytext": (-1, 1), "ha": "right", "va": "bottom"}
    place = (fine, top * (fine / h.max()) ** order)
    ax.annotate(str(order), place, **offset, fontsize=7, color="#595959")
