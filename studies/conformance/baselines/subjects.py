"""What has baselines: every arm of the catalogue on scenes that show what it does, at one or two resolutions.

The numbers are those of the studies' own rows, so a band holds the whole way from the equations to a row.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import RunSettings, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.library import IDEAL_SCENES, SCENES
from engine_models.scene.scene import Scene
from studies import agreement, energy
from studies.ladders import Rung, clearance_ladder
from studies.running.case import Case
from studies.work_precision import study as work_precision

#: Arms that take steps of one length, at two steps of the agreement study's ladder: their ratio is an order.
BY_STEP = (
    arms.REFERENCE,
    arms.PROJECTION,
    arms.BAUMGARTE,
    arms.NO_STABILISATION,
    arms.PLAIN_RK4,
    arms.EXUDYN,
    arms.TRAPEZOIDAL,
    arms.GENERALIZED_ALPHA,
    arms.GENERALIZED_ALPHA_09,
    arms.TUNED,
    arms.OUT_OF_THE_BOX,
)
STEPS_PER_SAMPLE = (16, 32)
#: Arms that choose their steps, at two tolerances; SciPy as it comes has but its own. No step is longer than
#: a fortieth of the run: beyond that Exudyn's DOPRI5 does not estimate its error well enough to reject.
BY_TOLERANCE = (
    arms.REFERENCE_DOP853,
    arms.DOPRI5,
    arms.ODE23,
    arms.SCIPY,
    arms.SCIPY_DOP853,
    arms.LSODA,
    arms.ODEINT,
    arms.ODE,
    arms.RADAU,
)
TOLERANCES, LONGEST_PART = (1e-6, 1e-9), 40
#: Scenes with clearance, and until when in s: so long before their horizons that no processor moves these.
CLEARANCE_END_S = {
    "clearance-free-0.5mm": 0.04,
    "clearance-driven-0.5mm": 0.015,
    "clearance-driven-AB": 0.006,
    "clearance-start-up": 0.03,
    "clearance-driven-damped": 0.018,
    "clearance-compressor": 0.03,
    "rigid-free-0.5mm": 0.12,
}
#: Of a ladder's rungs those that count: the coarsest may fail, the finest are dear.
CLEARANCE_RUNGS = slice(1, 3)
#: Scenes and the rung of the energy study, whose ledger closes line by line.
LEDGERS, LEDGER_RUNG = ("ideal-compressor", "clearance-driven-damped", "rigid-free-0.5mm"), 1


@dataclass(frozen=True)
class Subject:
    """An arm on a scene, as one study measures it at one or several resolutions, coarse to fine."""

    cases: tuple[Case, ...]

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is called: study, scene, and the arm's label."""
        first = self.cases[0]
        return first.study, first.scene.name, first.arm.label


def subjects(engines: Collection[str] = arms.NAMED) -> list[Subject]:
    """Return all subjects that some engines support here, in the order of the tables.

    An engine that the catalogue does not know has joined (see ``engine_models.engines``), and is measured as
    it comes.
    """
    every = sorted(_cases(engines), key=lambda case: Subject((case,)).key)
    grouped = (tuple(cases) for _, cases in groupby(every, key=lambda case: Subject((case,)).key))
    return [Subject(cases) for cases in grouped]


def _cases(engines: Collection[str]) -> Iterator[Case]:
    others = [arm for arm in arms.newcomers() if arm.engine in engines]
    stepping = [arm for arm in others if make_engine(arm.engine).order is not None]
    by_step = [arm for arm in (*BY_STEP, *stepping) if arm.engine in engines]
    choosing = [arm for arm in others if arm not in stepping]
    by_tolerance = [arm for arm in (*BY_TOLERANCE, *choosing) if arm.engine in engines]
    for name in IDEAL_SCENES:
        scene = IDEAL_SCENES[name]()
        for arm in _supporting(by_step, scene):
            steps = (scene.end_time_s / (agreement.SAMPLES * count) for count in STEPS_PER_SAMPLE)
            yield from (Case("agreement", scene, arm, RunSettings(h, agreement.SAMPLES)) for h in steps)
        for arm in _supporting(by_tolerance, scene):
            run = RunSettings(scene.end_time_s / LONGEST_PART, work_precision.SAMPLES)
            added = [dict.fromkeys(arm.tolerances, at) for at in TOLERANCES] if arm.tolerances else [{}]
            yield from (Case("work-precision", scene, arm, run, each) for each in added)
    for name, end_s in CLEARANCE_END_S.items():
        of_scene = _with_clearance(SCENES[name]().model_copy(update={"end_time_s": end_s}))
        yield from (case for case in of_scene if case.engine in engines)
    ledgers = (case for case in energy.cases(full=True) if case.columns["rung"] == LEDGER_RUNG)
    for case in ledgers:
        wanted = case.scene.name in LEDGERS and case.engine in engines
        if wanted and _supporting([case.arm], case.plain_scene):
            yield case


def _with_clearance(scene: Scene) -> Iterator[Case]:
    """Yield the clearance study's cases; where a tolerance chooses the steps those that count evaluations."""
    ladder = clearance_ladder(scene, full=False, fast=False)
    equal = [rung.step_s for rung in ladder if rung.arm is arms.PLAIN]
    ladder += [Rung(arms.RK44, step_s) for step_s in equal]  # refuses the constraints of ideal joints
    for arm, rungs in groupby(ladder, key=lambda rung: rung.arm):
        for rung in list(rungs)[CLEARANCE_RUNGS] if _supporting([arm], scene) else ():
            study, samples = ("work-precision", 24) if arm.tolerances else ("clearance", 120)
            yield Case(study, scene, arm, RunSettings(rung.step_s, samples), rung.added)


def _supporting(of: Sequence[Arm], scene: Scene) -> list[Arm]:
    """Return the arms that run a scene on this machine."""
    out = []
    for arm in of:
        try:
            make_engine(arm.engine, **arm.settings).check(scene)
        except UnsupportedScene:
            continue
        out.append(arm)
    return out
