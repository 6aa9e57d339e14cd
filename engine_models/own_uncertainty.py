"""A run's own uncertainty, signal by signal and time by time, from a second, sharper run."""

import numpy as np

from engine_models.engine import Engine, FloatArray, RunSettings, Trajectory
from engine_models.scene import Scene

#: The tolerance of a run that another method's is compared with.
CONTROLLED = 1e-12


def simulate_with_uncertainty(
    engine: Engine, scene: Scene, settings: RunSettings
) -> tuple[Trajectory, dict[str, FloatArray]]:
    """Return a sharper run than the one asked for, and how far that one is from it.

    The sharper run is at half the step, by an engine that is itself sharper if it can be. An engine that can
    control its error does so, by another method: its run is sharper by far, and the difference is the error
    of the run asked for. The other differences bound the error of the sharper run for every method of order 1
    or more in its asymptotic range, and are 15 times that of an order-4 method. Keys are the names of the
    trajectory's arrays over time (``position``, ``joint_force_N``, ...), ``slider_position_m`` and, for joint
    B with clearance, ``contact_B_normal_force_N`` and so on; shapes are theirs.

    Raises:
        UnsupportedScene, SimulationFailed: as the engine does.
    """
    coarse = engine.simulate(scene, settings)
    controlling = getattr(engine, "controlling_error", None)
    if controlling is not None and not getattr(engine, "controls_error", False):
        fine = controlling(CONTROLLED).simulate(scene, RunSettings(scene.end_time_s, settings.samples))
    else:
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
