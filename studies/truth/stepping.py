"""Two steps of order 13 or so that share nothing: Gragg, Bulirsch and Stoer's, and Radau IIA's collocation.

The first is explicit and extrapolates the midpoint rule (Hairer, Norsett, Wanner 1993, II.9); the second is
implicit, for stiff contacts and friction (Hairer, Wanner 1996, IV.5). Both are unlike DOP853, by which the
solver under test goes. Each fills the state after h, loops closed, and returns its error over the tolerance,
``REJECT`` or more where there is no number.

A state is (2, state) here: z, and what round-off has left out of it so far (Kahan 1965).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from studies.truth.machine import allocating
from studies.truth.record import Packed, moving

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: Columns of the extrapolation: the midpoint rule in 2, 4, ... 2 COLUMNS parts.
COLUMNS = 7
#: Most iterations of Newton's method in a step, and where they end: parts of the speeds' scale.
ITERATIONS, CONVERGED, STALLED = 12, 2e-16, 1e-13
REJECT = 1e6


class Method(NamedTuple):
    """The order of the error's estimate in h, the tolerance, and collocation's coefficients.

    ``A`` (s, s) integrates from 0 to each node what passes through values at the nodes; ``twice`` is its
    square; ``estimate`` (s,) is the weights' difference to a rule without the first node.
    """

    order: float
    tolerance: float
    A: FloatArray
    twice: FloatArray
    estimate: FloatArray


class Problem(NamedTuple):
    """What a step is of: ``rates`` of a mechanism in its phases (k, 3), and what errors are parts of.

    This ``scale`` (state,) is infinite for coordinates that are driven or close loops.
    """

    method: Method
    rates: Any
    p: Packed
    phases: FloatArray
    scale: FloatArray


def extrapolation(tolerance: float) -> Method:
    """Return the method of ``extrapolated``."""
    return Method(2.0 * COLUMNS - 1, tolerance, np.zeros((1, 1)), np.zeros((1, 1)), np.zeros(1))


def radau(stages: int, tolerance: float) -> Method:
    """Return the method of ``collocated``: the nodes are the zeros of P_(s-1)(2c - 1) - P_s(2c - 1)."""
    series = np.zeros(stages + 1)
    series[-2:] = 1.0, -1.0
    nodes = (np.sort(legendre.legroots(series).real) + 1) / 2
    nodes[-1] = 1.0
    A = _integrals(nodes, nodes)
    estimate = A[-1] - np.concatenate([[0.0], _integrals(nodes[1:], np.ones(1))[0]])
    return Method(float(stages), tolerance, A, A @ A, estimate)


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


def extrapolated(of: Problem, y: FloatArray, h: float, out: FloatArray) -> float:
    """Step by extrapolation, of changes rather than states: their round-off is smaller."""
    z, rates = y[0], of.rates
    state = len(z)
    first, present, now, there = np.empty(state), np.empty(state), np.empty(state), np.empty(state)
    before, T, told = np.empty(state), np.empty((COLUMNS, state)), np.empty(of.p.told)
    rates(of.p, of.phases, z, first, told)
    for j in range(COLUMNS):
        halves = 2 * (j + 1)
        H = h / halves
        for k in range(state):
            before[k], present[k] = 0.0, H * first[k]
        for _ in range(halves - 1):
            for k in range(state):
                there[k] = z[k] + present[k]
            rates(of.p, of.phases, there, now, told)
            for k in range(state):
                before[k], present[k] = present[k], before[k] + 2 * H * now[k]
        T[j] = present
        for i in range(j - 1, -1, -1):
            ratio = (j + 1.0) / (i + 1.0)
            factor = 1.0 / (ratio * ratio - 1.0)
            for k in range(state):
                T[i, k] = T[i + 1, k] + (T[i + 1, k] - T[i, k]) * factor
    return _end(of, y, T[0], T[0] - T[1], out)


@allocating
def _end(of: Problem, y: FloatArray, change: FloatArray, off: FloatArray, out: FloatArray) -> float:
    """Fill the state after a change, closing its loops; return the error of which ``off`` is the estimate."""
    rates, error = of.rates, 0.0
    for k in range(len(change)):
        by = change[k] + y[1, k]
        out[0, k] = y[0, k] + by
        added = out[0, k] - y[0, k]
        out[1, k] = (y[0, k] - (out[0, k] - added)) + (by - added)
        error = max(error, abs(off[k]) / of.scale[k])
    rates(of.p, of.phases, out[0], np.empty(len(change)), np.empty(of.p.told))
    return error / of.method.tolerance if np.all(np.isfinite(out)) and error >= 0.0 else REJECT


def collocated(of: Problem, y: FloatArray, h: float, out: FloatArray) -> float:
    """Step by collocation, with Newton's method on the accelerations at the nodes."""
    z, rates, method = y[0], of.rates, of.method
    free, (stages, state, size) = moving(of.p), (len(method.A), len(z), of.p.size)
    n, told, speeds, first = len(free), np.empty(of.p.told), of.scale[size : 2 * size], np.empty(state)
    rates(of.p, of.phases, z, first, told)
    matrix = _newton_matrix(of, z, h, first[size : 2 * size], free)
    if not np.all(np.isfinite(matrix)):
        return REJECT
    inverse = np.ascontiguousarray(np.linalg.inv(matrix)) if n else matrix
    found, a, residual = np.empty((stages, state)), np.empty((stages, size)), np.empty(stages * n)
    change, there = np.zeros(state), np.empty(state)
    a[:] = first[size : 2 * size]
    before = np.inf
    for _ in range(ITERATIONS):
        for i in range(stages):
            _fill_change(method, a, y, h, i, change)
            for k in range(state):
                there[k] = z[k] + change[k]
            rates(of.p, of.phases, there, found[i], told)
            for j in range(n):
                residual[i * n + j] = found[i, size + free[j]] - a[i, free[j]]
        correction = inverse @ residual if n else residual
        largest = 0.0
        for i in range(stages):
            for k in range(size):  # of what closes loops or is driven this is the answer
                if speeds[k] == np.inf:
                    a[i, k] = found[i, size + k]
            for j in range(n):
                a[i, free[j]] += correction[i * n + j]
                part = h * abs(correction[i * n + j]) / speeds[free[j]]
                if not part < 1e3:
                    return REJECT
                largest = max(largest, part)
        if largest > 2.0 * before and largest > STALLED:
            return REJECT
        if largest < CONVERGED or (largest < STALLED and largest > 0.5 * before):
            before = 0.0
            break
        before = largest
    if before > STALLED:
        return REJECT
    _fill_change(method, a, y, h, stages - 1, change)
    off = np.zeros(state)
    for i in range(stages):
        for k in range(size):
            off[size + k] += h * method.estimate[i] * a[i, k]
        for k in range(2 * size + 1, state):
            change[k] += h * method.A[stages - 1, i] * found[i, k]
            off[k] += h * method.estimate[i] * found[i, k]
    return _end(of, y, change, off, out)


@allocating
def _fill_change(method: Method, a: FloatArray, y: FloatArray, h: float, i: int, change: FloatArray) -> None:
    """Fill what the state changes by up to a node, but for its sums, from the accelerations (s, m) at all."""
    size, c = a.shape[1], 0.0
    for j in range(len(a)):
        c += method.A[i, j]
    for k in range(size):
        place = speed = 0.0
        for j in range(len(a)):
            place += method.twice[i, j] * a[j, k]
            speed += method.A[i, j] * a[j, k]
        change[k] = h * (c * (y[0, size + k] + y[1, size + k]) + h * place)
        change[size + k] = h * speed
    change[2 * size] = c * h


@allocating
def _newton_matrix(of: Problem, z: FloatArray, h: float, f: FloatArray, free: IntArray) -> FloatArray:
    """Return I - h A x df/dz' - h^2 A^2 x df/dz, by differences in the middle of the step."""
    method, rates = of.method, of.rates
    n, stages, size, told = len(free), len(method.A), len(f), np.empty(of.p.told)
    middle, here, there = z.copy(), np.empty(len(z)), np.empty(len(z))
    for k in range(size):
        middle[k] += 0.5 * h * (z[size + k] + 0.25 * h * f[k])
        middle[size + k] += 0.5 * h * f[k]
    middle[2 * size] += 0.5 * h
    rates(of.p, of.phases, middle, here, told)
    matrix = np.eye(stages * n)
    for j in range(n):
        for part in range(2):
            k = part * size + free[j]
            kept, by = middle[k], 1e-7 * of.scale[k]
            middle[k] += by
            rates(of.p, of.phases, middle, there, told)
            middle[k] = kept
            for i in range(n):
                d = (there[size + free[i]] - here[size + free[i]]) / by
                for r in range(stages):
                    for s in range(stages):
                        weight = h * method.A[r, s] if part else h * h * method.twice[r, s]
                        matrix[r * n + i, s * n + j] -= weight * d
    return matrix
