"""The picture of a sweep: points over one field, a map over two."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PathCollection

from reports.run_figures import NoPicture, sweep_picture

CLEARANCE, SPEED = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s"
FORCE = "largest_contact_force_N"


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
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), grid.drop(index=5)[[CLEARANCE, FORCE]])
    assert (ax.get_xlabel(), ax.get_xscale()) == ("clearance.B.radial clearance [m]", "log")
    assert (ax.get_ylabel(), ax.get_yscale()) == ("largest contact force [N]", "linear")
    assert picture.get_suptitle() == "scene: 12 members, 1 failed"


def test_over_two_fields_each_place_has_the_colour_of_the_mean_of_its_members(grid: pd.DataFrame) -> None:
    twice = pd.concat([grid, grid.assign(**{FORCE: grid[FORCE] + 200.0})])
    ax, scale = sweep_picture(twice, [CLEARANCE, SPEED], "scene", FORCE).axes
    (dots,) = (each for each in ax.collections if isinstance(each, PathCollection))
    done = grid.drop(index=5)
    np.testing.assert_array_equal(dots.get_offsets(), done[[CLEARANCE, SPEED]])
    np.testing.assert_allclose(np.asarray(dots.get_array()), done[FORCE] + 100.0)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "linear")
    assert (ax.get_ylabel(), scale.get_ylabel()) == ("start.crank speed [rad/s]", "largest contact force [N]")


@pytest.mark.parametrize(
    ("fields", "show", "said"),
    [
        ([], None, "expected one or two fields that differ, got 0"),
        ([CLEARANCE], "flight_part", "expected members with a number in flight_part, got none"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    grid: pd.DataFrame, fields: list[str], show: str | None, said: str
) -> None:
    with pytest.raises(NoPicture, match=said):
        sweep_picture(grid, fields, "scene", show)
