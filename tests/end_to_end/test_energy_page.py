"""The energy chapter on rows with round numbers: every cell, sentence and axis worked out here."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from reports.chapters import energy
from reports.parts import Section, Table
from tests.end_to_end.written_rows import mixed, results_of, row

SCENES = ("clearance-x", "ideal-x")
#: Arms with their order and hidden power in W at the longest of three steps.
ARMS = {("reference", "projection"): (4, -1.6e-6), ("pymunk", "tuned"): (2, 3e-2)}
STEPS_S, END_S, LARGEST_J = (2e-3, 1e-3, 5e-4), 2.0, 50.0
#: Ledger lines at the end in J; those below are of contact alone. They dissipate 1.875 J in 2 s.
STORED = {"kinetic change [J]": 5.0, "gravitational change [J]": 0.25}
OF_CONTACT = {
    "elastic change [J]": 0.75,
    "driver work [J]": 8.0,
    "contact B normal loss [J]": 1.25,
    "contact B friction loss [J]": 0.5,
    "contact B clipped loss [J]": 0.125,
}
DISSIPATED_W, STABILISATION_J = 0.9375, 1e-7


def power_W(engine: str, arm: str, halvings: int = 1) -> float:
    order, first = ARMS[engine, arm]
    return first / float(2 ** (order * halvings))


def column(heading: str) -> str:
    return heading.replace(" [J]", "_J").replace(" ", "_")


def lines(scene: str) -> dict[str, float]:
    return {**STORED, **(OF_CONTACT if scene == "clearance-x" else {})}


@pytest.fixture(scope="module")
def sections(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Section]:
    rows: list[dict[str, Any]] = []
    curves = {}
    for scene in SCENES:
        for engine, arm in ARMS:
            for k, step_s in enumerate(STEPS_S):
                power = power_W(engine, arm, k)
                low, high = sorted((0.9 * power, 1.2 * power))
                columns: dict[str, Any] = {"steps": 1000 * 2**k, "end_time_s": END_S, "rung": k}
                columns |= {"energy_in_play_J": LARGEST_J, "mean_step_s": step_s, "turns": 20.0}
                columns |= {"hidden_power_W": power, "hidden_power_low_W": low, "hidden_power_high_W": high}
                columns |= {"mean_hidden_power_W": 1.1 * power, "largest_numerical_gain_J": abs(3 * power)}
                columns |= {"energy_balance_residual_J": 2 * power, "quality_failure": ""}
                columns |= {"unaccounted_energy_part": abs(3 * power) / LARGEST_J}
                columns |= {"constraint_violation_m": 4e-8, "constraint_speed_m_s": 6e-6}
                columns |= {column(heading): value for heading, value in lines(scene).items()}
                if scene == "clearance-x":
                    columns["dissipated_power_W"] = DISSIPATED_W
                elif engine == "pymunk":
                    columns |= {"constraint_violation_exponent": 1.0, "constraint_speed_exponent": 0.5}
                if engine == "reference":
                    columns["stabilisation_loss_J"] = STABILISATION_J
                    columns["stabilisation_power_W"] = -STABILISATION_J / END_S
                rows.append(row(len(rows), scene, engine, arm, step_s, **columns))
                curve = {
                    "time_s": [0.0, 1.0, 2.0],
                    "numerical_gain_so_far_J": [0.0, abs(power), abs(3 * power)],
                    "constraint_violation_so_far_m": [0.0, 2e-8, 4e-8],
                    "constraint_speed_so_far_m_s": [0.0, 3e-6, 6e-6],
                    "energy_balance_residual_J": [0.0, power, 2 * power],
                    "stabilisation_loss_J": [0.0, 5e-8, 1e-7],
                }
                curve |= {column(name): [0.0, end / 2, end] for name, end in lines(scene).items()}
                curves[rows[-1]["case"]] = curve
    results = results_of(tmp_path_factory.mktemp("results") / "energy", rows, curves)
    return {section.name: section for section in energy.sections(results)}


def table(sections: dict[str, Section], name: str) -> Table:
    return next(one for section in sections.values() for one in section.tables if one.name == name)


def test_hidden_power_is_that_of_the_middle_step(sections: dict[str, Section]) -> None:
    shown = table(sections, "energy-hidden-power")
    assert shown.head == (
        "scene",
        "mean step [s]",
        "engine",
        "arm",
        "hidden power [W]",
        "± [W]",
        "± as a part",
        "order of the power",
        "mean over the run [W]",
        "of it stabilisation [W]",
        "largest gain, of the energy in play",
        "order of the largest gain",
    )
    expected = []
    for scene in SCENES:
        for engine, arm in ARMS:
            power, order = power_W(engine, arm), f"{ARMS[engine, arm][0]}.00"
            half = abs(1.2 * power - 0.9 * power) / 2
            numbers = (f"{x:.1e}" for x in (power, half, half * END_S / LARGEST_J))
            stabilisation = "-5.0e-08" if engine == "reference" else "–"
            mean, gain = f"{1.1 * power:.1e}", f"{abs(3 * power) / LARGEST_J:.1e}"
            where = (scene, "1.0e-03", engine, arm)
            expected.append((*where, *numbers, order, mean, stabilisation, gain, order))
    assert list(shown.rows) == expected
    assert sections["hidden-power"].text == (
        "Runs take 20 revolutions on ideal joints and 20 revolutions with contact.",
        *(
            f"On {scene} the hidden power is −1.0×10⁻⁷ W with reference (projection) and +7.5×10⁻³ W with "
            "pymunk (tuned)."
            for scene in SCENES
        ),
    )


@pytest.mark.parametrize("scene", SCENES)
def test_every_line_of_the_ledger_has_its_column(sections: dict[str, Section], scene: str) -> None:
    shown = table(sections, f"energy-ledger-{scene}")
    assert shown.head == ("engine", "arm", *lines(scene), "stabilisation loss [J]", "residual [J]")
    cells = [f"{value:.5f}" for value in lines(scene).values()]
    assert shown.rows == (
        ("reference", "projection", *cells, "1.0e-07", "-2.0e-07"),
        ("pymunk", "tuned", *cells, "–", "1.5e-02"),
    )
    # 3 s of the hidden powers of 1e-7 and 7.5e-3 W, in parts of 50 J.
    assert sections["ledger"].text == (
        "On the one scene with contact, in parts of the energy in play: the ledger lacks or has too much at "
        "most 6.0×10⁻⁹ with reference (projection) and 4.5×10⁻⁴ with pymunk (tuned).",
    )


def test_drift_tells_gap_and_speed_with_their_powers_of_time(sections: dict[str, Section]) -> None:
    shown = table(sections, "energy-drift")
    gap = ("largest gap [m]", "exponent of time", "order in the step")
    speed = ("largest gap speed [m/s]", "exponent of time", "order in the step")
    assert shown.head == ("scene", "mean step [s]", "engine", "arm", *gap, *speed)
    none = ("4.0e-08", "–", "–", "6.0e-06", "–", "–")
    drifting = ("4.0e-08", "1.00", "flat", "6.0e-06", "0.50", "flat")
    assert shown.rows == tuple(
        (scene, "1.0e-03", engine, arm, *(drifting if (scene, engine) == ("ideal-x", "pymunk") else none))
        for scene in SCENES
        for engine, arm in ARMS
    )
    assert sections["drift"].text == (
        "Projection leaves round-off alone on the one scene: gaps of at most 4.0×10⁻⁸ m.",
    )


@pytest.mark.parametrize(
    ("name", "axes", "abscissae", "factors"),
    [
        ("energy-gain-over-time", ("time [s]", "energy gained or lost\nso far [J]"), [1.0, 2.0], [1, 3]),
        ("energy-gain-by-step", ("mean step [s]", "largest energy\ngained or lost [J]"), STEPS_S[::-1], None),
    ],
)
def test_gains_are_drawn_over_time_and_against_the_step(
    sections: dict[str, Section],
    name: str,
    axes: tuple[str, str],
    abscissae: Sequence[float],
    factors: list[float] | None,
) -> None:
    figures = {one.name: one for section in sections.values() for one in section.figures}
    for panel, scene in zip(figures[name].drawing.axes, SCENES, strict=False):
        assert (panel.get_title(), panel.get_xlabel(), panel.get_ylabel()) == (scene, *axes)
        for line, (engine, arm) in zip(panel.lines, ARMS, strict=False):
            if factors is None:
                expected = [3 * abs(power_W(engine, arm, k)) for k in (2, 1, 0)]
            else:
                expected = [factor * abs(power_W(engine, arm)) for factor in factors]
            points = np.asarray(line.get_xydata())[-len(abscissae) :]
            assert points[:, 0] == pytest.approx(abscissae)
            assert points[:, 1] == pytest.approx(expected)


def test_hidden_power_against_the_step_is_that_of_scenes_without_clearance(
    sections: dict[str, Section],
) -> None:
    figures = {one.name: one for section in sections.values() for one in section.figures}
    (panel,) = figures["energy-hidden-power-by-step"].drawing.axes
    assert (panel.get_title(), panel.get_ylabel()) == ("ideal-x", "hidden power, size [W]")
    for line, (engine, arm) in zip(panel.lines, ARMS, strict=False):
        assert np.asarray(line.get_ydata()) == pytest.approx(
            [abs(power_W(engine, arm, k)) for k in (2, 1, 0)]
        )


@pytest.mark.parametrize(
    ("name", "axis", "largest"),
    [
        ("energy-gaps-over-time", "largest gap so far [m]", [2e-8, 4e-8]),
        ("energy-gap-speeds-over-time", "largest gap speed so far [m/s]", [3e-6, 6e-6]),
    ],
)
def test_gaps_and_their_speeds_have_a_figure_each(
    sections: dict[str, Section], name: str, axis: str, largest: list[float]
) -> None:
    figures = {one.name: one for section in sections.values() for one in section.figures}
    (panel,) = figures[name].drawing.axes
    assert (panel.get_title(), panel.get_xlabel(), panel.get_ylabel()) == ("ideal-x", "time [s]", axis)
    for line in panel.lines:
        assert np.asarray(line.get_xydata()) == pytest.approx(
            np.array([[1.0, largest[0]], [2.0, largest[1]]])
        )


def test_a_figure_has_one_quantity(sections: dict[str, Section]) -> None:
    assert mixed(sections) == []
