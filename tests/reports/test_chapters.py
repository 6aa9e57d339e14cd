"""Chapters on rows with round numbers: cells, claims and lines are worked out here, and follow altered rows.

The reference errs by 1e-4, 1e-6 and 1e-8 m in 2, 4 and 8 ms, Exudyn by as much in 20, 60 and 180 ms. A round
takes 0.9, 1 or 2 times as long, so that a mean or a median in place of the least would be seen.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from reports.chapters import (
    accuracy_clearance,
    accuracy_ideal,
    answer,
    cost,
    energy,
    extremes,
    predictability,
    stability,
)
from reports.chapters.contents import CHAPTERS
from reports.page import HALF_WIDTH, MOST, Claim
from reports.results import Results, Studies, frame, read_study
from studies.case import STUDIES
from tests.helpers.row_files import row, write_rows

SCENE = "ideal-free"
ERRORS_M = (1e-4, 1e-6, 1e-8)
#: Configurations with the times of their solves in s.
CONFIGURATIONS: dict[tuple[str, str], tuple[float, ...]] = {
    ("reference", "DOP853"): (0.002, 0.004, 0.008),
    ("exudyn", "trapezoidal"): (0.02, 0.06, 0.18),
}
ROUNDS = (1.1, 1.0, 2.0)
#: Rows of a quick set, as they are published.
ROWS = Path(__file__).parents[2] / "reports/published/results"


def written(of: Mapping[tuple[str, str], Any] = CONFIGURATIONS, scene: str = SCENE, **more: Any) -> Studies:
    """Return the studies of accuracy and cost on one scene of half a second, at three steps."""
    ran: list[dict[str, Any]] = []
    timed: list[dict[str, Any]] = []
    for (engine, arm), times_s in of.items():
        for k, (error_m, time_s) in enumerate(zip(ERRORS_M, times_s, strict=True)):
            head: Any = (scene, engine, arm, 0.1 / 2**k)
            columns: Any = {"slider_position_error_m": error_m, "slider_position_uncertainty_m": 1e-14}
            columns |= {"joint_A_force_error_N": 1e4 * error_m, "joint_B_force_error_N": 2e4 * error_m}
            columns |= {"joint_B_force_uncertainty_N": 1e-9, "end_time_s": 0.5, **more}
            ran.append(row(len(ran), *head, steps=100 * 2**k, **columns))
            for n, part in enumerate(ROUNDS):
                solve: Any = {"round": n, "solve_time_s": part * time_s, "end_time_s": 0.5}
                timed.append(row(len(timed), *head, timed=True, **solve))
    return {"accuracy": Results(frame(ran)), "cost": Results(frame(timed))}


def made(chapter: Any, studies: Studies) -> dict[str, Any]:
    """Return the parts of a chapter by their names; a table comes before its figure."""
    parts = [part for part in chapter.parts(studies) if hasattr(part, "name")]
    return {part.name: part for part in reversed(parts)}


# Cost and the answer


def test_ratios_are_to_one_configuration_whoever_else_is_there() -> None:
    """60 ms to 4 at 1e-6 m; 1 N is 5e-5 m, which the same settings keep; 4 ms for half a second."""
    ratios = made(cost, written())["cost-ratios"].cells()
    assert list(ratios["needed"]) == ["slider position within 1 µm", "largest joint force within 1 N"]
    assert list(ratios["reference (DOP853) [ms for 1 s of motion]"]) == ["8", "8"]
    assert list(ratios["exudyn"]) == ["15", "15"]
    assert list(ratios["exudyn on"]) == ["1 of 1", "1 of 1"]
    only = {("exudyn", "trapezoidal"): CONFIGURATIONS["exudyn", "trapezoidal"]}
    assert list(made(cost, written(only))["cost-ratios"].cells()["exudyn"]) == ["–", "–"]


def test_times_are_the_least_of_the_rounds_and_their_ends_those_of_the_next() -> None:
    parts = made(cost, written())
    rows = parts["cost-at-targets"].rows
    exudyn = rows[rows["configuration"].eq("exudyn (trapezoidal)") & rows["needed"].str.startswith("slider")]
    assert exudyn["run time [ms]"].item() == pytest.approx(60.0)
    assert (exudyn["low"].item(), exudyn["high"].item()) == pytest.approx((60 / 4.4, 66 / 4))
    points = parts["cost-slider-position"].data.query("series == 'reference'")
    assert sorted(zip(points["x"], points["y"], strict=True)) == [(0.002, 1e-4), (0.004, 1e-6), (0.008, 1e-8)]


def test_the_part_of_the_run_time_in_an_engines_own_calls_is_told() -> None:
    """Its calls take 15 ms of 20, 60 and 180 ms; another round takes twice as long."""
    studies = written()
    rows = studies["cost"].rows
    inside_s = rows["solve_time_s"].clip(upper=0.015).where(rows["engine"] == "exudyn")
    parts = made(cost, {**studies, "cost": Results(rows.assign(engine_time_s=inside_s))})
    assert [name for name in parts if name.startswith("inside")] == ["inside exudyn"]
    least, most = (parts["inside exudyn"].numbers[name][0] for name in ("least", "most"))
    assert (least, most) == pytest.approx((100 * 15 / 360, 100 * 15 / 20))


def test_the_answer_is_the_fastest_setting_and_what_is_next_best() -> None:
    (line,) = made(answer, written())["answer"].cells().to_dict("records")
    assert line == {
        "you need": "motion within 1 µm, ideal joints",
        "use": "reference (DOP853), step 0.05 s",
        "command": "crankslider simulate ideal-free --end 0.5 --engine reference --samples 4 --step 0.05",
        "time for 1 s of motion [ms]": "8",
        "next best": "exudyn (trapezoidal), step 0.05 s (15x)",
    }
    slower = {**CONFIGURATIONS, ("exudyn", "trapezoidal"): (1e-4, 2e-4, 0.01)}
    cells = made(answer, written(slower))["answer"].cells()
    assert cells["use"].item() == "exudyn (trapezoidal), step 0.05 s"


def test_an_engine_that_wins_on_one_scene_is_told_beside_one_that_reaches_more() -> None:
    more = written({**CONFIGURATIONS, ("pymunk", "tuned"): (1e-5, 2e-5, 3e-5)}, "ideal-driven")
    rows = {name: pd.concat([written()[name].rows, more[name].rows]) for name in more}
    both = {name: Results(frame(of.to_dict("records"))) for name, of in rows.items()}
    line = made(answer, both)["answer"].cells().iloc[0]
    assert line["use"] == "reference (DOP853), step 0.05 s"
    assert "faster where it runs: pymunk (tuned), step 0.05 s (1 of 2 scenes) (0.005x)" in line["next best"]


def test_engines_stand_beside_rk4_by_its_time_within_the_target() -> None:
    """RK4 takes 10 ms to 1e-6 m: of DOP853, 0.8 times, and Exudyn in ten times at most its last but one."""
    configurations = {**CONFIGURATIONS, ("reference", "projection"): (0.005, 0.01, 0.02)}
    parts = made(answer, written(configurations, unaccounted_energy_part=1e-6))
    cells = parts["compared-ideal-joints"].cells().set_index("configuration")
    assert list(cells.index) == ["reference (projection)", "reference (DOP853)", "exudyn (trapezoidal)"]
    assert list(cells["slider position error [µm]"]) == ["1", "0.01", "1"]
    assert list(cells["run time"]) == ["1", "0.8", "6"]
    assert list(cells["run time within 1 µm"]) == ["1", "0.4", "6"]
    assert list(cells["joint force error [N]"]) == ["0.02", "0.0002", "0.02"]
    within = "reference (DOP853) 0.4, exudyn (trapezoidal) 6 (1: reference (projection))"
    assert within in str(parts["within"])


# Orders and energy


@pytest.mark.parametrize("order", [4.0, 3.0])
def test_an_order_that_theory_contradicts_does_not_hold(order: float) -> None:
    steps = [0.1 / 2**k for k in range(4)]
    rows = [
        row(
            k,
            SCENE,
            "reference",
            "projection",
            h,
            slider_position_error_m=h**order,
            joint_B_force_error_N=h**order,
        )
        for k, h in enumerate(steps)
    ]
    parts = made(accuracy_ideal, {"accuracy": Results(frame(rows))})
    told = f"{order:g} in slider position and {order:g} in largest joint force; theory: 4."
    assert str(parts["rk4-order"]) == f"Observed order of the reference engine (RK4): {told}"
    assert parts["rk4-order"].holds == (order == 4.0)
    assert list(parts["accuracy-orders"].cells()["slider position"]) == [f"{order:.2f}"]


def long_run(number: int, engine: str, arm: str, part: float, **columns: Any) -> dict[str, Any]:
    powers = {"hidden_power_W": -part, "hidden_power_low_W": -1.5 * part, "hidden_power_high_W": -0.5 * part}
    measured = {"unaccounted_energy_part": part, "rung": 0, "turns": 100.0, **powers, **columns}
    return row(number, "ideal-driven", engine, arm, 1e-3, end_time_s=1.2, **measured)


def test_numerical_dissipation_is_a_loss_with_its_interval() -> None:
    rows = [
        long_run(0, "reference", "projection", 1e-6),
        long_run(1, "pymunk", "tuned", 2e-3, hidden_power_high_W=3e-3),
        long_run(2, "exudyn", "trapezoidal", -4e-3),
    ]
    parts = made(energy, {"energy": Results(frame(rows))})
    table = parts["energy-dissipation"]
    assert table.cells().set_index("configuration")["ideal-driven"].to_dict() == {
        "reference (projection)": "1.0e-06 ± 5.0e-07",
        "exudyn (trapezoidal)": "-4.0e-03",
        "pymunk (tuned)": "< 5.0e-03",
    }
    assert list(table.rows[f"ideal-driven{HALF_WIDTH}"]) == pytest.approx([5e-7, -2e-3, 3e-3])
    kept = str(parts["kept"])
    assert "0.01 % of the energy in play: exudyn (trapezoidal), reference (projection)." in kept
    assert kept.endswith("The furthest off is pymunk (tuned): 0.2 %.")


@pytest.mark.parametrize(
    ("gap", "speed", "holds"), [(2.05, 0.95, True), (2.2, 1.0, False), (2.0, 0.8, False)]
)
def test_drift_without_stabilisation_is_as_theory_has_it(gap: float, speed: float, holds: bool) -> None:
    columns = {"constraint_violation_exponent": gap, "constraint_speed_exponent": speed}
    rows = frame([long_run(0, "reference", "none", 1e-6, **columns)])
    (claim,) = energy.drift(energy.prepared(rows))
    assert claim.holds == holds
    assert claim.numbers["gap"][0] == pytest.approx(abs(gap - 2))


def from_store(folder: Path, study: str, of: dict[str, Any], **curves: Any) -> dict[str, Results]:
    """Return a study of one run with curves."""
    write_rows(folder, study, [of], {of["case"]: curves})
    return {study: read_study(folder, study)}


def test_an_energy_balance_error_is_drawn_as_the_largest_part_so_far(tmp_path: Path) -> None:
    run = long_run(0, "reference", "projection", 1e-6, energy_in_play_J=2.0)
    times, gains = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2], [0.0, 1e-9, 4e-9, 4e-9, 4e-9, 6e-9, 6e-9]
    studies = from_store(tmp_path, "energy", run, time_s=times, numerical_gain_so_far_J=gains)
    points = made(energy, studies)["energy-growth"].data
    assert list(points["x"]) == times
    assert list(points["y"])[1:] == pytest.approx([0.5e-9, 2e-9, 2e-9, 2e-9, 3e-9, 3e-9])


def test_an_impact_is_drawn_from_its_touch_on(tmp_path: Path) -> None:
    """The samples are 1 us apart; the pin touches in the third, and is pushed in the fourth and fifth."""
    depth, force = [-2e-6, -1e-6, 0.0, 1e-6, 1e-6, -1e-6], [0.0, 0.0, 0.0, 20.0, 10.0, 0.0]
    ran = row(0, "clearance-free-0.5mm-first-impact", "reference", "DOP853", 1e-6, view="impact")
    signal = "contact_B_normal_force"
    curves = {"contact_B_penetration_m": depth, "true_contact_B_penetration_m": depth}
    curves |= {f"{signal}_N": [0.0, 0.0, 0.0, 21.0, 10.0, 0.0], f"true_{signal}_N": force}
    curves |= {f"{signal}_error_N": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]}
    studies = from_store(tmp_path, "accuracy", ran, time_s=[1e-6 * k for k in range(6)], **curves)
    points = made(accuracy_clearance, studies)["clearance-impact"].data
    true = points[points["series"] == "reference solution"].head(6)
    assert list(true["x"]) == pytest.approx([-2.0, -1.0, 0.0, 1.0, 2.0, 3.0])
    assert list(true["y"]) == pytest.approx([0.0, 0.0, 0.0, 0.02, 0.01, 0.0])


# Predictability, stability and extremes


def test_the_growth_of_a_change_is_the_median_of_the_largest_distances_so_far(tmp_path: Path) -> None:
    columns: dict[str, Any] = {"part": "horizon", "end_time_s": 0.1, "revolutions": 10.0, "perturbations": 3}
    columns |= {"horizon_1um_s": 0.05, "perturbation_rad": 1e-10}
    ran = row(0, "soon", "reference", "default", 1e-5, **columns)
    far = {"perturbed_0_m": [1e-9, -3e-6, 2e-6], "perturbed_1_m": [2e-9, 1e-6, 5e-6]}
    far |= {"perturbed_2_m": [3e-9, 2e-6, 1e-6], "halved_m": [1e-10, 1e-10, 0.0]}
    studies = from_store(tmp_path, "predictability", ran, time_s=[0.0, 0.05, 0.1], **far)
    points = made(predictability, studies)["predictability-growth"].data
    lines = {name: (list(line["x"]), list(line["y"])) for name, line in points.groupby("series")}
    assert lines["perturbed start (median)"] == ([0.0, 5.0, 10.0], [2e-9, 2e-6, 3e-6])
    assert lines["perturbed start (largest)"][1] == [3e-9, 3e-6, 5e-6]
    assert lines["horizon (median)"] == ([5.0], [1e-6])


def test_a_mean_has_students_interval_of_both_sides() -> None:
    """Of 1, 2 and 3: t = 4.303 of two degrees of freedom, a standard deviation of 1."""
    half = 4.3026527 / math.sqrt(3)
    assert predictability.mean_of(pd.Series([1.0, 2.0, 3.0])) == pytest.approx((2.0, half))
    for few, mean in (([5.0], 5.0), ([], math.nan)):
        assert predictability.mean_of(pd.Series(few, dtype=float)) == pytest.approx(
            (mean, math.nan), nan_ok=True
        )


def test_a_horizon_is_told_in_revolutions_of_the_scene_where_it_is_shortest() -> None:
    rows = []
    for k, (scene, at_s) in enumerate({"late": 0.08, "soon": 0.02}.items()):
        horizons = {"": at_s, "_least": 0.9 * at_s, "_largest": 1.1 * at_s}
        columns: dict[str, Any] = {f"horizon_100um{end}_s": of for end, of in horizons.items()}
        columns |= {"part": "horizon", "end_time_s": 0.1, "revolutions": 10.0, "perturbation_rad": 1e-10}
        columns |= {"largest_distance_perturbed_m": 1e-3, "largest_distance_halved_m": 1e-3}
        rows.append(row(k, scene, "reference", "default", 1e-5, **columns))
    parts = made(predictability, {"predictability": Results(frame(rows))})
    assert " in 2 revolutions on soon, " in str(parts["horizon"])
    assert " in 8 on late, the longest" in str(parts["horizon"])
    first = parts["horizon"].numbers["first"]
    assert (first[0], *first[2:]) == pytest.approx((2.0, 1.8, 2.2))
    cells = parts["predictability-horizons"].cells()
    assert list(cells["100 µm: perturbed [ms]"]) == ["72 to 88", "18 to 22"]


def cell(number: int, step_s: float, severity: int, **columns: Any) -> dict[str, Any]:
    bounds = {"energy_bound_per_impact": 0.05, "constraint_bound_per_clearance": 0.01}
    bounds |= {"position_bound_per_clearance": 0.01, "compared_impacts": 5}
    head = {"contact_stiffness_N_m1_5": 1e10, "impact_frequency_rad_s": 1e5, "limit_frequency_step": 2.0}
    fine = {**dict.fromkeys(stability.BOUNDED, 0.001), **columns, "verdict_severity": severity}
    return row(number, "s", "pymunk", "as the scene", step_s, **head, **bounds, **fine)


def test_growth_begins_between_the_last_step_without_and_the_first_one_with_it() -> None:
    rows = [cell(0, 1e-5, 0), cell(1, 2e-5, 1), cell(2, 8e-5, 2), cell(3, 1e-4, 3)]
    parts = made(stability, {"stability": Results(frame(rows))})
    (line,) = parts["stability-boundaries"].rows.to_dict("records")
    assert line["growth from ωh"] == pytest.approx(math.sqrt(2.0 * 8.0))
    assert line["growth per theory"] == pytest.approx(2.0)
    assert line[f"divergence from ωh{MOST}"] == pytest.approx(math.sqrt(80.0))
    assert line["accurate up to ωh"] == pytest.approx(1.0)
    assert parts["energy-growth"].numbers["part"][0] == 50.0
    assert parts["accurate"].holds
    wrong = frame([cell(0, 1e-5, 0, position_error_per_clearance=0.02), *rows[1:]])
    assert not made(stability, {"stability": Results(wrong)})["accurate"].holds


def test_wrong_results_are_counted_by_configuration() -> None:
    rows = read_study(ROWS, "extremes").rows
    parts = made(extremes, {"extremes": Results(rows)})
    claim, counts = parts["wrong-results"], parts["extremes-counts"].rows.set_index("configuration")
    assert str(claim).count(" of 22") == rows["label"].nunique()
    wrong = counts["wrong, no error"]["pymunk (out of the box)"]
    assert f"pymunk (out of the box) in {wrong} of 22" in str(claim)
    better = rows.assign(relative_error=rows["relative_error"].where(rows["relative_error"].isna(), 0.0))
    fewer = made(extremes, {"extremes": Results(better)})["wrong-results"]
    assert fewer.numbers["n0"][0] < claim.numbers["n0"][0]


# All claims


@pytest.fixture(scope="module")
def published() -> dict[str, Results]:
    return {name: read_study(ROWS, name) for name in STUDIES}


#: What of the rows is altered, so that claims have to follow: a column, and what becomes of it.
ALTERED: dict[str, tuple[str, Callable[[pd.Series], pd.Series]]] = {
    "accuracy": ("slider_position_error_m", lambda of: 30 * of),
    "cost": ("solve_time_s", lambda of: of * np.linspace(1, 3, len(of)).round()),
    "energy": ("unaccounted_energy_part", lambda of: 1e3 * of),
    "predictability": ("horizon_100um_s", lambda of: 2 * of),
    "stability": ("verdict_severity", lambda of: 3 - of.clip(upper=3)),
    "extremes": ("relative_error", lambda of: 1e4 * of),
}


@pytest.mark.parametrize("study", ALTERED)
def test_claims_follow_the_rows(study: str, published: dict[str, Results]) -> None:
    column, alter = ALTERED[study]
    rows, facts = published[study].rows, published[study].facts
    changed = {**published, study: Results(rows.assign(**{column: alter(rows[column])}), facts)}
    own = [chapter for chapter in CHAPTERS if study in chapter.studies]
    before, after = (
        {str(part) for each in own for part in each.parts(of) if isinstance(part, Claim)}
        for of in (published, changed)
    )
    assert before - after, "no sentence has changed"
