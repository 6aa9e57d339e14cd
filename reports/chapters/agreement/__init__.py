"""The agreement study on the page: every engine on every ideal scene against the independent truth."""

import pandas as pd

from reports.chapters.agreement import findings, tables
from reports.chapters.agreement.figures import by_step, by_tolerance, over_time_at_step, sweep
from reports.chapters.agreement.findings import ENERGY, VIOLATION
from reports.parts import Section
from reports.quantities import with_largest
from reports.results import Results, with_columns
from reports.shared_tables import failures_section, settings_table

STUDY = "agreement"
POSITION, FORCE = "slider_position_error_m", "largest_joint_force_error_N"
VELOCITY, TORQUE = "slider_velocity_error_m_s", "driver_torque_error_N_m"
TITLE = "Agreement on ideal joints"
INTRODUCTION = (
    "Every engine runs every scene without clearance at a ladder of steps and is judged by a truth that "
    "shares no code with any of them: the mechanism in one coordinate, integrated to near round-off, with "
    "an uncertainty of its own. Errors are the largest over all samples; what dies away between two samples "
    "is not seen. At equal steps the engines do unequal work: this study is about what an engine gets right, "
    "not about what it costs."
)


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    rows = with_columns(results.rows, ENERGY, "compared_until_s", "varied")
    rows = with_largest(rows, FORCE, r"joint_\w_force_error_N")
    rows = rows.assign(varied=rows["varied"].fillna("step"))  # of results older than this column
    ladder, chosen = (rows[rows["varied"] == what] for what in ("step", "tolerance"))
    others = rows[~rows["varied"].isin(["step", "tolerance"])]
    at_step = at_common_steps(ladder)
    return [
        _convergence(ladder),
        *([_by_tolerance(chosen)] if len(chosen) else []),
        _one_step(results, at_step),
        _conservation(results, ladder, at_step),
        *(_sweep(of_setting, setting) for setting, of_setting in others.groupby("varied")),
        failures_section(rows, STUDY),
    ]


def at_common_steps(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of each scene at the middle one of the steps that every engine was run at."""
    steps = {}
    for scene, of_scene in rows.groupby("scene"):
        engines = of_scene.groupby("step_s")["engine"].nunique()
        common = engines.index[engines == of_scene["engine"].nunique()]
        if len(common):
            steps[scene] = common[len(common) // 2]
    return rows[rows["step_s"] == rows["scene"].map(steps)]


def _convergence(rows: pd.DataFrame) -> Section:
    force = (
        "The largest force error of all joints. Forces belong to the accelerations, so they show what a "
        "position that is prescribed or corrected can hide."
    )
    torque = (
        "A driver torque is compared where it is a reaction, under prescribed crank speed, and has no panel "
        "elsewhere."
    )
    return Section.of(
        "convergence",
        "Convergence",
        (*findings.pymunk_arms(rows, POSITION), *findings.orders_found(rows, (POSITION, FORCE))),
        (
            by_step("slider-position", "Slider position error", rows, POSITION),
            by_step("joint-force", "Joint force error", rows, FORCE, force),
            by_step("slider-velocity", "Slider velocity error", rows, VELOCITY),
            by_step("driver-torque", "Driver torque error", rows, TORQUE, torque),
        ),
        (settings_table(rows, STUDY), tables.orders_table(rows), tables.smallest_table(rows)),
    )


def _by_tolerance(rows: pd.DataFrame) -> Section:
    return Section.of(
        "tolerance",
        "Engines that choose their steps",
        findings.errors_by_tolerance(rows, POSITION),
        (
            by_tolerance("tolerance-position", "Slider position error", rows, POSITION),
            by_tolerance("tolerance-force", "Joint force error", rows, FORCE),
        ),
        [tables.tolerance_table(rows)],
    )


def _one_step(results: Results, at_step: pd.DataFrame) -> Section:
    figure = over_time_at_step(
        results,
        at_step,
        POSITION,
        "Slider position error",
        "Shown is the largest error up to each time, so that a zero crossing does not look like "
        "agreement: a line that keeps rising is an error that builds up, a level one is bounded.",
    )
    text, table = findings.best_at_step(at_step), tables.errors_table(at_step)
    return Section.of("one-step", "Errors at one step", text, [figure], [table])


def _conservation(results: Results, rows: pd.DataFrame, at_step: pd.DataFrame) -> Section:
    energy = over_time_at_step(
        results,
        at_step,
        ENERGY,
        "Unaccounted energy",
        "Energy that no physics accounts for, the largest up to each time, as a part of the energy in play. "
        "An exact run has none; a rising line is energy made or lost by the method.",
    )
    what = "Constraint violation"
    reading = "The largest gap in a joint, or of the slider from its guide."
    by_steps = by_step("constraint-violation", what, rows, VIOLATION, reading, floor="")
    reading = "The largest gap up to each time: a rising line is drift."
    drift = over_time_at_step(results, at_step, VIOLATION, what, reading)
    text, table = findings.conservation(at_step), tables.conservation_table(at_step, (ENERGY, VIOLATION))
    return Section.of("conservation", "Energy and constraints", text, (energy, by_steps, drift), [table])


def _sweep(rows: pd.DataFrame, setting: str) -> Section:
    columns = (POSITION, FORCE, VIOLATION)
    return Section.of(
        setting,
        f"{rows['engine'].iloc[0].capitalize()}'s {setting}",
        findings.enough(rows, setting, POSITION),
        [sweep(rows, setting, column) for column in columns],
        [tables.sweep_table(rows, setting, columns)],
    )
