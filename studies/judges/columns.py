"""A trajectory as the tables that ``crankslider simulate`` writes: fixed columns in a fixed order."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import Contact, FloatArray, Impacts, Trajectory
from engine_models.mechanics.forces import accelerations, along_lines, load_forces, on_ground
from engine_models.mechanics.states import direction, guide_column, observed_columns, point_motion, way
from engine_models.scene.scene import Scene
from studies.judges.energy_ledger import load_works
from studies.judges.metrics import energy_balance_residual_J, kinetic_energy_J, potential_energy_J

CRANK, ROD, SLIDER = range(3)
#: Kinds of drives whose work has a column, because it is not the product of two others.
OF_TIME = ("ramp", "fluctuating", "table", "motor")


def sample_columns(scene: Scene, trajectory: Trajectory) -> dict[str, FloatArray]:
    """Return columns with a value for each sample; columns that do not apply to the scene are absent.

    Names contain the unit. A joint force acts on the body named later, that further from the crank pivot; a
    guide's on its body, to the left of the guide's direction. A spring's force pulls its ends together.
    """
    of, run = scene.mechanism, trajectory
    forces, moving = load_forces(of, run.time_s, run.position, run.velocity), accelerations(scene, run)
    columns = {"time_s": run.time_s}
    columns |= _crank_slider(scene, run) if scene.is_short else _bodies(scene, run, moving)
    for joint, force in run.joint_force_N.items():
        columns |= {f"joint_{joint}_force_x_N": force[:, 0], f"joint_{joint}_force_y_N": force[:, 1]}
    columns |= _guides(scene, run)
    if run.driver_torque_N_m is not None:
        turns = of.drive.guide is None
        columns["driver_torque_N_m" if turns else "driver_force_N"] = run.driver_torque_N_m
    columns |= {f"{name.replace('.', '_')}_force_N": forces[name] for name in along_lines(of)}
    columns |= {f"spring_{spring.name}_force_N": forces[f"spring:{spring.name}"] for spring in of.springs}
    for it in of.torsions:
        damper = forces.get(f"torsion:{it.name}", 0.0)
        columns[f"torsion_{it.name}_torque_N_m"] = forces[f"torsion:{it.name}.spring"] + damper
    columns |= _energies(scene, run)
    for joint, contact in run.contacts.items():
        columns |= {
            f"clearance_{joint}_x_m": contact.gap_m[:, 0],
            f"clearance_{joint}_y_m": contact.gap_m[:, 1],
        }
        columns[f"contact_{joint}_penetration_m"] = contact.penetration_m
        columns[f"contact_{joint}_normal_force_N"] = contact.normal_force_N
        if contact.friction_force_N is not None:
            columns[f"contact_{joint}_friction_force_N"] = contact.friction_force_N
    if run.dissipated_energy_J is not None:
        columns["dissipated_energy_J"] = run.dissipated_energy_J
    if scene.is_short and "rod" in scene.body:
        forward, _ = direction(of.guides[0], run.position)
        columns["slider_acceleration_m_s2"] = np.sum(forward * moving[:, SLIDER, :2], axis=1)
        columns |= {"rod_angle_rad": run.position[:, ROD, 2], "rod_speed_rad_s": run.velocity[:, ROD, 2]}
    names = "ground_force_x_N", "ground_force_y_N", "ground_moment_N_m"
    return columns | dict(zip(names, on_ground(scene, run, moving).T, strict=True))


def _crank_slider(scene: Scene, run: Trajectory) -> dict[str, FloatArray]:
    """Return the crank's motion, and the slider's along its guide, or that of a pendulum's pin A."""
    columns = {"crank_angle_rad": run.position[:, CRANK, 2], "crank_speed_rad_s": run.velocity[:, CRANK, 2]}
    return columns | observed_columns(scene, run)


def _bodies(scene: Scene, run: Trajectory, acceleration: FloatArray) -> dict[str, FloatArray]:
    """Return what is observed, motions and accelerations of all centres of mass, and places of markers."""
    columns = observed_columns(scene, run)
    for k, body in enumerate(scene.mechanism.names):
        x, v, a = run.position[:, k], run.velocity[:, k], acceleration[:, k]
        columns |= {f"{body}_x_m": x[:, 0], f"{body}_y_m": x[:, 1], f"{body}_angle_rad": x[:, 2]}
        columns |= {f"{body}_velocity_x_m_s": v[:, 0], f"{body}_velocity_y_m_s": v[:, 1]}
        columns[f"{body}_speed_rad_s"] = v[:, 2]
        columns |= {f"{body}_acceleration_x_m_s2": a[:, 0], f"{body}_acceleration_y_m_s2": a[:, 1]}
        columns[f"{body}_angular_acceleration_rad_s2"] = a[:, 2]
    for marker, (number, point) in scene.markers.items():
        place = point_motion(number, point, run.position, run.velocity).place_m
        columns |= {f"marker_{marker}_x_m": place[:, 0], f"marker_{marker}_y_m": place[:, 1]}
    return columns


def _guides(scene: Scene, run: Trajectory) -> dict[str, FloatArray]:
    """Return ways along guides, their normal forces, and moments of those that hold an angle."""
    if scene.is_short:
        return {guide_column(scene, name): force for name, force in run.guide_force_N.items()}
    columns = dict[str, FloatArray]()
    for guide in scene.mechanism.guides:
        columns[f"guide_{guide.name}_along_m"], _ = way(guide, run.position, run.velocity)
        columns[guide_column(scene, guide.name)] = run.guide_force_N[guide.name]
        if guide.name in run.guide_moment_N_m:
            columns[f"guide_{guide.name}_moment_N_m"] = run.guide_moment_N_m[guide.name]
    return columns


def _energies(scene: Scene, run: Trajectory) -> dict[str, FloatArray]:
    """Return energies and works."""
    columns = {"kinetic_energy_J": kinetic_energy_J(scene, run)}
    of = scene.mechanism
    if any(of.gravity_m_s2) or run.contacts or of.springs or of.torsions:  # a contact stores elastic energy
        columns["potential_energy_J"] = potential_energy_J(scene, run)
    is_product = scene.drive.kind not in OF_TIME and scene.is_short
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
