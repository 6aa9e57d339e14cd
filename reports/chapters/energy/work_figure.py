"""The figure of where the driver's work goes on a scene with clearance."""

from collections.abc import Sequence

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from reports.chapters.energy.figures import arms
from reports.chapters.energy.runs import DISSIPATED, at_rung, has_clearance, resolution
from reports.parts import Figure
from reports.plots.step_figures import grid
from reports.results import FloatArray, Results, Run
from reports.style import BLACK, GREY, WIDTH_IN, label, title

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


def driver_work(results: Results, runs: Sequence[Run], scene: str, rung: float) -> list[Figure]:
    """Return where the work of a scene's driver goes, a panel for each arm: losses stacked below the work."""
    here = [run for run in at_rung(runs, {scene: rung}) if run.ok and has_clearance(run)]
    here = _worth_a_panel([run for run in here if "driver_work_J" in run.values])
    if not here:
        return []
    drawing, axes = grid(len(here), height_in=1.9)
    used: list[str] = []
    for ax, run in zip(axes, here, strict=True):
        time = _curve(results, run, "time_s")
        base = np.zeros(len(time))
        work = _curve(results, run, "driver_work_J")
        for name in (name for name in run.values if name.endswith("_loss_J")):
            if abs(run.values[name]) < SEEN * np.abs(work).max():
                continue
            top = base + _curve(results, run, name)
            face, hatch = _look(name)
            ax.fill_between(time, base, top, facecolor=face, hatch=hatch, edgecolor="#5A5A5A", linewidth=0.3)
            base, used = top, [*used, name]
        stored = sum(_curve(results, run, name) for name in run.values if name.endswith("_change_J"))
        ax.plot(time, work - stored, color=BLACK, linewidth=1.4)
        ax.set_title(title(run.name))
        ax.set_xlabel(label("time_s"))
        ax.set_ylabel("energy [J]")
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
    return [
        Figure(
            f"energy-driver-work-{scene}",
            f"Where the driver's work goes on {scene}",
            f"At {resolution(runs, scene, rung)}. Losses are stacked. The line is the work that is not "
            "stored in motion, height or contacts: it ends on the top of the stack if the ledger closes, "
            "above it if the method loses energy, below it if it makes some. Losses below a thousandth are "
            "left out. Shown are the first arm of each engine, and those with more than a hundredth missing.",
            f"{len(here)} panels over time with stacked losses and a line. Panels: {arms(here)}.",
            drawing,
        )
    ]


def _worth_a_panel(runs: Sequence[Run]) -> list[Run]:
    """Return the first arm of each engine and those whose ledger visibly does not close."""
    first = {run.engine: run for run in reversed(runs)}
    return [
        run
        for run in runs
        if run is first[run.engine]
        or abs(run.values["mean_hidden_power_W"]) > MISSING * run.values[DISSIPATED]
    ]


def _look(name: str) -> tuple[str, str]:
    """Return face and hatch of a loss by its column."""
    return WAYS[next(way for way in WAYS if way in name)]


def _curve(results: Results, run: Run, name: str) -> FloatArray:
    curve = results.curve(run, name)
    assert curve is not None, f"a run with the column {name} has its curve"
    return curve
