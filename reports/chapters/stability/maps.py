"""Maps of verdicts over the step and what else varies: one panel per engine and arm, the same axes in all."""

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

from reports.chapters.stability.map_cells import REFUSED, VARIED, VERDICTS, capped, limit_of
from reports.results import FloatArray
from reports.style import BLACK, ENGINES, WIDTH_IN

#: Colour and letter of each verdict. Lightness falls with severity, so that greyscale keeps the order; what
#: was refused is no worse than anything, so white and hatched.
LOOKS = (
    ("#F3F1E4", "·"),
    ("#F2C46D", "I"),
    ("#D27328", "G"),
    ("#8A1C1C", "D"),
    ("#20122E", "T"),
    ("#FFFFFF", "R"),
)
#: From this severity on letters are white.
DARK = 3
ACROSS = 3


def verdict_map(rows: pd.DataFrame, varied: str) -> Drawing:
    """Return the figure of one map from its cells, with theory's limit where the arm has one."""
    arms = list(rows.groupby("label", observed=True))
    down = math.ceil(len(arms) / ACROSS)
    drawing = Drawing(figsize=(WIDTH_IN, 1.95 * down + 0.8))
    steps, values = (np.unique(rows[name]) for name in ("step_s", varied))
    for place, (label, arm) in enumerate(arms):
        ax = drawing.add_subplot(down, ACROSS, place + 1)
        _cells(ax, arm, varied, steps, values)
        if not math.isnan(limit := limit_of(arm)):
            _theory(ax, arm, varied, limit)
        ax.set_title(f"{label}\n{_steps(arm, limit)}", fontsize=8)
        _axes(ax, varied, values, bottom=place + ACROSS >= len(arms), left=place % ACROSS == 0)
    _legend(drawing, sorted(rows["severity"].unique()))
    return drawing


def _steps(arm: pd.DataFrame, limit: float) -> str:
    """Return theory's limit on an arm's steps, whether the map's are but a cap, and those in contact."""
    unlimited = "no limit" if arm["engine"].iloc[0] in ENGINES else "limit unknown"
    text = unlimited if math.isnan(limit) else f"linear limit ωh = {limit:.3g}"
    if not capped(arm):
        return text
    taken = arm["contact_step_s"].dropna() * 1e6
    return f"a cap; {taken.min():.1g} to {taken.max():.1g} µs in contact" if len(taken) else f"{text}, a cap"


def _cells(ax: Axes, arm: pd.DataFrame, varied: str, steps: FloatArray, values: FloatArray) -> None:
    """Draw an arm's cells: ``steps`` (n,) across and ``values`` (m,) of what varies up."""
    grid = arm.pivot_table(index=varied, columns="step_s", values="severity", aggfunc="last")
    grid = grid.reindex(index=values, columns=steps).to_numpy(dtype=float)
    colours = ListedColormap([colour for colour, _ in LOOKS])
    ax.set(xscale="log", yscale="log")
    ax.grid(False)
    ax.pcolormesh(
        _edges(steps),
        _edges(values),
        np.ma.masked_invalid(grid),
        cmap=colours,
        vmin=-0.5,
        vmax=len(LOOKS) - 0.5,
        edgecolors="white",
        linewidth=0.4,
    )
    size = 7.0 if len(steps) <= 8 else 4.5
    for (row, column), severity in np.ndenumerate(grid):
        if math.isnan(severity):
            continue
        colour = "white" if DARK <= severity < REFUSED else BLACK
        place: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": size, "color": colour}
        ax.text(steps[column], values[row], LOOKS[int(severity)][1], **place)


def _edges(centres: FloatArray) -> FloatArray:
    """Return the borders between values (n,), halfway on a logarithmic axis, (n + 1,)."""
    logs = np.log(centres)
    gaps = np.diff(logs) if len(logs) > 1 else np.array([1.0])
    inner = logs[:-1] + gaps[: len(logs) - 1] / 2
    return np.asarray(np.exp(np.concatenate([[logs[0] - gaps[0] / 2], inner, [logs[-1] + gaps[-1] / 2]])))


def _theory(ax: Axes, arm: pd.DataFrame, varied: str, limit: float) -> None:
    """Draw the step at which omega h is the limit, omega the first impact's, across all rows."""
    frequency = arm.groupby(varied)["impact_frequency_rad_s"].last()
    values = frequency.index.to_numpy()
    logs = np.log(limit / frequency.to_numpy())
    ends = _edges(values)[[0, -1]]
    slope = np.gradient(logs, np.log(values)) if len(values) > 1 else np.zeros(1)
    first = logs[0] + slope[0] * np.log(ends[0] / values[0])
    last = logs[-1] + slope[-1] * np.log(ends[1] / values[-1])
    bounds = ax.get_xlim(), ax.get_ylim()
    ax.plot(np.exp([first, *logs, last]), [ends[0], *values, ends[1]], **_LINE)
    ax.set(xlim=bounds[0], ylim=bounds[1])


#: Theory's line, seen on light cells and dark ones.
_LINE: dict[str, Any] = {
    "color": BLACK,
    "linewidth": 1.6,
    "linestyle": "-",
    "path_effects": [withStroke(linewidth=3.4, foreground="white")],
}


def _axes(ax: Axes, varied: str, values: FloatArray, *, bottom: bool, left: bool) -> None:
    name, unit, scale = VARIED[varied]
    shown = values if len(values) <= 5 else values[::2]
    ax.set_yticks(shown, [_short(value / scale) for value in shown] if left else [""] * len(shown))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.tick_params(length=2)
    if left:
        ax.set_ylabel(f"{name} [{unit}]", fontsize=8)
    if bottom:
        ax.set_xlabel("step, or its cap [s]")
    else:
        ax.set_xticklabels([])


def _short(value: float) -> str:
    """Return 0.02, 1250 or 6.6e+10 as it is written at an axis."""
    if 1e-3 <= value < 1e5:
        return f"{value:g}"
    digits, power = f"{value:.1e}".split("e")
    return f"${digits}\\cdot 10^{{{int(power)}}}$"


def _legend(drawing: Drawing, severities: Sequence[int]) -> None:
    handles: list[Patch | Line2D] = [
        Patch(
            facecolor=LOOKS[k][0], edgecolor="#595959", linewidth=0.5, label=f"{LOOKS[k][1]}  {VERDICTS[k]}"
        )
        for k in severities
    ]
    handles.append(Line2D([], [], label="theory: the linear limit at the first impact", **_LINE))
    drawing.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=7.5)
