"""The equations of motion while pins follow their walls, with friction: the text to read.

A pin that follows has one row g = (d.d - c^2)/2 of [B], and F_n = -lambda c presses it inwards. Friction is
F_t = -mu F_n f(v_t) on the pin along t, with v_t the sliding speed and f one of the friction laws, which are
regularised: F_t is a function of the state and of F_n, also at v_t = 0, where a pin creeps rather than
sticks. With T the row of sliding speed, which holds the torque arms R_i and R_j = R_i - c of both bodies,

    {q''} = [M]^-1 ({F} + [B]^T {lambda} + [T]^T {tau}),   tau = s lambda of the pin's own row, s = mu c f.

Friction in r joints so changes the matrix of {lambda} by rank r, and makes it unsymmetric. [B][M]^-1[B]^T is
factored as ever. With {lambda}_0 of no friction, [X] = ([B][M]^-1[B]^T)^-1 [B][M]^-1[T]^T and [X]_R those of
its rows that belong to the r pins,

    {lambda} = {lambda}_0 - [X]{tau},   ([1] + [S][X]_R) {tau} = [S] {lambda}_0R,   [S] = diag(s).

The pivots of this small matrix are, joint by joint, what friction makes of the joint's mobility along its
normal, as a part of the one it has without. They have to be positive: otherwise a wall that pushes harder
would bring the pin nearer (Painleve 1895; Genot and Brogliato 1999), and no force fits.

Friction is a damper of v_t of rate mu F_n f' w at most, w = [T][M]^-1([T]^T - [B]^T[X]) being the mobility
along t that the rows leave. Classical RK4 is stable up to h rate = 2.785. The step has to keep below with the
law's steepest f', wherever v_t is: a reversal may come within any step, and a step beyond the limit would
throw v_t from side to side.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from reference_solver.contact import friction_share
from reference_solver.contact_laws import FrictionLaw
from reference_solver.equations import Equations
from reference_solver.errors import SolverError
from reference_solver.mechanism import Mechanism
from reference_solver.rigid_joint import JointGeometry, RigidJoint

FloatArray = NDArray[np.float64]

#: Classical RK4's limit of h times a damper's rate, on the negative real axis.
RK4_DAMPER_LIMIT = 2.785
#: The least part of a normal mobility that friction may leave: below are round-off and forces without bound.
LEAST_MOBILITY = 1e-9


class PainleveParadox(SolverError):
    """Friction leaves a pin no motion that answers its wall's push along the normal."""

    def __init__(self, time_s: float, joints: tuple[int, ...]) -> None:
        super().__init__(
            f"rigid joints {', '.join(map(str, joints))} at t = {time_s:.6g} s: with friction the normal "
            "mobility is not positive (Painleve's paradox): lower the friction or use a compliant law"
        )


class FrictionTooStiff(SolverError):
    """The step is too long for the damping by regularised friction; one below ``needed_s`` is not."""

    def __init__(self, time_s: float, h: float, rate: float) -> None:
        self.needed_s = RK4_DAMPER_LIMIT / rate
        super().__init__(
            f"step {h:.3g} s at t = {time_s:.6g} s: friction in rigid joints damps sliding at {rate:.3g} 1/s "
            f"and needs a step below {self.needed_s:.3g} s: shorten the step or raise the "
            "regularisation speed"
        )


def steepest(law: FrictionLaw) -> float:
    """Return the largest slope of the law's f(v), in s/m."""
    return 1 / (law.regularisation_speed_m_s - law.dead_band_speed_m_s)


class FollowingEquations(Equations):
    """The equations with one more row for each joint in ``following``, and friction in these joints.

    ``held`` is the mechanism with those rows, its last.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        joints: tuple[RigidJoint, ...],
        following: tuple[int, ...],
        q_start: FloatArray,
    ) -> None:
        links = tuple(joints[k].link() for k in following)
        self.held = Mechanism(
            mechanism.bodies, (*mechanism.constraints, *links), mechanism.loads, mechanism.gravity_m_s2
        )
        super().__init__(self.held, q_start)
        first = len(self.C) - len(following)
        rubs = [(first + i, k) for i, k in enumerate(following) if joints[k].friction is not None]
        self._rows = np.array([row for row, _ in rubs], dtype=int)
        self._joints = tuple(k for _, k in rubs)
        self._geometry = JointGeometry(mechanism, tuple(joints[k] for k in self._joints))
        self._friction = [law for k in self._joints if (law := joints[k].friction) is not None]
        # Where the normal forces and friction's powers stand behind the drivers' power.
        self._impulse = np.array([1 + k for k in following], dtype=int)
        self._loss = np.array([1 + len(joints) + k for k in self._joints], dtype=int)
        self._lever = np.array([-joints[k].radial_clearance_m for k in following])
        self._sums = 1 + 2 * len(joints)

    def accelerations(self, t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return {q''} (n,) and {lambda} (m,).

        Raises:
            SingularConfiguration: [B] has not full row rank.
            PainleveParadox: friction leaves a pin no mobility along its normal.
        """
        return self._answer(t, q, v)[:2]

    def with_powers(self, t: float, q: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """Return {q''} (n,) and (1 + 2J,) the drivers' power, J normal forces and J powers lost in friction.

        Raises:
            FrictionTooStiff: a step of h is too long at this state.
        """
        accelerations, lambda_, lost, rate = self._answer(t, q, v)
        if h * rate > RK4_DAMPER_LIMIT:
            raise FrictionTooStiff(t, h, rate)
        powers = np.zeros(self._sums)
        powers[0] = lambda_ @ self.C
        powers[self._impulse] = self._lever * lambda_[len(lambda_) - len(self._lever) :]
        powers[self._loss] = lost
        return accelerations, powers

    def friction_forces(self, q: FloatArray, v: FloatArray, lambda_: FloatArray) -> dict[int, float]:
        """Return the force F_t in N on the pins along t by joint, of those that have friction."""
        if not self._joints:
            return {}
        s = self._shares(self._geometry.separation(q, v).tangent @ v)
        return dict(zip(self._joints, (s * lambda_[self._rows]).tolist(), strict=True))

    def _shares(self, sliding: FloatArray) -> FloatArray:
        """Return s = mu c f(v_t) (r,) in m."""
        return self._geometry.clearance_m * [
            law.coefficient * friction_share(law, speed)
            for law, speed in zip(self._friction, sliding, strict=True)
        ]

    def _answer(
        self, t: float, q: FloatArray, v: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """Return {q''} (n,), {lambda} (m,), friction's lost powers (r,) in W and the damper's rate in 1/s."""
        accelerations, lambda_ = super().accelerations(t, q, v)
        if not self._joints:
            return accelerations, lambda_, np.zeros(0), 0.0
        T = self._geometry.separation(q, v).tangent
        sliding, B = T @ v, self.constraint_matrix(q)
        s = self._shares(sliding)
        weighted = self.inverse_mass[:, None] * T.T
        X, _ = lapack.dpotrs(self.factor(t, q, B), B @ weighted, lower=1)
        answer = weighted - (B * self.inverse_mass).T @ X
        small = np.eye(len(s)) + s[:, None] * X[self._rows]
        minors = [1.0] + [float(np.linalg.det(small[:k, :k])) for k in range(1, len(s) + 1)]
        pivots = np.divide(minors[1:], minors[:-1])
        if pivots.min() <= LEAST_MOBILITY:
            raise PainleveParadox(t, (self._joints[int(pivots.argmin())],))
        tau = np.linalg.solve(small, s * lambda_[self._rows])
        lambda_ = lambda_ - X @ tau
        # d tau/d v_t of each joint alone: of several the sum is not below the largest rate.
        slopes = [law.coefficient * steepest(law) for law in self._friction]
        pressing = np.maximum(-self._geometry.clearance_m * lambda_[self._rows], 0.0)
        rate = slopes * pressing * np.sum(T.T * answer, axis=0) / small.diagonal()
        return accelerations + answer @ tau, lambda_, -tau * sliding, float(rate.sum())


def rk4_step(
    equations: FollowingEquations, t: float, q: FloatArray, v: FloatArray, h: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, v and the sums (1 + 2J,) of one classical RK4 step of (11)-(12), by the same quadrature.

    Raises:
        SolverError: as ``FollowingEquations.with_powers``.
    """
    A1, P1 = equations.with_powers(t, q, v, h)
    v2 = v + h / 2 * A1
    A2, P2 = equations.with_powers(t + h / 2, q + h / 2 * v, v2, h)
    v3 = v + h / 2 * A2
    A3, P3 = equations.with_powers(t + h / 2, q + h / 2 * v2, v3, h)
    v4 = v + h * A3
    A4, P4 = equations.with_powers(t + h, q + h * v3, v4, h)
    sums = h / 6 * (P1 + 2 * (P2 + P3) + P4)
    return q + h / 6 * (v + 2 * (v2 + v3) + v4), v + h / 6 * (A1 + 2 * (A2 + A3) + A4), sums
