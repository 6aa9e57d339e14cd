"""Accuracy with clearance: every engine against the solution of its own contact law, impact by impact."""

import re
from collections.abc import Iterator

import numpy as np
import pandas as pd

from reports import shared_tables
from reports.analysis.equal_error import from_coarse_to_fine
from reports.parts import Chapter, Figure, Finding, Number, Studies, Table
from reports.plots.panels import MOST_LINES, Line, Panel, against, by_signal, draw, shown_labels
from reports.quantities import PEAK, finished, motion_error, uncertainty, value, with_forces, with_largest
from reports.results import Results, with_columns
from reports.shared_tables import CASE, head, heading, signal
from reports.style import line_styles, words
from reports.tables import ABSENT, error, number, span

STUDY, MOTIONS = "clearance", "motions"
INTRODUCTION = (
    "Each run is compared with the converged solution of the engine's own model: its error is numerical. The "
    "model form is the difference of that solution from the one of the scene's law. Errors are compared up "
    "to the time to which the reference solution is known."
)
CONTACT, TIME = "contact_force_error_N", "impact_time_error_s"
PEAK_N = "impact_force_error_N"
#: The largest error of an impact's impulse in percent of the largest impulse.
IMPULSE = "impulse_error_percent"
#: The impacts of a run with a partner and without one, and those of the reference solution without one.
COUNTS = ("impacts_matched", "impacts_unmatched", "impacts_missed")
#: The reference solution's line in the figure of an impact, and the samples shown before and after contact.
REFERENCE = {"color": "#B9B9B9", "linewidth": 3.2, "zorder": 1.5}
MARGIN = 24


def findings(studies: Studies) -> Iterator[Finding]:
    """Yield how far the reference solutions are from a second code, and how many runs finished."""
    if STUDY not in studies:
        return
    rows = prepare(studies[STUDY])
    yield from filter(None, (cross_check(rows, motion_error(rows)), shared_tables.reliability(rows)))


def figures(studies: Studies) -> Iterator[Figure | None]:
    """Yield one impact from near, and errors of motion and impacts against the mean step."""
    if MOTIONS in studies and studies[MOTIONS].has_curves:
        yield first_impact(studies[MOTIONS])
    if STUDY not in studies:
        return
    rows = prepare(studies[STUDY])
    rows = rows[rows["label"].isin(shared_tables.nearest(rows, motion_error(rows))["label"])]
    title = "How do the errors fall with the step?"
    reading = (
        "Configurations that are an engine's best on a scene. Grey lines: order at the left end; grey "
        "areas are the uncertainty of the reference solution."
    )
    drawing = by_signal(rows, (motion_error(rows), PEAK, IMPULSE), against)
    yield Figure("clearance-steps", title, reading, STUDY, drawing) if drawing else None


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield the errors of impacts and of models, and the numbers behind them as files."""
    if STUDY not in studies:
        return
    rows = prepare(studies[STUDY])
    yield table.on_page() if (table := impacts_by_configuration(rows)).rows else None
    yield laws_by_engine(rows)
    yield smallest_errors(rows)
    yield impacts_by_scene(rows)
    yield from shared_tables.runs_tables(rows, STUDY)


def prepare(results: Results) -> pd.DataFrame:
    """Return the rows with the largest contact force error of all joints, and with errors in percent.

    A scene is ``compliant`` if its impacts have a peak force, which they have not on rigid walls.
    """
    rows = with_largest(with_forces(results.rows), CONTACT, r"contact_\w+_normal_force_error_N")
    columns = (motion_error(rows), TIME, PEAK_N, "impact_impulse_relative_error", *COUNTS)
    rows = with_columns(rows, *columns)
    with_peak = rows[PEAK].notna().groupby(rows["scene"]).transform("any")
    return rows.assign(**{IMPULSE: 100 * rows["impact_impulse_relative_error"], "compliant": with_peak})


def model_form(column: str) -> str:
    """Return the column of how far an engine's own model is from the scene's law, of a column of errors."""
    return column.replace("_error_", "_model_difference_")


def finest(rows: pd.DataFrame) -> pd.DataFrame:
    """Return of each configuration on each scene the finest run that finished."""
    scenes = [from_coarse_to_fine(of_scene) for _, of_scene in rows.groupby("scene")]
    return finished(pd.concat(scenes)).drop_duplicates(CASE, keep="last").sort_index()


def cross_check(rows: pd.DataFrame, column: str) -> Finding | None:
    """Return how far the reference engine's converged solution is from the reference solution at most."""
    name = column.replace("_error_", "_cross_check_")
    apart = value(rows, name).dropna()
    if apart.empty:
        return None
    worst, count = rows.loc[apart.idxmax(), "scene"], rows.loc[apart.index, "scene"].nunique()
    text = (
        "The reference solutions agree with a second code, the reference engine near round-off, to {most} in "
        f"{signal(column)} ({worst}, the worst of {count} scenes)."
    )
    return Finding("cross-check", text, most=Number(float(apart.max()), words(column)[1]))


def first_impact(motions: Results) -> Figure | None:
    """Return the force of one impact over time and penetration, and its errors; None without runs of it."""
    rows = finished(motions.rows[motions.rows["view"] == "impact"])
    if rows.empty:
        return None
    rows = rows[rows["label"].isin(shown_labels(rows)[: MOST_LINES - 1])]
    force = str(rows.filter(regex=r"^contact_\w+_normal_force_N$").max().idxmax())
    depth, off = force.replace("_normal_force_N", "_penetration_m"), force.replace("_force_", "_force_error_")
    names = ("time_s", f"true_{depth}", f"true_{force}")
    time_s, true_depth, true_force = (motions.curve(rows["case"].iloc[0], name) for name in names)
    since_us = 1e6 * (time_s - time_s[np.argmax(true_depth >= 0)])
    touching = np.flatnonzero(true_force > 0)
    around = slice(max(0, touching[0] - MARGIN), touching[-1] + MARGIN)
    drawn = [("reference solution", true_depth, true_force, REFERENCE)]
    errors, styles = [], line_styles(rows)
    for place, (case, label) in enumerate(zip(rows["case"], rows["label"], strict=True)):
        style = {**styles[label], "linewidth": 0.9, "markevery": (4 * place, MARGIN)}
        drawn.append((label, motions.curve(case, depth), motions.curve(case, force), style))
        size = motions.curve(case, off)[around]
        errors.append(Line(label, since_us[around], np.where(size > 0, size, np.nan), style))
    over_time = [Line(label, since_us[around], F[around] / 1e3, style) for label, _, F, style in drawn]
    over_depth = [Line(label, 1e6 * d[touching], F[touching] / 1e3, style) for label, d, F, style in drawn]
    time, axis = "time since touch [µs]", "contact force [kN]"
    panels = (
        Panel("", time, axis, over_time, log=""),
        Panel("", "penetration [µm]", axis, over_depth, log=""),
        Panel("", time, "contact force error [N]", errors, log="y"),
    )
    title = "How well do the engines agree on one impact?"
    scene = rows["scene"].iloc[0].removesuffix("-first-impact")
    reading = f"The first impact on {scene}. The area of the loop is the energy lost."
    return Figure("clearance-impact", title, reading, MOTIONS, draw(panels))


def impacts_by_configuration(rows: pd.DataFrame) -> Table:
    """Return the impacts found and their largest errors over all scenes, of the finest runs."""
    runs = finest(rows).dropna(subset="impacts_matched")
    of_label = runs.groupby("label", observed=True)
    kinds = {"found, compliant contact": runs["compliant"], "found, rigid walls": ~runs["compliant"]}
    found = pd.DataFrame({name: _found(runs[kind]) for name, kind in kinds.items()})
    worst = of_label[[TIME, PEAK, IMPULSE]].max()
    cells = {
        "configuration": list(worst.index),
        **found.dropna(axis="columns", how="all").reindex(worst.index).fillna(ABSENT),
        "not in the reference solution": of_label["impacts_unmatched"].sum().map("{:.0f}".format),
        heading(TIME): worst[TIME].map(number),
        **{heading(name): [span([size]) for size in worst[name]] for name in (PEAK, IMPULSE)},
    }
    title = "Errors of impacts, largest over all scenes"
    reading = (
        "Each configuration's finest run against the reference solution. A missed impact counts as 100 % in "
        "the peak force; rigid contact has no peak force, and the last bounces before rest are missed."
    )
    return Table.of("clearance-impact-errors", title, reading, STUDY, cells)


def _found(runs: pd.DataFrame) -> "pd.Series[str]":
    """Return by label how many of all impacts are found."""
    sums = runs.groupby("label", observed=True)[list(COUNTS)].sum().astype(int)
    matched, missed = sums["impacts_matched"], sums["impacts_missed"]
    return matched.astype(str) + " of " + (matched + missed).astype(str)


def laws_by_engine(rows: pd.DataFrame) -> Table:
    """Return model form beside numerical error of each engine, each on the scene where it is largest."""
    column = motion_error(rows)
    rows = rows.assign(form=value(rows, model_form(column)))
    own = rows["form"].groupby(rows["label"], observed=True).transform("max") > 0
    cells = []
    for (engine, own_law), runs in rows.groupby([rows["engine"], own], sort=False):
        best = shared_tables.nearest(runs, column)
        if len(best):
            worst, most = best.loc[best["error"].idxmax()], ABSENT
            if own_law:
                furthest = runs.loc[runs["form"].idxmax()]
                most = f"{number(furthest['form'])} ({furthest['scene']})"
            numerical = f"{error(worst['error'], worst['doubt'])} ({worst['scene']})"
            cells.append((engine, "its own" if own_law else "the scene's", most, numerical))
    unit = words(column)[1]
    names = ["engine", "law solved", f"model form [{unit}]", f"numerical error [{unit}]"]
    title = "Model form and numerical error by engine"
    reading = (
        f"The largest difference in {signal(column)} of the engine's own model from the scene's law, and the "
        "error of the best run on the scene where it is largest."
    )
    cells_by_name = pd.DataFrame(cells, columns=names)
    table = Table.of("clearance-laws-by-engine", title, reading, STUDY, cells_by_name)
    return table.on_page() if own.any() else table


def smallest_errors(rows: pd.DataFrame) -> Table:
    """Return each configuration's smallest errors on each scene, until when they are such, and model form."""
    motion = motion_error(rows)
    columns = [motion, CONTACT, PEAK_N]
    rows = with_columns(rows[rows["status"] != "unsupported"], model_form(motion))
    # Between rigid walls an error that is zero compares nothing.
    cells = shared_tables.smallest_errors(rows.assign(**rows[columns].where(rows[columns] > 0)), columns)
    most = rows.assign(until=value(rows, "compared_until_s"), form=value(rows, model_form(motion)))
    most = most.groupby(list(CASE), sort=False)[["until", "form"]].max()
    cells.insert(len(CASE), "compared until [s]", list(most["until"].map(number)))
    cells[f"model form [{words(motion)[1]}]"] = list(most["form"].map(number))
    return Table.of(
        "clearance-smallest-errors", "Smallest errors", shared_tables.not_judged(rows), STUDY, cells
    )


def impacts_by_scene(rows: pd.DataFrame) -> Table:
    """Return how the impacts of each configuration's finest run match those of the reference solution."""
    runs = finest(rows).dropna(subset="impacts_matched")
    errors = list(runs.filter(regex=r"^impact_\w+_error"))
    doubts = {name: uncertainty(runs, name) for name in errors}
    cells = {
        **head(runs, *CASE, "step_s"),
        **{name.removeprefix("impacts_"): runs[name].map("{:.0f}".format) for name in COUNTS},
        **{
            re.sub("^impact ", "", heading(name)): list(map(error, runs[name], doubts[name]))
            for name in errors
        },
    }
    reading = (
        "Unmatched are impacts of the run without a partner, missed those of the reference solution. Errors "
        "without a unit are relative."
    )
    return Table.of("clearance-impacts", "Impacts matched one to one", reading, STUDY, cells)


CHAPTER = Chapter(
    "accuracy-clearance",
    "Accuracy with clearance",
    (STUDY, MOTIONS),
    INTRODUCTION,
    findings,
    figures,
    tables,
)
