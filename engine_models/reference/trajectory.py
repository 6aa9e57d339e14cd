"""A solution of the reference's equations as a trajectory: its rows and contacts by joint."""

from dataclasses import fields

import numpy as np

from engine_models.engine import JOINTS, Contact, FloatArray, Impacts, Trajectory
from engine_models.mechanics.joints import clearances
from engine_models.mechanics.trajectory import contact_of, trajectory_of
from engine_models.reference.model import loads_of
from engine_models.scene.scene import Clearance, Scene
from reference_solver.equations import row_slices
from reference_solver.solution import Solution


def trajectory_of_solution(
    scene: Scene, solution: Solution, step_s: float, solve_time_s: float, stabilised: bool
) -> Trajectory:
    """Return the trajectory at the solution's samples."""
    multipliers, joint_names = solution.multipliers, scene.joints_with_clearance
    rows_of = row_slices(solution.mechanism)
    joint_force = np.zeros((len(multipliers), len(scene.joints), 2))
    ideal = [name for name in scene.joints if name not in joint_names]
    for name, rows in zip(ideal, rows_of, strict=False):
        joint_force[:, JOINTS.index(name)] = multipliers[:, rows]
    for name, force in zip(joint_names, np.moveaxis(solution.joint_force_N, 1, 0), strict=True):
        joint_force[:, JOINTS.index(name)] = force
    position = solution.q.reshape(len(multipliers), -1, 3)
    work, works = None, _works_of_loads(scene, solution)
    if scene.speed_is_prescribed:
        work = solution.constraint_work_J
    elif scene.drive.kind == "motor":
        work = works["drive"]
    return trajectory_of(
        scene,
        time_s=solution.time_s,
        position=position,
        velocity=solution.v.reshape(position.shape),
        joint_force_N=joint_force,
        guide_normal_force_N=multipliers[:, rows_of[len(ideal)].start] if scene.is_crank_slider else None,
        driver_torque_N_m=multipliers[:, -1] if scene.speed_is_prescribed else None,
        driver_work_J=work,
        step_s=step_s,
        steps=solution.steps,
        solve_time_s=solve_time_s,
        contacts={
            name: _contact(clearance, solution, k)
            for k, (name, clearance) in enumerate(clearances(scene).items())
        },
        stabilisation_loss_J=solution.stabilisation_loss_J if stabilised else None,
        load_work_J=works,
    )


def _works_of_loads(scene: Scene, solution: Solution) -> dict[str, FloatArray]:
    """Return the works that the solution has integrated, by the names of ``loads_of``."""
    names = {f"load{k}": name for k, name in enumerate(loads_of(scene))}
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
