"""The reference solution of any scene, with a repeat that tells how far, and until when, it can be followed.

It is the independent solver's at its sharpest, and the reference's by DOP853 at its sharpest, by another
formulation, confirms it, begun some units in the last place to either side: their distance bounds its error
(see ``metrics.COVERAGE``). Where the independent solver refuses, as where a pin follows a rigid wall or rubs
on it, or loops are singular, the reference by two methods stands in. Scenes are followed up to the horizon,
where repeats, or runs begun a hair beside, part. All are kept on disk (see ``run_cache``).
"""

from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import (
    Contact,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
    UnsupportedScene,
    require_samples,
)
from engine_models.mechanics.impacts import BESIDE, POINTS, instants_in, with_largest
from engine_models.mechanics.quality import require_quality
from engine_models.mechanics.states import observed_m
from engine_models.mechanics.trajectory import selected
from engine_models.minimal.engine import SharpSolver
from engine_models.minimal.model import LimitPosition
from engine_models.reference.engine import SHARPEST, ReferenceEngine
from engine_models.scene.scene import Scene
from studies.judges.horizon import PERTURBATION_RAD, a_place_off, moved
from studies.judges.metrics import sizes
from studies.judges.run_cache import kept, kept_run

#: The independent solver, and the reference's run that confirms it.
TRUE, CONFIRMING = SharpSolver(), ReferenceEngine(method="dop853", step_tolerance=SHARPEST)
#: So many units in the last place beside the truth's start a repeat begins. What comes of one place is no
#: more than of rounding in the truth, and less by chance.
PLACES = 8.0
#: What stands in: the reference at ten times its sharpest tolerance, at a hundred times, and by RK4.
SHARP, LESS_SHARP = (ReferenceEngine(method="dop853", step_tolerance=at * SHARPEST) for at in (10, 100))
RK4, RK4_STEP_S = ReferenceEngine(method="rk4"), 1e-6
#: Scenes whose samples divide these are solved once.
GRID = 120
#: Peaks of a signal above this part of its largest value have a time of their own, found on so many samples.
PEAK, DENSE = 0.5, 4800
#: An impact longer than so many usual ones may hold many oscillations: these are sampled so often in a usual
#: one's time, and so often in all at the most.
LONG, PER_IMPACT, MOST_FINE = 1.5, 60, 20_000
#: Instants in all impacts at the most, and the fewest in one.
MOST_INSTANTS, FEWEST = 40_000, 8
#: Pointwise errors mean something while repeats are no further apart than this in slider position.
POINTWISE_M = 1e-8
#: What the truth of a scene is by.
INDEPENDENT, REFERENCE = "independent", "reference"


class Solved(NamedTuple):
    """A true trajectory, its repeats, and what they are by."""

    truth: Trajectory
    repeats: tuple[Trajectory, ...]
    by: str

    def selected(self, which: slice | NDArray[Any]) -> "Solved":
        """Return the same at some of its samples."""
        repeats = tuple(selected(repeat, which) for repeat in self.repeats)
        return Solved(selected(self.truth, which), repeats, self.by)


def converged(scene: Scene, samples: int, judged: bool = False) -> tuple[Trajectory, tuple[Trajectory, ...]]:
    """Return the true trajectory and its repeats, at equally spaced times.

    Where runs are ``judged`` at more times, it is not solved at these alone.

    Raises:
        ValueError: there are no samples.
        UnsupportedScene, SimulationFailed: see ``solved``.
    """
    require_samples(samples)
    if judged:
        found = solved(scene, samples)
        equal = RunSettings(scene.end_time_s, samples).are_equal(found.truth.time_s, scene.end_time_s)
        found = found.selected(equal)
    else:
        found = _on_equal(scene, samples)
    return found.truth, found.repeats


def truth_by(scene: Scene, samples: int) -> str:
    """Return what the truth of a scene is by: ``INDEPENDENT`` equations, or the ``REFERENCE``."""
    return _on_equal(scene, samples).by


def times_between_s(scene: Scene, samples: int) -> tuple[float, ...]:
    """Return the times, beside equal samples, at which runs of a scene with clearance are judged.

    They are those of ``GRID``, where the samples are some of them; those within every impact of the true
    solution (see ``instants_in``), one included that has not ended; and those at which a signal has a peak,
    of ``DENSE`` samples, or the normal force in a long impact.
    """
    return tuple(_judging(scene, _at_least(samples)).times_s(scene).tolist())


def _judging(scene: Scene, samples: int) -> RunSettings:
    """Return the settings of a true run to judge by."""
    return RunSettings(scene.end_time_s, samples, _telling(scene)[0])


@lru_cache(maxsize=64)
def solved(scene: Scene, samples: int) -> Solved:
    """Return the true solution at all times at which runs with so many samples are judged.

    Raises:
        UnsupportedScene, SimulationFailed: the truth and the reference refuse, or have no good solution.
    """
    if not scene.clearances:
        return _on_equal(scene, samples)
    if _at_least(samples) > samples:
        return solved(scene, _at_least(samples))
    known = _telling(scene)[1] if samples == GRID else None
    truth, repeats, by = _solved(scene, _judging(scene, samples), known)
    return Solved(with_largest(truth), tuple(with_largest(repeat) for repeat in repeats), by)


@lru_cache(maxsize=64)
def _on_equal(scene: Scene, samples: int) -> Solved:
    """Return the true solution at equally spaced times."""
    if _at_least(samples) > samples:
        return _on_equal(scene, GRID).selected(slice(None, None, GRID // samples))
    return _solved(scene, RunSettings(scene.end_time_s, samples))


def _at_least(samples: int) -> int:
    """Return how many equal samples a scene is solved on: those on few are of more."""
    return GRID if samples < GRID and GRID % samples == 0 else samples


@lru_cache(maxsize=64)
def _telling(scene: Scene) -> tuple[tuple[float, ...], tuple[Trajectory, str]]:
    """Return the times within the impacts of the true solution and those at which a signal is large.

    Behind them is the solution at these and those of ``GRID``, with what it is by.
    """
    dense = RunSettings(scene.end_time_s, DENSE)
    return kept(__name__, TRUE, scene, dense, lambda: _found_telling(scene, dense))


def _found_telling(scene: Scene, dense: RunSettings) -> tuple[tuple[float, ...], tuple[Trajectory, str]]:
    run, _ = _true(scene, dense)
    times = [run.time_s[_peaks(size)] for size in sizes(scene, run).values()]
    giving = [joint for joint, room in scene.clearances.items() if room.law != "rigid"]
    impacts = {joint: _begins_and_ends_s(run, run.contacts[joint]) for joint in giving}
    every = np.concatenate([np.zeros((0, 2)), *impacts.values()])
    count = max(FEWEST, min(POINTS, MOST_INSTANTS // max(1, len(every))))
    times += [instants_in(begin, end, count) for begin, end in every.tolist()]
    lasted_s = np.diff(every)[:, 0]
    usual_s = float(np.quantile(lasted_s, 0.25, method="lower")) if len(every) else 0.0
    long, long_s = every[lasted_s > LONG * usual_s], lasted_s[lasted_s > LONG * usual_s]
    step_s = max(usual_s / PER_IMPACT, long_s.sum() / MOST_FINE)
    fine = [np.arange(begin, end, step_s) for begin, end in long.tolist()]
    whole = RunSettings(scene.end_time_s, GRID, tuple(np.concatenate([*times, *fine]).tolist()))
    every_run, by = _true(scene, whole)
    if fine:  # there may be many oscillations in them
        run = selected(every_run, np.isin(every_run.time_s, np.concatenate(fine)))
    for joint in giving if fine else ():
        for begin, end in impacts[joint]:
            inside = np.flatnonzero((run.time_s > begin) & (run.time_s < end))
            force_N = run.contacts[joint].normal_force_N[inside]
            near = inside[_peaks(force_N)][:, None] + np.arange(-BESIDE, BESIDE + 1)
            times.append(run.time_s[np.clip(near.ravel(), 0, len(run.time_s) - 1)])
    telling = np.unique(np.concatenate(times))
    equal = whole.are_equal(every_run.time_s, scene.end_time_s)
    found = selected(every_run, equal | np.isin(every_run.time_s, telling))
    return tuple(telling.tolist()), (found, by)


def _true(scene: Scene, run: RunSettings) -> tuple[Trajectory, str]:
    """Return the true solution at the times of a run, and what it is by."""
    try:
        return TRUE.simulate(scene, run), INDEPENDENT
    except LimitPosition:
        raise
    except (UnsupportedScene, SimulationFailed):
        return SHARP.simulate(scene, run), REFERENCE


def _peaks(size: FloatArray) -> NDArray[np.bool_]:
    """Return which samples of a size (n,) are peaks of more than ``PEAK`` of its largest, (n,)."""
    beside = np.pad(size, 1, constant_values=-np.inf)
    largest = size.max(initial=0.0)
    return np.asarray((size >= beside[:-2]) & (size > beside[2:]) & (size > PEAK * largest))


def _begins_and_ends_s(run: Trajectory, contact: Contact) -> FloatArray:
    """Return when the impacts of a contact begin and end, (m, 2), one that has not ended with the run."""
    begin_s, duration_s = contact.impacts.time_s, contact.impacts.duration_s
    ends = np.column_stack([begin_s, begin_s + duration_s])
    if contact.penetration_m[-1] > 0:
        flown_s = np.append(run.time_s[contact.penetration_m <= 0], ends[:, 1]).max(initial=0.0)
        ends = np.append(ends, [[flown_s, run.time_s[-1]]], axis=0)
    return ends


def _solved(scene: Scene, whole: RunSettings, known: tuple[Trajectory, str] | None = None) -> Solved:
    """Return the solution at the times of a run in whole steps, unless it is known, with its repeats."""
    beside, other = (a_place_off(scene, side * PLACES) for side in (1.0, -1.0))
    truth, by = known or kept(__name__, TRUE, scene, whole, lambda: _true(scene, whole))
    if by == INDEPENDENT:
        runs = [truth, *(kept_run(CONFIRMING, begun, whole) for begun in (beside, other))]
    else:
        runs = [truth, kept_run(LESS_SHARP, beside, whole)]
        runs.append(kept_run(RK4, other, replace(whole, step_s=RK4_STEP_S)))
    truth, *repeats = (require_quality(scene, run) for run in runs)
    return Solved(truth, tuple(repeats), by)


def true_at(scene: Scene, run: RunSettings) -> Trajectory:
    """Return the true trajectory at the times of a run.

    Raises:
        UnsupportedScene, SimulationFailed: see ``solved``.
    """
    return _solved(scene, run).truth


@lru_cache(maxsize=64)
def followed(scene: Scene, samples: int, judged: bool = False) -> int:
    """Return how many samples of the true trajectory come before the scene's horizon.

    That is where a repeat parts from it, or with clearance a run of the reference with the turning body's
    angle moved by PERTURBATION_RAD to either side, if the start tells that angle. Of ``judged`` see
    ``converged``.
    """
    truth, repeats = converged(scene, samples, judged)
    whole, sides = RunSettings(scene.end_time_s, samples), list[Scene]()
    if scene.clearances:
        with suppress(ValueError):
            sides = [moved(scene, side * PERTURBATION_RAD) for side in (-1, 1)]
    repeats = (*repeats, *(kept_run(SHARP, side, whole) for side in sides))
    return reach(scene, truth, repeats)


def reach(
    scene: Scene, truth: Trajectory, repeats: tuple[Trajectory, ...], tolerance_m: float = POINTWISE_M
) -> int:
    """Return how many samples come before what is observed is off by more than a tolerance in a repeat."""
    apart = np.max(
        [np.abs(observed_m(scene, repeat) - observed_m(scene, truth)) for repeat in repeats], axis=0
    )
    return int(np.argmax(np.append(apart > tolerance_m, True)))
