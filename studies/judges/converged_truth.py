"""The converged solution of any scene, with repeats that tell how far, and until when, it can be followed.

Ideal scenes have the independent truth of ``ideal_truth``. Scenes with clearance have the reference by
DOP853 at a tolerance near round-off, with the same run at ten times that tolerance and one by RK4, a method
of another order whose steps come from other rules. They are followed up to the horizon, where these or runs
begun a hair beside them part. All are kept on disk (see ``run_cache``).
"""

from functools import lru_cache

import numpy as np

from engine_models.engine import RunSettings, Trajectory
from engine_models.mechanics.quality import require_quality
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.scene import Scene
from studies.judges.horizon import PERTURBATION_RAD, moved
from studies.judges.ideal_truth import exact, exact_repeats
from studies.judges.run_cache import kept_run

#: The engines of the converged run and its repeats, and the longest step of the repeat by RK4.
SHARP, LESS_SHARP = (ReferenceEngine(method="dop853", tolerance=tolerance) for tolerance in (1e-13, 1e-12))
RK4, RK4_STEP_S = ReferenceEngine(method="rk4"), 1e-6
#: Pointwise errors mean something while repeats are no further apart than this in slider position.
POINTWISE_M = 1e-8


@lru_cache(maxsize=64)
def converged(scene: Scene, samples: int) -> tuple[Trajectory, tuple[Trajectory, ...]]:
    """Return the converged trajectory and its repeats.

    Raises:
        UnsupportedScene, SimulationFailed: the reference cannot run the scene, or not well.
    """
    if not scene.joints_with_clearance:
        return exact(scene, samples), tuple(exact_repeats(scene, samples))
    whole, fine = RunSettings(scene.end_time_s, samples), RunSettings(RK4_STEP_S, samples)
    runs = ((SHARP, whole), (LESS_SHARP, whole), (RK4, fine))
    truth, *repeats = (require_quality(scene, kept_run(engine, scene, run)) for engine, run in runs)
    return truth, tuple(repeats)


@lru_cache(maxsize=64)
def followed(scene: Scene, samples: int) -> int:
    """Return how many samples of the converged trajectory come before the scene's horizon.

    That is where a repeat parts from it, or the same run with the crank angle moved by PERTURBATION_RAD to
    either side. What starts with the state of every body has no such angle, and ideal joints no horizon.
    """
    truth, repeats = converged(scene, samples)
    if scene.joints_with_clearance and not scene.start.states:
        whole = RunSettings(scene.end_time_s, samples)
        sides = (moved(scene, side * PERTURBATION_RAD) for side in (-1, 1))
        repeats = (*repeats, *(kept_run(SHARP, side, whole) for side in sides))
    return reach(truth, repeats)


def reach(truth: Trajectory, repeats: tuple[Trajectory, ...], tolerance_m: float = POINTWISE_M) -> int:
    """Return how many samples come before a repeat's slider position is off by more than a tolerance."""
    apart = np.max([np.abs(repeat.slider_position_m - truth.slider_position_m) for repeat in repeats], axis=0)
    return int(np.argmax(np.append(apart > tolerance_m, True)))
