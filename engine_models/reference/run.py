"""Runs of the reference solver: a scene as its mechanism, and the solution as a trajectory."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields

import numpy as np

from engine_models.engine import Contact, Impacts, RunSettings, SimulationFailed, Trajectory
from engine_models.mechanics.energy import elastic_energy_J
from engine_models.mechanics.forces import integrals_of, load_forces, works_J
from engine_models.mechanics.start import checked_start
from engine_models.mechanics.trajectory import reactions_of
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from engine_models.watch import MOST_STEPS, Pace, tell, too_slow
from reference_solver.energy import scales_of
from reference_solver.equations import Equations
from reference_solver.failures import FrictionTooStiff, Stalled
from reference_solver.mechanism import mechanism
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Solution
from reference_solver.solver import ErrorControl, Solver, Stabilisation, StepChoice, check_start

#: Steps of contacts, and events on rigid walls, after which their pace is judged: some seconds; and events
#: that there is no time for. A step in a jam of friction is tried up to sixty times: where a limit is set,
#: this part of the steps is enough.
LOOK_UP_STEPS, LOOK_UP_EVENTS, MOST_EVENTS, LIMITED = 2_000_000, 2_000, 1e8, 0.1
#: The turn in a step, at the mechanism's own rate, for which steps per contact are given: 0.3 degrees.
TURN_OF_STEP_RAD = math.pi / 600


def rate_s(scene: Scene) -> float:
    """Return the mechanism's own rate at the start in 1/s (see ``reference_solver.energy``).

    Raises:
        SingularConfiguration: there are no accelerations.
        SimulationFailed: see ``checked_start``.
    """
    q, v = (part.ravel() for part in checked_start(scene))
    of = mechanism_of(scene)
    accelerations = Equations(of, q).required(0.0, q, v).accelerations
    return scales_of(of, q, v, accelerations, scene.end_time_s).rate_s


def reference_run(
    scene: Scene,
    settings: RunSettings,
    choice: StepChoice | ErrorControl,
    stabilisation: Stabilisation,
    most_steps: float,
) -> Trajectory:
    """Run a scene, in no more steps than ``most_steps`` by the pace that it comes to.

    The joints' forces on rigid walls are those of following, without impulses. The solve time is that of the
    compiled loops; kernels are made outside it.

    Raises:
        SolverError: as the solver does.
        SimulationFailed: the steps are too short to come to an end; it says which field forces them.
    """
    q, v = (part.ravel() for part in checked_start(scene))
    of = mechanism_of(scene)
    check_start(of, q, v)
    solver = Solver(of, q, choice, stabilisation)
    try:
        watch, times_s = _watch(scene, solver, most_steps), settings.times_s(scene)
        solution = solver.run(q, v, scene.end_time_s, settings.samples, watch, times_s)
    except Stalled as stalled:
        spacing_s = math.ulp(stalled.time_s)
        raise too_slow(spacing_s, f" or less at t = {stalled.time_s:.6g} s") from stalled
    except FrictionTooStiff as stiff:
        raise too_slow(stiff.needed_s) from stiff
    stabilised = stabilisation != "none"
    return trajectory_of_solution(scene, solution, choice.longest_s, stabilised)


def _watch(scene: Scene, solver: Solver, most_steps: float) -> Callable[[float], None]:
    """Return what tells how far a run has come, and ends one whose steps, or events, have collapsed."""
    if not scene.clearances and most_steps >= MOST_STEPS:
        return tell
    look_up = LOOK_UP_STEPS if most_steps >= MOST_STEPS else int(LIMITED * LOOK_UP_STEPS)
    steps, events = Pace(scene, look_up, most_steps), Pace(scene, LOOK_UP_EVENTS, MOST_EVENTS)

    def watch(t: float) -> None:
        tell(t)
        steps.judge(t, solver.steps)
        events.judge(t, solver.settled)

    return watch


def mechanism_of(scene: Scene) -> Mechanism:
    """Return the mechanism; a joint with clearance has no rows, and is a contact.

    Raises:
        SimulationFailed: the stiffness of a contact overflows.
    """
    try:
        return mechanism.mechanism_of(scene.mechanism)
    except OverflowError as reason:
        raise SimulationFailed(str(reason)) from None


def trajectory_of_solution(scene: Scene, solution: Solution, step_s: float, stabilised: bool) -> Trajectory:
    """Return the trajectory at the solution's samples."""
    multipliers, of = solution.multipliers, scene.mechanism
    contacts = {pin.name: _contact(scene.clearances[pin.name], solution, k) for k, pin in enumerate(of.loose)}
    position = solution.q.reshape(len(multipliers), -1, 3)
    velocity = solution.v.reshape(position.shape)
    torque = load_forces(of, solution.time_s, position, velocity).get("drive")  # of one that is no row
    integrals = {name: solution.sums[sum_] for sum_, name in integrals_of(scene).items()}
    works = works_J(scene, position, integrals)
    return Trajectory(
        **vars(reactions_of(of, multipliers, contacts, torque)),
        time_s=solution.time_s,
        position=position,
        velocity=velocity,
        driver_work_J=works.pop("driver", None),
        step_s=step_s,
        steps=solution.steps,
        solve_time_s=solution.solve_time_s,
        contacts=contacts,
        stabilisation_loss_J=solution.sums["removed"] if stabilised else None,
        load_work_J=works,
    )


def _contact(clearance: Clearance, solution: Solution, k: int) -> Contact:
    """Return what contact k of a solution did."""
    sums, impacts = solution.sums, [impact for impact in solution.impacts if impact.contact == k]
    rigid = clearance.law == "rigid"
    columns = {it.name: np.array([getattr(impact, it.name) for impact in impacts]) for it in fields(Impacts)}
    penetration = np.hypot(*solution.gap_m[:, k].T) - clearance.radial_clearance_m
    return Contact(
        gap_m=solution.gap_m[:, k],
        penetration_m=penetration,
        normal_force_N=solution.normal_force_N[:, k],
        friction_force_N=None if clearance.friction is None else solution.friction_force_N[:, k],
        elastic_energy_J=elastic_energy_J(clearance, penetration),
        normal_impulse_N_s=sums[f"normal{k}"],
        normal_loss_J=sums[f"impact{k}"] + sums[f"closing{k}"] if rigid else sums[f"loss{k}"],
        friction_loss_J=sums.get(f"slide{k}"),
        clipped_loss_J=sums.get(f"clip{k}"),
        impacts=Impacts(**columns),
    )
