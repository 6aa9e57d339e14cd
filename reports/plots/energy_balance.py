"""The energy balance of a scene's runs over time: losses stacked below the work that is not stored."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from reports.plots.panels import grid
from reports.plots.series import mark
from reports.results import Results
from reports.style import BLACK, GREY, WIDTH_IN, axis_label

#: The ends of the columns that are terms of the energy balance, in the order of tables.
TERMS = ("_change_J", "_work_J", "_loss_J")
#: Grey and hatch of what contacts dissipate and of what stabilisation removes, and of other losses.
LOSSES = {
    "normal": ("#BDBDBD", ""),
    "friction": ("#E8E8E8", "////"),
    "clipped": ("#F7F7F7", "xxxx"),
    "stabilisation": ("#969696", "...."),
}
OTHER = ("#D0D0D0", "\\\\\\\\")
WORK = "work less energy stored"
#: A loss below this part of the work is too thin to be drawn.
SEEN = 1e-3
#: Panels have one scale if the largest is not so many times the smallest.
ALIKE = 4.0


def balance_drawing(results: Results, rows: pd.DataFrame) -> Drawing:
    """Return the energy balance of some runs of a scene, a row and a panel for each."""
    drawing, axes = grid(len(rows), height_in=1.9)
    used: list[str] = []
    for ax, (_, row) in zip(axes, rows.iterrows(), strict=True):
        used += _draw_balance(ax, results, row)
    tops = [ax.get_ylim()[1] for ax in axes]
    for ax, own in zip(axes, tops, strict=True):
        ax.set_ylim(0, max(tops) if max(tops) < ALIKE * min(tops) else own)
    handles: list[Line2D | Patch] = [Line2D([], [], color=BLACK, label=WORK)]
    for name in dict.fromkeys(used):
        face, hatch = _look(name)
        handles.append(Patch(facecolor=face, hatch=hatch, edgecolor=GREY, label=_loss(name)))
    drawing.set_figwidth(WIDTH_IN)
    drawing.legend(handles=handles, loc="outside lower center", ncols=3)
    return drawing


def _draw_balance(ax: Axes, results: Results, row: pd.Series) -> list[str]:
    """Draw a run's energy balance, and return the columns of the losses that are thick enough to be seen."""
    time, present = results.curve(row["case"], "time_s"), row.dropna().index
    curves = {name: results.curve(row["case"], name) for name in present if name.endswith(TERMS)}
    work = sum(curve for name, curve in curves.items() if name.endswith("_work_J"))
    left = work - sum(curve for name, curve in curves.items() if name.endswith("_change_J"))
    losses = [name for name in curves if name.endswith("_loss_J")]
    losses = [name for name in losses if np.abs(curves[name]).max() >= SEEN * np.abs(left).max()]
    base = np.zeros(len(time))
    for name in losses:
        top = base + curves[name]
        face, hatch = _look(name)
        edge: Any = {"hatch": hatch, "edgecolor": "#5A5A5A", "linewidth": 0.3}
        mark([ax.fill_between(time, base, top, facecolor=face, **edge)], _loss(name))
        base = top
    mark(ax.plot(time, left, color=BLACK, linewidth=1.4), WORK)
    ax.set(title=row["label"], xlabel=axis_label("time_s"), ylabel="energy [J]")
    return losses


def _loss(name: str) -> str:
    """Return a loss in words by its column."""
    return name.removesuffix("_J").replace("_", " ")


def _look(name: str) -> tuple[str, str]:
    """Return face and hatch of a loss by its column."""
    return next((look for kind, look in LOSSES.items() if kind in name), OTHER)
