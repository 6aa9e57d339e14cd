"""Motions: one impact by every engine beside the truth, and under every contact law, as curves for figures.

Two views, each a column ``view`` of its cases: the first ``impact`` by all engines, sampled densely, and the
same impact under every contact ``law`` by the reference.
"""

from typing import get_args

import numpy as np

from engine_models import arms
from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.mechanics.samples import selected
from engine_models.scene.library import SCENES
from engine_models.scene.parts import LINEAR_LAWS
from engine_models.scene.scene import ContactLaw, Scene
from studies.case import Case, Curves, Row
from studies.judges.columns import sample_columns
from studies.judges.comparison import compared, judged
from studies.judges.metrics import conserved
from studies.ladders import ladder

#: The scene whose first impact is shown, from shortly before its touch at 227 us to after its release, in
#: samples of half a microsecond; and the restitution at which laws are told apart.
IMPACT_SCENE, IMPACT_FROM_S, IMPACT_END_S, IMPACT_SAMPLES = "clearance-driven-0.5mm", 2.2e-4, 3e-4, 600
LAWS = tuple(law for law in get_args(ContactLaw) if law not in (*LINEAR_LAWS, "rigid"))
RESTITUTION = 0.5
QUICK_LAWS = ("hertz", "lankarani-nikravesh")
#: The engines' configurations, each at the middle of its settings in the quick set.
ARMS = (arms.LOCATED, arms.DOPRI5, arms.SHORTER_IN_CONTACT, arms.SCIPY_DOP853)
#: Columns of the truth that are kept beside a run's own.
OF_TRUTH = ("clearance_", "contact_")


def cases(full: bool) -> list[Case]:
    """Return the impact by all engines and under the laws; the full set has all laws."""
    laws = LAWS if full else QUICK_LAWS
    impacts = [_case(_first_impact(), arm, {"view": "impact"}) for arm in (*ARMS, *arms.newcomers())]
    return impacts + [_law(law) for law in laws]


def _first_impact() -> Scene:
    update = {"end_time_s": IMPACT_END_S, "name": f"{IMPACT_SCENE}-first-impact"}
    return SCENES[IMPACT_SCENE]().model_copy(update=update)


def _law(law: str) -> Case:
    restitution = None if law == "hertz" else RESTITUTION
    changes = {"clearance.B.law": law, "clearance.B.restitution": restitution}
    scene = _first_impact().replace({"name": f"{IMPACT_SCENE}-{law}", **changes})
    return _case(scene, arms.LOCATED, {"view": "law", "law": law, "restitution": restitution})


def _case(scene: Scene, arm: arms.Arm, columns: Row) -> Case:
    """Return a run at the middle setting; steps are no longer than the distance of two samples."""
    own = [setting for setting in ladder(scene, full=False, fast=False) if setting.arm == arm]
    middle = own[len(own) // 2]
    run = RunSettings(middle.step_s, IMPACT_SAMPLES)
    return Case("motions", scene, arm, run, middle.added, columns=columns)


def measure(case: Case) -> tuple[Row, Curves]:
    """Return a run's errors, and its curves with the truth's: names begin with ``true_``."""
    scene, engine = case.plain_scene, make_engine(case.engine, **case.settings)
    found = judged(engine, scene, case.run)
    run, own = found.plain, engine.twin(scene)
    worst, errors = compared(found)
    curves = sample_columns(scene, run)
    row: Row = {"steps": run.steps, "mean_step_s": scene.end_time_s / run.steps, **worst}
    row |= {name: float(np.abs(of).max()) for name, of in curves.items() if name.endswith("_force_N")}
    assert run.dissipated_energy_J is not None
    row |= {"dissipated_energy_J": float(run.dissipated_energy_J[-1]), **conserved(scene, run)[0]}
    row["scene_json"] = scene.model_dump_json(exclude_none=True)
    true = sample_columns(own, selected(found.solved.truth, found.equal))
    curves |= {f"true_{name}": curve for name, curve in true.items() if name.startswith(OF_TRUTH)}
    return row, {name: curve[run.time_s >= IMPACT_FROM_S] for name, curve in {**curves, **errors}.items()}
