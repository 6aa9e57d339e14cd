"""Runs of the reference solver as trajectories: ideal joints, compliant clearance, rigid clearance."""

from __future__ import annotations

import time
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from engine_models.contact_stiffness import elastic_energy_J
from engine_models.engine import (
    JOINTS,
    Contact,
    FloatArray,
    Impacts,
    RunSettings,
    Trajectory,
)
from engine_models.pace import MOST_STEPS, require_pace, too_slow
from engine_models.progress import tell
from engine_models.reference_model import CRANK, mechanism_of, rigid_joints_of
from engine_models.scene import Clearance, Scene
from engine_models.start_check import checked_start
from reference_solver.equations import row_slices
from reference_solver.rigid_contact import solve_rigid
from reference_solver.rigid_friction import FrictionTooStiff
from reference_solver.rigid_joint import JointGeometry
from reference_solver.rigid_solution import RigidImpact
from reference_solver.solver import Solution, Stabilisation, StepChoice, make_stepper, record

#: Runs tried with ever shorter steps, each this part of what friction needed in the one before.
MOST_TRIES, ROOM = 5, 0.8

#: Steps of contacts, and events between rigid walls, after which their pace is judged: some seconds; and
#: events that there is no time for.
LOOK_UP_STEPS, LOOK_UP_EVENTS, MOST_EVENTS = 2_000_000, 2_000, 1e8

if TYPE_CHECKING:  # it brings Numba
    from collections.abc import Callable

    from reference_solver.contact_stepper import ContactSolution


def _start(scene: Scene) -> tuple[FloatArray, FloatArray]:
    q, v = checked_start(scene)
    return q.ravel(), v.ravel()


def ideal_run(
    scene: Scene, settings: RunSettings, stabilisation: Stabilisation, compiled: bool
) -> Trajectory:
    """Run a scene of ideal joints at a fixed step."""
    end, step, (q, v) = scene.end_time_s, settings.step_used_s(scene.end_time_s), _start(scene)
    per_sample = settings.steps_per_sample(end)
    stepper = make_stepper(mechanism_of(scene), q, step, stabilisation, compiled)
    started = time.perf_counter()
    solution = record(
        stepper, q.copy(), v, end_time_s=end, samples=settings.samples, steps_per_sample=per_sample, tell=tell
    )
    solve_time = time.perf_counter() - started
    steps, stabilised = settings.samples * per_sample, stabilisation != "none"
    return _trajectory(scene, solution, {}, step, steps, solve_time, stabilised)


def compliant_run(
    scene: Scene, settings: RunSettings, rates: StepChoice, stabilisation: Stabilisation
) -> Trajectory:
    """Run a scene with compliant clearance at the two rates.

    Samples denser than the steps asked for do not shorten them: they are interpolated (see
    ``record_contacts``).
    """
    from reference_solver.contact_stepper import ContactStepper, record_contacts  # brings Numba

    if rates.locate_events and settings.steps_per_sample(scene.end_time_s) == 1:
        rates = rates.at(settings.step_s)
    q, v = _start(scene)
    stepper = ContactStepper(mechanism_of(scene), q, rates, stabilisation)
    started = time.perf_counter()
    watch = _watch(scene, lambda: stepper.steps, LOOK_UP_STEPS, MOST_STEPS)
    run = record_contacts(stepper, q, v, scene.end_time_s, settings.samples, watch)
    solve_time = time.perf_counter() - started
    contacts = {
        name: _contact(getattr(scene.clearance, name), run, k)
        for k, name in enumerate(scene.joints_with_clearance)
    }
    step, stabilised = rates.longest_s, stabilisation != "none"
    trajectory = _trajectory(scene, run.motion, contacts, step, run.steps, solve_time, stabilised)
    for name, states in zip(scene.joints_with_clearance, run.contacts, strict=True):
        force = np.array([state.force_on_pin_N for state in states])
        trajectory.joint_force_N[:, JOINTS.index(name)] = force
    return trajectory


def _watch(scene: Scene, steps: Callable[[], int], outlasting: int, most: float) -> Callable[[float], None]:
    """Return what tells how far a run has come, and ends one whose steps have collapsed.

    So many of the steps that it counts outlast any contact, and the most are more than there is time for.
    """
    judged, judged_s = 0, 0.0

    def watch(t: float) -> None:
        nonlocal judged, judged_s
        tell(t)
        since = steps() - judged
        if since >= outlasting:
            require_pace(scene, t, t - judged_s, since, most)
            judged, judged_s = judged + since, t

    return watch


def rigid_run(scene: Scene, settings: RunSettings) -> Trajectory:
    """Run a scene with rigid clearance as ``_rigid_run`` does, with shorter steps if friction needs them.

    Raises:
        FrictionTooStiff: it still needs shorter ones after ``MOST_TRIES``.
    """
    for _ in range(MOST_TRIES):
        try:
            return _rigid_run(scene, settings)
        except FrictionTooStiff as stiff:
            if stiff.needed_s * MOST_STEPS < scene.end_time_s:
                raise too_slow(scene, f"steps of {stiff.needed_s:.3g} s") from stiff
            settings = RunSettings(ROOM * stiff.needed_s, settings.samples)
    return _rigid_run(scene, settings)


def _rigid_run(scene: Scene, settings: RunSettings) -> Trajectory:
    """Run a scene with rigid clearance; the joints' forces are those of following, without impulses.

    The solve time includes the making of kernels, one for every set of following joints that occurs.
    """
    end, step, (q, v) = scene.end_time_s, settings.step_used_s(scene.end_time_s), _start(scene)
    per_sample = settings.steps_per_sample(end)
    joints, events = rigid_joints_of(scene), count(1)
    started = time.perf_counter()
    run = solve_rigid(
        mechanism_of(scene),
        joints,
        q,
        v,
        end_time_s=end,
        samples=settings.samples,
        steps_per_sample=per_sample,
        tell=_watch(scene, lambda: next(events), LOOK_UP_EVENTS, MOST_EVENTS),
    )
    solve_time = time.perf_counter() - started
    gaps = JointGeometry(mechanism_of(scene), joints)
    gap = np.array([gaps.offsets(at) for at in run.q])
    distance = np.hypot(gap[..., 0], gap[..., 1])
    contacts = {
        name: Contact(
            gap_m=gap[:, k],
            penetration_m=distance[:, k] - joint.radial_clearance_m,
            normal_force_N=run.normal_force_N[:, k],
            friction_force_N=None if joint.friction is None else run.friction_force_N[:, k],
            elastic_energy_J=np.zeros(len(gap)),
            normal_impulse_N_s=run.normal_impulse_N_s[:, k],
            normal_loss_J=run.impact_loss_J[:, k] + run.closing_loss_J[:, k],
            friction_loss_J=None if joint.friction is None else run.friction_loss_J[:, k],
            clipped_loss_J=None,
            impacts=_rigid_impacts(run.impacts, k),
        )
        for k, (name, joint) in enumerate(zip(scene.joints_with_clearance, joints, strict=True))
    }
    motion = Solution(run.time_s, run.q, run.v, run.multipliers, run.constraint_work_J)
    trajectory = _trajectory(scene, motion, contacts, step, settings.samples * per_sample, solve_time)
    for k, name in enumerate(scene.joints_with_clearance):
        trajectory.joint_force_N[:, JOINTS.index(name)] = run.joint_force_N[:, k]
    return trajectory


def _rigid_impacts(impacts: tuple[RigidImpact, ...], joint: int) -> Impacts:
    mine = [impact for impact in impacts if impact.joint == joint]
    return Impacts(
        time_s=np.array([impact.time_s for impact in mine]),
        duration_s=np.zeros(len(mine)),
        approach_speed_m_s=np.array([impact.approach_speed_m_s for impact in mine]),
        normal_impulse_N_s=np.array([impact.normal_impulse_N_s for impact in mine]),
        energy_lost_J=np.array([impact.energy_lost_J for impact in mine]),
    )


def _contact(clearance: Clearance, run: ContactSolution, k: int) -> Contact:
    states = run.contacts[k]
    penetration = np.array([state.penetration_m for state in states])
    friction = np.array([state.friction_force_N for state in states]) if clearance.friction else None
    return Contact(
        gap_m=np.array([state.gap_m for state in states]),
        penetration_m=penetration,
        normal_force_N=np.array([state.normal_force_N for state in states]),
        friction_force_N=friction,
        elastic_energy_J=elastic_energy_J(clearance, penetration),
        normal_impulse_N_s=run.sums[f"normal{k}"],
        normal_loss_J=run.sums[f"loss{k}"],
        friction_loss_J=run.sums.get(f"slide{k}"),
        clipped_loss_J=run.sums.get(f"clip{k}"),
        impacts=Impacts(*run.impacts[k].T),
    )


def _trajectory(
    scene: Scene,
    solution: Solution,
    contacts: dict[str, Contact],
    step: float,
    steps: int,
    solve_time: float,
    stabilised: bool = True,
) -> Trajectory:
    """Sort the solver's rows by joint; the force of a joint with clearance is left at zero."""
    mechanism, multipliers = mechanism_of(scene), solution.multipliers
    ideal = [name for name in scene.joints if name not in contacts]
    rows_of = row_slices(mechanism)
    joint_force = np.zeros((len(multipliers), len(scene.joints), 2))
    for name, rows in zip(ideal, rows_of, strict=False):
        joint_force[:, JOINTS.index(name)] = multipliers[:, rows]
    guide = multipliers[:, rows_of[len(ideal)].start] if scene.is_crank_slider else None
    position = solution.q.reshape(len(multipliers), -1, 3)
    torque: FloatArray | None = None
    work: FloatArray | None = None
    if scene.drive.kind == "constant-speed":
        torque, work = multipliers[:, -1], solution.constraint_work_J
    elif scene.drive.kind == "torque":
        torque = np.full(len(multipliers), scene.drive.torque_N_m)
        work = torque * (position[:, CRANK, 2] - position[0, CRANK, 2])
    return Trajectory(
        time_s=solution.time_s,
        position=position,
        velocity=solution.v.reshape(position.shape),
        joint_force_N=joint_force,
        guide_normal_force_N=guide,
        driver_torque_N_m=torque,
        driver_work_J=work,
        step_s=step,
        steps=steps,
        solve_time_s=solve_time,
        contacts=contacts,
        stabilisation_loss_J=solution.stabilisation_loss_J if stabilised else None,
    )
