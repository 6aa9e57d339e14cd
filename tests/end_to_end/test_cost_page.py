"""The chapter on cost, on rows with round numbers: every cell, finding and line worked out here.

The reference errs by 1e-4, 1e-6 and 1e-8 m in 2, 4 and 8 ms, Exudyn by as much in 20, 60 and 180 ms. A round
takes 0.9, 1 or 2 times as long, so that a mean or a least time in place of the median would be seen.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reports.analysis.equal_error import ALONE
from reports.chapters.cost import CHAPTER, STUDY
from reports.parts import Figure, Studies, Table
from tests.end_to_end.written_rows import results_of, row

SCENE = "ideal-free"
ERRORS_M = (1e-4, 1e-6, 1e-8)
#: A force's error is so many times the slider's, in N/m.
FORCE_AT_A, FORCE_AT_B = 1e4, 2e4
#: Configurations with the times of their solves, and of building, in s.
CONFIGURATIONS: dict[tuple[str, str], tuple[tuple[float, ...], float]] = {
    ("reference", "DOP853"): ((0.002, 0.004, 0.008), 0.5),
    ("exudyn", "trapezoidal"): ((0.02, 0.06, 0.18), 0.06),
}
ROUNDS = (1.1, 1.0, 2.0)
COMPILING_S, END_S = 4.0, 0.5


def written(folder: Path, of: Mapping[tuple[str, str], Any] = CONFIGURATIONS, **more: Any) -> Studies:
    """Return the study on one scene; ``more`` columns of recorded runs are numbers per m of error."""
    rows: list[dict[str, Any]] = []
    for (engine, arm), (times_s, build_s) in of.items():
        for k, (error_m, time_s) in enumerate(zip(ERRORS_M, times_s, strict=True)):
            head: Any = (SCENE, engine, arm, 0.1 / 2**k)
            errors = {
                "slider_position_error_m": error_m,
                "joint_A_force_error_N": FORCE_AT_A * error_m,
                "joint_B_force_error_N": FORCE_AT_B * error_m,
            }
            errors |= {name: per_m * error_m for name, per_m in more.items() if isinstance(per_m, float)}
            known = {name.replace("_error_", "_uncertainty_"): 1e-14 for name in errors if "_error_" in name}
            columns = {"steps": 100 * 2**k, "compared_until_s": END_S, "end_time_s": END_S, **errors, **known}
            columns |= {name: value for name, value in more.items() if not isinstance(value, float)}
            rows.append(row(len(rows), *head, **columns))
            for n, part in enumerate(ROUNDS):
                timed = {"timed": True, "round": n, "solve_time_s": part * time_s, "build_time_s": build_s}
                rows.append(row(len(rows), *head, end_time_s=END_S, **timed))
    anew = {"timed": True, "compiled_anew": 1, "compile_time_s": COMPILING_S, "end_time_s": END_S}
    rows.append(row(len(rows), SCENE, "reference", "DOP853", 0.1, **anew))
    return {STUDY: results_of(folder / STUDY, rows, {})}


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    return written(tmp_path_factory.mktemp("results"))


def tables_of(studies: Studies) -> dict[str, Table]:
    return {table.name: table for table in CHAPTER.tables(studies) if table}


def figures_of(studies: Studies) -> dict[str, Figure]:
    return {figure.name: figure for figure in CHAPTER.figures(studies) if figure}


def test_ratios_are_to_one_configuration_whoever_else_is_there(studies: Studies) -> None:
    """60 ms to 4 at 1e-6 m, and as much at 0.02 N; the reference takes 4 ms for half a second."""
    shown = tables_of(studies)["cost-ratios"]
    assert shown.shown
    assert shown.head[3:] == ("reference (DOP853) [ms for 1 s of motion]", "reference", "exudyn")
    assert shown.rows == (
        ("slider position within 1 µm", "ideal joints", "1", "8", "1 (1 of 1)", "15 (1 of 1)"),
        # 1 N is 5e-5 m, which the settings with 1e-6 m keep.
        ("largest joint force within 1 N", "ideal joints", "1", "8", "1 (1 of 1)", "15 (1 of 1)"),
    )


def test_a_setting_within_a_target_is_told_with_its_time_and_ratio(studies: Studies) -> None:
    first, second, *_ = tables_of(studies)["cost-at-targets"].rows
    assert first[2:] == (SCENE, "reference (DOP853)", "step 0.05 s", "4", "1", "0.91", "1.1")
    assert second[2:] == (SCENE, "exudyn (trapezoidal)", "step 0.05 s", "60", "15", "14", "16")


def test_what_is_outside_the_times_is_told_in_ms_and_as_a_part_of_the_run(studies: Studies) -> None:
    expected = []
    for (engine, arm), (times_s, build_s) in CONFIGURATIONS.items():
        parts = sorted(100 * build_s / (build_s + part * time_s) for time_s in times_s for part in ROUNDS)
        ends = (f"{part:.2g}" if part < 99.5 else "100" for part in (parts[4], parts[0], parts[-1]))
        expected.append((engine, arm, *3 * (f"{1000 * build_s:.0f}",), *ends))
    assert list(tables_of(studies)["cost-building"].rows) == expected
    assert tables_of(studies)["cost-compiling"].rows == ((SCENE, "reference", "4"),)


@pytest.mark.parametrize(("name", "per_m"), [("slider-position", 1.0), ("largest-joint-force", FORCE_AT_B)])
def test_errors_are_drawn_against_run_time(studies: Studies, name: str, per_m: float) -> None:
    (panel,) = figures_of(studies)[f"cost-{name}"].drawing.axes
    assert (panel.get_title(), panel.get_xlabel()) == (SCENE, "run time [s]")
    lines = [
        line for line in panel.lines if line.get_marker() not in ("None", "o") or line.get_linestyle() == "-"
    ]
    for line, (times_s, _) in zip(lines, CONFIGURATIONS.values(), strict=False):
        points = np.asarray(line.get_xydata())
        assert points[:, 0] == pytest.approx(times_s)
        assert points[:, 1] == pytest.approx([per_m * error for error in ERRORS_M])


def test_with_clearance_peak_forces_are_compared_in_percent(tmp_path: Path) -> None:
    """1e-6 m is 0.1 % here and 1e-4 m 10 %, so that 1 % takes the second setting: 4 ms and 60 ms."""
    studies = written(tmp_path, clearance_B_error_m=1.0, impact_force_relative_error=1e3)
    shown = tables_of(studies)["cost-at-targets"].rows
    assert [row[1:4] + row[5:6] for row in shown if row[0] == "peak force within 1 %"] == [
        ("clearance", SCENE, "reference (DOP853)", "4"),
        ("clearance", SCENE, "exudyn (trapezoidal)", "60"),
    ]
    assert "cost-peak-force" in figures_of(studies)


def test_errors_that_have_grown_to_the_clearance_are_counted_and_reach_nothing(tmp_path: Path) -> None:
    """A tenth of a clearance of 5 µm: two of three settings are beyond it."""
    rows = written(tmp_path, clearance_B_error_m=1.0)[STUDY]
    rows.rows["smallest_clearance_m"] = 5e-6
    found = {finding.name: finding for finding in CHAPTER.findings({STUDY: rows})}
    assert [number.value for number in found["saturated"].numbers] == [4.0, 6.0]
    failed = rows.rows.assign(status=rows.rows["status"].mask(rows.rows["step_s"] == 0.1, "failed"))
    found = {finding.name: finding for finding in CHAPTER.findings({STUDY: replace(rows, rows=failed)})}
    assert [number.value for number in found["saturated"].numbers] == [2.0, 4.0], "of those that finished"
    shown = tables_of({STUDY: rows})["cost-at-targets"].rows
    assert {row[4] for row in shown if row[0].startswith("slider position")} == {"step 0.025 s"}


def test_a_time_that_leaves_out_forces_is_marked_where_forces_are_compared_and_nowhere_else(
    tmp_path: Path,
) -> None:
    studies = written(tmp_path)
    rows = studies[STUDY].rows
    rows["motion_alone"] = rows["engine"] == "exudyn"
    at = tables_of(studies)["cost-at-targets"].rows
    assert {(row[0].split(" within")[0], row[3]): row[5].endswith("*") for row in at} == {
        ("slider position", "reference (DOP853)"): False,
        ("slider position", "exudyn (trapezoidal)"): False,
        ("largest joint force", "reference (DOP853)"): False,
        ("largest joint force", "exudyn (trapezoidal)"): True,
    }
    assert ALONE in figures_of(studies)["cost-slider-position"].reading
