"""Cost: the run times of every engine at the settings whose errors the study ``accuracy`` has.

Times are of bare runs that run alone, in rounds over all engines. What slows a machine makes no run shorter:
a setting's time is the least of its rounds, and a round that is slower than one before by more than
``SPREAD`` is run again. Left out: what compiling takes, which is before all times, and rounds of a setting
behind two that are as good as each other.
"""

import time
from collections import defaultdict
from dataclasses import replace
from random import Random

import numpy as np

from engine_models.engine import Engine, FloatArray, RunSettings, SimulationFailed
from engine_models.engines import make_engine
from engine_models.mechanics.states import lever_m
from engine_models.scene.scene import Scene
from studies.accuracy import SAMPLES, case_of, end_of
from studies.case import Case, Curves, Row
from studies.settings import ladder, scenes

#: Rounds of timed runs over all engines.
ROUNDS = 3
#: A bare run is repeated in its round until this much time is spent, in s, and no more often than that.
REPEAT_S, REPEATS = 0.02, 100
#: A round is as good as another if its least time is no more than so many times as long; and how often one
#: that is not is run again.
SPREAD, AGAIN = 1.3, 3
#: How far a bare run may end from the recorded one, in parts of the crank's length: 0.5 mm in most scenes.
#: They are equal but for methods whose steps know of the samples, and that are as far off themselves.
APART = 0.01
#: The least times of the rounds that this process has run, of each setting.
ROUNDS_RUN = defaultdict[tuple[Engine, Scene, RunSettings], list[float]](list)


def cases(full: bool) -> list[Case]:
    """Return rounds of bare runs of all settings.

    Each round has an order of its own, the same every time, so that no setting always follows the same one.
    """
    rungs = [(scene, rung) for scene in scenes(full) for rung in ladder(scene, full)]
    out = []
    for k in range(ROUNDS):
        shuffled = Random(k).sample(rungs, len(rungs))
        out += [case_of("cost", scene, rung, 1, timed=True, round=k) for scene, rung in shuffled]
    return list({str(one.head()): one for one in out}.values())  # samples may cut two settings to one step


def measure(case: Case) -> tuple[Row, Curves]:
    """Return the times of a setting in one round."""
    return times(case), {}


def require_same_end(scene: Scene, bare: FloatArray, recorded: FloatArray) -> float:
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
    """Return the native solve's least time over a round's repeats, without what building took.

    Of an engine that is stepped by a loop of ours it has the time inside its own calls, too.

    Every run's end is held, outside all times, to that of the recorded run with so many samples. A round is
    run again, up to ``AGAIN`` times, that is slower than one before by more than ``SPREAD``; and not at all,
    without times, behind two that are as good as each other.

    Raises:
        SimulationFailed: the recorded run, or a bare one, fails, or the ends differ (``require_same_end``).
    """
    engine = make_engine(case.engine, **case.settings)
    rounds = ROUNDS_RUN[engine, case.scene, case.run]
    before, second = [*sorted(rounds), np.inf, np.inf][:2]
    if second <= SPREAD * before < np.inf:
        return {"repeats": 0}
    recorded = end_of(engine, case.scene, replace(case.run, samples=samples))
    solves, inside, apart = list[float](), list[float](), 0.0
    for _ in range(1 + AGAIN):
        n, until = len(solves), np.inf
        while len(solves) < n + REPEATS and time.perf_counter() < until:
            run = engine.bare_run(case.scene, case.run)
            if len(solves) == n:  # which may load or build for as long as all others take
                until = time.perf_counter() + REPEAT_S - run.solve_time_s
            solves.append(run.solve_time_s)
            inside += [] if run.engine_time_s is None else [run.engine_time_s]
            apart = max(apart, require_same_end(case.scene, run.position, recorded))
        if min(solves) <= SPREAD * before:
            break
    rounds.append(min(solves))
    row: Row = {"solve_time_s": min(solves), "repeats": len(solves)}
    if inside:
        row["engine_time_s"] = min(inside)
    return row | {"end_apart_m": apart}
