"""Agreement: every engine on every ideal scene, at steps, tolerances and settings, against the truth."""

from collections.abc import Mapping

from engine_models import arms
from engine_models.arms import Arm, Setting
from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.scene.library import IDEAL_SCENES
from engine_models.scene.parts import AnyScene
from studies.case import Case, Curves, Row
from studies.judges.comparison import compared, judged
from studies.judges.converged_truth import REFERENCE
from studies.judges.metrics import conserved
from studies.ladders import QUICK_IDEAL, by_tolerance

SAMPLES = 200
#: Steps per sample interval, each a half of the one before, and those of the quick set.
LADDER, QUICK_STEPS = (2, 4, 8, 16, 32, 64, 128, 256, 512, 1024), (4, 16, 64)
#: Each engine's own settings worth showing, and what the full set adds.
ARMS = (arms.PROJECTION, arms.TRAPEZOIDAL, arms.GENERALIZED_ALPHA, arms.TUNED)
MORE_ARMS = (arms.NO_STABILISATION, arms.BAUMGARTE, arms.OUT_OF_THE_BOX)
#: Those that choose their steps, at tolerances 10^-k, and of both the quick set's.
QUICK_CHOOSING = (arms.REFERENCE_DOP853, arms.ODEINT)
CHOOSING = (*QUICK_CHOOSING, arms.SCIPY_DOP853)
EXPONENTS, QUICK_EXPONENTS = range(5, 14), (7, 9, 11)
#: The reference by DOP853 has a tolerance that leaves its steps as long as they may be, so many intervals
#: between samples. At order 8 shorter ones are in error by round-off alone; none is a step of the ladder, at
#: which engines are compared, since one of these is three of RK4's.
NO_LIMIT, INTERVALS = 0.999, tuple(2 ** (k / 2 + 0.25) for k in range(1, -7, -1))
#: Pymunk's solver iterations, shown at one step of the ladder.
ITERATIONS, ITERATIONS_STEPS_PER_SAMPLE = (2, 5, 7, 10, 15, 20, 50, 100), 32


def cases(full: bool) -> list[Case]:
    """Return for scenes ladders of steps, ladders of tolerances, and Pymunk's sweep of iterations."""
    names = IDEAL_SCENES if full else QUICK_IDEAL
    return [case for name in names for case in _cases_on(IDEAL_SCENES[name](), full)]


def _cases_on(scene: AnyScene, full: bool) -> list[Case]:
    """Return series of steps and tolerances; in the full set also DOP853's steps and Pymunk's iterations."""
    out = []
    for arm in (*ARMS, *(MORE_ARMS if full else ()), *arms.newcomers()):
        out += [_by_step(scene, arm, count) for count in (LADDER if full else QUICK_STEPS)]
    for arm in CHOOSING if full else QUICK_CHOOSING:
        rungs = by_tolerance(arm, scene.end_time_s, EXPONENTS if full else QUICK_EXPONENTS)
        out += [_case(scene, arm, rung.step_s, "tolerance", rung.added) for rung in rungs]
    if not full:
        return out
    for intervals in INTERVALS:
        out.append(_by_step(scene, arms.REFERENCE_DOP853, 1 / intervals, step_tolerance=NO_LIMIT))
    step = scene.end_time_s / (SAMPLES * ITERATIONS_STEPS_PER_SAMPLE)
    return out + [_case(scene, arms.with_iterations(n), step, "iterations", {}) for n in ITERATIONS]


def _by_step(scene: AnyScene, arm: Arm, steps_per_sample: float, **added: Setting) -> Case:
    return _case(scene, arm, scene.end_time_s / (SAMPLES * steps_per_sample), "step", added)


def _case(scene: AnyScene, arm: Arm, step_s: float, varied: str, added: Mapping[str, Setting]) -> Case:
    run = RunSettings(step_s=step_s, samples=SAMPLES)
    return Case("agreement", scene, arm, run, added, columns={"step_s": run.step_s, "varied": varied})


def measure(case: Case) -> tuple[Row, Curves]:
    """Run one case and return the largest error of every signal with the truth's uncertainty, and curves."""
    found = judged(make_engine(case.engine, **case.settings), case.scene, case.run)
    errors, error_curves = compared(found)
    ledger, curves = conserved(case.scene, found.plain)
    if errors["truth"] != REFERENCE:
        del errors["truth"]
    row = {"steps": found.plain.steps, **errors, **ledger}
    return row, {**error_curves, **curves, "time_s": found.plain.time_s}
