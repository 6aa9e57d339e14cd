"""The mechanism with its parameters, drawn from a scene's numbers."""

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.patches import Arc, Circle, Polygon, Rectangle

from reports.parts import Figure
from reports.style import BLUE, GREY, RC, VERMILLION

#: A scene as its row has it: the TOML file's sections and fields.
Scene = Mapping[str, Any]
#: The crank's angle in the drawing, in degrees; sizes in parts of the crank.
ANGLE_DEG, PIN, BLOCK, MARGIN = 55.0, 0.09, (0.62, 0.42), 0.42
LINK, MM = "#5A5A5A", 1e3
#: A pin rests in its bearing in this direction, in degrees, its room drawn as a part of the bearing.
TOUCH_DEG, ROOM = -35.0, 0.3
WIDTH_IN = 5.4


def mechanism_figure(scene: Scene) -> Figure:
    """Return the drawing of a crank-slider with its symbols, and of its first joint with clearance."""
    with mpl.rc_context(RC):
        drawing = Drawing(figsize=(WIDTH_IN, 4.6))
        grid = drawing.add_gridspec(2, 2, height_ratios=(1.25, 1), width_ratios=(1, 1.15))
        ax = drawing.add_subplot(grid[0, :])
        draw_mechanism(ax, scene)
        _label(ax, scene)
        bearing, text = (drawing.add_subplot(grid[1, place]) for place in range(2))
        joint = next(iter(scene["clearance"]))
        _bearing(bearing, joint)
        text.set_axis_off()
        text.text(0, 0.97, "\n".join(_values(scene, joint)), va="top", fontsize=8, linespacing=1.55)
    return Figure(
        "motions-mechanism",
        "The mechanism",
        f"Crank, rod and slider with the symbols of the equations, and joint {joint} with its clearance, "
        f"drawn far too large. The numbers are those of {scene['name']}.",
        "A crank-slider with angles, lengths and joints O, A, B named, and a pin touching its bearing.",
        drawing,
    )


def draw_mechanism(ax: Axes, scene: Scene) -> None:
    """Draw a scene's links, slider, guide and joints, where one has clearance its bearing too, in mm."""
    r = scene["crank"]["length_m"] * MM
    ax.set(aspect="equal")
    ax.set_axis_off()
    size = PIN * r
    if "rod" not in scene:
        ends = [(0.0, 0.0), (r, 0.0)]
        ax.set(xlim=(-0.5 * r, 1.2 * r), ylim=(-0.8 * r, 0.5 * r))
    else:
        rod = scene["rod"]["length_m"] * MM
        angle = np.radians(ANGLE_DEG)
        pin = r * np.array([np.cos(angle), np.sin(angle)])
        x = pin[0] + np.sqrt(rod**2 - pin[1] ** 2)
        ends = [(0.0, 0.0), (float(pin[0]), float(pin[1])), (float(x), 0.0)]
        _guide(ax, x, r)
        ax.add_patch(Circle((0, 0), r, fill=False, linestyle=":", color=GREY, linewidth=0.8))
        ax.set(xlim=(-1.15 * r, x + 1.05 * r), ylim=(-(1 + MARGIN / 3) * r, (1 + MARGIN) * r))
    ax.plot(*np.transpose(ends), color=LINK, linewidth=4, alpha=0.6, solid_capstyle="round", zorder=2)
    _ground(ax, r)
    for joint, centre in zip("OAB", ends, strict=False):
        if "rod" in scene or joint == "O":
            loose = bool(scene["clearance"].get(joint))
            ax.add_patch(Circle(centre, size, facecolor="white", edgecolor="black", zorder=4))
            if loose:
                ring = Circle(centre, 1.9 * size, fill=False, edgecolor=VERMILLION, linewidth=1.4, zorder=4)
                ax.add_patch(ring)


def _guide(ax: Axes, x: float, r: float) -> None:
    """Draw the slider's block and the two sides of its guide."""
    width, height = BLOCK[0] * r, BLOCK[1] * r
    block = Rectangle(
        (x - width / 2, -height / 2), width, height, facecolor="#D9D9D9", edgecolor=LINK, zorder=1
    )
    ax.add_patch(block)
    for side in (-1, 1):
        ax.plot([x - 1.4 * width, x + 1.4 * width], [side * height / 2] * 2, color="black", linewidth=0.9)


def _ground(ax: Axes, r: float) -> None:
    foot = [(0, 0), (-0.16 * r, -0.3 * r), (0.16 * r, -0.3 * r)]
    ax.add_patch(Polygon(foot, facecolor="#EDEDED", edgecolor="black", linewidth=0.8, zorder=1))
    ax.plot([-0.3 * r, 0.3 * r], [-0.3 * r] * 2, color="black", linewidth=1.2)


def _label(ax: Axes, scene: Scene) -> None:
    """Write the symbols: lengths, angles, joints, the slider's place, gravity."""
    r, rod = scene["crank"]["length_m"] * MM, scene["rod"]["length_m"] * MM
    angle = np.radians(ANGLE_DEG)
    a = r * np.array([np.cos(angle), np.sin(angle)])
    x = float(a[0] + np.sqrt(rod**2 - a[1] ** 2))
    ax.plot([-0.3 * r, x + 0.9 * r], [0, 0], color=GREY, linewidth=0.7, linestyle="-.", zorder=0)
    ax.add_patch(Arc((0, 0), 0.8 * r, 0.8 * r, theta1=0, theta2=ANGLE_DEG, color=BLUE))
    phi = float(np.degrees(np.arctan2(a[1], x - a[0])))
    ax.add_patch(Arc((x, 0), 1.5 * r, 1.5 * r, theta1=180 - phi, theta2=180, color=BLUE))
    texts = {
        r"$\theta$": (0.5 * r, 0.17 * r),
        r"$|\varphi|$": (x - 0.98 * r, 0.15 * r),
        "$r$": (a[0] * 0.72 - 0.15 * r, a[1] * 0.72 + 0.08 * r),
        "$L$": ((a[0] + x) / 2, a[1] / 2 + 0.14 * r),
        "O": (-0.27 * r, 0.06 * r),
        "A": (a[0] - 0.02 * r, a[1] + 0.2 * r),
        "B": (x + 0.02 * r, 0.32 * r),
        "crank": (-0.6 * r, 0.52 * r),
        "rod": ((a[0] + x) / 2 + 0.36 * r, a[1] / 2 + 0.06 * r),
        "slider in its guide": (x, -0.42 * r),
    }
    for text, (at_x, at_y) in texts.items():
        colour = BLUE if "$" in text else "black"
        ax.text(at_x, at_y, text, ha="center", va="center", color=colour, fontsize=10 if "$" in text else 9)
    arrow: dict[str, Any] = {"arrowstyle": "->", "color": "black"}
    ax.annotate("", (a[0] * 0.35, a[1] * 0.4), (-0.38 * r, 0.48 * r), arrowprops={**arrow, "color": GREY})
    ax.annotate("", (x + 0.85 * r, 0.5 * r), (x + 0.85 * r, 0.95 * r), arrowprops=arrow)
    ax.text(x + 0.72 * r, 0.72 * r, "$g$", color=BLUE, fontsize=10)
    ax.annotate("", (x, -0.75 * r), (0, -0.75 * r), arrowprops={**arrow, "arrowstyle": "<->"})
    ax.plot([0, 0], [-0.35 * r, -0.82 * r], color=GREY, linewidth=0.6)
    ax.plot([x, x], [-0.5 * r, -0.82 * r], color=GREY, linewidth=0.6)
    ax.text(x / 2, -0.67 * r, "$x$", color=BLUE, fontsize=10, ha="center")


def _bearing(ax: Axes, joint: str) -> None:
    """Draw a pin that has gone into the wall of its bearing, both far from their real proportions."""
    outer, inner = 1.0, 1.0 - ROOM

    def towards(length: float) -> tuple[float, float]:
        return length * float(np.cos(touch)), length * float(np.sin(touch))

    touch, deep = np.radians(TOUCH_DEG), 1.2 * ROOM
    centre = towards(deep)
    ax.add_patch(Circle((0, 0), outer + 0.22, facecolor="#E4E4E4", edgecolor="none"))
    ax.add_patch(Circle((0, 0), outer, facecolor="white", edgecolor=VERMILLION, linewidth=1.6))
    ax.add_patch(Circle(centre, inner, facecolor="#CFE3F1", edgecolor="black", alpha=0.75))
    ax.add_patch(Circle((0, 0), ROOM, fill=False, linestyle="--", edgecolor=GREY))
    ax.plot(0, 0, "+", color="black")
    ax.plot(*centre, "o", color=BLUE, markersize=3)
    arrow: dict[str, Any] = {"arrowstyle": "->", "color": BLUE, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", centre, (0, 0), arrowprops=arrow)
    up = np.radians(150)
    ax.annotate("", (outer * np.cos(up), outer * np.sin(up)), (0, 0), arrowprops={**arrow, "color": LINK})
    ax.text(-0.62, 0.47, "$R$", ha="center", color=BLUE, fontsize=10)
    ax.text(0.33, -0.02, "$\\mathbf{d}$", color=BLUE, fontsize=10)
    ax.text(-0.12, -0.47, "$c$", color=BLUE, fontsize=10)
    push = {**arrow, "color": VERMILLION, "linewidth": 1.6}
    ax.annotate("", towards(deep + 0.28), towards(deep + 0.72), arrowprops=push)
    ax.text(1.1, -0.92, "$F_n$", color=VERMILLION, fontsize=10)
    ax.text(0, 1.29, f"joint {joint}: bearing and pin", ha="center", fontsize=9)
    ax.set(xlim=(-1.3, 1.6), ylim=(-1.3, 1.5), aspect="equal")
    ax.set_axis_off()


def _values(scene: Scene, joint: str) -> list[str]:
    """Return the lines of numbers beside the bearing."""
    crank, rod, slider, loose = (scene[name] for name in ("crank", "rod", "slider", "clearance"))
    law = loose[joint]
    lines = [
        rf"$r$ = {crank['length_m'] * MM:g} mm, $L$ = {rod['length_m'] * MM:g} mm",
        f"masses {crank['mass_kg']:g}, {rod['mass_kg']:g}, {slider['mass_kg']:g} kg",
        f"inertias {crank['inertia_kg_m2']:g}, {rod['inertia_kg_m2']:g} kg m²",
        f"$R$ = {law['bearing_radius_m'] * MM:g} mm, $c$ = {law['radial_clearance_m'] * MM:g} mm",
        r"penetration $\delta$ = |$\mathbf{d}$| − $c$",
        r"$F_n$ = 0 while $\delta$ < 0: the pin flies",
        f"contact law {law['law']}",
    ]
    if law.get("restitution") is not None:
        lines.append(f"restitution {law['restitution']:g}")
    if law.get("young_modulus_Pa") is not None:
        lines.append(f"modulus {law['young_modulus_Pa'] / 1e9:g} GPa, Poisson {law['poisson_ratio']:g}")
    return lines
