"""The figure of where the driver's work goes on a scene with clearance."""

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from reports.chapters.energy.rungs import resolution
from reports.parts import Figure
from reports.plots.step_figures import grid
from reports.quantities import finished
from reports.results import Results
from reports.style import BLACK, GREY, WIDTH_IN, axis_label, labels

#: Grey and hatch of what a contact loses, and of what stabilisation removes, told apart without colour.
WAYS = {
    "normal": ("#BDBDBD", ""),
    "friction": ("#E8E8E8", "////"),
    "clipped": ("#F7F7F7", "xxxx"),
    "stabilisation": ("#969696", "...."),
}
#: A loss below this part of the driver's work is too thin to draw; an arm that hides more than the other part
#: of what contacts dissipate has a panel of its own.
SEEN, MISSING = 1e-3, 1e-2


def driver_work(results: Results, at_rung: pd.DataFrame) -> Figure | None:
    """Return where the work of a scene's driver goes, a panel for each arm: losses stacked below the work.

    ``at_rung`` are the scene's rows at one rung.
    """
    rows = finished(at_rung)
    rows = _worth_a_panel(rows[rows["has_clearance"] & rows["driver_work_J"].notna()])
    if rows.empty:
        return None
    drawing, axes = grid(len(rows), height_in=1.9)
    used: list[str] = []
    for ax, (_, row) in zip(axes, rows.iterrows(), strict=True):
        time, work = results.curve(row["case"], "time_s"), results.curve(row["case"], "driver_work_J")
        base, present = np.zeros(len(time)), row.dropna().index
        for name in (name for name in present if name.endswith("_loss_J")):
            if abs(row[name]) < SEEN * np.abs(work).max():
                continue
            top = base + results.curve(row["case"], name)
            face, hatch = _look(name)
            ax.fill_between(time, base, top, facecolor=face, hatch=hatch, edgecolor="#5A5A5A", linewidth=0.3)
            base, used = top, [*used, name]
        stored = sum(results.curve(row["case"], name) for name in present if name.endswith("_change_J"))
        ax.plot(time, work - stored, color=BLACK, linewidth=1.4)
        ax.set(title=row["label"], xlabel=axis_label("time_s"), ylabel="energy [J]")
    highest = max(ax.get_ylim()[1] for ax in axes)
    for ax in axes:
        ax.set_ylim(0, highest)
    handles: list[Line2D | Patch] = [Line2D([], [], color=BLACK, label="driver's work less energy stored")]
    for name in dict.fromkeys(used):
        face, hatch = _look(name)
        text = name.removesuffix("_J").replace("_", " ")
        handles.append(Patch(facecolor=face, hatch=hatch, edgecolor=GREY, label=text))
    drawing.set_size_inches(WIDTH_IN, drawing.get_size_inches()[1])
    drawing.legend(handles=handles, loc="outside lower center", ncols=3)
    scene = rows["scene"].iloc[0]
    return Figure(
        f"energy-driver-work-{scene}",
        f"Where the driver's work goes on {scene}",
        f"At {resolution(at_rung)}. Losses are stacked. The line is the work that is not "
        "stored in motion, height or contacts: it ends on the top of the stack if the ledger closes, "
        "above it if the method loses energy, below it if it makes some. Losses below a thousandth are "
        "left out. Shown are the first arm of each engine, and those with more than a hundredth missing.",
        f"{len(rows)} panels over time with stacked losses and a line. Panels: {', '.join(labels(rows))}.",
        drawing,
    )


def _worth_a_panel(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the first arm of each engine and those whose ledger visibly does not close."""
    open_by = rows["mean_hidden_power_W"].abs() / rows["dissipated_power_W"]
    return rows[~rows["engine"].duplicated() | (open_by > MISSING)]


def _look(name: str) -> tuple[str, str]:
    """Return face and hatch of a loss by its column."""
    return WAYS[next(way for way in WAYS if way in name)]
