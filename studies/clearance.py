"""Clearance: every engine on every scene with clearance, against the converged solution of its own law."""

from itertools import chain

import numpy as np

from engine_models.engine import RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.samples import selected
from engine_models.scene.library import CLEARANCE_SCENES, RIGID_SCENES
from engine_models.scene.scene import Scene
from studies.judges.comparison import compared, conserved
from studies.judges.converged_truth import converged, cross_check, followed, truth_by
from studies.judges.impact_matching import impact_errors
from studies.judges.kinds import require
from studies.judges.local_error import local_errors
from studies.judges.metrics import errors, with_suffix
from studies.ladders import clearance_ladder
from studies.running.case import Case, Curves, Row

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
#: The scenes of the quick set; the full set has all.
QUICK = (
    "clearance-driven-0.5mm",
    "clearance-driven-AB",
    "clearance-free-0.5mm",
    "clearance-start-up",
    "clearance-compressor",
    "rigid-free-0.5mm",
)
SAMPLES = 120


def scenes(full: bool) -> list[Scene]:
    """Return the scenes, cut to the time for which they are followed."""
    library = {**CLEARANCE_SCENES, **RIGID_SCENES}
    names = END_S if full else QUICK
    return [library[name]().model_copy(update={"end_time_s": END_S[name]}) for name in names]


def cases(full: bool) -> list[Case]:
    """Return a ladder of every engine's own best settings for every scene."""
    return [case for scene in scenes(full) for case in _cases_on(scene, full)]


def cases_on(scene: Scene, full: bool) -> list[Case]:
    """Return the same for a scene of the user's, followed to its end.

    Raises:
        BadInput: it has no clearance.
    """
    require("clearance", bool(scene.joints_with_clearance), "a joint with clearance", scene)
    return _cases_on(scene, full)


def _cases_on(scene: Scene, full: bool) -> list[Case]:
    out = [
        Case("clearance", scene, rung.arm, RunSettings(rung.step_s, SAMPLES), rung.added)
        for rung in clearance_ladder(scene, full, fast=False)
    ]
    return list({str(one.head()): one for one in out}.values())  # samples may cut two rungs to one step


def measure(case: Case) -> tuple[Row, Curves]:
    """Return a run's errors against its own law's true solution, and that law's distance from the scene's.

    Errors are the largest up to the horizon (see ``converged_truth.followed``), ``compared_until_s``. So is
    the distance of the truth from the cross-check; ``truth`` says what the truth is by.
    """
    engine = make_engine(case.engine, **case.settings)
    own = engine.twin(case.scene)
    truth, repeats = converged(own, case.run.samples)
    until = followed(own, case.run.samples)
    run = engine.simulate(case.scene, case.run)
    worst, error_curves = compared(own, run, truth, repeats, until)
    ledger, curves = conserved(case.scene, run)
    assert run.dissipated_energy_J is not None
    row: Row = {
        "truth": truth_by(own, case.run.samples),
        "slider_position_cross_check_m": _cross_check_m(own, truth, until),
        "steps": run.steps,
        "mean_step_s": case.scene.end_time_s / run.steps,
        **worst,
        **(_model_differences(case, own) if own != case.scene else {}),
        **_impacts(run, truth, repeats, worst["compared_until_s"]),
        **local_errors(engine, case.scene, truth, case.run, until),
        **ledger,
        "dissipated_energy_J": float(run.dissipated_energy_J[-1]),
    }
    return row, {**error_curves, **curves, "time_s": run.time_s}


def _cross_check_m(scene: Scene, truth: Trajectory, until: int) -> float | None:
    """Return how far the reference's slider is from the true one up to the horizon, None where it fails."""
    try:
        found = cross_check(scene, len(truth.time_s) - 1)
    except SimulationFailed:
        return None
    return float(np.abs(found.slider_position_m - truth.slider_position_m)[:until].max())


def _model_differences(case: Case, own: Scene) -> Row:
    """Return how far the converged solution of the engine's own law is from that of the scene's."""
    truth, other = (converged(scene, case.run.samples)[0] for scene in (case.scene, own))
    both = slice(None, min(followed(scene, case.run.samples) for scene in (case.scene, own)))
    apart = errors(own, selected(other, both), selected(truth, both))
    return {
        name.replace("_error_", "_model_difference_"): float(curve.max()) for name, curve in apart.items()
    }


def _impacts(run: Trajectory, truth: Trajectory, repeats: tuple[Trajectory, ...], end_s: float) -> Row:
    """Return what all joints' impacts miss: counts summed, the largest errors; and the truth's doubt."""
    row: Row = {}
    by_joint = [
        impact_errors(contact.impacts, truth.contacts[joint].impacts, end_s)
        for joint, contact in run.contacts.items()
    ]
    for name in dict.fromkeys(chain.from_iterable(by_joint)):
        values = [numbers[name] for numbers in by_joint if name in numbers]
        row[name] = sum(values) if name.startswith("impacts_") else max(values)
    doubts = [
        impact_errors(repeat.contacts[joint].impacts, contact.impacts, end_s).get("impact_time_error_s", 0.0)
        for repeat in repeats
        for joint, contact in truth.contacts.items()
    ]
    row[with_suffix("impact_time_s", "uncertainty")] = max(doubts)
    return row
