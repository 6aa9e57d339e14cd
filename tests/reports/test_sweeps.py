"""The picture of a sweep: points over one field, a map over two."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PathCollection, QuadMesh

from reports.plots.sweeps import NoPicture, sweep_picture

CLEARANCE, SPEED, FORCE = (
    "clearance.B.radial_clearance_m",
    "start.crank_speed_rad_s",
    "largest_contact_force_N",
)


@pytest.fixture
def grid() -> pd.DataFrame:
    clearance, speed = np.meshgrid(np.geomspace(1e-5, 1e-3, 4), np.linspace(100, 300, 3), indexing="ij")
    frame = pd.DataFrame({CLEARANCE: clearance.ravel(), SPEED: speed.ravel(), "status": "ok"})
    frame[FORCE] = np.linspace(1e3, 1.2e4, 12)
    frame.loc[5, ["status", FORCE]] = "failed", np.nan
    return frame


def test_over_one_field_there_is_a_point_for_each_member(grid: pd.DataFrame) -> None:
    picture = sweep_picture(grid, [CLEARANCE], "scene")
    (ax,) = picture.axes
    points = np.asarray(ax.lines[0].get_xydata())
    done = grid.drop(index=5)
    np.testing.assert_allclose(points, np.array([1e3 * done[CLEARANCE], 1e-3 * done[FORCE]]).T)
    assert (ax.get_xlabel(), ax.get_xscale()) == ("radial clearance at B [mm]", "log")
    assert ax.get_ylabel() == "largest contact force [kN]"
    assert picture.get_suptitle() == "scene: 12 members, 1 failed"


def test_over_two_fields_a_grid_is_cells_around_the_values(grid: pd.DataFrame) -> None:
    picture = sweep_picture(grid, [CLEARANCE, SPEED], "scene", FORCE)
    (mesh,) = (each for each in picture.axes[0].collections if isinstance(each, QuadMesh))
    cells = np.ma.asarray(mesh.get_array()).reshape(3, 4).T.ravel()
    np.testing.assert_allclose(cells.data[[0, 1, 11]], 1e-3 * grid[FORCE][[0, 1, 11]])
    assert np.flatnonzero(np.ma.getmaskarray(cells)).tolist() == [5]
    edges = np.asarray(mesh.get_coordinates())
    assert edges[0, :, 1] == pytest.approx(np.full(5, 50.0))
    assert edges[-1, :, 1] == pytest.approx(np.full(5, 350.0))
    middles = np.sqrt(edges[0, 1:, 0] * edges[0, :-1, 0])
    assert middles == pytest.approx(1e3 * np.geomspace(1e-5, 1e-3, 4))
    labels = [(ax.get_xlabel(), ax.get_ylabel()) for ax in picture.axes]
    assert labels[0] == ("radial clearance at B [mm]", "crank speed [rad/s]")
    assert labels[1] == ("", "largest contact force [kN]")


def test_of_several_members_at_a_place_the_mean_is_shown(grid: pd.DataFrame) -> None:
    twice = pd.concat([grid, grid.assign(**{FORCE: grid[FORCE] + 200.0})])
    picture = sweep_picture(twice, [CLEARANCE, SPEED], "scene")
    cells = np.asarray(picture.axes[0].collections[0].get_array(), dtype=float)
    assert np.nanmin(cells) == pytest.approx(1.1)


def test_draws_are_dots(grid: pd.DataFrame) -> None:
    drawn = grid.assign(**{SPEED: np.random.default_rng(1).uniform(100, 300, 12)})
    picture = sweep_picture(drawn, [CLEARANCE, SPEED], "scene")
    (dots,) = (each for each in picture.axes[0].collections if isinstance(each, PathCollection))
    expected = np.array([1e3 * drawn[CLEARANCE], drawn[SPEED]]).T.tolist()
    assert np.asarray(dots.get_offsets()) == pytest.approx(np.array(sorted(expected)))


@pytest.mark.parametrize(
    ("fields", "show", "said"),
    [
        ([], None, "expected one or two fields that differ, got 0"),
        ([CLEARANCE, SPEED, "crank.mass_kg"], None, "expected one or two fields that differ, got 3"),
        ([CLEARANCE], "flight_part", "expected members with a number in flight_part, got none"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    grid: pd.DataFrame, fields: list[str], show: str | None, said: str
) -> None:
    with pytest.raises(NoPicture, match=said):
        sweep_picture(grid, fields, "scene", show)
