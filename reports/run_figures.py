"""Figures of runs: motion, forces and energy over time, a pin in its clearance, a sweep over its fields."""

import re
from collections.abc import Mapping, Sequence
from textwrap import fill

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm, Normalize

from engine_models.scene.plain_words import BadInput
from reports.look import BLACK, BLUE, GREY, RC, VERMILLION, Picture, axis_label, words

#: Colours of the curves of one panel, Okabe and Ito's, and their dashes, which tell them apart in greyscale.
COLOURS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3)), (0, (7, 3)))
#: Height of a panel, of what is above and below all panels, in inches, and the characters of a line below
#: and of one beside a panel.
PANEL_IN, MARGINS_IN, LINE, LABEL = 1.45, 1.0, 110, 24
#: The label of the panel of forces.
FORCE = "force [N]"
#: The slider's motion, and the crank's, which is shown of a pendulum.
MOTION = {"slider_position_m": "crank_angle_rad", "slider_velocity_m_s": "crank_speed_rad_s"}
ENERGY = re.compile(r"(kinetic|potential|dissipated)_energy_J|.+_work_J")
#: The most forces and energies of a panel: those with the largest numbers.
MOST_FORCES, MOST_ENERGIES = 6, len(COLOURS)
#: The colours of a map, and the ratio of its ends from which on an axis is logarithmic.
MAP_COLOURS, DECADES = "cividis", 30.0
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
            if mark is not None and label.endswith(FORCE):
                ax.plot(*mark[:2], "o", color=COLOURS[4], zorder=5, label=fill(mark[2], LABEL))
            if len(ax.lines) > 1:
                ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
        picture.align_ylabels(list(axes))
        axes[-1].set(xlabel=axis_label("time_s"), xlim=(frame.index[0], frame.index[-1]))
    return picture


def _panels(frame: pd.DataFrame) -> dict[str, Mapping[str, pd.Series]]:
    """Return the curves of every panel by their names, the panels by their axis labels."""
    motion = [column for column in frame if column.startswith("observed_")][:2]
    motion = motion or [slider if slider in frame else crank for slider, crank in MOTION.items()]
    forces = {}
    for column in frame:
        if joint := re.fullmatch(r"joint_(.+)_force_x_N", column):
            forces[f"joint {joint[1]}"] = np.hypot(frame[column], frame[column.replace("_x_N", "_y_N")])
        elif guide := re.fullmatch(r"(guide(?:_.+)?)_normal_force_N", column):
            forces[f"{guide[1].replace('_', ' ', 1)}, normal"] = frame[column]
    drivers = frame.columns.intersection(["driver_torque_N_m", "driver_force_N"])
    energies = {
        words(name)[0].removesuffix(" energy"): frame[name] for name in frame if ENERGY.fullmatch(name)
    }
    return {
        **{axis_label(name): {"": frame[name]} for name in motion},
        **_largest(FORCE, forces, MOST_FORCES),
        **{axis_label(name): {"": frame[name]} for name in drivers},
        **_largest("energy [J]", energies, MOST_ENERGIES),
    }


def _largest(label: str, curves: Mapping[str, pd.Series], most: int) -> dict[str, Mapping[str, pd.Series]]:
    """Return a panel of curves, or of so many with the largest numbers, and none without curves."""
    if len(curves) <= most:
        return {label: curves} if curves else {}
    kept = sorted(curves, key=lambda name: float(np.abs(curves[name]).max()))[-most:]
    return {f"{most} largest: {label}": {name: curves[name] for name in curves if name in kept}}


def orbit_plot(frame: pd.DataFrame, joint: str, radial_clearance_m: float, title: str) -> Picture:
    """Return the figure of a joint's gap, from the bearing's centre to the pin's, in a table of samples."""
    x, y = (UM_PER_M * frame[f"clearance_{joint}_{axis}_m"] for axis in "xy")
    touching = frame[f"contact_{joint}_penetration_m"] >= 0
    angle, radius = np.linspace(0, 2 * np.pi, 361), UM_PER_M * radial_clearance_m
    with mpl.rc_context(RC):
        picture = Picture(5.0, 5.2)
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


def sweep_picture(frame: pd.DataFrame, fields: Sequence[str], title: str, show: str | None = None) -> Picture:
    """Return the picture of a sweep's rows over the one or two fields that differ: points, or coloured ones.

    It shows the column ``show``, or the largest contact force, or that of the first joint. Of several members
    at a place of a map it shows the mean.

    Raises:
        BadInput: other numbers of fields differ, or no member has a number in the column.
    """
    if not 1 <= len(fields) <= 2:
        raise BadInput(f"plot: expected one or two fields that differ, got {len(fields)}")
    first = ["largest_contact_force_N", *frame.filter(regex="^largest_joint_")]
    column = show or next((name for name in first if name in frame), first[0])
    if column not in frame or frame[column].isna().all():
        raise BadInput(f"plot: expected members with a number in {column}, got none")
    rows = frame.dropna(subset=column)
    with mpl.rc_context({**RC, "axes.formatter.limits": (-3, 4)}):  # clearances are small
        picture = Picture(3.5) if len(fields) == 1 else Picture(4.6, 6.2)
        ax = picture.add_subplot(xlabel=axis_label(fields[0]), xscale=_scale(rows[fields[0]]))
        if len(fields) == 1:
            ax.set(ylabel=axis_label(column), yscale=_scale(rows[column]))
            ax.plot(rows[fields[0]], rows[column], ".", color=BLACK)
        else:
            ax.set(ylabel=axis_label(fields[1]), yscale=_scale(rows[fields[1]]))
            places = rows.groupby(list(fields))[column].mean().reset_index()
            norm = LogNorm() if _scale(rows[column]) == "log" else Normalize()
            x, y, numbers = (places[name] for name in (*fields, column))
            drawn = ax.scatter(x, y, c=numbers, norm=norm, cmap=MAP_COLOURS, s=25, linewidths=0)
            picture.colorbar(drawn, label=axis_label(column), pad=0.02)
        failed = int((frame["status"] != "ok").sum())
        picture.suptitle(f"{title}: {len(frame)} members" + (f", {failed} failed" if failed else ""), size=9)
    return picture


def _scale(values: pd.Series) -> str:
    """Return the kind of axis for numbers."""
    return "log" if values.min() > 0 and values.max() >= DECADES * values.min() else "linear"
