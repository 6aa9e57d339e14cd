"""The force of one pin in its bearing, written to be read; ``contact_source`` writes the same as code.

d is the vector from bearing centre to pin centre, n = d/|d|, t = (-n_y, n_x). The pin gets -F_n n + F_t t,
the bearing the opposite, both at the point in the middle of the penetration.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_solver.contact_events import CLIPPED, FLIGHT, PROBE
from reference_solver.contact_laws import FrictionLaw
from reference_solver.mechanism import GROUND, ClearanceJoint, Point

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ContactState:
    """One contact at one instant.

    ``gap_m`` is d (2,), ``penetration_m`` |d| - c (negative in flight), ``rate_m_s`` its time derivative,
    ``normal_force_N`` F_n (pushing positive), ``friction_force_N`` F_t along t on the pin.
    """

    gap_m: FloatArray
    penetration_m: float
    rate_m_s: float
    normal_force_N: float
    friction_force_N: float

    @property
    def force_on_pin_N(self) -> FloatArray:
        """Force on body j, (2,), in the global frame."""
        if self.normal_force_N == 0 and self.friction_force_N == 0:
            return np.zeros(2)
        n = self.gap_m / np.hypot(*self.gap_m)
        return np.asarray(-self.normal_force_N * n + self.friction_force_N * np.array([-n[1], n[0]]))


def friction_share(law: FrictionLaw, sliding_m_s: float) -> float:
    """Return the part of mu F_n that acts at a sliding speed, with the speed's sign."""
    if law.kind == "tanh":
        return float(np.tanh(sliding_m_s / law.regularisation_speed_m_s))
    if law.kind == "saturated-linear":
        return float(np.clip(sliding_m_s / law.regularisation_speed_m_s, -1, 1))
    ramp = law.regularisation_speed_m_s - law.dead_band_speed_m_s
    return float(np.copysign(np.clip((abs(sliding_m_s) - law.dead_band_speed_m_s) / ramp, 0, 1), sliding_m_s))


def _pin(
    body: int, point: Point, q: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return a point's arm, place and velocity in the global frame, and its body's angular velocity."""
    if body == GROUND:
        return np.zeros(2), np.array(point), np.zeros(2), 0.0
    x, y, phi = q[3 * body : 3 * body + 3]
    turn = np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])
    arm, spin = turn @ np.array(point), float(v[3 * body + 2])
    return arm, np.array([x, y]) + arm, v[3 * body : 3 * body + 2] + spin * np.array([-arm[1], arm[0]]), spin


def contact_state(
    joint: ClearanceJoint, phase: float, damping_s_m: float, q: FloatArray, v: FloatArray
) -> ContactState:
    """Return the contact at coordinates q and velocities v in a phase, with a/v0 = ``damping_s_m``."""
    _, bearing, bearing_rate, bearing_spin = _pin(joint.body_i, joint.point_i, q, v)
    _, pin, pin_rate, pin_spin = _pin(joint.body_j, joint.point_j, q, v)
    d, d_rate, law = pin - bearing, pin_rate - bearing_rate, joint.law
    distance = float(np.hypot(*d))
    if distance == 0:
        return ContactState(d, -joint.radial_clearance_m, 0.0, 0.0, 0.0)
    n = d / distance
    penetration, rate = distance - joint.radial_clearance_m, float(n @ d_rate)
    if phase == FLIGHT:
        return ContactState(d, penetration, rate, 0.0, 0.0)
    depth = max(penetration, 0.0)
    normal = law.stiffness * depth**law.exponent * (1 + damping_s_m * rate) + law.damping_N_s_m * rate
    normal = {CLIPPED: 0.0, PROBE: 1.0}.get(phase, normal)
    friction = 0.0
    if joint.friction is not None:
        arm_i = joint.bearing_radius_m + depth / 2
        arm_j = joint.bearing_radius_m - joint.radial_clearance_m - depth / 2
        sliding = float(n[0] * d_rate[1] - n[1] * d_rate[0]) + pin_spin * arm_j - bearing_spin * arm_i
        pressing = normal if law.may_pull else max(normal, 0.0)
        friction = -joint.friction.coefficient * pressing * friction_share(joint.friction, sliding)
    return ContactState(d, penetration, rate, normal, friction)


def add_contact_force(
    F: FloatArray, joint: ClearanceJoint, phase: float, damping_s_m: float, q: FloatArray, v: FloatArray
) -> None:
    """Add the generalised force of one contact to {F} (n,)."""
    state = contact_state(joint, phase, damping_s_m, q, v)
    force = state.force_on_pin_N
    depth = max(state.penetration_m, 0.0)
    twist_i = -(joint.bearing_radius_m + depth / 2) * state.friction_force_N
    twist_j = (joint.bearing_radius_m - joint.radial_clearance_m - depth / 2) * state.friction_force_N
    for body, point, sign, twist in (
        (joint.body_i, joint.point_i, -1, twist_i),
        (joint.body_j, joint.point_j, 1, twist_j),
    ):
        if body != GROUND:
            arm = _pin(body, point, q, v)[0]
            moment = sign * (arm[0] * force[1] - arm[1] * force[0]) + twist
            F[3 * body : 3 * body + 3] += [*(sign * force), moment]
