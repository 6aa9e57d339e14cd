"""Joint forces from the bodies' momentum balance, for an engine that gives motion but no force vectors.

Conventions as in ``engine.Trajectory``: the force at O acts on the crank, at A on the rod, at B on the
slider; its opposite acts on the body nearer to the crank pivot. Global frame, gravity along -y.
"""

from collections.abc import Mapping

import numpy as np

from engine_models.engine import Contact, FloatArray
from engine_models.scene.scene import Scene


def reactions(
    scene: Scene, position: FloatArray, acceleration: FloatArray, contacts: Mapping[str, Contact]
) -> tuple[FloatArray, FloatArray | None, FloatArray]:
    """Return joint forces (n, joints, 2) and guide normal force (n,) in N, driver torque (n,) in N m.

    ``position`` and ``acceleration`` are (n, bodies, 3): crank, rod, slider by (x, y, phi) of the centre of
    mass, in m, rad and s; ``contacts`` has the joints with clearance at the same times. Newton's second law,
    slider first. With clearance in any joint its force is known, and the others follow from those of the
    bodies between. Without, the rod's spin is needed: its arms are those of its own pins, so that its balance
    is exact even where the pins have come apart a little; singular where the rod is at right angles to the
    guide. The torque is what the crank's angular momentum about O asks for beside gravity and the rod.
    """
    g = scene.gravity_m_s2
    masses = np.array([body.mass_kg for body in scene.bodies])
    # All forces on each body but its weight.
    force = masses[:, None] * (acceleration[:, :, :2] + np.array([0.0, g]))
    crank = force[:, 0]
    known = {name: contact_force(contact) for name, contact in contacts.items()}
    guide: FloatArray | None = None
    if not scene.is_crank_slider:
        at_o, at_a = known.get("O", crank), np.zeros_like(crank)
        joints = [at_o]
    else:
        rod, slider = force[:, 1], force[:, 2]
        if "B" in known:
            at_b = known["B"]
        elif "A" in known:
            at_b = known["A"] - rod
        elif "O" in known:
            at_b = known["O"] - crank - rod
        else:
            at_b = _force_by_spin(scene, position, acceleration, rod, slider)
        at_a = known.get("A", rod + at_b)
        at_o = known.get("O", crank + at_a)
        joints, guide = [at_o, at_a, at_b], slider[:, 1] - at_b[:, 1]

    theta = position[:, 0, 2]
    along = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    spin = scene.crank.inertia_kg_m2 * acceleration[:, 0, 2]
    s, r = scene.crank.centre_of_mass_m, scene.crank.length_m
    # About the crank's own end of joint O, by moments about the centre of mass.
    torque = (
        spin + s * _cross(along, at_o) + (r - s) * _cross(along, at_a) + _friction_moment(scene, contacts)
    )
    return np.stack(joints, axis=1), guide, torque


def contact_force(contact: Contact) -> FloatArray:
    """Return the force on the pin of a joint with clearance, (n, 2) in N."""
    length = np.hypot(contact.gap_m[:, 0], contact.gap_m[:, 1])
    n = contact.gap_m / np.where(length > 0, length, 1.0)[:, None]
    force = -contact.normal_force_N[:, None] * n
    if contact.friction_force_N is not None:
        force += contact.friction_force_N[:, None] * np.stack([-n[:, 1], n[:, 0]], axis=-1)
    return np.asarray(force)


def _friction_moment(scene: Scene, contacts: Mapping[str, Contact]) -> FloatArray | float:
    """Return the torque that friction at O and A asks of the driver beyond its force at the pins, (n,)."""
    moment: FloatArray | float = 0.0
    for name in ("O", "A"):
        contact, room = contacts.get(name), getattr(scene.clearance, name)
        if contact is None or contact.friction_force_N is None:
            continue
        depth = np.maximum(contact.penetration_m, 0.0)
        bearing = room.bearing_radius_m
        # The crank is the pin at O and the bearing at A.
        arm = -(bearing - room.radial_clearance_m - depth / 2) if name == "O" else bearing + depth / 2
        moment = moment + arm * contact.friction_force_N
    return moment


def _force_by_spin(
    scene: Scene, position: FloatArray, acceleration: FloatArray, rod: FloatArray, slider: FloatArray
) -> FloatArray:
    """Return the force at B (n, 2) in N: along the guide by the slider, across it by the rod's spin."""
    phi = position[:, 1, 2]
    along = np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    _, link, _ = scene.crank_slider()
    length, d = link.length_m, link.centre_of_mass_m
    spin = link.inertia_kg_m2 * acceleration[:, 1, 2]
    # Unknown: B_y. I alpha = r_A x (rod + B) - r_B x B with r_A = -d u, r_B = (L - d) u, u along the rod.
    b_x = slider[:, 0]
    b_y = -(spin + d * _cross(along, rod) - length * along[:, 1] * b_x) / (length * along[:, 0])
    return np.stack([b_x, b_y], axis=-1)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the z component of a x b, (n,) from two (n, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def gaps(scene: Scene, position: FloatArray) -> dict[str, FloatArray]:
    """Return the vector (n, 2) in m from the bearing to the pin of each joint in each position."""

    def end(body: int, distance: float) -> FloatArray:
        phi = position[:, body, 2]
        return position[:, body, :2] + distance * np.stack([np.cos(phi), np.sin(phi)], axis=-1)

    s, r = scene.crank.centre_of_mass_m, scene.crank.length_m
    out = {"O": end(0, -s)}
    if scene.is_crank_slider:
        _, link, _ = scene.crank_slider()
        d, length = link.centre_of_mass_m, link.length_m
        out["A"] = end(1, -d) - end(0, r - s)
        out["B"] = position[:, 2, :2] - end(1, length - d)
    return out
