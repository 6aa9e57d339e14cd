"""The agreement chapter on rows with round numbers: every cell, sentence, axis and point worked out here."""

from typing import Any

import numpy as np
import pytest
from matplotlib.lines import Line2D

from reports.chapters import agreement
from reports.parts import Figure, Section, Table
from tests.end_to_end.written_rows import mixed, results_of, row

#: Steps of each scene in s, and its arms with their order and position error in m at the longest step.
STEPS = {"ideal-driven": (4e-5, 2e-5, 1e-5), "ideal-free": (4e-4, 2e-4, 1e-4)}
ARMS = {
    ("reference", "projection"): (4, {"ideal-driven": 2.56e-6, "ideal-free": 5.12e-6}),
    ("exudyn", "trapezoidal"): (2, {"ideal-driven": 1.6e-4, "ideal-free": 3.2e-4}),
    ("pymunk", "tuned"): (2, {"ideal-driven": 4.8e-3, "ideal-free": 8e-3}),
}
#: Every signal's error as a multiple of the position's, with its heading and its truth's uncertainty.
SIGNALS = {
    "slider_position_error_m": (1, "slider position [m]", 1e-12),
    "slider_velocity_error_m_s": (100, "slider velocity [m/s]", 2e-12),
    "joint_O_force_error_N": (3000, "joint O force [N]", 3e-12),
    "joint_A_force_error_N": (7000, "joint A force [N]", 4e-12),
    "joint_B_force_error_N": (5000, "joint B force [N]", 5e-12),
    "guide_normal_force_error_N": (2000, "guide normal force [N]", 6e-12),
    "driver_torque_error_N_m": (50, "driver torque [N·m]", 7e-12),
}
#: Exudyn's force at A is the best of all, in N at the longest step.
BEST_AT_A_N = 1.2e-5
UNACCOUNTED = {"reference": 1.6e-6, "exudyn": 3.2e-3, "pymunk": 2.4e-2}
VIOLATION_M = {"reference": 2e-15, "exudyn": 5e-9, "pymunk": 4e-4}
#: heyoka's position error in m by the tolerance that it was given; one is below truth's uncertainty.
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


@pytest.fixture(scope="module")
def sections(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Section]:
    rows: list[dict[str, Any]] = []
    curves = {}
    for scene, steps in STEPS.items():
        for (engine, arm), (order, _) in ARMS.items():
            for k, step in enumerate(steps):
                signals = [column for column in SIGNALS if has(scene, column)]
                columns: dict[str, Any] = {c: signal_error(scene, engine, arm, k, c) for c in signals}
                columns |= {c.replace("_error_", "_uncertainty_"): SIGNALS[c][2] for c in signals}
                columns["unaccounted_energy_part"] = UNACCOUNTED[engine] / 2 ** (order * k)
                columns["constraint_violation_m"] = VIOLATION_M[engine] * (1 + k)
                columns |= {
                    "varied": "step",
                    "end_time_s": 0.05,
                    "compared_until_s": 0.05,
                    "steps": 100 * 2**k,
                }
                rows.append(row(len(rows), scene, engine, arm, step, **columns))
                position = columns["slider_position_error_m"]
                curves[rows[-1]["case"]] = {
                    "time_s": [0.0, 0.02, 0.03, 0.05],
                    "slider_position_error_m": [0.0, position, position / 2, position / 4],
                    "unaccounted_energy_part": [0.0, 0.1, 0.2, 0.05],
                    "constraint_violation_m": [0.0, 1.0, 3.0, 2.0],
                }
    for scene, errors in BY_TOLERANCE.items():
        for tolerance, position in errors.items():
            columns = {
                "varied": "tolerance",
                "setting_step_tolerance": tolerance,
                "steps": 20,
                "end_time_s": 0.05,
            }
            columns |= {c: SIGNALS[c][0] * position for c in SIGNALS if has(scene, c)}
            columns |= {
                c.replace("_error_", "_uncertainty_"): SIGNALS[c][2] for c in SIGNALS if has(scene, c)
            }
            rows.append(row(len(rows), scene, "heyoka", "Taylor", 0.05, compared_until_s=0.05, **columns))
    results = results_of(tmp_path_factory.mktemp("results") / "agreement", rows, curves)
    return {section.name: section for section in agreement.sections(results)}


def table(sections: dict[str, Section], name: str) -> Table:
    return next(one for section in sections.values() for one in section.tables if one.name == name)


def figure(sections: dict[str, Section], name: str) -> Figure:
    return next(one for section in sections.values() for one in section.figures if one.name == name)


def drawn(line: Line2D) -> tuple[list[float], list[float]]:
    """Return a line's points, x and y."""
    points = np.asarray(line.get_xydata())
    return points[:, 0].tolist(), points[:, 1].tolist()


def cell(scene: str, column: str, value: float) -> str:
    return f"{value:.1e}" if has(scene, column) else "–"


def test_the_errors_at_one_step_are_those_of_the_middle_step(sections: dict[str, Section]) -> None:
    shown = table(sections, "agreement-errors")
    assert shown.head == ("scene", "step [s]", "engine", "arm", *(signal[1] for signal in SIGNALS.values()))
    expected = []
    for scene, step in (("ideal-driven", "2.0e-05"), ("ideal-free", "2.0e-04")):
        for engine, arm in ARMS:
            cells = (cell(scene, c, signal_error(scene, engine, arm, 1, c)) for c in SIGNALS)
            expected.append((scene, step, engine, arm, *cells))
        doubts = (cell(scene, column, SIGNALS[column][2]) for column in SIGNALS)
        expected.append((scene, step, "truth", "uncertainty", *doubts))
    assert list(shown.rows) == expected


def test_the_smallest_errors_are_those_of_the_shortest_step(sections: dict[str, Section]) -> None:
    shown = table(sections, "agreement-smallest-errors")
    assert shown.head == ("scene", "engine", "arm", *(signal[1] for signal in SIGNALS.values()))
    expected = []
    for scene in STEPS:
        for engine, arm in ARMS:
            cells = (cell(scene, c, signal_error(scene, engine, arm, 2, c)) for c in SIGNALS)
            expected.append((scene, engine, arm, *cells))
    assert list(shown.rows) == expected


def test_orders_are_those_of_the_numbers(sections: dict[str, Section]) -> None:
    shown = table(sections, "agreement-orders")
    names = (signal[1].partition(" [")[0] for signal in SIGNALS.values())
    assert shown.head == ("scene", "engine", "arm", *names)
    expected = [
        (scene, engine, arm, *(f"{order}.00" if has(scene, c) else "–" for c in SIGNALS))
        for scene in STEPS
        for (engine, arm), (order, _) in ARMS.items()
    ]
    assert list(shown.rows) == expected
    text = sections["convergence"].text
    assert text == tuple(
        f"{engine} ({arm}), {signal}: order {order}.00 on ideal-driven and ideal-free."
        for (engine, arm), (order, _) in ARMS.items()
        for signal in ("slider position", "largest joint force")
    )


def test_errors_by_tolerance_stand_beside_the_tolerance(sections: dict[str, Section]) -> None:
    shown = table(sections, "agreement-tolerances")
    assert shown.head == ("scene", "engine", "arm", "tolerance", *(signal[1] for signal in SIGNALS.values()))
    expected = []
    for scene, tolerance, position in (
        ("ideal-driven", "step_tolerance 1e-06", 4e-7),
        ("ideal-driven", "step_tolerance 1e-08", 2e-9),
        ("ideal-free", "step_tolerance 1e-06", 3e-5),
    ):
        cells = (cell(scene, column, signal[0] * position) for column, signal in SIGNALS.items())
        expected.append((scene, "heyoka", "Taylor", tolerance, *cells))
    assert list(shown.rows[:3]) == expected
    assert shown.rows[3][:5] == ("ideal-free", "heyoka", "Taylor", "step_tolerance 1e-15", "< 1.0e-12")
    # 4e-7 of 1e-6 is 0.4, 2e-9 of 1e-8 a fifth, 3e-5 of 1e-6 thirty; the last, 500, is not told from truth.
    assert sections["tolerance"].text == (
        "heyoka (Taylor) has slider position errors, in m, of at most 30 times the tolerance asked for, on "
        "both "
        "scenes.",
    )
    panel = figure(sections, "agreement-tolerance-position").drawing.axes[0]
    assert (panel.get_title(), panel.get_xlabel()) == ("ideal-driven", "tolerance")
    assert panel.get_ylabel() == "slider position error [m]"
    assert drawn(panel.lines[0]) == ([1e-8, 1e-6], [2e-9, 4e-7])


def test_the_sentences_name_who_errs_least_in_which_signal(sections: dict[str, Section]) -> None:
    best = (
        "the smallest error is that of exudyn (trapezoidal) in joint A force and that of reference "
        "(projection) in every other signal; without the reference, that of exudyn (trapezoidal) in every "
        "signal."
    )
    assert sections["one-step"].text == (
        f"On ideal-driven at a step of 2.0×10⁻⁵ s {best}",
        f"On ideal-free at a step of 2.0×10⁻⁴ s {best}",
    )


def test_energy_and_constraints_are_those_at_the_middle_step(sections: dict[str, Section]) -> None:
    shown = table(sections, "agreement-conservation")
    head = ("scene", "step [s]", "engine", "arm", "unaccounted energy part", "constraint violation [m]")
    assert shown.head == head
    # A sixteenth or a quarter of the residuals, and twice the violations, above.
    numbers = {"reference": ("1.0e-07", "4.0e-15"), "exudyn": ("8.0e-04", "1.0e-08")}
    numbers["pymunk"] = ("6.0e-03", "8.0e-04")
    expected = [
        (scene, step, engine, arm, *numbers[engine])
        for scene, step in (("ideal-driven", "2.0e-05"), ("ideal-free", "2.0e-04"))
        for engine, arm in ARMS
    ]
    assert list(shown.rows) == expected
    assert sections["conservation"].text == (
        "At the steps of the table, on both scenes: the largest unaccounted energy part is least with "
        "reference (projection), 1.0×10⁻⁷ and most with pymunk (tuned), 6.0×10⁻³.",
        "At the steps of the table, on both scenes: the largest constraint violation is least with reference "
        "(projection), 4.0×10⁻¹⁵ m and most with pymunk (tuned), 8.0×10⁻⁴ m.",
    )


@pytest.mark.parametrize(
    ("name", "label", "columns"),
    [
        ("slider-position", "slider position error [m]", "slider_position_error_m"),
        ("joint-force", "largest joint force error [N]", ""),
        ("slider-velocity", "slider velocity error [m/s]", "slider_velocity_error_m_s"),
        ("driver-torque", "driver torque error [N·m]", "driver_torque_error_N_m"),
    ],
)
def test_errors_are_drawn_against_the_step(
    sections: dict[str, Section], name: str, label: str, columns: str
) -> None:
    panel = figure(sections, f"agreement-{name}").drawing.axes[0]
    assert (panel.get_title(), panel.get_xlabel(), panel.get_ylabel()) == ("ideal-driven", "step [s]", label)
    assert (panel.get_xscale(), panel.get_yscale()) == ("log", "log")
    forces = [column for column in SIGNALS if column.startswith("joint_")]
    for line, (engine, arm) in zip(panel.lines, ARMS, strict=False):
        expected = [
            max(
                signal_error("ideal-driven", engine, arm, k, column)
                for column in ([columns] if columns else forces)
            )
            for k in (2, 1, 0)
        ]
        assert drawn(line)[0] == [1e-5, 2e-5, 4e-5]
        assert drawn(line)[1] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("name", "label", "so_far"),
    [
        ("slider-position-error", "slider position error so far [m]", [1.6e-7, 1.6e-7, 1.6e-7]),
        (
            "unaccounted-energy",
            "unaccounted energy part so far",
            [0.1, 0.2, 0.2],
        ),
        ("constraint-violation", "constraint violation so far [m]", [1.0, 3.0, 3.0]),
    ],
)
def test_curves_are_drawn_as_the_largest_so_far_over_time(
    sections: dict[str, Section], name: str, label: str, so_far: list[float]
) -> None:
    panel = figure(sections, f"agreement-{name}-over-time").drawing.axes[0]
    assert (panel.get_title(), panel.get_xlabel(), panel.get_ylabel()) == ("ideal-driven", "time [s]", label)
    (reference,) = (line for line in panel.lines if line.get_color() == "#000000")
    assert drawn(reference)[0] == [0.0, 0.02, 0.03, 0.05]
    assert drawn(reference)[1][1:] == pytest.approx(so_far)


def test_a_figure_has_one_quantity(sections: dict[str, Section]) -> None:
    assert mixed(sections) == []
