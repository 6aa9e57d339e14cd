"""The energy study's cases, and its chapter from a small run of all engines."""

import matplotlib as mpl
import pandas as pd
import pytest

from reports.chapters.energy import (
    CHAPTER,
    STUDY,
    at_middle,
    dissipation_by_scene,
    dissipation_table,
    drift,
    energy_parts,
    has_contact,
    ledger_table,
    prepared,
)
from reports.parts import Contradiction
from reports.quantities import finished
from reports.results import Results, read_study
from reports.style import RC
from studies import energy
from tests.helpers.running import run_in


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The reference at all settings without clearance, some others at the middle one."""
    folder = tmp_path_factory.mktemp("energy")
    wanted = {
        ("exudyn", "trapezoidal"),
        ("pymunk", "tuned"),
        ("pymunk", "out of the box"),
        ("scipy", "solve_ivp, DOP853"),
    }
    cases = [
        case
        for case in energy.cases(full=True)
        if case.scene.name in ("ideal-free", "ideal-driven", "clearance-driven-damped")
        and (
            (case.engine == "reference" and not case.scene.joints_with_clearance)
            or ((case.engine, case.arm.name) in wanted and case.columns["rung"] == 1)
        )
    ]
    run_in(folder, cases)
    return read_study(folder, "energy")


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


def test_the_chapter_has_its_figures_and_a_table_of_the_balance_for_every_scene(results: Results) -> None:
    with mpl.rc_context(RC):
        figures = [figure.name for figure in CHAPTER.figures({STUDY: results}) if figure]
    assert figures == ["energy-balance", "energy-error-by-step"]
    tables = [table for table in CHAPTER.tables({STUDY: results}) if table]
    scenes = ("ideal-free", "ideal-driven", "clearance-driven-damped")
    assert {f"energy-ledger-{scene}" for scene in scenes} <= {table.name for table in tables}
    assert [table.name for table in tables if table.shown] == ["energy-dissipation-by-scene"]


def test_energy_tables_have_no_column_that_their_scene_has_no_use_for(results: Results) -> None:
    heads = {table.name: " ".join(table.head) for table in CHAPTER.tables({STUDY: results}) if table}
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
    (shown,) = dissipation_table(tuned(rows), rows).rows
    assert shown[2:4] == ("pymunk", "tuned")
    assert shown[4] == f"{-row['hidden_power_W']:.1e}"
    ledger = ledger_table(tuned(rows))
    cells = dict(zip(ledger.head, ledger.rows[0], strict=True))
    assert float(cells["driver work [J]"]) == pytest.approx(row["driver_work_J"], abs=1e-5)
    kept, spent = float(cells["kinetic change [J]"]), float(cells["driver work [J]"])
    assert kept - spent == pytest.approx(float(cells["residual [J]"]), abs=1e-2)


def test_what_is_not_resolved_from_zero_is_shown_as_below(rows: pd.DataFrame) -> None:
    power = {"hidden_power_W": 1e-3, "hidden_power_low_W": -2e-3, "hidden_power_high_W": 4e-3}
    doubtful = prepared(tuned(rows).assign(**power))
    assert dissipation_table(doubtful, doubtful).rows[0][4] == "< 4.0e-03"
    assert dissipation_by_scene(doubtful).rows[0][1] == "< 4.0e-03"


def test_the_part_of_a_configuration_is_that_of_its_worst_scene(rows: pd.DataFrame) -> None:
    middle = finished(at_middle(rows))
    for each in energy_parts(rows):
        own = middle[middle["label"] == each.label]
        assert each.part == own["unaccounted_energy_part"].max()
        assert (each.fewest_turns, each.most_turns) == (own["turns"].min(), own["turns"].max())
        assert (each.scenes, each.of_scenes) == (own["scene"].nunique(), 3)
    parts = [each.part for each in energy_parts(rows)]
    assert parts == sorted(parts)


def test_parts_of_scenes_with_contact_are_of_these_alone(rows: pd.DataFrame) -> None:
    of_contact = energy_parts(rows[has_contact(rows)])
    assert {each.of_scenes for each in of_contact} == {1}


def test_no_order_is_claimed_of_runs_that_gain_or_lose_a_good_part_of_their_energy(
    rows: pd.DataFrame,
) -> None:
    series = rows[(rows["label"] == "reference (none)") & (rows["scene"] == "ideal-free")]
    near, far = (prepared(series.assign(unaccounted_energy_part=part)) for part in (0.009, 0.011))
    shown = [dissipation_table(of, of).rows[0][-1] for of in (near, far)]
    assert float(shown[0]) == pytest.approx(4, abs=0.5)
    assert shown[1] == "too few points"


def test_those_who_can_run_hundreds_of_turns_with_contact() -> None:
    lasting = [case.scene for case in energy.cases(full=True) if case.scene.name.endswith("-turns")]
    assert {round(scene.end_time_s / energy.TURN_S) for scene in lasting} == {100, 300}
    assert all(scene.joints_with_clearance for scene in lasting)


def test_drift_of_another_power_of_time_breaks_the_chapter(rows: pd.DataFrame) -> None:
    assert "gap speeds grow in proportion to time, gaps with its square" in next(drift(rows))
    free = (rows["label"] == "reference (none)") & (rows["scene"] == "ideal-free")
    for name, value in (("constraint_violation_exponent", 1.5), ("constraint_speed_exponent", 0.5)):
        with pytest.raises(Contradiction, match="drift as theory predicts for RK4 on both scenes"):
            list(drift(rows.assign(**{name: rows[name].mask(free, value)})))


def test_drift_that_stabilisation_does_not_bound_breaks_the_chapter(rows: pd.DataFrame) -> None:
    for label in ("reference (Baumgarte)", "reference (projection)"):
        grows = rows["constraint_violation_exponent"].mask(rows["label"] == label, 0.5)
        with pytest.raises(Contradiction, match="Stabilisation bounds the drift"):
            list(drift(rows.assign(constraint_violation_exponent=grows)))


def test_curves_are_thin_and_intervals_have_their_ends_in_order(results: Results) -> None:
    rows = finished(results.rows)
    assert (rows["hidden_power_low_W"] <= rows["hidden_power_high_W"]).all()
    for case in rows["case"]:
        assert len(results.curve(case, "numerical_gain_so_far_J")) <= energy.KEPT + 1
