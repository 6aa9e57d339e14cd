"""Checks of the gallery: relative errors of a run against an independent truth, by what was judged."""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.scene.scene import Scene
from studies.extremes.truth import braked_wheel, dropped_wheel, folded_rod, turning_rod
from studies.judges.converged_truth import converged, followed
from studies.judges.ideal_truth import exact, slider_position_m

Errors = Mapping[str, float]


def _off(value: FloatArray, true: FloatArray, size: float) -> float:
    """Return the largest distance from the truth, of numbers (n,) or vectors (n, k), in parts of a size."""
    difference = value - true
    distance = np.abs(difference) if difference.ndim == 1 else np.sqrt(np.sum(difference**2, axis=-1))
    return float(distance.max() / size)


def ideal_motion(scene: Scene, run: Trajectory) -> Errors:
    """Judge a scene of ideal joints by the motion in one coordinate: crank, slider, force at B."""
    samples = len(run.time_s) - 1
    truth = exact(scene, samples)
    force, angle = truth.joint_force_N[:, -1], truth.position[:, 0, 2]
    return {
        "slider position": _off(run.slider_position_m, truth.slider_position_m, scene.crank.length_m),
        "crank angle": _off(run.position[:, 0, 2], angle, float(np.ptp(angle)) or 1.0),
        "force at B": _off(run.joint_force_N[:, -1], force, float(np.hypot(*force.T).max()) or 1.0),
    }


def loose_motion(scene: Scene, run: Trajectory) -> Errors:
    """Judge clearance at B by the converged solution, for as long as independent solutions agree.

    The distance is that from the farthest of these, so that no solver is judged by itself.
    """
    samples = len(run.time_s) - 1
    truth, repeats = converged(scene, samples)
    until = slice(None, followed(scene, samples))
    contact = truth.contacts["B"]
    size = float(np.hypot(*contact.gap_m[until].T).max())
    impulse = float(contact.normal_impulse_N_s[until][-1])
    judged = [
        (
            _off(run.contacts["B"].gap_m[until], other.contacts["B"].gap_m[until], size),
            _off(
                run.contacts["B"].normal_impulse_N_s[until],
                other.contacts["B"].normal_impulse_N_s[until],
                impulse,
            ),
        )
        for other in (truth, *repeats)
    ]
    place, push = (max(column) for column in zip(*judged, strict=True))
    return {"place in the bearing": place, "impulse at B": push}


def long_turning(scene: Scene, run: Trajectory) -> Errors:
    """Judge a crank that keeps its speed by its closed form, reduced to one turn before it is evaluated."""
    theta = np.remainder(scene.start.crank_angle_rad + scene.start.crank_speed_rad_s * run.time_s, 2 * np.pi)
    true = slider_position_m(scene, theta)
    return {"slider position": _off(run.slider_position_m, true, scene.crank.length_m)}


def dropped(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel on the bearing's vertical by its height, in parts of the height it moves through."""
    height = dropped_wheel(scene, run.time_s)
    travel = float(np.ptp(height))
    place = run.position[:, 0, :2]
    return {"height": _off(place, np.stack([np.zeros_like(height), height], axis=-1), travel)}


def resting(scene: Scene, run: Trajectory) -> Errors:
    """Judge bodies that have to stay where they began, in parts of the crank's length (or of a radian)."""
    moved = run.position - run.position[0]
    return {"any body's place": float(np.abs(moved).max() / scene.crank.length_m)}


def braked(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel on a dry bearing by its spin, the angle it turned and its place in the bearing."""
    spin, angle = braked_wheel(scene, run.time_s)
    return {
        "spin": _off(run.velocity[:, 0, 2], spin, float(spin[0])),
        "angle turned": _off(run.position[:, 0, 2] - run.position[0, 0, 2], angle, float(np.ptp(angle))),
    }


def stopped(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel on a dry bearing by the angle it turned until it stood, and after.

    What it rolls back then, by no more than the clearance and the depth over the pin's radius, is below 3e-4
    of that angle.
    """
    return {"angle turned": braked(scene, run)["angle turned"]}


def turned_over(scene: Scene, run: Trajectory) -> Errors:
    """Judge a rod shorter than the crank by the motion in the rod's own angle."""
    true = turning_rod(scene, run.time_s)
    return {"slider position": _off(run.slider_position_m, true, scene.crank.length_m)}


def unfolded(scene: Scene, run: Trajectory) -> Errors:
    """Judge a crank and rod of one length by the smooth branch past their dead centre."""
    true = folded_rod(scene, run.time_s)
    return {"slider position": _off(run.slider_position_m, true, scene.crank.length_m)}


def impossible(scene: Scene, run: Trajectory) -> Errors:
    """Judge a run of a scene that has no motion: whatever came is wrong altogether."""
    del scene, run
    return {"a motion where there is none": 1.0}
