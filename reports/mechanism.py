"""The crank-slider with its symbols, and the pin of a joint in its bearing, from the numbers of a scene."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.patches import Arc, Circle, Polygon, Rectangle

from reports.look import BLUE, GREY, VERMILLION, WIDTH_IN

#: A scene as its row has it: the sections and fields of its file.
Scene = Mapping[str, Any]
#: The angle of the crank as drawn, in degrees; the radius of a pin and the size of the slider, in cranks.
ANGLE_DEG, PIN, SLIDER = 55.0, 0.09, (0.62, 0.42)
#: The direction in which the pin touches, in degrees, and the clearance as drawn, in radii of the bearing.
TOUCH_DEG, CLEARANCE = -35.0, 0.3
LINK, MM = "#5A5A5A", 1e3
ARROW: dict[str, Any] = {"arrowstyle": "->", "color": "black", "shrinkA": 0, "shrinkB": 0}


def draw_mechanism(scene: Scene) -> Drawing:
    """Return the drawing of a crank-slider in proportion, of its first joint with clearance, and numbers."""
    joint = next(joint for joint, law in scene["clearance"].items() if law)
    drawing = Drawing(figsize=(0.72 * WIDTH_IN, 4.6))
    grid = drawing.add_gridspec(2, 2, height_ratios=(1.25, 1), width_ratios=(1, 1.15))
    _draw_links(drawing.add_subplot(grid[0, :]), scene)
    _draw_bearing(drawing.add_subplot(grid[1, 0]), joint)
    text = drawing.add_subplot(grid[1, 1])
    text.set_axis_off()
    text.text(0, 0.97, "\n".join(_numbers(scene, joint)), va="top", fontsize=8, linespacing=1.55)
    return drawing


def _draw_links(ax: Axes, scene: Scene) -> None:
    """Draw links, slider, guide and joints in mm, with the symbols of lengths, angles and gravity."""
    r, rod = (scene[link]["length_m"] * MM for link in ("crank", "rod"))
    a = r * np.array([np.cos(np.radians(ANGLE_DEG)), np.sin(np.radians(ANGLE_DEG))])
    x = float(a[0] + np.sqrt(rod**2 - a[1] ** 2))
    ends = {"O": (0.0, 0.0), "A": (float(a[0]), float(a[1])), "B": (x, 0.0)}
    ax.set(aspect="equal", xlim=(-1.15 * r, x + 1.05 * r), ylim=(-1.14 * r, 1.42 * r))
    ax.set_axis_off()
    width, height = SLIDER[0] * r, SLIDER[1] * r
    corner = (x - width / 2, -height / 2)
    ax.add_patch(Rectangle(corner, width, height, facecolor="#D9D9D9", edgecolor=LINK, zorder=1))
    for side in (-1, 1):
        ax.plot([x - 1.4 * width, x + 1.4 * width], [side * height / 2] * 2, color="black", linewidth=0.9)
    foot = [(0, 0), (-0.16 * r, -0.3 * r), (0.16 * r, -0.3 * r)]
    ax.add_patch(Polygon(foot, facecolor="#EDEDED", edgecolor="black", linewidth=0.8, zorder=1))
    ax.plot([-0.3 * r, 0.3 * r], [-0.3 * r] * 2, color="black", linewidth=1.2)
    ax.add_patch(Circle((0, 0), r, fill=False, linestyle=":", color=GREY, linewidth=0.8))
    ax.plot([-0.3 * r, x + 0.9 * r], [0, 0], color=GREY, linewidth=0.7, linestyle="-.", zorder=0)
    ax.plot(*np.transpose([*ends.values()]), color=LINK, linewidth=4, alpha=0.6, zorder=2)
    for joint, centre in ends.items():
        ax.add_patch(Circle(centre, PIN * r, facecolor="white", edgecolor="black", zorder=4))
        if scene["clearance"].get(joint):
            ax.add_patch(
                Circle(centre, 1.9 * PIN * r, fill=False, edgecolor=VERMILLION, linewidth=1.4, zorder=4)
            )
    phi_deg = float(np.degrees(np.arctan2(a[1], x - a[0])))
    ax.add_patch(Arc((0, 0), 0.8 * r, 0.8 * r, theta1=0, theta2=ANGLE_DEG, color=BLUE))
    ax.add_patch(Arc((x, 0), 1.5 * r, 1.5 * r, theta1=180 - phi_deg, theta2=180, color=BLUE))
    texts = {
        r"$\theta$": (0.5 * r, 0.17 * r),
        r"$|\varphi|$": (x - 0.98 * r, 0.15 * r),
        "$r$": (a[0] * 0.72 - 0.15 * r, a[1] * 0.72 + 0.08 * r),
        "$L$": ((a[0] + x) / 2, a[1] / 2 + 0.14 * r),
        "$x$": (x / 2, -0.67 * r),
        "$g$": (x + 0.76 * r, 0.74 * r),
        "O": (-0.27 * r, 0.06 * r),
        "A": (a[0] - 0.02 * r, a[1] + 0.2 * r),
        "B": (x + 0.02 * r, 0.32 * r),
        "crank": (-0.6 * r, 0.52 * r),
        "rod": ((a[0] + x) / 2 + 0.36 * r, a[1] / 2 + 0.06 * r),
        "slider in its guide": (x, -0.42 * r),
    }
    for text, place in texts.items():
        style: dict[str, Any] = (
            {"color": BLUE, "fontsize": 10} if "$" in text else {"color": "black", "fontsize": 9}
        )
        ax.text(*place, text, ha="center", va="center", **style)
    ax.annotate("", (a[0] * 0.35, a[1] * 0.4), (-0.38 * r, 0.48 * r), arrowprops={**ARROW, "color": GREY})
    ax.annotate("", (x + 0.85 * r, 0.5 * r), (x + 0.85 * r, 0.95 * r), arrowprops=ARROW)
    ax.annotate("", (x, -0.75 * r), (0, -0.75 * r), arrowprops={**ARROW, "arrowstyle": "<->"})
    for at, top in ((0.0, -0.35), (x, -0.5)):
        ax.plot([at, at], [top * r, -0.82 * r], color=GREY, linewidth=0.6)


def _draw_bearing(ax: Axes, joint: str) -> None:
    """Draw a pin that penetrates the wall of its bearing, with the clearance far too large."""

    def at(length: float, angle_deg: float = TOUCH_DEG) -> tuple[float, float]:
        angle = np.radians(angle_deg)
        return length * float(np.cos(angle)), length * float(np.sin(angle))

    deep = 1.2 * CLEARANCE
    ax.add_patch(Circle((0, 0), 1.22, facecolor="#E4E4E4", edgecolor="none"))
    ax.add_patch(Circle((0, 0), 1.0, facecolor="white", edgecolor=VERMILLION, linewidth=1.6))
    ax.add_patch(Circle(at(deep), 1 - CLEARANCE, facecolor="#CFE3F1", edgecolor="black", alpha=0.75))
    ax.add_patch(Circle((0, 0), CLEARANCE, fill=False, linestyle="--", edgecolor=GREY))
    ax.plot(0, 0, "+", color="black")
    ax.plot(*at(deep), "o", color=BLUE, markersize=3)
    ax.annotate("", at(deep), (0, 0), arrowprops={**ARROW, "color": BLUE})
    ax.annotate("", at(1.0, 150), (0, 0), arrowprops={**ARROW, "color": LINK})
    push = {**ARROW, "color": VERMILLION, "linewidth": 1.6}
    ax.annotate("", at(deep + 0.28), at(deep + 0.72), arrowprops=push)
    texts = {"$R$": (-0.7, 0.47), "$\\mathbf{d}$": (0.33, -0.02), "$c$": (-0.12, -0.47)}
    for text, place in texts.items():
        ax.text(*place, text, color=BLUE, fontsize=10)
    ax.text(1.1, -0.92, "$F_n$", color=VERMILLION, fontsize=10)
    ax.text(0, 1.29, f"joint {joint}: bearing and pin", ha="center", fontsize=9)
    ax.set(xlim=(-1.3, 1.6), ylim=(-1.3, 1.5), aspect="equal")
    ax.set_axis_off()


def _numbers(scene: Scene, joint: str) -> list[str]:
    """Return the lines of numbers beside the bearing."""
    crank, rod, slider, law = scene["crank"], scene["rod"], scene["slider"], scene["clearance"][joint]
    lines = [
        rf"$r$ = {crank['length_m'] * MM:g} mm, $L$ = {rod['length_m'] * MM:g} mm",
        f"masses {crank['mass_kg']:g}, {rod['mass_kg']:g}, {slider['mass_kg']:g} kg",
        f"inertias {crank['inertia_kg_m2']:g}, {rod['inertia_kg_m2']:g} kg m²",
        f"$R$ = {law['bearing_radius_m'] * MM:g} mm, $c$ = {law['radial_clearance_m'] * MM:g} mm",
        r"penetration $\delta$ = |$\mathbf{d}$| − $c$",
        r"$F_n$ = 0 where $\delta$ < 0: the pin is in flight",
        f"contact law {law['law']}",
    ]
    if law.get("restitution") is not None:
        lines.append(f"restitution {law['restitution']:g}")
    if law.get("young_modulus_Pa") is not None:
        lines.append(f"modulus {law['young_modulus_Pa'] / 1e9:g} GPa, Poisson {law['poisson_ratio']:g}")
    return lines
