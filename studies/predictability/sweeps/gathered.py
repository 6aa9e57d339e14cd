"""What a member of a sweep did, in the columns of its row: from a run of any engine.

The reference gathers the same in its compiled loop (``engine_models.reference.members``).
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from engine_models.engine import Contact, FloatArray, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.mechanics.quality import require_quality
from engine_models.mechanics.states import observed_m
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.members import End, Row, failed, numbers_of, subject_of
from engine_models.reference.watch import Watch
from engine_models.scene.data import SceneError
from engine_models.scene.parts import AnyScene
from studies.judges import lyapunov
from studies.predictability.sweeps.closing import closed
from studies.predictability.sweeps.task import Task

#: Samples in a stretch of the exponent, for each pair of joints: two pins are rarely in flight at once; and
#: steps in a turn, in flight.
STRETCH_SAMPLES, TURN_STEPS = 500, 240


def row_of(task: Task, values: Mapping[str, float]) -> Row:
    """Return the row of a member with these values: what it did, or why it failed."""
    return followed(task, values)[0]


def followed(task: Task, values: Mapping[str, float]) -> tuple[Row, End | None]:
    """Return the row of a member with these values, and where it ended; nothing of one that failed."""
    try:
        scene = task.member(values)
        with np.errstate(all="ignore"):  # engines look for non-finite numbers themselves
            run = task.engine.simulate(scene, task.run_settings(scene))
            found = gathered(task.watch, scene, require_quality(scene, run))
            exponent = _exponent_1_s(task, scene) if task.watch.exponent else math.nan
    except (SceneError, SimulationFailed, UnsupportedScene, MemoryError) as failure:
        return failed(str(failure) or "no memory left", numbers_of(task.scene)), None
    row = {"status": "ok", "reason": "", **found, "exponent_1_s": exponent}
    return row, (run.position[-1], run.velocity[-1])


def gathered(watch: Watch, scene: AnyScene, run: Trajectory) -> Row:
    """Return what a run did after the transient; all joints with clearance are taken together.

    An impact is a touch; one that still lasts at the end has no impulse yet, and its speed is not known. The
    deviation in m is that of what the scene observes, such as the slider's place, from where ideal joints
    would have it at the turning body's angle: NaN where they do not close. That angle is the phase of an
    impact, or without such a body the part of a turn's time.
    """
    turn_s, body = scene.end_time_s / watch.turns, scene.turning_body
    first = round((len(run.time_s) - 1) * watch.transient / watch.turns)
    touch_s, speed, impulse = _touches(run, run.time_s[first])
    late = replace(run, position=run.position[first:], velocity=run.velocity[first:])
    ideal = replace(late, position=closed(scene, late.position, body))
    deviation = observed_m(scene, late) - observed_m(scene, ideal)
    once = turn_s * (watch.transient + np.arange(1, math.floor(watch.revolutions) + 1))
    angle = 2 * np.pi * run.time_s / turn_s if body is None else run.position[:, body, 2]
    phase = np.interp(touch_s, run.time_s, angle) % (2 * np.pi)
    contacts, lost = run.contacts.values(), run.dissipated_energy_J
    assert lost is not None
    subject = subject_of(scene)
    pressed = np.sum([contact.normal_impulse_N_s for contact in contacts], axis=0)
    in_flight = np.all([contact.penetration_m[first:] < 0 for contact in contacts], axis=0)
    return {
        "impacts_per_revolution": len(touch_s) / watch.revolutions,
        "flight_part": float(in_flight.mean()),
        "impact_speed_m_s": float(np.nanmean(speed)) if np.isfinite(speed).any() else math.nan,
        "impulse_N_s": float(np.nanmean(impulse)) if np.isfinite(impulse).any() else math.nan,
        "impulse_per_revolution_N_s": float(pressed[-1] - pressed[first]) / watch.revolutions,
        "largest_contact_force_N": max(float(each.normal_force_N[first:].max()) for each in contacts),
        "dissipated_energy_per_revolution_J": float((lost[-1] - lost[first]) / watch.revolutions),
        f"{subject}_deviation_m": float(np.abs(deviation).max()),
        f"rms_{subject}_deviation_m": float(np.sqrt(np.mean(deviation**2))),
        "strobe_m": np.interp(once, run.time_s[first:], deviation).tolist(),
        "impact_phase_rad": phase.tolist(),
    }


def _touches(run: Trajectory, from_s: float) -> FloatArray:
    """Return times, speeds and impulses of touches from a time on, (3, m), NaN of what is not known."""
    found = []
    for contact in run.contacts.values():
        impacts, lasting = contact.impacts, _lasting_s(run.time_s, contact)
        unknown = np.full(len(lasting), np.nan)
        over = impacts.time_s, impacts.approach_speed_m_s, impacts.normal_impulse_N_s
        found.append(np.concatenate([over, (lasting, unknown, unknown)], axis=1))
    touches = np.concatenate(found, axis=1)
    touches = touches[:, np.argsort(touches[0], kind="stable")]
    return np.asarray(touches[:, touches[0] >= from_s])


def _lasting_s(time_s: FloatArray, contact: Contact) -> FloatArray:
    """Return when the contact began that lasts at the end: nothing if there is none, or it never began.

    That is between two samples, or where the one before ended if no sample lies in the flight between.
    """
    depth, over = contact.penetration_m, contact.impacts.time_s + contact.impacts.duration_s
    flying = np.flatnonzero(depth < 0)
    if depth[-1] < 0 or not (len(flying) or len(over)):
        return np.empty(0)
    began = list(over)
    if len(flying):
        last = slice(flying[-1], flying[-1] + 2)
        began.append(np.interp(0.0, depth[last], time_s[last]))
    return np.array([max(began)])


def _exponent_1_s(task: Task, scene: AnyScene) -> float:
    """Return how fast neighbouring motions part, in 1/s; NaN where that cannot be followed.

    Of the reference it is measured with RK4: where a tolerance chooses the steps, two runs differ by theirs.
    """
    turn_s = scene.end_time_s / task.watch.turns
    samples = STRETCH_SAMPLES * len(scene.joints_with_clearance) ** 2
    engine, step_s = task.engine, task.step_s or turn_s / TURN_STEPS
    if isinstance(engine, ReferenceEngine):
        engine = replace(engine, method="rk4")
    growth = lyapunov.growth(engine, scene, step_s, turn_s, samples)
    try:
        return growth.exponent_per_s(task.watch.transient * turn_s)
    except SimulationFailed:  # pins that never leave the wall
        return math.nan
