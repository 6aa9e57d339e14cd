"""The work-precision chapter on rows with round numbers: every cell, sentence and axis worked out here.

The reference errs by 1e-4, 1e-6 and 1e-8 m in 2, 4 and 8 ms, Exudyn by as much in 20, 60 and 180 ms. A round
takes 0.9, 1 or 2 times as long, so that a mean or a least time in place of the median would be seen.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reports.chapters import work_precision
from reports.parts import Section, Table
from tests.end_to_end.written_rows import mixed, results_of, row

SCENE = "ideal-free"
ERRORS_M = (1e-4, 1e-6, 1e-8)
#: A force's error is so many times the slider's, in N/m.
FORCE_AT_A, FORCE_AT_B = 1e4, 2e4
#: Arms with the times of their solves, and of building, in s.
ARMS = {
    ("reference", "none"): ((0.002, 0.004, 0.008), 0.5),
    ("exudyn", "trapezoidal"): ((0.02, 0.06, 0.18), 0.06),
}
ROUNDS = (1.0, 0.9, 2.0)
COMPILING_S = 4.0


@pytest.fixture(scope="module")
def sections(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Section]:
    return written(tmp_path_factory.mktemp("results") / "work-precision", 0.0)


def written(folder: Path, peak_per_m: float) -> dict[str, Section]:
    """Return the chapter, with clearance if errors of peak forces are so many times the slider's, in 1/m."""
    rows: list[dict[str, Any]] = []
    for (engine, arm), (times_s, build_s) in ARMS.items():
        for k, (error_m, time_s) in enumerate(zip(ERRORS_M, times_s, strict=True)):
            head: Any = (SCENE, engine, arm, 0.1 / 2**k)
            errors = {
                "slider_position_error_m": error_m,
                "joint_A_force_error_N": FORCE_AT_A * error_m,
                "joint_B_force_error_N": FORCE_AT_B * error_m,
            }
            known = {name.replace("_error_", "_uncertainty_"): 1e-14 for name in errors}
            columns: dict[str, Any] = {
                "steps": 100 * 2**k,
                "compared_until_s": 0.5,
                "end_time_s": 0.5,
                **errors,
                **known,
            }
            if peak_per_m:
                columns |= {"clearance_B_error_m": error_m, "not_judged": "joint_O_force_N: zero"}
                columns["impact_force_relative_error"] = peak_per_m * error_m
            rows.append(row(len(rows), *head, **columns))
            for n, part in enumerate(ROUNDS):
                timed: dict[str, Any] = {
                    "timed": True,
                    "round": n,
                    "solve_time_s": part * time_s,
                    "build_time_s": build_s,
                }
                rows.append(row(len(rows), *head, end_time_s=0.5, **timed))
    anew: dict[str, Any] = {
        "timed": True,
        "compiled_anew": 1,
        "compile_time_s": COMPILING_S,
        "end_time_s": 0.5,
    }
    rows.append(row(len(rows), SCENE, "reference", "none", 0.1, **anew))
    results = results_of(folder, rows, {})
    return {section.name: section for section in work_precision.sections(results)}


def table(sections: dict[str, Section], name: str) -> Table:
    found = (one for section in sections.values() for one in section.tables)
    return next(one for one in found if one.name == f"work-precision-{name}")


def test_the_sentences_tell_who_is_cheaper_and_by_how_much(sections: dict[str, Section]) -> None:
    # In the solve 8 of 180 ms to 2 of 20 ms; with building at most 502 ms against 80.
    expected = []
    for signal in ("slider position", "largest joint force"):
        expected += [
            f"By {signal} error, in the native solve, the reference is cheaper at the errors of all its "
            "rivals' best rungs on 1 of 1 scenes. It is cheaper at some of them on 1 of 1 scenes. There it "
            "takes "
            "0.044 to 0.1 of their time.",
            f"By {signal} error, with building and reading out, the reference is cheaper at the errors "
            "of all its rivals' best rungs on 0 of 1 scenes.",
            f"{SCENE} by {signal} error, with building and reading out: exudyn (trapezoidal) is cheaper "
            "at 3 of the best rungs; the reference takes up to 6.3 times as long.",
        ]
    assert list(sections["work-precision-ideal"].text) == expected


def test_times_at_equal_error_are_medians_in_ms_on_the_line_between_rungs(
    sections: dict[str, Section],
) -> None:
    shown = table(sections, "ideal-slider-position")
    head = ("scene", "error [m]", "engine and arm", "setting", "time [ms]", "ratio to the cheapest")
    assert shown.head == head
    # Half way between two rungs in powers of ten a time is the root of their product: 2.8 of 2 and 4.
    settings = ("step 0.1 s", "step 0.1 to 0.05 s", "step 0.05 s", "step 0.05 to 0.025 s")
    numbers = (
        ("1.0e-04", "2", "20", "10 (10 to 10)"),
        ("1.0e-05", "2.8", "35", "12 (12 to 12)"),
        ("1.0e-06", "4", "60", "15 (15 to 15)"),
        ("1.0e-07", "5.7", "100", "18 (18 to 18)"),
    )
    expected = []
    for setting, (error, own, other, ratio) in zip(settings, numbers, strict=True):
        expected.append((SCENE, error, "reference (none)", setting, own, "–"))
        expected.append((SCENE, error, "exudyn (trapezoidal)", setting, other, ratio))
    assert list(shown.rows) == expected


def test_races_are_counted_by_rungs_with_and_without_building(sections: dict[str, Section]) -> None:
    for signal in ("slider-position", "largest-joint-force"):
        solve = table(sections, f"ideal-{signal}-races")
        assert solve.head == (
            "scene",
            "rivals' best rungs",
            "reference cheaper",
            "in parts of the rival's time",
            "rival cheaper",
            "not resolved",
            "rival alone",
            "reference alone",
        )
        assert solve.rows == ((SCENE, "3", "3", "0.044 to 0.1", "0", "0", "0", "0"),)
        whole = table(sections, f"ideal-{signal}-whole-races")
        assert whole.rows == ((SCENE, "3", "0", "–", "3", "0", "0", "0"),)


def test_what_is_outside_the_times_is_told_in_ms_and_as_a_part_of_the_run(
    sections: dict[str, Section],
) -> None:
    building = table(sections, "building")
    milliseconds = ("median [ms]", "least [ms]", "most [ms]")
    assert building.head == ("engine", "arm", *milliseconds, "median [%]", "least [%]", "most [%]")
    expected = []
    for (engine, arm), (times_s, build_s) in ARMS.items():
        parts = sorted(100 * build_s / (build_s + part * time_s) for time_s in times_s for part in ROUNDS)
        ends = (f"{part:.2g}" if part < 99.5 else "100" for part in (parts[4], parts[0], parts[-1]))
        expected.append((engine, arm, *3 * (f"{1000 * build_s:.0f}",), *ends))
    assert list(building.rows) == expected
    compiling = table(sections, "compiling")
    head = ("scene", "engine", "time [s]", "at an error of", "against", "paid for after")
    assert compiling.head == head
    # 4 s, of which each run at 1e-6 m saves 60 - 4 ms.
    assert compiling.rows == ((SCENE, "reference", "4", "1.0e-06 m", "exudyn (trapezoidal)", "72 runs"),)


@pytest.mark.parametrize(
    ("signal", "label", "per_m"),
    [
        ("slider-position", "slider position error [m]", 1.0),
        ("largest-joint-force", "largest joint force error [N]", FORCE_AT_B),
    ],
)
def test_errors_are_drawn_against_times_and_steps(
    sections: dict[str, Section], signal: str, label: str, per_m: float
) -> None:
    figures = {one.name: one for section in sections.values() for one in section.figures}
    for against, axis in (("time", "run time [s]"), ("steps", "steps")):
        panel = figures[f"work-precision-ideal-{signal}-{against}"].drawing.axes[0]
        assert (panel.get_title(), panel.get_xlabel(), panel.get_ylabel()) == (SCENE, axis, label)
        for line, (times_s, _) in zip(panel.lines, ARMS.values(), strict=False):
            points = np.asarray(line.get_xydata())
            abscissae = times_s if against == "time" else (100, 200, 400)
            assert points[:, 0] == pytest.approx(abscissae)
            assert points[:, 1] == pytest.approx([per_m * error for error in ERRORS_M])


def test_with_clearance_peak_forces_are_shown_in_percent_against_run_time_alone(tmp_path: Path) -> None:
    """1e-6 m is 0.1 % here, so that 1 % is half way between two rungs: 2.8 ms and 35 ms."""
    found = written(tmp_path / "work-precision", 1e3)
    shown = table(found, "clearance-peak-force")
    assert shown.head[1] == "error [%]"
    assert [row[1:3] + row[4:5] for row in shown.rows if row[1] == "1.0e+00"] == [
        ("1.0e+00", "reference (none)", "2.8"),
        ("1.0e+00", "exudyn (trapezoidal)", "35"),
    ]
    section = found["work-precision-clearance"]
    (drawn,) = [one for one in section.figures if "peak-force" in one.name]
    panel = drawn.drawing.axes[0]
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("run time [s]", "peak force error [%]")
    assert section.text[-1] == (
        f"A signal that is zero, or whose peak no sample sees, is not judged: joint O force on {SCENE}."
    )
    assert "By peak force error, in the native solve, the reference is cheaper" in "".join(section.text)


def test_a_figure_has_one_quantity(sections: dict[str, Section]) -> None:
    assert mixed(sections) == []
