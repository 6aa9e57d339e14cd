"""Pictures of a run show what its scene has, where it was."""

import re
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.quiver import Quiver
from PIL import Image

import crankslider as cs
from engine_models.engine import FloatArray
from engine_models.scene.file import load
from engine_models.scene.library import MECHANISMS
from reports.film import LONGEST_ARROW, Stage, film_bytes

#: Drawn is what a double has: the slider's place and gaps are differences of coordinates below 1 m.
ROUND_OFF_MM = 1e-9
#: A driven table with an arm of three corners on it, and a wheel whose only pin is its centre of mass.
ON_A_TABLE = load(Path(__file__).parent / "on-a-table.toml")


@pytest.fixture(scope="module")
def run() -> cs.Run:
    return cs.simulate("clearance-driven-AB", end=0.006, samples=12)


def stage(run: cs.Run, exaggerate: float = 1.0) -> Stage:
    """Return the figure of a film of all samples."""
    return Stage(run.scene, run.trajectory, exaggerate)


def film(run: cs.Run, ending: str, exaggerate: float) -> bytes:
    return film_bytes(run.scene, run.trajectory, exaggerate, ending)


def along(angle_rad: object) -> FloatArray:
    """Return unit vectors (n, 2)."""
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)  # type: ignore[call-overload]


def y_labels(figure: Figure) -> list[str]:
    return [ax.get_ylabel() for ax in figure.axes]


def test_at_its_true_size_the_mechanism_is_drawn_where_it_was(run: cs.Run) -> None:
    joints, position = stage(run).joints, run.trajectory.position
    a, b = joints["A"][1], joints["B"][0]
    np.testing.assert_allclose(np.hypot(*(b - a).T), 120.0, rtol=0, atol=ROUND_OFF_MM)
    turned = np.unwrap(np.arctan2(*(b - a).T[::-1]))
    np.testing.assert_allclose(turned, position[:, 1, 2], rtol=0, atol=ROUND_OFF_MM / 120)
    np.testing.assert_allclose((a + b) / 2, 1e3 * position[:, 1, :2], rtol=0, atol=ROUND_OFF_MM)
    np.testing.assert_allclose(joints["B"][1], 1e3 * position[:, 2, :2], rtol=0, atol=ROUND_OFF_MM)


def test_exaggerated_gaps_are_so_many_times_as_large(run: cs.Run) -> None:
    drawn = stage(run, 20.0)
    for joint in "AB":
        bearing, pin = drawn.joints[joint]
        true_m = run.frame[[f"clearance_{joint}_{axis}_m" for axis in "xy"]].to_numpy()
        np.testing.assert_allclose(pin - bearing, 2e4 * true_m, rtol=0, atol=ROUND_OFF_MM)
    assert not drawn.joints["B"][1][:, 1].any(), "the slider stays on its guide"
    drawn.show(3)
    discs = [patch for patch in drawn.axes.patches if isinstance(patch, Circle)]
    (bearing_disc,) = (each for each in discs if not each.get_fill() and each.center[0] > 100)
    pin_disc = next(each for each in discs if each.get_fill() and each.center[0] > 100)
    assert bearing_disc.get_radius() - pin_disc.get_radius() == pytest.approx(20 * 0.5)
    assert list(bearing_disc.center) == list(drawn.joints["B"][0][3])
    assert list(pin_disc.center) == list(drawn.joints["B"][1][3])


def test_the_scale_of_arrows_is_told_and_holds(run: cs.Run) -> None:
    drawn = stage(run)
    drawn.show(3)
    (title,) = (each.get_title().get_text() for each in drawn.picture.legends)
    mm, newtons, cut_mm = (float(number) for number in re.findall(r"\d[\d.e+]*", title))
    joints, _ = (each for each in drawn.axes.collections if isinstance(each, Quiver))
    for k, (name, body) in enumerate({"O": "crank", "A": "rod", "B": "slider"}.items()):
        whole = mm / newtons * run.trajectory.joint_force_N[name][3]
        cut = cut_mm / max(float(np.hypot(*whole)), cut_mm)
        np.testing.assert_allclose([np.asarray(joints.U)[k], np.asarray(joints.V)[k]], cut * whole, rtol=5e-3)
        place = drawn.forces[f"joint {name} on the {body}"][0][3]
        np.testing.assert_array_equal(np.asarray(joints.get_offsets())[k], place)


@pytest.mark.parametrize("bearing", ["coupler", "rocker"])
def test_the_corner_of_the_pin_s_body_moves_away_from_the_bearing(bearing: str) -> None:
    """Links are laid out from angles alone: the crank from O, the coupler from A, the rocker from C."""
    loose = MECHANISMS["four-bar-clearance"]().replace("clearance.B.bearing", bearing)
    run = cs.simulate(loose, end=0.02, samples=20)
    drawn, angle = (
        stage(run, 30.0),
        {name: run.frame[f"{name}_angle_rad"] for name in loose.mechanism.names},
    )
    crank_pin = 0.1 * along(angle["crank"])
    ends = {
        "coupler": crank_pin + 0.25 * along(angle["coupler"]),
        "rocker": [0.28, 0.0] + 0.2 * along(angle["rocker"]),
    }
    (of_pin,) = ends.keys() - {bearing}
    gap = 30.0 * (ends[of_pin] - ends[bearing])
    assert np.hypot(*gap.T).max() == pytest.approx(30.0 * 5e-4, rel=0.05)
    for name, near in (("coupler", crank_pin), ("rocker", np.broadcast_to([0.28, 0.0], gap.shape))):
        far = ends[name] if name == bearing else ends[bearing] + gap
        expected = np.stack([far, near], axis=1)
        np.testing.assert_allclose(drawn.bodies[name], 1e3 * expected, rtol=0, atol=1e-5)
    np.testing.assert_allclose(drawn.joints["B"][0], 1e3 * ends[bearing], rtol=0, atol=1e-5)
    circle, path, *_ = run.plot_orbit("B").axes[0].lines
    np.testing.assert_allclose(np.hypot(*map(np.asarray, circle.get_data())), 500.0)
    np.testing.assert_allclose(np.asarray(path.get_xdata()), 1e6 * gap[:, 0] / 30.0, rtol=0, atol=0.1)


def test_bodies_are_polygons_bars_or_blocks() -> None:
    drawn = stage(cs.simulate(ON_A_TABLE, samples=4))
    assert {name: corners.shape for name, corners in drawn.bodies.items()} == {
        "table": (5, 2, 2),
        "wheel": (5, 2, 2),
        "arm": (5, 2, 2),
    }
    np.testing.assert_allclose(np.hypot(*(drawn.bodies["wheel"][0, 0] - drawn.bodies["wheel"][0, 1])), 40.0)


@pytest.mark.parametrize("scene", [*MECHANISMS, ON_A_TABLE], ids=[*MECHANISMS, "table"])
def test_every_mechanism_has_its_pictures(scene: Any) -> None:
    run = cs.simulate(scene, end=0.005, samples=3)
    assert film(run, ".html", 10.0).count(b'"iVBOR') == 4
    drawn = stage(run, 10.0)
    for name, arrows in drawn.arrows.items():
        force = drawn.forces[name][1]
        lengths = np.hypot(*arrows.T) * np.hypot(*force.T)
        np.testing.assert_allclose(np.sum(arrows * force, axis=1), lengths, rtol=1e-12, atol=1e-300)
        assert np.hypot(*arrows.T).max() <= LONGEST_ARROW * drawn.unit_mm * (1 + 1e-12), name
    (left, right), (low, high) = drawn.axes.get_xlim(), drawn.axes.get_ylim()
    for corners in drawn.bodies.values():
        assert left < corners[..., 0].min() <= corners[..., 0].max() < right
        assert low < corners[..., 1].min() <= corners[..., 1].max() < high
    own = "slider" if "slider_position_m" in run.frame else run.scene.observed.name.replace(".", " ")
    motion = [label for label in y_labels(run.plot()) if label.replace("\n", " ").startswith(own)]
    assert len(motion) == 2


def test_a_film_moves(run: cs.Run) -> None:
    moving = Image.open(BytesIO(film(run, ".gif", 20.0)))
    assert 0 < moving.n_frames - 1 <= len(run.frame)  # type: ignore[attr-defined]
    pictures = []
    for k in range(3):
        moving.seek(k)
        pictures.append(np.asarray(moving.convert("RGB")))
    assert all((one != other).any() for one, other in pairwise(pictures))


def test_a_page_holds_its_whole_film_and_needs_nothing_else(run: cs.Run) -> None:
    page = film(run, ".html", 1.0).decode("utf-8")
    assert page.count('"iVBOR') == len(run.frame)
    assert "http" not in page
    assert f'max="{len(run.frame) - 1}"' in page
