"""Runs of the reference solver as trajectories."""

from __future__ import annotations

import time
from collections.abc import Callable

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
from engine_models.reference_model import CRANK, mechanism_of
from engine_models.scene import Clearance, Scene
from engine_models.start_check import checked_start
from reference_solver.equations import row_slices
from reference_solver.errors import FrictionTooStiff
from reference_solver.solution import Solution
from reference_solver.solver import Solver, Stabilisation, StepChoice

#: Runs tried with ever shorter steps, each this part of what friction needed in the one before.
MOST_TRIES, ROOM = 5, 0.8

#: Steps of contacts, and events on rigid walls, after which their pace is judged: some seconds; and events
#: that there is no time for.
LOOK_UP_STEPS, LOOK_UP_EVENTS, MOST_EVENTS = 2_000_000, 2_000, 1e8


def reference_run(
    scene: Scene, settings: RunSettings, choice: StepChoice, stabilisation: Stabilisation, compiled: bool
) -> Trajectory:
    """Run a scene; with shorter steps where friction on rigid walls needs them.

    Samples denser than the steps asked for do not shorten those whose events are located: they are
    interpolated (see ``solver.solve``).

    Raises:
        FrictionTooStiff: it still needs shorter ones after ``MOST_TRIES``.
    """
    if (
        scene.joints_with_clearance
        and choice.locate_events
        and settings.steps_per_sample(scene.end_time_s) == 1
    ):
        choice = choice.at(settings.step_s)
    for _ in range(MOST_TRIES):
        try:
            return _run(scene, settings, choice, stabilisation, compiled)
        except FrictionTooStiff as stiff:
            if stiff.needed_s * MOST_STEPS < scene.end_time_s:
                raise too_slow(scene, f"steps of {stiff.needed_s:.3g} s") from stiff
            choice = choice.at(ROOM * stiff.needed_s)
    return _run(scene, settings, choice, stabilisation, compiled)


def _run(
    scene: Scene, settings: RunSettings, choice: StepChoice, stabilisation: Stabilisation, compiled: bool
) -> Trajectory:
    """Run a scene; the joints' forces on rigid walls are those of following, without impulses.

    The solve time includes the making of kernels for pins that follow rigid walls, one for every set of them
    that occurs.
    """
    q, v = (part.ravel() for part in checked_start(scene))
    solver = Solver(mechanism_of(scene), q, choice, stabilisation, compiled)
    started = time.perf_counter()
    run = solver.run(q, v, scene.end_time_s, settings.samples, _watch(scene, solver))
    solve_time = time.perf_counter() - started
    offsets = run.gap_m
    contacts = {
        name: _contact(getattr(scene.clearance, name), run, k, offsets[:, k])
        for k, name in enumerate(scene.joints_with_clearance)
    }
    trajectory = _trajectory(scene, run, contacts, choice.longest_s, solve_time, stabilisation != "none")
    force = run.joint_force_N
    for k, name in enumerate(contacts):
        trajectory.joint_force_N[:, JOINTS.index(name)] = force[:, k]
    return trajectory


def _watch(scene: Scene, solver: Solver) -> Callable[[float], None]:
    """Return what tells how far a run has come, and ends one whose steps, or events, have collapsed."""
    if not scene.joints_with_clearance:
        return tell
    judges = [
        _judge(scene, lambda: solver.steps, LOOK_UP_STEPS, MOST_STEPS),
        _judge(scene, lambda: solver.settled, LOOK_UP_EVENTS, MOST_EVENTS),
    ]

    def watch(t: float) -> None:
        tell(t)
        for judge in judges:
            judge(t)

    return watch


def _judge(scene: Scene, done: Callable[[], int], outlasting: int, most: float) -> Callable[[float], None]:
    """Return what ends a run that does too much: more outlasts any contact, the most takes too long."""
    judged, judged_s = 0, 0.0

    def judge(t: float) -> None:
        nonlocal judged, judged_s
        since = done() - judged
        if since >= outlasting:
            require_pace(scene, t, t - judged_s, since, most)
            judged, judged_s = judged + since, t

    return judge


def _contact(clearance: Clearance, run: Solution, k: int, gap: FloatArray) -> Contact:
    penetration = np.hypot(gap[:, 0], gap[:, 1]) - clearance.radial_clearance_m
    rigid = clearance.law == "rigid"
    mine = run.impacts_of(k)
    return Contact(
        gap_m=gap,
        penetration_m=penetration,
        normal_force_N=run.normal_force_N[:, k],
        friction_force_N=run.friction_force_N[:, k] if clearance.friction else None,
        elastic_energy_J=np.zeros(len(gap)) if rigid else elastic_energy_J(clearance, penetration),
        normal_impulse_N_s=run.sums[f"normal{k}"],
        normal_loss_J=run.sums[f"impact{k}"] + run.sums[f"closing{k}"] if rigid else run.sums[f"loss{k}"],
        friction_loss_J=run.sums.get(f"slide{k}"),
        clipped_loss_J=run.sums.get(f"clip{k}"),
        impacts=Impacts(
            time_s=np.array([impact.time_s for impact in mine]),
            duration_s=np.array([impact.duration_s for impact in mine]),
            approach_speed_m_s=np.array([impact.approach_speed_m_s for impact in mine]),
            normal_impulse_N_s=np.array([impact.normal_impulse_N_s for impact in mine]),
            energy_lost_J=np.array([impact.energy_lost_J for impact in mine]),
        ),
    )


def _trajectory(
    scene: Scene,
    solution: Solution,
    contacts: dict[str, Contact],
    step: float,
    solve_time: float,
    stabilised: bool,
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
        steps=solution.steps,
        solve_time_s=solve_time,
        contacts=contacts,
        stabilisation_loss_J=solution.stabilisation_loss_J if stabilised else None,
    )
