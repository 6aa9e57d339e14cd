"""A solution of the reference's equations as a trajectory: its rows and contacts by joint."""

import numpy as np

from engine_models.engine import JOINTS, Contact, FloatArray, Impacts, Trajectory
from engine_models.mechanics.energy import elastic_energy_J
from engine_models.reference.model import CRANK
from engine_models.scene.scene import Clearance, Scene
from reference_solver.equations import row_slices
from reference_solver.solution import Solution


def trajectory_of(
    scene: Scene, solution: Solution, step_s: float, solve_time_s: float, stabilised: bool
) -> Trajectory:
    """Return the trajectory at the solution's samples."""
    multipliers, joint_names = solution.multipliers, scene.joints_with_clearance
    gap, rows_of = solution.gap_m, row_slices(solution.mechanism)
    joint_force = np.zeros((len(multipliers), len(scene.joints), 2))
    ideal = [name for name in scene.joints if name not in joint_names]
    for name, rows in zip(ideal, rows_of, strict=False):
        joint_force[:, JOINTS.index(name)] = multipliers[:, rows]
    for name, force in zip(joint_names, np.moveaxis(solution.joint_force_N, 1, 0), strict=True):
        joint_force[:, JOINTS.index(name)] = force
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
        guide_normal_force_N=multipliers[:, rows_of[len(ideal)].start] if scene.is_crank_slider else None,
        driver_torque_N_m=torque,
        driver_work_J=work,
        step_s=step_s,
        steps=solution.steps,
        solve_time_s=solve_time_s,
        contacts={
            name: _contact(getattr(scene.clearance, name), solution, k, gap[:, k])
            for k, name in enumerate(joint_names)
        },
        stabilisation_loss_J=solution.stabilisation_loss_J if stabilised else None,
    )


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
