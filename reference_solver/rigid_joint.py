"""A pin in a bearing with clearance between rigid walls: its data and its geometry.

d is the vector from bearing centre to pin centre, n = d/|d|, t = (-n_y, n_x). Contact is at |d| = c, at one
point of both surfaces: R_i from the bearing's centre and R_j = R_i - c from the pin's, along n. Normal speed
is that of approach, n.d', positive outwards; tangential speed is the pin's surface against the bearing's,
along t: t.d' + omega_j R_j - omega_i R_i.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_solver.contact_laws import FrictionLaw
from reference_solver.equations import Equations
from reference_solver.mechanism import GROUND, MasslessLink, Mechanism, Point, RevoluteJoint

FloatArray = NDArray[np.float64]

#: Units in the last place that a few sums and products may lose, with an order of magnitude to spare.
ROUND_OFF = 64 * float(np.finfo(float).eps)


@dataclass(frozen=True)
class RigidJoint:
    """A pin of body j at ``point_j`` in a bearing of body i at ``point_i``, of ``bearing_radius_m`` R_i.

    ``restitution`` is Newton's, of the normal speed. ``friction`` holds as it is while the pin follows the
    wall; in impacts, which are over at once and leave no speed to regularise, its coefficient is Coulomb's.
    An approach slower than ``minimum_impact_speed_m_s`` closes without rebound.
    """

    body_i: int
    point_i: Point
    body_j: int
    point_j: Point
    radial_clearance_m: float
    bearing_radius_m: float
    restitution: float
    friction: FrictionLaw | None = None
    minimum_impact_speed_m_s: float = 0.0

    def __post_init__(self) -> None:
        for field, valid, wanted in (
            ("bearing_radius_m", 0 < self.bearing_radius_m < float("inf"), "a positive number"),
            (
                "radial_clearance_m",
                0 < self.radial_clearance_m < self.bearing_radius_m,
                "a positive number below the bearing's radius",
            ),
            ("restitution", 0 <= self.restitution <= 1, "a number from 0 to 1"),
            (
                "minimum_impact_speed_m_s",
                0 <= self.minimum_impact_speed_m_s < float("inf"),
                "a number from 0",
            ),
        ):
            if not valid:
                raise ValueError(f"RigidJoint.{field}: expected {wanted}, got {getattr(self, field)}")
        if self.friction is not None:
            _check(self.friction)

    @property
    def friction_coefficient(self) -> float:
        """Coulomb's coefficient, 0 without friction."""
        return 0.0 if self.friction is None else self.friction.coefficient

    def link(self) -> MasslessLink:
        """Return the constraint of a pin that follows the wall."""
        return MasslessLink(self.body_i, self.point_i, self.body_j, self.point_j, self.radial_clearance_m)


def _check(friction: FrictionLaw) -> None:
    """Refuse friction that is no number, and a law without a ramp."""
    full = friction.regularisation_speed_m_s
    for field, valid, wanted in (
        ("coefficient", 0 <= friction.coefficient < float("inf"), "a number from 0"),
        ("regularisation_speed_m_s", 0 < full < float("inf"), "a positive number"),
        ("dead_band_speed_m_s", 0 <= friction.dead_band_speed_m_s < full, f"a number from 0 below {full}"),
    ):
        if not valid:
            raise ValueError(f"FrictionLaw.{field}: expected {wanted}, got {getattr(friction, field)}")


@dataclass(frozen=True)
class Separation:
    """Where the pins of J joints stand at a state of n coordinates.

    ``d`` (J, 2), ``distance_m`` (J,); ``normal`` and ``tangent`` (J, n) are the rows that give the normal and
    tangential speeds from {q'}; ``normal_speed`` (J,) and ``turning`` (J,), the part of |d|'' d.d/|d| that is
    there without accelerations, so that (d.d/2)''/|d| = normal {q''} + turning.
    """

    d: FloatArray
    distance_m: FloatArray
    normal: FloatArray
    tangent: FloatArray
    normal_speed: FloatArray
    turning: FloatArray


class JointGeometry:
    """The geometry of J joints of one mechanism: that of revolute joints at the same points, left open."""

    def __init__(self, mechanism: Mechanism, joints: tuple[RigidJoint, ...]) -> None:
        revolutes = tuple(RevoluteJoint(j.body_i, j.point_i, j.body_j, j.point_j) for j in joints)
        n = 3 * len(mechanism.bodies)
        self._equations = Equations(Mechanism(mechanism.bodies, revolutes), np.zeros(n))
        self._joints = joints
        self.clearance_m = np.array([joint.radial_clearance_m for joint in joints])

    def offsets(self, q: FloatArray) -> FloatArray:
        """Return d (J, 2)."""
        return self._equations.violation(0.0, q).reshape(-1, 2)

    def gaps(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return (J, 2): g = (d.d - c^2)/2 in m^2, positive past the wall, and its rate d.d'."""
        system = self._equations.system(0.0, q, v)
        d, rate = system.g.reshape(-1, 2), (system.B @ v).reshape(-1, 2)
        g = (np.sum(d * d, axis=1) - self.clearance_m**2) / 2
        return np.column_stack([g, np.sum(d * rate, axis=1)])

    def separation(self, q: FloatArray, v: FloatArray) -> Separation:
        """Return the joints' separation; a pin at its bearing's very centre has n along +x."""
        system = self._equations.system(0.0, q, v)
        rows = system.B.reshape(len(self._joints), 2, -1)
        d, bending = system.g.reshape(-1, 2), system.B_dot_v.reshape(-1, 2)
        distance = np.hypot(d[:, 0], d[:, 1])
        n = np.where(distance[:, None] > 0, d, [1.0, 0.0]) / np.where(distance > 0, distance, 1.0)[:, None]
        t = np.column_stack([-n[:, 1], n[:, 0]])
        normal, tangent = (np.einsum("ja,jac->jc", direction, rows) for direction in (n, t))
        for k, joint in enumerate(self._joints):
            if joint.body_i != GROUND:
                tangent[k, 3 * joint.body_i + 2] -= joint.bearing_radius_m
            if joint.body_j != GROUND:
                tangent[k, 3 * joint.body_j + 2] += joint.bearing_radius_m - joint.radial_clearance_m
        rate = rows @ v
        squares = np.divide(
            np.sum(rate**2, axis=1), distance, out=np.zeros(len(distance)), where=distance > 0
        )
        turning = squares + np.sum(n * bending, axis=1)
        return Separation(d, distance, normal, tangent, normal @ v, turning)

    def round_off(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return (J, 2): the round-off of |d| in m and of |d|' in m/s, by the size of their terms."""
        position, rate = (np.append(z, np.zeros(3)).reshape(-1, 3) for z in (q, v))
        sizes = np.zeros((len(self._joints), 2))
        for k, joint in enumerate(self._joints):
            for body, point in ((joint.body_i, joint.point_i), (joint.body_j, joint.point_j)):
                arm = np.abs(point).max()
                sizes[k] += np.abs(position[body, :2]).max() + arm, np.abs(rate[body, :2]).max()
                sizes[k, 1] += np.abs(rate[body, 2]) * arm
        return np.asarray(ROUND_OFF * (sizes + np.column_stack([self.clearance_m, np.zeros(len(sizes))])))
