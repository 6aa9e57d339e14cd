"""A pin in its bearing: where it stands, the force between events, and how the gap changes.

d is the vector from bearing centre to pin centre, n = d/|d|, t = (-n_y, n_x), penetration |d| - c. A
compliant wall gives the pin -F_n n + F_t t and the bearing the opposite, both at one point in the middle of
the penetration: R_i + delta/2 from the bearing's centre and R_j - delta/2 from the pin's.

On a rigid wall contact is at |d| = c, at one point of both surfaces: R_i from the bearing's centre and
R_j = R_i - c from the pin's, along n. Normal speed is that of approach, n.d', positive outwards; tangential
speed is the pin's surface against the bearing's, along t: t.d' + omega_j R_j - omega_i R_i.
"""

from dataclasses import dataclass

import numpy as np

from reference_solver.mechanism.contact_laws import FRICTION_LAWS, NORMAL_LAWS
from reference_solver.mechanism.loads import Forces, pair
from reference_solver.mechanism.mechanism import ClearanceJoint, MasslessLink
from reference_solver.mechanism.points import Point, State, ends_of, speed_row
from reference_solver.run import CLIPPED, FLIGHT
from reference_solver.tape import Array, Scalar, array, choose, equal, larger, size, sqrt, when

#: As a part of the clearance: round-off of the penetration.
LEAST_DEPTH = 1e-12
#: What a contact's branch computes.
OF_CONTACT = ("force_x", "force_y", "twist_i", "twist_j", "normal", "loss", "clip", "slide", "tangential")


def rates_of(joint: ClearanceJoint, number: int) -> list[str]:
    """Return the names of what a contact adds up: normal force and losses.

    Losses are, of a compliant contact, by the normal force and where that is clipped; of a rigid wall, in
    impacts and in closings; of both by friction.
    """
    names = ["normal", "impact", "closing"] if joint.rigid else ["normal", "loss"]
    if not joint.rigid and joint.compliance.clipped:
        names.append("clip")
    return [f"{name}{number}" for name in [*names, *(["slide"] if joint.friction else [])]]


def contact_force(
    joint: ClearanceJoint, phase: Scalar, memory: Scalar, state: State
) -> tuple[Forces, list[Scalar], Scalar]:
    """Return the generalised forces of a contact in its phase, its ``rates_of`` in N and W, and friction.

    That is the force on the pin along t, in N.
    """
    bearing, pin = ends_of(joint, state)
    d, d_dot, law = pin.place - bearing.place, pin.rate - bearing.rate, joint.compliance

    def closed() -> tuple[Scalar, ...]:
        distance = sqrt(d @ d)
        n = array([d[0] / distance, d[1] / distance])
        depth, rate = larger(distance - joint.radial_clearance_m, 0.0), n @ d_dot
        elastic, damper = NORMAL_LAWS[law.kind](law, depth, memory)
        normal, loss, clip, slide = elastic + damper * rate, damper * rate * rate, 0.0, 0.0
        if law.clipped:  # the law would pull: no force, and the spring's energy is lost
            clipped = equal(phase, CLIPPED)
            normal, loss = choose(clipped, 0.0, normal), choose(clipped, 0.0, loss)
            clip = choose(clipped, -elastic * rate, 0.0)
        force, twist_i, twist_j, tangential = -normal * n, 0.0, 0.0, 0.0
        if joint.friction is not None:
            arm_i = joint.bearing_radius_m + 0.5 * depth
            arm_j = joint.bearing_radius_m - joint.radial_clearance_m - 0.5 * depth
            sliding = n[0] * d_dot[1] - n[1] * d_dot[0] + pin.spin * arm_j - bearing.spin * arm_i
            # Where a law pulls, friction has the force's sign and drives the sliding, as in Exudyn's contact.
            pressing = normal if law.may_pull else larger(normal, 0.0)
            share = FRICTION_LAWS[joint.friction.kind](joint.friction, sliding)
            tangential = -(joint.friction.coefficient * pressing * share)
            slide, twist_i, twist_j = -tangential * sliding, -arm_i * tangential, arm_j * tangential
            force = force + tangential * array([-n[1], n[0]])
        return (*force, twist_i, twist_j, normal, loss, clip, slide, tangential)

    results = when(phase > FLIGHT, closed, len(OF_CONTACT))
    x, y, twist_i, twist_j, normal, loss, clip, slide, tangential = results
    rates = [normal, loss] + law.clipped * [clip] + (joint.friction is not None) * [slide]
    return pair(bearing, pin, array([x, y]), twist_i, twist_j), rates, tangential


def elastic_force(joint: ClearanceJoint, phase: Scalar, state: State) -> Forces:
    """Return what a contact pushes with at rest, clipped or not: the part that has a potential."""
    bearing, pin = ends_of(joint, state)
    d, law = pin.place - bearing.place, joint.compliance

    def closed() -> tuple[Scalar, ...]:
        distance = sqrt(d @ d)
        depth = larger(distance - joint.radial_clearance_m, 0.0)
        return ((-NORMAL_LAWS[law.kind](law, depth, 0.0)[0]) / distance,)

    (pull,) = when(phase > FLIGHT, closed, 1)
    return pair(bearing, pin, pull * d)


def gap(
    joint: ClearanceJoint, phase: Scalar, memory: Scalar, state: State, pressing: Scalar = 0.0
) -> dict[str, Scalar]:
    """Return the fields of ``run.Gap``.

    g = (d.d - c^2)/(2c), polynomial in d, has the sign of the penetration and its slope at touch. Where the
    elastic force vanishes, "push" is as it is at a ``LEAST_DEPTH``; of a pin that follows a rigid wall it is
    the force that presses it inwards, ``pressing`` in N.
    """
    (bearing, pin), c = ends_of(joint, state), joint.radial_clearance_m
    d, d_dot = pin.place - bearing.place, pin.rate - bearing.rate
    distance, g_rate = sqrt(d @ d), d @ d_dot / c
    depth = distance - c

    def closed() -> tuple[Scalar, ...]:
        law = joint.compliance
        elastic, damper = NORMAL_LAWS[law.kind](law, larger(depth, LEAST_DEPTH * c), memory)
        return elastic, damper, 1.0 + damper / elastic * (g_rate * c / distance)

    elastic, damper, push = (0.0, 0.0, pressing) if joint.rigid else when(phase > FLIGHT, closed, 3)
    fields = {"g": 0.5 * (d @ d - c * c) / c, "rate": g_rate, "speed": sqrt(d_dot @ d_dot), "depth": depth}
    return {**fields, "elastic": elastic, "damper": damper, "push": push}


# --------------------------------------------------------------------------------- rigid walls

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
