"""A scene solved by methods of different order, step control and search for events: DOP853 and RK4.

What the one claims is tested by the other. What they share is the equations. RK4 loses its order where
friction has kinks, and its steps have no end where friction jams: there, and where it only comes near, what
is left is tested by DOPRI5, of order 5 and with steps by its error, too. All follow bounces on rigid walls
down to round-off at any tolerance, or what they leave out would be left out by both; the other method gives
up at higher ones, so that what this does to the motion is seen as well.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from engine_models.engine import FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.run import TURN_OF_STEP_RAD, rate_s
from engine_models.scene.scene import Scene
from reference_solver.solver import LOWEST_FLIGHT

#: Tolerances of DOP853: the first as a part of the one asked for in lengths of the crank, then each as a part
#: of the one before; within bounds. That of DOPRI5 is so many times as large.
FIRST_PART, SHARPER, SHARPEST, LOOSEST, LESS_SHARP = 1e-2, 1e-2, 1e-14, 1e-6, 10.0
#: RK4's error in lengths of the crank at its usual steps, roughly; by how much they are shortened at once;
#: and within how many tolerances it has come near.
USUAL_ERROR, LEAST_CUT, LARGEST_CUT, NEAR = 1e-8, 2.0, 8.0, 100.0
#: The lowest flights of the other method: speeds at the last bounce are four times as high.
HIGHER = 16 * LOWEST_FLIGHT
#: Pairs tried, and steps of RK4, at the most.
MOST_PAIRS, MOST_STEPS = 5, 20_000_000


@dataclass(frozen=True)
class SolvedTwice:
    """DOP853's run, and another method's."""

    run: Trajectory
    other: Trajectory

    @property
    def apart_m(self) -> FloatArray:
        """How far their slider positions have been apart up to each of n times, (n,)."""
        apart = np.abs(self.run.slider_position_m - self.other.slider_position_m)
        return np.asarray(np.maximum.accumulate(apart))


def solved_twice(scene: Scene, tolerance_m: float, samples: int) -> SolvedTwice:
    """Return the solution on which methods agree to a tolerance of slider position at all samples.

    DOPRI5 has its errors in common with DOP853 more often than RK4 has: it is asked after both have been
    sharpened, where RK4 still only comes near, or fails.

    Raises:
        UnsupportedScene: the reference cannot run the scene.
        SimulationFailed: one of them fails, or they part: from when on, and how far.
    """
    part = tolerance_m / scene.crank.length_m
    sharp = min(LOOSEST, max(SHARPEST, FIRST_PART * part))
    # No tolerance is so small that the first step is to be below round-off.
    step, best = _usual_step_s(scene) * (max(part, SHARPEST) / USUAL_ERROR) ** 0.25, np.inf
    failure = SimulationFailed("no two methods came to the end")
    for attempt in range(MOST_PAIRS):
        pair, apart = None, np.inf
        try:
            pair = SolvedTwice(_controlled(scene, sharp, samples, "dop853"), _by_rk4(scene, step, samples))
            apart = float(pair.apart_m[-1])
            if apart <= tolerance_m:
                return pair
        except SimulationFailed as failed:  # at one tolerance, and not at the next, where forces jump
            failure = failed
        if attempt > 0 and (pair is None or apart <= NEAR * tolerance_m):
            pair = _by_dopri5(scene, sharp, samples)
            if pair.apart_m[-1] <= tolerance_m:
                return pair
        if pair is not None:
            failure = _parted(pair, tolerance_m)
        if sharp == SHARPEST and not apart <= 0.5 * best:
            break
        best, sharp = min(best, apart), max(SHARPEST, SHARPER * sharp)
        step /= min(LARGEST_CUT, max(LEAST_CUT, 1.5 * (apart / tolerance_m) ** 0.25))
        if scene.end_time_s > MOST_STEPS * step:
            break
    raise failure


def _parted(pair: SolvedTwice, tolerance_m: float) -> SimulationFailed:
    when = pair.run.time_s[int(np.argmax(pair.apart_m > tolerance_m))]
    return SimulationFailed(
        f"two methods part at t = {when:.6g} s, and are {pair.apart_m[-1]:.3g} m apart at the end: what "
        "comes then depends on round-off, or on steps too short to take; end the run before, or ask for less"
    )


def sharp_pair(scene: Scene, samples: int) -> SolvedTwice:
    """Return the solution by two methods at steps near round-off, whether they agree or not.

    Raises:
        UnsupportedScene, SimulationFailed: as the reference does.
    """
    sharp, step = 10 * SHARPEST, _usual_step_s(scene) / LARGEST_CUT
    try:
        return SolvedTwice(_controlled(scene, sharp, samples, "dop853"), _by_rk4(scene, step, samples))
    except SimulationFailed:
        return _by_dopri5(scene, sharp, samples)


def _usual_step_s(scene: Scene) -> float:
    """Return a step of RK4 in which the mechanism turns by as much as steps per contact are given for."""
    return TURN_OF_STEP_RAD / rate_s(scene)


def _by_rk4(scene: Scene, step_s: float, samples: int) -> Trajectory:
    engine = ReferenceEngine(lowest_flight=HIGHER, max_steps=MOST_STEPS)
    return engine.simulate(scene, RunSettings(min(step_s, scene.end_time_s), samples))


def _by_dopri5(scene: Scene, sharp: float, samples: int) -> SolvedTwice:
    """Return DOP853's run and DOPRI5's."""
    run = _controlled(scene, sharp, samples, "dop853")
    return SolvedTwice(run, _controlled(scene, LESS_SHARP * sharp, samples, "dopri5"))


def _controlled(
    scene: Scene, tolerance: float, samples: int, method: Literal["dop853", "dopri5"]
) -> Trajectory:
    lowest = HIGHER if method == "dopri5" else LOWEST_FLIGHT
    engine = ReferenceEngine(method=method, tolerance=tolerance, lowest_flight=lowest)
    return engine.simulate(scene, RunSettings(scene.end_time_s, samples))
