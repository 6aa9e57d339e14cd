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
    B = equations.constraint_matrix(q)
    correction, _ = lapack.dpotrs(equations.factor(t, q, B), equations.violation(t, q), lower=1)
    q = q - equations.inverse_mass * (B.T @ correction)
    B = equations.constraint_matrix(q)
    correction, _ = lapack.dpotrs(equations.factor(t, q, B), B @ v - equations.C, lower=1)
    return q, v - equations.inverse_mass * (B.T @ correction)


class ReadableStepper:
    """Takes steps of size h from t = 0 with the readable equations."""

    def __init__(self, equations: Equations, h: float, projected: bool) -> None:
        self._equations, self._h, self._projected = equations, h, projected

    def advance(self, q: FloatArray, v: FloatArray, first: int, count: int) -> float:
        """Take steps number first to first + count - 1 in place; return the drivers' work.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            NonFiniteState: the state overflows.
        """
        work = 0.0
        for step in range(first, first + count):
            t = step * self._h
            with np.errstate(over="ignore", invalid="ignore"):
                q[:], v[:], done = rk4_step(self._equations, t, q, v, self._h)
            if not (np.isfinite(q).all() and np.isfinite(v).all()):
                raise NonFiniteState(t + self._h, self._h)
            if self._projected:
                q[:], v[:] = project(self._equations, t + self._h, q, v)
            work += done
        return work

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda} (m,) at a state."""
        return self._equations.accelerations(t, q, v)[1]
