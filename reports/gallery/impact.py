"""One impact from near: force over time, over penetration, and how far each engine is from the truth."""

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure as Drawing
from matplotlib.ticker import LogLocator, NullLocator

from reports.gallery.data import of_view
from reports.gallery.drawing import WIDTH_IN
from reports.gallery.over_time import LEGEND_IN, TRUTH, legend
from reports.parts import Figure
from reports.results import Results
from reports.style import RC, labels, line_styles

US, UM, KN = 1e6, 1e6, 1e-3
#: Every so many samples a marker; an engine's first one is this much later than that of the one before.
EVERY, LATER = 24, 4
FORCE, DEPTH = "contact_B_normal_force_N", "contact_B_penetration_m"


def impact_figures(results: Results) -> list[Figure]:
    """Return the figures of the first impact by all engines, none without runs of it."""
    rows = of_view(results, "impact")
    if rows.empty:
        return []
    styles, scene = line_styles(rows), rows["scene"].iloc[0].removesuffix("-first-impact")
    with mpl.rc_context(RC):
        loops, misses = (Drawing(figsize=(WIDTH_IN, height + LEGEND_IN)) for height in (2.5, 2.1))
        over_time, over_depth = loops.subplots(1, 2, sharey=True)
        error_panel = misses.subplots()
        first = rows.iloc[0]["case"]
        depth, force = (results.curve(first, f"true_{name}") for name in (DEPTH, FORCE))
        time = results.curve(first, "time_s")
        touch = float(time[np.argmax(depth >= 0)])
        near = np.flatnonzero(force > 0)
        shown = slice(max(0, near[0] - EVERY), near[-1] + EVERY)
        over_time.plot(US * (time - touch)[shown], KN * force[shown], **TRUTH)
        over_depth.plot(UM * depth[near], KN * force[near], **TRUTH)
        for place, (_, row) in enumerate(rows.iterrows()):
            run, at = results.curve(row["case"], FORCE), results.curve(row["case"], DEPTH)
            style = {**styles[row["label"]], "markevery": (LATER * place, EVERY), "linewidth": 0.9}
            over_time.plot(US * (time - touch)[shown], KN * run[shown], **style)
            over_depth.plot(UM * at[near], KN * run[near], **style)
            off = results.curve(row["case"], "contact_B_normal_force_error_N")
            error_panel.plot(US * (time - touch)[shown], np.where(off > 0, off, np.nan)[shown], **style)
        over_time.set(xlabel="time since touch [µs]", ylabel="contact force [kN]")
        over_depth.set(xlabel="penetration [µm]")
        error_panel.set(
            xlabel="time since touch [µs]", ylabel="size of the error of\nthe contact force [N]", yscale="log"
        )
        error_panel.yaxis.set_major_locator(LogLocator(numticks=7))
        error_panel.yaxis.set_minor_locator(NullLocator())
        legend(loops, rows)
        legend(misses, rows, truth=False)
    named = ", ".join(labels(rows))
    return [
        Figure(
            "motions-impact",
            f"The first impact on {scene}",
            "Left over time since the truth's touch, right over penetration: along the upper branch as the "
            "pin goes in, back on the lower one as it comes out. The area between them is the "
            "energy lost. The truth is the broad grey line.",
            f"Contact force over time and over penetration, a loop. Lines: {named}.",
            loops,
        ),
        Figure(
            "motions-impact-error",
            f"Error of the contact force in the first impact on {scene}",
            "Against the truth of the engine's law at the same time, on a logarithmic axis: an "
            "engine that touches late is furthest off where the force is steepest.",
            f"Error of the contact force over time. Lines: {named}.",
            misses,
        ),
    ]
