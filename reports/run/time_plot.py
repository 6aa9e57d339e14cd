"""A run over time: position, velocity, forces and energy, as far as its scene has them."""

import re
from collections.abc import Mapping
from textwrap import fill

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from reports.run.picture import COLOURS, DASHES, Picture
from reports.style import RC, axis_label, words

#: Height of a panel and of what is above and below all, in inches; characters of a line below.
PANEL_IN, MARGINS_IN, LINE = 1.45, 1.0, 110
FORCE = "force [N]"
MOTION = {"slider_position_m": "crank_angle_rad", "slider_velocity_m_s": "crank_speed_rad_s"}
JOINT_FORCE = re.compile(r"joint_(\w)_force_x_N")
ENERGY = re.compile(r"(kinetic|potential|dissipated)_energy_J|\w+_work_J")

Curves = Mapping[str, pd.Series]


def time_plot(
    frame: pd.DataFrame, title: str, quality: str, mark: tuple[float, float, str] | None = None
) -> Picture:
    """Return the figure of a table of samples whose index is the time in s, its quality below in words.

    ``mark`` is a time, a force in N there, and what to call it.
    """
    panels = _panels(frame)
    with mpl.rc_context(RC):
        picture = Picture(PANEL_IN * len(panels) + MARGINS_IN)
        picture.suptitle(title, fontsize=10)
        picture.supxlabel(fill(quality, LINE), fontsize=7.5, color="#555555")
        axes = picture.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
        for ax, (label, curves) in zip(axes, panels.items(), strict=True):
            ax.set_ylabel(label)
            for (name, curve), colour, dashes in zip(curves.items(), COLOURS, DASHES, strict=False):
                ax.plot(frame.index, curve, label=name, color=colour, linestyle=dashes)
            if len(curves) > 1:
                ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
            if mark is not None and label == FORCE:
                _mark(ax, *mark)
        picture.align_ylabels(list(axes))
        axes[-1].set(xlabel=axis_label("time_s"), xlim=(frame.index[0], frame.index[-1]))
    return picture


def _mark(ax: Axes, time_s: float, force_N: float, name: str) -> None:
    """Mark a force, and name it on the side of the marker that has more room."""
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


def _panels(frame: pd.DataFrame) -> dict[str, Curves]:
    """Return the curves of every panel by its axis label; a pendulum's motion is its crank's."""
    motion = [slider if slider in frame else crank for slider, crank in MOTION.items()]
    panels: dict[str, Curves] = {axis_label(column): {"": frame[column]} for column in motion}
    panels[FORCE] = _forces(frame)
    if "driver_torque_N_m" in frame:
        panels[axis_label("driver_torque_N_m")] = {"": frame["driver_torque_N_m"]}
    energies = [column for column in frame if ENERGY.fullmatch(column)]
    panels["energy [J]"] = {words(column)[0].removesuffix(" energy"): frame[column] for column in energies}
    return panels


def _forces(frame: pd.DataFrame) -> Curves:
    """Return the sizes of the joint forces, and the normal force of the guide."""
    joints = [match[1] for column in frame if (match := JOINT_FORCE.fullmatch(column))]
    forces = {
        f"joint {joint}": np.hypot(frame[f"joint_{joint}_force_x_N"], frame[f"joint_{joint}_force_y_N"])
        for joint in joints
    }
    return forces | (
        {"guide, normal": frame["guide_normal_force_N"]} if "guide_normal_force_N" in frame else {}
    )
