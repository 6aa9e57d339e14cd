"""The picture of a sweep by what was varied."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from reports.plots.motions import motions

from reports.plots.axes import scale_of
from reports.plots.sweeps import NoPicture, sweep_picture

CLEARANCE, SPEED = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s"


def frame(clearances: np.ndarray, speeds: np.ndarray, exponents: np.ndarray) -> pd.DataFrame:
    count = len(clearances)
    return pd.DataFrame(
        {
            "member": range(count),
            CLEARANCE: clearances,
            SPEED: speeds,
            "status": "ok",
            "reason": "",
            "largest_contact_force_N": np.linspace(1e3, 1e5, count),
            "exponent_1_s": exponents,
            "strobe_m": [[0.5 * c, -0.25 * c] for c in clearances],
            "impact_phase_rad": [[np.pi / 2, np.pi]] * count,
        }
    )


@pytest.fixture
def grid() -> pd.DataFrame:
    clearance, speed = np.meshgrid(np.geomspace(1e-5, 1e-3, 4), np.linspace(100, 300, 3), indexing="ij")
    return frame(clearance.ravel(), speed.ravel(), np.linspace(-10, 90, 12))


def test_over_two_fields_a_grid_is_a_map_of_the_exponent_with_zero_in_the_middle_of_its_colours(
    grid: pd.DataFrame,
) -> None:
    grid.loc[5, ["status", "exponent_1_s"]] = "failed", np.nan
    picture = sweep_picture(grid, [CLEARANCE, SPEED], "scene")
    (mesh,) = (each for each in picture.axes[0].collections if isinstance(each, QuadMesh))
    array = mesh.get_array()
    assert array is not None
    cells = np.ma.getdata(array).reshape(3, 4)
    np.testing.assert_array_equal(cells.T.ravel()[[0, 1, 11]], grid["exponent_1_s"][[0, 1, 11]])
    assert np.ma.getmaskarray(array).reshape(3, 4).T.ravel().tolist() == [k == 5 for k in range(12)]
    assert mesh.norm(np.zeros(1)) == 0.5
    assert picture.axes[0].get_xlabel() == "radial clearance at B [mm]"
    assert picture.axes[-1].get_ylabel() == "finite-time exponent [1/s]"
    assert "1 failed" in picture.get_suptitle()


@pytest.mark.parametrize(
    ("far", "extend"), [([], "neither"), ([40.0], "max"), ([-40.0], "min"), ([40.0, -30.0, 38.0], "both")]
)
def test_a_few_far_numbers_pale_no_map_and_its_bar_has_ticks_on_both_sides(
    far: list[float], extend: str
) -> None:
    clearance, speed = np.meshgrid(np.geomspace(1e-5, 1e-3, 20), np.linspace(100, 300, 20), indexing="ij")
    exponents = np.clip(np.linspace(-2, 8, 400), -2, 6)
    exponents[100 : 100 + len(far)] = far  # at most 3 of 400, which is less than one in a hundred
    picture = sweep_picture(frame(clearance.ravel(), speed.ravel(), exponents), [CLEARANCE, SPEED], "scene")
    (mesh,) = (each for each in picture.axes[0].collections if isinstance(each, QuadMesh))
    low, high = mesh.get_clim()
    assert (low, high) == (-6.0, 6.0)
    assert mesh.norm(np.zeros(1)) == 0.5
    assert mesh.colorbar is not None
    assert mesh.colorbar.extend == extend
    picture.draw_without_rendering()
    ticks = [tick for tick in mesh.colorbar.get_ticks() if low <= tick <= high]
    assert sum(tick < 0 for tick in ticks) == sum(tick > 0 for tick in ticks) >= 2


def test_over_two_fields_draws_are_dots_each_where_it_was_drawn(grid: pd.DataFrame) -> None:
    draws = grid.iloc[[0, 4, 7, 11]]
    picture = sweep_picture(draws, [CLEARANCE, SPEED], "scene", "largest_contact_force_N")
    (dots,) = (each for each in picture.axes[0].collections if isinstance(each, PathCollection))
    np.testing.assert_allclose(np.asarray(dots.get_offsets())[:, 1], draws[SPEED])


@pytest.mark.parametrize(
    ("column", "numbers", "drawn", "label"),
    [
        ("slider_deviation_m", [-5e-5, 2e-4], [-50, 200], "largest deviation of the slider [µm]"),
        ("slider_deviation_m", [5e-3], [5], "largest deviation of the slider [mm]"),
        ("largest_contact_force_N", [2e4], [20], "largest contact force [kN]"),
        ("impact_phase_rad", [np.pi], [180], "crank angle at impact [°]"),
    ],
)
def test_numbers_are_drawn_in_a_unit_in_which_they_have_few_digits(
    column: str, numbers: list[float], drawn: list[float], label: str
) -> None:
    scale = scale_of(column, pd.Series(numbers))
    assert scale.apply(pd.Series(numbers)) == pytest.approx(drawn)
    assert (scale.label, scale.log) == (label, False)


@pytest.mark.parametrize(
    ("field", "label"),
    [
        ("start.speed_rad_s.crank", "crank's speed at the start [rad/s]"),
        ("start.K1.x_m", "K1's x at the start [mm]"),
        ("body.crank.pins_m.A", "pin A of crank [mm]"),
        ("body.crank.mass_kg", "mass of crank [kg]"),
        ("spring.return.stiffness_N_m", "stiffness of return [N/m]"),
        ("load.crank.torque_N_m", "torque on crank [N·m]"),
        ("clearance.B.friction.coefficient", "coefficient at B"),
    ],
)
def test_fields_of_any_scene_are_labelled_with_their_part_and_unit(field: str, label: str) -> None:
    assert scale_of(field, pd.Series([0.1])).label == label


def test_other_mechanisms_have_no_slider_in_their_labels(grid: pd.DataFrame) -> None:
    rows = grid.assign(exponent_1_s=np.nan, observed_deviation_m=1e-4)
    (ax,) = sweep_picture(rows, [SPEED], "scene").axes
    assert ax.get_ylabel() == "deviation once a revolution [µm]"
    (ax,) = sweep_picture(rows, [], "scene").axes
    assert ax.get_xlabel() == "phase at impact [°]"


def test_over_a_clearance_lengths_are_parts_of_it_a_point_for_each_turn(grid: pd.DataFrame) -> None:
    picture = sweep_picture(grid.assign(exponent_1_s=np.nan), [CLEARANCE], "scene")
    (ax,) = picture.axes
    (points,) = ax.get_lines()
    heights = np.asarray(points.get_ydata(), dtype=float)
    np.testing.assert_allclose(heights, [0.5, -0.25] * len(grid))


def test_of_an_ensemble_there_is_a_histogram_of_impacts_per_member(grid: pd.DataFrame) -> None:
    (ax,) = sweep_picture(grid, [], "scene").axes
    heights = [bar.get_height() for bar in ax.patches if isinstance(bar, Rectangle)]
    assert sum(heights) == pytest.approx(2.0)
    assert heights[9] == heights[18] == pytest.approx(1.0)  # at 90 and 180 degrees, in bins of ten


@pytest.mark.parametrize(
    ("varied", "show", "pieces"),
    [
        ([CLEARANCE], "peak", "expected one of .*strobe_m.*, got peak"),
        ([CLEARANCE, SPEED], "strobe_m", "expected a column with one number a member for a map"),
        ([CLEARANCE, SPEED, "gravity_m_s2"], None, "expected one or two fields"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    grid: pd.DataFrame, varied: list[str], show: str | None, pieces: str
) -> None:
    with pytest.raises(NoPicture, match=pieces):
        sweep_picture(grid, varied, "scene", show)


def ended(impacts: float, strobe_mm: list[float]) -> dict[str, object]:
    return {"impacts_per_revolution": impacts, "strobe_m": [1e-3 * each for each in strobe_mm * 12][:12]}


#: Members that end in five motions, two of them in the same.
ENDED = [
    ended(0.0, [0.5]),
    ended(2.0, [0.3]),
    ended(2.0, [0.4]),
    ended(1.0, [0.1, 0.4]),
    ended(3.0, [*np.random.default_rng(1).random(12)]),
    ended(2.0, [0.3001]),
]


def test_members_are_told_apart_by_the_motion_that_they_end_in() -> None:
    assert motions(pd.DataFrame(ENDED)).tolist() == [
        "at the wall",
        "impacts, every turn, a",
        "impacts, every turn, b",
        "impacts, every 2 turns",
        "impacts, not repeating",
        "impacts, every turn, a",
    ]


def test_over_the_start_basins_are_drawn_with_the_number_of_members_in_each() -> None:
    places = {"start.slider.x_m": [0.0, 0.0, 0.0, 1.0, 1.0, 1.0], "start.rod.x_m": [1.0, 2.0, 3.0] * 2}
    rows = pd.DataFrame(ENDED).assign(**places, status="ok", exponent_1_s=np.nan)
    picture = sweep_picture(rows, [*places], "scene")
    (legend,) = picture.legends
    assert legend.get_texts()[0].get_text() == "impacts, every turn, a: 2 members"
    assert legend.get_texts()[1].get_text().endswith(": 1 member")
    assert len(legend.get_texts()) == 5
    assert picture.axes[0].get_xlabel() == "slider's x at the start [m]"


def test_motions_beyond_the_seven_most_frequent_share_a_colour() -> None:
    """The k-th of nine motions is that of k members."""
    members = [k for k in range(1, 10) for _ in range(k)]
    places = {"start.slider.x_m": [*range(len(members))], "start.rod.x_m": [0.0] * len(members)}
    rows = pd.DataFrame([ended(2.0, [0.1 * k]) for k in members]).assign(**places, status="ok")
    picture = sweep_picture(rows.assign(exponent_1_s=np.nan), [*places], "scene")
    (mesh,) = (each for each in picture.axes[0].collections if isinstance(each, QuadMesh))
    numbers = np.ma.getdata(mesh.get_array()).ravel()  # type: ignore[arg-type]
    np.testing.assert_array_equal(numbers, [min(9 - k, 7) for k in members])
    texts = [text.get_text() for text in picture.legends[0].get_texts()]
    assert texts[0] == "impacts, every turn, i: 9 members"
    assert texts[7:] == ["2 other motions: 3 members"]


def test_chains_up_and_down_have_a_colour_each(grid: pd.DataFrame) -> None:
    rows = grid.assign(exponent_1_s=np.nan, direction=["up"] * 6 + ["down"] * 6)
    picture = sweep_picture(rows, [SPEED], "scene")
    down, up = picture.axes[0].get_lines()
    assert down.get_color() != up.get_color()
    assert len(np.asarray(up.get_xdata())) == 12
    assert [str(line.get_label()) for line in (down, up)] == ["members downwards", "members upwards"]
    assert set(np.asarray(up.get_xdata())) == set(rows[SPEED][:6])


def test_a_legend_of_many_small_points_has_points_to_be_seen() -> None:
    count = 2000
    rows = frame(np.full(count, 1e-4), np.linspace(100, 300, count), np.full(count, np.nan))
    picture = sweep_picture(rows.assign(direction=["up", "down"] * (count // 2)), [SPEED], "scene")
    sizes = [line.get_markersize() for line in picture.axes[0].get_lines()]
    (legend,) = picture.legends
    for handle, size in zip(legend.legend_handles, sizes, strict=True):
        assert isinstance(handle, Line2D)
        assert size < 3 < handle.get_markersize()
        assert handle.get_alpha() == 1.0
