"""A member of a sweep: one simulation of a scene with its own values, and what it did, as a row.

``measure`` is that of a study, so that members run, are kept and resume as the cases of studies do.
"""

import math
from dataclasses import replace

import numpy as np

from engine_models.convergence.doubts import doubts
from engine_models.engine import Contact, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.quality import quality_of
from engine_models.mechanics.states import observed_m
from engine_models.scene.data import SceneError
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from studies.case import Case, Curves, Row
from studies.sweeps.closing import closed

NAME = "sweep"
#: Output intervals in a revolution, and of a whole run at most.
TURN_SAMPLES, MOST_SAMPLES = 200, 100_000
#: How the columns of varied fields begin in the rows that are kept.
VARIED = "varied "


def member(scene: AnyScene, values: dict[str, float], revolutions: float) -> AnyScene:
    """Return the scene with these values in its fields, by their paths, as long as so many revolutions.

    They are those of the turning body at its speed at the start. Without one, or where it is at rest, a
    revolution is as long as the scene.

    Raises:
        SceneError: with them it is none.
    """
    scene, body = scene.replace(values), scene.turning_body
    speed = 0.0 if body is None else float(start_state(scene)[1][body, 2])
    turn_s = 2 * math.pi / abs(speed) if speed else scene.end_time_s
    return scene.replace("end_time_s", revolutions * turn_s)


def measure(case: Case) -> tuple[Row, Curves]:
    """Simulate a member as ``crankslider simulate`` does, and return what it did, with its warnings.

    Raises:
        SimulationFailed, UnsupportedScene: its values give no scene, or the engine has no run of it.
    """
    columns = case.columns
    transient, revolutions = (float(str(columns[name])) for name in ("transient", "revolutions"))
    values = {
        name.removeprefix(VARIED): float(str(value))
        for name, value in columns.items()
        if name.startswith(VARIED)
    }
    engine = make_engine(case.engine, **case.settings)
    try:
        scene = member(case.scene, values, transient + revolutions)
    except SceneError as reason:
        raise SimulationFailed(str(reason)) from None
    samples = max(1, min(round(TURN_SAMPLES * (transient + revolutions)), MOST_SAMPLES))
    longest_s = scene.end_time_s if columns["step"] is None else float(str(columns["step"]))
    with np.errstate(all="ignore"):  # engines look for non-finite numbers themselves
        run = engine.simulate(scene, RunSettings(min(longest_s, scene.end_time_s), samples))
        warnings = doubts(engine, scene, run, to_tolerance=False)
    numbers = {**quality_of(scene, run).parts(), **summary(scene, run, transient, revolutions)}
    known = {name: value for name, value in numbers.items() if math.isfinite(value)}
    return {"warnings": "; ".join(warnings), **known}, {}


def summary(scene: AnyScene, run: Trajectory, transient: float, revolutions: float) -> dict[str, float]:
    """Return what a run did in the revolutions after the transient; NaN is what is not known.

    Of joints with clearance, all taken together: an impact is a touch; one that still lasts at the end has no
    impulse yet, and its speed is not known. The largest force is that of impacts, found between steps, and of
    samples. The deviation in m is that of what the scene observes, such as the slider's place, from where
    ideal joints would have it at the turning body's angle. That angle is the phase of an impact, or without
    such a body the part of a turn's time: its mean is that of cosine and sine, since angles go round.

    Of a scene with ideal joints: the largest forces of joints and guides, and of its driver, at samples.
    """
    turns, body = transient + revolutions, scene.turning_body
    first = round((len(run.time_s) - 1) * transient / turns)
    if not run.contacts:
        return _largest_loads(run, first)
    turn_s, from_s = scene.end_time_s / turns, run.time_s[first]
    touch_s, speed, impulse = _touches(run, from_s)
    late = replace(run, position=run.position[first:], velocity=run.velocity[first:])
    ideal = replace(late, position=closed(scene, late.position, body))
    deviation = observed_m(scene, late) - observed_m(scene, ideal)
    angle = 2 * np.pi * run.time_s / turn_s if body is None else run.position[:, body, 2]
    phase = np.interp(touch_s, run.time_s, angle) % (2 * np.pi)
    contacts, lost = run.contacts.values(), run.dissipated_energy_J
    assert lost is not None, "there are contacts"
    pressed = np.sum([contact.normal_impulse_N_s for contact in contacts], axis=0)
    in_flight = np.all([contact.penetration_m[first:] < 0 for contact in contacts], axis=0)
    compliant = [run.contacts[joint] for joint, own in scene.clearances.items() if own.law != "rigid"]
    subject = "slider" if isinstance(scene, Scene) and scene.is_crank_slider else "observed"
    return {
        "impacts_per_revolution": len(touch_s) / revolutions,
        "flight_part": float(in_flight.mean()),
        "impact_speed_m_s": _mean(speed),
        "impulse_N_s": _mean(impulse),
        "impulse_per_revolution_N_s": float(pressed[-1] - pressed[first]) / revolutions,
        "largest_contact_force_N": max(
            (_peak_N(each, first, from_s) for each in compliant), default=math.nan
        ),
        "dissipated_energy_per_revolution_J": float((lost[-1] - lost[first]) / revolutions),
        f"{subject}_deviation_m": float(np.abs(deviation).max()),
        f"rms_{subject}_deviation_m": float(np.sqrt(np.mean(deviation**2))),
        "impact_phase_cosine": _mean(np.cos(phase)),
        "impact_phase_sine": _mean(np.sin(phase)),
    }


def _largest_loads(run: Trajectory, first: int) -> dict[str, float]:
    joints = {name: np.hypot(*force.T) for name, force in run.joint_force_N.items()}
    loads = {f"largest_joint_{name}_force_N": force for name, force in joints.items()}
    loads |= {f"largest_{name}_normal_force_N": force for name, force in run.guide_force_N.items()}
    if run.driver_torque_N_m is not None:
        loads["largest_driver_torque_N_m"] = run.driver_torque_N_m
    return {name: float(np.abs(load[first:]).max()) for name, load in loads.items()}


def _mean(values: FloatArray) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else math.nan


def _peak_N(contact: Contact, first: int, from_s: float) -> float:
    """Return the largest normal force of a contact from a sample on, between samples that of its impacts."""
    impacts = contact.impacts
    late = impacts.largest_normal_force_N[impacts.largest_normal_force_time_s >= from_s]
    return float(max(contact.normal_force_N[first:].max(), late.max(initial=0.0)))


def _touches(run: Trajectory, from_s: float) -> FloatArray:
    """Return times, speeds and impulses of touches from a time on, (3, m), NaN of what is not known."""
    parts = []
    for contact in run.contacts.values():
        impacts, lasting = contact.impacts, _lasting_s(run.time_s, contact)
        unknown = np.full(len(lasting), np.nan)
        over = impacts.time_s, impacts.approach_speed_m_s, impacts.normal_impulse_N_s
        parts.append(np.concatenate([over, (lasting, unknown, unknown)], axis=1))
    touches = np.concatenate(parts, axis=1)
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
