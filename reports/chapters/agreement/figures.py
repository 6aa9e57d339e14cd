"""Figures of the agreement study."""

from collections.abc import Mapping, Sequence

import pandas as pd

from reports.chapters.agreement.tables import at_steps
from reports.parts import Figure
from reports.plots.step_figures import against_step, panels_of
from reports.plots.sweep_figures import against_setting
from reports.plots.time_figures import over_time
from reports.quantities import finished
from reports.results import Results
from reports.style import axis_label, labels, words
from reports.tables import in_text

POSITION, VELOCITY = "slider_position_error_m", "slider_velocity_error_m_s"
FORCE, TORQUE = "largest_joint_force_error_N", "driver_torque_error_N_m"
VIOLATION, ENERGY = "constraint_violation_m", "energy_balance_residual_J"
#: What an energy is a part of.
LARGEST_ENERGY = "largest_kinetic_energy_J"

_GUIDES = "Both axes are logarithmic. Grey lines have the slope of the order written at their fine end"
_BY_STEP = f"{_GUIDES}; the grey area is the truth's own uncertainty, below which no error can be told."


def convergence(rows: pd.DataFrame) -> tuple[Figure, ...]:
    """Return the errors against the step."""
    return (
        *_by_step("slider-position", "Slider position error", rows, [POSITION], _BY_STEP),
        *_by_step(
            "joint-force",
            "Joint force error",
            rows,
            [FORCE],
            "The largest force error of all joints. Forces belong to the accelerations, so they show what "
            f"a position that is prescribed or corrected can hide. {_BY_STEP}",
        ),
        *_by_step(
            "velocity-and-torque",
            "Slider velocity and driver torque error",
            rows,
            [VELOCITY, TORQUE],
            "A driver torque is compared where it is a reaction, under prescribed crank speed, and has no "
            f"panel elsewhere. {_BY_STEP}",
        ),
    )


def position_over_time(
    results: Results, rows: pd.DataFrame, steps: Mapping[str, float]
) -> tuple[Figure, ...]:
    """Return the slider position error over time at one step per scene."""
    return _over_time(
        results,
        rows,
        steps,
        POSITION,
        "Slider position error",
        "Shown is the largest error up to each time, so that a zero crossing does not look like "
        "agreement: a line that keeps rising is an error that builds up, a level one is bounded.",
    )


def conservation(results: Results, rows: pd.DataFrame, steps: Mapping[str, float]) -> tuple[Figure, ...]:
    """Return energy and constraint violation over time at one step, and the violation against the step."""
    return (
        *_over_time(
            results,
            rows,
            steps,
            ENERGY,
            "Energy balance residual",
            "Energy gained beyond the driver's work, the largest up to each time, as a part of the "
            "largest kinetic energy. An exact run has none; a rising line is energy made or lost by the "
            "method.",
            per=LARGEST_ENERGY,
        ),
        *_by_step(
            "constraint-violation",
            "Constraint violation",
            rows,
            [VIOLATION],
            f"The largest gap in a joint, or of the slider from its guide. {_GUIDES}.",
        ),
        *_over_time(
            results,
            rows,
            steps,
            VIOLATION,
            "Constraint violation",
            "The largest gap up to each time: a rising line is drift.",
        ),
    )


def sweep(rows: pd.DataFrame, setting: str, columns: Sequence[str]) -> tuple[Figure, ...]:
    """Return the errors of an engine against one of its settings."""
    if finished(rows).empty:
        return ()
    engine, steps = rows["engine"].iloc[0], rows.groupby("scene")["step_s"].last()
    return (
        Figure(
            f"agreement-{setting}",
            f"Errors of {engine} against its {setting}",
            f"One line per scene, everything but the {setting} as in the tuned arm, at a step of "
            f"{steps_in_text(steps)}. A crossed-out marker above a panel is a run that failed.",
            f"{len(columns)} logarithmic panels over {setting}: {', '.join(map(axis_label, columns))}.",
            against_setting(rows, setting, columns),
        ),
    )


def steps_in_text(steps: Mapping[str, float]) -> str:
    """Return the step of each scene in words."""
    return ", ".join(f"{in_text(step)} s on {scene}" for scene, step in steps.items())


def _by_step(
    name: str, what: str, rows: pd.DataFrame, columns: Sequence[str], reading: str
) -> tuple[Figure, ...]:
    panels = panels_of(rows, columns)
    if not panels:
        return ()
    shown = ", ".join(f"{axis_label(column)} on {scene}" for scene, column in panels)
    alt = f"{len(panels)} log-log panels over the step: {shown}. Lines: {', '.join(labels(rows))}."
    return (
        Figure(f"agreement-{name}", f"{what} against the step", reading, alt, against_step(rows, panels)),
    )


def _over_time(
    results: Results,
    rows: pd.DataFrame,
    steps: Mapping[str, float],
    column: str,
    what: str,
    reading: str,
    per: str = "",
) -> tuple[Figure, ...]:
    """Return a curve at each scene's step, divided by the rows' column ``per`` if one is named."""
    # By name, so that the reference's lines are seen on those of Exudyn and Pymunk.
    rows = finished(at_steps(rows, steps)).sort_values(["scene", "engine", "arm"])
    if rows.empty:
        return ()
    so_far = axis_label(column).replace(" [", " so far [")
    axis = f"{what.lower()} so far /\n{words(per)[0]}" if per else so_far
    scenes = ", ".join(rows["scene"].unique())
    return (
        Figure(
            f"agreement-{what.lower().replace(' ', '-')}-over-time",
            f"{what} over time at one step",
            f"The step is {steps_in_text(steps)}. {reading}",
            f"Panels over time of the {what.lower()} on {scenes}. Lines: {', '.join(labels(rows))}.",
            over_time(results, rows, column, axis, per),
        ),
    )
