"""Judges on runs whose errors are put there by hand: what comes out is the number that was put in."""

from dataclasses import replace

import numpy as np
import pytest

from engine_models.engine import Trajectory
from engine_models.mechanics.trajectory import selected
from engine_models.minimal.engine import SharpSolver
from engine_models.reference.engine import SHARPEST, ReferenceEngine
from engine_models.scene.library import clearance, ideal_driven, ideal_free
from engine_models.scene.scene import Scene
from studies.judges import converged_truth
from studies.judges.comparison import Judged, compared
from studies.judges.converged_truth import Solved, reach
from studies.judges.energy_ledger import constraint_speed_m_s
from studies.judges.horizon import first_beyond_s
from studies.judges.metrics import constraint_violation_m, errors, scales, sizes, uncertainties
from tests.helpers.ideal_crank_slider import exact

POSITION = "slider_position_error_m"
EPS = 2.0**-52
SHIFT = 1e-3


def shifted(run: Trajectory, by_m: float, sample: int = 2) -> Trajectory:
    """Return a run with its slider off at one sample."""
    position = run.position.copy()
    position[sample, 2, 0] += by_m
    return replace(run, position=position)


@pytest.fixture(scope="module")
def driven() -> tuple[Scene, Trajectory]:
    return ideal_driven(), exact(ideal_driven(), 8)


def test_a_force_is_that_of_its_joint(driven: tuple[Scene, Trajectory]) -> None:
    scene, truth = driven
    for joint in "OAB":
        force = truth.joint_force_N[joint].copy()
        force[2] += (3.0, -4.0)
        off = errors(scene, replace(truth, joint_force_N={**truth.joint_force_N, joint: force}), truth)
        assert {name: e.max() for name, e in off.items() if e.any()} == {
            f"joint_{joint}_force_error_N": pytest.approx(5.0)
        }
        assert off[f"joint_{joint}_force_error_N"].argmax() == 2


def test_an_uncertainty_is_six_times_the_largest_distance_from_any_repeat_and_round_off(
    driven: tuple[Scene, Trajectory],
) -> None:
    scene, truth = driven
    found = uncertainties(scene, truth, [shifted(truth, 1e-6), shifted(truth, -3e-6, 5)])
    assert found["slider_position_uncertainty_m"] == pytest.approx(18e-6, rel=1e-6)
    alone = uncertainties(scene, truth, [truth])["slider_position_uncertainty_m"]
    assert alone == pytest.approx(4 * EPS * 0.17, rel=1e-6, abs=0.0), (
        "of crank and rod in line, 0.05 m and 0.12 m"
    )


def judged_by(scene: Scene, run: Trajectory, truth: Trajectory, until_s: float, **peaks: float) -> Judged:
    """A run with a truth that is its own repeat."""
    equal = np.ones(len(truth.time_s), dtype=bool)
    largest = {name: float(size.max()) for name, size in sizes(scene, truth).items()} | peaks
    true = Solved(truth, (truth,), "independent")
    return Judged(scene, run, run, true, equal, largest, until_s)


def test_a_signal_of_which_too_little_is_seen_or_nothing_is_there_is_not_judged(
    driven: tuple[Scene, Trajectory],
) -> None:
    scene, truth = driven
    seen = float(np.hypot(*truth.joint_force_N["B"].T).max())
    truth = replace(truth, guide_force_N={"guide": 0 * truth.guide_force_N["guide"]})
    for part, judged_at_all in ((0.995, True), (0.98, False)):
        row, _ = compared(judged_by(scene, truth, truth, 1.0, joint_B_force_N=seen / part))
        assert ("joint_B_force_error_N" in row) == judged_at_all
        assert "guide_normal_force_error_N" not in row
        assert "guide_normal_force_N: zero" in str(row["not_judged"])
        assert ("joint_B_force_N: 98 % of its peak is seen" in str(row["not_judged"])) == (not judged_at_all)


def test_what_is_compared_ends_at_the_horizon_and_is_the_largest(driven: tuple[Scene, Trajectory]) -> None:
    scene, truth = driven
    run = shifted(shifted(truth, -2e-6, 3), 5.0, 7)
    row, _ = compared(judged_by(scene, run, truth, float(truth.time_s[5])))
    assert row[POSITION] == pytest.approx(2e-6)
    assert row["compared_until_s"] == pytest.approx(5 * 0.024 / 8)
    fast = replace(truth, velocity=2 * truth.velocity)
    found = [compared(judged_by(scene, each, truth, 1.0))[0] for each in (truth, fast)]
    both = [row["largest_kinetic_energy_J"] for row in found]
    assert both[0] == both[1], "it is the truth's"


def test_the_first_repeat_that_parts_by_ten_nanometres_ends_the_comparison(
    driven: tuple[Scene, Trajectory],
) -> None:
    scene, truth = driven
    near, far = shifted(truth, 0.9e-8, 1), shifted(truth, 1.1e-8, 4)
    assert reach(scene, truth, (near, far)) == 4
    assert reach(scene, truth, (far, near)) == 4
    assert reach(scene, truth, (near, near)) == len(truth.time_s)


def test_a_truth_and_what_tells_its_uncertainty_are_found_in_different_ways() -> None:
    assert isinstance(converged_truth.TRUE, SharpSolver)
    assert isinstance(converged_truth.CONFIRMING, ReferenceEngine)
    assert converged_truth.CONFIRMING.step_tolerance == SHARPEST


def test_a_scale_is_the_largest_distance_from_the_mean_over_time() -> None:
    truth = exact(ideal_driven(), 2)
    position = truth.position.copy()
    position[:, 2, 0] = 1.0, 2.0, 6.0  # 3 on average
    force = {**truth.joint_force_N, "A": np.array([(0.0, 0.0), (3.0, 0.0), (0.0, 12.0)])}  # (1, 4) on average
    found = scales(ideal_driven(), replace(truth, position=position, joint_force_N=force))
    assert found["slider_position_scale_m"] == pytest.approx(3.0)
    assert found["joint_A_force_scale_N"] == pytest.approx(65.0**0.5)
    alone = scales(ideal_driven(), selected(truth, slice(1)))
    assert set(alone.values()) == {0.0}, "the horizon may leave the start alone"
    early = replace(truth, position=position, time_s=np.array([0.0, 1.0, 4.0]))  # for 1, 2 and 3 s
    assert scales(ideal_driven(), early)["slider_position_scale_m"] == pytest.approx(23 / 6 - 1)


@pytest.mark.parametrize(("body", "axis"), [(0, 0), (1, 1), (2, 0), (2, 1)])
def test_a_body_out_of_place_is_a_violation_of_that_size_and_one_that_moves_off_has_that_speed(
    body: int, axis: int
) -> None:
    scene = ideal_free().model_copy(update={"end_time_s": 0.02})
    truth = exact(scene, 4)
    position, velocity = truth.position.copy(), truth.velocity.copy()
    position[2, body, axis] += SHIFT
    velocity[2, body, axis] += SHIFT
    loose = scene.replace("clearance.B", clearance(5e-4))  # where the guide alone sees the slider's y
    violation = constraint_violation_m(loose if axis else scene, replace(truth, position=position))
    speed = constraint_speed_m_s(scene, replace(truth, velocity=velocity))
    assert [violation[2], speed[2]] == pytest.approx([SHIFT, SHIFT], rel=1e-9)
    assert violation[[0, 1, 3, 4]].max() < 1e-15


def test_a_horizon_is_the_first_time_beyond() -> None:
    distance = np.array([0.0, 2.0, 0.5, 3.0])
    assert first_beyond_s(np.arange(4.0), distance, 1.0) == 1.0
    assert first_beyond_s(np.arange(4.0), distance, 3.0) == np.inf
