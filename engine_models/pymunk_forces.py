"""Joint forces from the bodies' momentum balance, for an engine that gives motion but no force vectors.

Conventions as in ``engine.Trajectory``: the force at O acts on the crank, at A on the rod, at B on the
slider; its opposite acts on the body nearer to the crank pivot. Global frame, gravity along -y.
"""

import numpy as np

from engine_models.engine import FloatArray
from engine_models.scene import Scene


def reactions(
    scene: Scene, position: FloatArray, acceleration: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return joint forces (n, 3, 2) and guide normal force (n,) in N, driver torque (n,) in N m.

    ``position`` and ``acceleration`` are (n, 3, 3): crank, rod, slider by (x, y, phi) of the centre of mass,
    in m, rad and s. Newton's second law, slider first; the rod's arms are those of its own pins, so that its
    balance is exact even where the pins have come apart a little. The torque is what the crank's angular
    momentum about O asks for beside gravity and the rod. Singular where the rod is at right angles to the
    guide.
    """
    g = scene.gravity_m_s2
    masses = np.array([scene.crank.mass_kg, scene.rod.mass_kg, scene.slider.mass_kg])
    # All forces on each body but its weight.
    force = masses[:, None] * (acceleration[:, :, :2] + np.array([0.0, g]))
    crank, rod, slider = force[:, 0], force[:, 1], force[:, 2]

    phi = position[:, 1, 2]
    along = np.stack([np.cos(phi), np.sin(phi)], axis=-1)
    length, d = scene.rod.length_m, scene.rod.centre_of_mass_m
    spin = scene.rod.inertia_kg_m2 * acceleration[:, 1, 2]
    # Unknown: B_y. I alpha = r_A x (rod + B) - r_B x B with r_A = -d u, r_B = (L - d) u, u along the rod.
    b_x = slider[:, 0]
    b_y = -(spin + d * _cross(along, rod) - length * along[:, 1] * b_x) / (length * along[:, 0])
    at_b = np.stack([b_x, b_y], axis=-1)
    at_a = rod + at_b
    at_o = crank + at_a

    theta = position[:, 0, 2]
    along = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    spin = scene.crank.inertia_kg_m2 * acceleration[:, 0, 2]
    s, r = scene.crank.centre_of_mass_m, scene.crank.length_m
    torque = spin + s * _cross(along, crank) + r * _cross(along, at_a)
    return np.stack([at_o, at_a, at_b], axis=1), slider[:, 1] - b_y, torque


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the z component of a x b, (n,) from two (n, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def joint_gaps(scene: Scene, position: FloatArray) -> FloatArray:
    """Return the largest distance (n,) in m by which O, A, B or the guide is off in each position."""
    crank, rod, slider = (position[:, i] for i in range(3))

    def pin(body: FloatArray, distance: float) -> FloatArray:
        return body[:, :2] + distance * np.stack([np.cos(body[:, 2]), np.sin(body[:, 2])], axis=-1)

    s, r = scene.crank.centre_of_mass_m, scene.crank.length_m
    d, length = scene.rod.centre_of_mass_m, scene.rod.length_m
    gaps = [
        np.hypot(*pin(crank, -s).T),
        np.hypot(*(pin(rod, -d) - pin(crank, r - s)).T),
        np.hypot(*(pin(rod, length - d) - slider[:, :2]).T),
        np.abs(slider[:, 1]),
    ]
    return np.asarray(np.max(gaps, axis=0))
