"""Runs of the reference solver."""

from __future__ import annotations

from collections.abc import Callable

from engine_models.engine import RunSettings, Trajectory
from engine_models.mechanics.start_check import checked_start
from engine_models.pace import MOST_STEPS, require_pace, too_slow
from engine_models.progress import tell
from engine_models.reference.model import mechanism_of
from engine_models.reference.trajectory import trajectory_of_solution
from engine_models.scene.scene import Scene
from reference_solver.errors import FrictionTooStiff
from reference_solver.solver import ErrorControl, Solver, Stabilisation, StepChoice, check_start

#: Runs tried with ever shorter steps, each this part of what friction needed in the one before.
MOST_TRIES, ROOM = 5, 0.8

#: Steps of contacts, and events on rigid walls, after which their pace is judged: some seconds; and events
#: that there is no time for.
LOOK_UP_STEPS, LOOK_UP_EVENTS, MOST_EVENTS = 2_000_000, 2_000, 1e8


def reference_run(
    scene: Scene,
    settings: RunSettings,
    choice: StepChoice | ErrorControl,
    stabilisation: Stabilisation,
    compiled: bool,
) -> Trajectory:
    """Run a scene; with shorter steps where friction on rigid walls needs them.

    Samples denser than the steps asked for do not shorten those whose events are located: they are
    interpolated (see ``solver.solve``).

    Raises:
        FrictionTooStiff: it still needs shorter ones after ``MOST_TRIES``.
    """
    if isinstance(choice, ErrorControl):  # which friction does not make unstable
        return _run(scene, settings, choice, stabilisation, compiled)
    if (
        scene.joints_with_clearance
        and choice.locate_events
        and settings.steps_per_sample(scene.end_time_s) == 1
    ):
        choice = choice.at(settings.step_s)
    for _ in range(MOST_TRIES):
        try:
            return _run(scene, settings, choice, stabilisation, compiled)
        except FrictionTooStiff as stiff:
            if stiff.needed_s * MOST_STEPS < scene.end_time_s:
                raise too_slow(scene, f"steps of {stiff.needed_s:.3g} s") from stiff
            choice = choice.at(ROOM * stiff.needed_s)
    return _run(scene, settings, choice, stabilisation, compiled)


def _run(
    scene: Scene,
    settings: RunSettings,
    choice: StepChoice | ErrorControl,
    stabilisation: Stabilisation,
    compiled: bool,
) -> Trajectory:
    """Run a scene; the joints' forces on rigid walls are those of following, without impulses.

    The solve time is the solver's own. It includes the making of kernels for pins that follow rigid walls,
    one for every set of them that occurs.
    """
    q, v = (part.ravel() for part in checked_start(scene))
    mechanism = mechanism_of(scene)
    check_start(mechanism, q, v)
    solver = Solver(mechanism, q, choice, stabilisation, compiled)
    run = solver.run(q, v, scene.end_time_s, settings.samples, _watch(scene, solver))
    return trajectory_of_solution(scene, run, choice.longest_s, run.solve_time_s, stabilisation != "none")


def _watch(scene: Scene, solver: Solver) -> Callable[[float], None]:
    """Return what tells how far a run has come, and ends one whose steps, or events, have collapsed."""
    if not scene.joints_with_clearance:
        return tell
    judges = [
        _judge(scene, lambda: solver.steps, LOOK_UP_STEPS, MOST_STEPS),
        _judge(scene, lambda: solver.settled, LOOK_UP_EVENTS, MOST_EVENTS),
    ]

    def watch(t: float) -> None:
        tell(t)
        for judge in judges:
            judge(t)

    return watch


def _judge(scene: Scene, done: Callable[[], int], outlasting: int, most: float) -> Callable[[float], None]:
    """Return what ends a run that does too much: more outlasts any contact, the most takes too long."""
    judged, judged_s = 0, 0.0

    def judge(t: float) -> None:
        nonlocal judged, judged_s
        since = done() - judged
        if since >= outlasting:
            require_pace(scene, t, t - judged_s, since, most)
            judged, judged_s = judged + since, t

    return judge
