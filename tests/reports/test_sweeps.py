"""The picture of a sweep: points over one field, a map over two."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PathCollection

from reports.run_figures import sweep_picture
from studies.failures import BadInput

CLEARANCE, SPEED = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s"
FORCE = "largest_contact_force_N"
CLEARANCES_M, SPEEDS = np.meshgrid(np.geomspace(1e-5, 1e-3, 4), np.linspace(100, 300, 3), indexing="ij")
GRID = pd.DataFrame({CLEARANCE: CLEARANCES_M.ravel(), SPEED: SPEEDS.ravel(), "status": "ok"})
GRID[FORCE] = np.linspace(1e3, 1.2e4, 12)
GRID.loc[5, ["status", FORCE]] = "failed", np.nan
DONE = GRID.drop(index=5)


def test_over_one_field_there_is_a_point_for_each_member() -> None:
    picture = sweep_picture(GRID, [CLEARANCE], "scene")
    (ax,) = picture.axes
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), DONE[[CLEARANCE, FORCE]])
    assert (ax.get_xlabel(), ax.get_xscale()) == ("clearance.B.radial clearance [m]", "log")
    assert (ax.get_ylabel(), ax.get_yscale()) == ("largest contact force [N]", "linear")
    assert picture.get_suptitle() == "scene: 12 members, 1 failed"


def test_over_two_fields_each_place_has_the_colour_of_the_mean_of_its_members() -> None:
    twice = pd.concat([GRID, GRID.assign(**{FORCE: GRID[FORCE] + 200.0})])
    ax, scale = sweep_picture(twice, [CLEARANCE, SPEED], "scene", FORCE).axes
    (dots,) = (each for each in ax.collections if isinstance(each, PathCollection))
    np.testing.assert_array_equal(dots.get_offsets(), DONE[[CLEARANCE, SPEED]])
    np.testing.assert_allclose(np.asarray(dots.get_array()), DONE[FORCE] + 100.0)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "linear")
    assert (ax.get_ylabel(), scale.get_ylabel()) == ("start.crank speed [rad/s]", "largest contact force [N]")


def test_what_cannot_be_drawn_is_refused() -> None:
    with pytest.raises(BadInput, match="expected one or two fields that differ, got 0"):
        sweep_picture(GRID, [], "scene")
    with pytest.raises(BadInput, match="expected members with a number in flight_part, got none"):
        sweep_picture(GRID, [CLEARANCE], "scene", "flight_part")
