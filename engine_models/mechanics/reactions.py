"""Forces of ideal joints, guides and drives from the bodies' accelerations, where an engine tells none.

Newton's second law has three equations a body, M a = F + B^T lambda. The columns of B^T are the wrenches of
unit reactions. lambda is the solution by least squares in the norm of M^-1: B M^-1 B^T lambda =
B (a - M^-1 F).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from engine_models.engine import Contact, FloatArray
from engine_models.mechanics.joints import ContactForces, contact_force
from engine_models.mechanics.trajectory import drive_torque
from engine_models.mechanics.wrenches import Wrenches, accelerations, inertias
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import Guide, MechanismData


@dataclass(frozen=True)
class Reactions:
    """Forces of joints (n, 2), of guides (n,), their moments (n,), and the drive's torque or force (n,).

    Names and signs are those of ``engine.Trajectory``.
    """

    joint_force_N: dict[str, FloatArray]
    guide_force_N: dict[str, FloatArray]
    guide_moment_N_m: dict[str, FloatArray]
    driver_torque_N_m: FloatArray | None


def reactions(
    scene: Scene,
    time_s: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    contacts: Mapping[str, Contact | ContactForces],
) -> Reactions:
    """Return all reactions at times (n,) in states (n, bodies, 3) with such accelerations.

    ``contacts`` has what the joints with clearance do then.
    """
    of, told = scene.mechanism, drive_torque(scene.mechanism.drive, time_s, velocity)
    known = Wrenches(position)
    known.loads(of, time_s, velocity)
    for pin in of.loose:
        known.contact(pin, contacts[pin.name])
    if told is not None:
        known.drive(of, told)
    missing = acceleration - accelerations(of, known.total)
    B = unit_wrenches(of, position)
    weighted = B / inertias(of).ravel()
    found = solve_systems(weighted @ B.swapaxes(1, 2), B @ missing.reshape(len(B), -1, 1))
    rows = iter(np.moveaxis(found, 1, 0))
    forces = {pin.name: np.stack([next(rows), next(rows)], axis=-1) for pin in of.ideal}
    forces |= {pin.name: force_on_later(pin.bearing_on_j, contacts[pin.name]) for pin in of.loose}
    across = {guide.name: next(rows) for guide in of.guides}
    moments = {guide.name: next(rows) for guide in held(of)}
    ordered = {pin.name: forces[pin.name] for pin in of.pins}
    return Reactions(ordered, across, moments, next(rows) if of.drive.prescribes else told)


def force_on_later(bearing_on_j: bool, contact: Contact | ContactForces) -> FloatArray:
    """Return the force (n, 2) of a joint with clearance on the body named later."""
    force = contact_force(contact)
    return -force if bearing_on_j else force


def held(of: MechanismData) -> list[Guide]:
    """Return the guides that keep their body from turning."""
    return [guide for guide in of.guides if not guide.turns]


def unit_wrenches(of: MechanismData, position: FloatArray) -> FloatArray:
    """Return [B] (n, m, 3 bodies): what the unit of each reaction puts on the bodies.

    They are two of each ideal joint, one across each guide, one of each guide that holds an angle, and one of
    a drive that prescribes a motion.
    """
    one, rows = np.ones(len(position)), list[Wrenches]()
    for pin in of.ideal:
        for axis in np.eye(2):
            rows.append(Wrenches(position))
            rows[-1].pin(pin, np.outer(one, axis))
    for guide in of.guides:
        rows.append(Wrenches(position))
        rows[-1].line(guide, one, across=True)
    for guide in held(of):
        rows.append(Wrenches(position))
        rows[-1].turn(guide.body_j, guide.body_i, one)
    if of.drive.prescribes:
        rows.append(Wrenches(position))
        rows[-1].drive(of, one)
    on_bodies = [acting.total[:, :-1].reshape(len(position), -1) for acting in rows]
    return np.stack(on_bodies, axis=1) if rows else np.zeros((len(position), 0, 3 * len(of.bodies)))


def solve_systems(
    matrix: FloatArray, right: FloatArray, singular: bool = False, zero: float = 1e-15
) -> FloatArray:
    """Return the solutions (n, m) of n systems, of ``singular`` ones the shortest.

    Singular values are 0 below the part ``zero`` of the largest.
    """
    if not singular:
        try:
            return np.asarray(np.linalg.solve(matrix, right)[..., 0])
        except np.linalg.LinAlgError:
            pass
    return np.asarray((np.linalg.pinv(matrix, zero, hermitian=True) @ right)[..., 0])
