"""Figures of the energy study."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from reports.chapters.energy.rungs import LASTING, LONG, UNACCOUNTED, longest, resolution
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
#: part of the energy in play has a panel of its own.
SEEN, MISSING = 1e-3, 1e-3
#: Panels have one scale if the largest is not so many times the smallest.
ALIKE = 4.0
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


def by_step(rows: pd.DataFrame) -> Iterator[Figure]:
    """Yield what is gained or lost against the mean step, and without clearance its rate."""
    # A run that chooses its steps and did not finish has none to stand at.
    rows = rows[(rows["status"] == "ok") | rows["tolerance"].isna()]
    rows = rows[
        ~(rows["scene"].str.endswith((LONG, LASTING)) & own_scenes(rows))
    ]  # the short have every rung
    rows = rows.assign(hidden_power_W=rows["hidden_power_W"].abs().where(rows["significant"]))
    for of, column, name, title, axis, reading in (
        (
            rows,
            "largest_numerical_gain_J",
            "energy-gain-by-step",
            "Energy gained or lost against the step",
            "largest energy\ngained or lost [J]",
            "The most that a run gains or loses includes what swings and comes back.",
        ),
        (
            rows[~rows["has_clearance"]],
            "hidden_power_W",
            "energy-hidden-power-by-step",
            "Hidden power against the step",
            "hidden power, size [W]",
            "Shown are scenes without clearance, at steps where it is told from zero.",
        ),
    ):
        panels = panels_of(of, column)
        if not panels:
            continue
        drawing = against_step(of, panels, orders=(1, 3, 5))
        for ax in drawing.axes:
            ax.set(xlabel="mean step [s]", ylabel=axis)
        yield Figure(
            name,
            title,
            f"{reading} Both axes are logarithmic; the step is the mean one where an engine chooses its own. "
            "Grey lines have the slope of the order written at their fine end.",
            f"{len(panels)} log-log panels over the step on {', '.join(of['scene'].unique())}. "
            f"Lines: {', '.join(labels(of))}.",
            drawing,
        )


def growth(results: Results, at_rung: pd.DataFrame) -> Iterator[Figure]:
    """Yield the gaps of the constraints over time, and their speeds, on scenes without clearance."""
    rows = finished(longest(at_rung[~at_rung["has_clearance"]]))
    if rows.empty or not results.has_curves:
        return
    for curve, name, what, axis in (
        ("constraint_violation_so_far_m", "gaps", "gaps of the constraints", "largest gap so far [m]"),
        (
            "constraint_speed_so_far_m_s",
            "gap-speeds",
            "speeds at which gaps open",
            "largest gap speed so far [m/s]",
        ),
    ):
        yield Figure(
            f"energy-{name}-over-time",
            f"{what.capitalize()} over time",
            f"At {_resolutions(rows)}. Both axes are logarithmic, so that a power of time is a straight "
            "line. Shown is the largest up to each time.",
            f"Log-log panels over time of {what} on {', '.join(rows['scene'].unique())}. "
            f"Lines: {', '.join(labels(rows))}.",
            _growth(results, rows, curve, axis),
        )


def _growth(results: Results, rows: pd.DataFrame, name: str, axis: str) -> Drawing:
    scenes, styles = list(rows.groupby("scene")), line_styles(rows)
    drawing, axes = grid(len(scenes))
    for ax, (scene, of_scene) in zip(axes, scenes, strict=True):
        ax.set(title=scene, xlabel=axis_label("time_s"), ylabel=axis)
        for case, label in zip(of_scene["case"], of_scene["label"], strict=True):
            time, curve = results.curve(case, "time_s"), results.curve(case, name)
            at = np.unique(np.geomspace(1, len(time) - 1, GROWTH_POINTS).round().astype(int))
            mark(ax.loglog(time[at], np.where(curve[at] > 0, curve[at], np.nan), **styles[label]), label)
    engine_legend(drawing, rows, failures=False)
    return drawing


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
    tops = [ax.get_ylim()[1] for ax in axes]
    for ax, own in zip(axes, tops, strict=True):
        ax.set_ylim(0, max(tops) if max(tops) < ALIKE * min(tops) else own)
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
        "are left out. Shown are the first arm of each engine, and those that hide more than a thousandth of "
        "the energy in play; "
        "where they differ much each panel has a scale of its own.",
        f"{len(rows)} panels over time with stacked losses and a line. Panels: {', '.join(labels(rows))}.",
        drawing,
    )


def _worth_a_panel(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the first arm of each engine and those whose ledger visibly does not close."""
    return rows[~rows["engine"].duplicated() | (rows[UNACCOUNTED] > MISSING)]


def _way(name: str) -> str:
    """Return a loss in words by its column."""
    return name.removesuffix("_J").replace("_", " ")


def _look(name: str) -> tuple[str, str]:
    """Return face and hatch of a loss by its column."""
    return WAYS[next(way for way in WAYS if way in name)]


def _resolutions(rows: pd.DataFrame) -> str:
    return "; ".join(f"{resolution(of_scene)} on {scene}" for scene, of_scene in rows.groupby("scene"))
