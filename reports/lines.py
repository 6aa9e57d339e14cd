"""Panels of lines with one legend, and their points as data."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from reports.look import GREY, RC, WIDTH_IN, Picture, axis_label, line_styles, setting
from reports.page import Figure
from reports.results import floor, knobs, tolerances, value

#: A panel has no more lines than these; the other configurations are in the tables.
MOST_LINES = 8
#: The slopes of the guides in a panel of errors against the step.
ORDERS = (1, 2, 4)
#: The entries of a row of a legend, in a narrow figure half as many, and the height of a row.
IN_ROW, ROW_IN = 4, 0.17


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


def points(panels: Iterable[Panel]) -> pd.DataFrame:
    """Return every point of every line with its panel, series, axes and note."""
    columns = ("panel", "series", "x is", "y is", "x", "y", "setting")
    rows = [
        (panel.title, line.label, panel.x, panel.y, float(x), float(y), *(line.notes[k : k + 1] or [""]))
        for panel in panels
        for line in panel.lines
        for k, (x, y) in enumerate(zip(line.x, line.y, strict=True))
    ]
    return pd.DataFrame(rows, columns=columns)


def figure_of(
    name: str,
    title: str,
    caption: str,
    study: str,
    panels: Sequence[Panel],
    height_in: float = 2.7,
    across: int | None = None,
) -> Figure | None:
    """Return the figure of some panels with their points as its data, None without panels."""
    if not panels:
        return None
    return Figure(name, title, caption, study, draw(panels, height_in, across), points(panels))


def draw(panels: Sequence[Panel], height_in: float = 2.7, across: int | None = None) -> Drawing:
    """Return the figure of some panels, three in a row or so many ``across``, with a legend of all series."""
    across = across or (
        len(panels) if len(panels) <= 3 else math.ceil(len(panels) / math.ceil(len(panels) / 3))
    )
    down = math.ceil(len(panels) / across)
    styles: dict[str, Mapping[str, Any]] = {}
    for line in (line for panel in panels for line in panel.lines):
        styles.setdefault(line.label, line.style)
    handles = [Line2D([], [], label=label, **style) for label, style in styles.items()]
    width, in_row = (WIDTH_IN, IN_ROW) if across > 1 else (0.6 * WIDTH_IN, IN_ROW // 2)
    with mpl.rc_context(RC):
        drawing = Picture(height_in * down + 0.5 + ROW_IN * math.ceil(len(handles) / in_row), width)
        for place, panel in enumerate(panels):
            ax = drawing.add_subplot(
                down, across, place + 1, title=panel.title, xlabel=panel.x, ylabel=panel.y
            )
            for axis in panel.log:
                ax.set(**{f"{axis}scale": "log"})
            if "x" in panel.log:
                ax.xaxis.set_major_locator(LogLocator(numticks=6))
            for line in panel.lines:
                ax.errorbar(line.x, line.y, xerr=line.spread, elinewidth=0.7, **line.style)
            _finish(ax, panel)
            ax.xaxis.label.set_visible(place + across >= len(panels) or len({each.x for each in panels}) > 1)
            ax.yaxis.label.set_visible(place % across == 0 or len({each.y for each in panels}) > 1)
        drawing.legend(handles=handles, loc="outside lower center", ncols=in_row, fontsize=7.5)
    return drawing


def _finish(ax: Axes, panel: Panel) -> None:
    """Shade the reference's uncertainty, draw the guides down from the coarsest step, and what is marked."""
    if panel.level is not None:
        ax.axhline(panel.level, color=GREY, linestyle="--", linewidth=1.0)
    for x, y in panel.rings:
        ax.plot(x, y, "o", markersize=13, markerfacecolor="none", markeredgecolor=GREY)
    if "y" not in panel.log or not (panel.floor or panel.orders):
        return
    h, e = np.concatenate([np.transpose([line.x, line.y]) for line in panel.lines]).T.astype(float)
    h, e = h[e > 0], e[e > 0]
    low, high = min(e.min(), panel.floor or e.min()) / 4, e.max() * 6
    ax.set_ylim(low, high)
    ax.axhspan(low, max(panel.floor, low), color=GREY, alpha=0.3, linewidth=0, zorder=0.5)
    for order in panel.orders:
        top = high / 1.5
        fine = max(h.min(), h.max() * (2 * low / top) ** (1 / order))
        ends = np.array([fine, h.max()])
        ax.plot(ends, top * (ends / h.max()) ** order, color="#B3B3B3", linewidth=0.7, zorder=0.8)
        ax.text(fine, top * (fine / h.max()) ** order, f"{order} ", ha="right", fontsize=7, color="#595959")


def shown_labels(rows: pd.DataFrame) -> list[str]:
    """Return the configurations that a figure shows: each engine's first, its second, ..., eight at most."""
    labels = rows[["label", "engine"]].drop_duplicates("label").sort_values("label")
    places = labels.groupby("engine", sort=False).cumcount()
    first = labels.assign(place=places).sort_values("place", kind="stable")["label"].head(MOST_LINES)
    return sorted(first, key=list(labels["label"]).index)


def against(
    rows: pd.DataFrame, column: str, at: str = "mean_step_s", orders: Sequence[int] = ORDERS
) -> list[Panel]:
    """Return a panel for each scene of a column against the mean step, or against another column ``at``.

    Scenes without the column have none.
    """
    styles, panels = line_styles(rows), list[Panel]()
    rows = rows.assign(error=value(rows, column)).query("error > 0")
    for scene, every in rows.groupby("scene"):
        of_scene = every[every["label"].isin(shown_labels(every))]
        lines = [
            Line(str(label), line[at], line["error"], styles[label], settings_in_words(line))
            for label, line in of_scene.sort_values([at, "error"]).groupby("label", observed=True)
        ]
        axes, known = (axis_label(at), axis_label(column)), floor(of_scene, column)
        panels.append(Panel(str(scene), *axes, lines, floor=known, orders=orders))
    return panels


def settings_in_words(rows: pd.DataFrame) -> list[str]:
    """Return what each run was set to, as a reader of its point wants it: the step, a tolerance."""
    return [
        setting(knob, step) if knob == "step" else f"{setting(knob, of)}, mean {setting('step', step)}"
        for knob, of, step in zip(knobs(rows), tolerances(rows), rows["mean_step_s"], strict=True)
    ]
