"""Tables and sentences of the clearance study."""

from collections.abc import Iterator, Sequence

import pandas as pd

from reports.parts import Table
from reports.quantities import uncertainty, value
from reports.shared_tables import CASE, head, orders, smallest_errors
from reports.tables import error, in_text, number

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
    rows = rows[rows["status"] != "unsupported"]
    cells = smallest_errors(rows.assign(**rows[columns].where(rows[columns] > 0)), columns)
    until = value(rows, "compared_until_s").groupby([rows[name] for name in CASE], sort=False).max()
    cells.insert(len(CASE), "compared until [s]", list(until.map(number)))
    reading = (
        "The smallest error over the arm's ladder, against its model twin. A dash where no sample has "
        "anything to compare: between rigid walls the contact force is an impulse, and zero "
        "at the samples in flight."
    )
    return Table.of("clearance-smallest-errors", "Smallest errors", reading, cells)


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


def orders_found(rows: pd.DataFrame, column: str) -> Iterator[str]:
    """Yield the observed orders of the local error in a sentence per arm."""
    for label, by_scene in orders(rows, column).items():
        claimed = [f"{order} on {scene}" for scene, order in by_scene.items() if order.slope]
        if claimed:
            yield f"{label}: local position error of order {', '.join(claimed)}."


def impacts_found(rows: pd.DataFrame) -> Iterator[str]:
    """Yield which arms find every impact at their most accurate settings."""
    rows = finest(rows).dropna(subset="impacts_matched")
    complete = (rows["impacts_unmatched"] + rows["impacts_missed"]) == 0
    for label, scenes in complete.groupby(rows["label"], observed=True):
        yield (
            f"{label}: every impact of the model twin is found, and no other, on {scenes.sum()} of "
            f"{len(scenes)} scenes."
        )


def laws_found(rows: pd.DataFrame) -> Iterator[str]:
    """Yield, for each arm with a law of its own, which of the two differences is the larger."""
    for label, arm in finest(rows).dropna(subset=MODEL_FORM).groupby("label", observed=True):
        larger, most = (arm[MODEL_FORM] > arm[SLIDER]).sum(), arm[MODEL_FORM].max()
        if most == 0:
            yield f"{label} solves a law of its own, with the same motion on all scenes here."
        else:
            yield (
                f"{label} solves a law of its own, up to {in_text(most)} m from the scene's; that "
                f"is more than its smallest numerical error on {larger} of {len(arm)} scenes."
            )
