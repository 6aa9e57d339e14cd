"""Runs of the reference solver."""

from __future__ import annotations

import math
from collections.abc import Callable

from engine_models.engine import RunSettings, Trajectory
from engine_models.mechanics.start import checked_start
from engine_models.reference.solution import mechanism_of, trajectory_of_solution
from engine_models.scene.scene import Scene
from engine_models.watch import MOST_STEPS, Pace, tell, too_slow
from reference_solver.energy import scales_of
from reference_solver.equations import Equations
from reference_solver.failures import FrictionTooStiff, Stalled
from reference_solver.solver import ErrorControl, Solver, Stabilisation, StepChoice, check_start

#: Steps of contacts, and events on rigid walls, after which their pace is judged: some seconds; and events
#: that there is no time for. A step in a jam of friction is tried up to sixty times: where a limit is set,
#: this part of the steps is enough.
LOOK_UP_STEPS, LOOK_UP_EVENTS, MOST_EVENTS, LIMITED = 2_000_000, 2_000, 1e8, 0.1
#: The turn in a step, at the mechanism's own rate, for which steps per contact are given: 0.3 degrees.
TURN_OF_STEP_RAD = math.pi / 600


def rate_s(scene: Scene) -> float:
    """Return the mechanism's own rate at the start in 1/s (see ``reference_solver.energy``).

    Raises:
        SingularConfiguration: there are no accelerations.
        SimulationFailed: see ``checked_start``.
    """
    q, v = (part.ravel() for part in checked_start(scene))
    mechanism = mechanism_of(scene)
    accelerations = Equations(mechanism, q).required(0.0, q, v).accelerations
    return scales_of(mechanism, q, v, accelerations, scene.end_time_s).rate_s


def reference_run(
    scene: Scene,
    settings: RunSettings,
    choice: StepChoice | ErrorControl,
    stabilisation: Stabilisation,
    most_steps: float,
) -> Trajectory:
    """Run a scene, in no more steps than ``most_steps`` by the pace that it comes to.

    The joints' forces on rigid walls are those of following, without impulses. The solve time is that of the
    compiled loops; kernels are made outside it.

    Raises:
        SolverError: as the solver does.
        SimulationFailed: the steps are too short to come to an end; it says which field forces them.
    """
    q, v = (part.ravel() for part in checked_start(scene))
    mechanism = mechanism_of(scene)
    check_start(mechanism, q, v)
    solver = Solver(mechanism, q, choice, stabilisation)
    try:
        watch, times_s = _watch(scene, solver, most_steps), settings.times_s(scene)
        solution = solver.run(q, v, scene.end_time_s, settings.samples, watch, times_s)
    except Stalled as stalled:
        spacing_s = math.ulp(stalled.time_s)
        raise too_slow(spacing_s, f" or less at t = {stalled.time_s:.6g} s") from stalled
    except FrictionTooStiff as stiff:
        raise too_slow(stiff.needed_s) from stiff
    stabilised = stabilisation != "none"
    return trajectory_of_solution(scene, solution, choice.longest_s, stabilised)


def _watch(scene: Scene, solver: Solver, most_steps: float) -> Callable[[float], None]:
    """Return what tells how far a run has come, and ends one whose steps, or events, have collapsed."""
    if not scene.clearances and most_steps >= MOST_STEPS:
        return tell
    look_up = LOOK_UP_STEPS if most_steps >= MOST_STEPS else int(LIMITED * LOOK_UP_STEPS)
    steps, events = Pace(scene, look_up, most_steps), Pace(scene, LOOK_UP_EVENTS, MOST_EVENTS)

    def watch(t: float) -> None:
        tell(t)
        steps.judge(t, solver.steps)
        events.judge(t, solver.settled)

    return watch
