"""Tables of the clearance study."""

from collections.abc import Sequence

import pandas as pd

from reports.parts import Table
from reports.quantities import uncertainty, value
from reports.shared_tables import CASE, head, heading, smallest
from reports.tables import error, number

SLIDER, MODEL_FORM = "slider_position_error_m", "slider_position_model_difference_m"
#: The numbers of impacts of a run, and the errors of those that have a partner, with their headings.
IMPACT_COUNTS = ("impacts_matched", "impacts_unmatched", "impacts_missed")
IMPACT_ERRORS = {
    "impact_time_error_s": "time [s]",
    "impact_speed_relative_error": "speed, relative",
    "impact_impulse_relative_error": "impulse, relative",
    "impact_loss_relative_error": "energy lost, relative",
}
IMPACT_COLUMNS = (*IMPACT_COUNTS, *IMPACT_ERRORS)


def finest(rows: pd.DataFrame) -> pd.DataFrame:
    """Return of each arm on each scene the run with the smallest slider position error."""
    return (
        rows.assign(size=value(rows, SLIDER))
        .dropna(subset="size")
        .sort_values("size")
        .drop_duplicates(CASE)
        .sort_index()
    )


def smallest_table(rows: pd.DataFrame, columns: Sequence[str]) -> Table:
    """Return the smallest error that each arm reaches on each scene, of those that the engine can run."""
    # Between rigid walls an error that is zero compares nothing.
    rows = rows.assign(**{column: rows[column].where(rows[column] > 0) for column in columns})
    arms = rows[rows["status"] != "unsupported"].groupby(list(CASE), sort=False)
    cells = [
        (*case, number(value(arm, "compared_until_s").max()), *(smallest(arm, column) for column in columns))
        for case, arm in arms
    ]
    reading = (
        "The smallest error over the arm's ladder, against its model twin. A dash where no sample has "
        "anything to compare: between rigid walls the contact force is an impulse, and zero "
        "at the samples in flight."
    )
    head = (*CASE, "compared until [s]", *map(heading, columns))
    return Table("clearance-smallest-errors", "Smallest errors", reading, head, tuple(cells))


def impacts(rows: pd.DataFrame) -> Table:
    """Return how the impacts of each arm's finest finished run match its twin's."""
    rows = finest(rows).dropna(subset="impacts_matched")
    return Table.of(
        "clearance-impacts",
        "Impacts matched one to one",
        "The arm's most accurate run against its model twin: impacts of both that are nearest to each other, "
        "those of the engine without a partner (unmatched), those of the twin without (missed); and the "
        "largest errors of the matched ones, relative to the largest value.",
        {
            **head(rows, *CASE, "step_s"),
            **{name.removeprefix("impacts_"): rows[name].map("{:.0f}".format) for name in IMPACT_COUNTS},
            **{heading: rows[name].map(error) for name, heading in IMPACT_ERRORS.items()},
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
            **head(rows, *CASE),
            "model form [m]": form.where(rows[MODEL_FORM].notna(), "the scene's own"),
            "numerical error [m]": map(error, rows[SLIDER], doubt),
        },
    )
