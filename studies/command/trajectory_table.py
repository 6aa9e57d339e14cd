"""A trajectory as the tables that ``crankslider simulate`` writes: fixed columns in a fixed order."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, Impacts, Trajectory
from engine_models.mechanics.loads import load_forces
from engine_models.mechanics.states import observed
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from studies.judges.energy_ledger import load_works
from studies.judges.metrics import energy_balance_residual_J, kinetic_energy_J, potential_energy_J

#: Kinds of drives whose work has a column, because it is not the product of two others.
OF_TIME = ("ramp", "fluctuating", "table", "motor")


def sample_columns(scene: AnyScene, trajectory: Trajectory) -> dict[str, FloatArray]:
    """Return columns with a value for each sample; columns that do not apply to the scene are absent.

    Names contain the unit. A joint force acts on the body named later, that further from the crank pivot; the
    guide's force on the slider is to the left of the guide's direction.
    """
    if isinstance(scene, Scene):
        columns = _motion_of_crank(scene, trajectory)
    else:
        columns = {"time_s": trajectory.time_s, **_observed(scene, trajectory), **_motion(scene, trajectory)}
    for joint, force in zip(scene.joints, trajectory.joint_force_N.swapaxes(0, 1), strict=True):
        columns |= {f"joint_{joint}_force_x_N": force[:, 0], f"joint_{joint}_force_y_N": force[:, 1]}
    if trajectory.guide_normal_force_N is not None:
        columns["guide_normal_force_N"] = trajectory.guide_normal_force_N
    if trajectory.driver_torque_N_m is not None:
        along = scene.mechanism.drive.guide is not None
        columns["driver_force_N" if along else "driver_torque_N_m"] = trajectory.driver_torque_N_m
    columns |= _forces_of_loads(scene, trajectory)
    columns |= _energies(scene, trajectory)
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


def _motion_of_crank(scene: Scene, run: Trajectory) -> dict[str, FloatArray]:
    """Return times, the crank's motion and the slider's along its guide."""
    columns = {
        "time_s": run.time_s,
        "crank_angle_rad": run.position[:, 0, 2],
        "crank_speed_rad_s": run.velocity[:, 0, 2],
    }
    if scene.is_crank_slider:
        columns["slider_position_m"], columns["slider_velocity_m_s"] = observed(scene, run)
    return columns


def _observed(scene: AnyScene, run: Trajectory) -> dict[str, FloatArray]:
    """Return what the scene observes, and its rate: ``observed_B_x_m``, ``observed_rocker_angle_rad``."""
    (value, rate), of = observed(scene, run), scene.observed
    name = f"observed_{of.name.replace('.', '_')}"
    return {f"{name}_{of.unit}": value, f"{name}_velocity_{of.unit}_s": rate}


def _motion(scene: AnyScene, run: Trajectory) -> dict[str, FloatArray]:
    """Return place, angle and their rates of every body's centre of mass."""
    columns = dict[str, FloatArray]()
    for k, body in enumerate(scene.mechanism.names):
        x, v = run.position[:, k], run.velocity[:, k]
        columns |= {f"{body}_x_m": x[:, 0], f"{body}_y_m": x[:, 1], f"{body}_angle_rad": x[:, 2]}
        columns |= {f"{body}_velocity_x_m_s": v[:, 0], f"{body}_velocity_y_m_s": v[:, 1]}
        columns[f"{body}_speed_rad_s"] = v[:, 2]
    return columns


def _forces_of_loads(scene: AnyScene, run: Trajectory) -> dict[str, FloatArray]:
    """Return the forces of loads along their lines: ``slider_gas_force_N``."""
    forces = load_forces(scene.mechanism, run.time_s, run.position, run.velocity)
    return {f"{name.replace('.', '_')}_force_N": force for name, force in forces.items()}


def _energies(scene: AnyScene, run: Trajectory) -> dict[str, FloatArray]:
    """Return energies and works."""
    columns = {"kinetic_energy_J": kinetic_energy_J(scene, run)}
    of = scene.mechanism
    if any(of.gravity_m_s2) or run.contacts or of.springs:  # a contact stores elastic energy
        columns["potential_energy_J"] = potential_energy_J(scene, run)
    is_product = scene.driven_by.kind not in OF_TIME and isinstance(scene, Scene) and scene.is_plain
    if run.driver_work_J is not None and (run.load_work_J or not is_product):
        columns["driver_work_J"] = run.driver_work_J
    columns |= load_works(run)
    columns["energy_balance_residual_J"] = energy_balance_residual_J(scene, run)
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
