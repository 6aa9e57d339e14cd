"""Motions: what every engine's run looks like beside the truth, as curves that figures are drawn from.

Four views, each a column ``view`` of its cases: one ``revolution`` by all engines; the first ``impact`` by
all engines, sampled densely; the same impact under every contact ``law``; and every scene of the library
``whole``, by one engine, for the scenes' cards.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import FloatArray, RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.samples import selected
from engine_models.mechanics.states import observed_m
from engine_models.scene.library import CLEARANCE_SCENES, IDEAL_SCENES, RIGID_SCENES, SCENES
from engine_models.scene.parts import LINEAR_LAWS
from engine_models.scene.scene import ContactLaw, Scene
from studies.command.trajectory_table import sample_columns
from studies.judges.comparison import compared, judged
from studies.judges.energy_ledger import ledger
from studies.judges.metrics import checked, conserved
from studies.ladders import QUICK_IDEAL, QUICK_LOOSE, Rung, clearance_ladder, ideal_ladder
from studies.running.case import Case, Curves, Row

#: One turn of set R's crank, in s, and what is followed of each scene: a turn, or up to its horizon where
#: that is earlier (see ``clearance.END_S``). Quick, then what the full set adds.
TURN_S = 60 / 5000
QUICK = {"ideal-driven": TURN_S}
MORE = {
    "clearance-driven-0.5mm": TURN_S,
    "ideal-free": 0.1,
    "ideal-fluctuating": TURN_S,
    "ideal-compressor": 0.04,
    "clearance-driven-0.1mm": TURN_S,
    "clearance-driven-0.02mm": TURN_S,
    "clearance-driven-damped": TURN_S,
    "clearance-driven-A": TURN_S,
    "clearance-driven-AB": 0.01,
    "clearance-free-0.5mm": 0.071,
    "clearance-compressor": 0.04,
    "rigid-driven-0.5mm": TURN_S,
    "rigid-driven-damped": TURN_S,
}
#: A contact of set R lasts some ten of a turn's samples.
SAMPLES = 2400
#: The scene whose first impact is shown, from shortly before its touch at 227 us to after its release, in
#: samples of half a microsecond; and the restitution at which laws are told apart.
IMPACT_SCENE, IMPACT_FROM_S, IMPACT_END_S, IMPACT_SAMPLES = "clearance-driven-0.5mm", 2.2e-4, 3e-4, 600
LAWS = tuple(law for law in get_args(ContactLaw) if law not in (*LINEAR_LAWS, "rigid"))
RESTITUTION = 0.5
QUICK_LAWS = ("hertz", "lankarani-nikravesh")
#: Samples of a whole scene, of which every so many are kept, and the tolerance of its run.
WHOLE_SAMPLES, WHOLE_EVERY, WHOLE_TOLERANCE = 4800, 4, 1e-9

#: The engines' arms, each at the middle rung of its ladder. What has no rung on rigid walls says why.
IDEAL_ARMS = (arms.PROJECTION, arms.TRAPEZOIDAL, arms.TUNED, arms.ODE)
COMPLIANT_ARMS = (arms.LOCATED, arms.DOPRI5, arms.SHORTER_IN_CONTACT, arms.SCIPY_DOP853)
RIGID_ARMS = (arms.LOCATED, arms.DOPRI5, arms.NATIVE_CONTACT, arms.SCIPY_DOP853)
#: Columns of the truth that are kept beside a run's own.
OF_TRUTH = ("crank_angle_", "slider_", "joint_", "driver_torque_", "clearance_", "contact_")


def cases(full: bool) -> list[Case]:
    """Return the cases of all views; the full set has more scenes."""
    return [
        *(
            case
            for name, end in {**QUICK, **(MORE if full else {})}.items()
            for case in _revolution(name, end)
        ),
        *_by_all(_first_impact(), "impact", IMPACT_SAMPLES),
        *(_law(law) for law in LAWS if full or law in QUICK_LAWS),
        *(_whole(name) for name in SCENES if full or name in QUICK_IDEAL + QUICK_LOOSE),
    ]


def _revolution(name: str, end_s: float) -> list[Case]:
    return _by_all(SCENES[name]().model_copy(update={"end_time_s": end_s}), "revolution", SAMPLES)


def _by_all(scene: Scene, view: str, samples: int) -> list[Case]:
    """Return a case of every engine; steps are no longer than the distance of two samples."""
    rungs = (ideal_ladder if scene.name in IDEAL_SCENES else clearance_ladder)(scene, full=False)
    chosen = (_middle(rungs, arm) for arm in (*_arms(scene), *arms.newcomers()))
    return [
        Case(
            "motions", scene, rung.arm, RunSettings(rung.step_s, samples), rung.added, columns={"view": view}
        )
        for rung in chosen
    ]


def _arms(scene: Scene) -> tuple[Arm, ...]:
    if scene.name in IDEAL_SCENES:
        return IDEAL_ARMS
    return RIGID_ARMS if scene.name in RIGID_SCENES else COMPLIANT_ARMS


def _middle(rungs: Sequence[Rung], arm: Arm) -> Rung:
    """Return an arm's middle rung, an engine's best practice when neither cheap nor sharp is asked for."""
    own = [rung for rung in rungs if rung.arm == arm]
    if not own:
        return Rung(arm, TURN_S)
    middle = own[len(own) // 2]
    # Exudyn's build for speed is for clocks, and would not run in one process with the other.
    return replace(middle, added={name: of for name, of in middle.added.items() if name != "fast"})


def _first_impact() -> Scene:
    update = {"end_time_s": IMPACT_END_S, "name": f"{IMPACT_SCENE}-first-impact"}
    return SCENES[IMPACT_SCENE]().model_copy(update=update)


def _law(law: str) -> Case:
    restitution = None if law == "hertz" else RESTITUTION
    scene = _first_impact().replace(
        {
            "name": f"{IMPACT_SCENE}-{law}",
            "clearance.B.law": law,
            "clearance.B.restitution": restitution,
        }
    )
    columns = {"view": "law", "law": law, "restitution": restitution}
    rung = _middle(clearance_ladder(scene, full=False), arms.LOCATED)
    run = RunSettings(rung.step_s, IMPACT_SAMPLES)
    return Case("motions", scene, rung.arm, run, rung.added, columns=columns)


def _whole(name: str) -> Case:
    """Return the run of a scene's card, by an engine that needs no kernel of its own for the scene if any."""
    scene = SCENES[name]()
    arm = arms.DOPRI5 if name in CLEARANCE_SCENES else arms.REFERENCE_DOP853
    run = RunSettings(scene.end_time_s, WHOLE_SAMPLES)
    added = dict.fromkeys(arm.tolerances, WHOLE_TOLERANCE)
    return Case("motions", scene, arm, run, added, columns={"view": "whole"})


def measure(case: Case) -> tuple[Row, Curves]:
    """Return a run's largest forces and errors, and its curves with the truth's: names begin with ``true_``.

    Errors are those against the converged solution of the law that the engine solves, up to the horizon, and
    past it not a number. A ``whole`` scene has no truth beside it, and its own definition in its row.
    """
    scene, engine = case.plain_scene, make_engine(case.engine, **case.settings)
    found = None if case.columns["view"] == "whole" else judged(engine, scene, case.run)
    run = found.plain if found else engine.simulate(scene, case.run)
    curves = _curves(scene, run)
    row: Row = {"steps": run.steps, "mean_step_s": scene.end_time_s / run.steps}
    row |= {name: float(np.abs(of).max()) for name, of in curves.items() if name.endswith("_force_N")}
    row |= {
        name: float(curves[name][-1]) for name in curves if name.endswith(("_work_J", "dissipated_energy_J"))
    }
    row |= _contacts(run) if run.contacts else {}
    if found is None:
        row |= checked(scene, run)
        row |= {
            "scene_json": scene.model_dump_json(exclude_none=True),
            "scene_text": SCENES[scene.name].__doc__ or "",
        }
        return row, {name: _short(curve[::WHOLE_EVERY]) for name, curve in curves.items()}
    own, truth = engine.twin(scene), selected(found.solved.truth, found.equal)
    worst, errors = compared(found)
    row |= {**worst, **conserved(scene, run)[0]}
    beyond = len(run.time_s) - len(errors["slider_position_error_m"])
    curves |= {name: np.append(curve, np.full(beyond, np.nan)) for name, curve in errors.items()}
    true = _curves(own, truth)
    curves |= {f"true_{name}": curve for name, curve in true.items() if name.startswith(OF_TRUTH)}
    shown = run.time_s >= (0 if case.columns["view"] == "revolution" else IMPACT_FROM_S)
    return row, {name: _short(curve[shown]) for name, curve in curves.items()}


def _curves(scene: Scene, run: Trajectory) -> Curves:
    """Return the samples of a run and its energy ledger, joint forces also by their size.

    ``slider_deviation_m`` is the slider's distance along +x from where ideal joints have it at the run's own
    crank angle.
    """
    curves = {**sample_columns(scene, run), **ledger(scene, run)}
    for joint, force in run.joint_force_N.items():
        curves[f"joint_{joint}_force_N"] = np.hypot(*force.T)
    if scene.is_crank_slider:
        crank, rod, _ = scene.crank_slider()
        pin = crank.length_m * np.exp(1j * run.position[:, 0, 2])
        ideal = pin.real + np.sqrt((rod.length_m - pin.imag) * (rod.length_m + pin.imag))
        curves["slider_deviation_m"] = observed_m(scene, run) - ideal
    return curves


def _contacts(run: Trajectory) -> Row:
    """Return how many contacts ended, and how short the shortest and how fast the fastest of them were."""
    impacts = [contact.impacts for contact in run.contacts.values()]
    lasted = np.concatenate([each.duration_s for each in impacts])
    speeds = np.concatenate([each.approach_speed_m_s for each in impacts])
    if not len(lasted):
        return {"contacts_ended": 0}
    return {
        "contacts_ended": len(lasted),
        "shortest_contact_s": float(lasted.min()),
        "largest_approach_speed_m_s": float(speeds.max()),
    }


def _short(curve: FloatArray) -> FloatArray:
    """Return a curve in single precision's digits, which no figure shows and which make a small file."""
    return np.asarray(curve.astype(np.float32), dtype=float)
