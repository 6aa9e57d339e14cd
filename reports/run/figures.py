"""Figures of one run: its motion, forces and energy over time, and the path of a pin in its clearance."""

import re
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from textwrap import fill

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.look import BLUE, GREY, RC, VERMILLION, axis_label, words
from reports.plots.picture import COLOURS, DASHES, Picture, picture_bytes

#: Height of a panel, of what is above and below all panels, in inches, and the characters of a line below
#: and of one beside a panel.
PANEL_IN, MARGINS_IN, LINE, LABEL = 1.45, 1.0, 110, 24
#: The label of the panel of forces.
FORCE = "force [N]"
#: The slider's motion, and the crank's, which is shown of a pendulum.
MOTION = {"slider_position_m": "crank_angle_rad", "slider_velocity_m_s": "crank_speed_rad_s"}
#: How columns begin that have what any other mechanism is about, and its rate.
OBSERVED = "observed_"
JOINT_FORCE = re.compile(r"joint_(.+)_force_x_N")
GUIDE_FORCE = re.compile(r"guide_(.+)_normal_force_N")
ENERGY = re.compile(r"(kinetic|potential|dissipated)_energy_J|.+_work_J")
#: The most forces and energies of a panel: those with the largest numbers.
MOST_FORCES, MOST_ENERGIES = 6, len(COLOURS)
#: Points of the clearance circle, and width and height of its figure in inches.
POINTS, ORBIT_IN = 361, (5.2, 5.0)
UM_PER_M = 1e6


def time_plot(
    frame: pd.DataFrame,
    title: str,
    quality: str,
    mark: tuple[float, float, str] | None = None,
    columns: Sequence[str] = (),
) -> Picture:
    """Return the figure of a table of samples whose index is the time in s, with its quality in words below.

    ``mark`` is a time in s, a force in N there, and its name. It has a panel for each of the ``columns``, or
    without any for those that a mechanism is about.
    """
    panels = {axis_label(name): {"": frame[name]} for name in columns} or _panels(frame)
    with mpl.rc_context(RC):
        picture = Picture(PANEL_IN * len(panels) + MARGINS_IN)
        picture.suptitle(title, fontsize=10)
        picture.supxlabel(fill(quality, LINE), fontsize=7.5, color="#595959")
        axes = picture.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
        for ax, (label, curves) in zip(axes, panels.items(), strict=True):
            ax.set_ylabel(fill(label, LABEL))
            for (name, curve), colour, dashes in zip(curves.items(), COLOURS, DASHES, strict=False):
                ax.plot(frame.index, curve, label=name, color=colour, linestyle=dashes)
            if len(curves) > 1:
                ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
            if mark is not None and label.endswith(FORCE):
                _mark(ax, *mark)
        picture.align_ylabels(list(axes))
        axes[-1].set(xlabel=axis_label("time_s"), xlim=(frame.index[0], frame.index[-1]))
    return picture


def orbit_plot(frame: pd.DataFrame, joint: str, radial_clearance_m: float, title: str) -> Picture:
    """Return the figure of a joint's gap, from the bearing's centre to the pin's, in a table of samples."""
    x, y = (UM_PER_M * frame[f"clearance_{joint}_{axis}_m"] for axis in "xy")
    touching = frame[f"contact_{joint}_penetration_m"] >= 0
    angle, radius = np.linspace(0, 2 * np.pi, POINTS), UM_PER_M * radial_clearance_m
    width, height = ORBIT_IN
    with mpl.rc_context(RC):
        picture = Picture(height, width)
        ax = picture.add_subplot()
        ax.plot(radius * np.cos(angle), radius * np.sin(angle), color="black", label="clearance circle")
        ax.plot(x, y, color=GREY, linewidth=0.7, label="centre of the pin")
        ax.plot(x[touching], y[touching], ".", color=VERMILLION, markersize=3, label="in contact")
        ax.plot(x.iloc[0], y.iloc[0], "o", color=BLUE, label="start")
        ax.set(
            title=f"{title}: pin {joint} in its bearing",
            xlabel="x from the centre of the bearing [µm]",
            ylabel="y from the centre of the bearing [µm]",
            aspect="equal",
        )
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4)
    return picture


def card(title: str, lines: Iterable[str], figure: Figure) -> str:
    """Return a run as a notebook shows it: its title, some lines and its figure, as HTML."""
    text = "".join(f"<li>{escape(line)}</li>" for line in lines)
    image = b64encode(picture_bytes(figure, ".png")).decode("ascii")
    source = f'src="data:image/png;base64,{image}" alt="{escape(title)} over time"'
    return f'<b>{escape(title)}</b><ul>{text}</ul><img {source} style="max-width: 60em; width: 100%">'


def _mark(ax: Axes, time_s: float, force_N: float, name: str) -> None:
    """Mark a force, with its name on the side where there is more room."""
    late = time_s > np.mean(ax.get_xlim())
    ax.plot(time_s, force_N, "o", color=COLOURS[4], zorder=5, label="_mark")
    ax.annotate(
        name,
        (time_s, force_N),
        (-7 if late else 7, 0),
        textcoords="offset points",
        ha="right" if late else "left",
        va="center",
        fontsize=7.5,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
    )


def _panels(frame: pd.DataFrame) -> dict[str, Mapping[str, pd.Series]]:
    """Return the curves of every panel by their names, the panels by their axis labels."""
    motion = [column for column in frame if column.startswith(OBSERVED)][:2]
    motion = motion or [slider if slider in frame else crank for slider, crank in MOTION.items()]
    panels: dict[str, Mapping[str, pd.Series]] = {axis_label(name): {"": frame[name]} for name in motion}
    panels |= _largest(FORCE, _forces(frame), MOST_FORCES)
    drivers = frame.columns.intersection(["driver_torque_N_m", "driver_force_N"])
    panels |= {axis_label(name): {"": frame[name]} for name in drivers}
    energies = [column for column in frame if ENERGY.fullmatch(column)]
    curves = {words(column)[0].removesuffix(" energy"): frame[column] for column in energies}
    return panels | _largest("energy [J]", curves, MOST_ENERGIES)


def _largest(label: str, curves: Mapping[str, pd.Series], most: int) -> dict[str, Mapping[str, pd.Series]]:
    """Return a panel of curves, or of so many with the largest numbers, and none without curves."""
    if len(curves) <= most:
        return {label: curves} if curves else {}
    kept = sorted(curves, key=lambda name: float(np.abs(curves[name]).max()))[-most:]
    return {f"{most} largest: {label}": {name: curves[name] for name in curves if name in kept}}


def _forces(frame: pd.DataFrame) -> dict[str, pd.Series]:
    """Return the sizes of the joint forces, and the normal forces of guides."""
    joints = [match[1] for column in frame if (match := JOINT_FORCE.fullmatch(column))]
    forces = {
        f"joint {joint}": np.hypot(frame[f"joint_{joint}_force_x_N"], frame[f"joint_{joint}_force_y_N"])
        for joint in joints
    }
    if "guide_normal_force_N" in frame:
        forces["guide, normal"] = frame["guide_normal_force_N"]
    for column in frame:
        if match := GUIDE_FORCE.fullmatch(column):
            forces[f"guide {match[1]}, normal"] = frame[column]
    return forces
