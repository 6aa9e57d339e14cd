"""Figures of the predictability study."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from reports.chapters.predictability import data
from reports.chapters.predictability.comparison import Verdict
from reports.chapters.predictability.statistics import student_interval
from reports.plots.series import mark
from reports.plots.step_figures import engine_legend, grid
from reports.plots.time_figures import so_far
from reports.results import FloatArray, Results
from reports.style import BLACK, BLUE, GREY, VERMILLION, line_styles

#: Nothing closer than this is drawn, in m: it is round-off.
LEAST_M = 1e-14
#: Bins of the impact phase, in degrees.
BIN_DEG = 30


def growth(results: Results, rows: pd.DataFrame) -> Drawing:
    """Return how the reference's twins part from it, one panel per scene, horizons marked."""
    drawing, axes = grid(len(rows), height_in=2.3)
    for ax, (_, row) in zip(axes, rows.iterrows(), strict=True):
        names = [f"perturbed_{k}_m" for k in range(int(row["perturbations"]))]
        each = np.array([so_far(results.curve(row["case"], name)) for name in names])
        turns = row["revolutions"] > 0
        unit = row["end_time_s"] / row["revolutions"] if turns else 1.0
        time = results.curve(row["case"], "time_s") / unit
        least, most = (_drawn(end(axis=0)) for end in (each.min, each.max))
        band = ax.fill_between(time, least, most, color=GREY, alpha=0.5)
        mark([band], "perturbed (all)")
        mark(ax.plot(time, _drawn(np.median(each, axis=0)), color=BLACK), "perturbed (median)")
        halved = _drawn(so_far(results.curve(row["case"], "halved_m")))
        mark(ax.plot(time, halved, color=BLUE, linestyle="--"), "step halved")
        for words, (_, tolerance) in data.TOLERANCES.items():
            ax.axhline(tolerance, color=GREY, linewidth=0.6, linestyle=":")
            _mark_horizon(ax, row, words, tolerance, unit)
        ax.set(yscale="log", ylim=(LEAST_M, 1e-2), xlim=(0, row["end_time_s"] / unit), title=row["scene"])
        ax.set(xlabel="crank revolutions" if turns else "time [s]", ylabel="distance so far [m]")
        ax.yaxis.set_minor_locator(NullLocator())
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


def _mark_horizon(ax: Axes, row: pd.Series, words: str, tolerance: float, unit: float) -> None:
    """Put the median horizon with its interval on the tolerance's line; an open end goes to the edge."""
    median, least, most = (row[f"horizon_{words}{part}_s"] for part in ("", "_least", "_largest"))
    if math.isnan(least):
        return
    most = row["end_time_s"] if math.isnan(most) else most
    ax.plot([least / unit, most / unit], [tolerance] * 2, color=VERMILLION, linewidth=2)
    if not math.isnan(median):
        ax.plot(median / unit, tolerance, marker="D", markersize=4, color=VERMILLION)


def exponents(results: Results, by_scene: Mapping[str, pd.DataFrame]) -> Drawing | None:
    """Return exponents against the length of the run, a panel for each scene whose every start has one."""
    whole = {scene: of for scene, of in by_scene.items() if len(data.measured(of)) == len(of) > 1}
    if not whole:
        return None
    drawing, axes = grid(len(whole), height_in=2.3)
    for ax, (scene, starts) in zip(axes, whole.items(), strict=True):
        used = np.arange(1.0, math.floor(starts["revolutions"].min()))
        each = np.array([_so_far(results, row, used) for _, row in starts.iterrows()])
        intervals = [student_interval(values) for values in each.T]
        ax.plot(used, each.T, color=GREY, linewidth=0.6)
        ax.fill_between(
            used,
            [of.low for of in intervals],
            [of.high for of in intervals],
            color=BLUE,
            alpha=0.3,
            linewidth=0,
        )
        ax.plot(used, [of.mean for of in intervals], color=BLACK, linewidth=1.6)
        ax.axhline(0.0, color=VERMILLION, linewidth=0.8, linestyle="--")
        ax.set(title=scene, xlabel="revolutions used", ylabel="exponent per revolution")
    handles = [
        Line2D([], [], color=BLACK, linewidth=1.6, label="mean"),
        Patch(color=BLUE, alpha=0.3, linewidth=0, label="its 95 % interval"),
        Line2D([], [], color=GREY, linewidth=0.6, label="a start"),
        Line2D([], [], color=VERMILLION, linewidth=0.8, linestyle="--", label="zero"),
    ]
    drawing.legend(handles=handles, loc="outside lower center", ncols=4)
    return drawing


def _so_far(results: Results, row: pd.Series, used: FloatArray) -> FloatArray:
    """Return a start's exponents from the first revolutions ``used`` after the one that is left out."""
    time, growth = results.curve(row["case"], "time_s"), results.curve(row["case"], "log_growth")
    grown = np.interp(np.append(0.0, used) + 1.0, time * row["revolutions"] / time[-1], growth)
    return np.asarray((grown[1:] - grown[0]) / used)


def differences(verdicts: Sequence[Verdict]) -> Drawing:
    """Return the difference of every quantity in units of its margin, one panel per pair of ensembles."""
    drawing, axes = grid(len(verdicts), height_in=2.4)
    ends = [end for each in verdicts if each.decides for of in each.differences for end in (of.low, of.high)]
    reach = 1.1 * max(1.0, *np.abs(ends)) if ends else 1.1
    for ax, verdict in zip(axes, verdicts, strict=True):
        ax.axvspan(-1, 1, color=GREY, alpha=0.25, linewidth=0)
        ax.axvline(0.0, color=GREY, linewidth=0.8)
        for place, difference in enumerate(verdict.differences if verdict.decides else ()):
            ax.plot([difference.low, difference.high], [place] * 2, color=BLACK, linewidth=2)
            ax.plot(difference.mean, place, marker="o", color=BLACK)
        if not verdict.decides:
            ax.text(0.5, 0.5, verdict.words, transform=ax.transAxes, ha="center", va="center", fontsize=8)
        names = [data.QUANTITIES[quantity].split(" [")[0] for quantity in verdict.quantities]
        # One scale for all, so that the names are needed once in a row.
        ax.set(xlim=(-reach, reach), ylim=(len(names) - 0.5, -0.5))
        spec = ax.get_subplotspec()
        ax.set_yticks(range(len(names)), names if spec is None or spec.is_first_col() else [])
        ax.set(xlabel="difference / margin")
        ax.set_title(verdict.pair.label, fontsize=8)
    return drawing


def phases(results: Results, by_label: data.Ensembles) -> Drawing:
    """Return the impacts of a revolution by crank angle, each ensemble beside its twin's."""
    pairs = data.pairs(by_label)
    drawing, axes = grid(len(pairs), height_in=2.6)
    edges = np.arange(0, 361, BIN_DEG)
    members = pd.concat([frame for pair in pairs for frame in (pair.members, pair.of_twin)])
    styles = line_styles(members)
    for ax, pair in zip(axes, pairs, strict=True):
        both = ((-0.18, pair.label, pair.members), (0.18, pair.twin, pair.of_twin))
        for shift, label, of_label in both:
            counts = np.array([_counts(results, row, edges) for _, row in of_label.iterrows()])
            means = [student_interval(column) for column in counts.T]
            at = (edges[:-1] + edges[1:]) / 2 + shift * BIN_DEG
            middle = np.array([mean.mean for mean in means])
            ends = np.array([[mean.mean - mean.low, mean.high - mean.mean] for mean in means]).T
            how = {**styles[label], "linestyle": ""}
            mark(ax.errorbar(at, middle, ends, elinewidth=1.2, **how).get_children(), label)
        ax.set_xticks(range(0, 361, 90))
        ax.set_ylim(bottom=0)
        ax.set(xlabel="crank angle at impact [°]", ylabel=f"impacts per revolution in {BIN_DEG}°")
        ax.set_title(pair.label, fontsize=8)
    engine_legend(drawing, members, failures=False)
    return drawing


def _counts(results: Results, row: pd.Series, edges: NDArray[np.int_]) -> FloatArray:
    phase = results.curve(row["case"], "impact_phase_rad")
    return np.asarray(np.histogram(np.degrees(phase), edges)[0] / row["revolutions"])
