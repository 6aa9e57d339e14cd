"""The crank-slider with its symbols, and the pin of a joint in its bearing, from the numbers of a scene."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.patches import Circle, Rectangle

from reports.look import BLUE, GREY, VERMILLION, WIDTH_IN, Picture

#: The angle of the crank as drawn, and the direction in which the pin touches, in degrees.
ANGLE_DEG, TOUCH_DEG = 55.0, -35.0
#: The clearance as drawn, and how far the pin's centre is off, in radii of the bearing.
CLEARANCE, DEEP = 0.3, 0.36
MM = 1e3


def draw_mechanism(scene: Mapping[str, Any]) -> Drawing:
    """Return the drawing of a crank-slider in proportion, of its first joint with clearance, and numbers.

    The scene is as its row has it: the sections and fields of its file.
    """
    joint, law = next((joint, law) for joint, law in scene["clearance"].items() if law)
    crank, rod, slider = (scene[name] for name in ("crank", "rod", "slider"))
    drawing = Picture(4.6, 0.72 * WIDTH_IN)
    grid = drawing.add_gridspec(2, 2, height_ratios=(1.25, 1), width_ratios=(1, 1.15))
    _draw_links(drawing.add_subplot(grid[0, :]), crank["length_m"] * MM, rod["length_m"] * MM, joint)
    _draw_bearing(drawing.add_subplot(grid[1, 0]), joint)
    numbers = [
        rf"$r$ = {crank['length_m'] * MM:g} mm, $L$ = {rod['length_m'] * MM:g} mm",
        f"masses {crank['mass_kg']:g}, {rod['mass_kg']:g}, {slider['mass_kg']:g} kg",
        f"inertias {crank['inertia_kg_m2']:g}, {rod['inertia_kg_m2']:g} kg m²",
        f"$R$ = {law['bearing_radius_m'] * MM:g} mm, $c$ = {law['radial_clearance_m'] * MM:g} mm",
        r"penetration $\delta$ = |$\mathbf{d}$| − $c$",
        r"$F_n$ = 0 where $\delta$ < 0: the pin is in flight",
        f"contact law {law['law']}",
    ]
    text = drawing.add_subplot(grid[1, 1])
    text.set_axis_off()
    text.text(0, 0.97, "\n".join(numbers), va="top", fontsize=8, linespacing=1.55)
    return drawing


def _draw_links(ax: Axes, r: float, rod: float, loose: str) -> None:
    """Draw links, slider, guide and joints in mm, with the symbols of lengths and angles."""
    a = r * np.cos(np.radians(ANGLE_DEG)), r * np.sin(np.radians(ANGLE_DEG))
    x = float(a[0] + np.sqrt(rod**2 - a[1] ** 2))
    ax.set(aspect="equal", xlim=(-1.15 * r, x + 0.9 * r), ylim=(-1.0 * r, 1.3 * r))
    ax.set_axis_off()
    ax.add_patch(
        Rectangle((x - 0.31 * r, -0.21 * r), 0.62 * r, 0.42 * r, facecolor="#D9D9D9", edgecolor="black")
    )
    ax.plot([x - 0.8 * r, x + 0.8 * r], [[-0.21 * r, 0.21 * r]] * 2, color="black", linewidth=0.9)
    ax.plot([-0.3 * r, x + 0.9 * r], [0, 0], color=GREY, linewidth=0.7, linestyle="-.", zorder=0)
    ax.plot([0, a[0], x], [0, a[1], 0], color="#5A5A5A", linewidth=4, alpha=0.6)
    ax.plot(0, 0, marker=6, markersize=16, color=GREY)
    ax.add_patch(Circle((0, 0), r, fill=False, linestyle=":", color=GREY, linewidth=0.8))
    for joint, place in {"O": (0.0, 0.0), "A": a, "B": (x, 0.0)}.items():
        edge = VERMILLION if joint == loose else "black"
        ax.plot(*place, "o", markersize=9, markerfacecolor="white", markeredgecolor=edge, zorder=4)
        ax.annotate(joint, place, (-14, 9), textcoords="offset points", fontsize=9)
    ax.annotate("", (x, -0.6 * r), (0, -0.6 * r), arrowprops={"arrowstyle": "<->"})
    texts = {
        r"$\theta$": (0.25 * r, 0.12 * r),
        r"$\varphi$": (x - 0.75 * r, 0.09 * r),
        "$r$": (0.3 * a[0], 0.7 * a[1]),
        "$L$": ((a[0] + x) / 2, a[1] / 2 + 0.12 * r),
        "$x$": (x / 2, -0.5 * r),
        "crank": (-0.55 * r, 0.52 * r),
        "rod": ((a[0] + x) / 2 + 0.5 * r, a[1] / 2 - 0.05 * r),
        "slider in its guide": (x, -0.42 * r),
    }
    for text, place in texts.items():
        ax.text(*place, text, ha="center", va="center", fontsize=9, color=BLUE if "$" in text else "black")


def _draw_bearing(ax: Axes, joint: str) -> None:
    """Draw a pin that penetrates the wall of its bearing, with the clearance far too large."""
    x, y = float(np.cos(np.radians(TOUCH_DEG))), float(np.sin(np.radians(TOUCH_DEG)))
    ax.add_patch(Circle((0, 0), 1.22, facecolor="#E4E4E4", edgecolor="none"))
    ax.add_patch(Circle((0, 0), 1.0, facecolor="white", edgecolor=VERMILLION, linewidth=1.6))
    ax.add_patch(
        Circle((DEEP * x, DEEP * y), 1 - CLEARANCE, facecolor="#CFE3F1", edgecolor="black", alpha=0.75)
    )
    ax.add_patch(Circle((0, 0), CLEARANCE, fill=False, linestyle="--", edgecolor=GREY))
    arrows = [((0.0, 0.0), (DEEP * x, DEEP * y), BLUE), ((0.0, 0.0), (-0.87, 0.5), GREY)]
    arrows.append(((1.1 * x, 1.1 * y), (0.6 * x, 0.6 * y), VERMILLION))
    for start, end, colour in arrows:
        ax.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": colour})
    for text, place in {"$R$": (-0.7, 0.5), r"$\mathbf{d}$": (0.33, -0.02), "$c$": (-0.12, -0.5)}.items():
        ax.text(*place, text, color=BLUE, fontsize=10)
    ax.text(1.0, -0.9, "$F_n$", color=VERMILLION, fontsize=10)
    ax.text(0, 1.29, f"joint {joint}: bearing and pin", ha="center", fontsize=9)
    ax.set(xlim=(-1.3, 1.6), ylim=(-1.3, 1.5), aspect="equal")
    ax.set_axis_off()
