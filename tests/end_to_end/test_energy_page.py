"""The energy chapter on rows with round numbers: every cell, finding and axis worked out here."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from reports.chapters.answer import advice
from reports.chapters.energy import CHAPTER, STUDY
from reports.parts import Figure, Studies, Table
from tests.end_to_end.written_rows import mixed, results_of, row

SCENES = ("clearance-x", "ideal-x")
#: Configurations with their order and power gained in W at the longest of three steps.
ARMS = {("reference", "projection"): (4, -1.6e-6), ("pymunk", "tuned"): (2, 3e-2)}
STEPS_S, END_S, LARGEST_J = (2e-3, 1e-3, 5e-4), 2.0, 50.0
#: Terms of the energy balance at the end in J; those below are of contact, which dissipates 1.875 J in 2 s.
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
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
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
    return {STUDY: results_of(tmp_path_factory.mktemp("results") / STUDY, rows, curves)}


def table(studies: Studies, name: str) -> Table:
    return next(one for one in CHAPTER.tables(studies) if one and one.name == name)


def figure(studies: Studies, name: str) -> Figure:
    return next(one for one in CHAPTER.figures(studies) if one and one.name == name)


def test_numerical_dissipation_is_that_of_the_middle_step(studies: Studies) -> None:
    shown = table(studies, "energy-numerical-dissipation")
    assert not shown.shown
    assert shown.head == (
        "scene",
        "mean step [s]",
        "engine",
        "configuration",
        "numerical dissipation [W]",
        "± [W]",
        "order of the dissipation",
        "of it stabilisation [W]",
        "largest error, of the energy in play",
        "order of the largest error",
    )
    expected = []
    for scene in SCENES:
        for engine, arm in ARMS:
            power, order = power_W(engine, arm), f"{ARMS[engine, arm][0]}.00"
            half = abs(1.2 * power - 0.9 * power) / 2
            numbers = (f"{x:.1e}" for x in (-power, half))
            stabilisation = "5.0e-08" if engine == "reference" else "–"
            error = f"{abs(3 * power) / LARGEST_J:.1e}"
            where = (scene, "1.0e-03", engine, arm)
            expected.append((*where, *numbers, order, stabilisation, error, order))
    assert list(shown.rows) == expected


def test_the_page_has_the_dissipation_by_configuration_and_scene(studies: Studies) -> None:
    shown = table(studies, "energy-dissipation-by-scene")
    assert shown.shown
    assert shown.head == ("configuration", *SCENES)
    # A gain of 7.5e-3 W with an interval from 0.9 to 1.2 times that, and a loss of 1e-7 W.
    assert shown.rows == (
        ("reference (projection)", *["1.0e-07 ± 1.5e-08"] * 2),
        ("pymunk (tuned)", *["-7.5e-03 ± 1.1e-03"] * 2),
    )


def test_what_did_not_finish_or_is_not_resolved_says_so_on_the_page(studies: Studies) -> None:
    """A power of 7.5e-3 W whose interval is 17e-3 W wide is below 1.6e-2 W."""
    rows = studies[STUDY].rows
    pymunk, reference = rows["engine"] == "pymunk", rows["engine"] == "reference"
    wide = rows["hidden_power_low_W"].mask(pymunk, -1e-3), rows["hidden_power_high_W"].mask(pymunk, 16e-3)
    changed = rows.assign(
        hidden_power_low_W=wide[0],
        hidden_power_high_W=wide[1],
        status=rows["status"].mask(reference & (rows["scene"] == "ideal-x"), "failed"),
    )
    shown = table({STUDY: replace(studies[STUDY], rows=changed)}, "energy-dissipation-by-scene")
    assert shown.rows == (
        ("reference (projection)", "1.0e-07 ± 1.5e-08", "failed"),
        ("pymunk (tuned)", *["< 1.6e-02"] * 2),
    )


def test_the_findings_tell_how_constraints_drift(studies: Studies) -> None:
    found = {finding.name: finding for finding in CHAPTER.findings(studies)}
    assert list(found) == ["drift-bounded", "reliability"]
    assert found["drift-bounded"] == (
        "Stabilisation bounds the drift: with projection gaps are round-off, at most 40 nm."
    )


def test_the_first_screen_recommends_who_keeps_the_energy_balance(studies: Studies) -> None:
    """The reference is off by 3e-7 J of 50 J; Pymunk by 4.5e-4 of the energy in play, more than 0.01 %."""
    ((need, use, _, *others),) = (each.cells for each in advice(studies))
    assert (need, use) == (
        "energy balance within 0.01 % over 20 revolutions",
        "reference (projection), step 0.001 s",
    )
    assert others == ["not timed", "no other engine"]


@pytest.mark.parametrize("scene", SCENES)
def test_every_term_of_the_energy_balance_has_its_column(studies: Studies, scene: str) -> None:
    shown = table(studies, f"energy-ledger-{scene}")
    head = ("engine", "configuration", *lines(scene), "stabilisation loss [J]", "residual [J]")
    assert shown.head == head
    cells = [f"{value:g}" for value in lines(scene).values()]
    assert shown.rows == (
        ("reference", "projection", *cells, "1e-07", "-2.0e-07"),
        ("pymunk", "tuned", *cells, "–", "1.5e-02"),
    )


def test_drift_tells_gap_and_speed_with_their_powers_of_time(studies: Studies) -> None:
    shown = table(studies, "energy-drift")
    gap = ("largest gap [m]", "gap, exponent of time", "gap, order in the step")
    speed = ("largest gap speed [m/s]", "gap speed, exponent of time", "gap speed, order in the step")
    assert shown.head == ("scene", "mean step [s]", "engine", "configuration", *gap, *speed)
    none = ("4.0e-08", "–", "–", "6.0e-06", "–", "–")
    drifting = ("4.0e-08", "1.00", "flat", "6.0e-06", "0.50", "flat")
    assert shown.rows == tuple(
        (scene, "1.0e-03", engine, arm, *(drifting if (scene, engine) == ("ideal-x", "pymunk") else none))
        for scene in SCENES
        for engine, arm in ARMS
    )


def test_the_error_is_drawn_against_the_mean_step(studies: Studies) -> None:
    for panel, scene in zip(figure(studies, "energy-error-by-step").drawing.axes, SCENES, strict=True):
        axes = "mean step [s]", "largest error of the\nenergy balance [J]"
        assert (panel.get_title(), panel.get_xlabel(), panel.get_ylabel()) == (scene, *axes)
        for line, (engine, arm) in zip(panel.lines, ARMS, strict=False):
            points = np.asarray(line.get_xydata())
            assert points[:, 0] == pytest.approx(STEPS_S[::-1])
            assert points[:, 1] == pytest.approx([3 * abs(power_W(engine, arm, k)) for k in (2, 1, 0)])


def test_losses_are_stacked_below_the_work_that_is_not_stored(studies: Studies) -> None:
    """Of 8 J, 6 are stored and 1.875 lost; the line is at the end of the run, 2 s."""
    shown = figure(studies, "energy-balance")
    assert shown.reading.startswith("On clearance-x. ")
    assert [ax.get_title() for ax in shown.drawing.axes] == [f"{engine} ({arm})" for engine, arm in ARMS]
    for panel in shown.drawing.axes:
        (work,) = (line for line in panel.lines if line.get_color() == "#000000")
        assert np.asarray(work.get_xydata())[-1] == pytest.approx([END_S, 2.0])
        tops = [
            np.asarray(path.vertices)[:, 1].max() for patch in panel.collections for path in patch.get_paths()
        ]
        assert tops == pytest.approx([1.25, 1.75, 1.875])


def test_figures_over_time_need_curves(studies: Studies) -> None:
    published = replace(studies[STUDY], store=None)
    names = [one.name for one in CHAPTER.figures({STUDY: published}) if one]
    assert names == ["energy-error-by-step"]


def test_a_figure_has_one_quantity(studies: Studies) -> None:
    assert mixed(one for one in CHAPTER.figures(studies) if one) == []
