"""The parts of a comparison's page, made of those of the studies' chapters."""

from collections.abc import Iterator, Mapping

from matplotlib.figure import Figure as Drawing

from reports.chapters import clearance
from reports.chapters.comparison.recommendation import refusals, sentences
from reports.chapters.comparison.standing import Standings
from reports.chapters.work_precision import figures, tables
from reports.equal_error import ALONE, UNRESOLVED, WITHOUT_FORCES, at_rung
from reports.parts import Figure, Section, Table
from reports.plots.time_figures import over_time
from reports.quantities import PEAK
from reports.results import Results, with_columns
from reports.shared_tables import failures_table, followed, not_judged, quality_table, settings_table
from reports.style import axis_label, words
from reports.tables import ABSENT, number, plain

NAME = "comparison"


def sections(results: Results, pictures: Mapping[str, Drawing], given: str) -> list[Section]:
    """Return the recommendation, what it rests on, and pictures of the run that is recommended.

    ``given`` is the scene as it is typed.
    """
    standings = Standings.of(results.rows)
    recorded = standings.recorded
    parts = [
        Section.of(NAME, "Recommendation", sentences(standings, given), tables=[standings_table(standings)]),
        Section.of(
            "errors",
            "Error and run time",
            [_what_an_error_is(standings)],
            [*figures.figures(standings.judged), _over_time(results, standings)],
            [tables.cheapest(standings.judged)],
        ),
        Section.of("run", "The run that is recommended", (), _figures(pictures)),
    ]
    if "impacts_matched" in recorded:
        columns = (*clearance.IMPACT_COLUMNS, clearance.MODEL_FORM, clearance.SLIDER)
        rows = with_columns(recorded, *columns)
        found = [*clearance.impacts_found(rows), *clearance.laws_found(rows)]
        parts.append(
            Section.of(
                "impacts", "Impacts and laws", found, (), [clearance.impacts(rows), clearance.laws(rows)]
            )
        )
    runs = [settings_table(recorded, NAME), failures_table(recorded, NAME), quality_table(recorded, NAME)]
    parts.append(Section.of("runs", "The runs", refusals(standings), tables=runs))
    return [part for part in parts if part.text or part.figures or part.tables]


def standings_table(standings: Standings) -> Table:
    """Return where each engine stands: its cheapest way to the error wanted, or else its nearest run."""
    what, unit = words(standings.column)
    loose = "impacts_matched" in standings.recorded
    head = ("engine and arm", "setting", "time [ms]", "ratio", f"error [{unit}]", "force error [N]")
    there = [arrival.engine for arrival in standings.there]
    engines = dict.fromkeys([*there, *standings.rungs.get("engine", ()), *standings.recorded["engine"]])
    return Table(
        f"{NAME}-standings",
        f"Each engine at a {what} of {number(standings.level)} {unit}",
        "The time is that of the native solve at that error, between two settings interpolated, and in ratio "
        f"to the cheapest. {UNRESOLVED} {ALONE} All finer settings of the arm keep that error as well; the "
        "errors shown are those of the run at the setting. An engine without a time does not get to that "
        "error: shown is its most accurate run.",
        (*head, axis_label(PEAK)) if loose else head,
        tuple(_line(standings, engine)[: len(head) + loose] for engine in engines),
    )


def _line(standings: Standings, engine: str) -> tuple[str, ...]:
    rungs = standings.rungs
    own = rungs[rungs["engine"] == engine] if len(rungs) else rungs
    if own.empty:
        status = standings.recorded.query("engine == @engine")["status"].iloc[0]
        return (engine, status, *[ABSENT] * 5)
    arrival = next((each for each in standings.there if each.engine == engine), None)
    rung = (
        standings.rung(arrival)
        if arrival
        else next(own.sort_values(["kept", "error", "time_s"]).itertuples())
    )
    error = _told(rung.error, standings.floor)
    force = _told(*standings.force_error_N(rung.Index))
    alone = WITHOUT_FORCES if rung.motion_alone else ""
    time = plain(1e3 * arrival.time_s) + alone if arrival else ABSENT
    share = standings.share(arrival) if arrival and arrival is not standings.there[0] else None
    peak = number(standings.rows.loc[rung.Index, PEAK])
    return rung.label, at_rung(rung).setting, time, str(share or ABSENT), error, force, peak


def _told(error: float, known: float) -> str:
    """Return an error, as a bound where the truth is not known well enough to tell."""
    return f"< {number(known)}" if error <= known else number(error)


def _what_an_error_is(standings: Standings) -> str:
    text = "Errors are the largest over the times compared, which with clearance resolve every impact. "
    text += followed(standings.recorded) + not_judged(standings.recorded)
    if standings.recorded.columns.str.contains("_model_difference_").any():
        text += " Where an engine solves a law of its own, that law's distance from the scene's is added."
    return text


def _over_time(results: Results, standings: Standings) -> Figure | None:
    """Return the errors of each engine's run in the table, over time."""
    places = [standings.rung(arrival).Index for arrival in standings.there]
    if not places and standings.nearest is not None:
        places = [standings.nearest.Index]
    rows = standings.recorded.loc[places]
    if rows.empty:
        return None
    what, _ = words(standings.column)
    return Figure(
        f"{NAME}-over-time",
        f"{what.capitalize()} over time",
        "The largest so far, of each engine's run in the table, against the law that it solves.",
        f"{what} over time, a line for each of {', '.join(rows['label'])}",
        over_time(results, rows, standings.column, axis_label(standings.column).replace(" [", " so far [")),
    )


def _figures(pictures: Mapping[str, Drawing]) -> Iterator[Figure]:
    for place, (title, drawing) in enumerate(pictures.items()):
        yield Figure(f"{NAME}-run-{place}", title, "", title, drawing)
