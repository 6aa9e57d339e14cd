"""A map of verdicts over the step and what varies: a panel a configuration, with theory's limit."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import NullLocator

from reports.analysis.map_cells import DIVERGED, REFUSED, VARIED, VERDICTS, limit_of
from reports.plots.series import mark
from reports.results import FloatArray
from reports.style import BLACK, WIDTH_IN

#: Colour and letter of each verdict, in their order. Lightness falls with severity, so that greyscale keeps
#: the order; what was refused is no worse than anything, so white.
LOOKS = (
    ("#F3F1E4", "·"),
    ("#F2C46D", "I"),
    ("#D27328", "G"),
    ("#8A1C1C", "D"),
    ("#20122E", "T"),
    ("#FFFFFF", "R"),
)
#: A mean step below this part of the map's was no matter of rounding.
CAPPED = 0.99
ACROSS = 3
#: Theory's line, seen on light cells and dark ones.
LINE: dict[str, Any] = {
    "color": BLACK,
    "linewidth": 1.6,
    "path_effects": [withStroke(linewidth=3.4, foreground="white")],
}


def verdict_map(rows: pd.DataFrame, varied: str) -> Drawing:
    """Return the figure of one map from its cells, a panel for each label among them."""
    configurations = list(rows.groupby("label", observed=True))
    down = math.ceil(len(configurations) / ACROSS)
    drawing = Drawing(figsize=(WIDTH_IN, 1.95 * down + 0.8))
    steps, values = (np.unique(rows[name]) for name in ("step_s", varied))
    for place, (label, of_label) in enumerate(configurations):
        ax = drawing.add_subplot(down, ACROSS, place + 1)
        _draw_cells(ax, of_label, varied, steps, values)
        if not math.isnan(limit := limit_of(of_label)):
            _draw_limit(ax, of_label, varied, limit)
        ax.set_title(f"{label}\n{_steps(of_label, limit)}", fontsize=8)
        _label_axes(
            ax, varied, values, bottom=place + ACROSS >= len(configurations), left=place % ACROSS == 0
        )
    _add_legend(drawing, sorted(rows["severity"].unique()))
    return drawing


def _steps(rows: pd.DataFrame, limit: float) -> str:
    """Return theory's limit on a configuration's steps, or that it shortens them by itself."""
    if not math.isnan(limit):
        return f"linear limit ωh = {limit:.3g}"
    if rows["method"].notna().any():
        return "no limit"
    return "shortens steps" if (rows["mean_step_s"] < CAPPED * rows["step_s"]).any() else "limit unknown"


def _draw_cells(ax: Axes, rows: pd.DataFrame, varied: str, steps: FloatArray, values: FloatArray) -> None:
    """Draw a configuration's cells: ``steps`` (n,) across and ``values`` (m,) of what varies up."""
    grid = rows.pivot_table(index=varied, columns="step_s", values="severity", aggfunc="last")
    grid = grid.reindex(index=values, columns=steps).to_numpy(dtype=float)
    ax.set(xscale="log", yscale="log")
    ax.grid(False)
    colours = ListedColormap([colour for colour, _ in LOOKS])
    scale: dict[str, Any] = {"cmap": colours, "vmin": -0.5, "vmax": len(LOOKS) - 0.5}
    cells = np.ma.masked_invalid(grid)
    ax.pcolormesh(_edges(steps), _edges(values), cells, edgecolors="white", linewidth=0.4, **scale)
    size = 7.0 if len(steps) <= 8 else 4.5
    for (row, column), severity in np.ndenumerate(grid):
        if not math.isnan(severity):
            colour = "white" if DIVERGED <= severity < REFUSED else BLACK
            place: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": size, "color": colour}
            ax.text(steps[column], values[row], LOOKS[int(severity)][1], **place)
    verdicts = [VERDICTS[severity] for severity in rows["severity"]]
    mark(ax.plot(rows["step_s"], rows[varied], linestyle="none"), str(rows["label"].iloc[0]), verdicts)


def _edges(centres: FloatArray) -> FloatArray:
    """Return the borders between values (n,), halfway on a logarithmic axis, (n + 1,)."""
    logs = np.log(centres)
    gaps = np.diff(logs) if len(logs) > 1 else np.array([1.0])
    inner = logs[:-1] + gaps[: len(logs) - 1] / 2
    return np.asarray(np.exp(np.concatenate([[logs[0] - gaps[0] / 2], inner, [logs[-1] + gaps[-1] / 2]])))


def _draw_limit(ax: Axes, rows: pd.DataFrame, varied: str, limit: float) -> None:
    """Draw the step at which omega h is the limit, omega the first impact's, across all rows of the map."""
    frequency = rows.groupby(varied)["impact_frequency_rad_s"].last()
    values = frequency.index.to_numpy()
    logs = np.log(limit / frequency.to_numpy())
    ends = _edges(values)[[0, -1]]
    slope = np.gradient(logs, np.log(values)) if len(values) > 1 else np.zeros(1)
    first = logs[0] + slope[0] * np.log(ends[0] / values[0])
    last = logs[-1] + slope[-1] * np.log(ends[1] / values[-1])
    bounds = ax.get_xlim(), ax.get_ylim()
    ax.plot(np.exp([first, *logs, last]), [ends[0], *values, ends[1]], **LINE)
    ax.set(xlim=bounds[0], ylim=bounds[1])


def _label_axes(ax: Axes, varied: str, values: FloatArray, *, bottom: bool, left: bool) -> None:
    name, unit, scale = VARIED[varied]
    shown = values if len(values) <= 5 else values[::2]
    ax.set_yticks(shown, [_short(value / scale) for value in shown] if left else [""] * len(shown))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.tick_params(length=2)
    if left:
        ax.set_ylabel(f"{name} [{unit}]", fontsize=8)
    if bottom:
        ax.set_xlabel("step, or longest step [s]")
    else:
        ax.set_xticklabels([])


def _short(value: float) -> str:
    """Return 0.02, 1250 or 6.6e+10 as it is written at an axis."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    digits, power = f"{value:.1e}".split("e")
    return f"${digits}\\cdot 10^{{{int(power)}}}$"


def _add_legend(drawing: Drawing, severities: Sequence[int]) -> None:
    handles: list[Patch | Line2D] = []
    for severity in severities:
        (colour, letter), name = LOOKS[severity], VERDICTS[severity]
        handles.append(Patch(facecolor=colour, edgecolor="#595959", linewidth=0.5, label=f"{letter}  {name}"))
    handles.append(Line2D([], [], label="theory: linear limit at the first impact", **LINE))
    drawing.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=7.5)
