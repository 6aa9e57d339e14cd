"""A trajectory as the tables that ``crankslider simulate`` writes: fixed columns in a fixed order."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, Impacts, Trajectory
from engine_models.mechanics.slider_load import slider_forces
from engine_models.scene.scene import Scene
from studies.judges.energy_ledger import load_works
from studies.judges.metrics import energy_balance_residual_J, kinetic_energy_J, potential_energy_J

#: Kinds of drives whose work has a column, because it is not the product of two others.
OF_TIME = ("ramp", "fluctuating", "table", "motor")


def sample_columns(scene: Scene, trajectory: Trajectory) -> dict[str, FloatArray]:
    """Return columns with a value for each sample; columns that do not apply to the scene are absent.

    Names contain the unit. A joint force acts on the body further from the crank pivot, the guide force on
    the slider along +y.
    """
    columns = {
        "time_s": trajectory.time_s,
        "crank_angle_rad": trajectory.position[:, 0, 2],
        "crank_speed_rad_s": trajectory.velocity[:, 0, 2],
    }
    if scene.is_crank_slider:
        columns["slider_position_m"] = trajectory.slider_position_m
        columns["slider_velocity_m_s"] = trajectory.slider_velocity_m_s
    for joint, force in zip(scene.joints, trajectory.joint_force_N.swapaxes(0, 1), strict=True):
        columns |= {f"joint_{joint}_force_x_N": force[:, 0], f"joint_{joint}_force_y_N": force[:, 1]}
    if trajectory.guide_normal_force_N is not None:
        columns["guide_normal_force_N"] = trajectory.guide_normal_force_N
    if trajectory.driver_torque_N_m is not None:
        columns["driver_torque_N_m"] = trajectory.driver_torque_N_m
    forces = slider_forces(scene, trajectory.position, trajectory.velocity)
    columns |= {f"slider_{part}_force_N": force for part, force in forces.items()}
    columns["kinetic_energy_J"] = kinetic_energy_J(scene, trajectory)
    if scene.gravity_m_s2 > 0 or trajectory.contacts:  # a contact stores elastic energy
        columns["potential_energy_J"] = potential_energy_J(scene, trajectory)
    if trajectory.driver_work_J is not None and (trajectory.load_work_J or scene.drive.kind in OF_TIME):
        columns["driver_work_J"] = trajectory.driver_work_J
    columns |= load_works(trajectory)
    columns["energy_balance_residual_J"] = energy_balance_residual_J(scene, trajectory)
    for joint, contact in trajectory.contacts.items():
        columns |= {
            f"clearance_{joint}_x_m": contact.gap_m[:, 0],
            f"clearance_{joint}_y_m": contact.gap_m[:, 1],
        }
        columns[f"contact_{joint}_penetration_m"] = contact.penetration_m
        columns[f"contact_{joint}_normal_force_N"] = contact.normal_force_N
        if contact.friction_force_N is not None:
            columns[f"contact_{joint}_friction_force_N"] = contact.friction_force_N
    if trajectory.dissipated_energy_J is not None:
        columns["dissipated_energy_J"] = trajectory.dissipated_energy_J
    return columns


def impact_columns(contacts: Mapping[str, Contact]) -> dict[str, NDArray[Any]]:
    """Return columns with a value for each impact, in the order of time: joint and fields of ``Impacts``.

    Columns without numbers are absent.
    """
    impacts = {joint: contact.impacts for joint, contact in contacts.items()}
    counts = [len(each.time_s) for each in impacts.values()]
    columns: dict[str, NDArray[Any]] = {"joint": np.repeat(np.array(list(impacts), dtype=str), counts)}
    for field in fields(Impacts):
        columns[field.name] = np.concatenate([[], *(getattr(each, field.name) for each in impacts.values())])
    order = np.argsort(columns["time_s"], kind="stable")
    return {
        name: values[order]
        for name, values in columns.items()
        if name == "joint" or not len(values) or not np.isnan(values).all()
    }
