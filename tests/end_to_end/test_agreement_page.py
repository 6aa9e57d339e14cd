"""The chapter on ideal joints on rows with round numbers: every cell, finding and point worked out here."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.lines import Line2D

from reports.chapters.accuracy_ideal import CHAPTER
from reports.parts import Contradiction, Figure, Table
from reports.results import Results
from tests.end_to_end.written_rows import results_of, row

#: Steps of each scene in s, and configurations with their order and position error in m at the longest step.
STEPS = {"ideal-driven": (4e-5, 2e-5, 1e-5), "ideal-free": (4e-4, 2e-4, 1e-4)}
ARMS = {
    ("reference", "projection"): (4, {"ideal-driven": 2.56e-6, "ideal-free": 5.12e-6}),
    ("exudyn", "trapezoidal"): (2, {"ideal-driven": 1.6e-4, "ideal-free": 3.2e-4}),
    ("pymunk", "tuned"): (2, {"ideal-driven": 4.8e-3, "ideal-free": 8e-3}),
    ("pymunk", "out of the box"): (1, {"ideal-driven": 6e-3, "ideal-free": 9e-3}),
}
#: Every signal's error as a multiple of the position's, with its heading and its reference's uncertainty.
SIGNALS = {
    "slider_position_error_m": (1, "slider position [m]", 1e-12),
    "slider_velocity_error_m_s": (100, "slider velocity [m/s]", 2e-12),
    "joint_O_force_error_N": (3000, "joint O force [N]", 3e-12),
    "joint_A_force_error_N": (7000, "joint A force [N]", 4e-12),
    "joint_B_force_error_N": (5000, "joint B force [N]", 5e-12),
    "guide_normal_force_error_N": (2000, "guide normal force [N]", 6e-12),
    "driver_torque_error_N_m": (50, "driver torque [N·m]", 7e-12),
}
JOINTS = [column for column in SIGNALS if column.startswith("joint_")]
#: The signals of figures and of tables on the page: the largest joint force in place of the three.
SHOWN = {
    "slider position": ["slider_position_error_m"],
    "slider velocity": ["slider_velocity_error_m_s"],
    "largest joint force": JOINTS,
    "guide normal force": ["guide_normal_force_error_N"],
    "driver torque": ["driver_torque_error_N_m"],
}
#: Exudyn's force at A is the best of all, in N at the longest step.
BEST_AT_A_N = 1.2e-5
#: At the longest step on ideal-free, half of the energy on the other; the violation grows with every halving.
UNACCOUNTED = {"projection": 1.6e-6, "trapezoidal": 3.2e-3, "tuned": 2.4e-2, "out of the box": 5e-2}
VIOLATION_M = {"projection": 2e-15, "trapezoidal": 5e-9, "tuned": 4e-4, "out of the box": 6e-4}
#: SciPy's position error in m by the tolerance that it was given; one is below the reference's uncertainty.
BY_TOLERANCE = {
    "ideal-driven": {1e-6: 4e-7, 1e-8: 2e-9},
    "ideal-free": {1e-6: 3e-5, 1e-15: 5e-13},
}


def signal_error(scene: str, engine: str, arm: str, halvings: int, column: str) -> float:
    order, position = ARMS[engine, arm]
    first = SIGNALS[column][0] * position[scene]
    if (engine, column) == ("exudyn", "joint_A_force_error_N"):
        first = BEST_AT_A_N
    return float(first / 2 ** (order * halvings))


def has(scene: str, column: str) -> bool:
    return scene == "ideal-driven" or column != "driver_torque_error_N_m"


def known(scene: str, **columns: Any) -> dict[str, Any]:
    """Return the columns of a finished run, with the uncertainties of its scene's reference solution."""
    doubts = {c.replace("_error_", "_uncertainty_"): SIGNALS[c][2] for c in SIGNALS if has(scene, c)}
    return {"end_time_s": 0.05, "compared_until_s": 0.05, **doubts, **columns}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    rows: list[dict[str, Any]] = []
    for scene, steps in STEPS.items():
        for (engine, arm), (order, _) in ARMS.items():
            for k, step in enumerate(steps):
                signals = {c: signal_error(scene, engine, arm, k, c) for c in SIGNALS if has(scene, c)}
                columns = known(scene, varied="step", steps=100 * 2**k, **signals)
                part = UNACCOUNTED[arm] if scene == "ideal-free" else UNACCOUNTED[arm] / 2
                columns["unaccounted_energy_part"] = part / 2 ** (order * k)
                columns["constraint_violation_m"] = VIOLATION_M[arm] * (1 + k)
                rows.append(row(len(rows), scene, engine, arm, step, **columns))
    for scene, errors in BY_TOLERANCE.items():
        for tolerance, position in errors.items():
            signals = {c: SIGNALS[c][0] * position for c in SIGNALS if has(scene, c)}
            columns = known(scene, varied="tolerance", steps=20, setting_step_tolerance=tolerance, **signals)
            rows.append(row(len(rows), scene, "scipy", "DOP853", 0.05, **columns))
    swept = {"varied": "iterations", "end_time_s": 0.05, "setting_iterations": 5}
    failed = {"status": "failed", "reason": "not finite"}
    rows.append(row(len(rows), "ideal-free", "pymunk", "5 iterations", 1e-4, **swept, **failed))
    swept |= known(
        "ideal-free", setting_iterations=20, slider_position_error_m=0.25, joint_B_force_error_N=8.0
    )
    swept["constraint_violation_m"] = 0.5
    rows.append(row(len(rows), "ideal-free", "pymunk", "20 iterations", 1e-4, **swept))
    return results_of(tmp_path_factory.mktemp("results") / "agreement", rows, {})


@pytest.fixture(scope="module")
def tables(results: Results) -> dict[str, Table]:
    return {table.name: table for table in CHAPTER.tables({"agreement": results}) if table}


@pytest.fixture(scope="module")
def figures(results: Results) -> dict[str, Figure]:
    return {figure.name: figure for figure in CHAPTER.figures({"agreement": results}) if figure}


def findings(results: Results) -> dict[str, str]:
    return {finding.name: finding for finding in CHAPTER.findings({"agreement": results})}


def drawn(line: Line2D) -> tuple[list[float], list[float]]:
    """Return a line's points, x and y."""
    points = np.asarray(line.get_xydata())
    return points[:, 0].tolist(), points[:, 1].tolist()


def cell(scene: str, column: str, value: float) -> str:
    return f"{value:.1e}" if has(scene, column) else "–"


def test_the_errors_at_one_step_are_those_of_the_middle_step(tables: dict[str, Table]) -> None:
    shown = tables["agreement-errors"]
    headings = [signal[1] for signal in SIGNALS.values()]
    assert shown.head == ("scene", "step [s]", "engine", "configuration", *headings)
    expected = []
    for scene, step in (("ideal-driven", "2.0e-05"), ("ideal-free", "2.0e-04")):
        for engine, arm in ARMS:
            cells = (cell(scene, c, signal_error(scene, engine, arm, 1, c)) for c in SIGNALS)
            expected.append((scene, step, engine, arm, *cells))
        doubts = (cell(scene, column, SIGNALS[column][2]) for column in SIGNALS)
        expected.append((scene, step, "reference solution", "uncertainty", *doubts))
    assert list(shown.rows) == expected


def test_an_engines_error_is_that_of_its_best_run_on_its_worst_scene(tables: dict[str, Table]) -> None:
    shown = tables["agreement-errors-by-engine"]
    assert shown.shown
    assert shown.head[:2] == ("engine", "slider position [m]")
    expected = []
    for engine, arm in list(ARMS)[:3]:  # Pymunk is better tuned
        worst = (
            max(signal_error(s, engine, arm, 2, c) for s in STEPS for c in of if has(s, c))
            for of in SHOWN.values()
        )
        expected.append((engine, *(f"{size:.1e}" for size in worst)))
    # On ideal-driven, where it is worst: 2e-9 m times 1, 100, 7000, 2000 and 50.
    expected.append(("scipy", "2.0e-09", "2.0e-07", "1.4e-05", "4.0e-06", "1.0e-07"))
    assert list(shown.rows) == expected


def test_orders_are_those_of_the_numbers(tables: dict[str, Table]) -> None:
    shown = tables["agreement-orders"]
    names = (signal[1].partition(" [")[0] for signal in SIGNALS.values())
    assert shown.head == ("scene", "engine", "configuration", *names)
    expected = [
        (scene, engine, arm, *(f"{order}.00" if has(scene, c) else "–" for c in SIGNALS))
        for scene in STEPS
        for (engine, arm), (order, _) in ARMS.items()
    ]
    assert list(shown.rows) == expected


def test_orders_are_shown_by_configuration(results: Results, tables: dict[str, Table]) -> None:
    shown = tables["agreement-orders-by-configuration"]
    assert shown.shown
    assert shown.head == ("configuration", *SHOWN)
    assert shown.rows == tuple(
        (f"{engine} ({arm})", *[f"{order}.00"] * 5) for (engine, arm), (order, _) in ARMS.items()
    )
    # On one scene the position's error falls by 2.25 times as much at every halving, on the other not at all.
    rows, column = results.rows.copy(), "slider_position_error_m"
    exudyn = rows["engine"] == "exudyn"
    for scene, errors in (("ideal-driven", [9e-4, 1e-4, 1e-4 / 9]), ("ideal-free", [1e-4] * 3)):
        rows.loc[exudyn & (rows["scene"] == scene), column] = errors
    made = CHAPTER.tables({"agreement": replace(results, rows=rows)})
    (shown,) = (table for table in made if table and table.name == shown.name)
    assert shown.rows[1][:3] == ("exudyn (trapezoidal)", "3.17 (else flat)", "2.00")


def test_errors_are_drawn_against_the_tolerance(figures: dict[str, Figure]) -> None:
    panel, *_ = figures["agreement-tolerance"].drawing.axes
    assert (panel.get_title(), panel.get_xlabel()) == ("ideal-driven", "tolerance")
    assert panel.get_ylabel() == "slider position error [m]"
    assert drawn(panel.lines[0]) == ([1e-8, 1e-6], [2e-9, 4e-7])


def test_a_sweep_has_errors_and_failures_by_its_parameter(tables: dict[str, Table]) -> None:
    shown = tables["agreement-iterations"]
    head = ("scene", "step [s]", "engine", "iterations", "configuration", "slider position [m]")
    assert shown.head == (*head, "largest joint force [N]", "constraint violation [m]")
    case = ("ideal-free", "1.0e-04", "pymunk")
    failed = (*case, "5", "5 iterations", "failed", "failed", "failed")
    assert shown.rows == (failed, (*case, "20", "20 iterations", "2.5e-01", "8.0e+00", "5.0e-01"))


FINDINGS = {
    "rk4-order": (
        "Observed order of the reference engine (RK4): 4 in slider position and 4 in largest joint force."
    ),
    "pymunk-orders": (
        "pymunk (out of the box) is a first-order method (observed order 1 in slider position); pymunk "
        "(tuned), with joint errors corrected in full in every step and a half-step start, is of second "
        "order (2)."
    ),
    "reliability": ("29 of 30 runs finished."),
}


def test_the_findings_are_those_of_the_numbers(results: Results) -> None:
    assert findings(results) == FINDINGS


@pytest.mark.parametrize("label", ["reference (projection)", "pymunk (tuned)"])
def test_another_order_than_theorys_contradicts_the_finding(results: Results, label: str) -> None:
    rows = results.rows.copy()
    free = rows["scene"] == "ideal-free"
    of_label = free & (rows["label"] == label)
    rows.loc[of_label, "slider_position_error_m"] = [8e-3, 1e-3, 1.25e-4]  # order 3
    with pytest.raises(Contradiction):
        findings(replace(results, rows=rows))


@pytest.mark.parametrize(("place", "signal"), [(0, "slider position"), (2, "largest joint force")])
def test_errors_are_drawn_against_the_step(figures: dict[str, Figure], place: int, signal: str) -> None:
    drawing = figures["agreement-steps"].drawing
    assert [ax.get_title() for ax in drawing.axes] == ["ideal-driven", "ideal-free"] * 2
    panel = drawing.axes[place]
    assert (panel.get_xlabel(), panel.get_xscale(), panel.get_yscale()) == ("step [s]", "log", "log")
    assert panel.get_ylabel() == f"{signal} error [{'N' if place else 'm'}]"
    for line, (engine, arm) in zip(panel.lines, ARMS, strict=False):
        expected = [
            max(signal_error("ideal-driven", engine, arm, k, column) for column in SHOWN[signal])
            for k in (2, 1, 0)
        ]
        assert drawn(line)[0] == [1e-5, 2e-5, 4e-5]
        assert drawn(line)[1] == pytest.approx(expected)
