"""Pictures of a run of which every number is written down: what is drawn where, under which name."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.patches import Circle
from matplotlib.quiver import Quiver

from reports.plots.picture import Picture
from reports.results import FloatArray
from reports.run.figures import orbit_plot, time_plot
from reports.run.film import Drawing, Force, Joint, Stage

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


def at(x: float, y: float) -> FloatArray:
    """Return one place at all three times, (3, 2)."""
    return np.array([[x, y]] * 3)


@pytest.fixture
def stage() -> Stage:
    """Return the second picture of a film of a crank of 50 mm, its clearance at B 20 times as large."""
    pin = np.array([[0.17, 0.0], [0.16, 0.0], [0.15, 0.0]])
    bearing = pin - 20.0 * np.array([[1e-4, 0.0], [2e-4, -4e-4], [3e-4, -1e-4]])
    drawing = Drawing(
        time_s=np.array([0.0, 0.5, 1.0]),
        link_m=0.05,
        bodies={
            "crank": np.stack([at(0, 0), at(0.05, 0)], axis=1),
            "rod": np.stack([at(0.05, 0), bearing], axis=1),
        },
        joints={"O": Joint(at(0, 0), at(0, 0)), "B": Joint(bearing, pin, 20.0 * 5e-4)},
        feet={(0.0, 0.0): 0.0},
        guides={},
        springs=[],
        loads=[],
        drive=None,
        forces={
            "joint O on the crank": Force(at(0, 0), at(30.0, 40.0)),
            "joint A on the rod": Force(at(0.05, 0), at(6.0, 8.0)),
            "joint B on the slider": Force(pin, at(5.0, 12.0)),
            "guide on the slider": Force(pin, np.array([[0.0, -20.0], [0.0, -21.0], [0.0, 22.0]])),
        },
        exaggeration=20.0,
    )
    stage = Stage(drawing, "scene")
    stage.show(1)
    return stage


def test_the_scale_of_arrows_is_told_and_holds(stage: Stage) -> None:
    """Of twelve forces, four each of 50, 10, 13 and 20 to 22 N, those up to 50 N are 0.6 of a crank long."""
    (title,) = (each.get_title().get_text() for each in stage.picture.legends)
    assert title == f"forces: 50 mm are {50 / 0.6:.3g} N, cut at 45 mm"
    assert {name: arrows[1].tolist() for name, arrows in stage.arrows.items()} == {
        "joint O on the crank": pytest.approx([30 * 0.6, 40 * 0.6]),
        "joint A on the rod": pytest.approx([6 * 0.6, 8 * 0.6]),
        "joint B on the slider": pytest.approx([5 * 0.6, 12 * 0.6]),
        "guide on the slider": pytest.approx([0.0, -21 * 0.6]),
    }
    moved = [quiver for quiver in stage.axes.collections if isinstance(quiver, Quiver)]
    at_mm = [np.asarray(quiver.get_offsets())[0].tolist() for quiver in moved]
    assert at_mm == [[0, 0], [50, 0], [160, 0], [160, 0]]


def test_a_bearing_is_larger_than_its_pin_by_the_clearance_as_it_is_drawn(stage: Stage) -> None:
    discs = [patch for patch in stage.axes.patches if isinstance(patch, Circle)]
    (bearing,) = (disc for disc in discs if not disc.get_fill())
    pin = next(disc for disc in discs if disc.get_fill() and disc.center[0] == pytest.approx(160.0))
    assert bearing.get_radius() - pin.get_radius() == pytest.approx(20 * 0.5)
    assert np.subtract(pin.center, bearing.center) == pytest.approx([20 * 0.2, 20 * -0.4])
