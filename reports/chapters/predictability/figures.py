"""Figures of the predictability study."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from reports.chapters.predictability import data
from reports.chapters.predictability.statistics import mean_interval, student_interval
from reports.plots.step_figures import engine_legend, grid
from reports.plots.time_figures import so_far
from reports.results import FloatArray, Results, Run
from reports.style import BLACK, BLUE, GREY, VERMILLION, WIDTH_IN, line_style

#: Nothing closer than this is drawn, in m: it is round-off.
LEAST_M = 1e-14
#: Bins of the impact phase, in degrees.
BIN_DEG = 30
_SMALL: dict[str, Any] = {"linestyle": "", "markersize": 3, "alpha": 0.55, "markeredgewidth": 0.6}


def growth(results: Results, runs: Sequence[Run]) -> Drawing:
    """Return how the reference's twins part from it, one panel per scene, horizons marked."""
    drawing, axes = grid(len(runs), height_in=2.3)
    for ax, run in zip(axes, runs, strict=True):
        curves = [results.curve(run, f"perturbed_{k}_m") for k in range(int(run.values["perturbations"]))]
        time, halved = results.curve(run, "time_s"), results.curve(run, "halved_m")
        assert time is not None
        assert halved is not None
        turns = run.values.get("revolutions")
        unit = run.values["end_time_s"] / turns if turns else 1.0
        each = np.array([so_far(curve) for curve in curves if curve is not None])
        low, high = _drawn(each.min(axis=0)), _drawn(each.max(axis=0))
        ax.fill_between(time / unit, low, high, color=GREY, alpha=0.5)
        ax.plot(time / unit, _drawn(np.median(each, axis=0)), color=BLACK)
        ax.plot(time / unit, _drawn(so_far(halved)), color=BLUE, linestyle="--")
        for words, (_, tolerance) in data.TOLERANCES.items():
            ax.axhline(tolerance, color=GREY, linewidth=0.6, linestyle=":")
            _mark_horizon(ax, run.values, words, tolerance, unit)
        ax.set_yscale("log")
        ax.set_ylim(LEAST_M, 1e-2)
        ax.yaxis.set_minor_locator(NullLocator())
        ax.set_xlim(0, run.values["end_time_s"] / unit)
        ax.set_xlabel("crank revolutions" if turns else "time [s]")
        ax.set_ylabel("distance so far [m]")
        ax.set_title(run.scene)
    handles = [
        Line2D([], [], color=BLACK, label="perturbed (median)"),
        Patch(color=GREY, alpha=0.5, label="perturbed (all)"),
        Line2D([], [], color=BLUE, linestyle="--", label="step halved"),
        Line2D([], [], color=VERMILLION, marker="D", markersize=4, label="horizon and its interval"),
    ]
    drawing.legend(handles=handles, loc="outside lower center", ncols=4)
    return drawing


def _drawn(distance: FloatArray) -> FloatArray:
    return np.maximum(distance, LEAST_M)


def _mark_horizon(ax: Axes, values: Mapping[str, float], words: str, tolerance: float, unit: float) -> None:
    """Put the median horizon with its interval on the tolerance's line; an open end goes to the edge."""
    at, least = (values.get(f"horizon_{words}{part}_s") for part in ("", "_least"))
    if least is None:
        return
    most = values.get(f"horizon_{words}_largest_s", values["end_time_s"])
    ax.plot([least / unit, most / unit], [tolerance] * 2, color=VERMILLION, linewidth=2)
    if at is not None:
        ax.plot(at / unit, tolerance, marker="D", markersize=4, color=VERMILLION)


def exponents(found: Mapping[str, Sequence[Run]]) -> Drawing:
    """Return the exponents of all starts, with mean and interval, a line per scene."""
    drawing = Drawing(figsize=(WIDTH_IN, 0.34 * len(found) + 1.1))
    ax = drawing.add_subplot()
    for place, starts in enumerate(found.values()):
        values = data.measured(starts)
        ax.plot(values, [place] * len(values), marker="o", color=BLACK, fillstyle="none", **_SMALL)
        if len(values) > 1:
            mean = student_interval(values)
            ax.plot([mean.low, mean.high], [place + 0.25] * 2, color=BLACK, linewidth=2)
            ax.plot(mean.mean, place + 0.25, marker="D", color=BLACK)
        if len(values) < len(starts):
            settled = f"{len(starts) - len(values)} of {len(starts)} starts settle: no exponent"
            ax.annotate(settled, (0.15, place), va="center", fontsize=8)
    ax.set_yticks(range(len(found)), list(found))
    ax.set_ylim(len(found) - 0.4, -0.6)
    ax.set_xlim(left=0)
    ax.set_xlabel("Lyapunov exponent per revolution (open: a start; filled: mean and 95 % interval)")
    return drawing


def distributions(found: data.Ensembles) -> Drawing:
    """Return every quantity's members and mean with its interval, one panel per quantity."""
    quantities, names = data.shown(found), list(found)
    drawing, axes = grid(len(quantities), height_in=0.5 + 0.24 * len(names))
    for ax, quantity in zip(axes, quantities, strict=True):
        for place, name in enumerate(names):
            style = line_style(name, names)
            values = data.matrix(found[name], [quantity])[:, 0]
            mean = mean_interval(values)
            ax.plot(values, [place - 0.3] * len(values), marker="|", color=style["color"], **_SMALL)
            ax.plot([mean.low, mean.high], [place] * 2, color=style["color"], linewidth=2)
            ax.plot(mean.mean, place, **{**style, "linestyle": "", "markersize": 6})
        ax.set_ylim(len(names) - 0.4, -0.6)
        ax.set_yticks([])
        ax.set_xlabel(data.QUANTITIES[quantity])
    engine_legend(drawing, names, failures=False)
    return drawing


def phases(results: Results, found: data.Ensembles) -> Drawing:
    """Return the impacts of a revolution by crank angle, each engine beside its model twin."""
    pairs = data.compared(found)
    drawing, axes = grid(len(pairs), height_in=2.6)
    edges = np.arange(0, 361, BIN_DEG)
    names = [name for name in found if any(name in pair for pair in pairs)]
    for ax, pair in zip(axes, pairs, strict=True):
        for shift, name in zip((-0.18, 0.18), pair, strict=True):
            counts = np.array([_counts(results, run, edges) for run in found[name]])
            means = [mean_interval(column) for column in counts.T]
            at = (edges[:-1] + edges[1:]) / 2 + shift * BIN_DEG
            style = {**line_style(name, names), "linestyle": ""}
            middle = np.array([mean.mean for mean in means])
            ends = np.array([[mean.mean - mean.low, mean.high - mean.mean] for mean in means]).T
            ax.errorbar(at, middle, ends, elinewidth=1.2, label=f"{name[0]} ({name[1]})", **style)
        ax.set_xticks(range(0, 361, 90))
        ax.set_ylim(bottom=0)
        ax.set_xlabel("crank angle at impact [°]")
        ax.set_ylabel(f"impacts per revolution in {BIN_DEG}°")
    engine_legend(drawing, names, failures=False)
    return drawing


def _counts(results: Results, run: Run, edges: np.ndarray) -> FloatArray:
    phase = results.curve(run, "impact_phase_rad")
    assert phase is not None
    return np.histogram(np.degrees(phase), edges)[0] / run.values["revolutions"]


def picture(results: Results, runs: Sequence[Run], arm: str) -> Drawing:
    """Return what a pin does in every revolution against clearance or speed: three panels of points."""
    drawing = Drawing(figsize=(WIDTH_IN, 3.2))
    panels = (
        ("gap_y_part", 1.0, "pin's height at 90° / clearance"),
        ("impact_phase_rad", 180 / np.pi, "crank angle at impact [°]"),
        ("impact_speed_m_s", 1.0, "impact speed [m/s]"),
    )
    for place, (column, scale, words) in enumerate(panels):
        ax = drawing.add_subplot(1, 3, place + 1)
        for run in runs:
            curve = results.curve(run, column)
            assert curve is not None
            at = np.full(len(curve), swept(run, arm))
            ax.plot(at, scale * curve, linestyle="", marker=".", markersize=1.8, color=BLACK, alpha=0.7)
        if arm == data.CLEARANCES:
            ax.set_xscale("log")
        ax.set_xlim(*_room([swept(run, arm) for run in runs], arm == data.CLEARANCES))
        if column == "impact_phase_rad":
            ax.set_yticks(range(0, 361, 90))
        ax.set_xlabel("radial clearance [mm]" if arm == data.CLEARANCES else "crank speed [rev/min]")
        ax.set_ylabel(words)
    return drawing


def _room(at: Sequence[float], logarithmic: bool) -> tuple[float, float]:
    """Return limits a little beyond the points."""
    if logarithmic:
        return min(at) / 1.2, max(at) * 1.2
    return min(at) - 0.03 * max(at), max(at) * 1.03


def swept(run: Run, arm: str) -> float:
    """Return a point's clearance in mm or speed in rev/min."""
    if arm == data.CLEARANCES:
        return 1e3 * run.values["radial_clearance_m"]
    return run.values["crank_speed_rad_s"] * 60 / (2 * np.pi)
