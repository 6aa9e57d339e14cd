"""The runs of a comparison: every engine's best arms on one scene, recorded once, and timed in rounds.

What is measured is what the studies accuracy and cost measure.
"""

from collections.abc import Collection
from random import Random

from engine_models import arms
from engine_models.engine import RunSettings
from engine_models.scene.parts import AnyScene
from studies import accuracy, cost
from studies.case import Case, Curves, Row, Value
from studies.comparison.question import Question
from studies.settings import Rung, configurations, ladder

NAME = "comparison"
#: No step is longer than the time between two samples, but impacts are told between them.
SAMPLES = 60
ROUNDS = 3
AS_THEY_COME = (arms.EXUDYN, arms.SCIPY)
#: A run that takes longer would not be recommended. A kernel's compilation counts.
LIMIT_S = 60.0
#: What the truth may take, which is found before any run is made.
TRUTH_LIMIT_S = 300.0


def cases(scene: AnyScene, question: Question, engines: Collection[str]) -> list[Case]:
    """Return the recorded run of every rung of the engines named, or of all, then rounds of bare runs."""
    rungs = [rung for rung in _rungs(scene) if not engines or rung.arm.engine in engines]
    out = [_case(scene, question, rung, SAMPLES) for rung in rungs]
    for k in range(ROUNDS):
        shuffled = Random(k).sample(rungs, len(rungs))
        out += [_case(scene, question, rung, 1, round=k) for rung in shuffled]
    return list({str(one.head()): one for one in out}.values())  # samples may cut two rungs to one step


def _rungs(scene: AnyScene) -> list[Rung]:
    """Return the settings of the quick set's configurations; an engine without one says once why."""
    shown = configurations(scene)
    rungs = [rung for rung in ladder(scene, full=True) if rung.arm in shown]
    there = {rung.arm.engine for rung in rungs}
    return rungs + [Rung(arm, scene.end_time_s) for arm in AS_THEY_COME if arm.engine not in there]


def _case(scene: AnyScene, question: Question, rung: Rung, samples: int, **timed: Value) -> Case:
    run = RunSettings(RunSettings(rung.step_s, SAMPLES).step_used_s(scene.end_time_s), samples)
    judged: Row = {"judged_by": question.column, "wanted_error": question.wanted}
    columns = {**judged, "motion_alone": arms.gives_motion_alone(rung.arm), **timed}
    return Case(NAME, scene, rung.arm, run, rung.added, timed=bool(timed), limit_s=LIMIT_S, columns=columns)


def measure(case: Case) -> tuple[Row, Curves]:
    """Return a recorded run's errors and what needs no truth, with curves; or the times of a bare one."""
    return (cost.times(case, SAMPLES), {}) if case.timed else accuracy.measure(case)
