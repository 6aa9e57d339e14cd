"""Tables of the agreement study."""

import math
from collections.abc import Sequence

import pandas as pd

from reports.convergence import RULE
from reports.parts import Table
from reports.quantities import floor, knobs, signal_errors, tolerances, uncertainty, value
from reports.shared_tables import CASE, head, heading, not_judged, order_cells, smallest_errors
from reports.style import words
from reports.tables import error, number, setting


def orders_table(rows: pd.DataFrame) -> Table:
    """Return the observed order of every signal."""
    arms = rows.drop_duplicates(CASE)
    signals = {
        words(column)[0].replace(" error", ""): order_cells(arms, rows, column)
        for column in signal_errors(rows)
    }
    title = "Observed order of convergence"
    return Table.of("agreement-orders", title, RULE, {**head(arms, *CASE), **signals})


def errors_table(at_step: pd.DataFrame) -> Table:
    """Return the errors of every signal at one step per scene, the truth's uncertainty as the last line."""
    errors = signal_errors(at_step)
    floors = pd.DataFrame(
        {
            "scene": scene,
            "step [s]": number(of_scene["step_s"].iloc[0]),
            "engine": "truth",
            "arm": "uncertainty",
            **{heading(column): number(floor(of_scene, column) or math.nan) for column in errors},
        }
        for scene, of_scene in at_step.groupby("scene")
    )
    return Table.of(
        "agreement-errors",
        "Largest errors at one step",
        "Largest error over all samples; joint forces by the length of the difference vector. An error "
        "below the truth's own uncertainty u is shown as “< u”. The step is the middle one of those that "
        f"every engine was run at.{not_judged(at_step)}",
        pd.concat([_errors(at_step, errors), floors]).sort_values("scene", kind="stable"),
    )


def tolerance_table(rows: pd.DataFrame) -> Table:
    """Return the errors of every signal at every tolerance."""
    rows = rows.assign(tolerance=tolerances(rows))
    rows = rows.sort_values(["scene", "label", "tolerance"], ascending=[True, True, False])
    cells = _errors(rows, signal_errors(rows)).drop(columns="step [s]")
    cells.insert(3, "tolerance", [*map(setting, knobs(rows), rows["tolerance"])])
    return Table.of(
        "agreement-tolerances",
        "Largest errors by tolerance",
        "The tolerance is the number that the engine was given; what it makes of it is its own affair. An "
        "error below the truth's own uncertainty u is shown as “< u”.",
        cells,
    )


def conservation_table(at_step: pd.DataFrame, columns: Sequence[str]) -> Table:
    """Return what needs no truth, energy balance and constraints, at one step per scene."""
    return Table.of(
        "agreement-conservation",
        "Energy and constraints at one step",
        "The largest sizes over all samples. Neither needs a truth: both are zero for an exact run.",
        _errors(at_step, columns),
    )


def smallest_table(rows: pd.DataFrame) -> Table:
    """Return the smallest error each arm reaches within the ladder of steps."""
    return Table.of(
        "agreement-smallest-errors",
        "Smallest error over all steps",
        "The smallest of the errors over all steps of the ladder. Where the figures show that an error "
        "has stopped falling, this is the engine's own floor; elsewhere a smaller step would give less.",
        smallest_errors(rows, signal_errors(rows)),
    )


def sweep_table(rows: pd.DataFrame, setting: str, columns: Sequence[str]) -> Table:
    """Return errors and status against one setting of an engine."""
    rows = rows.sort_values(["scene", "engine", f"setting_{setting}"])
    return Table.of(
        f"agreement-{setting}",
        f"Errors against {setting}",
        "Everything but this setting as in the tuned arm.",
        {
            **head(rows, "scene", "engine"),
            setting: rows[f"setting_{setting}"].map(str),
            **head(rows, "step_s", "status"),
            **{heading(name): map(error, value(rows, name), uncertainty(rows, name)) for name in columns},
        },
    )


def _errors(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return the runs with their errors as text, or their status where they did not finish."""
    errors = {
        heading(column): [
            status if status != "ok" else error(size, doubt)
            for status, size, doubt in zip(
                rows["status"], value(rows, column), uncertainty(rows, column), strict=True
            )
        ]
        for column in columns
    }
    return pd.DataFrame({**head(rows, "scene", "step_s", "engine", "arm"), **errors})
