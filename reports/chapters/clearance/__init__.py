"""The clearance study on the page: every engine against its own law's solution, and the laws side by side."""

import pandas as pd

from reports.chapters.clearance import tables
from reports.parts import Figure, Section
from reports.plots.step_figures import against_step, panels_of
from reports.quantities import with_largest
from reports.results import Results, with_columns
from reports.shared_tables import failures_section, failures_table, settings_table

STUDY = "clearance"
TITLE = "Agreement on joints with clearance"
INTRODUCTION = (
    "Two engines may differ because they solve different contact laws, or because one solves its law badly. "
    "The reference solves every engine's own law to convergence, as that engine's model twin: an engine's "
    "distance from its twin is numerical error, its twin's distance from the scene's own law is the form of "
    "the model. The twin is solved by DOP853 near round-off, with ten times that tolerance, by RK4, and from "
    "starts moved by a hair; errors are the largest up to the time at which these part, past which no "
    "pointwise error means anything. A local error is what an engine misses over one impact "
    "when begun from the twin's state, so that one unlucky impact decides nothing."
)
LOCAL, CONTACT_FORCE = "local_position_error_m", "largest_contact_force_error_N"
_GUIDES = "Both axes are logarithmic. Grey lines have the slope of the order written at their fine end"


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    rows = with_columns(results.rows, "compared_until_s", tables.MODEL_FORM, *tables.IMPACT_COLUMNS)
    rows = with_largest(rows, CONTACT_FORCE, r"contact_\w_normal_force_error_N")
    return [
        Section.of(
            "clearance-errors",
            "Numerical error",
            tables.orders_found(rows, LOCAL),
            (
                _figure(rows, "slider-position", "Slider position error", tables.SLIDER),
                _figure(rows, "local-error", "Local error of the bodies' positions", LOCAL),
                _figure(rows, "contact-force", "Contact force error", CONTACT_FORCE),
            ),
            (settings_table(rows, STUDY), tables.smallest_table(rows, [tables.SLIDER, LOCAL, CONTACT_FORCE])),
        ),
        Section.of(
            "clearance-impacts",
            "Impacts one by one",
            tables.impacts_found(rows),
            (
                _figure(rows, "impact-times", "Error of the times of impact", "impact_time_error_s"),
                _figure(
                    rows,
                    "impact-impulses",
                    "Error of the impulse of an impact",
                    "impact_impulse_relative_error",
                ),
            ),
            [tables.impacts(rows)],
        ),
        Section.of(
            "clearance-laws",
            "Model form and numerical error",
            tables.laws_found(rows),
            tables=[tables.laws(rows)],
        ),
        failures_section(rows, failures_table(rows, STUDY), "clearance-failures"),
    ]


def _figure(rows: pd.DataFrame, name: str, title: str, column: str) -> Figure:
    return Figure(
        f"clearance-{name}",
        title,
        f"Against the model twin. {_GUIDES}; the grey area is the twin's own uncertainty. Of an engine that "
        "chooses its steps it is the mean one.",
        f"{title} against the step, log-log, one panel per scene, one line per engine and arm",
        against_step(rows, panels_of(rows, [column])),
    )
