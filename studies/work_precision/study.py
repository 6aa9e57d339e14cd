"""Work-precision: the error of every engine against its run time and its steps, at a ladder of its settings.

Errors come from recorded runs, which may share the machine; times from bare repeats that run alone, in
rounds over all engines. What slows a machine makes no run shorter: a setting's time is the least of its
rounds, and a round that is slower than one before by more than ``SPREAD`` is run again. What compiling takes
on a machine that has no kernels yet is measured apart.
"""

import time
from dataclasses import replace
from functools import cache
from random import Random

import numpy as np

from engine_models import arms
from engine_models.engine import Engine, FloatArray, RunSettings, SimulationFailed
from engine_models.engines import engine_class, make_engine
from engine_models.mechanics.states import lever_m
from engine_models.scene.library import IDEAL_SCENES
from engine_models.scene.parts import AnyScene
from studies import clearance
from studies.case import Case, Curves, Row, Value
from studies.judges.comparison import compared, judged
from studies.judges.metrics import checked
from studies.ladders import QUICK_IDEAL, QUICK_LOOSE, Rung, ladder

NAME = "work-precision"
#: Few, since no step is longer than the time between two samples.
SAMPLES = 24
#: Rounds of timed runs over all engines, quick and full.
ROUNDS, FULL_ROUNDS = 3, 5
#: A bare run is repeated in its round until this much time is spent, in s, and no more often than that.
REPEAT_S, REPEATS = 0.02, 100
#: A round is as good as another if its least time is no more than so many times as long; how often one that
#: is not is run again; and from which time of a solve on, in s, a setting is timed in one round alone.
SPREAD, AGAIN, LONG_S = 1.3, 3, 1.0
#: How far a bare run may end from the recorded one, in parts of the crank's length: 0.5 mm in most scenes.
#: They are equal but for methods whose steps know of the samples, and that are as far off themselves.
APART = 0.01
#: Scenes of the quick set; the full set has all ideal ones and all that the clearance study follows.
QUICK = (*QUICK_IDEAL, *QUICK_LOOSE, "rigid-free-0.5mm")
#: Ends in s of scenes with rigid walls, while all engines' models follow the bounces: short of where these
#: first accumulate, which coarse settings have sooner. With damping they do so at once.
BEFORE_REST_S = {
    "rigid-driven-0.5mm": 0.006,
    "rigid-free-0.5mm": 0.07,
    "rigid-pendulum": 0.11,
    "rigid-start-up": 0.008,
    "rigid-compressor": 0.0075,
}
#: Scenes for which the full set compiles kernels anew.
COMPILED = ("ideal-driven", "clearance-driven-0.5mm", "clearance-free-OAB", "rigid-free-0.5mm")


def scenes(full: bool) -> list[AnyScene]:
    """Return the scenes, those with clearance cut to the time for which they are followed."""
    ideal = IDEAL_SCENES if full else QUICK_IDEAL
    loose = [scene for scene in clearance.scenes(True) if full or scene.name in QUICK]
    ends = [BEFORE_REST_S.get(scene.name, scene.end_time_s) for scene in loose]
    cut = [scene.model_copy(update={"end_time_s": end}) for scene, end in zip(loose, ends, strict=True)]
    return [IDEAL_SCENES[name]() for name in ideal] + cut


def cases(full: bool) -> list[Case]:
    """Return the recorded run of every rung, then rounds of bare runs of all, and compilations.

    Each round has an order of its own, the same every time, so that no rung always follows the same one.
    """
    rungs = [(scene, rung) for scene in scenes(full) for rung in ladder(scene, full)]
    out = [case_of(NAME, scene, rung, SAMPLES) for scene, rung in rungs]
    for k in range(FULL_ROUNDS if full else ROUNDS):
        shuffled = Random(k).sample(rungs, len(rungs))
        out += [case_of(NAME, scene, rung, 1, timed=True, round=k) for scene, rung in shuffled]
    compiled = COMPILED if full else ()
    anew = [(scene, rung) for scene, rung in reversed(rungs) if scene.name in compiled and _compiles(rung)]
    coarsest = {(scene.name, rung.arm.engine): (scene, rung) for scene, rung in anew}
    out += [case_of(NAME, scene, rung, 1, timed=True, compiled_anew=1) for scene, rung in coarsest.values()]
    return list({str(one.head()): one for one in out}.values())  # samples may cut two settings to one step


def _compiles(rung: Rung) -> bool:
    return bool(engine_class(rung.arm.engine).compiles)


def case_of(
    study: str, scene: AnyScene, rung: Rung, samples: int, timed: bool = False, **columns: Value
) -> Case:
    """Return a rung's run, at the step of the recorded one, with the columns that tell it from others."""
    run = RunSettings(RunSettings(rung.step_s, SAMPLES).step_used_s(scene.end_time_s), samples)
    columns = {"motion_alone": arms.gives_motion_alone(rung.arm), **columns}
    return Case(study, scene, rung.arm, run, rung.added, timed=timed, columns=columns)


def measure(case: Case) -> tuple[Row, Curves]:
    """Return the largest error of every signal of a recorded run, or the times of a bare one."""
    if "compiled_anew" in case.columns:
        engine = make_engine(case.engine, **case.settings)
        return {"compile_time_s": engine.compile_time_s(case.scene, case.run)}, {}
    return (times(case) if case.timed else _errors(case)), {}


def _errors(case: Case) -> Row:
    found = judged(make_engine(case.engine, **case.settings), case.scene, case.run)
    errors, _ = compared(found)
    row: Row = {"steps": found.plain.steps}
    row |= errors
    if rooms := found.own.clearances.values():
        row["smallest_clearance_m"] = min(room.radial_clearance_m for room in rooms)
        row |= clearance.impacts_of(found)
    return row | checked(case.scene, found.plain)


@cache
def _recorded(engine: Engine, scene: AnyScene, run: RunSettings) -> tuple[FloatArray, list[float]]:
    """Return all bodies' positions at a recorded run's end, made once in a process: it loads kernels too.

    Beside them is a list for the least times of the rounds that this process runs.
    """
    return engine.simulate(scene, run).position[-1], []


def require_same_end(scene: AnyScene, bare: FloatArray, recorded: FloatArray) -> float:
    """Return how far a bare run ends from the recorded one: centres of mass, of positions (bodies, 3).

    Raises:
        SimulationFailed: by more than ``APART`` of the longest lever, the crank's, or by no finite number.
    """
    off = float(np.hypot(*(bare - recorded)[:, :2].T).max())
    if not off <= APART * lever_m(scene):
        what = f"off by {off:.3g} m from the recorded run's" if np.isfinite(off) else "not finite"
        raise SimulationFailed(f"the timed run's end at t = {scene.end_time_s:.6g} s is {what}")
    return off


def times(case: Case, samples: int = SAMPLES) -> Row:
    """Return the native solve's least time over a round's repeats, and what building took besides.

    Every run's end is held, outside all times, to that of the recorded run with so many samples. A round is
    run again, up to ``AGAIN`` times, that is slower than one before by more than ``SPREAD``; and not at all,
    without times, of a setting whose solve took longer than ``LONG_S`` in one before.

    Raises:
        SimulationFailed: the recorded run, or a bare one, fails, or the ends differ (``require_same_end``).
    """
    engine = make_engine(case.engine, **case.settings)
    recorded, rounds = _recorded(engine, case.scene, replace(case.run, samples=samples))
    before = min(rounds, default=np.inf)
    if LONG_S < before < np.inf:
        return {"repeats": 0}
    solves: list[float] = []
    builds: list[float] = []
    apart = 0.0
    for _ in range(1 + AGAIN):
        n = len(solves)
        # The first one may build for as long as all others take.
        while len(solves) == n or (
            sum(solves[n:]) + sum(builds[n + 1 :]) < REPEAT_S and len(solves) < n + REPEATS
        ):
            start = time.perf_counter()
            solve_time, end = engine.bare_run(case.scene, case.run)
            builds.append(time.perf_counter() - start - solve_time)
            solves.append(solve_time)
            apart = max(apart, require_same_end(case.scene, end, recorded))
        if min(solves) <= SPREAD * before:
            break
    rounds.append(min(solves))
    row: Row = {"solve_time_s": min(solves), "build_time_s": min(builds), "repeats": len(solves)}
    return row | {"end_apart_m": apart}
