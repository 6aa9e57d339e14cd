"""Accuracy with clearance: every engine against the solution of its own contact law, impact by impact."""

from collections.abc import Iterator
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd

from reports.chapters.accuracy_ideal import nearest
from reports.equal_error import from_coarse_to_fine
from reports.lines import MOST_LINES, Line, Panel, against, figure_of, shown_labels
from reports.look import axis_label, line_styles, number
from reports.page import Chapter, Figure, Table
from reports.results import (
    LOOSE,
    PEAK,
    RIGID,
    SLIDER,
    Results,
    Studies,
    accuracy,
    finished,
    uncertainty,
    value,
    with_columns,
)

INTRODUCTION = (
    "Each run is compared with the converged solution of the engine's own model: its error is numerical. The "
    "model form is the difference of that solution from the one of the scene's law. Errors are compared up "
    "to the time to which the reference solution is known."
)
#: The largest error of an impact's time, and of its impulse in percent of the largest impulse.
TIME, IMPULSE = "impact_time_error_s", "impulse_error_percent"
#: The impacts of a run with a partner, those of the reference solution without one, and those of the run.
MATCHED, MISSED, UNMATCHED = COUNTS = ["impacts_matched", "impacts_missed", "impacts_unmatched"]
#: The reference solution's line in the figure of an impact, and the samples shown before and after contact.
TRUE_LINE: dict[str, Any] = {"color": "#B9B9B9", "linewidth": 3.2, "zorder": 1.5}
MARGIN = 24


def parts(studies: Studies) -> Iterator[Figure | Table | None]:
    """Yield one impact from near, errors against the mean step, and what of impacts and models is off."""
    if studies["accuracy"].has_curves:
        yield first_impact(studies["accuracy"])
    rows = accuracy(studies, LOOSE, RIGID)
    if rows.empty:
        return
    rows = with_columns(rows, TIME, "impact_impulse_relative_error", *COUNTS)
    rows[IMPULSE] = 100 * rows["impact_impulse_relative_error"]
    finest = finished(from_coarse_to_fine(rows)).drop_duplicates(["scene", "label"], keep="last")
    best = rows[rows["joints"] == LOOSE]
    best = best[best["label"].isin(nearest(best, SLIDER)["label"])]
    by_signal = [against(best, column) for column in (SLIDER, PEAK, IMPULSE)]
    caption = (
        "Configurations that are an engine's best on a scene. Grey lines: order at the left end; grey "
        "areas are the uncertainty of the reference solution."
    )
    title = "How do the errors fall with the step?"
    across = min(3, max(map(len, by_signal)))
    yield figure_of("clearance-steps", title, caption, "accuracy", [*chain(*by_signal)], 2.2, across)
    yield impacts_by_configuration(finest)
    yield _models(rows)


def first_impact(results: Results) -> Figure | None:
    """Return the force of one impact over time and penetration, and its errors; None without runs of it."""
    rows = finished(with_columns(results.rows, "view").query("view == 'impact'"))
    if rows.empty:
        return None
    rows = rows[rows["label"].isin(shown_labels(rows)[: MOST_LINES - 1])]
    force, depth = "contact_B_normal_force_N", "contact_B_penetration_m"
    names = ("time_s", f"true_{depth}", f"true_{force}")
    time_s, true_depth, true_force = (results.curve(rows["case"].iloc[0], name) for name in names)
    since_us = 1e6 * (time_s - time_s[np.argmax(true_depth >= 0)])
    touching = np.flatnonzero(true_force > 0)
    around = slice(max(0, touching[0] - MARGIN), touching[-1] + MARGIN)
    drawn = [("reference solution", true_depth, true_force, TRUE_LINE)]
    errors, styles = [], line_styles(rows)
    for place, (case, label) in enumerate(zip(rows["case"], rows["label"], strict=True)):
        style = {**styles[label], "linewidth": 0.9, "markevery": (4 * place, MARGIN)}
        drawn.append((label, results.curve(case, depth), results.curve(case, force), style))
        size = results.curve(case, force.replace("_force_", "_force_error_"))[around]
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
    caption = (
        f"The first impact on {scene}: the curves lie on each other, the errors on the right do not. The "
        "area of the loop is the energy lost."
    )
    return figure_of("clearance-impact", title, caption, "accuracy", panels)


def impacts_by_configuration(runs: pd.DataFrame) -> Table:
    """Return the impacts found and their largest errors over all scenes."""
    of_label = runs.groupby(["joints", "label"], observed=True)
    table = of_label[COUNTS].sum().join(of_label[[TIME, PEAK, IMPULSE]].max()).reset_index()
    headings = {"label": "configuration", "joints": "joints", MATCHED: "impacts found", MISSED: "missed"}
    headings |= {UNMATCHED: "unmatched"}
    headings |= {name: axis_label(name).replace(" error", "") for name in (TIME, PEAK, IMPULSE)}
    title = "Errors of impacts, largest over all scenes"
    caption = (
        "Each configuration's finest run against the reference solution; unmatched are impacts that it does "
        "not have. A missed impact counts as 100 % in the peak force; rigid contact has no peak force."
    )
    formats: dict[str, Any] = {headings[name]: "{:.0f}".format for name in COUNTS} | {headings[TIME]: number}
    table = table[[*headings]].rename(columns=headings)
    return Table("clearance-impacts", title, caption, "accuracy", table, formats)


def _models(rows: pd.DataFrame) -> Table:
    """Return model form beside numerical error of each engine that solves another law."""
    rows = rows.assign(form=value(rows, SLIDER.replace("_error_", "_model_difference_")))
    rows = rows[rows["form"] > uncertainty(rows, SLIDER)]
    furthest = rows.sort_values("form").drop_duplicates("engine", keep="last")
    numerical = nearest(rows, SLIDER).groupby("engine")["error"].max()
    table = furthest.assign(error=furthest["engine"].map(numerical))[["engine", "scene", "form", "error"]]
    title = "Model form and numerical error of engines with contact laws of their own"
    caption = (
        "The largest difference of the engine's own model from the scene's law, and its best run's error."
    )
    table = table.rename(columns={"form": "model form [m]", "error": "numerical error [m]"})
    return Table("clearance-models", title, caption, "accuracy", table)


CHAPTER = Chapter("accuracy-clearance", "Accuracy with clearance", ("accuracy",), INTRODUCTION, parts)
