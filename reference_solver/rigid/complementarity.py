"""Small systems of equations and linear complementarity problems, as of a few contacts at once.

Numba compiles this module as it stands, into that of ``settling``. All memory is the caller's: ``room`` is a
matrix of at least k rows and k + 2 columns.
"""

import numpy as np
from numba.extending import register_jitable

from reference_solver.contact.loop import INNER

EPS = float(np.finfo(float).eps)
#: Units of the largest term by which a solution may miss its conditions.
SLACK = 16
#: Part of its diagonal's product below which a minor is round-off.
LEAST_MINOR = 1e-12


@register_jitable(**INNER)
def eliminate(room, k):
    """Eliminate the k unknowns of ``room`` (k, k + 1) in place, with complete pivoting.

    Return the rank, and the determinant if that is k. Numbers of the unknowns in their new order are left in
    column k + 1.
    """
    determinant, largest = 1.0, 0.0
    for i in range(k):
        room[i, k + 1] = i
    for step in range(k):
        row, column, pivot = step, step, 0.0
        for i in range(step, k):
            for j in range(step, k):
                if abs(room[i, j]) > pivot:
                    row, column, pivot = i, j, abs(room[i, j])
        largest = max(largest, pivot)
        if not pivot > k * EPS * largest:
            return step, 0.0
        for j in range(k + 1):
            room[row, j], room[step, j] = room[step, j], room[row, j]
        for i in range(k):
            room[i, column], room[i, step] = room[i, step], room[i, column]
        room[column, k + 1], room[step, k + 1] = room[step, k + 1], room[column, k + 1]
        determinant *= room[step, step] if (row == step) == (column == step) else -room[step, step]
        for i in range(step + 1, k):
            factor = room[i, step] / room[step, step]
            for j in range(step, k + 1):
                room[i, j] -= factor * room[step, j]
    return k, determinant


@register_jitable(**INNER)
def solve(room, k, x):
    """Solve the equations in ``room``, matrix and right-hand side (k, k + 1), for x (k,); return the rank.

    Of equations that depend on each other as their right-hand sides do, a solution has zeros for what they
    leave open.
    """
    rank, _ = eliminate(room, k)
    for i in range(k - 1, -1, -1):
        total = 0.0
        if i < rank:
            total = room[i, k]
            for j in range(i + 1, rank):
                total -= room[i, j] * room[j, k]
            total /= room[i, i]
        room[i, k] = total
    for i in range(k):
        x[int(room[i, k + 1])] = room[i, k]
    return rank


@register_jitable(**INNER)
def is_in(case, i, k):
    """Return whether a case, a number below 2^k, has i of k among its members."""
    return (case >> (k - 1 - i)) & 1 == 1


@register_jitable(**INNER)
def members(case, k):
    """Return how many members a case has."""
    count = 0
    for i in range(k):
        count += is_in(case, i, k)
    return count


@register_jitable(**INNER)
def complementary(W, b, k, z, trial, room):
    """Set z (k,) to z >= 0, W z + b >= 0 and z.(W z + b) = 0, for a W with positive principal minors.

    The solution is unique (Cottle, Pang and Stone 1992); symmetric positive definite is enough. Where
    round-off leaves several sets of positive z nearly right, the one that violates its signs least is taken,
    and of equals the smallest. ``trial`` (k,) is memory.
    """
    scale, least = 0.0, np.inf
    for i in range(k):
        z[i], scale = 0.0, max(scale, abs(b[i]))
    for size in range(k + 1):
        for case in range(1 << k):
            if members(case, k) != size:
                continue
            row = 0
            for i in range(k):
                if is_in(case, i, k):
                    column = 0
                    for j in range(k):
                        if is_in(case, j, k):
                            room[row, column], column = W[i, j], column + 1
                    room[row, size], row = -b[i], row + 1
            if solve(room, size, trial) < size:  # these contacts repeat one another: fewer will do
                continue
            violation = 0.0
            for i in range(k):
                row, total = 0, b[i]
                for j in range(k):
                    if is_in(case, j, k):
                        violation = max(violation, -trial[row] * W[j, j])
                        total, row = total + W[i, j] * trial[row], row + 1
                if not is_in(case, i, k):
                    violation = max(violation, -total)
            if violation < least:
                row, least = 0, violation
                for i in range(k):
                    z[i] = 0.0
                    if is_in(case, i, k):
                        z[i], row = max(trial[row], 0.0), row + 1
            if least <= SLACK * EPS * scale:
                return


@register_jitable(**INNER)
def minor(W, case, k, room):
    """Return a principal minor of W (k, k), and the product of its diagonal."""
    row, product = 0, 1.0
    for i in range(k):
        if is_in(case, i, k):
            column, product = 0, product * W[i, i]
            for j in range(k):
                if is_in(case, j, k):
                    room[row, column], column = W[i, j], column + 1
            row += 1
    for i in range(row):
        room[i, row] = 0.0
    return eliminate(room, row)[1], product


@register_jitable(**INNER)
def least_minor_ratio(W, of, k, room):
    """Return the least ratio of the principal minors of W to those of the matrix ``of``, both (k, k).

    Minors of ``of`` that are round-off beside the product of its diagonal are left out; 1 with none left.
    """
    least = 1.0
    for case in range(1, 1 << k):
        reference, product = minor(of, case, k, room)
        if reference > LEAST_MINOR * product:
            least = min(least, minor(W, case, k, room)[0] / reference)
    return least
