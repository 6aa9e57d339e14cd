"""Errors against the step, log-log: one panel per scene and quantity."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator
from matplotlib.transforms import ScaledTranslation

from reports.quantities import Quantity
from reports.results import Run
from reports.style import GREY, WIDTH_IN, Name, label, line_style, ordered, title

Panel = tuple[str, Quantity]
ORDERS = (1, 2, 4)
#: Height of a row of crossed-out markers.
ROW_POINTS = 9


def panels_of(runs: Sequence[Run], quantities: Sequence[Quantity]) -> list[Panel]:
    """Return a panel for each quantity and each scene that has it."""
    scenes = sorted({run.scene for run in runs})
    return [(scene, q) for q in quantities for scene in scenes if q.of_scene(runs, scene)]


def against_step(runs: Sequence[Run], panels: Sequence[Panel], orders: Sequence[int] = ORDERS) -> Drawing:
    """Return the figure: every arm a line, guides of the given orders, the truth's uncertainty shaded."""
    drawing, axes = grid(len(panels))
    names = ordered(run.name for run in runs)
    failing = {scene: ordered(r.name for r in runs if r.scene == scene and not r.ok) for scene, _ in panels}
    rows = max(map(len, failing.values()))
    for ax, (scene, quantity) in zip(axes, panels, strict=True):
        here = [run for run in runs if run.scene == scene]
        ax.set_xlabel(label("step_s"))
        ax.set_ylabel(label(quantity.name))
        for name in names:
            points = sorted((r.mean_step_s, quantity.value(r)) for r in here if r.name == name and r.ok)
            shown = [(h, e) for h, e in points if e is not None and e > 0]
            if shown:
                ax.loglog(*zip(*shown, strict=True), **line_style(name, names))
        _finish(ax, quantity.floor(here, scene), orders)
        ax.set_title(scene, pad=6 + ROW_POINTS * rows)
        for row, name in enumerate(failing[scene]):
            at = [run.step_s for run in here if not run.ok and run.name == name]
            mark_failures(ax, at, row, line_style(name, names))
    engine_legend(drawing, names, failures=any(not run.ok for run in runs))
    return drawing


def grid(count: int, height_in: float = 2.7) -> tuple[Drawing, list[Axes]]:
    """Return a figure of ``count`` panels, up to three in a row, and its axes."""
    across = count if count <= 3 else math.ceil(count / math.ceil(count / 3))
    down = math.ceil(count / across)
    width = WIDTH_IN if across > 1 else 0.6 * WIDTH_IN
    drawing = Drawing(figsize=(width, height_in * down + 0.7))
    return drawing, [drawing.add_subplot(down, across, place + 1) for place in range(count)]


def mark_failures(ax: Axes, at: Sequence[float], row: int, style: Mapping[str, Any]) -> None:
    """Put crossed-out markers above a panel where runs failed, in the row of their line."""
    drawing = ax.get_figure(root=True)
    assert drawing is not None, "the panel is on a figure"
    up = ScaledTranslation(0.0, (0.6 + row) * ROW_POINTS / 72, drawing.dpi_scale_trans)
    place = {"transform": ax.get_xaxis_transform() + up, "clip_on": False, "linestyle": ""}
    ax.plot(at, [1.0] * len(at), **{**style, **place})
    ax.plot(at, [1.0] * len(at), **{**place, "marker": "x", "markersize": 7, "color": style["color"]})


def failed_entry() -> Line2D:
    """Return the legend's entry for crossed-out markers."""
    return Line2D([], [], linestyle="", marker="x", markersize=7, color=GREY, label="failed")


def engine_legend(drawing: Drawing, names: Sequence[Name], failures: bool) -> None:
    """Put a legend below the figure, a column for each engine."""
    engines = list(dict.fromkeys(engine for engine, _ in names))
    longest = max(sum(engine == e for e, _ in names) for engine in engines)
    handles: list[Line2D] = []
    for engine in engines:
        arms = [name for name in names if name[0] == engine]
        handles += [Line2D([], [], label=title(name), **line_style(name, names)) for name in arms]
        handles += [Line2D([], [], linestyle="", label=" ") for _ in range(longest - len(arms))]
    columns = len(engines)
    if failures:
        handles.append(failed_entry())
        columns += 1
    narrow = (
        {"fontsize": 7, "handlelength": 2.4, "columnspacing": 1.2} if columns > 4 else {"handlelength": 3.2}
    )
    drawing.legend(handles=handles, loc="outside lower center", ncols=columns, **narrow)


def _finish(ax: Axes, uncertainty: float, orders: Sequence[int]) -> None:
    """Shade the truth's uncertainty and draw the guides down from the coarsest step."""
    ax.set_xscale("log")
    ax.set_yscale("log")
    if not ax.lines:
        return
    h, e = (
        np.concatenate([np.asarray(data, dtype=float) for data in each])
        for each in ((line.get_xdata() for line in ax.lines), (line.get_ydata() for line in ax.lines))
    )
    low, high = min(e.min(), uncertainty or e.min()) / 4, e.max() * 6
    ax.set_ylim(low, high)
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
