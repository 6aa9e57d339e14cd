"""RK4, equations (11)-(13), and the projection, around the readable ``equations``: slow, the text to read."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from reference_solver.equations import Equations
from reference_solver.errors import NonFiniteState

FloatArray = NDArray[np.float64]


def rk4_step(
    equations: Equations, t: float, q: FloatArray, v: FloatArray, h: float
) -> tuple[FloatArray, FloatArray, float]:
    """Return q, v and the drivers' work after one classical RK4 step of (11)-(12): Z1' = Z2, Z2' = A."""
    A1, lambda1 = equations.accelerations(t, q, v)
    v2 = v + h / 2 * A1
    A2, lambda2 = equations.accelerations(t + h / 2, q + h / 2 * v, v2)
    v3 = v + h / 2 * A2
    A3, lambda3 = equations.accelerations(t + h / 2, q + h / 2 * v2, v3)
    v4 = v + h * A3
    A4, lambda4 = equations.accelerations(t + h, q + h * v3, v4)
    work = h / 6 * (lambda1 + 2 * (lambda2 + lambda3) + lambda4) @ equations.C
    return q + h / 6 * (v + 2 * (v2 + v3) + v4), v + h / 6 * (A1 + 2 * (A2 + A3) + A4), float(work)


def project(equations: Equations, t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the state moved onto the constraints: the least change in the norm of [M], first q, then q'.

    One Newton step for q, which leaves a violation quadratic in the one before; q' is exact.
    """
    q, v, _ = project_with_loss(equations, t, q, v)
    return q, v


def project_with_loss(
    equations: Equations, t: float, q: FloatArray, v: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the state that ``project`` does, and the energy in J that it has lost in being moved.

    Both energies are differences of nearly equal numbers, so they are not taken as such. Positions move by
    -[M]^-1[B]^T{mu}, along which the forces with a potential, {Q}, do the work -{mu}^T[B][M]^-1{Q}: exactly
    where they are constant, else but for terms quadratic in the move, which is itself of order h^5. Of
    velocities, T(v) - T(v') = (v - v')^T[M](v + v')/2, with v' as rounded: what rounding adds the next
    projection removes, and both have to be counted.
    """
    if not len(equations.C):  # LAPACK takes no empty matrix
        return q, v, 0.0
    B = equations.constraint_matrix(q)
    mu, _ = lapack.dpotrs(equations.factor(t, q, B), equations.violation(t, q), lower=1)
    move = equations.inverse_mass * (B.T @ mu)
    removed = -move @ equations.stored_force(q)
    q = q - move
    B = equations.constraint_matrix(q)
    mu, _ = lapack.dpotrs(equations.factor(t, q, B), B @ v - equations.C, lower=1)
    new_v = v - equations.inverse_mass * (B.T @ mu)
    removed += np.sum((v - new_v) * (v + new_v) / equations.inverse_mass) / 2
    return q, new_v, float(removed)


class ReadableStepper:
    """Takes steps of size h from t = 0 with the readable equations.

    ``stabilisation_loss_J`` is the energy that the projections, or Baumgarte's feedback, have removed in all
    steps so far. The feedback's is its power at the start of each step times h: within a step, RK4's stages
    violate the constraints by more than the solution does.
    """

    def __init__(self, equations: Equations, h: float, projected: bool) -> None:
        self._equations, self._h, self._projected = equations, h, projected
        self.stabilisation_loss_J = 0.0

    def advance(self, q: FloatArray, v: FloatArray, first: int, count: int) -> float:
        """Take steps number first to first + count - 1 in place; return the drivers' work.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            NonFiniteState: the state overflows.
        """
        work = 0.0
        for step in range(first, first + count):
            t = step * self._h
            removed = self._h * self._equations.feedback_power(t, q, v)
            with np.errstate(over="ignore", invalid="ignore"):
                q[:], v[:], done = rk4_step(self._equations, t, q, v, self._h)
            if not (np.isfinite(q).all() and np.isfinite(v).all()):
                raise NonFiniteState(t + self._h, self._h)
            if self._projected:
                q[:], v[:], removed = project_with_loss(self._equations, t + self._h, q, v)
            work += done
            self.stabilisation_loss_J += removed
        return work

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda} (m,) at a state."""
        return self._equations.accelerations(t, q, v)[1]
