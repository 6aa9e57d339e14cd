"""Accuracy: every engine's errors in motion, forces and impacts, against the solution of its own model.

Scenes and settings are those of ``settings``. One scene more, the first impact of a driven crank-slider, is
sampled densely, for its force to be drawn over time: the rows with a ``view``. Left out between rigid walls:
SciPy, whose pins rebound and follow no wall; the scenes end before that, where they can.

A row has the largest error of every signal up to the horizon (see ``converged_truth.followed``) with the
reference solution's uncertainty and the signal's scale; what of impacts is missed and off; energy balance and
constraints; and where the engine solves another contact law, how far that law's motion is from the scene's.
"""

import json
from itertools import chain

import numpy as np

from engine_models import arms
from engine_models.engine import ROUNDING, Engine, FloatArray, RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.trajectory import selected
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.case import Case, Curves, Row, Value
from studies.judges.comparison import Judged, compared, judged
from studies.judges.converged_truth import followed, solved, times_between_s, true_at
from studies.judges.impact_matching import FORCE_ERROR, FORCE_PART, force_error_in_phase_N, impact_errors
from studies.judges.metrics import COVERAGE, conserved, errors
from studies.judges.run_cache import kept
from studies.settings import Rung, ladder, scenes

#: Few, since no step is longer than the time between two samples; forces are judged between them as well.
SAMPLES = 24
#: The scene whose first impact is shown, from shortly before its touch at 227 us to after its release, in
#: samples of half a microsecond; and by which configurations.
IMPACT_SCENE, IMPACT_FROM_S, IMPACT_END_S, IMPACT_SAMPLES = "clearance-driven-0.5mm", 2.2e-4, 3e-4, 600
IMPACT_ARMS = (arms.LOCATED, arms.DOPRI5, arms.SHORTER_IN_CONTACT, arms.SCIPY_DOP853)


def cases(full: bool) -> list[Case]:
    """Return the recorded run of every setting, and the impact by every engine's middle one."""
    out = [
        case_of("accuracy", scene, rung, SAMPLES) for scene in scenes(full) for rung in ladder(scene, full)
    ]
    out += [_impact(arm) for arm in (*IMPACT_ARMS, *arms.newcomers())]
    return list({str(one.head()): one for one in out}.values())  # samples may cut two settings to one step


def case_of(
    study: str, scene: Scene, rung: Rung, samples: int, timed: bool = False, **columns: Value
) -> Case:
    """Return a setting's run, at the step of the recorded one."""
    run = RunSettings(RunSettings(rung.step_s, SAMPLES).step_used_s(scene.end_time_s), samples)
    columns = {"motion_alone": arms.gives_motion_alone(rung.arm), **columns}
    return Case(study, scene, rung.arm, run, rung.added, timed=timed, columns=columns)


def _impact(arm: arms.Arm) -> Case:
    """Return a run of the first impact; steps are no longer than the distance of two samples."""
    update = {"end_time_s": IMPACT_END_S, "name": f"{IMPACT_SCENE}-first-impact"}
    scene = SCENES[IMPACT_SCENE]().model_copy(update=update)
    own = [rung for rung in ladder(scene, full=False) if rung.arm == arm]
    middle, columns = (
        own[len(own) // 2],
        {"view": "impact", "scene_json": json.dumps(scene.as_written())},
    )
    return Case(
        "accuracy", scene, arm, RunSettings(middle.step_s, IMPACT_SAMPLES), middle.added, columns=columns
    )


def measure(case: Case) -> tuple[Row, Curves]:
    """Return the row of a run, and errors over time as curves; of the impact also its force and depth."""
    engine = make_engine(case.engine, **case.settings)
    found = judged(engine, case.scene, case.run)
    end_of(engine, case.scene, case.run, found.plain)
    worst, error_curves = compared(found)
    ledger, curves = conserved(case.scene, found.plain)
    row: Row = {"steps": found.plain.steps, "mean_step_s": case.scene.end_time_s / found.plain.steps}
    row |= worst | ledger
    if found.plain.dissipated_energy_J is not None:
        row["smallest_clearance_m"] = min(room.radial_clearance_m for room in found.own.clearances.values())
        row["dissipated_energy_J"] = float(found.plain.dissipated_energy_J[-1])
        row |= impacts_of(found)
        if found.own != case.scene:
            row |= _model_differences(case.scene, found.own, case.run.samples)
    curves |= {**error_curves, "time_s": found.plain.time_s}
    if "view" in case.columns:
        curves |= _contacts("", found.plain)
        curves |= _contacts("true_", selected(found.solved.truth, found.equal))
        curves = {name: curve[found.plain.time_s >= IMPACT_FROM_S] for name, curve in curves.items()}
    return row, curves


def end_of(engine: Engine, scene: Scene, run: RunSettings, made: Trajectory | None = None) -> FloatArray:
    """Return all bodies' positions (bodies, 3) at a recorded run's end, kept for timed runs to be held to."""
    return kept(__name__, engine, scene, run, lambda: (made or engine.simulate(scene, run)).position[-1])


def _contacts(prefix: str, run: Trajectory) -> Curves:
    curves: Curves = {}
    for joint, contact in run.contacts.items():
        curves[f"{prefix}contact_{joint}_penetration_m"] = contact.penetration_m
        curves[f"{prefix}contact_{joint}_normal_force_N"] = contact.normal_force_N
    return curves


def _model_differences(scene: Scene, own: Scene, samples: int) -> Row:
    """Return how far the true solution of the engine's own law is from that of the scene's.

    Both are at the times at which runs of the scene are judged.
    """
    run = RunSettings(scene.end_time_s, samples, times_between_s(scene, samples))
    truth, other = solved(scene, samples).truth, true_at(own, run)
    until = min(followed(each, samples, judged=True) for each in (scene, own))
    both = truth.time_s <= scene.end_time_s * (until - 1) / samples * (1 + ROUNDING)
    apart = errors(own, selected(other, both), selected(truth, both))
    return {name.replace("_error_", "_model_difference_"): float(off.max()) for name, off in apart.items()}


def impacts_of(found: Judged) -> Row:
    """Return what all joints' impacts miss: counts summed, largest errors, and the truth's uncertainty."""
    row: Row = {}
    run, (truth, repeats, _), end_s = found.run, found.solved, found.compared_until_s
    by_joint = [
        impact_errors(contact.impacts, truth.contacts[joint].impacts, end_s)
        for joint, contact in run.contacts.items()
    ]
    for name in dict.fromkeys(chain.from_iterable(by_joint)):
        values = [numbers[name] for numbers in by_joint if name in numbers]
        row[name] = sum(values) if name.startswith("impacts_") else max(values)
    if FORCE_ERROR in row:
        own = [(contact, truth.contacts[joint]) for joint, contact in run.contacts.items()]
        in_phase = float(np.max([force_error_in_phase_N(*pair, truth.time_s, end_s) for pair in own]))
        row |= {"impact_force_in_phase_error_N": in_phase} if np.isfinite(in_phase) else {}
    row |= {"largest_contact_force_error_N": abs(_largest_N(run, end_s) - _largest_N(truth, end_s))}
    repeated = [
        impact_errors(repeat.contacts[joint].impacts, contact.impacts, end_s)
        for repeat in repeats
        for joint, contact in truth.contacts.items()
    ]
    for name in ("impact_time_error_s", FORCE_ERROR, FORCE_PART):
        apart = max(each.get(name, 0.0) for each in repeated)
        row[name.replace("_error", "_uncertainty")] = COVERAGE * apart
    return row


def _largest_N(run: Trajectory, end_s: float) -> float:
    """Return the largest normal force in any joint up to a time, as samples and impacts have it."""
    until, forces = run.time_s <= end_s * (1 + ROUNDING), [0.0]
    for contact in run.contacts.values():
        impacts = contact.impacts
        forces += contact.normal_force_N[until].tolist()
        forces += impacts.largest_normal_force_N[impacts.time_s <= end_s].tolist()
    return float(np.nanmax(forces))
