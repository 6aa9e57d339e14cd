"""What loads put on a mechanism in any states, along their lines, and the works of their parts.

Parts are named "BODY.force", "BODY.viscous" and so on: of a slider's load without its name, "force".
"""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.states import point_motion, way
from engine_models.scene.scene import Scene
from reference_solver.mechanism.curves import curve_of
from reference_solver.mechanism.data import Load, MechanismData, Motor, Spring, Table, Torque

#: Parts of any load whose works follow from the positions.
EXACT = ("force", "spring", "torque")


def slider_forces(scene: Scene, position: FloatArray, velocity: FloatArray) -> dict[str, FloatArray]:
    """Return the force of each part of the slider's load in N, (n,), in states (n, bodies, 3)."""
    forces = load_forces(scene.mechanism, np.zeros(len(position)), position, velocity)
    return {name.removeprefix("slider."): force for name, force in forces.items()}


def load_forces(
    of: MechanismData, time_s: FloatArray, position: FloatArray, velocity: FloatArray
) -> dict[str, FloatArray]:
    """Return the forces along their lines in N, (n,), at times (n,) and in states (n, bodies, 3)."""
    clock = of.drive.clock_s
    return {
        f"{of.bodies[load.body].name}.{part}": force
        for load in of.loads
        for part, force in _forces(load, clock + time_s, position, velocity).items()
    }


def _forces(
    load: Load, clock_s: FloatArray, position: FloatArray, velocity: FloatArray
) -> dict[str, FloatArray]:
    if load.line is None:
        return {}
    (s, rate), forces = way(load.line, position, velocity), dict[str, FloatArray]()
    if load.force_N:
        forces["force"] = np.full(len(s), load.force_N)
    if load.viscous_N_s_m:
        forces["viscous"] = -load.viscous_N_s_m * rate
    if load.spring_N_m:
        forces["spring"] = -load.spring_N_m * (s - load.free_position_m)
    if load.gas is not None:
        forces["gas"] = np.asarray(curve_of(load.gas.table)(position[:, load.gas.body, 2]))
    if load.force_by_time is not None:
        forces["by_time"] = np.asarray(curve_of(load.force_by_time)(clock_s))
    return forces


def load_torques(of: MechanismData, time_s: FloatArray, velocity: FloatArray) -> dict[str, FloatArray]:
    """Return the torques in N m, (n,), at times (n,) and velocities (n, bodies, 3), named as forces are."""
    torques = dict[str, FloatArray]()
    for load in of.loads:
        body, one = of.bodies[load.body].name, np.ones(len(time_s))
        if load.torque_N_m:
            torques[f"{body}.torque"] = load.torque_N_m * one
        if load.viscous_N_m_s:
            torques[f"{body}.turning_viscous"] = -load.viscous_N_m_s * velocity[:, load.body, 2]
        if load.torque_by_time is not None:
            curve = curve_of(load.torque_by_time)
            torques[f"{body}.torque_by_time"] = np.asarray(curve(of.drive.clock_s + time_s))
    return torques


def spring_forces(of: MechanismData, position: FloatArray, velocity: FloatArray) -> dict[str, FloatArray]:
    """Return the force of each spring with its damper in N, (n,), by name: positive pulls."""
    forces = dict[str, FloatArray]()
    for spring in of.springs:
        length, rate = _stretched(spring, position, velocity)
        forces[spring.name] = (
            spring.stiffness_N_m * (length - spring.free_length_m) + spring.damping_N_s_m * rate
        )
    return forces


def _stretched(spring: Spring, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the length of a spring and its rate, (n,) each, 0 where its ends are at one place."""
    i = point_motion(spring.body_i, spring.point_i, position, velocity)
    j = point_motion(spring.body_j, spring.point_j, position, velocity)
    apart = j.place_m - i.place_m
    length = np.hypot(*apart.T)
    return length, np.sum(apart * (j.rate_m_s - i.rate_m_s), axis=1) / np.where(length > 0, length, 1.0)


def load_powers_W(
    scene: Scene, time_s: FloatArray, position: FloatArray, velocity: FloatArray
) -> dict[str, FloatArray]:
    """Return the powers (n,), at times (n,) in states (n, bodies, 3), of what has no other work.

    They are those of ``integrated_works`` but "driver".
    """
    of, powers = scene.mechanism, dict[str, FloatArray]()
    short = "slider." if scene.is_short else ""
    forces, torques = load_forces(of, time_s, position, velocity), load_torques(of, time_s, velocity)
    for load in of.loads:
        body = f"{of.bodies[load.body].name}."
        kinds = [(torques, velocity[:, load.body, 2])]
        if load.line is not None:
            kinds.append((forces, way(load.line, position, velocity)[1]))
        for parts, rate in kinds:
            own = [name for name in parts if name.startswith(body)]
            powers |= {name.removeprefix(short): parts[name] * rate for name in own}
    for spring in of.springs:
        powers[f"spring:{spring.name}"] = (
            -spring.damping_N_s_m * _stretched(spring, position, velocity)[1] ** 2
        )
    return {name: powers[name] for name in integrated_works(scene) if name != "driver"}


def integrated_works(scene: Scene) -> tuple[str, ...]:
    """Return the works that an engine has to integrate, by the names of ``load_works_J``, and "driver"."""
    of, short = scene.mechanism, "slider." if scene.is_short else ""
    names = [
        f"{of.bodies[load.body].name}.{part}".removeprefix(short)
        for load in of.loads
        for part in _parts(load)
        if part not in EXACT
    ]
    names += [f"spring:{spring.name}" for spring in of.springs if spring.damping_N_s_m]
    law = of.drive.law
    by_time = isinstance(law, Torque) and isinstance(law.torque_N_m, Table)
    return (*names, "driver") if of.drive.prescribes or by_time or isinstance(law, Motor) else (*names,)


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
        for part in _parts(load):
            name = f"{body}.{part}".removeprefix(short)
            works[name] = exact[part] if part in exact else integrated[name]
    return works | {name: work for name, work in integrated.items() if name.startswith("spring:")}


def _parts(load: Load) -> list[str]:
    """Return the parts of a load in the order of ``building.loads_of``."""
    there = {
        "force": load.force_N,
        "viscous": load.viscous_N_s_m,
        "spring": load.spring_N_m,
        "gas": load.gas,
        "by_time": load.force_by_time,
        "torque": load.torque_N_m,
        "turning_viscous": load.viscous_N_m_s,
        "torque_by_time": load.torque_by_time,
    }
    return [part for part, value in there.items() if value]
