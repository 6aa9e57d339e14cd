"""The true solution of any scene, with repeats that tell how far, and until when, it can be followed.

It shares nothing with the solvers. Ideal cranks that can turn have ``ideal_truth``, scenes with clearance
the minimal coordinates of ``studies.independent``: by Radau's collocation, and again by extrapolation, a
method of another kind with shorter steps at another tolerance. Their distance is the truth's uncertainty. The
reference by DOP853 is a cross-check, and no more. Where the independent equations have no solution it stands
in, with repeats of its own, as for ideal pendulums and rods no longer than their crank. Scenes are followed
up to the horizon, where repeats or runs begun a hair beside part. All are kept on disk (see ``run_cache``).
"""

from functools import lru_cache

import numpy as np

from engine_models.engine import RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.mechanics.quality import require_quality
from engine_models.mechanics.samples import selected
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.scene import Scene
from studies.independent.solver import IndependentSolver
from studies.judges.horizon import PERTURBATION_RAD, moved
from studies.judges.ideal_truth import exact, exact_repeats
from studies.judges.kinds import has_closed_form
from studies.judges.run_cache import kept_run

#: The solvers of the truth and of its repeats, which leave out shorter flights between rigid walls.
COLLOCATION = IndependentSolver("collocation", 1e-11)
EXTRAPOLATION = IndependentSolver("extrapolation", 1e-14, shortest_flight_s=1e-9)
SHARPER = IndependentSolver("collocation", 1e-12, shortest_flight_s=1e-9)
#: The cross-check, and what stands in with it: its runs at ten times the tolerance, and by RK4 at this step.
SHARP, LESS_SHARP = (ReferenceEngine(method="dop853", step_tolerance=at) for at in (1e-13, 1e-12))
RK4, RK4_STEP_S = ReferenceEngine(method="rk4"), 1e-6
#: Scenes whose samples divide these are solved once.
GRID = 120
#: Pointwise errors mean something while repeats are no further apart than this in slider position.
POINTWISE_M = 1e-8
#: What the truth of a scene is by.
INDEPENDENT, REFERENCE = "independent", "reference"

Solved = tuple[Trajectory, tuple[Trajectory, ...]]


def converged(scene: Scene, samples: int) -> Solved:
    """Return the true trajectory and its repeats.

    Raises:
        UnsupportedScene, SimulationFailed: the independent equations have no solution, nor has the reference,
            or not a good one.
    """
    if has_closed_form(scene):
        return exact(scene, samples), tuple(exact_repeats(scene, samples))
    return _on_samples(scene, samples)[1]


def truth_by(scene: Scene, samples: int) -> str:
    """Return what the truth of a scene is by: ``INDEPENDENT`` equations, or the ``REFERENCE``."""
    return INDEPENDENT if has_closed_form(scene) else _on_samples(scene, samples)[0]


@lru_cache(maxsize=64)
def _on_samples(scene: Scene, samples: int) -> tuple[str, Solved]:
    """Return what solved a scene without closed form, and its solution; those on few samples are of more."""
    if samples < GRID and GRID % samples == 0:
        by, (truth, repeats) = _on_samples(scene, GRID)
        some = slice(None, None, GRID // samples)
        return by, (selected(truth, some), tuple(selected(repeat, some) for repeat in repeats))
    whole, fine = RunSettings(scene.end_time_s, samples), RunSettings(RK4_STEP_S, samples)
    try:
        truth, repeat = kept_run(COLLOCATION, scene, whole), _repeat(scene, whole)
        return INDEPENDENT, (require_quality(scene, truth), (require_quality(scene, repeat),))
    except (UnsupportedScene, SimulationFailed):
        runs = ((SHARP, whole), (LESS_SHARP, whole), (RK4, fine))
        truth, *others = (require_quality(scene, kept_run(engine, scene, run)) for engine, run in runs)
        return REFERENCE, (truth, tuple(others))


def _repeat(scene: Scene, whole: RunSettings) -> Trajectory:
    """Return the repeat: the explicit method's, or if that takes too many steps a sharper implicit one."""
    try:
        return kept_run(EXTRAPOLATION, scene, whole)
    except SimulationFailed:
        return kept_run(SHARPER, scene, whole)


def cross_check(scene: Scene, samples: int) -> Trajectory:
    """Return the reference's sharpest run of a scene.

    Raises:
        UnsupportedScene, SimulationFailed: as ``simulate`` does.
    """
    return kept_run(SHARP, scene, RunSettings(scene.end_time_s, samples))


@lru_cache(maxsize=64)
def followed(scene: Scene, samples: int) -> int:
    """Return how many samples of the true trajectory come before the scene's horizon.

    That is where a repeat parts from it, or a run of the reference with the crank angle moved by
    PERTURBATION_RAD to either side. What starts with the state of every body has no such angle, and ideal
    joints no horizon.
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
