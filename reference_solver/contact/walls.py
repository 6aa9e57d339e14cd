"""A pin in a bearing with a rigid wall: its geometry.

d is the vector from bearing centre to pin centre, n = d/|d|, t = (-n_y, n_x). Contact is at |d| = c, at one
point of both surfaces: R_i from the bearing's centre and R_j = R_i - c from the pin's, along n. Normal speed
is that of approach, n.d', positive outwards; tangential speed is the pin's surface against the bearing's,
along t: t.d' + omega_j R_j - omega_i R_i.
"""

from dataclasses import dataclass

import numpy as np

from reference_solver.mechanism.mechanism import ClearanceJoint, MasslessLink
from reference_solver.mechanism.points import Point, State, ends_of, speed_row
from reference_solver.tape import Array, FloatArray, array

#: Units in the last place that a few sums and products may lose, with an order of magnitude to spare.
ROUND_OFF = 64 * float(np.finfo(float).eps)


def wall_link(joint: ClearanceJoint) -> MasslessLink:
    """Return the constraint of a pin that follows its wall, g = (d.d - c^2)/2 (see ``massless_link``)."""
    return MasslessLink(joint.body_i, joint.point_i, joint.body_j, joint.point_j, joint.radial_clearance_m)


# v_t = t.d' + omega_j R_j - omega_i R_i = T{q'}: a row of speed alone, without any g that it is the rate of
def sliding_row(joint: ClearanceJoint, n: Array, bearing: Point, pin: Point, size: int) -> Array:
    """Return the row (size,) that gives the sliding speed from {q'}, n the normal (2,)."""
    radii = -joint.bearing_radius_m, joint.bearing_radius_m - joint.radial_clearance_m
    return speed_row(array([-n[1], n[0]]), bearing, pin, size, radii)


@dataclass(frozen=True)
class Separation:
    """Where the pins of J joints stand at a state of n coordinates.

    ``distance_m`` is |d| (J,); ``normal`` and ``tangent`` (J, n) are the rows that give normal and tangential
    speeds from {q'}; ``normal_speed`` (J,) and ``turning`` (J,), the part of |d|'' d.d/|d| that is there
    without accelerations, so that (d.d/2)''/|d| = normal {q''} + turning. ``round_off`` (J, 2) is that of |d|
    in m and of |d|' in m/s, by the size of their terms.
    """

    distance_m: FloatArray
    normal: FloatArray
    tangent: FloatArray
    normal_speed: FloatArray
    turning: FloatArray
    round_off: FloatArray


def separation(joints: tuple[ClearanceJoint, ...], q: FloatArray, v: FloatArray) -> Separation:
    """Return the joints' separation; a pin at its bearing's very centre has n along +x."""
    state, n = State(q, v), len(q)
    separations: list[tuple[object, ...]] = []
    for joint in joints:
        bearing, pin = ends_of(joint, state)
        d, d_dot = pin.place - bearing.place, pin.rate - bearing.rate
        distance = float(np.hypot(*d))
        normal = d / distance if distance > 0 else np.array([1.0, 0.0])
        turning = normal @ (pin.centripetal - bearing.centripetal)
        if distance > 0:
            turning += d_dot @ d_dot / distance
        rows = speed_row(normal, bearing, pin, n), sliding_row(joint, normal, bearing, pin, n)
        sizes = np.array([joint.radial_clearance_m, 0.0])
        for body, point in ((joint.body_i, joint.point_i), (joint.body_j, joint.point_j)):
            lever, rate = np.abs(point).max(), np.abs(state.velocity(body))
            sizes += np.abs(state.position(body)[:2]).max() + lever, rate[:2].max() + rate[2] * lever
        separations.append((distance, *rows, normal @ d_dot, turning, ROUND_OFF * sizes))
    return Separation(*(np.array(column) for column in zip(*separations, strict=True)))
