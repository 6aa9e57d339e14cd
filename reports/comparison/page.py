"""The page of a comparison: one HTML file with its figures and tables inside."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure as Drawing

from reports.comparison.sentences import sentences
from reports.comparison.standing import NAME, Standings, standings_table
from reports.lines import MOST_LINES, Line, Panel, as_svg, draw, shown_labels, so_far
from reports.look import RC, axis_label, line_styles, setting, words
from reports.page import Figure, Table
from reports.results import Results, with_columns
from reports.run.command import command

#: Where the page's template is, and the style that it shares with the report.
FOLDERS = (Path(__file__).parent, Path(__file__).parents[1])
#: The style of each configuration's line, by its label.
Styles = Mapping[str, Mapping[str, Any]]
#: Markers on a curve over time.
MARKERS = 7


def page(results: Results, pictures: Mapping[str, Drawing], scene: str, given: str) -> str:
    """Return the page of the results on one scene as HTML that needs no other file.

    ``pictures`` are of the recommended run, by their titles; ``scene`` is the scene as TOML, and ``given``
    how it is typed in a command.
    """
    standings = Standings.of(results.rows)
    with mpl.rc_context(RC):
        figures = [*_figures(results, standings)]
    figures += [
        Figure(f"{NAME}-run-{n}", title, "", NAME, of) for n, (title, of) in enumerate(pictures.items())
    ]
    environment = Environment(
        loader=FileSystemLoader(FOLDERS),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html.jinja").render(
        name=results.rows["scene"].iloc[0],
        sentences=[*sentences(standings, given)],
        tables=[standings_table(standings), _commands(standings, given)],
        figures=[(figure, as_svg(figure.drawing).partition("<svg")[2]) for figure in figures],
        runs=[_runs(standings)],
        scene=scene,
    )


def _commands(standings: Standings, given: str) -> Table:
    """Return the command of the run that each engine is shown with."""
    runs = standings.runs
    commands = [command(standings.rows.loc[run.row], given) for run in runs]
    columns = pd.DataFrame({"configuration": [run.label for run in runs], "command": commands})
    return Table(f"{NAME}-commands", "Commands of these runs", "", NAME, columns)


def _runs(standings: Standings) -> Table:
    """Return every recorded run: its setting, error, and how it ended."""
    rows = with_columns(standings.recorded, "quality_failure")
    table = pd.DataFrame(
        {
            "configuration": rows["label"].astype(str),
            "setting": list(map(setting, rows["knob"], rows["value"])),
            axis_label(standings.column): rows[standings.column],
            "status": rows["status"],
            "reason": rows["reason"].where(rows["reason"] != "", rows["quality_failure"].fillna("")),
        }
    )
    return Table(f"{NAME}-all", "All runs", "", NAME, table)


def _figures(results: Results, standings: Standings) -> Iterator[Figure]:
    """Yield the errors against run time, and those of the runs in the table over time."""
    ran, rows, runs = standings.settings, standings.recorded, standings.runs
    if not runs:
        return
    what, _ = words(standings.column)
    labels = dict.fromkeys([*(run.label for run in runs), *shown_labels(ran)])
    styles = line_styles(ran[ran["label"].isin([*labels][:MOST_LINES])])
    reading = (
        "Dashed: the error asked for; ringed: the recommended setting; grey: the reference solution's "
        "uncertainty."
    )
    if rows.columns.str.contains("_model_difference_").any():
        reading += " Where an engine solves another contact law, the distance of the two laws is added."
    question = f"Which setting reaches the {what} asked for in the least time?"
    drawing = draw([_against_time(standings, styles)], height_in=3.4)
    yield Figure(f"{NAME}-time", question, reading, NAME, drawing)
    if results.has_curves:
        question = f"How does the {what} grow over time?"
        reading = "The largest so far, of each engine's run in the table, against its own model's solution."
        curves = rows.loc[[run.row for run in runs if run.label in styles]]
        drawing = draw([_over_time(results, curves, standings.column, styles)], height_in=3.4)
        yield Figure(f"{NAME}-over-time", question, reading, NAME, drawing)


def _against_time(standings: Standings, styles: Styles) -> Panel:
    """Return the errors of the configurations that have a style against run time."""
    ran, lines = standings.settings, []
    for label, style in styles.items():
        own = ran[ran["label"] == label].sort_values("time_s", kind="stable")
        ends = np.stack([own["times_s"].map(np.nanmin), own["times_s"].map(np.nanmax)])
        spread = np.abs(ends - own["time_s"].to_numpy())
        notes = [*map(setting, own["knob"], own["value"])]
        lines.append(Line(label, own["time_s"], own["error"], style, notes, spread))
    chosen = ran.loc[standings.runs[0].row]
    return Panel(
        "",
        "time of the solve [s]",
        axis_label(standings.column),
        lines,
        floor=standings.floor,
        level=standings.wanted,
        rings=[(chosen["time_s"], chosen["error"])],
    )


def _over_time(results: Results, rows: pd.DataFrame, column: str, styles: Styles) -> Panel:
    """Return the largest error so far of each row's run over time."""
    lines = []
    for case, label in zip(rows["case"], rows["label"], strict=True):
        size = so_far(results.curve(case, column))
        times = results.curve(case, "time_s")[: len(size)]
        style = {**styles[label], "markevery": max(1, len(size) // MARKERS)}
        lines.append(Line(label, times, np.where(size > 0, size, np.nan), style))
    return Panel("", axis_label("time_s"), axis_label(column).replace(" [", " so far ["), lines, log="y")
