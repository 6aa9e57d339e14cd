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
from reference_solver.tape import Array, Scalar, array, choose, larger, size, sqrt

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
    """Where the pin of a joint with a rigid wall stands, at a state of n coordinates.

    ``distance`` is |d|; ``normal`` and ``tangent`` (n,) are the rows that give normal and tangential speeds
    from {q'}; ``rate`` is the normal speed, and ``turning`` the part of |d|'' d.d/|d| that is there without
    accelerations, so that (d.d/2)''/|d| = normal {q''} + turning. ``noise`` and ``rate_noise`` are the
    round-off of |d| in m and of |d|' in m/s, by the size of their terms.
    """

    distance: Scalar
    normal: Array
    tangent: Array
    rate: Scalar
    turning: Scalar
    noise: Scalar
    rate_noise: Scalar


def separation(joint: ClearanceJoint, state: State) -> Separation:
    """Return a joint's separation; a pin at its bearing's very centre has n along +x."""
    (bearing, pin), size_of_q = ends_of(joint, state), len(state.q)
    d, d_dot = pin.place - bearing.place, pin.rate - bearing.rate
    distance = sqrt(d @ d)
    apart = distance > 0.0
    length = choose(apart, distance, 1.0)
    normal = array([choose(apart, d[0] / length, 1.0), d[1] / length])
    turning = normal @ (pin.centripetal - bearing.centripetal) + choose(apart, d_dot @ d_dot / length, 0.0)
    sizes = [joint.radial_clearance_m, 0.0]
    for body, point in ((joint.body_i, joint.point_i), (joint.body_j, joint.point_j)):
        x, y, _ = (size(value) for value in state.position(body))
        v_x, v_y, spin = (size(value) for value in state.velocity(body))
        lever = larger(*map(size, point))
        sizes = [sizes[0] + larger(x, y) + lever, sizes[1] + larger(v_x, v_y) + spin * lever]
    return Separation(
        distance,
        speed_row(normal, bearing, pin, size_of_q),
        sliding_row(joint, normal, bearing, pin, size_of_q),
        normal @ d_dot,
        turning,
        *(ROUND_OFF * terms for terms in sizes),
    )
