"""Pictures of a run show what its scene has, where it was."""

from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import crankslider as cs
from engine_models.engine import FloatArray
from engine_models.scene.file import load
from engine_models.scene.library.mechanisms import MECHANISMS
from reports.run.drawing import Shape
from reports.run.film import LONGEST_ARROW, Drawing, Stage

#: Drawn is what a double has: the slider's place and gaps are differences of coordinates below 1 m.
ROUND_OFF_M = 1e-12
#: A driven table with an arm of three corners on it, and a wheel whose only pin is its centre of mass.
ON_A_TABLE = load(Path(__file__).parent / "on-a-table.toml")


@pytest.fixture(scope="module")
def run() -> cs.Run:
    return cs.simulate("clearance-driven-AB", end=0.006, samples=24)


def drawing(run: cs.Run, exaggerate: float = 1.0) -> Drawing:
    """Return what a film of all samples shows."""
    return Shape(run.scene, run.trajectory, exaggerate).drawing()


def along(angle_rad: object) -> FloatArray:
    """Return unit vectors (n, 2)."""
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)  # type: ignore[call-overload]


def y_labels(figure: Figure) -> list[str]:
    return [ax.get_ylabel() for ax in figure.axes]


def test_at_its_true_size_the_mechanism_is_drawn_where_it_was(run: cs.Run) -> None:
    joints, position = drawing(run).joints, run.trajectory.position
    rod = joints["B"].bearing_m - joints["A"].pin_m
    np.testing.assert_allclose(np.hypot(*rod.T), 0.12, rtol=0, atol=ROUND_OFF_M)
    turned = np.unwrap(np.arctan2(rod[:, 1], rod[:, 0]))
    np.testing.assert_allclose(turned, position[:, 1, 2], rtol=0, atol=ROUND_OFF_M / 0.12)
    np.testing.assert_allclose(joints["A"].pin_m + rod / 2, position[:, 1, :2], rtol=0, atol=ROUND_OFF_M)
    np.testing.assert_allclose(joints["B"].pin_m, position[:, 2, :2], rtol=0, atol=ROUND_OFF_M)


def test_exaggerated_gaps_are_so_many_times_as_large(run: cs.Run) -> None:
    joints = drawing(run, 20.0).joints
    for joint in "AB":
        gap = joints[joint].pin_m - joints[joint].bearing_m
        true = run.frame[[f"clearance_{joint}_{axis}_m" for axis in "xy"]].to_numpy()
        np.testing.assert_allclose(gap, 20.0 * true, rtol=0, atol=ROUND_OFF_M)
    assert not joints["B"].pin_m[:, 1].any(), "the slider stays on its guide"


@pytest.mark.parametrize("bearing", ["coupler", "rocker"])
def test_the_corner_of_the_pin_s_body_moves_away_from_the_bearing(bearing: str) -> None:
    """Links are laid out from angles alone: the crank from O, the coupler from A, the rocker from C."""
    loose = MECHANISMS["four-bar-clearance"]().replace("clearance.B.bearing", bearing)
    run = cs.simulate(loose, end=0.02, samples=20)
    drawn, angle = (
        drawing(run, 30.0),
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
        np.testing.assert_allclose(drawn.bodies[name], expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(drawn.joints["B"].bearing_m, ends[bearing], rtol=0, atol=1e-8)
    circle, path, *_ = run.plot_orbit("B").axes[0].lines
    np.testing.assert_allclose(np.hypot(*map(np.asarray, circle.get_data())), 500.0)
    np.testing.assert_allclose(np.asarray(path.get_xdata()), 1e6 * gap[:, 0] / 30.0, rtol=0, atol=0.1)


def test_a_slot_lies_on_its_body_and_is_as_long_as_its_pin_needs() -> None:
    run = cs.simulate("scotch-yoke", end=0.3, samples=300)
    slot, crank = drawing(run).guides["slot"], 0.05 * along(run.frame["crank_angle_rad"])
    np.testing.assert_allclose(slot.pin_m, crank, rtol=0, atol=1e-9)
    np.testing.assert_allclose(slot.ends_m[..., 0], crank[:, :1] * [1, 1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(slot.ends_m[:, :, 1], [[-0.05, 0.05]] * 301, rtol=0, atol=1e-4)
    assert not slot.has_block
    assert drawing(run).guides["frame"].has_block


def test_bodies_are_polygons_bars_or_blocks_and_marks_point_as_loads_and_drives_act() -> None:
    drawn = drawing(cs.simulate(ON_A_TABLE, samples=4))
    assert {name: corners.shape for name, corners in drawn.bodies.items()} == {
        "table": (5, 2, 2),
        "wheel": (5, 2, 2),
        "arm": (5, 3, 2),
    }
    arm = {(round(x, 9), round(y, 9)) for x, y in drawn.bodies["arm"][0]}
    assert arm == {(0.05, 0.05), (0.17, 0.05), (0.17, 0.1)}, "joint, spring, and the observed point"
    assert np.hypot(*(drawn.bodies["wheel"][0, 0] - drawn.bodies["wheel"][0, 1])) == pytest.approx(0.04)
    force, torque = drawn.loads
    assert force.angle_rad is not None
    assert (set(force.angle_rad), set(force.sign)) == ({0.5}, {-1.0})
    assert torque.angle_rad is None
    assert torque.sign.tolist() == [1, 1, -1, -1, -1]
    np.testing.assert_allclose(torque.place_m, [[0.25, 0.1]] * 5, rtol=0, atol=1e-9)
    driven = drawing(cs.simulate("four-bar-clearance", end=0.002, samples=4)).drive
    assert driven is not None
    np.testing.assert_allclose(driven.place_m, [[0, 0]] * 5, rtol=0, atol=1e-15)
    assert driven.sign.tolist() == [1] * 5


@pytest.mark.parametrize("scene", [*MECHANISMS, ON_A_TABLE], ids=[*MECHANISMS, "table"])
def test_every_mechanism_has_its_pictures(scene: Any) -> None:
    run = cs.simulate(scene, end=0.005, samples=3)
    assert run.film(".html", 10.0).count(b'"iVBOR') == 4
    drawn = drawing(run, 10.0)
    stage = Stage(drawn, "")
    for name, arrows in stage.arrows.items():
        force = drawn.forces[name].force_N
        lengths = np.hypot(*arrows.T) * np.hypot(*force.T)
        np.testing.assert_allclose(np.sum(arrows * force, axis=1), lengths, rtol=1e-12, atol=1e-300)
        assert np.hypot(*arrows.T).max() <= LONGEST_ARROW * 1e3 * drawn.link_m * (1 + 1e-12), name
    (left, right), (low, high) = stage.axes.get_xlim(), stage.axes.get_ylim()
    for corners in drawn.bodies.values():
        x, y = 1e3 * corners[..., 0], 1e3 * corners[..., 1]
        assert left < x.min() <= x.max() < right
        assert low < y.min() <= y.max() < high
    own = "slider" if "slider_position_m" in run.frame else run.scene.observed.name.replace(".", " ")
    motion = [label for label in y_labels(run.plot()) if label.replace("\n", " ").startswith(own)]
    assert len(motion) == 2


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
