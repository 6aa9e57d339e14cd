"""The work-precision study on the page: error against run time, and who is cheapest at equal error."""

import pandas as pd

from reports.chapters.work_precision import figures, tables
from reports.parts import Section
from reports.quantities import finished, with_largest
from reports.results import Results, with_columns
from reports.shared_tables import quality_table

STUDY = "work-precision"
TITLE = "Work and precision"
INTRODUCTION = (
    "Every engine climbs a ladder of its own best settings, and what it takes is set against what it gets "
    "right. Errors are those of recorded runs, against the converged solution of the law that the engine "
    "really solves, so that a different contact law is no error; times are those of bare runs of the native "
    "solve, made alone on the machine in rounds over all engines. SciPy integrates the reference's own "
    "equations: the pick of a user without an engine. Times are of one machine; ratios are what counts."
)
POSITION, FORCE = "slider_position_error_m", "largest_joint_force_error_N"


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    times = ("solve_time_s", "build_time_s", "compile_time_s")
    rows = with_columns(results.rows, "steps", "round", "compiled_anew", *times)
    rows = with_largest(rows, FORCE, r"joint_\w_force_error_N")
    measured = finished(rows)
    loose = (
        measured.filter(regex="^clearance_").notna().any(axis=1).groupby(measured["scene"]).transform("any")
    )
    kinds = (("ideal", "Ideal joints", ~loose), ("clearance", "Joints with clearance", loose))
    return [
        *(_section(name, title, measured[kind]) for name, title, kind in kinds if kind.any()),
        _costs(rows),
    ]


def _section(kind: str, title: str, rows: pd.DataFrame) -> Section:
    return Section.of(
        f"work-precision-{kind}",
        title,
        tables.reference_against_rivals(rows, POSITION),
        (*figures.figures(kind, rows, POSITION), *figures.figures(kind, rows, FORCE)),
        (tables.cheapest(kind, rows, POSITION), tables.cheapest(kind, rows, FORCE)),
    )


def _costs(rows: pd.DataFrame) -> Section:
    text = (
        "Compiling kernels, building the model and reading results out are outside all times above; this is "
        "what they take. Only the reference's rigid contact loads kernels as it goes, within its times."
    )
    shown = (tables.building(rows), tables.compiling(rows), tables.failures(rows), quality_table(rows, STUDY))
    return Section.of("work-precision-costs", "What is outside the times", [text], tables=shown)
