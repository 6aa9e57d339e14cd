"""The converged solution of any scene, with twins that tell how far, and until when, it can be followed.

Ideal scenes have the independent truth of ``studies.truth``. Scenes with clearance have the reference solver
far below any step that is judged, with the same run at half that step and, where contacts are compliant,
SciPy's DOP853 between located events: an integrator of another kind and order on the same equations. They
are followed up to the horizon, where these or runs begun a hair beside them part.
"""

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from engine_models.engine import RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.scene import Scene
from studies.horizon import PERTURBATION_RAD, moved
from studies.truth import exact, exact_twins

#: The longest step of the converged run of a scene with clearance, and its twin's in parts of it.
LONGEST_STEP_S, TWIN = 2e-6, 0.5
#: The twin by DOP853.
OTHER: Mapping[str, object] = MappingProxyType({"method": "DOP853", "rtol": 1e-12, "atol": 1e-14})
#: Pointwise errors mean something while twins are no further apart than this in slider position.
POINTWISE_M = 1e-8


@lru_cache(maxsize=64)
def converged(scene: Scene, samples: int) -> tuple[Trajectory, tuple[Trajectory, ...]]:
    """Return the converged trajectory and its twins.

    Raises:
        UnsupportedScene, SimulationFailed: the reference cannot run the scene.
    """
    if not scene.joints_with_clearance:
        return exact(scene, samples), tuple(exact_twins(scene, samples))
    reference = make_engine("reference")
    step = RunSettings(LONGEST_STEP_S, samples)
    half = RunSettings(TWIN * step.step_used_s(scene.end_time_s), samples)
    truth, twins = reference.simulate(scene, step), [reference.simulate(scene, half)]
    if all(getattr(scene.clearance, joint).law != "rigid" for joint in scene.joints_with_clearance):
        try:
            whole = RunSettings(scene.end_time_s, samples)
            twins.append(make_engine("scipy", **OTHER).simulate(scene, whole))
        except SimulationFailed:
            pass  # the other twin is there
    return truth, tuple(twins)


@lru_cache(maxsize=64)
def followed(scene: Scene, samples: int) -> int:
    """Return how many samples of the converged trajectory come before the scene's horizon.

    That is where a twin parts from it, or the same run with the crank angle moved by PERTURBATION_RAD to
    either side. What starts with the state of every body has no such angle, and ideal joints no horizon.
    """
    truth, twins = converged(scene, samples)
    if scene.joints_with_clearance and not scene.start.states:
        reference, step = make_engine("reference"), RunSettings(LONGEST_STEP_S, samples)
        sides = (moved(scene, side * PERTURBATION_RAD) for side in (-1, 1))
        twins = (*twins, *(reference.simulate(side, step) for side in sides))
    return reach(truth, twins)


def reach(truth: Trajectory, twins: tuple[Trajectory, ...], tolerance_m: float = POINTWISE_M) -> int:
    """Return how many samples come before a twin's slider position is off by more than a tolerance."""
    apart = np.max([np.abs(twin.slider_position_m - truth.slider_position_m) for twin in twins], axis=0)
    beyond = apart > tolerance_m
    return int(np.argmax(beyond)) if beyond.any() else len(beyond)
