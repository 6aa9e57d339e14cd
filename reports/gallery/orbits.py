"""The path of the pin in its clearance circle, an engine a panel."""

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from reports.gallery.data import joints_with_clearance, of_view
from reports.gallery.drawing import WIDTH_IN
from reports.gallery.over_time import TRUTH
from reports.parts import Figure
from reports.results import FloatArray, Results
from reports.style import BLACK, RC, labels, line_styles

UM, ACROSS = 1e6, 3
#: Of a path every so many points are drawn.
EVERY = 3


def orbit_figures(results: Results) -> list[Figure]:
    """Return a figure for each scene with clearance and each of its joints that has one."""
    rows = of_view(results, "revolution")
    return [
        _orbits(results, scene, of, joint)
        for scene, of in rows.groupby("scene")
        for joint in joints_with_clearance(of.iloc[0])
    ]


def _orbits(results: Results, scene: str, rows: pd.DataFrame, joint: str) -> Figure:
    styles = line_styles(rows)
    with mpl.rc_context(RC):
        across = min(ACROSS, len(rows))
        down = -(-len(rows) // across)
        size, room = WIDTH_IN / ACROSS, len(rows) % across > 0  # for the legend among the panels
        height = (size + 0.1) * down + (0.3 if room else 0.9)
        drawing = Drawing(figsize=(size * across + 0.2, height))
        panels = drawing.subplots(down, across, sharex=True, sharey=True, squeeze=False).ravel()
        for ax, (_, row) in zip(panels, rows.iterrows(), strict=False):
            case, style = row["case"], styles[row["label"]]
            circle(ax, radius_m(results, case, joint))
            ax.plot(*_path(results, case, joint, "true_"), **{**TRUTH, "linewidth": 2.4})
            ax.plot(*_path(results, case, joint), color=style["color"], linewidth=0.7)
            ax.set_title(row["label"].replace(" (", "\n("), fontsize=8, color=style["color"])
        for ax in panels[len(rows) :]:
            ax.set_axis_off()
        key = [
            Line2D([], [], label="clearance circle", color=BLACK, linewidth=0.9),
            Line2D([], [], label="truth", **TRUTH),
        ]
        if room:
            panels[-1].legend(handles=key, loc="center")
        else:
            drawing.legend(handles=key, loc="outside upper center", ncols=2)
        drawing.supxlabel("x of the pin [µm]", fontsize=8.5)
        drawing.supylabel("y of the pin [µm]", fontsize=8.5)
    return Figure(
        f"motions-orbit-{scene}-{joint}",
        f"The pin of joint {joint} in its bearing on {scene}",
        "The way of the pin's centre over one revolution, from the bearing's: inside the circle it flies, "
        "on it and outside it touches. The truth of the law that the engine solves is the broad grey line.",
        f"{len(rows)} clearance circles with the pin's path in each: {', '.join(labels(rows))}.",
        drawing,
    )


def circle(ax: Axes, radius_m: float) -> None:
    """Draw the clearance circle, in µm."""
    ax.add_patch(Circle((0, 0), UM * radius_m, fill=False, edgecolor=BLACK, linewidth=0.9, zorder=3))
    ax.set_aspect("equal")


def radius_m(results: Results, case: str, joint: str) -> float:
    """Return the radial clearance of a joint: the length of its gap less the penetration, at any time."""
    x, y = (results.curve(case, f"clearance_{joint}_{axis}_m") for axis in "xy")
    return float(np.median(np.hypot(x, y) - results.curve(case, f"contact_{joint}_penetration_m")))


def _path(results: Results, case: str, joint: str, prefix: str = "") -> list[FloatArray]:
    return [UM * results.curve(case, f"{prefix}clearance_{joint}_{axis}_m")[::EVERY] for axis in "xy"]
