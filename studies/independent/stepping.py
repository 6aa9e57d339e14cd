"""Two steps of order 13 or so that share nothing: Gragg, Bulirsch and Stoer's, and Radau IIA's collocation.

The first is explicit and extrapolates the midpoint rule (Hairer, Norsett, Wanner 1993, II.9); the second is
implicit, for stiff contacts and friction (Hairer, Wanner 1996, IV.5). Both are unlike DOP853, by which the
solver under test goes. Each fills the state after h and returns its error over the tolerance.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.polynomial import legendre

from studies.independent import drives, equations, loads, mechanism
from studies.independent.equations import STATE, SUMS, TIME
from studies.independent.mechanism import SIZE, FloatArray, Mechanism

#: Modules whose text the machine code has taken over.
COMPILED_WITH = (drives, loads, mechanism, equations)
#: Columns of the extrapolation: the midpoint rule in 2, 4, ... 2 COLUMNS parts.
COLUMNS = 7
#: Most iterations of Newton's method in a step, and where they end: parts of the speeds' scale.
ITERATIONS, CONVERGED, STALLED = 12, 2e-16, 1e-13
REJECT = 1e6


class Table(NamedTuple):
    """The order of the error's estimate in h, the tolerance, and collocation's coefficients.

    ``A`` (s, s) integrates from 0 to each node what passes through values at the nodes; ``twice`` is its
    square; ``estimate`` (s,) is the weights' difference to a rule without the first node.
    """

    order: float
    tolerance: float
    A: FloatArray
    twice: FloatArray
    estimate: FloatArray


def extrapolation(tolerance: float) -> Table:
    """Return the table of ``extrapolated``."""
    return Table(2.0 * COLUMNS - 1, tolerance, np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1))


def radau(stages: int, tolerance: float) -> Table:
    """Return the table of ``collocated``: the nodes are the zeros of P_(s-1)(2c - 1) - P_s(2c - 1)."""
    series = np.zeros(stages + 1)
    series[-2:] = 1.0, -1.0
    nodes = (np.sort(legendre.legroots(series).real) + 1) / 2
    nodes[-1] = 1.0
    A = _integrals(nodes, nodes)
    estimate = A[-1] - np.concatenate([[0.0], _integrals(nodes[1:], np.ones(1))[0]])
    return Table(float(stages), tolerance, A, A @ A, estimate)


def _integrals(nodes: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the integrals from 0 to each end of Lagrange's polynomials on the nodes, by Gauss's rule."""
    places, weights = legendre.leggauss(len(nodes))
    out = np.empty((len(ends), len(nodes)))
    for i, end in enumerate(ends):
        x = end * (places + 1) / 2
        for j, node in enumerate(nodes):
            others = np.delete(nodes, j)
            values = np.prod((x[:, None] - others) / (node - others), axis=1)
            out[i, j] = end / 2 * weights @ values
    return out


def extrapolated(
    table: Table,
    rates: Any,
    m: Mechanism,
    phases: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    h: float,
    out: FloatArray,
) -> float:
    """Step by extrapolation, of changes rather than states: their round-off is smaller."""
    first, present, now = np.empty(STATE), np.empty(STATE), np.empty(STATE)
    before, after = np.empty(STATE), np.empty(STATE)
    T, told = np.empty((COLUMNS, STATE)), np.empty((4, 3))
    rates(m, phases, y, first, told)
    for j in range(COLUMNS):
        parts = 2 * (j + 1)
        H = h / parts
        before[:] = 0.0
        present[:] = H * first
        for _ in range(parts - 1):
            rates(m, phases, y + present, now, told)
            after[:] = before + 2 * H * now
            before[:] = present
            present[:] = after
        T[j] = present
        for i in range(j - 1, -1, -1):
            ratio = (j + 1.0) / (i + 1.0)
            T[i] = T[i + 1] + (T[i + 1] - T[i]) / (ratio * ratio - 1.0)
    error = 0.0
    for i in range(STATE):
        out[i] = y[i] + T[0, i]
    for i in range(TIME):
        off = abs(T[0, i] - T[1, i]) / scale[i]
        if not off <= error:
            error = off
    return error / table.tolerance if error == error else REJECT


def collocated(
    table: Table,
    rates: Any,
    m: Mechanism,
    phases: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    h: float,
    out: FloatArray,
) -> float:
    """Step by collocation, with Newton's method on the accelerations at the nodes."""
    stages, free = len(table.A), m.bodies.free
    n, told = len(free), np.empty((4, 3))
    here = np.empty(STATE)
    rates(m, phases, y, here, told)
    matrix = _newton_matrix(table, rates, m, phases, scale, y, h, here[SIZE:TIME].copy())
    if not np.all(np.isfinite(matrix)):
        return REJECT
    inverse = np.linalg.inv(matrix)
    found, a, residual = np.empty((stages, STATE)), np.empty((stages, SIZE)), np.empty(stages * n)
    a[:] = here[SIZE:TIME]
    before = np.inf
    for _ in range(ITERATIONS):
        for i in range(stages):
            _node_state(table, a, y, h, i, out)
            rates(m, phases, out, found[i], told)
            for j in range(n):
                residual[i * n + j] = found[i, SIZE + free[j]] - a[i, free[j]]
        change = inverse @ residual
        size = 0.0
        for i in range(stages):
            for j in range(n):
                a[i, free[j]] += change[i * n + j]
                part = h * abs(change[i * n + j]) / scale[SIZE + free[j]]
                if not part <= size:
                    size = part
            if free[0] > 0:  # that of a crank whose speed is prescribed goes by the time alone
                part = h * abs(a[i, 0] - found[i, SIZE]) / scale[SIZE]
                a[i, 0] = found[i, SIZE]
                size = max(size, part)
        if not size < 1e3 or (size > 2.0 * before and size > STALLED):
            return REJECT
        if size < CONVERGED or (size < STALLED and size > 0.5 * before):
            before = 0.0
            break
        before = size
    if before > STALLED:
        return REJECT
    _node_state(table, a, y, h, stages - 1, out)
    for k in range(SUMS, STATE):
        for i in range(stages):
            out[k] += h * table.A[stages - 1, i] * found[i, k]
    error = 0.0
    for j in range(n):
        off = 0.0
        for i in range(stages):
            off += table.estimate[i] * a[i, free[j]]
        error = max(error, h * abs(off) / scale[SIZE + free[j]])
    return error / table.tolerance


@njit(error_model="numpy")
def _node_state(table: Table, a: FloatArray, y: FloatArray, h: float, i: int, out: FloatArray) -> None:
    """Fill the state at a node, but for its sums, from the accelerations (s, 7) at all."""
    c = 0.0
    out[:] = y
    for j in range(len(a)):
        c += table.A[i, j]
    for k in range(SIZE):
        place = speed = 0.0
        for j in range(len(a)):
            place += table.twice[i, j] * a[j, k]
            speed += table.A[i, j] * a[j, k]
        out[k] += h * (c * y[SIZE + k] + h * place)
        out[SIZE + k] += h * speed
    out[TIME] += c * h


@njit(error_model="numpy")
def _newton_matrix(
    table: Table,
    rates: Any,
    m: Mechanism,
    phases: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    h: float,
    f: FloatArray,
) -> FloatArray:
    """Return I - h A x df/dw' - h^2 A^2 x df/dw, by differences in the middle of the step."""
    stages, free = len(table.A), m.bodies.free
    n, told = len(free), np.empty((4, 3))
    middle = y.copy()
    for k in range(SIZE):
        middle[k] += 0.5 * h * (y[SIZE + k] + 0.25 * h * f[k])
        middle[SIZE + k] += 0.5 * h * f[k]
    here, there = np.empty(STATE), np.empty(STATE)
    rates(m, phases, middle, here, told)
    matrix = np.eye(stages * n)
    for j in range(n):
        for part in range(2):
            k = part * SIZE + free[j]
            kept, by = middle[k], 1e-7 * scale[k]
            middle[k] += by
            rates(m, phases, middle, there, told)
            middle[k] = kept
            for i in range(n):
                d = (there[SIZE + free[i]] - here[SIZE + free[i]]) / by
                for p in range(stages):
                    for q in range(stages):
                        weight = h * table.A[p, q] if part else h * h * table.twice[p, q]
                        matrix[p * n + i, q * n + j] -= weight * d
    return matrix
