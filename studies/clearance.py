"""Clearance: every engine on every scene with clearance, against the converged solution of its own law."""

from itertools import chain

import numpy as np

from engine_models.engine import ROUNDING, RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.samples import selected
from engine_models.mechanics.states import observed_m
from engine_models.scene.library import CLEARANCE_SCENES, RIGID_SCENES
from engine_models.scene.parts import AnyScene
from studies.case import Case, Curves, Row
from studies.judges.comparison import Judged, compared, judged
from studies.judges.converged_truth import (
    converged,
    cross_check,
    followed,
    solved,
    times_between_s,
    true_at,
)
from studies.judges.impact_matching import (
    FORCE_ERROR,
    FORCE_PART,
    force_error_in_phase_N,
    impact_errors,
)
from studies.judges.metrics import COVERAGE, conserved, errors
from studies.ladders import QUICK_LOOSE, ladder

#: How far each scene is followed in s: to its horizon (see ``converged_truth.followed``), where it has one.
#: What settles to continuous contact has none in ten revolutions and is followed for three; the pendulum for
#: half a swing to either side.
END_S = {
    "clearance-driven-0.5mm": 0.029,
    "clearance-driven-0.1mm": 0.033,
    "clearance-driven-0.02mm": 0.036,
    "clearance-driven-damped": 0.036,
    "clearance-driven-A": 0.021,
    "clearance-driven-AB": 0.01,
    "clearance-free-0.5mm": 0.071,
    "clearance-free-OAB": 0.04,
    "clearance-pendulum": 0.3,
    "clearance-start-up": 0.1,
    "clearance-compressor": 0.052,
    "rigid-driven-0.5mm": 0.026,
    "rigid-driven-damped": 0.036,
    "rigid-free-0.5mm": 0.29,
    "rigid-pendulum": 0.3,
    "rigid-start-up": 0.05,
    "rigid-compressor": 0.084,
}
SAMPLES = 120


def scenes(full: bool) -> list[AnyScene]:
    """Return the scenes, cut to the time for which they are followed."""
    library = {**CLEARANCE_SCENES, **RIGID_SCENES}
    names = END_S if full else QUICK_LOOSE
    return [library[name]().model_copy(update={"end_time_s": END_S[name]}) for name in names]


def cases(full: bool) -> list[Case]:
    """Return a series of every engine's own best settings for every scene.

    SciPy is left out between rigid walls: its pins rebound, and follow no wall as they do here in the end.
    """
    out = [
        Case("clearance", scene, rung.arm, RunSettings(rung.step_s, SAMPLES), rung.added)
        for scene in scenes(full)
        for rung in ladder(scene, full, fast=False)
        if rung.arm.engine != "scipy" or scene.name not in RIGID_SCENES
    ]
    return list({str(one.head()): one for one in out}.values())  # samples may cut two rungs to one step


def measure(case: Case) -> tuple[Row, Curves]:
    """Return a run's errors against its own law's true solution, and that law's distance from the scene's.

    Errors are the largest up to the horizon (see ``converged_truth.followed``), ``compared_until_s``. So is
    the distance of the truth from the cross-check; ``truth`` says what the truth is by.
    """
    engine, samples = make_engine(case.engine, **case.settings), case.run.samples
    found = judged(engine, case.scene, case.run)
    worst, error_curves = compared(found)
    own, until = found.own, followed(found.own, samples)
    truth, _ = converged(own, samples)
    run = found.plain
    ledger, curves = conserved(case.scene, run)
    assert run.dissipated_energy_J is not None
    row: Row = {
        "slider_position_cross_check_m": _cross_check_m(own, truth, until),
        "steps": run.steps,
        "mean_step_s": case.scene.end_time_s / run.steps,
        **worst,
        **(_model_differences(case.scene, own, samples) if own != case.scene else {}),
        **impacts_of(found),
        **ledger,
        "dissipated_energy_J": float(run.dissipated_energy_J[-1]),
    }
    return row, {**error_curves, **curves, "time_s": run.time_s}


def _cross_check_m(scene: AnyScene, truth: Trajectory, until: int) -> float | None:
    """Return how far the reference's slider is from the true one up to the horizon, None where it fails."""
    try:
        found = cross_check(scene, len(truth.time_s) - 1)
    except SimulationFailed:
        return None
    return float(np.abs(observed_m(scene, found) - observed_m(scene, truth))[:until].max())


def _model_differences(scene: AnyScene, own: AnyScene, samples: int) -> Row:
    """Return how far the true solution of the engine's own law is from that of the scene's.

    Both are at the times at which runs of the scene are judged.
    """
    run = RunSettings(scene.end_time_s, samples, times_between_s(scene, samples))
    truth, other = solved(scene, samples).truth, true_at(own, run)
    until = min(followed(each, samples) for each in (scene, own))
    both = truth.time_s <= scene.end_time_s * (until - 1) / samples * (1 + ROUNDING)
    apart = errors(own, selected(other, both), selected(truth, both))
    return {name.replace("_error_", "_model_difference_"): float(off.max()) for name, off in apart.items()}


def impacts_of(found: Judged) -> Row:
    """Return what all joints' impacts miss: counts summed, the largest errors; and the truth's doubt."""
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
    doubts = [
        impact_errors(repeat.contacts[joint].impacts, contact.impacts, end_s)
        for repeat in repeats
        for joint, contact in truth.contacts.items()
    ]
    for name in ("impact_time_error_s", FORCE_ERROR, FORCE_PART):
        doubt = COVERAGE * max(each.get(name, 0.0) for each in doubts)
        row[name.replace("_error", "_uncertainty")] = doubt
    return row


def _largest_N(run: Trajectory, end_s: float) -> float:
    """Return the largest normal force in any joint up to a time, as samples and impacts have it."""
    until, forces = run.time_s <= end_s * (1 + ROUNDING), [0.0]
    for contact in run.contacts.values():
        impacts = contact.impacts
        forces += contact.normal_force_N[until].tolist()
        forces += impacts.largest_normal_force_N[impacts.time_s <= end_s].tolist()
    return float(np.nanmax(forces))
