"""Checks of the gallery: relative errors of a run against an independent truth, by what was judged."""

from collections.abc import Callable, Mapping

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.samples import selected
from engine_models.mechanics.states import observed_m
from engine_models.scene.scene import Clearances, Scene
from studies.extremes.case import Check
from studies.judges.converged_truth import converged, followed

Errors = Mapping[str, float]
#: Turns after which a motion that settles has settled.
SETTLED_TURNS = 20


def _off(value: FloatArray, true: FloatArray, size: float) -> float:
    """Return the largest distance from the truth, of numbers (n,) or vectors (n, k), in parts of a size."""
    difference = value - true
    distance = np.abs(difference) if difference.ndim == 1 else np.sqrt(np.sum(difference**2, axis=-1))
    return float(distance.max() / size)


def _truth(scene: Scene, run: Trajectory) -> Trajectory:
    """Return the true trajectory at the samples of a run."""
    return converged(scene, len(run.time_s) - 1)[0]


def ideal_motion(scene: Scene, run: Trajectory) -> Errors:
    """Judge a scene of ideal joints by its true motion: crank, slider, force at B."""
    truth = _truth(scene, run)
    force, angle = truth.joint_force_N["B"], truth.position[:, 0, 2]
    return {
        "slider position": _off(observed_m(scene, run), observed_m(scene, truth), scene.crank.length_m),
        "crank angle": _off(run.position[:, 0, 2], angle, float(np.ptp(angle)) or 1.0),
        "force at B": _off(run.joint_force_N["B"], force, float(np.hypot(*force.T).max()) or 1.0),
    }


def loose_motion(scene: Scene, run: Trajectory) -> Errors:
    """Judge joints with clearance by the converged solution, for as long as independent solutions agree.

    The distance is that from the farthest of these, so that no solver is judged by itself.
    """
    samples = len(run.time_s) - 1
    truth, repeats = converged(scene, samples)
    until = slice(None, followed(scene, samples))
    errors: dict[str, float] = {}
    for joint in scene.joints_with_clearance:
        own, *others = (selected(motion.contacts[joint], until) for motion in (run, truth, *repeats))
        size = float(np.hypot(*others[0].gap_m.T).max())
        impulse = float(others[0].normal_impulse_N_s[-1])
        errors[f"place in the bearing at {joint}"] = max(
            _off(own.gap_m, other.gap_m, size) for other in others
        )
        errors[f"impulse at {joint}"] = max(
            _off(own.normal_impulse_N_s, other.normal_impulse_N_s, impulse) for other in others
        )
    return errors


def settled(scene: Scene, run: Trajectory) -> Errors:
    """Judge a long run of clearance at B by the periodic motion that it settles to.

    The samples are whole turns and a little apart, so that they take a part of a turn by its phases, and the
    first of them comes after ``SETTLED_TURNS``. The truth is the converged solution, in the turn after these.
    """
    samples = len(run.time_s) - 1
    turn = 2 * np.pi / scene.start.crank_speed_rad_s
    per_turn = round(samples * turn / (scene.end_time_s % turn))
    short = scene.model_copy(update={"end_time_s": SETTLED_TURNS * turn + scene.end_time_s % turn})
    truth, _ = converged(short, SETTLED_TURNS * per_turn + samples)
    true, gap = truth.contacts["B"].gap_m[SETTLED_TURNS * per_turn :], run.contacts["B"].gap_m
    size = float(np.hypot(*true.T).max())
    return {"place in the bearing at B": _off(gap[1:], true[1:], size)}


def nearly_ideal(scene: Scene, run: Trajectory) -> Errors:
    """Judge a clearance of next to nothing by the ideal joint's slider: the walls give less than is right."""
    ideal = _truth(scene.model_copy(update={"clearance": Clearances()}), run)
    off = _off(observed_m(scene, run), observed_m(scene, ideal), scene.crank.length_m)
    return {"slider position": off}


def slider_by(truth: Callable[[Scene, FloatArray], FloatArray]) -> Check:
    """Return the check of the slider by its true position (n,) in m, given a scene and n times in s."""

    def slider(scene: Scene, run: Trajectory) -> Errors:
        true = truth(scene, run.time_s)
        return {"slider position": _off(observed_m(scene, run), true, scene.crank.length_m)}

    return slider


def dropped(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel on the bearing's vertical by its place, in parts of the height it moves through."""
    true = _truth(scene, run).position[:, 0, :2]
    return {"height": _off(run.position[:, 0, :2], true, float(np.ptp(true[:, 1])))}


def bounced(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel that bounces between two samples by its height and the impulse told of impacts."""
    told, true = (
        float(each.contacts["O"].impacts.normal_impulse_N_s.sum()) for each in (run, _truth(scene, run))
    )
    return {**dropped(scene, run), "impulse of the bounce": abs(told / true - 1)}


def resting(scene: Scene, run: Trajectory) -> Errors:
    """Judge bodies that have to stay where they began, in parts of the crank's length (or of a radian)."""
    moved = run.position - run.position[0]
    return {"any body's place": float(np.abs(moved).max() / scene.crank.length_m)}


def braked(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel on a dry bearing by its spin and the angle it turned."""
    truth = _truth(scene, run)
    spin, angle = truth.velocity[:, 0, 2], truth.position[:, 0, 2]
    return {
        "spin": _off(run.velocity[:, 0, 2], spin, float(spin[0])),
        "angle turned": _off(run.position[:, 0, 2], angle, float(np.ptp(angle))),
    }


def swung(scene: Scene, run: Trajectory) -> Errors:
    """Judge a pendulum on a dry bearing by its angle and its pin's place in the bearing."""
    truth = _truth(scene, run)
    angle, place = truth.position[:, 0, 2], truth.contacts["O"].gap_m
    return {
        "angle": _off(run.position[:, 0, 2], angle, float(np.ptp(angle))),
        "place in the bearing": _off(run.contacts["O"].gap_m, place, float(np.hypot(*place.T).max())),
    }


def impossible(scene: Scene, run: Trajectory) -> Errors:
    """Judge a run of a scene that has no motion: whatever came is wrong altogether."""
    del scene, run
    return {"a motion where there is none": 1.0}
