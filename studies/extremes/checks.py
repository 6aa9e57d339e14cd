"""Checks of the gallery: relative errors of a run against an independent truth, by what was judged."""

from collections.abc import Callable, Mapping

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.samples import selected
from engine_models.scene.scene import Scene
from studies.extremes.case import Check
from studies.extremes.truth import braked_wheel, dropped_wheel
from studies.judges.converged_truth import converged, followed
from studies.judges.ideal_truth import exact

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
    own, *others = (selected(motion.contacts["B"], until) for motion in (run, truth, *repeats))
    size = float(np.hypot(*others[0].gap_m.T).max())
    impulse = float(others[0].normal_impulse_N_s[-1])
    return {
        "place in the bearing": max(_off(own.gap_m, other.gap_m, size) for other in others),
        "impulse at B": max(
            _off(own.normal_impulse_N_s, other.normal_impulse_N_s, impulse) for other in others
        ),
    }


def slider_by(truth: Callable[[Scene, FloatArray], FloatArray]) -> Check:
    """Return the check of the slider by its true position (n,) in m, given a scene and n times in s."""

    def slider(scene: Scene, run: Trajectory) -> Errors:
        true = truth(scene, run.time_s)
        return {"slider position": _off(run.slider_position_m, true, scene.crank.length_m)}

    return slider


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


def impossible(scene: Scene, run: Trajectory) -> Errors:
    """Judge a run of a scene that has no motion: whatever came is wrong altogether."""
    del scene, run
    return {"a motion where there is none": 1.0}
