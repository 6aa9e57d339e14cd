"""A run's motion and forces as a ``Trajectory``, and what a joint with clearance did as a ``Contact``."""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import Contact, FloatArray, Impacts, Trajectory
from engine_models.mechanics.energy import elastic_energy_J
from engine_models.mechanics.loads import drive_torque, parts_of
from engine_models.mechanics.states import way
from engine_models.scene.format import Clearance
from engine_models.scene.scene import Scene
from reference_solver.mechanism.contacts import clips
from reference_solver.mechanism.data import Torque


def trajectory_of(
    scene: Scene,
    *,
    time_s: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    joint_force_N: Mapping[str, FloatArray],
    guide_force_N: Mapping[str, FloatArray],
    guide_moment_N_m: Mapping[str, FloatArray],
    driver_torque_N_m: FloatArray | None = None,
    driver_work_J: FloatArray | None = None,
    step_s: float,
    steps: int,
    solve_time_s: float,
    contacts: Mapping[str, Contact] | None = None,
    stabilisation_loss_J: FloatArray | None = None,
    load_work_J: Mapping[str, FloatArray] | None = None,
) -> Trajectory:
    """Return the trajectory at samples (n,) from t = 0 to the scene's end.

    Torque and work of a driver that prescribes the speed are taken as given, (n,) each, and so are a motor's
    work and those of the load that are integrals; the others are the scene's, and what there is not, is None.
    """
    torque, work = driver_torque_N_m, driver_work_J
    drive = scene.mechanism.drive
    if not drive.prescribes:
        torque = drive_torque(drive, time_s, velocity)
        if torque is None:
            work = None
        elif isinstance(drive.law, Torque) and isinstance(drive.law.torque_N_m, float):
            angle = position[:, drive.body, 2]
            work = drive.law.torque_N_m * (angle - angle[0])
    return Trajectory(
        time_s=time_s,
        position=position,
        velocity=velocity,
        joint_force_N=joint_force_N,
        guide_force_N=guide_force_N,
        guide_moment_N_m=guide_moment_N_m,
        driver_torque_N_m=torque,
        driver_work_J=work,
        step_s=step_s,
        steps=steps,
        solve_time_s=solve_time_s,
        contacts=contacts or {},
        stabilisation_loss_J=stabilisation_loss_J,
        load_work_J=load_works_J(scene, position, load_work_J or {}),
    )


def load_works_J(
    scene: Scene, position: FloatArray, integrated: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return the work of each part of the loads since the first of positions (n, bodies, 3), (n,).

    Those of forces and torques without a potential are given, and what springs' dampers take.
    """
    of, works, at_rest = scene.mechanism, dict[str, FloatArray](), np.zeros_like(position)
    short = "slider." if scene.is_short else ""
    for load in of.loads:
        exact, body = dict[str, FloatArray](), of.bodies[load.body].name
        if load.line is not None:
            s, _ = way(load.line, position, at_rest)
            gone, middle = s - s[0], (s + s[0]) / 2
            exact["force"] = load.force_N * gone
            exact["spring"] = -load.spring_N_m * gone * (middle - load.free_position_m)
        angle = position[:, load.body, 2]
        exact["torque"] = load.torque_N_m * (angle - angle[0])
        for part in parts_of(load):
            name = f"{body}.{part}".removeprefix(short)
            works[name] = exact[part] if part in exact else integrated[name]
    return works | {name: work for name, work in integrated.items() if name.startswith("spring:")}


def contact_of(
    clearance: Clearance,
    gap_m: FloatArray,
    *,
    normal_force_N: FloatArray,
    friction_force_N: FloatArray,
    normal_impulse_N_s: FloatArray,
    normal_loss_J: FloatArray,
    friction_loss_J: FloatArray | None,
    clipped_loss_J: FloatArray | None,
    impacts: Impacts,
) -> Contact:
    """Return what a joint with clearance did, from its gap (n, 2), forces and sums, (n,) each.

    What friction and clipping there may be in them is left out where the clearance has none.
    """
    has_friction = clearance.friction is not None
    penetration = np.hypot(*gap_m.T) - clearance.radial_clearance_m
    return Contact(
        gap_m=gap_m,
        penetration_m=penetration,
        normal_force_N=normal_force_N,
        friction_force_N=friction_force_N if has_friction else None,
        elastic_energy_J=elastic_energy_J(clearance, penetration),
        normal_impulse_N_s=normal_impulse_N_s,
        normal_loss_J=normal_loss_J,
        friction_loss_J=friction_loss_J if has_friction else None,
        clipped_loss_J=clipped_loss_J if clips(clearance) else None,
        impacts=impacts,
    )
