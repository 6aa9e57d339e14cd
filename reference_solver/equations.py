"""Equations (1)-(10) of Grigore, Stanescu and Pandrea (ECCOMAS 2008), in their order: the text to read.

Letters are the paper's: M, B, C, F, q, lambda. The constraint force is +B^T lambda. ``_dot`` is a time
derivative. Position-level constraints g, needed for stabilisation only, are measured from the start: a guide
keeps the body's initial angle, and a driver's angle is the initial one plus speed times t.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from reference_solver.arrays import MechanismArrays
from reference_solver.contact import add_contact_force
from reference_solver.contact_events import CONTACT
from reference_solver.errors import NonFiniteState, SingularConfiguration
from reference_solver.mechanism import GROUND, Mechanism, SpringDamper

FloatArray = NDArray[np.float64]

#: A Cholesky pivot that is mere round-off, relative to its diagonal entry: the row depends on earlier rows.
PIVOT_TOLERANCE_PER_ROW = 64 * float(np.finfo(float).eps)


@dataclass(frozen=True)
class Baumgarte:
    """Baumgarte's (1972) gains in 1/s: -2 alpha (B q' - C) - beta^2 g joins the right-hand side of (4)."""

    alpha_s: float
    beta_s: float


class Equations:
    """The paper's equations for one mechanism with n = 3 x bodies coordinates and m constraint rows.

    ``q_start`` (n,) are the initial coordinates, from which g is measured.
    """

    def __init__(self, mechanism: Mechanism, q_start: FloatArray, baumgarte: Baumgarte | None = None) -> None:
        self._arrays = MechanismArrays(mechanism, q_start)
        self._springs = [load for load in mechanism.loads if isinstance(load, SpringDamper)]
        self._baumgarte = baumgarte
        self._n = 3 * len(mechanism.bodies)
        self._contacts = mechanism.contacts
        #: Phase and a/v0 of every contact (2K,), constant between events (see ``contact_loop``).
        self.phases = np.zeros(2 * len(mechanism.contacts))
        #: {C} (m,): what the constraint rows ask of [B]{q'}; not zero in drivers' rows alone.
        self.C = self._arrays.C
        self.inverse_mass = self._arrays.inverse_mass

    def _arms(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return, for every revolute joint, the arms from both bodies' centres to its points, each (2, r)."""
        a, coordinates = self._arrays, np.append(q, np.zeros(3))  # the frame's coordinates
        return _turned(coordinates[a.phi_i], a.point_i), _turned(coordinates[a.phi_j], a.point_j)

    def _link_arms(self, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return, for every massless link, d from point i to point j and the two arms, each (2, l)."""
        a, coordinates = self._arrays, np.append(q, np.zeros(3))
        arm_i = _turned(coordinates[a.link_i[2]], a.link_point_i)
        arm_j = _turned(coordinates[a.link_j[2]], a.link_point_j)
        return coordinates[a.link_j[:2]] + arm_j - coordinates[a.link_i[:2]] - arm_i, arm_i, arm_j

    def constraint_matrix(self, q: FloatArray) -> FloatArray:
        """Return [B] (m, n) of (1), [B]{q'} = {C}."""
        a, (arm_i, arm_j) = self._arrays, self._arms(q)
        B = a.E.copy()
        B[a.row, a.phi_i], B[a.row + 1, a.phi_i] = arm_i[1], -arm_i[0]
        B[a.row, a.phi_j], B[a.row + 1, a.phi_j] = -arm_j[1], arm_j[0]
        if len(a.link_row):
            d, arm_i, arm_j = self._link_arms(q)
            B[a.link_row, a.link_i] = -d[0], -d[1], d[0] * arm_i[1] - d[1] * arm_i[0]
            B[a.link_row, a.link_j] = d[0], d[1], d[1] * arm_j[0] - d[0] * arm_j[1]
        return np.asarray(B[:, : self._n])

    def centripetal(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return [B']{q'} (m,) of (4): minus omega^2 times the arms, body j less body i.

        Of a link it is d'.d' + d.d'', with d'' of the arms' turning alone.
        """
        a, (arm_i, arm_j) = self._arrays, self._arms(q)
        rates = np.append(v, np.zeros(3))
        B_dot_v = np.zeros(len(self.C))
        B_dot_v[a.row], B_dot_v[a.row + 1] = rates[a.phi_i] ** 2 * arm_i - rates[a.phi_j] ** 2 * arm_j
        if len(a.link_row):
            d, arm_i, arm_j = self._link_arms(q)
            rate_i, rate_j = rates[a.link_i], rates[a.link_j]
            d_dot = rate_j[:2] + rate_j[2] * _across(arm_j) - rate_i[:2] - rate_i[2] * _across(arm_i)
            d_dot_dot = rate_i[2] ** 2 * arm_i - rate_j[2] ** 2 * arm_j
            B_dot_v[a.link_row] = np.sum(d_dot**2 + d * d_dot_dot, axis=0)
        return B_dot_v

    def violation(self, t: float, q: FloatArray) -> FloatArray:
        """Return {g} (m,): gaps in m, angles in rad, links' in m^2; its time derivative is [B]{q'} - {C}."""
        a, (arm_i, arm_j) = self._arrays, self._arms(q)
        g = a.E[:, : self._n] @ q + a.d - self.C * t
        gap = arm_j - arm_i
        g[a.row], g[a.row + 1] = g[a.row] + gap[0], g[a.row + 1] + gap[1]
        if len(a.link_row):
            g[a.link_row] += np.sum(self._link_arms(q)[0] ** 2, axis=0) / 2
        return np.asarray(g)

    def applied_force(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {F(q, q')} (n,) of (2): gravity, torques, springs and dampers, contacts."""
        return self._force(q, v, self.phases)

    def stored_force(self, q: FloatArray) -> FloatArray:
        """Return the part of {F} (n,) that has a potential: gravity, torques, springs, elastic contacts.

        It is what is applied at rest; a clipped contact still stores its elastic energy.
        """
        phases = self.phases.copy()
        phases[::2] = np.minimum(phases[::2], CONTACT)
        return self._force(q, np.zeros(self._n), phases)

    def _force(self, q: FloatArray, v: FloatArray, phases: FloatArray) -> FloatArray:
        if not self._springs and not self._contacts:
            return np.asarray(self._arrays.F)
        F: FloatArray = self._arrays.F.copy()
        for spring in self._springs:
            self._add_spring(F, spring, q, v)
        for joint, (phase, damping) in zip(self._contacts, phases.reshape(-1, 2), strict=True):
            add_contact_force(F, joint, phase, damping, q, v)
        return F

    def _add_spring(self, F: FloatArray, spring: SpringDamper, q: FloatArray, v: FloatArray) -> None:
        ends = []
        for body, (x, y) in ((spring.body_i, spring.point_i), (spring.body_j, spring.point_j)):
            if body == GROUND:
                ends.append((np.array([x, y]), np.array([x, y]), np.zeros(2)))
                continue
            cos, sin = np.cos(q[3 * body + 2]), np.sin(q[3 * body + 2])
            arm = np.array([cos * x - sin * y, sin * x + cos * y])
            rate = v[3 * body : 3 * body + 2] + v[3 * body + 2] * np.array([-arm[1], arm[0]])
            ends.append((q[3 * body : 3 * body + 2] + arm, arm, rate))
        (point_i, arm_i, rate_i), (point_j, arm_j, rate_j) = ends
        length = np.linalg.norm(point_j - point_i)
        direction = (point_j - point_i) / length
        tension = spring.stiffness_N_m * (length - spring.free_length_m)
        tension += spring.damping_N_s_m * direction @ (rate_j - rate_i)
        for body, arm, force in (
            (spring.body_i, arm_i, tension * direction),
            (spring.body_j, arm_j, -tension * direction),
        ):
            if body != GROUND:
                F[3 * body : 3 * body + 3] += [*force, arm[0] * force[1] - arm[1] * force[0]]

    def factor(self, t: float, q: FloatArray, B: FloatArray) -> FloatArray:
        """Return the lower Cholesky factor (m, m) of [B][M]^-1[B]^T; its inverse (6) is never formed.

        Raises:
            SingularConfiguration: [B] has not full row rank, by the smallest pivot.
            NonFiniteState: it has overflowed.
        """
        G = (B * self.inverse_mass) @ B.T
        if not np.isfinite(G).all():
            raise NonFiniteState(t)
        L, info = lapack.dpotrf(G, lower=1)
        threshold = len(G) * PIVOT_TOLERANCE_PER_ROW
        if info != 0 or np.any(L.diagonal() ** 2 < threshold * G.diagonal()):
            scaled = B * np.sqrt(self.inverse_mass)
            size = np.linalg.norm(scaled, axis=1, keepdims=True)
            scaled = np.divide(scaled, size, out=np.zeros_like(scaled), where=size > 0)
            rank = int(np.linalg.matrix_rank(scaled, tol=np.sqrt(threshold)))
            raise SingularConfiguration(rank, len(B), t, q)
        return np.asarray(L)

    def accelerations(self, t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return {q''} = {A} (n,) and the multipliers {lambda} (m,), equations (3)-(10).

        Raises:
            SingularConfiguration: [B] has not full row rank.
        """
        B, F = self.constraint_matrix(q), self.applied_force(q, v)
        if not len(B):  # LAPACK takes no empty matrix
            return self.inverse_mass * F, np.zeros(0)
        # (4), (5): {C'} is zero, since prescribed speeds are constant.
        right = -self.centripetal(q, v) - B @ (self.inverse_mass * F)
        if self._baumgarte is not None:
            right -= self._feedback(self._baumgarte, t, q, v, B)
        # (6)-(8)
        lambda_, _ = lapack.dpotrs(self.factor(t, q, B), right, lower=1)
        # (9), (10)
        return self.inverse_mass * (F + B.T @ lambda_), lambda_

    def feedback_power(self, t: float, q: FloatArray, v: FloatArray) -> float:
        """Return the power in W that Baumgarte's feedback takes away; 0 without one.

        The feedback adds -[M]*(2 alpha g' + beta^2 g) to {lambda}, with g' = [B]{q'} - {C}, and its forces do
        the power of these multipliers times [B]{q'}. The part times {C} is in the drivers' work already; what
        is left, and removed, is g'^T [M]* (2 alpha g' + beta^2 g): a damper and a spring of the violation.

        The other multipliers' power on the violation, {lambda}^T g', is not counted. It pays for a violation
        that RK4's error has put in without work, and with it the ledger's residual is larger, not smaller.
        """
        if self._baumgarte is None or not len(self.C):
            return 0.0
        B = self.constraint_matrix(q)
        x, _ = lapack.dpotrs(self.factor(t, q, B), B @ v - self.C, lower=1)
        return float(x @ self._feedback(self._baumgarte, t, q, v, B))

    def _feedback(
        self, gains: Baumgarte, t: float, q: FloatArray, v: FloatArray, B: FloatArray
    ) -> FloatArray:
        drift = B @ v - self.C
        return np.asarray(2 * gains.alpha_s * drift + gains.beta_s**2 * self.violation(t, q))


def _turned(angle: FloatArray, point: FloatArray) -> FloatArray:
    """Return points (2, r) of bodies at the angles (r,) in the global frame, from the bodies' centres."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([cos * point[0] - sin * point[1], sin * point[0] + cos * point[1]])


def _across(arm: FloatArray) -> FloatArray:
    """Return arms (2, r) turned by 90 degrees counter-clockwise."""
    return np.array([-arm[1], arm[0]])
