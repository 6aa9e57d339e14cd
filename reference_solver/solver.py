"""Equations (11)-(13): fixed-step classical RK4 from the initial state, with stabilisation and recording."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from reference_solver.equations import Baumgarte, Equations
from reference_solver.errors import InconsistentStart, NonFiniteState
from reference_solver.mechanism import Mechanism

FloatArray = NDArray[np.float64]

#: The paper's own algorithm, Baumgarte's feedback, or a projection of q and q' after every step.
Stabilisation = Literal["none", "projection"] | Baumgarte

#: Largest violation of the constraints accepted at t = 0 in m and rad, and, per unit of speed, in velocity.
START_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Solution:
    """The sampled motion of a mechanism with n coordinates and m constraint rows, at s equally spaced times.

    ``time_s`` (s,), ``q`` and ``v`` (s, n), ``multipliers`` (s, m) by the rows of [B] (see ``row_slices``),
    and ``constraint_work_J`` (s,), the work of the drivers: the integral of {lambda}^T{C} by RK4's own
    quadrature.
    """

    time_s: FloatArray
    q: FloatArray
    v: FloatArray
    multipliers: FloatArray
    constraint_work_J: FloatArray


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


def _check_start(equations: Equations, q: FloatArray, v: FloatArray) -> None:
    gap = np.abs(equations.violation(0.0, q)).max(initial=0)
    if not gap <= START_TOLERANCE:
        raise InconsistentStart(
            f"initial positions: expected the constraints to hold, got a violation of {gap:.3g}"
        )
    rate = np.abs(equations.constraint_matrix(q) @ v - equations.C).max(initial=0)
    if not rate <= START_TOLERANCE * (1 + np.abs(v).max()):
        raise InconsistentStart(f"initial velocities: expected [B]q' = C, got a violation of {rate:.3g}")


def solve(
    mechanism: Mechanism,
    q: FloatArray,
    v: FloatArray,
    *,
    end_time_s: float,
    samples: int,
    steps_per_sample: int,
    stabilisation: Stabilisation = "projection",
) -> Solution:
    """Integrate from coordinates q and velocities v, each (3 x bodies,), and record ``samples + 1`` states.

    The step is ``end_time_s / (samples * steps_per_sample)``.

    Raises:
        InconsistentStart: q or v violate the constraints.
        SingularConfiguration: the constraint matrix loses full row rank.
        NonFiniteState: the state overflows.
    """
    q, v = np.array(q, dtype=float), np.array(v, dtype=float)
    baumgarte = stabilisation if isinstance(stabilisation, Baumgarte) else None
    equations = Equations(mechanism, q, baumgarte)
    _check_start(equations, q, v)
    h = end_time_s / (samples * steps_per_sample)
    time = np.linspace(0.0, end_time_s, samples + 1)
    work = 0.0
    records = [(q, v, equations.accelerations(0.0, q, v)[1], work)]
    for sample in range(samples):
        for step in range(steps_per_sample):
            t = (sample * steps_per_sample + step) * h
            with np.errstate(over="ignore", invalid="ignore"):
                q, v, done = rk4_step(equations, t, q, v, h)
            work += done
            if not np.isfinite(v).all():
                raise NonFiniteState(t + h, h)
            if stabilisation == "projection":
                q, v = project(equations, t + h, q, v)
        records.append((q, v, equations.accelerations(time[sample + 1], q, v)[1], work))
    qs, vs, multipliers, works = (np.array(column) for column in zip(*records, strict=True))
    return Solution(time, qs, vs, multipliers, works)
