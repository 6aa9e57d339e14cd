"""A scene as a mechanism of the reference's equations, and their solution as a trajectory."""

from dataclasses import fields

import numpy as np

from engine_models.engine import Contact, FloatArray, Impacts, SimulationFailed, Trajectory
from engine_models.mechanics.trajectory import contact_of, trajectory_of
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from reference_solver.mechanism import mechanism
from reference_solver.mechanism.constraints import row_slices
from reference_solver.mechanism.mechanism import Mechanism, loads_of
from reference_solver.solution import Solution


def mechanism_of(scene: Scene) -> Mechanism:
    """Return the mechanism; a joint with clearance has no rows, and is a contact.

    Raises:
        SimulationFailed: the stiffness of a contact overflows.
    """
    try:
        return mechanism.mechanism_of(scene.mechanism)
    except OverflowError as reason:
        raise SimulationFailed(str(reason)) from None


def trajectory_of_solution(
    scene: Scene, solution: Solution, step_s: float, solve_time_s: float, stabilised: bool
) -> Trajectory:
    """Return the trajectory at the solution's samples."""
    multipliers, of = solution.multipliers, scene.mechanism
    rows = iter(row_slices(solution.mechanism.constraints, solution.q.shape[1]))
    forces, contacts = dict[str, FloatArray](), dict[str, Contact]()
    for pin in of.ideal:
        forces[pin.name] = multipliers[:, next(rows)]
    for k, pin in enumerate(of.loose):  # the force on the pin, which is on body j unless its bearing is
        force = solution.joint_force_N[:, k]
        forces[pin.name] = -force if pin.bearing_on_j else force
        contacts[pin.name] = _contact(scene.clearances[pin.name], solution, k)
    normal, moment = dict[str, FloatArray](), dict[str, FloatArray]()
    for guide in of.guides:
        first = next(rows).start
        normal[guide.name] = multipliers[:, first]
        if not guide.turns:
            moment[guide.name] = multipliers[:, first + 1]
    position, works = solution.q.reshape(len(multipliers), -1, 3), _works_of_loads(scene, solution)
    prescribed = of.drive.prescribes
    work = solution.constraint_work_J if prescribed else works.pop("drive", None)
    return trajectory_of(
        scene,
        time_s=solution.time_s,
        position=position,
        velocity=solution.v.reshape(position.shape),
        joint_force_N={pin.name: forces[pin.name] for pin in of.pins},
        guide_force_N=normal,
        guide_moment_N_m=moment,
        driver_torque_N_m=multipliers[:, -1] if prescribed else None,
        driver_work_J=work,
        step_s=step_s,
        steps=solution.steps,
        solve_time_s=solve_time_s,
        contacts=contacts,
        stabilisation_loss_J=solution.stabilisation_loss_J if stabilised else None,
        load_work_J=works,
    )


def _works_of_loads(scene: Scene, solution: Solution) -> dict[str, FloatArray]:
    """Return the works that the solution has integrated, by the names of ``loads_of``."""
    short = "slider." if scene.is_short else ""
    names = {f"load{k}": name.removeprefix(short) for k, name in enumerate(loads_of(scene.mechanism))}
    return {names[sum_]: work for sum_, work in solution.sums.items() if sum_ in names}


def _contact(clearance: Clearance, solution: Solution, k: int) -> Contact:
    """Return what contact k of a solution did."""
    sums, impacts = solution.sums, solution.impacts_of(k)
    rigid = clearance.law == "rigid"
    columns = {
        column.name: np.array([getattr(impact, column.name) for impact in impacts])
        for column in fields(Impacts)
    }
    return contact_of(
        clearance,
        solution.gap_m[:, k],
        normal_force_N=solution.normal_force_N[:, k],
        friction_force_N=solution.friction_force_N[:, k],
        normal_impulse_N_s=sums[f"normal{k}"],
        normal_loss_J=sums[f"impact{k}"] + sums[f"closing{k}"] if rigid else sums[f"loss{k}"],
        friction_loss_J=sums.get(f"slide{k}"),
        clipped_loss_J=sums.get(f"clip{k}"),
        impacts=Impacts(**columns),
    )
