"""A run's own uncertainty, signal by signal and time by time, from a second run at half the step."""

import numpy as np

from engine_models.engine import Engine, FloatArray, RunSettings, Trajectory
from engine_models.scene import Scene


def simulate_with_uncertainty(
    engine: Engine, scene: Scene, settings: RunSettings
) -> tuple[Trajectory, dict[str, FloatArray]]:
    """Return the run at half the step asked for, and how far the run at that step is from it.

    The difference bounds the error of the finer run for every method of order 1 or more in its asymptotic
    range, and is 15 times that of an order-4 method. Keys are the names of the trajectory's arrays over time
    (``position``, ``joint_force_N``, ...), ``slider_position_m`` and, for joint B with clearance,
    ``contact_B_normal_force_N`` and so on; shapes are theirs.

    Raises:
        UnsupportedScene, SimulationFailed: as the engine does.
    """
    coarse = engine.simulate(scene, settings)
    half = RunSettings(settings.step_used_s(scene.end_time_s) / 2, settings.samples)
    fine = engine.sharper().simulate(scene, half)
    before = _arrays(coarse)
    return fine, {name: np.abs(value - before[name]) for name, value in _arrays(fine).items()}


def _arrays(run: Trajectory) -> dict[str, FloatArray]:
    named = {name: value for name, value in vars(run).items() if name != "time_s"}
    named["dissipated_energy_J"] = run.dissipated_energy_J
    named["slider_position_m"], named["slider_velocity_m_s"] = run.slider_position_m, run.slider_velocity_m_s
    for joint, contact in run.contacts.items():
        named |= {f"contact_{joint}_{name}": value for name, value in vars(contact).items()}
    return {name: value for name, value in named.items() if isinstance(value, np.ndarray)}
