"""The clearance study on the page: every engine against its own law's solution, and the laws side by side."""

import re
from collections.abc import Iterator

import pandas as pd

from reports import shared_tables
from reports.parts import Figure, Section, Table
from reports.plots.step_figures import against_step, panels_of
from reports.quantities import uncertainty, value, with_largest
from reports.results import NEVER_BEGUN, Results, with_columns
from reports.tables import error, in_text, number, on_scenes

STUDY = "clearance"
TITLE = "Agreement on joints with clearance"
INTRODUCTION = (
    "Two engines may differ because they solve different contact laws, or because one solves its law badly. "
    "Every engine's own law, its model twin, is solved to convergence by a solver that shares no code with "
    "any of them, in minimal coordinates, by collocation and by extrapolation. An engine's distance from "
    "its twin is numerical error, its twin's distance from the scene's own law is the form of the model. "
    "Past the time at which the two methods part, or starts moved by a hair, no pointwise error means "
    "anything: errors are the largest up to the time in the caption, which is no later. Bounces that "
    "converge are impacts for as long as a solver follows them. A local error is what an engine misses over "
    "one impact when begun from the twin's state, so that one unlucky impact decides nothing."
)
SLIDER, MODEL_FORM = "slider_position_error_m", "slider_position_model_difference_m"
CROSS_CHECK = "slider_position_cross_check_m"
LOCAL, CONTACT_FORCE, PEAK_FORCE = "local_position_error_m", "contact_force_error_N", "impact_force_error_N"
_GUIDES = "Both axes are logarithmic. Grey lines have the slope of the order written at their fine end"
#: What the count of missed impacts counts too.
DYING_BOUNCES = (
    " Bounces that die away come ever faster, on rigid walls without end (Zeno): every engine stops at some "
    "height, and those below it, which are next to nothing, count as missed too."
)
#: The numbers of impacts of a run, and the errors of those that have a partner.
IMPACT_COUNTS = ("impacts_matched", "impacts_unmatched", "impacts_missed")
IMPACT_ERRORS = (
    "impact_time_error_s",
    "impact_force_relative_error",
    "impact_force_in_phase_error_N",
    "impact_penetration_relative_error",
    "impact_duration_relative_error",
)
IMPACT_COLUMNS = (*IMPACT_COUNTS, *IMPACT_ERRORS)


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    rows = with_columns(
        results.rows, "compared_until_s", SLIDER, LOCAL, MODEL_FORM, PEAK_FORCE, *IMPACT_COLUMNS
    )
    rows = with_largest(rows, CONTACT_FORCE, r"contact_\w_normal_force_error_N")
    return [
        Section.of(
            "clearance-errors",
            "Numerical error",
            (*cross_check_found(rows), *orders_found(rows, LOCAL)),
            (
                _figure(rows, "slider-position", "Slider position error", SLIDER),
                _figure(rows, "local-error", "Local error of the bodies' positions", LOCAL),
                _figure(rows, "contact-force", "Contact force error", CONTACT_FORCE),
            ),
            (shared_tables.settings_table(rows, STUDY), smallest_table(rows)),
        ),
        Section.of(
            "clearance-impacts",
            "Impacts one by one",
            impacts_found(rows),
            (
                _figure(rows, "impact-times", "Error of the times of impact", "impact_time_error_s"),
                _figure(
                    rows,
                    "impact-impulses",
                    "Error of the impulse of an impact",
                    "impact_impulse_relative_error",
                ),
            ),
            [impacts(rows)],
        ),
        Section.of(
            "clearance-laws",
            "Model form and numerical error",
            laws_found(rows),
            tables=[laws(rows)],
        ),
        shared_tables.failures_section(rows, STUDY, "clearance-failures"),
    ]


def cross_check_found(rows: pd.DataFrame) -> list[str]:
    """Return how far the reference's sharp solution of the twins is from the independent one."""
    apart = value(with_columns(rows, CROSS_CHECK), CROSS_CHECK).dropna()
    if apart.empty:
        return []
    furthest = rows.loc[apart.idxmax(), "scene"]
    return [
        "Solved by the reference, another code, near round-off, a twin's slider is at most "
        f"{in_text(float(apart.max()))} m from where that solver has it, on {furthest}, the worst of "
        f"{rows.loc[apart.index, 'scene'].nunique()} scenes."
    ]


def _figure(rows: pd.DataFrame, name: str, title: str, column: str) -> Figure | None:
    panels = panels_of(rows, column)
    if not panels:
        return None
    return Figure(
        f"clearance-{name}",
        title,
        f"Against the model twin. {_GUIDES}; the grey area is the twin's own uncertainty. Of an engine that "
        f"chooses its steps it is the mean one. {shared_tables.followed(rows)}",
        f"{title} against the step, log-log, one panel per scene, one line per engine and arm",
        against_step(rows, panels),
    )


def finest(rows: pd.DataFrame) -> pd.DataFrame:
    """Return of each arm on each scene the run with the smallest slider position error."""
    return (
        rows.assign(size=value(rows, SLIDER))
        .dropna(subset="size")
        .sort_values("size")
        .drop_duplicates(shared_tables.CASE)
        .sort_index()
    )


def smallest_table(rows: pd.DataFrame) -> Table:
    """Return the smallest error that each arm reaches on each scene, of those that the engine can run."""
    columns, unjudged = [SLIDER, LOCAL, CONTACT_FORCE, PEAK_FORCE], shared_tables.not_judged(rows)
    # Between rigid walls an error that is zero compares nothing.
    rows = rows[~rows["status"].isin(NEVER_BEGUN)]
    cells = shared_tables.smallest_errors(rows.assign(**rows[columns].where(rows[columns] > 0)), columns)
    until = (
        value(rows, "compared_until_s").groupby([rows[name] for name in shared_tables.CASE], sort=False).max()
    )
    cells.insert(len(shared_tables.CASE), "compared until [s]", list(until.map(number)))
    reading = (
        "The smallest error over the arm's ladder, against its model twin: of the contact force the largest "
        "pointwise difference, of peak forces the largest over the impacts. A dash where there is nothing to "
        f"compare: between rigid walls the contact force is an impulse, and zero in flight.{unjudged}"
    )
    return Table.of("clearance-smallest-errors", "Smallest errors", reading, cells)


def impacts(rows: pd.DataFrame) -> Table:
    """Return how the impacts of each arm's finest finished run match its twin's."""
    rows = finest(rows).dropna(subset="impacts_matched")
    bounces = DYING_BOUNCES if (rows["impacts_missed"] > 0).any() else ""
    return Table.of(
        "clearance-impacts",
        "Impacts matched one to one",
        "The arm's most accurate run against its model twin: impacts of both that are nearest to each other, "
        "those of the engine without a partner (unmatched), those of the twin without (missed); and the "
        "largest errors of the matched ones, those without a unit in parts of that impact's true value. An "
        "impact that is missed counts as 1 in the peak force. At equal phase is at equal parts of "
        "an impact's duration; a dash where an impact of the run has too few samples for that. Impacts on "
        "rigid walls have neither force nor duration." + bounces,
        {
            **shared_tables.head(rows, *shared_tables.CASE, "step_s"),
            **{name.removeprefix("impacts_"): rows[name].map("{:.0f}".format) for name in IMPACT_COUNTS},
            **{
                re.sub("^(impact|relative) ", "", shared_tables.heading(name)): map(
                    error, rows[name], uncertainty(rows, name)
                )
                for name in IMPACT_ERRORS
            },
        },
    )


def laws(rows: pd.DataFrame) -> Table:
    """Return the distance of each arm's own law from the scene's beside its smallest numerical error."""
    rows = finest(rows)
    doubt = uncertainty(rows, SLIDER)
    form = pd.Series(map(error, rows[MODEL_FORM], doubt), rows.index)
    return Table.of(
        "clearance-laws",
        "Model form and numerical error",
        "Slider position: how far the converged solution of the law that the engine solves is from that of "
        "the scene's law, and how far the engine's most accurate run is from its own law's.",
        {
            **shared_tables.head(rows, *shared_tables.CASE),
            "model form [m]": form.where(rows[MODEL_FORM].notna(), "the scene's own"),
            "numerical error [m]": map(error, rows[SLIDER], doubt),
        },
    )


def orders_found(rows: pd.DataFrame, column: str) -> Iterator[str]:
    """Yield the observed orders of the local error in a sentence for each arm that has any."""
    for label, by_scene in shared_tables.orders(rows, column).items():
        if any(order.slope for order in by_scene.values()):
            yield f"{label}, local position error: {shared_tables.orders_in_text(by_scene)}."


def impacts_found(rows: pd.DataFrame) -> Iterator[str]:
    """Yield which arms find every impact at their most accurate settings."""
    rows = finest(rows).dropna(subset="impacts_matched")
    complete = (rows["impacts_unmatched"] + rows["impacts_missed"]) == 0
    for label, scenes in complete.groupby(rows["label"], observed=True):
        yield (
            f"{label}: every impact of the model twin is found, and no other, "
            f"{on_scenes(scenes.sum(), len(scenes))}."
        )


def laws_found(rows: pd.DataFrame) -> Iterator[str]:
    """Yield, for each arm with a law of its own, which of the two differences is the larger."""
    for label, arm in finest(rows).dropna(subset=MODEL_FORM).groupby("label", observed=True):
        larger, most = (arm[MODEL_FORM] > arm[SLIDER]).sum(), arm[MODEL_FORM].max()
        if most == 0:
            yield f"{label} solves a law of its own, with the same motion {on_scenes(len(arm))}."
        else:
            yield (
                f"{label} solves a law of its own, up to {in_text(most)} m from the scene's. That "
                f"is more than its smallest numerical error {on_scenes(larger, len(arm))}."
            )
