"""Panels of lines with one legend, their points as data, and a drawing as SVG."""

import io
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from reports.look import ENGINES, GREY, RC, WIDTH_IN, axis_label, line_styles, set_plainly, setting
from reports.results import FloatArray, floor, knobs, tolerances, value

#: A panel has no more lines than these; the other configurations are in the tables.
MOST_LINES = 6
#: Height of an entry of the legend, how many of these fit, and the columns that fit beside each other.
ENTRY_IN, FITTING, MOST_COLUMNS = 0.17, 4, 5
#: The slopes of the guides in a panel of errors against the step.
ORDERS = (1, 2, 4)
_COORDINATES = re.compile(r' (d|x|y|transform|points)="([^"]*)"')
_DIGITS = re.compile(r"(-?\d+\.\d\d)\d+")


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


def draw(panels: Sequence[Panel], height_in: float = 2.7, across: int | None = None) -> Drawing:
    """Return the figure of some panels, up to three in a row, with a legend of all series below."""
    with mpl.rc_context(RC):
        drawing, axes = grid(len(panels), height_in, across)
        styles: dict[str, Mapping[str, Any]] = {}
        for ax, panel in zip(axes, panels, strict=True):
            ax.set(title=panel.title, xlabel=panel.x, ylabel=panel.y)
            for axis in panel.log:
                ax.set(**{f"{axis}scale": "log"})
            if "x" in panel.log:
                ax.xaxis.set_major_locator(LogLocator(numticks=6))
            for line in panel.lines:
                styles.setdefault(line.label, line.style)
                ax.errorbar(line.x, line.y, xerr=line.spread, elinewidth=0.7, **line.style)
            _finish(ax, panel)
        _label_once(axes)
        draw_legend(drawing, styles)
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


def draw_legend(drawing: Drawing, styles: Mapping[str, Mapping[str, Any]]) -> None:
    """Put a legend below a figure, a column an engine: its lines are those of one colour."""
    columns: dict[Any, list[Line2D]] = {}
    for label, style in styles.items():
        columns.setdefault(style.get("color"), []).append(Line2D([], [], label=label, **style))
    place = {colour: k for k, (colour, _) in enumerate(ENGINES.values())}
    lists = [columns[colour] for colour in sorted(columns, key=lambda of: place.get(of, len(place)))]
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


def against(
    rows: pd.DataFrame, column: str, at: str = "mean_step_s", orders: Sequence[int] = ORDERS
) -> list[Panel]:
    """Return a panel for each scene of a column against the mean step, or against another column ``at``.

    Scenes without the column have none.
    """
    styles, panels = line_styles(rows), list[Panel]()
    rows = rows.assign(error=value(rows, column)).query("error > 0")
    rows = rows[rows["label"].isin(shown_labels(rows))]
    for scene, of_scene in rows.groupby("scene"):
        lines = [
            Line(str(label), line[at], line["error"], styles[label], settings_in_words(line))
            for label, line in of_scene.sort_values([at, "error"]).groupby("label", observed=True)
        ]
        known = floor(of_scene, column)
        panels.append(
            Panel(str(scene), axis_label(at), axis_label(column), lines, floor=known, orders=orders)
        )
    return panels


def settings_in_words(rows: pd.DataFrame) -> list[str]:
    """Return what each run was set to, as a reader of its point wants it: the step, a tolerance."""
    return [
        setting(knob, step) if knob == "step" else f"{setting(knob, of)}, mean {setting('step', step)}"
        for knob, of, step in zip(knobs(rows), tolerances(rows), rows["mean_step_s"], strict=True)
    ]


def so_far(curve: FloatArray) -> FloatArray:
    """Return the largest size of a curve up to each time: falls back at no zero crossing."""
    return np.asarray(np.maximum.accumulate(np.abs(curve)))


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


def as_svg(drawing: Drawing) -> str:
    """Return a drawing as SVG without a date, to a hundredth of a point; text stays text."""
    set_plainly(drawing)
    with mpl.rc_context({**RC, "svg.fonttype": "none"}):
        _lay_out(drawing)
        # `Figure.savefig` draws all once more before, for a layout that is there.
        canvas: Any = FigureCanvasSVG(drawing)
        written = io.StringIO()
        canvas.print_svg(written, metadata={"Date": None})
    return _COORDINATES.sub(lambda found: _DIGITS.sub(r"\1", found[0]), written.getvalue())


def _lay_out(drawing: Drawing) -> None:
    """Place the panels of a drawing once, and give a long title smaller letters."""
    if engine := drawing.get_layout_engine():
        engine.execute(drawing)
    drawing.set_layout_engine("none")
    wide = drawing.bbox.width
    for ax in drawing.axes:
        spec, title, box = ax.get_subplotspec(), ax.title, ax.title.get_window_extent()
        across, middle = spec.get_gridspec().ncols if spec else 1, (box.x0 + box.x1) / 2
        room = 0.98 * min(wide / across, 2 * middle, 2 * (wide - middle))
        if box.width > room:
            title.set_fontsize(title.get_fontsize() * room / box.width)
