"""The agreement study on the page: every engine on every ideal scene against the independent truth."""

from collections.abc import Mapping

import pandas as pd

from reports.chapters.agreement import figures, findings, tables
from reports.chapters.agreement.figures import ENERGY, FORCE, POSITION, VIOLATION
from reports.parts import Section
from reports.quantities import with_largest
from reports.results import Results
from reports.shared_tables import failures_section, failures_table, settings_table

STUDY = "agreement"
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
    return Section(
        "convergence",
        "Convergence",
        (*findings.pymunk_arms(rows, POSITION), *findings.orders_found(rows, (POSITION, FORCE))),
        figures.convergence(rows),
        (settings_table(rows, STUDY), tables.orders_table(rows), tables.smallest_table(rows)),
    )


def _one_step(results: Results, rows: pd.DataFrame, steps: Mapping[str, float]) -> Section:
    return Section(
        "one-step",
        "Errors at one step",
        findings.best_at_step(rows, steps),
        figures.position_over_time(results, rows, steps),
        (tables.errors_table(rows, steps),),
    )


def _conservation(results: Results, rows: pd.DataFrame, steps: Mapping[str, float]) -> Section:
    return Section(
        "conservation",
        "Energy and constraints",
        findings.conservation(rows, steps),
        figures.conservation(results, rows, steps),
        (tables.conservation_table(rows, steps, (ENERGY, VIOLATION)),),
    )


def _sweep(rows: pd.DataFrame, setting: str) -> Section:
    columns = (POSITION, FORCE, VIOLATION)
    return Section(
        setting,
        f"{rows['engine'].iloc[0].capitalize()}'s {setting}",
        findings.enough(rows, setting, POSITION),
        figures.sweep(rows, setting, columns),
        (tables.sweep_table(rows, setting, columns),),
    )
