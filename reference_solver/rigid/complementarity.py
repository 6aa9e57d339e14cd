"""Small linear complementarity problems, as of a few contacts at once: all cases are tried."""

from itertools import product

import numpy as np

from reference_solver.tape import FloatArray


def complementary(W: FloatArray, b: FloatArray) -> FloatArray:
    """Return z (k,) with z >= 0, W z + b >= 0 and z.(W z + b) = 0, for a W with positive principal minors.

    The solution is unique (Cottle, Pang and Stone 1992); symmetric positive definite is enough. Where
    round-off leaves several sets of positive z nearly right, the one that violates its signs least is taken,
    and of equals the smallest.
    """
    k = len(b)
    scale = np.abs(b).max(initial=0.0)
    best, least = np.zeros(k), np.inf
    for case in sorted(product((False, True), repeat=k), key=sum):
        closed = np.array(case, dtype=bool)
        z = np.zeros(k)
        try:
            z[closed] = np.linalg.solve(W[np.ix_(closed, closed)], -b[closed])
        except np.linalg.LinAlgError:  # these contacts repeat one another: fewer will do
            continue
        violation = max((-z * W.diagonal()).max(initial=0.0), -(W @ z + b)[~closed].min(initial=0.0))
        if violation < least:
            best, least = z, violation
        if least <= 16 * np.finfo(float).eps * scale:
            break
    return np.maximum(best, 0.0)


def least_minor_ratio(W: FloatArray, of: FloatArray) -> float:
    """Return the least ratio of the principal minors of W to those of the matrix ``of``, both (k, k).

    Minors of ``of`` that are round-off beside the product of its diagonal are left out; 1 with none left.
    """
    ratios = [1.0]
    for case in product((False, True), repeat=len(W)):
        block = np.ix_(case, case)
        reference = float(np.linalg.det(of[block]))
        if any(case) and reference > 1e-12 * of.diagonal()[list(case)].prod():
            ratios.append(float(np.linalg.det(W[block])) / reference)
    return min(ratios)
