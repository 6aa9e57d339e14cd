"""A finished run as a trajectory: forces and contacts from the states at its samples."""

import numpy as np

from engine_models.contact_stiffness import elastic_energy_J
from engine_models.engine import JOINTS, Contact, Trajectory
from engine_models.reference_scipy import Derivative
from engine_models.scene import Scene
from engine_models.scipy_record import Record


def trajectory_of(
    scene: Scene,
    derivative: Derivative,
    record: Record,
    longest_step_s: float,
    steps: int,
    solve_time_s: float,
) -> Trajectory:
    """Return the trajectory at the record's s samples."""
    y = np.array(record.y)
    time = np.linspace(0.0, scene.end_time_s, len(y))
    rows, states = [], []
    for t, at, phases in zip(time, y, record.phases, strict=True):
        derivative.set_phases(phases)
        rows.append(derivative.multipliers(t, at))
        states.append(derivative.contacts(at))
    multipliers = np.array(rows)
    position = y[:, : derivative.n].reshape(len(y), -1, 3)
    sums = derivative.named_sums(y)
    # Rows of [B] are those of the ideal joints O, A, B, then the guide (force and moment), then the driver.
    joint_force = np.zeros((len(y), len(scene.joints), 2))
    ideal = [name for name in scene.joints if name not in scene.joints_with_clearance]
    for k, name in enumerate(ideal):
        joint_force[:, JOINTS.index(name)] = multipliers[:, 2 * k : 2 * k + 2]
    contacts = {}
    for k, name in enumerate(scene.joints_with_clearance):
        at_joint = [at_sample[k] for at_sample in states]
        joint_force[:, JOINTS.index(name)] = [state.force_on_pin_N for state in at_joint]
        penetration = np.array([state.penetration_m for state in at_joint])
        clearance = getattr(scene.clearance, name)
        friction = [state.friction_force_N for state in at_joint]
        contacts[name] = Contact(
            gap_m=np.array([state.gap_m for state in at_joint]),
            penetration_m=penetration,
            normal_force_N=np.array([state.normal_force_N for state in at_joint]),
            friction_force_N=np.array(friction) if clearance.friction else None,
            elastic_energy_J=elastic_energy_J(clearance, penetration),
            normal_impulse_N_s=sums[f"normal{k}"],
            normal_loss_J=sums[f"loss{k}"],
            friction_loss_J=sums.get(f"slide{k}"),
            clipped_loss_J=sums.get(f"clip{k}"),
            impacts=record.impacts(k),
        )
    torque, work = None, sums.get("work")
    if scene.drive.kind == "constant-speed":
        torque = multipliers[:, -1]
    elif scene.drive.kind == "torque":
        torque = np.full(len(y), scene.drive.torque_N_m)
        work = torque * (position[:, 0, 2] - position[0, 0, 2])
    return Trajectory(
        time_s=time,
        position=position,
        velocity=y[:, derivative.n : 2 * derivative.n].reshape(position.shape),
        joint_force_N=joint_force,
        guide_normal_force_N=multipliers[:, 2 * len(ideal)] if scene.is_crank_slider else None,
        driver_torque_N_m=torque,
        driver_work_J=work,
        step_s=longest_step_s,
        steps=steps,
        solve_time_s=solve_time_s,
        contacts=contacts,
    )
