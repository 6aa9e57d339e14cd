"""What a run may be off by: a bound for each signal, and from when on its slider's position is in doubt."""

import numpy as np

from engine_models.engine import Engine, FloatArray, RunSettings, Trajectory
from engine_models.mechanics.states import guide_column, lever_m, observed_columns, observed_m
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.two_methods import sharp_solution
from engine_models.scene.scene import Scene

#: What the sharper solution itself may be off by beside these.
MARGIN = 1.1
#: Units in the last place of a signal's largest value that any run may lose.
ROUND_OFF = 64 * float(np.finfo(float).eps)
#: A slider is in doubt where it may be off by more than this part of the smallest clearance, or the crank.
DOUBTFUL_PART = 0.01


def simulate_with_uncertainty(
    engine: Engine, scene: Scene, settings: RunSettings
) -> tuple[Trajectory, dict[str, FloatArray]]:
    """Return a run, and bounds on the largest error over time of each of its signals.

    They are how far the run is from a solution of what the engine solves, its twin, plus how far others are
    from that: DOP853 at the sharpest tolerance, and RK4 near round-off, or DOPRI5 where RK4 fails. The
    slider's bound held, up to their horizons, on all of 240 random scenes with compliant contacts, and on all
    of 117 with rigid walls: with a confidence of 95 % on ninety-seven in a hundred of their kinds. Keys are
    the names of the trajectory's arrays over time (``position``, ...), ``slider_position_m`` or what else
    is observed, ``joint_B_force_N`` and, with clearance, ``contact_B_normal_force_N`` and so on; shapes are
    those of one time.

    Raises:
        UnsupportedScene, SimulationFailed: as the engine does, or the reference.
    """
    run, solution = engine.simulate(scene, settings), sharp_solution(engine.twin(scene), settings.samples)
    own, sharp, *others = (_arrays(scene, of) for of in (run, solution.run, *solution.others))
    common = [name for name in own if name in sharp]
    return run, {
        name: MARGIN * _apart(own[name], sharp[name])
        + MARGIN * np.max([_apart(sharp[name], other[name]) for other in others], axis=0)
        + ROUND_OFF * np.abs(sharp[name]).max(axis=0)
        for name in common
    }


def doubtful_from_s(engine: ReferenceEngine, scene: Scene, run: Trajectory) -> float | None:
    """Return from when on the slider of the reference's run may be off by 1 % of the smallest clearance.

    Without clearance it is 1 % of the crank. That is where a run at half the step, and twice the steps per
    contact, or at a hundredth of the tolerance, is half so far away; None where it never is.

    Raises:
        SimulationFailed: that run fails.
    """
    settings = RunSettings(run.step_s if engine.controls_error else run.step_s / 2, len(run.time_s) - 1)
    finer = engine.finer().simulate(scene, settings)
    far = np.abs(observed_m(scene, run) - observed_m(scene, finer)) > DOUBTFUL_PART * measure_m(scene) / 2
    return float(run.time_s[np.argmax(far)]) if far.any() else None


def measure_m(scene: Scene) -> float:
    """Return the smallest radial clearance, or without any the longest lever, the crank of a crank-slider."""
    radial = (clearance.radial_clearance_m for clearance in scene.clearances.values())
    return min(radial, default=lever_m(scene))


def _apart(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the largest distance over time."""
    return np.asarray(np.abs(one - other).max(axis=0))


def _arrays(scene: Scene, run: Trajectory) -> dict[str, FloatArray]:
    named = {name: value for name, value in vars(run).items() if name != "time_s"}
    named["dissipated_energy_J"] = run.dissipated_energy_J
    named |= observed_columns(scene, run)
    named |= {f"joint_{joint}_force_N": force for joint, force in run.joint_force_N.items()}
    named |= {guide_column(scene, guide): force for guide, force in run.guide_force_N.items()}
    for joint, contact in run.contacts.items():
        named |= {f"contact_{joint}_{name}": value for name, value in vars(contact).items()}
    return {name: value for name, value in named.items() if isinstance(value, np.ndarray)}
