"""Cells, sentences, labels and lines of the report against what was worked out by hand from a few rows."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from reports.chapters.agreement.findings import best_at_step, conservation, enough
from reports.chapters.energy import lost_as_it_comes
from reports.chapters.work_precision.figures import drawing
from reports.chapters.work_precision.findings import found, races
from reports.chapters.work_precision.tables import cheapest
from reports.equal_error import Arrival, Judged, Ratio, arrival, front, kept, levels, ratio
from reports.plots.step_figures import against_step
from reports.plots.time_figures import over_time
from reports.quantities import finished, floor, value, with_largest
from reports.results import BrokenResults, Results, frame, read_results
from reports.run.orbit_plot import orbit_plot
from reports.run.time_plot import time_plot
from reports.shared_tables import followed, orders, smallest_errors
from reports.style import variant
from reports.tables import error, in_text
from tests.helpers.row_files import write_rows

POSITION, DOUBT = "slider_position_error_m", "slider_position_uncertainty_m"
ENERGY, VIOLATION = "unaccounted_energy_part", "constraint_violation_m"


def row(label: str, step: float, **columns: Any) -> dict[str, Any]:
    engine, arm = label.removesuffix(")").split(" (")
    head = {"scene": "s", "engine": engine, "arm": arm, "label": label, "step_s": step, "end_time_s": 1.0}
    head |= {"case": f"{label} {step} {columns}", "fingerprint": "0", "status": "ok", "reason": ""}
    return head | columns


def rows(*of: dict[str, Any]) -> pd.DataFrame:
    return frame(of)


def points_of(line: Line2D) -> list[list[float]]:
    return [[float(x), float(y)] for x, y in np.asarray(line.get_xydata())]


#: Errors of three engines at one step.
THREE = rows(
    *(
        row(label, 0.1, **{POSITION: off, ENERGY: part, VIOLATION: gap})
        for label, off, part, gap in (
            ("reference (none)", 2e-6, 1e-8, 3e-9),
            ("exudyn (DOPRI5)", 5e-6, 2e-3, 0.0),
            ("pymunk (tuned)", 7e-3, 1e-5, 2e-6),
        )
    )
)


# Sentences


def test_the_best_is_who_has_the_smallest_error() -> None:
    (sentence,) = best_at_step(THREE)
    assert sentence == (
        "On s at a step of 1.0×10⁻¹ s the smallest error is that of reference (none) in every signal; "
        "without the reference, that of exudyn (DOPRI5) in every signal."
    )


def test_energy_and_gaps_are_least_and_most_with_whom_they_are() -> None:
    energy, gap = conservation(THREE)
    parts = "least with reference (none), 1.0×10⁻⁸ and most with exudyn (DOPRI5), 2.0×10⁻³."
    assert energy.endswith(f"the largest unaccounted energy part is {parts}")
    assert gap.endswith("least with exudyn (DOPRI5), 0.0×10⁰ m and most with pymunk (tuned), 2.0×10⁻⁶ m.")


def test_enough_is_where_no_larger_value_is_worse_again() -> None:
    swept = rows(
        *(
            row(f"pymunk ({n} iterations)", 0.1, setting_iterations=n, **{POSITION: off})
            for n, off in ((2, 9e-3), (5, 1.5e-6), (10, 4e-5), (20, 1.0e-6), (50, 1.9e-6))
        )
    )
    (sentence,) = enough(swept, "iterations", POSITION)
    assert "within a factor of 2 of its smallest from 20 iterations on." in sentence


def test_energy_lost_is_that_of_the_shortest_and_of_the_longest_step() -> None:
    ladder = [
        row("pymunk (out of the box)", h, scene="ideal-free", unaccounted_energy_part=h) for h in (0.5, 0.03)
    ]
    (sentence,) = lost_as_it_comes(rows(*ladder), "ideal-free")
    assert "off by 3 % of the energy in play at the shortest of its steps, and by 50 % at" in sentence


def test_a_comparison_that_some_run_ends_early_says_so() -> None:
    some = rows(
        *(row("reference (none)", h, compared_until_s=until) for h, until in ((0.1, 1.0), (0.2, 0.5)))
    )
    assert followed(some) == "Compared until 0.5 to 1 s of 1 s on s."


def test_powers_have_their_own_digits() -> None:
    written = [in_text(float(f"1e{power}")) for power in (12, 34, 56, 78, 90, -43)]
    assert written == ["1.0×10¹²", "1.0×10³⁴", "1.0×10⁵⁶", "1.0×10⁷⁸", "1.0×10⁹⁰", "1.0×10⁻⁴³"]


# Numbers


def test_a_floor_is_the_largest_uncertainty_and_an_order_stays_above_it() -> None:
    ladder = rows(
        *(
            row("reference (none)", 2.0**-k, **{POSITION: 16.0**-k, DOUBT: 1e-4 if k == 5 else 1e-12})
            for k in range(8)
        )
    )
    assert floor(ladder, POSITION) == 1e-4
    order = orders(ladder, POSITION)["reference (none)"]["s"]
    assert order.steps == (1.0, 0.5, 0.25), "ten times 1e-4 is above 16^-3"


def test_what_failed_or_was_refused_did_not_finish() -> None:
    ends = ("ok", "failed", "unsupported", "crashed", "timed out")
    of = rows(*(row("reference (none)", 0.1, status=end) for end in ends))
    assert finished(of)["status"].tolist() == ["ok"]


def test_what_failed_has_no_number() -> None:
    failed = rows(row("reference (none)", 0.1, **{POSITION: 1.0, "status": "failed"}))
    assert value(failed, POSITION).isna().all()


def test_the_largest_of_all_joints_has_the_largest_of_their_uncertainties() -> None:
    joints = {"joint_O_force_error_N": 3.0, "joint_A_force_error_N": 5.0, "joint_B_force_error_N": 4.0}
    doubts = {"joint_O_force_uncertainty_N": 0.3, "joint_A_force_uncertainty_N": 0.1}
    one = with_largest(
        rows(row("reference (none)", 0.1, **joints, **doubts)), "f_error_N", r"joint_\w_force_error_N"
    )
    assert (one["f_error_N"].tolist(), one["f_uncertainty_N"].tolist()) == ([5.0], [0.3])


def test_the_smallest_error_stands_beside_its_own_uncertainty() -> None:
    ladder = rows(
        row("reference (none)", 0.2, **{POSITION: 2e-9, DOUBT: 1e-12}),
        row("reference (none)", 0.1, **{POSITION: 3e-9, DOUBT: 1e-8}),
    )
    assert smallest_errors(ladder, [POSITION])["slider position [m]"].tolist() == [error(2e-9, 1e-12)]


def rungs_of(*points: tuple[float, tuple[float, ...]]) -> pd.DataFrame:
    """Return the rungs of an arm by their errors and run times in s by round."""
    of = pd.DataFrame({"error": [error for error, _ in points], "place": range(len(points))})
    times = [np.array(times) for _, times in points]
    own = {
        "engine": "e",
        "label": "e (a)",
        "knob": "step",
        "value": of["error"],
        "steps": 1.0,
        "motion_alone": False,
    }
    of = of.assign(times_s=times, time_s=[float(np.nanmedian(each)) for each in times], **own)
    return of.assign(kept=kept(of))


def test_of_two_rungs_as_good_the_cheaper_is_the_front() -> None:
    assert front(rungs_of((1e-4, (2.0,)), (1e-4, (1.0,))))["time_s"].tolist() == [1.0]


def test_an_error_is_passed_where_two_neighbours_have_it_between_them_and_no_finer_rung_is_worse() -> None:
    """A ladder whose last rung is worse again: down from 1e-4 m to 1e-8 m, and up again to 1e-6 m."""
    ladder = rungs_of((1e-4, (1.0,)), (1e-8, (10.0,)), (1e-6, (16.0,)))
    assert arrival(ladder, 1e-7) is None
    there = arrival(ladder, 1e-5)
    assert there is not None
    assert there.time_s == pytest.approx(10**0.5), "half way to 1e-6 m, and not a quarter of that to 1e-8 m"


def test_a_ratio_of_one_decides_nothing() -> None:
    assert [Ratio(*of).decided for of in ((1.0, 1.0, 1.0), (2.0, 1.0, 3.0), (0.5, 0.4, 1.0))] == [False] * 3
    assert [Ratio(*of).decided for of in ((1.2, 1.1, 1.3), (0.5, 0.4, 0.9))] == [True] * 2


def test_levels_begin_above_the_best_rung_and_end_where_two_rungs_are() -> None:
    assert levels(rungs_of(*((error, (1.0,)) for error in (1e-3, 1e-4, 1e-6))), 0.0) == [1e-4, 1e-5]
    assert levels(rungs_of(*((error, (1.0,)) for error in (1e-3, 2e-6, 6e-7))), 0.0) == [1e-6]


def test_between_rungs_a_round_counts_that_both_have() -> None:
    there = arrival(rungs_of((1e-4, (np.nan, 1.0)), (1e-6, (7.0, 4.0))), 1e-5)
    assert there is not None
    assert there.time_s == pytest.approx(2.0)


def test_an_interval_of_many_rounds_holds_19_of_20_medians() -> None:
    """Ends of the median's interval by the binomial distribution: of 101 rounds the 41st and the 61st."""
    rounds = np.random.default_rng(3).permutation(np.arange(1.0, 102.0))
    one, other = (Arrival("e", "e (a)", "", times) for times in (rounds, np.ones(101)))
    found = ratio(one, other)
    assert found is not None
    assert [found.low, found.high] == pytest.approx([41, 61], abs=1)


def test_a_row_whose_number_was_edited_is_refused(tmp_path: Path) -> None:
    write_rows(tmp_path / "rows.jsonl", [row("reference (none)", 0.1, **{POSITION: 2e-6})])
    assert read_results(tmp_path)[POSITION].tolist() == [2e-6]
    text = (tmp_path / "rows.jsonl").read_text(encoding="utf-8")
    (tmp_path / "rows.jsonl").write_text(text.replace("2e-06", "1e-06"), encoding="utf-8")
    with pytest.raises(BrokenResults, match="edited or damaged"):
        read_results(tmp_path)
    without = {name: part for name, part in json.loads(text).items() if name != "checksum"}
    (tmp_path / "rows.jsonl").write_text(json.dumps(without) + "\n", encoding="utf-8")
    with pytest.raises(BrokenResults, match="earlier version"):
        read_results(tmp_path)


# Work and precision

#: Each engine's run times in s by round at an error, and what building takes besides.
RACE = {"reference (DOP853)": (0.002, 0.004, 0.009), "exudyn (DOPRI5)": (0.010, 0.008, 0.018)}


def raced(build_s: float = 0.1) -> Judged:
    recorded = [
        row(label, 0.1, steps=7.0, compared_until_s=1.0, **{POSITION: off})
        for label in RACE
        for off in (1e-4, 1e-6)
    ]
    for k, each in enumerate(recorded):
        each["step_s"] = (0.2, 0.1)[k % 2]
    timed = [
        row(label, step, round=k, solve_time_s=time, build_time_s=build_s)
        for label, times in RACE.items()
        for step in (0.2, 0.1)
        for k, time in enumerate(times)
    ]
    return Judged("t", rows(*recorded, *timed), POSITION)


def test_times_are_medians_in_milliseconds_the_cheapest_first() -> None:
    table = cheapest(raced())
    assert table is not None
    assert table.head[4] == "time [ms]"
    at = [line[2:] for line in table.rows if line[1] == "1.0e-05"]
    setting = "step 0.1 s"  # which takes no longer than the other
    # By round the reference is 5, 2 and 2 times as fast.
    assert at == [("reference (DOP853)", setting, "4", "–"), ("exudyn (DOPRI5)", setting, "10", "2 (2 to 5)")]


def test_building_counts_where_it_is_said_to() -> None:
    (plain, *_), (whole, *_) = found(raced()), found(raced().whole())
    assert plain.endswith("it takes 0.5 of their time.")
    # 104 ms against 110 ms in the middle, 109 against 118 at the most, 102 against 110 at the least.
    assert whole.endswith("it takes 0.93 of their time.")


def test_a_rival_leads_by_up_to_its_largest_share() -> None:
    times = {(0, "reference"): 6.0, (1, "reference"): 6.0, (0, "exudyn"): 1.0, (1, "exudyn"): 3.0}
    of = [
        [
            row(f"{engine} (a)", 2.0**-place, steps=1.0, **{POSITION: 10.0 ** (-4 - place)}),
            row(f"{engine} (a)", 2.0**-place, round=0, solve_time_s=time, build_time_s=0.0),
        ]
        for (place, engine), time in times.items()
    ]
    *_, sentence = found(Judged("t", rows(*(each for pair in of for each in pair)), POSITION))
    assert sentence.endswith(
        "exudyn (a) is cheaper at 2 of the best rungs; the reference takes up to 6 times as long."
    )


def test_a_scene_is_won_by_all_rungs_and_alone_is_below_all_rivals() -> None:
    """By error the run times of the reference and of its rival, whose second rung takes as long."""
    reference, exudyn = {1e-3: 1.0, 1e-5: 2.0, 1e-7: 5.0, 1e-8: 6.0}, {1e-3: 4.0, 1e-7: 5.0}
    times = {"reference (a)": reference, "exudyn (a)": exudyn}
    of = [
        row(label, error, **{POSITION: error}, **more)
        for label, ladder in times.items()
        for error, time in ladder.items()
        for more in ({"steps": 1.0}, {"round": 0, "solve_time_s": time, "build_time_s": 0.0})
    ]
    judged = Judged("t", rows(*of), POSITION)
    (race,) = races(judged)
    assert (len(race.shares), len(race.cheaper), race.undecided, race.alone) == (2, 1, 1, 1)
    assert "best rungs on 0 of 1 scenes" in next(found(judged))


def test_a_work_precision_figure_has_what_it_costs_below_and_the_error_beside() -> None:
    judged = raced()
    ax = drawing(judged, "time_s").axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("run time [s]", "slider position error [m]")
    reference, exudyn = map(points_of, ax.lines[:2])
    assert sorted(reference) == [[0.004, 1e-6], [0.004, 1e-4]]
    assert sorted(exudyn) == [[0.010, 1e-6], [0.010, 1e-4]]
    bars = [path for path in ax.collections if isinstance(path, LineCollection)]
    ends = sorted({round(x, 6) for bar in bars for segment in bar.get_segments() for x in segment[:, 0]})
    assert ends == [0.002, 0.008, 0.009, 0.018], "the range of the rounds"


# Figures


def test_a_legend_of_work_and_precision_has_who_is_drawn_and_no_other() -> None:
    judged = raced()
    counted = judged.rows["label"].str.startswith("exudyn") & judged.rows["round"].isna()
    counting = replace(judged, rows=judged.rows.assign(evaluations=np.where(counted, 50.0, np.nan)))
    for cost, names in (("evaluations", ["exudyn (DOPRI5)"]), ("steps", [*RACE])):
        (legend,) = drawing(counting, cost).legends
        assert [text.get_text() for text in legend.get_texts()] == names


def test_engines_look_as_they_have_always_looked() -> None:
    looks = {name: (to_hex(of["color"]).upper(), of["marker"]) for name in LOOKS for of in [variant(name, 0)]}
    assert looks == LOOKS


#: Okabe and Ito's black, vermillion, blue and bluish green, and a purple.
LOOKS = {
    "reference": ("#000000", "o"),
    "exudyn": ("#D55E00", "s"),
    "pymunk": ("#0072B2", "^"),
    "scipy": ("#009E73", "D"),
    "heyoka": ("#6A3D9A", "*"),
}


def test_errors_stand_over_their_steps_with_guides_of_their_orders_and_the_uncertainty_shaded() -> None:
    points = {0.1: 1e-3, 0.05: 1e-4, 0.025: 1e-5}
    ladder = rows(*(row("exudyn (DOPRI5)", h, **{POSITION: off, DOUBT: 2e-6}) for h, off in points.items()))
    ax = against_step(ladder, [("s", POSITION)], orders=(1, 2)).axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("step [s]", "slider position error [m]")
    assert ax.get_title() == "s"
    line, *guides = ax.lines
    assert sorted(points_of(line), reverse=True) == [list(point) for point in points.items()]
    assert to_hex(line.get_color()).upper() == LOOKS["exudyn"][0]
    for order, guide in zip((1, 2), guides, strict=True):
        (h, finer), (e, smaller) = np.asarray(guide.get_xdata()), np.asarray(guide.get_ydata())
        assert np.log(e / smaller) / np.log(h / finer) == pytest.approx(order)
    (shaded,) = (patch for patch in ax.patches if isinstance(patch, Rectangle))
    assert shaded.get_y() + shaded.get_height() == pytest.approx(2e-6)


def test_a_curve_over_time_is_the_largest_so_far(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    curves = {"time_s": np.array([0.0, 1.0, 2.0]), ENERGY: np.array([0.0, -8.0, 2.0])}
    monkeypatch.setattr(Results, "curve", lambda _, __, column: curves[column])
    one = rows(row("pymunk (tuned)", 0.1))
    figure = over_time(Results(Path(), one, None), one, ENERGY, "so far")
    (line,) = figure.axes[0].lines
    assert figure.axes[0].get_xlabel() == "time [s]"
    np.testing.assert_array_equal(np.asarray(line.get_xdata()), [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(np.asarray(line.get_ydata()), [np.nan, 8.0, 8.0])


#: Three samples of a run with its pin in the wall at the second; joint force 3 and 4 N.
SAMPLES = pd.DataFrame(
    {
        "slider_position_m": [0.1, 0.2, 0.3],
        "slider_velocity_m_s": [1.0, 2.0, 3.0],
        "joint_B_force_x_N": [3.0, 0.0, -3.0],
        "joint_B_force_y_N": [4.0, 1.0, 4.0],
        "clearance_B_x_m": [1e-4, 5e-4, 0.0],
        "clearance_B_y_m": [2e-4, 0.0, 3e-4],
        "contact_B_penetration_m": [-1e-4, 1e-9, -2e-4],
    },
    index=pd.Index([0.0, 0.5, 1.0], name="time_s"),
)


def test_an_orbit_is_x_and_y_in_micrometres() -> None:
    ax = orbit_plot(SAMPLES, "B", 5e-4, "s").axes[0]
    path, touching = ax.lines[1], ax.lines[2]
    np.testing.assert_allclose(points_of(path), [(100, 200), (500, 0), (0, 300)])
    np.testing.assert_allclose(points_of(touching), [(500, 0)])


def test_a_joint_force_over_time_is_as_long_as_both_its_components() -> None:
    forces = next(ax for ax in time_plot(SAMPLES, "s", "").axes if ax.get_ylabel() == "force [N]")
    np.testing.assert_allclose(np.asarray(forces.lines[0].get_ydata(), dtype=float), [5.0, 1.0, 5.0])
