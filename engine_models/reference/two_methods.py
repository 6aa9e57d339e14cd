"""A scene solved by methods of different order, step control and search for events: DOP853 and RK4.

What the one claims is tested by the other. What they share is the equations. RK4 loses its order where
friction has kinks, and its steps have no end where friction jams: there, and where it only comes near, what
is left is tested by DOPRI5, of order 5 and with steps by its error, too. All follow bounces on rigid walls
down to round-off at any tolerance, or what they leave out would be left out by both; the other method gives
up at higher ones, so that what this does to the motion is seen as well.
"""

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np

from engine_models.engine import FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.mechanics.states import lever_m, observed_m
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.run import TURN_OF_STEP_RAD, rate_s
from engine_models.scene.scene import Scene
from reference_solver.failures import LimitPosition
from reference_solver.solver import LOWEST_FLIGHT

#: Tolerances of DOP853: the first as a part of the one asked for in lengths of the crank, then each as a part
#: of the one before; within bounds. That of DOPRI5 is so many times as large.
FIRST_PART, SHARPER, SHARPEST, LOOSEST, LESS_SHARP = 1e-2, 1e-2, 1e-14, 1e-6, 10.0
#: RK4's error in lengths of the crank at its usual steps, roughly; by how much they are shortened at once;
#: and within how many tolerances it has come near.
USUAL_ERROR, LEAST_CUT, LARGEST_CUT, NEAR = 1e-8, 2.0, 8.0, 100.0
#: The lowest flights of the other method: speeds at the last bounce are four times as high.
HIGHER = 16 * LOWEST_FLIGHT
#: Attempts, and steps of RK4, at the most.
MOST_ATTEMPTS, MOST_STEPS = 5, 20_000_000


@dataclass(frozen=True)
class Solution:
    """DOP853's run, and those that it is tested by: its own at a larger tolerance, and another method's."""

    scene: Scene
    run: Trajectory
    others: tuple[Trajectory, ...]

    @property
    def apart_m(self) -> FloatArray:
        """How far what is observed has been from the run's up to each of n times, (n,)."""
        position = observed_m(self.scene, self.run)
        apart = np.max([np.abs(observed_m(self.scene, other) - position) for other in self.others], axis=0)
        return np.asarray(np.maximum.accumulate(apart))


def agreed_solution(scene: Scene, tolerance_m: float, samples: int) -> Solution:
    """Return the solution on which methods agree to a tolerance of what is observed at all samples.

    Two runs may be wrong by as much where errors grow far beyond the tolerance: a run by DOP853 a hundred
    times as sharp has to agree with both. DOPRI5 has its errors in common with DOP853 more often than RK4
    has: it is asked after both have been sharpened, where RK4 only comes near at some step, or fails.

    Raises:
        UnsupportedScene: the reference cannot run the scene.
        SimulationFailed: one of them fails, or they part: from when on, and how far.
    """
    part = tolerance_m / lever_m(scene)
    sharp = min(LOOSEST, max(SHARPEST, FIRST_PART * part))
    # The usual turn in a step, but for no tolerance so small that the first step is below round-off.
    step, best = TURN_OF_STEP_RAD / rate_s(scene) * (max(part, SHARPEST) / USUAL_ERROR) ** 0.25, np.inf
    end_s, run = scene.end_time_s, partial(_run, scene, samples)
    dop853 = cache(lambda at: run(end_s, method="dop853", step_tolerance=at, lowest_flight=LOWEST_FLIGHT))
    failure = SimulationFailed("no two methods came to the end")
    for attempt in range(MOST_ATTEMPTS):
        others = [partial(run, min(step, end_s), lowest_flight=HIGHER, max_steps=MOST_STEPS)]
        dopri5 = {"method": "dopri5", "step_tolerance": LESS_SHARP * sharp, "lowest_flight": HIGHER}
        others += [partial(run, end_s, **dopri5)] * (attempt > 0)
        sharper, apart = max(SHARPEST, SHARPER * sharp), list[float]()
        for other in others:
            if apart and apart[0] < np.inf and min(best, apart[0]) > NEAR * tolerance_m:
                break
            try:
                found = Solution(scene, dop853(sharper), (dop853(sharp), other()))
            except SimulationFailed as failed:  # at one tolerance, and not at the next, where forces jump
                if isinstance(failed.__cause__, LimitPosition):
                    raise
                failure = failed
                apart.append(np.inf)
                continue
            apart.append(float(found.apart_m[-1]))
            if apart[-1] <= tolerance_m:
                return found
            when = found.run.time_s[int(np.argmax(found.apart_m > tolerance_m))]
            failure = SimulationFailed(
                f"two methods part at t = {when:.6g} s, and are {found.apart_m[-1]:.3g} m apart at the end: "
                "what comes then depends on round-off, or on steps too short to take; end the run before, or "
                "ask for less"
            )
        if sharp == SHARPEST and not apart[0] <= 0.5 * best:
            break
        best, sharp = min(best, apart[0]), sharper
        step /= min(LARGEST_CUT, max(LEAST_CUT, 1.5 * (apart[0] / tolerance_m) ** 0.25))
        if end_s > MOST_STEPS * step:
            break
    raise failure


def _run(scene: Scene, samples: int, step_s: float, **settings: Any) -> Trajectory:
    return ReferenceEngine(**settings).simulate(scene, RunSettings(step_s, samples))
