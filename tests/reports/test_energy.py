"""The energy study's cases, and its chapter from a small run of all engines."""

from concurrent.futures import ThreadPoolExecutor

import matplotlib as mpl
import pandas as pd
import pytest

from reports.chapters import energy as chapter
from reports.chapters.energy import drift, hidden_power
from reports.chapters.energy.rungs import prepared
from reports.chapters.energy.tables import ledger_table, power_table
from reports.parts import Contradiction, Section
from reports.quantities import finished
from reports.results import Results, read_study
from reports.style import RC
from reports.tables import in_text
from studies import energy
from studies.running.runner import run_study


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The reference's whole ladders without clearance, the middle rung of some others."""
    folder = tmp_path_factory.mktemp("energy")
    wanted = {
        ("exudyn", "trapezoidal"),
        ("pymunk", "tuned"),
        ("pymunk", "out of the box"),
        ("scipy", "DOP853"),
    }
    cases = [
        case
        for case in energy.cases(full=False)
        if (case.engine == "reference" and not case.scene.joints_with_clearance)
        or (
            (case.engine, case.arm.name) in wanted
            and case.columns["rung"] == 1
            and case.scene.name in ("ideal-free", "ideal-driven", "clearance-driven-damped")
        )
    ]
    run_study("energy", cases, folder, lambda: ThreadPoolExecutor(1))
    return read_study(folder)


@pytest.fixture(scope="module")
def sections(results: Results) -> list[Section]:
    with mpl.rc_context(RC):
        return chapter.sections(results)


def test_the_full_set_contains_the_quick_one_and_runs_ten_times_as_long() -> None:
    quick, full = energy.cases(full=False), energy.cases(full=True)
    assert [case for case in full if case in quick] == quick
    ends = {case.scene.name: case.scene.end_time_s for case in full}
    for length in energy.SHORT:
        assert ends[f"{length.scene}-long"] >= 9.99 * length.end_s
    by_step = [
        case
        for case in full
        if case.engine == "reference" and case.arm.name != "DOP853" and not case.scene.name.endswith("-turns")
    ]
    steps = {(case.scene.name, f"{case.run.step_s:.6e}") for case in by_step}
    of_both = {(name.removesuffix("-long"), step) for name, step in steps}
    short = {(name, step) for name, step in steps if not name.endswith("-long")}
    assert of_both == short, "long runs take the steps of the short ones"


def test_samples_of_a_driven_scene_divide_its_turns() -> None:
    for length in (*energy.SHORT, *energy.LONG):
        if "driven" in length.scene:
            turns = length.end_s / energy.TURN_S
            assert turns == pytest.approx(round(turns))
            assert length.intervals % round(turns) == 0


def test_the_chapter_has_its_figures_and_a_ledger_for_every_scene(sections: list[Section]) -> None:
    figures = {figure.name for section in sections for figure in section.figures}
    tables = {table.name for section in sections for table in section.tables}
    assert {"energy-gain-over-time", "energy-gain-by-step", "energy-hidden-power-by-step"} <= figures
    assert {"energy-gaps-over-time", "energy-gap-speeds-over-time"} <= figures
    assert "energy-driver-work-clearance-driven-damped" in figures
    scenes = ("ideal-free", "ideal-driven", "clearance-driven-damped")
    assert {f"energy-ledger-{scene}" for scene in scenes} <= tables
    assert all(len(figure.alt) > 40 for section in sections for figure in section.figures)


def test_ledgers_have_no_column_that_their_scene_has_no_use_for(sections: list[Section]) -> None:
    heads = {table.name: " ".join(table.head) for section in sections for table in section.tables}
    free, driven = heads["energy-ledger-ideal-free"], heads["energy-ledger-ideal-driven"]
    assert "contact" not in free + driven
    assert "elastic" not in free + driven
    assert "driver work" not in free
    assert "driver work [J]" in driven
    assert "contact B friction loss [J]" in heads["energy-ledger-clearance-driven-damped"]


@pytest.fixture(scope="module")
def rows(results: Results) -> pd.DataFrame:
    return prepared(results.rows)


def tuned(rows: pd.DataFrame) -> pd.DataFrame:
    """Return Pymunk's row on the driven scene."""
    return rows[(rows["label"] == "pymunk (tuned)") & (rows["scene"] == "ideal-driven")]


def test_the_tables_show_the_numbers_of_the_rows(rows: pd.DataFrame) -> None:
    row = tuned(rows).iloc[0]
    (shown,) = power_table(tuned(rows), rows).rows
    assert shown[2:4] == ("pymunk", "tuned")
    assert shown[4] == f"{row['hidden_power_W']:.1e}"
    ledger = ledger_table(tuned(rows))
    cells = dict(zip(ledger.head, ledger.rows[0], strict=True))
    assert float(cells["driver work [J]"]) == pytest.approx(row["driver_work_J"], abs=1e-5)
    kept, spent = float(cells["kinetic change [J]"]), float(cells["driver work [J]"])
    assert kept - spent == pytest.approx(float(cells["residual [J]"]), abs=1e-2)


def test_what_is_not_told_from_zero_is_shown_as_below(rows: pd.DataFrame) -> None:
    power = {"hidden_power_W": 1e-3, "hidden_power_low_W": -2e-3, "hidden_power_high_W": 4e-3}
    doubtful = prepared(tuned(rows).assign(**power))
    assert power_table(doubtful, doubtful).rows[0][4] == "< 4.0e-03"
    (sentence,) = hidden_power(doubtful)
    part = in_text(3e-3 * tuned(rows)["end_time_s"].iloc[0] / tuned(rows)["energy_in_play_J"].iloc[0])
    assert f"is not told from zero, to within {part} of the energy in play" in sentence


def test_nothing_is_told_from_an_interval_that_is_wide_against_the_energy_in_play(rows: pd.DataFrame) -> None:
    row = finished(rows[rows["has_clearance"]]).iloc[:1]
    in_play_W = (row["energy_in_play_J"] / row["end_time_s"]).iloc[0]
    for part, said, shown in (
        (0.5, "nothing can be told of the hidden power", "unknown"),
        (5e-5, "is not told from zero, to within 5.0×10⁻⁵ of the energy in play", "< "),
    ):
        half = part * in_play_W
        power = {"hidden_power_W": 0.0, "hidden_power_low_W": -half, "hidden_power_high_W": half}
        doubtful = prepared(row.assign(**power))
        (sentence,) = hidden_power(doubtful)
        assert said in sentence
        assert power_table(doubtful, doubtful).rows[0][4].startswith(shown)


def test_the_least_and_the_largest_hidden_power_are_told(rows: pd.DataFrame) -> None:
    row = tuned(rows)
    powers = (-3e-2, 1e-3, 2e-2)
    several = pd.concat(
        row.assign(
            label=f"arm {k}", hidden_power_W=power, hidden_power_low_W=power, hidden_power_high_W=power
        )
        for k, power in enumerate(powers)
    )
    (sentence,) = hidden_power(prepared(several))
    assert "+1.0×10⁻³ W with arm 1 and −3.0×10⁻² W with arm 0, and between these with arm 2" in sentence


def test_no_order_is_claimed_of_runs_that_gain_or_lose_a_good_part_of_their_energy(
    rows: pd.DataFrame,
) -> None:
    ladder = rows[(rows["label"] == "reference (none)") & (rows["scene"] == "ideal-free")]
    near, far = (prepared(ladder.assign(unaccounted_energy_part=part)) for part in (0.009, 0.011))
    shown = [power_table(of, of).rows[0][-1] for of in (near, far)]
    assert float(shown[0]) == pytest.approx(4, abs=0.5)
    assert shown[1] == "too few points"


def test_those_who_can_run_hundreds_of_turns_with_contact() -> None:
    lasting = [case.scene for case in energy.cases(full=True) if case.scene.name.endswith("-turns")]
    assert {round(scene.end_time_s / energy.TURN_S) for scene in lasting} == {100, 300}
    assert all(scene.joints_with_clearance for scene in lasting)


def test_drift_of_another_power_of_time_breaks_the_chapter(rows: pd.DataFrame) -> None:
    speeds, gaps = list(drift(rows))[:2]
    assert "in proportion to time (exponents " in speeds
    assert "with the square of time (exponents " in gaps
    free = (rows["label"] == "reference (none)") & (rows["scene"] == "ideal-free")
    for name, value, sentence in (
        ("constraint_violation_exponent", 1.5, "with the square of time"),
        ("constraint_speed_exponent", 0.5, "drift on both scenes as theory has it for RK4"),
    ):
        with pytest.raises(Contradiction, match=sentence):
            list(drift(rows.assign(**{name: rows[name].mask(free, value)})))


def test_curves_are_thin_and_intervals_have_their_ends_in_order(results: Results) -> None:
    rows = finished(results.rows)
    assert (rows["hidden_power_low_W"] <= rows["hidden_power_high_W"]).all()
    for case in rows["case"]:
        assert len(results.curve(case, "numerical_gain_so_far_J")) <= energy.KEPT + 1
