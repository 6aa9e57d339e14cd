"""Figures of the agreement study."""

import pandas as pd

from reports.parts import Figure
from reports.plots.step_figures import against_step, against_tolerance, panels_of
from reports.plots.sweep_figures import against_setting
from reports.plots.time_figures import over_time
from reports.quantities import finished
from reports.results import Results
from reports.shared_tables import followed
from reports.style import axis_label, labels, words
from reports.tables import in_text

#: What a figure's reading ends with where truth has an uncertainty.
FLOOR = "; the grey area is the truth's own uncertainty, below which no error can be told"


def by_step(
    name: str, what: str, rows: pd.DataFrame, column: str, reading: str = "", floor: str = FLOOR
) -> Figure | None:
    """Return a column against the step, None if no run has it; ``what`` says what it is."""
    panels = panels_of(rows, column)
    if not panels:
        return None
    shown = ", ".join(f"{axis_label(column)} on {scene}" for scene, column in panels)
    return Figure(
        f"agreement-{name}",
        f"{what} against the step",
        f"{reading} Both axes are logarithmic. Grey lines have the slope of the order written at their fine "
        f"end{floor}. {followed(rows) if floor else ''}".strip(),
        f"{len(panels)} log-log panels over the step: {shown}. Lines: {', '.join(labels(rows))}.",
        against_step(rows, panels),
    )


def by_tolerance(name: str, what: str, rows: pd.DataFrame, column: str, reading: str = "") -> Figure | None:
    """Return a column against the tolerance that engines were asked for, None if no run has it."""
    panels = panels_of(rows, column)
    if not panels:
        return None
    shown = ", ".join(f"{axis_label(column)} on {scene}" for scene, column in panels)
    return Figure(
        f"agreement-{name}",
        f"{what} against the tolerance",
        f"{reading} Both axes are logarithmic. The line marked 1 is of errors in proportion to the "
        f"tolerance{FLOOR}. {followed(rows)}".strip(),
        f"{len(panels)} log-log panels over the tolerance: {shown}. Lines: {', '.join(labels(rows))}.",
        against_tolerance(rows, panels),
    )


def over_time_at_step(
    results: Results, at_step: pd.DataFrame, column: str, what: str, reading: str
) -> Figure | None:
    """Return a curve over time at each scene's step."""
    # By name, so that the reference's lines are seen on those of Exudyn and Pymunk.
    rows = finished(at_step).sort_values(["scene", "engine", "arm"])
    if rows.empty or not results.has_curves:
        return None
    name, unit = words(column)
    axis = f"{name} so far" + (f" [{unit}]" if unit else "")
    scenes = ", ".join(rows["scene"].unique())
    return Figure(
        f"agreement-{what.lower().replace(' ', '-')}-over-time",
        f"{what} over time at one step",
        f"The step is {steps_in_text(at_step)}. {reading}",
        f"Panels over time of the {what.lower()} on {scenes}. Lines: {', '.join(labels(rows))}.",
        over_time(results, rows, column, axis),
    )


def sweep(rows: pd.DataFrame, setting: str, column: str) -> Figure | None:
    """Return a column of an engine's runs against one of its settings, None if no run finished."""
    if finished(rows).empty:
        return None
    engine, (what, _) = rows["engine"].iloc[0], words(column)
    return Figure(
        f"agreement-{setting}-{what.replace(' ', '-')}",
        f"{what.capitalize()} of {engine} against its {setting}",
        f"One line per scene, everything but the {setting} as in the tuned arm, at a step of "
        f"{steps_in_text(rows)}. A crossed-out marker above a panel is a run that failed.",
        f"A logarithmic panel of {axis_label(column)} over {setting}.",
        against_setting(rows, setting, column),
    )


def steps_in_text(rows: pd.DataFrame) -> str:
    """Return the step of each scene in words, of rows that have one each."""
    steps = rows.groupby("scene")["step_s"].first()
    return ", ".join(f"{in_text(step)} s on {scene}" for scene, step in steps.items())
