"""Pictures of a run show what its scene has, where it was."""

from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.animation import FFMpegWriter
from matplotlib.figure import Figure
from PIL import Image

import crankslider as cs
from reports.run.film import LONGEST_ARROW, Mechanism, Stage, places

#: Drawn is what a double has: the slider's place and gaps are differences of coordinates below 1 m.
ROUND_OFF_M = 1e-12
LENGTHS = Mechanism(0.05, 0.12, {"A": 5e-4, "B": 5e-4})


@pytest.fixture(scope="module")
def run() -> cs.Run:
    return cs.simulate("clearance-driven-AB", end=0.006, samples=24)


def y_labels(figure: Figure) -> list[str]:
    return [ax.get_ylabel() for ax in figure.axes]


def test_a_plot_has_a_panel_for_what_the_scene_has(run: cs.Run) -> None:
    motion = ["slider position [m]", "slider velocity [m/s]", "force [N]"]
    free = cs.simulate("ideal-free", end=0.01, samples=4)
    assert y_labels(free.plot()) == [*motion, "energy [J]"]
    assert y_labels(run.plot()) == [*motion, "driver torque [N·m]", "energy [J]"]
    pendulum = cs.simulate("clearance-pendulum", end=0.01, samples=4)
    assert y_labels(pendulum.plot()) == [
        "crank angle [rad]",
        "crank speed [rad/s]",
        "force [N]",
        "energy [J]",
    ]


def test_a_plot_shows_the_frame_and_names_every_curve(run: cs.Run) -> None:
    position, _, forces, _, energy = run.plot().axes
    np.testing.assert_array_equal(position.lines[0].get_ydata(), run.frame["slider_position_m"])
    size = np.hypot(run.frame["joint_A_force_x_N"], run.frame["joint_A_force_y_N"])
    np.testing.assert_array_equal(forces.lines[1].get_ydata(), size)
    *names, mark = [line.get_label() for line in forces.lines]
    assert (names, mark) == (["joint O", "joint A", "joint B", "guide, normal"], "_mark")
    assert [line.get_label() for line in energy.lines] == ["kinetic", "potential", "dissipated"]


@pytest.mark.parametrize("scene", ["clearance-driven-AB", "ideal-compressor", "rigid-pendulum"])
def test_no_text_leaves_its_figure(scene: str) -> None:
    run = cs.simulate(scene, end=0.005, samples=20)
    for figure in (run.plot(), *(run.plot_orbit(joint) for joint in run.scene.joints_with_clearance)):
        figure.draw_without_rendering()  # lays it out
        drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
        assert min(drawn.x0, drawn.y0) >= 0, drawn
        assert drawn.x1 <= width, drawn
        assert drawn.y1 <= height, drawn


def test_an_orbit_is_the_gap_in_its_circle(run: cs.Run) -> None:
    circle, path, contact, _ = run.plot_orbit("B").axes[0].lines
    np.testing.assert_allclose(np.hypot(*map(np.asarray, circle.get_data())), 500.0)
    np.testing.assert_allclose(np.asarray(path.get_xdata()), 1e6 * run.frame["clearance_B_x_m"])
    touching = run.frame["contact_B_penetration_m"] >= 0
    assert 0 < len(np.asarray(contact.get_xdata())) == touching.sum() < len(run.frame)


def test_at_its_true_size_the_mechanism_is_drawn_where_it_was(run: cs.Run) -> None:
    drawn, position = places(run.frame, LENGTHS, 1.0), run.trajectory.position
    rod = drawn.bearing["B"] - drawn.pin["A"]
    np.testing.assert_allclose(np.hypot(*rod.T), 0.12, rtol=0, atol=ROUND_OFF_M)
    turned = np.unwrap(np.arctan2(rod[:, 1], rod[:, 0]))
    np.testing.assert_allclose(turned, position[:, 1, 2], rtol=0, atol=ROUND_OFF_M / 0.12)
    np.testing.assert_allclose((drawn.pin["A"] + rod / 2), position[:, 1, :2], rtol=0, atol=ROUND_OFF_M)
    np.testing.assert_allclose(drawn.pin["B"], position[:, 2, :2], rtol=0, atol=ROUND_OFF_M)


def test_exaggerated_gaps_are_so_many_times_as_large(run: cs.Run) -> None:
    drawn = places(run.frame, LENGTHS, 20.0)
    for joint in "AB":
        gap = drawn.pin[joint] - drawn.bearing[joint]
        true = run.frame[[f"clearance_{joint}_{axis}_m" for axis in "xy"]].to_numpy()
        np.testing.assert_allclose(gap, 20.0 * true, rtol=0, atol=ROUND_OFF_M)
    assert not drawn.pin["B"][:, 1].any(), "the slider stays on its guide"


def test_arrows_point_along_their_forces_and_none_is_longer_than_told(run: cs.Run) -> None:
    stage = Stage(run.frame, LENGTHS, 1.0, "")
    for name, (joint, arrows) in stage.forces.items():
        assert np.hypot(*arrows.T).max() <= LONGEST_ARROW * 50.0 * (1 + 1e-12), name
        if not name.startswith("guide"):
            force = run.frame[[f"joint_{joint}_force_{axis}_N" for axis in "xy"]].to_numpy()
            lengths = np.hypot(*arrows.T) * np.hypot(*force.T)
            np.testing.assert_allclose(np.sum(arrows * force, axis=1), lengths, rtol=1e-12)


def test_a_film_moves(run: cs.Run) -> None:
    film = Image.open(BytesIO(run.film(".gif", 20.0)))
    assert 0 < film.n_frames - 1 <= len(run.frame)  # type: ignore[attr-defined]
    pictures = []
    for k in range(3):
        film.seek(k)
        pictures.append(np.asarray(film.convert("RGB")))
    assert all((one != other).any() for one, other in pairwise(pictures))


def test_a_page_holds_its_whole_film_and_needs_nothing_else(run: cs.Run) -> None:
    page = run.film(".html", 1.0).decode("utf-8")
    assert page.count('"iVBOR') == len(run.frame)
    assert "http" not in page
    assert f'max="{len(run.frame) - 1}"' in page


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="ffmpeg is not installed")
def test_with_ffmpeg_there_is_mp4(run: cs.Run) -> None:
    assert run.film(".mp4", 1.0)[4:8] == b"ftyp"
