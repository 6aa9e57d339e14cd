"""The page of a comparison on one scene."""

import math
from collections.abc import Iterator
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from reports.lines import MOST_LINES, Line, Panel, figure_of, shown_labels
from reports.look import axis_label, command, line_styles, words
from reports.page import Chapter, Claim, Figure, Made, Part, Table, Text, write_page
from reports.results import Results, Studies, quality_failures
from reports.standings import NAME, Standings, sentences, standings_table
from studies.judges.energy_rates import so_far

#: Markers on a curve over time.
MARKERS = 7


def write_comparison(folder: Path, results: Results, scene: str, given: str) -> None:
    """Write the page of the results on one scene, its figures and tables to a folder.

    ``scene`` is the scene as TOML, and ``given`` how it is typed in a command.
    """
    rest = partial(_parts, scene=scene, given=given)
    made = Made.of(Chapter("answer", "Recommendation", (NAME,), "", rest), {NAME: results})
    head = {"scene": given, "engines": ", ".join(dict.fromkeys(results.rows["engine"]))}
    title = f"Engines on {results.rows['scene'].iloc[0]}"
    write_page(folder, title, head, [made], {NAME: f"crankslider compare {given}"})


def _parts(studies: Studies, scene: str, given: str) -> Iterator[Part | None]:
    results = studies[NAME]
    standings = Standings.of(results.rows)
    for k, sentence in enumerate(sentences(standings, given)):
        yield Claim(str(k), sentence.replace("{", "{{").replace("}", "}}"))
    yield standings_table(standings)
    yield from _figures(results, standings)
    rows, axis = standings.recorded, axis_label(standings.column)
    table = rows[["label", "knob", "value", standings.column, "status"]].astype({"label": str})
    table = table.rename(columns={"label": "configuration", standings.column: axis})
    table["reason"] = rows["reason"].where(rows["reason"] != "", quality_failures(rows))
    table["command"] = [command(row, given) for _, row in rows.iterrows()]
    yield Table(f"{NAME}-all", "All runs", "", NAME, table)
    yield Text(f"<h2>The scene</h2><pre>{escape(scene)}</pre>")


def _figures(results: Results, standings: Standings) -> Iterator[Figure | None]:
    """Yield the errors against run time, and those of the runs in the table over time."""
    ran, runs, chosen = standings.settings, standings.runs, standings.chosen
    if chosen is None:
        return
    (what, _), axis = words(standings.column), axis_label(standings.column)
    labels = [*dict.fromkeys([*runs["label"], *shown_labels(ran)])][:MOST_LINES]
    styles = line_styles(ran[ran["label"].isin(labels)])
    lines = []
    for label, style in styles.items():
        own = ran[ran["label"] == label].sort_values("time_s", kind="stable")
        spread = np.array([0 * own["time_s"], own["last_s"] - own["time_s"]])
        lines.append(Line(label, own["time_s"], own["error"], style, [*own["setting"]], spread))
    marked: dict[str, Any] = {"level": standings.wanted, "rings": [(chosen.time_s, chosen.error)]}
    panels = [Panel("", "time of the solve [s]", axis, lines, floor=standings.floor, **marked)]
    question = f"Which setting reaches the {what} asked for in the least time?"
    caption = (
        "Dashed: the error asked for; ringed: the recommended setting; grey: the reference solution's "
        "uncertainty. Where an engine solves another contact law, the distance of the two laws is added."
    )
    yield figure_of(f"{NAME}-time", question, caption, NAME, panels, 3.4)
    if results.has_curves:
        lines = []
        for run in runs[runs["label"].isin(styles)].itertuples():
            size = so_far(results.curve(run.case, standings.column))
            times = results.curve(run.case, "time_s")[: len(size)]
            style = {**styles[run.label], "markevery": max(1, len(size) // MARKERS)}
            lines.append(Line(run.label, times, np.where(size > 0, size, math.nan), style))
        panels = [Panel("", axis_label("time_s"), axis.replace(" [", " so far ["), lines, log="y")]
        question = f"How does the {what} grow over time?"
        caption = (
            "The largest so far at the samples, of each engine's run in the table, against its own model's "
            "solution; the table has more instants, within impacts."
        )
        yield figure_of(f"{NAME}-over-time", question, caption, NAME, panels, 3.4)
