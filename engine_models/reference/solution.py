"""A scene as a mechanism of the reference's equations, and their solution as a trajectory."""

from dataclasses import fields

import numpy as np

from engine_models.engine import Contact, Impacts, SimulationFailed, Trajectory
from engine_models.mechanics.energy import elastic_energy_J
from engine_models.mechanics.forces import integrals_of, load_forces, works_J
from engine_models.mechanics.trajectory import reactions_of
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from reference_solver.mechanism import mechanism
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Solution


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
