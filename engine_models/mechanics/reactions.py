"""Joint forces, guide force and driver torque from the bodies' momentum balance, where none are told.

Conventions as in ``engine.Trajectory``: the force at O acts on the crank, at A on the rod, at B on the
slider; its opposite acts on the body nearer to the crank pivot. Global frame, gravity along -y.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from engine_models.engine import JOINTS, Contact, FloatArray
from engine_models.mechanics.joints import CRANK, ROD, SLIDER, axis, clearances, cross, directions, levers
from engine_models.mechanics.loads import slider_forces
from engine_models.scene.scene import Scene


@dataclass(frozen=True)
class ContactForces:
    """The forces of a joint with clearance and where they act; shapes and signs as in ``engine.Contact``."""

    gap_m: FloatArray
    penetration_m: FloatArray
    normal_force_N: FloatArray
    friction_force_N: FloatArray


def reactions(
    scene: Scene,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    contacts: Mapping[str, Contact | ContactForces],
) -> tuple[FloatArray, FloatArray | None, FloatArray]:
    """Return joint forces (n, joints, 2) and guide normal force (n,) in N, driver torque (n,) in N m.

    ``position``, ``velocity`` and ``acceleration`` are (n, bodies, 3): crank, rod, slider by (x, y, phi) of
    the centre of mass, in m, rad and s; velocities matter to the slider's load alone. ``contacts`` has the
    joints with clearance at the same times. Newton's second law, slider first. With clearance in any joint
    its force is known, and the others follow from those of the bodies between. Without, the rod's spin is
    needed: its levers are those of its own pins, so that its balance is exact even where the pins have come
    apart a little; singular where the rod is at right angles to the guide. The torque is what the crank's
    angular momentum asks for beside its joints' forces.
    """
    masses = np.array([body.mass_kg for body in scene.bodies])
    # All forces on each body but its weight and its load.
    force = masses[:, None] * (acceleration[:, :, :2] + np.array([0.0, scene.weight_m_s2]))
    for load in slider_forces(scene, position, velocity).values():
        force[:, SLIDER, 0] -= load
    known = {joint: contact_force(contact) for joint, contact in contacts.items()}
    joint_force = known.get("O", force[:, CRANK])[:, None]
    if scene.is_crank_slider:
        crank, rod, slider = np.moveaxis(force, 1, 0)
        if "B" in known:
            at_b = known["B"]
        elif "A" in known:
            at_b = known["A"] - rod
        elif "O" in known:
            at_b = known["O"] - crank - rod
        else:
            at_b = _force_by_spin(scene, position, acceleration, rod, slider)
        at_a = known.get("A", rod + at_b)
        joint_force = np.stack([known.get("O", crank + at_a), at_a, at_b], axis=1)
    guide = guide_force(scene, joint_force, acceleration[:, -1, 1])
    return joint_force, guide, _driver_torque(scene, position, acceleration, joint_force, contacts)


def guide_force(
    scene: Scene, joint_force_N: FloatArray, slider_acceleration: FloatArray | float = 0.0
) -> FloatArray | None:
    """Return the guide's normal force (n,) on the slider, along +y, from the joint forces (n, joints, 2).

    The slider's acceleration along y, in m/s^2, is zero on a guide that holds. None without a guide.
    """
    if not scene.is_crank_slider:
        return None
    slider = scene.bodies[SLIDER].mass_kg * (slider_acceleration + scene.weight_m_s2)
    return np.asarray(slider - joint_force_N[:, JOINTS.index("B"), 1])


def contact_force(contact: Contact | ContactForces) -> FloatArray:
    """Return the force on the pin of a joint with clearance, (n, 2) in N."""
    normal, across = directions(contact.gap_m)
    force = -contact.normal_force_N[:, None] * normal
    if contact.friction_force_N is not None:
        force += contact.friction_force_N[:, None] * across
    return np.asarray(force)


def _driver_torque(
    scene: Scene,
    position: FloatArray,
    acceleration: FloatArray,
    joint_force_N: FloatArray,
    contacts: Mapping[str, Contact | ContactForces],
) -> FloatArray:
    """Return the torque (n,) that the crank's angular momentum asks for beside its joints' forces."""
    along = axis(position[:, CRANK, 2])
    s, r = scene.crank.centre_of_mass_m, scene.crank.length_m
    torque = scene.crank.inertia_kg_m2 * acceleration[:, CRANK, 2] + s * cross(along, joint_force_N[:, 0])
    if scene.is_crank_slider:
        torque += (r - s) * cross(along, joint_force_N[:, 1])
    for joint, contact in contacts.items():
        if joint != "B" and contact.friction_force_N is not None:
            bearing, pin = levers(clearances(scene)[joint], contact.penetration_m)
            # The crank is the pin at O and the bearing at A.
            torque += (-pin if joint == "O" else bearing) * contact.friction_force_N
    return np.asarray(torque)


def _force_by_spin(
    scene: Scene, position: FloatArray, acceleration: FloatArray, rod: FloatArray, slider: FloatArray
) -> FloatArray:
    """Return the force at B (n, 2) in N: along the guide by the slider, across it by the rod's spin."""
    along = axis(position[:, ROD, 2])
    _, link, _ = scene.crank_slider()
    length, d = link.length_m, link.centre_of_mass_m
    spin = link.inertia_kg_m2 * acceleration[:, ROD, 2]
    # Unknown: B_y. I alpha = r_A x (rod + B) - r_B x B with r_A = -d u, r_B = (L - d) u, u along the rod.
    b_x = slider[:, 0]
    b_y = -(spin + d * cross(along, rod) - length * along[:, 1] * b_x) / (length * along[:, 0])
    return np.stack([b_x, b_y], axis=-1)
