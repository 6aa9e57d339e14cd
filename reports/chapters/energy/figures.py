"""Figures of the energy study."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, NullFormatter

from reports.chapters.energy.runs import (
    GAIN,
    LONG,
    POWER,
    at_rung,
    has_clearance,
    is_told,
    longest,
    resolution,
    tolerance,
)
from reports.parts import Figure
from reports.plots.step_figures import against_step, engine_legend, grid, panels_of
from reports.plots.time_figures import over_time
from reports.quantities import column
from reports.results import FloatArray, Results, Run
from reports.style import label, line_style, ordered, title

#: Points of a growing gap: evenly spaced on the logarithmic scale of time.
GROWTH_POINTS = 14


def gain_over_time(results: Results, runs: Sequence[Run], rungs: Mapping[str, float]) -> list[Figure]:
    """Return the energy that no physics accounts for, over time on each scene's middle rung."""
    here = [run for run in longest(at_rung(runs, rungs)) if run.ok]
    if not here:
        return []
    drawing = over_time(
        results, here, "numerical_gain_so_far_J", "energy gained or lost\nso far [J]", _itself
    )
    return [
        Figure(
            "energy-gain-over-time",
            "Energy that no physics accounts for",
            f"At {_at(here, rungs)}. Shown is the largest size up to each time: a line that keeps rising "
            "is power that the method makes or takes, a level one swings and comes back.",
            f"Panels over time on {_scenes(here)}. Lines: {arms(here)}.",
            drawing,
        )
    ]


def by_step(runs: Sequence[Run]) -> list[Figure]:
    """Return what is gained or lost, and without clearance its rate, against the mean step."""
    # A run that chooses its steps and did not finish has none to stand at.
    told = [_sized(run) for run in runs if run.ok or tolerance(run) is None]
    told = [run for run in told if not run.scene.endswith(LONG)]  # the short ones have every rung
    ideal = [run for run in told if not has_clearance(run)]
    panels = [*panels_of(told, [GAIN]), *panels_of(ideal, [column(POWER)])]
    if not panels:
        return []
    drawing = against_step(told, panels, orders=(1, 3, 5))
    for ax, (_, quantity) in zip(drawing.axes, panels, strict=True):
        ax.set_xlabel("mean step [s]")
        power = quantity.name == POWER
        ax.set_ylabel("hidden power, size [W]" if power else "largest energy\ngained or lost [J]")
        _few_labels(ax)
    return [
        Figure(
            "energy-by-step",
            "Energy gained or lost, and its rate, against the step",
            "Both axes are logarithmic; the step is the mean one where an engine chooses its own. What a run "
            "gains or loses at most includes what swings and comes back; hidden power does not. It is shown "
            "for scenes without clearance, at steps where it is told from zero. Grey lines have the slope of "
            "the order written at their fine end.",
            f"{len(panels)} log-log panels over the step on {_scenes(told)}. Lines: {arms(told)}.",
            drawing,
        )
    ]


def growth(results: Results, runs: Sequence[Run], rungs: Mapping[str, float]) -> list[Figure]:
    """Return gap and gap speed of the constraints over time, on scenes without clearance."""
    here = [run for run in longest(at_rung(runs, rungs)) if run.ok and not has_clearance(run)]
    scenes = list(dict.fromkeys(run.scene for run in here))
    if not scenes:
        return []
    names = ordered(run.name for run in here)
    drawing, axes = grid(2 * len(scenes))
    wanted = [
        (scene, name)
        for name in ("constraint_violation_so_far_m", "constraint_speed_so_far_m_s")
        for scene in scenes
    ]
    for ax, (scene, name) in zip(axes, wanted, strict=True):
        ax.set_title(scene)
        ax.set_xlabel(label("time_s"))
        ax.set_ylabel("largest gap so far [m]" if name.endswith("_m") else "largest gap speed so far [m/s]")
        for run in here:
            time, curve = results.curve(run, "time_s"), results.curve(run, name)
            if run.scene == scene and time is not None and curve is not None:
                at = np.unique(np.geomspace(1, len(time) - 1, GROWTH_POINTS).round().astype(int))
                shown = np.where(curve[at] > 0, curve[at], np.nan)
                ax.loglog(time[at], shown, **line_style(run.name, names))
    engine_legend(drawing, names, failures=False)
    return [
        Figure(
            "energy-drift-over-time",
            "Drift of the constraints",
            f"At {_at(here, rungs)}. Both axes are logarithmic, so "
            "that a power of time is a straight line: gaps above, the speeds at which they open below.",
            f"{len(wanted)} log-log panels over time on {', '.join(scenes)}. Lines: {arms(here)}.",
            drawing,
        )
    ]


def _sized(run: Run) -> Run:
    """Return the run with the size of its hidden power in place of the power, without if it may be zero."""
    others = {name: value for name, value in run.values.items() if name != POWER}
    power = {POWER: abs(run.values[POWER])} if run.ok and is_told(run) else {}
    return replace(run, values={**others, **power})


def _few_labels(ax: Axes) -> None:
    """Label so few steps that the numbers do not overlap, but more than one."""
    low, high = ax.get_xlim()
    ax.set_xlim(0.75 * low, high)  # room for the guides' numbers
    digits = (1.0, 2.0, 5.0) if high < 10 * low else (1.0, 3.0) if high < 50 * low else (1.0,)
    ax.xaxis.set_major_locator(LogLocator(subs=digits))
    ax.xaxis.set_major_formatter(LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf)))
    ax.xaxis.set_minor_formatter(NullFormatter())


def _itself(curve: FloatArray, _: Run) -> FloatArray:
    return curve


def _at(runs: Sequence[Run], rungs: Mapping[str, float]) -> str:
    scenes = dict.fromkeys(run.scene for run in runs)
    return "; ".join(f"{resolution(runs, scene, rungs[scene])} on {scene}" for scene in scenes)


def _scenes(runs: Sequence[Run]) -> str:
    return ", ".join(sorted({run.scene for run in runs}))


def arms(runs: Sequence[Run]) -> str:
    """Return the engines and arms of runs in words, in the order of legends."""
    return ", ".join(title(name) for name in ordered(run.name for run in runs))
