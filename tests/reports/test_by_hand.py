"""Cells, sentences, labels and lines of the report against what was worked out by hand from a few rows."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from reports.parts import quantity
from reports.plots.panels import against, draw, shown_labels, so_far
from reports.quantities import finished, floor, value, with_largest
from reports.results import frame
from reports.shared_tables import followed, orders, smallest_errors
from reports.style import variant
from reports.tables import error

POSITION, DOUBT = "slider_position_error_m", "slider_position_uncertainty_m"


def row(label: str, step: float, **columns: Any) -> dict[str, Any]:
    engine, arm = label.removesuffix(")").split(" (")
    head = {"scene": "s", "engine": engine, "arm": arm, "label": label, "step_s": step, "end_time_s": 1.0}
    head |= {"case": f"{label} {step} {columns}", "status": "ok", "reason": ""}
    return head | columns


def rows(*of: dict[str, Any]) -> pd.DataFrame:
    return frame(of)


def points_of(line: Line2D) -> list[list[float]]:
    return [[float(x), float(y)] for x, y in np.asarray(line.get_xydata())]


# Sentences


def test_a_comparison_that_some_run_ends_early_says_so() -> None:
    some = rows(
        *(row("reference (none)", h, compared_until_s=until) for h, until in ((0.1, 1.0), (0.2, 0.5)))
    )
    assert followed(some) == "Compared until 0.5 to 1 s of 1 s on s."


def test_powers_have_their_own_digits() -> None:
    written = [quantity(1.04 * float(f"1e{power}")) for power in (12, 34, 56, 78, 90, -43)]
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


# Figures


def test_engines_look_as_they_have_always_looked() -> None:
    looks = {name: (to_hex(of["color"]).upper(), of["marker"]) for name in LOOKS for of in [variant(name, 0)]}
    assert looks == LOOKS


#: Okabe and Ito's black, vermillion, blue and bluish green.
LOOKS = {
    "reference": ("#000000", "o"),
    "exudyn": ("#D55E00", "s"),
    "pymunk": ("#0072B2", "^"),
    "scipy": ("#009E73", "D"),
}


def test_errors_stand_over_their_steps_with_guides_of_their_orders_and_the_uncertainty_shaded() -> None:
    points = {0.1: 1e-3, 0.05: 1e-4, 0.025: 1e-5}
    ladder = rows(*(row("exudyn (DOPRI5)", h, **{POSITION: off, DOUBT: 2e-6}) for h, off in points.items()))
    ax = draw(against(ladder, POSITION, orders=(1, 2))).axes[0]
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


def test_a_panel_has_the_first_configurations_of_each_engine_and_six_lines_at_most() -> None:
    labels = [*(f"reference ({k})" for k in range(9)), "exudyn (DOPRI5)", "pymunk (a)", "pymunk (b)"]
    of = rows(*(row(label, 0.1, **{POSITION: 1e-3}) for label in labels))
    shown = [*(f"reference ({k})" for k in range(3)), "exudyn (DOPRI5)", "pymunk (a)", "pymunk (b)"]
    assert shown_labels(of) == shown
    (ax,) = draw(against(of, POSITION, orders=())).axes
    assert len(ax.lines) == len(shown)


def test_a_run_that_did_not_finish_is_crossed_out_at_its_step() -> None:
    failed = row("exudyn (DOPRI5)", 0.2, status="failed", reason="why")
    (panel,) = against(rows(row("exudyn (DOPRI5)", 0.1, **{POSITION: 1e-3}), failed), POSITION)
    assert panel.failed == {"exudyn (DOPRI5)": [0.2]}
    crosses = [line for line in draw([panel]).axes[0].lines if line.get_marker() == "x"]
    assert [list(np.asarray(line.get_xdata())) for line in crosses] == [[0.2]]


def test_a_curve_so_far_is_the_largest_size_up_to_each_time() -> None:
    np.testing.assert_array_equal(so_far(np.array([0.0, -8.0, 2.0])), [0.0, 8.0, 8.0])
