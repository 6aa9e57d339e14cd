"""The places of a mechanism at one state: loops closed by Newton's method, rates and accelerations of rows.

Letters are those of ``tree``. This is machine code: it neither allocates nor counts references.
"""

import math

import numpy as np
from numpy.typing import NDArray

from studies.truth.machine import bare, within
from studies.truth.tree import ALONG, LENGTH, Tree, Work

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: Newton's method ends with a change of this part of the coordinates' units: the next would be its square.
CLOSE, ITERATIONS = 1e-9, 25
#: Rates of dependent coordinates, in units, by those of independent ones, from which on others are chosen.
STEEP = 8.0


@bare
def fill_rows(tree: Tree, w: Work, rows: int, terms: int, links: int) -> None:
    """Fill value and J of the first rows, which have so many terms and links, at cosines and sines there."""
    m = len(w.u)
    for k in range(rows):
        w.value[k] = tree.constant[k]
        for i in range(m):
            w.J[k, i] = tree.still[k, i]
    for k in range(links):
        w.value[tree.links[k, 0]] += tree.linear[k] * w.u[tree.links[k, 1]]
    for k in range(terms):
        row, c, way = tree.terms[k, 0], tree.terms[k, 1], tree.terms[k, 2]
        P, Q, cos, sin = tree.turning[k, 0], tree.turning[k, 1], w.turned[c, 0], w.turned[c, 1]
        X, slope = P * cos + Q * sin, Q * cos - P * sin
        w.X[k, 0], w.X[k, 1] = X, slope
        if way < 0:
            w.value[row] += X
            w.J[row, c] += slope
        else:
            w.value[row] += w.u[way] * X
            w.J[row, c] += w.u[way] * slope
            w.J[row, way] += X


@bare
def factor(A: FloatArray, swaps: IntArray) -> None:
    """Replace A by its factors, by Gauss's elimination with row pivots."""
    n = len(A)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        swaps[k] = best
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        for i in range(k + 1, n):
            A[i, k] /= A[k, k]
            part = A[i, k]
            if part != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= part * A[k, j]


@bare
def solve(A: FloatArray, swaps: IntArray, x: FloatArray) -> None:
    """Replace x by the solution of the equations that ``factor`` has prepared."""
    n = len(A)
    for k in range(n):
        if swaps[k] != k:
            x[k], x[swaps[k]] = x[swaps[k]], x[k]
    for i in range(1, n):
        for j in range(i):
            x[i] -= A[i, j] * x[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= A[i, j] * x[j]
        x[i] /= A[i, i]


@bare
def _turn(tree: Tree, w: Work, first: int) -> None:
    """Fill cosines and sines of the coordinates from place ``first`` in ``order`` on that are angles."""
    for k in range(first, len(w.order)):
        c = w.order[k]
        if c < tree.angles:
            w.turned[c, 0], w.turned[c, 1] = math.cos(w.u[c]), math.sin(w.u[c])


@bare
def _factor_closing(tree: Tree, w: Work) -> None:
    n = len(w.order) - tree.closing
    for i in range(tree.closing):
        for j in range(tree.closing):
            w.G[i, j] = w.J[i, w.order[n + j]]
    factor(w.G, w.swaps)


@within
def move(tree: Tree, w: Work) -> None:
    """Close the loops; fill u and its rates v of dependent coordinates, rows, T and bias.

    Independent coordinates, and ``b`` of them, are right; dependent ones are near. NaN where nothing closes.
    """
    m, c = len(w.u), tree.closing
    n, first = m - c, 0
    for _ in range(ITERATIONS if c else 0):
        _turn(tree, w, first)
        first = n
        fill_rows(tree, w, c, tree.closing_terms, tree.closing_links)
        _factor_closing(tree, w)
        for i in range(c):
            w.column[i] = w.value[i]
        solve(w.G, w.swaps, w.column)
        change = 0.0
        for i in range(c):
            k = w.order[n + i]
            w.u[k] -= w.column[i]
            part = abs(w.column[i]) / tree.unit[k]
            if not part <= change:
                change = part
        if change < CLOSE:
            break
    else:
        if c:
            w.u[:] = np.nan
    _turn(tree, w, first)
    fill_rows(tree, w, len(w.value), len(tree.terms), len(tree.links))
    if c:
        _factor_closing(tree, w)
        for j in range(n):
            for i in range(c):
                w.column[i] = -w.J[i, w.order[j]]
            solve(w.G, w.swaps, w.column)
            for i in range(c):
                w.T[w.order[n + i], j] = w.column[i]
        for i in range(n, m):
            k, rate = w.order[i], 0.0
            for j in range(n):
                rate += w.T[k, j] * w.v[w.order[j]]
            w.v[k] = rate
    _fill_bias(tree, w)


@within
def _fill_bias(tree: Tree, w: Work) -> None:
    """Fill what rows have beside J T z'', and ``b`` of dependent coordinates."""
    m, c, rows = len(w.u), tree.closing, len(w.value)
    n = m - c
    for k in range(rows):
        w.bias[k] = 0.0
    for k in range(len(tree.terms)):
        row, way, turn = tree.terms[k, 0], tree.terms[k, 2], w.v[tree.terms[k, 1]]
        if way < 0:
            w.bias[row] -= turn * turn * w.X[k, 0]
        else:
            w.bias[row] += turn * (2.0 * w.v[way] * w.X[k, 1] - turn * w.u[way] * w.X[k, 0])
    for i in range(c):
        w.column[i] = -w.bias[i]
        for j in range(n):
            w.column[i] -= w.J[i, w.order[j]] * w.b[w.order[j]]
    if c:
        solve(w.G, w.swaps, w.column)
    for i in range(c):
        w.b[w.order[n + i]] = w.column[i]
    for k in range(tree.acting, rows):
        for i in range(m):
            w.bias[k] += w.J[k, i] * w.b[i]


@bare
def make_rows(tree: Tree, w: Work) -> None:
    """Fill value and J of the rows that are made of two others."""
    for k in range(len(tree.made)):
        kind, row, x, c = tree.made[k, 0], tree.made[k, 1], tree.made[k, 2], tree.made[k, 3]
        d_x, d_y = w.value[x], w.value[x + 1]
        if kind == LENGTH:
            w.value[row] = math.hypot(d_x, d_y)
            length = w.value[row] if w.value[row] > 0 else 1.0  # without one it has no direction
            along_x, along_y = d_x / length, d_y / length
        else:
            cos, sin, a, b = w.turned[c, 0], w.turned[c, 1], tree.along[k, 0], tree.along[k, 1]
            along_x, along_y = a * cos - b * sin, a * sin + b * cos
            w.value[row] = along_x * d_x + along_y * d_y
        for i in range(len(w.u)):
            w.J[row, i] = along_x * w.J[x, i] + along_y * w.J[x + 1, i]
        if kind == ALONG:
            w.J[row, c] += along_x * d_y - along_y * d_x


@bare
def choose(tree: Tree, w: Work, driven: int) -> None:
    """Choose the coordinates that depend on the others, at a state of which J is known.

    They are pivots, by size in units, of Gauss's elimination; the driven one is none, and gaps' come last.
    """
    m, c, G = len(w.u), tree.closing, w.pivots
    n = m - c
    for j in range(m):
        w.used[j] = 1 if j == driven else 0
        for i in range(c):
            G[i, j] = w.J[i, j] * tree.unit[j]
    largest = 0.0
    for k in range(c):
        best, row, column = 0.0, -1, -1
        for last in range(2):
            for j in range(m):
                if w.used[j] == 0 and tree.is_gap[j] == last:
                    for i in range(k, c):
                        if abs(G[i, j]) > best:
                            best, row, column = abs(G[i, j]), i, j
            if best > 1e-6 * largest:
                break
        largest = max(largest, best)
        if column < 0:
            return
        w.used[column] = 2
        for j in range(m):
            G[k, j], G[row, j] = G[row, j], G[k, j]
        for i in range(k + 1, c):
            part = G[i, column] / G[k, column]
            for j in range(m):
                G[i, j] -= part * G[k, j]
    at, behind = 0, n
    if driven >= 0:
        w.order[0], at = driven, 1
    for j in range(m):
        if w.used[j] == 2:
            w.order[behind] = j
            behind += 1
        elif j != driven:
            w.order[at] = j
            at += 1
    w.T[:] = 0.0
    for k in range(m):
        w.place[w.order[k]] = k
        if k < n:
            w.T[w.order[k], k] = 1.0


@bare
def determinant(tree: Tree, w: Work) -> float:
    """Return the determinant of G_dep, in units, at the state last moved to; 1 without loops.

    It is 0 in a position in which loops are singular: there are several ways on from there.
    """
    found, n = 1.0, len(w.u) - tree.closing
    for i in range(tree.closing):
        unit = tree.unit[w.order[n + i]]
        found *= w.G[i, i] * unit if w.swaps[i] == i else -w.G[i, i] * unit
    return found


@bare
def steepness(tree: Tree, w: Work) -> float:
    """Return the largest rate of a dependent coordinate by an independent one that is no gap, in units."""
    m, n, largest = len(w.u), len(w.u) - tree.closing, 0.0
    for j in range(n):
        k = w.order[j]
        for i in range(n, m):
            if tree.is_gap[k] == 0:
                largest = max(largest, abs(w.T[w.order[i], j]) * tree.unit[k] / tree.unit[w.order[i]])
    return largest


@bare
def look(tree: Tree, w: Work, z: FloatArray) -> None:
    """Fill all rows at coordinates that close loops, as a choice of independent ones needs them."""
    for i in range(len(w.u)):
        w.u[i] = z[i]
    _turn(tree, w, 0)
    fill_rows(tree, w, len(w.value), len(tree.terms), len(tree.links))
