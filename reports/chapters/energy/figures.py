"""Figures of the energy study."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, NullFormatter

from reports.chapters.energy.rungs import LASTING, LONG, longest, resolution
from reports.parts import Figure
from reports.plots.series import mark
from reports.plots.step_figures import against_step, engine_legend, grid, panels_of
from reports.plots.time_figures import over_time
from reports.quantities import finished, own_scenes
from reports.results import Results
from reports.style import BLACK, GREY, WIDTH_IN, axis_label, labels, line_styles

#: Points of a growing gap: evenly spaced on the logarithmic scale of time.
GROWTH_POINTS = 14
#: Grey and hatch of what a contact loses, and of what stabilisation removes, told apart without colour.
WAYS = {
    "normal": ("#BDBDBD", ""),
    "friction": ("#E8E8E8", "////"),
    "clipped": ("#F7F7F7", "xxxx"),
    "stabilisation": ("#969696", "...."),
}
#: A loss below this part of what is not stored is too thin to draw; an arm that hides more than the other
#: part of what contacts dissipate has a panel of its own.
SEEN, MISSING = 1e-3, 1e-2
WORK = "driver's work less energy stored"


def gain_over_time(results: Results, at_rung: pd.DataFrame) -> Figure | None:
    """Return the energy that no physics accounts for, over time; ``at_rung`` has one rung for each scene."""
    rows = finished(longest(at_rung))
    if rows.empty or not results.has_curves:
        return None
    return Figure(
        "energy-gain-over-time",
        "Energy that no physics accounts for",
        f"At {_resolutions(rows)}. Shown is the largest size up to each time: a line that keeps rising "
        "is power that the method makes or takes, a level one swings and comes back.",
        f"Panels over time on {', '.join(rows['scene'].unique())}. Lines: {', '.join(labels(rows))}.",
        over_time(results, rows, "numerical_gain_so_far_J", "energy gained or lost\nso far [J]"),
    )


def by_step(rows: pd.DataFrame) -> Figure | None:
    """Return what is gained or lost, and without clearance its rate, against the mean step."""
    # A run that chooses its steps and did not finish has none to stand at.
    rows = rows[(rows["status"] == "ok") | rows["tolerance"].isna()]
    rows = rows[
        ~(rows["scene"].str.endswith((LONG, LASTING)) & own_scenes(rows))
    ]  # the short have every rung
    rows = rows.assign(hidden_power_W=rows["hidden_power_W"].abs().where(rows["significant"]))
    panels = [
        *panels_of(rows, ["largest_numerical_gain_J"]),
        *panels_of(rows[~rows["has_clearance"]], ["hidden_power_W"]),
    ]
    if not panels:
        return None
    drawing = against_step(rows, panels, orders=(1, 3, 5))
    for ax, (_, column) in zip(drawing.axes, panels, strict=True):
        power = column == "hidden_power_W"
        ax.set_xlabel("mean step [s]")
        ax.set_ylabel("hidden power, size [W]" if power else "largest energy\ngained or lost [J]")
        _few_labels(ax)
    scenes = ", ".join(rows["scene"].unique())
    return Figure(
        "energy-by-step",
        "Energy gained or lost, and its rate, against the step",
        "Both axes are logarithmic; the step is the mean one where an engine chooses its own. What a run "
        "gains or loses at most includes what swings and comes back; hidden power does not. It is shown "
        "for scenes without clearance, at steps where it is told from zero. Grey lines have the slope of "
        "the order written at their fine end.",
        f"{len(panels)} log-log panels over the step on {scenes}. Lines: {', '.join(labels(rows))}.",
        drawing,
    )


def growth(results: Results, at_rung: pd.DataFrame) -> Figure | None:
    """Return gap and gap speed of the constraints over time, on scenes without clearance."""
    rows = finished(longest(at_rung[~at_rung["has_clearance"]]))
    if rows.empty or not results.has_curves:
        return None
    scenes, styles = rows["scene"].unique().tolist(), line_styles(rows)
    drawing, axes = grid(2 * len(scenes))
    curves = {
        "constraint_violation_so_far_m": "largest gap so far [m]",
        "constraint_speed_so_far_m_s": "largest gap speed so far [m/s]",
    }
    panels = [(scene, curve) for curve in curves for scene in scenes]
    for ax, (scene, name) in zip(axes, panels, strict=True):
        ax.set(title=scene, xlabel=axis_label("time_s"), ylabel=curves[name])
        of_scene = rows[rows["scene"] == scene]
        for case, label in zip(of_scene["case"], of_scene["label"], strict=True):
            time, curve = results.curve(case, "time_s"), results.curve(case, name)
            at = np.unique(np.geomspace(1, len(time) - 1, GROWTH_POINTS).round().astype(int))
            mark(ax.loglog(time[at], np.where(curve[at] > 0, curve[at], np.nan), **styles[label]), label)
    engine_legend(drawing, rows, failures=False)
    return Figure(
        "energy-drift-over-time",
        "Drift of the constraints",
        f"At {_resolutions(rows)}. Both axes are logarithmic, so "
        "that a power of time is a straight line: gaps above, the speeds at which they open below.",
        f"{len(panels)} log-log panels over time on {', '.join(scenes)}. Lines: {', '.join(labels(rows))}.",
        drawing,
    )


def driver_work(results: Results, at_rung: pd.DataFrame) -> Figure | None:
    """Return where the work of a scene's driver goes, a panel for each arm: losses stacked below the work.

    ``at_rung`` are the scene's rows at one rung.
    """
    rows = finished(at_rung)
    rows = _worth_a_panel(rows[rows["has_clearance"] & rows["driver_work_J"].notna()])
    if rows.empty or not results.has_curves:
        return None
    drawing, axes = grid(len(rows), height_in=1.9)
    used: list[str] = []
    for ax, (_, row) in zip(axes, rows.iterrows(), strict=True):
        time, present = results.curve(row["case"], "time_s"), row.dropna().index
        base = np.zeros(len(time))
        work = sum(results.curve(row["case"], name) for name in present if name.endswith("_work_J"))
        stored = sum(results.curve(row["case"], name) for name in present if name.endswith("_change_J"))
        for name in (name for name in present if name.endswith("_loss_J")):
            if abs(row[name]) < SEEN * np.abs(work - stored).max():
                continue
            top = base + results.curve(row["case"], name)
            face, hatch = _look(name)
            edge: Any = {"hatch": hatch, "edgecolor": "#5A5A5A", "linewidth": 0.3}
            mark([ax.fill_between(time, base, top, facecolor=face, **edge)], _way(name))
            base, used = top, [*used, name]
        mark(ax.plot(time, work - stored, color=BLACK, linewidth=1.4), WORK)
        ax.set(title=row["label"], xlabel=axis_label("time_s"), ylabel="energy [J]")
    highest = max(ax.get_ylim()[1] for ax in axes)
    for ax in axes:
        ax.set_ylim(0, highest)
    handles: list[Line2D | Patch] = [Line2D([], [], color=BLACK, label=WORK)]
    for name in dict.fromkeys(used):
        face, hatch = _look(name)
        handles.append(Patch(facecolor=face, hatch=hatch, edgecolor=GREY, label=_way(name)))
    drawing.set_size_inches(WIDTH_IN, drawing.get_size_inches()[1])
    drawing.legend(handles=handles, loc="outside lower center", ncols=3)
    scene = rows["scene"].iloc[0]
    return Figure(
        f"energy-driver-work-{scene}",
        f"Where the driver's work goes on {scene}",
        f"At {resolution(at_rung)}. Losses are stacked. The line is the work that is not "
        "stored in motion, height or contacts: it ends on the top of the stack if the ledger closes, "
        "above it if the method loses energy, below it if it makes some. Losses below a thousandth of it "
        "are left out. Shown are the first arm of each engine, and those with more than a hundredth missing.",
        f"{len(rows)} panels over time with stacked losses and a line. Panels: {', '.join(labels(rows))}.",
        drawing,
    )


def _worth_a_panel(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the first arm of each engine and those whose ledger visibly does not close."""
    open_by = rows["mean_hidden_power_W"].abs() / rows["dissipated_power_W"]
    return rows[~rows["engine"].duplicated() | (open_by > MISSING)]


def _way(name: str) -> str:
    """Return a loss in words by its column."""
    return name.removesuffix("_J").replace("_", " ")


def _look(name: str) -> tuple[str, str]:
    """Return face and hatch of a loss by its column."""
    return WAYS[next(way for way in WAYS if way in name)]


def _few_labels(ax: Axes) -> None:
    """Label so few steps that the numbers do not overlap, but more than one."""
    low, high = ax.get_xlim()
    ax.set_xlim(0.75 * low, high)  # room for the guides' numbers
    digits = (1.0, 2.0, 5.0) if high < 10 * low else (1.0, 3.0) if high < 50 * low else (1.0,)
    ax.xaxis.set_major_locator(LogLocator(subs=digits))
    ax.xaxis.set_major_formatter(LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf)))
    ax.xaxis.set_minor_formatter(NullFormatter())


def _resolutions(rows: pd.DataFrame) -> str:
    return "; ".join(f"{resolution(of_scene)} on {scene}" for scene, of_scene in rows.groupby("scene"))
