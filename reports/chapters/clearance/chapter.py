"""The clearance study on the page: every engine against its own law's solution, and the laws side by side."""

from collections.abc import Sequence

from reports.chapters.agreement.tables import settings_table
from reports.chapters.clearance import tables
from reports.parts import Figure, Section
from reports.plots.step_figures import against_step, panels_of
from reports.quantities import Quantity, column, largest
from reports.results import Results, Run

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
POSITION, LOCAL = column("slider_position_error_m"), column("local_position_error_m")
IMPACT_TIME, IMPULSE = column("impact_time_error_s"), column("impact_impulse_relative_error")
_GUIDES = "Both axes are logarithmic. Grey lines have the slope of the order written at their fine end"


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    runs = results.runs
    contact_force = largest("largest_contact_force_error_N", runs, r"contact_\w_normal_force_error_N")
    failed = tables.failures(runs)
    return [
        Section(
            "clearance-errors",
            "Numerical error",
            tables.orders_found(runs, LOCAL),
            (
                _figure(runs, "slider-position", "Slider position error", POSITION),
                _figure(runs, "local-error", "Local error of the bodies' positions", LOCAL),
                _figure(runs, "contact-force", "Contact force error", contact_force),
            ),
            (settings_table(runs, "clearance"), tables.smallest(runs, (POSITION, LOCAL, contact_force))),
        ),
        Section(
            "clearance-impacts",
            "Impacts one by one",
            tables.impacts_found(runs),
            (
                _figure(runs, "impact-times", "Error of the times of impact", IMPACT_TIME),
                _figure(runs, "impact-impulses", "Error of the impulse of an impact", IMPULSE),
            ),
            (tables.impacts(runs),),
        ),
        Section(
            "clearance-laws",
            "Model form and numerical error",
            tables.laws_found(runs),
            (),
            (tables.laws(runs),),
        ),
        Section(
            "clearance-failures",
            "Runs that did not finish",
            (f"{sum(not run.ok for run in runs)} of {len(runs)} runs did not finish.",),
            (),
            (failed,) if failed else (),
        ),
    ]


def _figure(runs: Sequence[Run], name: str, title: str, quantity: Quantity) -> Figure:
    panels = panels_of(runs, [quantity])
    return Figure(
        f"clearance-{name}",
        title,
        f"Against the model twin. {_GUIDES}; the grey area is the twin's own uncertainty. Of an engine that "
        "chooses its steps it is the mean one.",
        f"{title} against the step, log-log, one panel per scene, one line per engine and arm",
        against_step(runs, panels),
    )
