"""Signals over one revolution beside the truth, and how far each engine is from it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

from reports.gallery.data import angle_deg, envelope, extremes, has, joints_with_clearance, of_view
from reports.gallery.drawing import WIDTH_IN
from reports.parts import Figure
from reports.plots.step_figures import grid
from reports.results import Results
from reports.style import RC, labels, line_styles
from reports.tables import listed

#: The truth's line: broad and pale, behind those of all engines.
TRUTH: dict[str, Any] = {"color": "#B9B9B9", "linewidth": 3.2, "zorder": 1.5}
TURN = "crank's turn [°]"
MARKERS, LEGEND_IN = 4, 0.75
#: Room for an entry of the legend.
KEY_IN = 2.2


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


def signal_figures(results: Results, rows: pd.DataFrame, signal: Signal) -> Iterator[Figure]:
    """Yield a signal and its error, a panel for each scene; nothing where no run has it.

    ``rows`` are finished runs over a revolution.
    """
    rows = rows[[has(row, signal.error) for _, row in rows.iterrows()]]
    if rows.empty:
        return
    kind = "clearance" if signal is DEVIATION else "ideal"
    scenes = f"over the crank's angle: {listed(rows['scene'].unique())}."
    with mpl.rc_context(RC):
        drawn, errors = _values(results, rows, signal), _errors(results, rows, signal)
    yield Figure(
        f"motions-{signal.name}-{kind}",
        f"{signal.title} over one revolution",
        "Every engine's run, on the truth as a broad grey line.",
        f"Panels of the {signal.title.lower()} {scenes}",
        drawn,
    )
    yield Figure(
        f"motions-{signal.name}-error-{kind}",
        f"{signal.title} over one revolution: errors",
        "The largest in each sixtieth of the run, on a logarithmic axis. No step is longer than the "
        "distance of two samples.",
        f"Logarithmic panels of errors {scenes}",
        errors,
    )


def _values(results: Results, rows: pd.DataFrame, signal: Signal) -> Drawing:
    drawing, panels = _over_turn(rows, signal.axis)
    for ax, of in panels:
        first = of.iloc[0]
        true = signal.scale * results.curve(first["case"], f"true_{signal.column}")
        ax.plot(*extremes(angle_deg(results, first), true), **TRUTH)
        for _, row in of.iterrows():
            value = signal.scale * results.curve(row["case"], signal.column)
            ax.plot(*extremes(angle_deg(results, row), value), **_marked(rows, row["label"]))
    legend(drawing, rows)
    return drawing


def _errors(results: Results, rows: pd.DataFrame, signal: Signal) -> Drawing:
    drawing, panels = _over_turn(rows, f"error [{signal.error_unit}]")
    for ax, of in panels:
        for _, row in of.iterrows():
            size = np.abs(results.curve(row["case"], signal.error))
            ax.plot(*envelope(angle_deg(results, row), size), **_marked(rows, row["label"]))
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(numticks=6))
        ax.yaxis.set_minor_locator(NullLocator())
    legend(drawing, rows, truth=False)
    return drawing


def _over_turn(rows: pd.DataFrame, axis: str) -> tuple[Drawing, list[tuple[Axes, pd.DataFrame]]]:
    """Return a figure with a panel over the crank's turn for each scene, and each with the scene's rows."""
    scenes = list(rows.groupby("scene"))
    drawing, axes = grid(len(scenes), height_in=2.0)
    for ax, (scene, _) in zip(axes, scenes, strict=True):
        ax.set(title=scene, xlabel=TURN, ylabel=axis)
        ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 3, 6, 10]))
    return drawing, [(ax, of) for ax, (_, of) in zip(axes, scenes, strict=True)]


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


def legend(drawing: Drawing, rows: pd.DataFrame, truth: bool = True) -> None:
    """Put all labels among rows below a figure, and the truth if its line is drawn, in a few columns."""
    styles = line_styles(rows)
    handles = [Line2D([], [], label="truth", **TRUTH)] if truth else []
    handles += [Line2D([], [], label=label, **styles[label]) for label in labels(rows)]
    across = int(drawing.get_figwidth() // KEY_IN)
    drawing.legend(handles=handles, loc="outside lower center", ncols=across, fontsize=8)


def _marked(rows: pd.DataFrame, label: str) -> dict[str, Any]:
    """Return a label's style with a few markers on its line, which lie beside those of the other labels."""
    styles, part = line_styles(rows), 1 / MARKERS
    return {
        **styles[label],
        "markevery": (part * list(styles).index(label) / len(styles), part),
        "linewidth": 1.0,
    }
