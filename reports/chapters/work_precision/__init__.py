"""The work-precision study on the page: error against run time, and who is cheapest at equal error."""

from collections.abc import Sequence

import pandas as pd

from reports.chapters.work_precision import figures, findings, tables
from reports.equal_error import Judged
from reports.parts import Section
from reports.quantities import PEAK, value, with_largest, with_peak
from reports.results import Results, with_columns
from reports.shared_tables import not_installed, not_judged, quality_table

STUDY = "work-precision"
TITLE = "Work and precision"
INTRODUCTION = (
    "Every engine climbs a ladder of its own best settings, and what it takes is set against what it gets "
    "right. Errors are those of recorded runs, against the converged solution of the law that the engine "
    "really solves, so that a different contact law is no error; times are those of bare runs of the native "
    "solve, made alone on the machine in rounds over all engines, each in an order of its own. Where the "
    "slider's position follows from a prescribed crank alone, driver torque and joint forces are judged in "
    "its place. A setting ranks by the largest error of its own and all finer settings of its arm: a small "
    "one before a larger one is luck. Every timed run ends where the recorded one does, or has failed. "
    "Between rigid walls scenes end before bounces first accumulate, up to where every engine follows them. "
    "SciPy, the pick of a user without an engine, integrates the reference's equations with their "
    "multipliers, or in its minimal arms those of minimal coordinates, as heyoka does. Times are of one "
    "machine; ratios are what counts."
)
POSITION, TORQUE = "slider_position_error_m", "driver_torque_error_N_m"
FORCE = "largest_joint_force_error_N"
#: The signals of these errors, as a row names those that are not judged.
JUDGED = r"^(slider_position_m|driver_torque_N_m|joint_\w_force_N)$"


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    times = ("solve_time_s", "build_time_s", "compile_time_s")
    rows = with_columns(results.rows, "round", "compiled_anew", "compared_until_s", *times, *figures.REACHED)
    rows = with_peak(with_largest(rows, FORCE, r"joint_\w_force_error_N"))
    loose = _on_scenes(rows, rows.filter(regex="^clearance_").notna().any(axis=1))
    kinematic = ~loose & _on_scenes(rows, value(rows, TORQUE).notna())
    by_column = {POSITION: ~kinematic, TORQUE: kinematic, FORCE: kinematic | ~kinematic, PEAK: loose}
    found: list[Section] = []
    judged: list[Judged] = []
    for kind, title, of_kind in (
        ("ideal", "Ideal joints", ~loose),
        ("clearance", "Joints with clearance", loose),
    ):
        name = f"work-precision-{kind}"
        of = [
            Judged(f"{name}-{figures.file_name(column)}", rows[of_kind & those], column)
            for column, those in by_column.items()
        ]
        if of_kind.any():
            found.append(_section(name, title, of, rows[of_kind]))
        judged += of
    return [*found, _costs(rows, judged)]


def _on_scenes(rows: pd.DataFrame, holds: pd.Series) -> pd.Series:
    """Return of each row whether something holds of any finished run of its scene."""
    return (holds & (rows["status"] == "ok")).groupby(rows["scene"]).transform("any")


def _section(name: str, title: str, judged: Sequence[Judged], rows: pd.DataFrame) -> Section:
    both = [one for solve in judged for one in (solve, solve.whole())]
    unjudged = not_judged(rows, JUDGED).strip()
    return Section.of(
        name,
        title,
        [
            *(text for one in both for text in findings.found(one)),
            *findings.saturated_found(rows),
            *filter(None, [unjudged]),
        ],
        [*(figure for one in judged for figure in figures.figures(one)), *figures.horizons(rows, name)],
        [*map(findings.races_table, both), *map(tables.cheapest, judged), tables.early(rows, name)],
    )


def _costs(rows: pd.DataFrame, judged: Sequence[Judged]) -> Section:
    text = (
        "Compiling kernels, building the model and reading results out are outside all times above; this is "
        "what they take. Only the reference's rigid contact loads kernels as it goes, within its times."
    )
    shown = (
        tables.building(rows),
        tables.compiling(rows, judged),
        tables.failures(rows),
        quality_table(rows, STUDY),
    )
    title = "What is outside the times"
    return Section.of("work-precision-costs", title, [text, *not_installed(rows)], tables=shown)
