"""The stability study on the page: maps of verdicts, and the scalar problem held against theory."""

from collections.abc import Iterator, Sequence

import pandas as pd

from reports.chapters.stability import findings, tables
from reports.chapters.stability.map_cells import VARIED, cells, dampings_of, limits_of, prepared
from reports.chapters.stability.maps import verdict_map
from reports.parts import Figure, Section
from reports.results import Results
from reports.shared_tables import settings_table
from reports.style import labels

STUDY = "stability"
TITLE = "Stability"
INTRODUCTION = (
    "Where does each solver stop being trustworthy? The literature's crank-slider with clearance at the "
    "rod-slider pin and a lossless Hertz contact is run through its first impacts at steps from harmless to "
    "absurd, while contact stiffness, clearance or crank speed varies, and every run gets a verdict from its "
    "trajectory alone. Theory knows a limit for a fixed explicit step h on a contact of frequency ω: "
    "ωh = 2.828 for RK4, h = 0.702 durations of the contact, and ωh = 2 for semi-implicit Euler, 0.496 "
    "durations. Implicit methods, and those that choose their steps, have none. A mass on a contact's "
    "spring shows whether the engines' methods are what theory takes them for."
)


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    rows = prepared(results.rows)
    maps = [varied for varied in VARIED if len(cells(rows, varied))]
    return [*_scalar(rows), *(_map(rows, varied) for varied in maps), *_boundaries(rows, maps)]


def _scalar(rows: pd.DataFrame) -> Iterator[Section]:
    shown = (tables.limits(limits_of(rows)), tables.dampings(dampings_of(rows)))
    if any(shown):
        yield Section.of("scalar", "A mass on a contact", findings.recovered(rows), tables=shown)


def _map(rows: pd.DataFrame, varied: str) -> Section:
    rows = cells(rows, varied)
    what = VARIED[varied][0]
    name = what.replace(" ", "-")
    figure = Figure(
        f"stability-{name}",
        f"Verdicts over the step and the {what}",
        "A cell is a run, dark is bad. Right of the black line the step is beyond the limit of theory at the "
        "deepest point of the first impact. G: the energy balance gains more than its bound; I: any bound is "
        "exceeded otherwise; D: the engine gave up, a number is not finite or the mechanism came apart.",
        f"Maps of verdicts over the step and the {what}, logarithmic, one panel each for "
        f"{', '.join(labels(rows))}.",
        verdict_map(rows, varied),
    )
    return Section.of(name, f"Step and {what}", findings.begun(rows, varied), [figure])


def _boundaries(rows: pd.DataFrame, maps: Sequence[str]) -> Iterator[Section]:
    if maps:
        shown = (tables.boundaries(rows), settings_table(rows, STUDY))
        yield Section.of("boundaries", "The boundaries", findings.verdicts(rows), tables=shown)
