"""Pymunk's runs of ideal scenes, how far they are from the truth, and how that falls with the step."""

import numpy as np

from engine_models.engine import RunSettings, Trajectory
from engine_models.pymunk.engine import PymunkEngine
from engine_models.scene.scene import Scene
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, errors
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES = 160
#: What a regression over a factor of 4 to 8 in the step leaves of the next term of the error.
ORDER_TOLERANCE = 0.05


def run(scene: Scene, engine: PymunkEngine, steps_per_sample: int = 1, samples: int = SAMPLES) -> Trajectory:
    return engine.simulate(scene, RunSettings(scene.end_time_s / (samples * steps_per_sample), samples))


def worst(scene: Scene, trajectory: Trajectory, since: int = 0) -> dict[str, float]:
    """Return the largest error of every signal, of torque and works, energy balance and constraints."""
    truth = exact(scene, len(trajectory.time_s) - 1)
    out = dict(errors(scene, trajectory, truth))
    if trajectory.driver_work_J is not None and truth.driver_work_J is not None:
        out["driver_work_J"] = trajectory.driver_work_J - truth.driver_work_J
    if scene.drive.kind == "motor":
        assert trajectory.driver_torque_N_m is not None
        assert truth.driver_torque_N_m is not None
        out["motor_torque_N_m"] = trajectory.driver_torque_N_m - truth.driver_torque_N_m
    for part, work in trajectory.load_work_J.items():
        out[f"{part}_work_J"] = work - truth.load_work_J[part]
    out["energy_J"] = energy_balance_residual_J(scene, trajectory)
    out["violation_m"] = constraint_violation_m(scene, trajectory)
    return {name: float(np.abs(error[since:]).max()) for name, error in out.items()}


def orders(
    scene: Scene, engine: PymunkEngine, steps_per_sample: tuple[int, ...], since: int = 0
) -> dict[str, float]:
    """Return the slope of log(largest error) over log(step) for every signal."""
    runs = [worst(scene, run(scene, engine, n), since) for n in steps_per_sample]
    return {
        name: float(-np.polyfit(np.log(steps_per_sample), np.log([r[name] for r in runs]), 1)[0])
        for name in runs[0]
    }
