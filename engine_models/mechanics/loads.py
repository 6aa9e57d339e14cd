"""What loads put on a mechanism in any states, and all that acts on its bodies in a run.

Engines have these from ``minimal.forces``, compiled; here they are for rows and pictures. Parts are named
"BODY.force", "BODY.viscous" and so on.
A wrench is (force x, force y, torque), in the global frame and about the centre of mass; the ground's is
about the origin. Whatever acts on a body acts the other way round on another one or on the ground: drives,
torques of loads, and loads along a line that is not on another body act from the ground.
"""

from typing import Protocol

import numpy as np

from engine_models.engine import Contact, FloatArray, Trajectory
from engine_models.mechanics.states import direction, point_motion, way
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import (
    GROUND,
    DriveData,
    Load,
    MechanismData,
    Motor,
    Pin,
    Point,
    Spring,
    Torque,
)
from reference_solver.mechanism.loads import motor_torque_N_m
from reference_solver.mechanism.motions import curve_of

#: The field of a load that makes each of its parts, in the order of ``mechanism.loads_of``.
FIELDS = {
    "force": "force_N",
    "viscous": "viscous_N_s_m",
    "spring": "spring_N_m",
    "gas": "gas",
    "by_time": "force_by_time",
    "torque": "torque_N_m",
    "turning_viscous": "viscous_N_m_s",
    "torque_by_time": "torque_by_time",
}


class Touching(Protocol):
    """Gap (n, 2) and forces (n,) of a joint with clearance, as in ``engine.Contact``."""

    @property
    def gap_m(self) -> FloatArray: ...  # noqa: D102
    @property
    def normal_force_N(self) -> FloatArray: ...  # noqa: D102
    @property
    def friction_force_N(self) -> FloatArray | None: ...  # noqa: D102


def parts_of(load: Load) -> list[str]:
    """Return the parts of a load that there are."""
    return [part for part, field in FIELDS.items() if getattr(load, field)]


def load_forces(
    of: MechanismData, time_s: FloatArray, position: FloatArray, velocity: FloatArray
) -> dict[str, FloatArray]:
    """Return the forces along their lines in N, (n,), at times (n,) and in states (n, bodies, 3)."""
    forces, clock_s = dict[str, FloatArray](), of.drive.clock_s + time_s
    for load in of.loads:
        if load.line is None:
            continue
        name, (s, rate) = of.bodies[load.body].name, way(load.line, position, velocity)
        if load.force_N:
            forces[f"{name}.force"] = np.full(len(s), load.force_N)
        if load.viscous_N_s_m:
            forces[f"{name}.viscous"] = -load.viscous_N_s_m * rate
        if load.spring_N_m:
            forces[f"{name}.spring"] = -load.spring_N_m * (s - load.free_position_m)
        if load.gas is not None:
            forces[f"{name}.gas"] = np.asarray(curve_of(load.gas.table)(position[:, load.gas.body, 2]))
        if load.force_by_time is not None:
            forces[f"{name}.by_time"] = np.asarray(curve_of(load.force_by_time)(clock_s))
    return forces


def load_torques(of: MechanismData, time_s: FloatArray, velocity: FloatArray) -> dict[str, FloatArray]:
    """Return the torques in N m, (n,), at times (n,) and velocities (n, bodies, 3), named as forces are."""
    torques, clock_s = dict[str, FloatArray](), of.drive.clock_s + time_s
    for load in of.loads:
        name = of.bodies[load.body].name
        if load.torque_N_m:
            torques[f"{name}.torque"] = np.full(len(time_s), load.torque_N_m)
        if load.viscous_N_m_s:
            torques[f"{name}.turning_viscous"] = -load.viscous_N_m_s * velocity[:, load.body, 2]
        if load.torque_by_time is not None:
            torques[f"{name}.torque_by_time"] = np.asarray(curve_of(load.torque_by_time)(clock_s))
    return torques


def spring_pull(spring: Spring, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the pull of a spring with its damper in N, (n,), and on its body j, (n, 2)."""
    i, j = (
        point_motion(body, point, position, velocity)
        for body, point in ((spring.body_i, spring.point_i), (spring.body_j, spring.point_j))
    )
    apart = j.place_m - i.place_m
    length = np.hypot(*apart.T)
    unit = apart / np.where(length > 0, length, 1.0)[:, None]
    rate = np.sum(unit * (j.rate_m_s - i.rate_m_s), axis=1)
    pull = spring.stiffness_N_m * (length - spring.free_length_m) + spring.damping_N_s_m * rate
    return pull, -pull[:, None] * unit


def drive_torque(drive: DriveData, time_s: FloatArray, velocity: FloatArray) -> FloatArray | None:
    """Return the torque of a drive that prescribes no motion, (n,) at times and velocities (n, bodies, 3)."""
    law, speed = drive.law, velocity[:, drive.body, 2]
    if isinstance(law, Torque):
        if isinstance(law.torque_N_m, float):
            return np.full(len(speed), law.torque_N_m)
        return np.asarray(curve_of(law.torque_N_m)(drive.clock_s + time_s))
    if isinstance(law, Motor):
        if law.table is not None:
            return np.asarray(curve_of(law.table)(np.clip(speed, law.table.x[0], law.table.x[-1])))
        return np.asarray(motor_torque_N_m(law, speed))
    return None


def wrenches(scene: Scene, run: Trajectory) -> FloatArray:
    """Return all that acts in a run, weight left out, on the bodies and on the ground: (n, bodies + 1, 3)."""
    of, x, v = scene.mechanism, run.position, run.velocity
    total, still = np.zeros((len(x), len(of.bodies) + 1, 3)), np.zeros_like(x)

    def place(body: int, point: Point) -> FloatArray:
        return point_motion(body, point, x, still).place_m

    def push(body: int, other: int, at_m: FloatArray, force: FloatArray, other_at_m: FloatArray) -> None:
        for each, where, own in ((body, at_m, force), (other, other_at_m, -force)):
            arm = where if each == GROUND else where - x[:, each, :2]
            total[:, each, :2] += own
            total[:, each, 2] += arm[:, 0] * own[:, 1] - arm[:, 1] * own[:, 0]

    def turn(body: int, other: int, torque: FloatArray) -> None:
        total[:, body, 2] += torque
        total[:, other, 2] -= torque

    def between(ends: Pin | Spring, force: FloatArray) -> None:
        at_j, at_i = place(ends.body_j, ends.point_j), place(ends.body_i, ends.point_i)
        push(ends.body_j, ends.body_i, at_j, force, at_i)

    forces, torques = load_forces(of, run.time_s, x, v), load_torques(of, run.time_s, v)
    along = [(load.line, forces[name], 0) for load, name in _named(of, forces) if load.line is not None]
    along += [(guide, run.guide_force_N[guide.name], 1) for guide in of.guides]
    effort = run.driver_torque_N_m
    if effort is not None and of.drive.guide is not None:
        along.append((of.guides[of.drive.guide], effort, 0))
    elif effort is not None:
        turn(of.drive.body, GROUND, effort)
    for line, force, across in along:
        at = place(line.body_j, line.point_j)
        push(line.body_j, line.body_i, at, force[:, None] * direction(line, x)[across], at)
    for load, name in _named(of, torques):
        turn(load.body, GROUND, torques[name])
    for guide in of.guides:
        if guide.name in run.guide_moment_N_m:
            turn(guide.body_j, guide.body_i, run.guide_moment_N_m[guide.name])
    for spring in of.springs:
        between(spring, spring_pull(spring, x, v)[1])
    for pin in of.pins:
        contact = run.contacts.get(pin.name)
        if contact is None:
            between(pin, run.joint_force_N[pin.name])
            continue
        force = force_on_pin(contact)
        between(pin, -force if pin.bearing_on_j else force)
        if contact.friction_force_N is not None:
            own, bearing = (pin.body_i, pin.body_j) if pin.bearing_on_j else (pin.body_j, pin.body_i)
            of_bearing, of_pin = levers(pin, contact)
            total[:, own, 2] += of_pin * contact.friction_force_N
            total[:, bearing, 2] -= of_bearing * contact.friction_force_N
    return total


def _named(of: MechanismData, parts: dict[str, FloatArray]) -> list[tuple[Load, str]]:
    """Return loads with the names of their parts among these."""
    names = [(load, f"{of.bodies[load.body].name}.{part}") for load in of.loads for part in parts_of(load)]
    return [(load, name) for load, name in names if name in parts]


def force_on_pin(contact: Touching) -> FloatArray:
    """Return the force of a bearing on its pin, (n, 2) in N."""
    distance = np.maximum(np.hypot(*contact.gap_m.T), np.finfo(float).tiny)
    x, y = contact.gap_m.T / distance
    force = -contact.normal_force_N * np.array([x, y])
    if contact.friction_force_N is not None:
        force += contact.friction_force_N * np.array([-y, x])
    return np.asarray(force.T)


def levers(pin: Pin, contact: Contact) -> tuple[FloatArray, FloatArray]:
    """Return how far in m the surfaces in contact are from the centres of bearing and pin, each (n,).

    They meet in the middle of the penetration.
    """
    assert pin.clearance is not None
    radius, half = pin.clearance.bearing_radius_m, np.maximum(contact.penetration_m, 0.0) / 2
    return radius + half, radius - pin.clearance.radial_clearance_m - half


def accelerations(of: MechanismData, acting: FloatArray) -> FloatArray:
    """Return the accelerations (n, bodies, 3) of bodies on which such wrenches act, and gravity."""
    inertia = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in of.bodies])
    return np.asarray(acting[:, :-1] / inertia + np.array([*of.gravity_m_s2, 0.0]))
