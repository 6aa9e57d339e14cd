"""Joint forces and driver torque of a model without constraints, from its accelerations.

Exudyn tells no force of a kinematic tree's joints. In a scene with clearance somewhere they need no closed
loop to be solved: from the known force of a contact Newton's second law leads outwards, body by body.
"""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import JOINTS, FloatArray
from engine_models.exudyn.contact_record import ContactStates
from engine_models.exudyn.tree import CRANK
from engine_models.scene.scene import Scene


def joint_forces(scene: Scene, acceleration: FloatArray, contacts: Mapping[str, ContactStates]) -> FloatArray:
    """Return joint forces (n, joints, 2), signs as in ``Trajectory``; ``acceleration`` is (n, bodies, 3)."""
    g = np.array([0.0, scene.gravity_m_s2])
    force = np.zeros((len(acceleration), len(scene.joints), 2))
    for joint, states in contacts.items():
        force[:, JOINTS.index(joint)] = states.force_on_pin_N
    # What the joint nearer the crank pivot carries beyond the other one: crank's and rod's m (a - g).
    carried = [
        scene.bodies[body].mass_kg * (acceleration[:, body, :2] + g) for body in range(len(scene.joints) - 1)
    ]
    seed = JOINTS.index(next(iter(contacts)))
    for outer in range(seed + 1, len(scene.joints)):
        if JOINTS[outer] not in contacts:
            force[:, outer] = force[:, outer - 1] - carried[outer - 1]
    for inner in reversed(range(seed)):
        force[:, inner] = force[:, inner + 1] + carried[inner]
    return force


def driver_torque(
    scene: Scene,
    position: FloatArray,
    acceleration: FloatArray,
    force: FloatArray,
    contacts: Mapping[str, ContactStates],
) -> FloatArray:
    """Return the torque on the crank (n,) that its angular momentum asks for beside its joints' forces."""
    angle = position[:, CRANK, 2]
    along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    s = scene.crank.centre_of_mass_m
    torque = scene.crank.inertia_kg_m2 * acceleration[:, CRANK, 2] + s * _cross(along, force[:, 0])
    if "O" in contacts:  # the crank is the pin
        torque -= contacts["O"].pin_arm_m * contacts["O"].friction_force_N
    if scene.is_crank_slider:
        torque += (scene.crank.length_m - s) * _cross(along, force[:, JOINTS.index("A")])
    if "A" in contacts:  # the crank is the bearing
        torque += contacts["A"].bearing_arm_m * contacts["A"].friction_force_N
    return np.asarray(torque)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the z component of a x b, (n,) from two (n, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
