"""Pictures of a run of which every number is written down: what is drawn where, under which name."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from reports.look import Picture
from reports.run_figures import orbit_plot, time_plot

#: Three samples, each column with numbers that no other has.
FRAME = pd.DataFrame(
    {
        "crank_angle_rad": [0.0, 0.1, 0.2],
        "crank_speed_rad_s": [10.0, 11.0, 12.0],
        "slider_position_m": [0.17, 0.16, 0.15],
        "slider_velocity_m_s": [-1.0, -2.0, -3.0],
        **{f"joint_{joint}_force_x_N": [size] * 3 for joint, size in (("O", 30.0), ("A", 6.0), ("B", 5.0))},
        **{f"joint_{joint}_force_y_N": [size] * 3 for joint, size in (("O", 40.0), ("A", 8.0), ("B", 12.0))},
        "guide_normal_force_N": [-20.0, -21.0, 22.0],
        "kinetic_energy_J": [7.0, 7.1, 7.2],
        "potential_energy_J": [1.0, 1.1, 1.2],
        "driver_work_J": [3.0, 3.1, 3.2],
        "dissipated_energy_J": [2.0, 2.1, 2.2],
        "clearance_B_x_m": [1e-4, 2e-4, 3e-4],
        "clearance_B_y_m": [0.0, -4e-4, -1e-4],
        "contact_B_penetration_m": [-4e-4, 1e-6, -2e-4],
    },
    index=pd.Index([0.0, 0.5, 1.0], name="time_s"),
)


def points(picture: Picture, panel: int) -> dict[str, Any]:
    """Return the points of every line of a panel by its name, a list across and one up."""
    ax = picture.axes[panel]
    return {
        str(line.get_label()): (list(np.asarray(line.get_xdata())), list(np.asarray(line.get_ydata())))
        for line in ax.get_lines()
    }


def test_an_orbit_shows_path_touches_and_start_in_micrometres_under_its_axes() -> None:
    picture = orbit_plot(FRAME, "B", 5e-4, "scene")
    lines, (ax,) = points(picture, 0), picture.axes
    assert lines["centre of the pin"] == (pytest.approx([100, 200, 300]), pytest.approx([0, -400, -100]))
    assert lines["in contact"] == (pytest.approx([200]), pytest.approx([-400]))
    assert lines["start"] == (pytest.approx([100]), pytest.approx([0]))
    assert max(lines["clearance circle"][0]) == pytest.approx(500)
    assert ax.get_xlabel() == "x from the centre of the bearing [µm]"
    assert ax.get_ylabel() == "y from the centre of the bearing [µm]"


def test_every_panel_over_time_has_its_own_numbers_under_their_names() -> None:
    picture = time_plot(FRAME, "scene", "quality")
    shown = {ax.get_ylabel(): points(picture, k) for k, ax in enumerate(picture.axes)}
    (position,), (velocity,) = (shown[f"slider {of}"].values() for of in ("position [m]", "velocity [m/s]"))
    assert position == ([0.0, 0.5, 1.0], [0.17, 0.16, 0.15])
    assert velocity == ([0.0, 0.5, 1.0], [-1.0, -2.0, -3.0])
    assert {name: up for name, (_, up) in shown["force [N]"].items()} == {
        "joint O": [50.0] * 3,
        "joint A": [10.0] * 3,
        "joint B": [13.0] * 3,
        "guide, normal": [-20.0, -21.0, 22.0],
    }
    assert {name: up for name, (_, up) in shown["energy [J]"].items()} == {
        "kinetic": [7.0, 7.1, 7.2],
        "potential": [1.0, 1.1, 1.2],
        "driver work": [3.0, 3.1, 3.2],
        "dissipated": [2.0, 2.1, 2.2],
    }
    assert picture.axes[-1].get_xlabel() == "time [s]"
