"""Signals over one revolution beside the truth, and how far each engine is from it."""

from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from reports.gallery.data import angle_deg, envelope, extremes, has, joints_with_clearance, of_view
from reports.gallery.drawing import WIDTH_IN
from reports.parts import Figure
from reports.results import Results
from reports.style import RC, labels, line_styles
from reports.tables import listed

#: The truth's line: broad and pale, behind those of all engines.
TRUTH: dict[str, Any] = {"color": "#B9B9B9", "linewidth": 3.2, "zorder": 1.5}
TURN = "crank's turn [°]"
MARKERS, LEGEND_IN = 4, 0.75


@dataclass(frozen=True)
class Signal:
    """A column shown in another unit, ``scale`` of which are one of its own, and its errors in its own."""

    name: str
    title: str
    column: str
    error: str
    axis: str
    error_unit: str
    scale: float = 1.0


POSITION = Signal(
    "slider-position",
    "Slider position",
    "slider_position_m",
    "slider_position_error_m",
    "slider\nposition [mm]",
    "m",
    1e3,
)
VELOCITY = Signal(
    "slider-velocity",
    "Slider velocity",
    "slider_velocity_m_s",
    "slider_velocity_error_m_s",
    "slider\nvelocity [m/s]",
    "m/s",
)
JOINT = Signal(
    "joint-force",
    "Force in joint B",
    "joint_B_force_N",
    "joint_B_force_error_N",
    "force in\njoint B [kN]",
    "N",
    1e-3,
)
TORQUE = Signal(
    "driver-torque",
    "Driver torque",
    "driver_torque_N_m",
    "driver_torque_error_N_m",
    "driver\ntorque [N·m]",
    "N·m",
)
DEVIATION = Signal(
    "deviation",
    "Slider's deviation from the ideal mechanism",
    "slider_deviation_m",
    "slider_position_error_m",
    "slider's\ndeviation [µm]",
    "m",
    1e6,
)


def signal_figure(results: Results, rows: pd.DataFrame, signal: Signal) -> Figure | None:
    """Return a row of two panels for each scene: the signal, and its error; None where no run has it.

    ``rows`` are finished runs over a revolution.
    """
    rows = rows[[has(row, signal.error) for _, row in rows.iterrows()]]
    if rows.empty:
        return None
    styles, scenes = line_styles(rows), list(rows.groupby("scene"))
    with mpl.rc_context(RC):
        drawing = Drawing(figsize=(WIDTH_IN, 1.75 * len(scenes) + LEGEND_IN))
        for (left, right), (scene, of) in zip(
            drawing.subplots(len(scenes), 2, squeeze=False), scenes, strict=True
        ):
            first = of.iloc[0]
            true = signal.scale * results.curve(first["case"], f"true_{signal.column}")
            left.plot(*extremes(angle_deg(results, first), true), **TRUTH)
            for _, row in of.iterrows():
                turn, style = angle_deg(results, row), _marked(styles, row["label"])
                value = signal.scale * results.curve(row["case"], signal.column)
                left.plot(*extremes(turn, value), **style)
                right.plot(*envelope(turn, np.abs(results.curve(row["case"], signal.error))), **style)
            right.set_yscale("log")
            right.yaxis.set_major_locator(LogLocator(numticks=6))
            right.yaxis.set_minor_locator(NullLocator())
            left.set(ylabel=signal.axis)
            right.set(ylabel=f"error [{signal.error_unit}]")
            left.set_title(scene, loc="left")
            for ax in (left, right):
                ax.set(xlabel=TURN)
                ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 3, 6, 10]))
        legend(drawing, rows)
    return Figure(
        f"motions-{signal.name}-{'clearance' if signal is DEVIATION else 'ideal'}",
        f"{signal.title} over one revolution",
        "Left every engine's run, on the truth as a broad grey line; right its error, the largest "
        "in each sixtieth of the run, on a logarithmic axis. No step is longer than the distance of two "
        "samples.",
        f"{len(scenes)} rows of two panels over the crank's angle: {listed(scene for scene, _ in scenes)}.",
        drawing,
    )


def contact_force_figures(results: Results) -> list[Figure]:
    """Return for each scene with compliant contacts the contact force of every engine beside the truth."""
    rows = of_view(results, "revolution")
    rows = rows[rows["shortest_contact_s"] > 0]
    return [
        _contact_force(results, scene, of, joint)
        for scene, of in rows.groupby("scene")
        for joint in joints_with_clearance(of.iloc[0])
    ]


def _contact_force(results: Results, scene: str, rows: pd.DataFrame, joint: str) -> Figure:
    styles, column = line_styles(rows), f"contact_{joint}_normal_force_N"
    with mpl.rc_context(RC):
        drawing = Drawing(figsize=(WIDTH_IN, 1.12 * len(rows) + 0.75))
        panels = drawing.subplots(len(rows), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for ax, (_, row) in zip(panels, rows.iterrows(), strict=True):
            turn, style = angle_deg(results, row), styles[row["label"]]
            true = results.curve(row["case"], f"true_{column}") / 1e3
            run = results.curve(row["case"], column) / 1e3
            ax.plot(*extremes(turn, true), **TRUTH, label="truth")
            ax.plot(*extremes(turn, run), color=style["color"], linewidth=0.9, label=row["label"])
            ax.set_title(row["label"], loc="left", color=style["color"], fontsize=8.5, pad=3)
        panels[-1].set(xlabel=TURN)
        drawing.supylabel(f"contact force in joint {joint} [kN]", fontsize=8.5)
    return Figure(
        f"motions-contact-force-{scene}-{joint}",
        f"Contact force over one revolution on {scene}",
        "A panel for each engine, its force on the truth of the law that it solves, the broad grey line: "
        "where grey shows, the engine is elsewhere.",
        f"{len(rows)} panels of contact force over the crank's angle: {', '.join(labels(rows))}.",
        drawing,
    )


def legend(drawing: Drawing, rows: pd.DataFrame) -> None:
    """Put the truth and all labels among rows below a figure, in two columns."""
    styles = line_styles(rows)
    handles = [Line2D([], [], label="truth", **TRUTH)]
    handles += [Line2D([], [], label=label, **styles[label]) for label in labels(rows)]
    drawing.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=8)


def _marked(styles: dict[str, Any], label: str) -> dict[str, Any]:
    """Return a label's style with a few markers on its line, which lie beside those of the other labels."""
    part = 1 / MARKERS
    return {
        **styles[label],
        "markevery": (part * list(styles).index(label) / len(styles), part),
        "linewidth": 1.0,
    }
