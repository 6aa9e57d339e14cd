"""Errors against one setting of an engine: one panel per quantity, one line per scene."""

import math
from collections.abc import Sequence

from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from reports.plots.step_figures import failed_entry, grid, mark_failures
from reports.quantities import Quantity
from reports.results import Run
from reports.style import label, variant


def against_setting(runs: Sequence[Run], setting: str, quantities: Sequence[Quantity]) -> Drawing:
    """Return the figure for runs of one engine; a crossed-out marker is a run that failed."""
    drawing, axes = grid(len(quantities))
    scenes = sorted({run.scene for run in runs})
    styles = {scene: variant(runs[0].engine, place) for place, scene in enumerate(scenes)}
    values = sorted({run.settings[setting] for run in runs})
    for ax, quantity in zip(axes, quantities, strict=True):
        ax.set_xlabel(setting)
        ax.set_ylabel(label(quantity.name))
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xticks(values, [str(value) for value in values], rotation=90)
        ax.set_xticks([], minor=True)
        row = 0
        for scene, style in styles.items():
            here = sorted((r for r in runs if r.scene == scene), key=lambda r: r.settings[setting])
            shown = [(r.settings[setting], e) for r in here if (e := quantity.value(r)) is not None and e > 0]
            if shown:
                ax.plot(*zip(*shown, strict=True), **style)
            failed = [r.settings[setting] for r in here if not r.ok]
            if failed:
                mark_failures(ax, failed, row, style)
                row += 1
        low, high = ax.get_ylim()
        ax.set_ylim(10 ** math.floor(math.log10(low)), 10 ** math.ceil(math.log10(high)))
        ax.yaxis.set_minor_locator(NullLocator())
    handles = [Line2D([], [], label=scene, **style) for scene, style in styles.items()]
    if any(not run.ok for run in runs):
        handles.append(failed_entry())
    drawing.legend(handles=handles, loc="outside lower center", ncols=len(handles), handlelength=3.2)
    return drawing
