"""A run's own uncertainty, signal by signal and time by time, from a second run."""

import numpy as np

from engine_models.engine import Engine, FloatArray, RunSettings, Trajectory
from engine_models.scene.scene import Scene

#: The tolerance of a run that another method's is judged by.
JUDGES_TOLERANCE = 1e-13


def simulate_with_uncertainty(
    engine: Engine, scene: Scene, settings: RunSettings
) -> tuple[Trajectory, dict[str, FloatArray]]:
    """Return a run, and how far another is from it.

    An engine that can control its error, but does not, has the run asked for judged by one that does, of
    another method and sharper by far: the difference is its error. Any other engine is run again at half the
    step, itself sharper if it can be, and that finer run is returned: the difference bounds its error for
    every method of order 1 or more in its asymptotic range, and is 15 times that of an order-4 method. Keys
    are the names of the trajectory's arrays over time (``position``, ``joint_force_N``, ...),
    ``slider_position_m`` and, for joint B with clearance, ``contact_B_normal_force_N`` and so on; shapes are
    theirs.

    Raises:
        UnsupportedScene, SimulationFailed: as the engine does.
    """
    run = engine.simulate(scene, settings)
    controlling = getattr(engine, "controlling_error", None)
    if controlling is None or getattr(engine, "controls_error", False):
        half = RunSettings(settings.step_used_s(scene.end_time_s) / 2, settings.samples)
        run, other = engine.sharper().simulate(scene, half), run
    else:
        other = controlling(JUDGES_TOLERANCE).simulate(scene, RunSettings(scene.end_time_s, settings.samples))
    before = _arrays(other)
    return run, {name: np.abs(value - before[name]) for name, value in _arrays(run).items()}


def _arrays(run: Trajectory) -> dict[str, FloatArray]:
    named = {name: value for name, value in vars(run).items() if name != "time_s"}
    named["dissipated_energy_J"] = run.dissipated_energy_J
    named["slider_position_m"], named["slider_velocity_m_s"] = run.slider_position_m, run.slider_velocity_m_s
    for joint, contact in run.contacts.items():
        named |= {f"contact_{joint}_{name}": value for name, value in vars(contact).items()}
    return {name: value for name, value in named.items() if isinstance(value, np.ndarray)}
