"""The agreement study on the page: every engine on every ideal scene against the independent truth."""

from collections.abc import Mapping

import pandas as pd

from reports.chapters.agreement import findings, tables
from reports.chapters.agreement.figures import at_one_step, by_step, sweep
from reports.chapters.agreement.findings import ENERGY, LARGEST_ENERGY, VIOLATION
from reports.parts import Section
from reports.quantities import with_largest
from reports.results import Results
from reports.shared_tables import failures_section, failures_table, settings_table

STUDY = "agreement"
POSITION, FORCE = "slider_position_error_m", "largest_joint_force_error_N"
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
    rows = with_largest(results.rows, FORCE, r"joint_\w_force_error_N")
    swept = swept_settings(rows)
    ladder = rows[swept.isna()]
    steps = common_steps(ladder)
    return [
        _convergence(ladder),
        _one_step(results, ladder, steps),
        _conservation(results, ladder, steps),
        *(_sweep(of_setting, setting) for setting, of_setting in rows.groupby(swept)),
        failures_section(rows, failures_table(rows, STUDY)),
    ]


def swept_settings(rows: pd.DataFrame) -> pd.Series:
    """Return the setting that each row's arm is one value of, as 20 iterations; None on the ladder."""
    settings = rows["arm"].str.extract(r"^\d+ (\w+)$", expand=False)
    return settings.where([f"setting_{setting}" in rows for setting in settings], None)


def common_steps(rows: pd.DataFrame) -> dict[str, float]:
    """Return for each scene the middle one of the steps that every engine was run at."""
    steps = {}
    for scene, of_scene in rows.groupby("scene"):
        engines = of_scene.groupby("step_s")["engine"].nunique()
        common = engines.index[engines == of_scene["engine"].nunique()]
        if len(common):
            steps[scene] = float(common[len(common) // 2])
    return steps


def _convergence(rows: pd.DataFrame) -> Section:
    return Section.of(
        "convergence",
        "Convergence",
        (*findings.pymunk_arms(rows, POSITION), *findings.orders_found(rows, (POSITION, FORCE))),
        (
            by_step("slider-position", "Slider position error", rows, [POSITION]),
            by_step(
                "joint-force",
                "Joint force error",
                rows,
                [FORCE],
                "The largest force error of all joints. Forces belong to the accelerations, so they show "
                "what a position that is prescribed or corrected can hide.",
            ),
            by_step(
                "velocity-and-torque",
                "Slider velocity and driver torque error",
                rows,
                ["slider_velocity_error_m_s", "driver_torque_error_N_m"],
                "A driver torque is compared where it is a reaction, under prescribed crank speed, and has "
                "no panel elsewhere.",
            ),
        ),
        (settings_table(rows, STUDY), tables.orders_table(rows), tables.smallest_table(rows)),
    )


def _one_step(results: Results, rows: pd.DataFrame, steps: Mapping[str, float]) -> Section:
    figure = at_one_step(
        results,
        rows,
        steps,
        POSITION,
        "Slider position error",
        "Shown is the largest error up to each time, so that a zero crossing does not look like "
        "agreement: a line that keeps rising is an error that builds up, a level one is bounded.",
    )
    text, table = findings.best_at_step(rows, steps), tables.errors_table(rows, steps)
    return Section.of("one-step", "Errors at one step", text, [figure], [table])


def _conservation(results: Results, rows: pd.DataFrame, steps: Mapping[str, float]) -> Section:
    return Section.of(
        "conservation",
        "Energy and constraints",
        findings.conservation(rows, steps),
        (
            at_one_step(
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
            by_step(
                "constraint-violation",
                "Constraint violation",
                rows,
                [VIOLATION],
                "The largest gap in a joint, or of the slider from its guide.",
                floor="",
            ),
            at_one_step(
                results,
                rows,
                steps,
                VIOLATION,
                "Constraint violation",
                "The largest gap up to each time: a rising line is drift.",
            ),
        ),
        [tables.conservation_table(rows, steps, (ENERGY, VIOLATION))],
    )


def _sweep(rows: pd.DataFrame, setting: str) -> Section:
    columns = (POSITION, FORCE, VIOLATION)
    return Section.of(
        setting,
        f"{rows['engine'].iloc[0].capitalize()}'s {setting}",
        findings.enough(rows, setting, POSITION),
        [sweep(rows, setting, columns)],
        [tables.sweep_table(rows, setting, columns)],
    )
