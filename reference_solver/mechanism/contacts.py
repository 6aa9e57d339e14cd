"""A pin in its bearing: laws of its wall and of friction, the force between events, and how the gap changes.

d is the vector from bearing centre to pin centre, n = d/|d|, t = (-n_y, n_x), penetration delta = |d| - c. A
compliant wall gives the pin -F_n n + F_t t and the bearing the opposite, both at one point in the middle of
the penetration: R_i + delta/2 from the bearing's centre and R_j - delta/2 from the pin's.

A normal law is a function of delta >= 0, its rate and the ``memory`` of the present contact, set at its
touch; it returns the elastic force, which has a potential, and the coefficient of the rate in the rest, which
dissipates: F = elastic + damper delta'. A new law is a function and a line in ``NORMAL_LAWS``.

On a rigid wall contact is at |d| = c, at one point of both surfaces: R_i from the bearing's centre and
R_j = R_i - c from the pin's, along n. Normal speed is that of approach, n.d', positive outwards; tangential
speed is the pin's surface against the bearing's, along t: t.d' + omega_j R_j - omega_i R_i.
"""

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from reference_solver.mechanism.data import GROUND, HERTZ_EXPONENT, LINEAR_LAWS, Ends, FrictionLaw, Pin
from reference_solver.mechanism.loads import Forces, pair
from reference_solver.mechanism.points import State, ends_of
from reference_solver.tape import Array, Scalar, array, choose, larger, signed, smaller, sqrt, tanh, when

#: The phases of a contact: flight, contact (of a rigid wall: its pin follows it), and contact with the force
#: clipped because the law would pull.
FLIGHT, CONTACT, CLIPPED = 0.0, 1.0, 2.0
#: Floor of the approach speed in laws that divide by it, where no other is given.
MINIMUM_IMPACT_SPEED_M_S = 1e-6
#: Damping factor a(e) by law, e the nominal restitution.
DAMPING_FACTORS: Mapping[str, Callable[[float], float]] = {
    "hunt-crossley": lambda e: 3 * (1 - e) / 2,
    "lankarani-nikravesh": lambda e: 3 * (1 - e**2) / 4,
    "gonthier": lambda e: (1 - e**2) / e,
    "zhiying-qishao": lambda e: 3 * (1 - e**2) / 4 * math.exp(2 * (1 - e)),
    "flores": lambda e: 8 * (1 - e) / (5 * e),
    "hu-guo": lambda e: 3 * (1 - e) / (2 * e),
    "carvalho-martins": lambda e: 3 / 2 * (1 - e) * (11 - e) / (1 + 9 * e),
}
#: In the metadata of a field: numbers that machine code is written for, rather than given.
WRITTEN_OUT = "written out"
#: As a part of the clearance: round-off of the penetration.
LEAST_DEPTH = 1e-12
#: Units in the last place that a few sums and products may lose, with an order of magnitude to spare.
ROUND_OFF = 64 * float(np.finfo(float).eps)


def exponent_of(room: Any) -> float:
    """Return the exponent n of F = K delta^n: as given, else 1 for the linear laws and 3/2 for the others."""
    if room.exponent is not None:
        return float(room.exponent)
    return 1.0 if room.law in LINEAR_LAWS else HERTZ_EXPONENT


def stiffness_of(room: Any) -> float:
    """Return K in N/m^n: as given, else in N/m^1.5 of a pin in a hole of the same material (Goldsmith 1960).

    K = 4/(3 (s_i + s_j)) sqrt(R_i R_j/(R_i - R_j)) with s = (1 - nu^2)/E.
    """
    if room.stiffness is not None:
        return float(room.stiffness)
    hole, c = room.bearing_radius_m, room.radial_clearance_m
    s = (1 - room.poisson_ratio**2) / room.young_modulus_Pa
    return float(4 / (6 * s) * math.sqrt(hole * (hole - c) / c))


def damping_factor_of(room: Any) -> float:
    """Return a(e); 0 for the laws that know no restitution."""
    factor = DAMPING_FACTORS.get(room.law)
    return 0.0 if factor is None or room.restitution is None else factor(room.restitution)


def minimum_impact_speed_of(room: Any) -> float:
    """Return the floor of v0 in m/s."""
    return float(room.minimum_impact_speed_m_s or MINIMUM_IMPACT_SPEED_M_S)


@dataclass(frozen=True)
class ContactLaw:
    """A pin's normal force: stiffness K in N/m^n, damping c in N s/m (of law "kuwabara-kono" in N s/m^1.5).

    Of law "dissipative" ``damping_factor`` is a; v0 is floored at ``minimum_impact_speed_m_s``. Where its
    first factor turns negative it would pull: the force is zero there, unless it ``may_pull``. Kelvin-Voigt's
    force is left as it is until delta = 0.
    """

    stiffness: float
    exponent: float = field(default=1.5, metadata={WRITTEN_OUT: (1.0, 1.5)})
    damping_factor: float = 0.0
    damping_N_s_m: float = 0.0
    minimum_impact_speed_m_s: float = MINIMUM_IMPACT_SPEED_M_S
    may_pull: bool = False
    kind: str = "dissipative"

    @property
    def clipped(self) -> bool:
        """Whether the force is clipped where the law would pull."""
        return (self.damping_factor != 0 or self.kind != "dissipative") and not self.may_pull


@dataclass(frozen=True)
class RigidWall:
    """A wall that does not give (see ``impacts``): Newton's restitution, of the normal speed.

    An approach slower than ``minimum_impact_speed_m_s`` closes without rebound.
    """

    restitution: float
    minimum_impact_speed_m_s: float = 0.0


def power(x: Scalar, exponent: Scalar) -> Scalar:
    """Return x to the power of an exponent, by multiplication and square root where that is enough."""
    if exponent == 1.0:
        return x
    return x * sqrt(x) if exponent == 1.5 else x**exponent


def dissipative(law: ContactLaw, depth: Scalar, memory: Scalar) -> tuple[Scalar, Scalar]:
    """Return elastic force and damper of F = K delta^n (1 + a delta'/v0) + c delta'; the memory is a/v0.

    All of ``DAMPING_FACTORS`` are of this kind, v0 the approach speed at the start of the present contact;
    so are Hertz's law, the linear one, and Kelvin and Voigt's with a = 0.
    """
    elastic = law.stiffness * power(depth, law.exponent)
    return elastic, (elastic * memory if law.damping_factor else 0.0) + law.damping_N_s_m


def kuwabara_kono(law: ContactLaw, depth: Scalar, memory: Scalar) -> tuple[Scalar, Scalar]:  # noqa: ARG001
    """Return elastic force and damper of F = K delta^n + D delta^0.5 delta', n = 1.5 (Kuwabara-Kono 1987)."""
    return law.stiffness * power(depth, law.exponent), law.damping_N_s_m * sqrt(depth)


#: The normal laws by kind.
NORMAL_LAWS = {"dissipative": dissipative, "kuwabara-kono": kuwabara_kono}


# Friction: mu F_n f(v) against the sliding speed v at the contact point; none where F_n is clipped. Where a
# law may pull, F_n is negative and friction drives the sliding, as Exudyn's contact has it.


def saturated_linear(law: FrictionLaw, sliding: Scalar) -> Scalar:
    """Return f(v) = v/v_reg within -1 and 1."""
    return smaller(1.0, larger(-1.0, sliding / law.regularisation_speed_m_s))


def ambrosio(law: FrictionLaw, sliding: Scalar) -> Scalar:
    """Return f(v), 0 in the dead band, of size 1 from v_reg on, linear between (Ambrosio 2003)."""
    ramp = law.regularisation_speed_m_s - law.dead_band_speed_m_s
    part = (abs(sliding) - law.dead_band_speed_m_s) / ramp
    return signed(smaller(1.0, larger(0.0, part)), sliding)


def hyperbolic(law: FrictionLaw, sliding: Scalar) -> Scalar:
    """Return f(v) = tanh(v/v_reg)."""
    return tanh(sliding / law.regularisation_speed_m_s)


#: The friction laws by kind: the part of mu F_n that acts at a sliding speed in m/s, with the speed's sign.
FRICTION_LAWS = {"saturated-linear": saturated_linear, "ambrosio": ambrosio, "tanh": hyperbolic}


def steepest(law: FrictionLaw) -> float:
    """Return the largest slope of the law's f(v), in s/m."""
    return 1 / (law.regularisation_speed_m_s - law.dead_band_speed_m_s)


@dataclass(frozen=True)
class ClearanceJoint(Ends):
    """A pin of body j at ``point_j`` in a bearing of body i at ``point_i``, of ``bearing_radius_m`` R_i.

    Its law says how the bearing's wall answers: it gives, and is a contact, or it is rigid. A pin that
    follows a rigid wall has one row of [B] (see ``constraints.following``). Friction on a rigid wall holds as
    it is while the pin follows it; in impacts, which are over at once and leave no speed to regularise, its
    coefficient is Coulomb's.
    """

    radial_clearance_m: float
    bearing_radius_m: float
    law: Any
    friction: FrictionLaw | None = None

    @property
    def rigid(self) -> bool:
        """Whether the wall is rigid."""
        return isinstance(self.law, RigidWall)


def joint_of(pin: Pin) -> ClearanceJoint:
    """Return the joint of a pin with clearance.

    Raises:
        OverflowError: the stiffness of its wall is none.
    """
    ends, room = (pin.body_i, pin.point_i, pin.body_j, pin.point_j), pin.clearance
    assert room is not None
    ends = (*ends[2:], *ends[:2]) if pin.bearing_on_j else ends
    if room.law == "rigid":
        wall = RigidWall(room.restitution or 0.0, room.minimum_impact_speed_m_s or 0.0)
        return ClearanceJoint(*ends, room.radial_clearance_m, room.bearing_radius_m, wall, room.friction)
    if not math.isfinite(stiffness := stiffness_of(room)):
        name = "radial_clearance_m" if room.radial_clearance_m <= sys.float_info.min else "young_modulus_Pa"
        got = f"{getattr(room, name):g}"
        raise OverflowError(f"{name}: expected one whose stiffness is no overflow, got {got}")
    factor, floor, damping = damping_factor_of(room), minimum_impact_speed_of(room), room.damping_N_s_m or 0.0
    kind = room.law if room.law in NORMAL_LAWS else "dissipative"
    law = ContactLaw(stiffness, exponent_of(room), factor, damping, floor, room.may_pull, kind)
    return ClearanceJoint(*ends, room.radial_clearance_m, room.bearing_radius_m, law, room.friction)


def rates_of(joint: ClearanceJoint, number: int) -> list[str]:
    """Return the names of what a contact adds up: normal force and losses.

    Losses are, of a compliant contact, by the normal force and where that is clipped; of a rigid wall, in
    impacts and in closings; of both by friction.
    """
    names = ["normal", "impact", "closing"] if joint.rigid else ["normal", "loss"]
    if not joint.rigid and joint.law.clipped:
        names.append("clip")
    return [f"{name}{number}" for name in [*names, *(["slide"] if joint.friction else [])]]


def contact_force(
    joint: ClearanceJoint, phase: Scalar, memory: Scalar, state: State
) -> tuple[Forces, list[Scalar], Scalar]:
    """Return the generalised forces of a contact in its phase, its ``rates_of`` in N and W, and friction.

    That is the force on the pin along t, in N.
    """
    bearing, pin = ends_of(joint, state)
    d, d_dot, law = pin.place - bearing.place, pin.rate - bearing.rate, joint.law

    def closed() -> tuple[Scalar, ...]:
        distance = sqrt(d @ d)
        n = array([d[0] / distance, d[1] / distance])
        depth, rate = larger(distance - joint.radial_clearance_m, 0.0), n @ d_dot
        elastic, damper = NORMAL_LAWS[law.kind](law, depth, memory)
        normal, loss, clip, slide = elastic + damper * rate, damper * rate * rate, 0.0, 0.0
        if law.clipped:  # the law would pull: no force, and the spring's energy is lost
            clipped = phase > CONTACT
            normal, loss = choose(clipped, 0.0, normal), choose(clipped, 0.0, loss)
            clip = choose(clipped, -elastic * rate, 0.0)
        force, twist_i, twist_j, tangential = -normal * n, 0.0, 0.0, 0.0
        if joint.friction is not None:
            arm_i = joint.bearing_radius_m + 0.5 * depth
            arm_j = joint.bearing_radius_m - joint.radial_clearance_m - 0.5 * depth
            sliding = n[0] * d_dot[1] - n[1] * d_dot[0] + pin.spin * arm_j - bearing.spin * arm_i
            # Where a law pulls, friction has the force's sign and drives the sliding, as in Exudyn's contact.
            pressing = normal if law.may_pull else larger(normal, 0.0)
            share = FRICTION_LAWS[joint.friction.law](joint.friction, sliding)
            tangential = -(joint.friction.coefficient * pressing * share)
            slide, twist_i, twist_j = -tangential * sliding, -arm_i * tangential, arm_j * tangential
            force = force + tangential * array([-n[1], n[0]])
        return (*force, twist_i, twist_j, normal, loss, clip, slide, tangential)

    x, y, twist_i, twist_j, normal, loss, clip, slide, tangential = when(phase > FLIGHT, closed, 9)
    rates = [normal, loss] + law.clipped * [clip] + (joint.friction is not None) * [slide]
    return pair(bearing, pin, array([x, y]), twist_i, twist_j), rates, tangential


def gap(joint: ClearanceJoint, phase: Scalar, memory: Scalar, state: State, pressing: Scalar) -> list[Scalar]:
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
        law = joint.law
        elastic, damper = NORMAL_LAWS[law.kind](law, larger(depth, LEAST_DEPTH * c), memory)
        return elastic, damper, 1.0 + damper / elastic * (g_rate * c / distance)

    elastic, damper, push = (0.0, 0.0, pressing) if joint.rigid else when(phase > FLIGHT, closed, 3)
    return [0.5 * (d @ d - c * c) / c, g_rate, sqrt(d_dot @ d_dot), depth, elastic, damper, push]


@dataclass(frozen=True)
class Separation:
    """Where the pin of a joint with a rigid wall stands, at a state of n coordinates.

    ``distance`` is |d|. Rows (n,) give speeds from {q'}: ``normal`` and ``tangent`` those of above, and
    ``across`` that of the pin's centre along t. ``rate`` is the normal speed, and ``turning`` the part of
    |d|'' d.d/|d| that is there without accelerations, so that (d.d/2)''/|d| = normal {q''} + turning.
    ``noise`` and ``rate_noise`` are the round-off of |d| in m and of |d|' in m/s, by the size of their terms.
    """

    distance: Scalar
    normal: Array
    tangent: Array
    across: Array
    rate: Scalar
    turning: Scalar
    noise: Scalar
    rate_noise: Scalar


def separation(joint: ClearanceJoint, state: State) -> Separation:
    """Return a joint's separation; a pin at its bearing's very centre has n along +x."""
    bearing, pin = ends_of(joint, state)
    d, d_dot = pin.place - bearing.place, pin.rate - bearing.rate
    distance = sqrt(d @ d)
    apart = distance > 0.0
    length = choose(apart, distance, 1.0)
    normal = array([choose(apart, d[0] / length, 1.0), d[1] / length])
    tangent = array([-normal[1], normal[0]])
    radii = -joint.bearing_radius_m, joint.bearing_radius_m - joint.radial_clearance_m
    turning = normal @ (pin.centripetal - bearing.centripetal) + choose(apart, d_dot @ d_dot / length, 0.0)
    sizes = [joint.radial_clearance_m, 0.0]
    for body, point in ((joint.body_i, joint.point_i), (joint.body_j, joint.point_j)):
        x, y, _ = (abs(value) for value in state.position(body))
        v_x, v_y, spin = (abs(value) for value in state.velocity(body))
        lever = larger(*map(abs, point))
        sizes = [sizes[0] + larger(x, y) + lever, sizes[1] + larger(v_x, v_y) + spin * lever]

    # u.d' = u.(p_j' - p_i') along a direction u: the row of a ``following`` with u for d
    def row(direction: Array, twist: tuple[Scalar, Scalar] = (0.0, 0.0)) -> Array:
        entries: list[Scalar] = [0.0] * len(state.q)
        for point, sign, radius in zip((bearing, pin), (-1, 1), twist, strict=True):
            if point.body != GROUND:
                x, y, turn = sign * (direction @ point.jacobian)
                entries[3 * point.body : 3 * point.body + 3] = [x, y, turn + radius]
        return array(entries)

    rows = row(normal), row(tangent, radii), row(tangent)
    return Separation(distance, *rows, normal @ d_dot, turning, *(ROUND_OFF * terms for terms in sizes))
