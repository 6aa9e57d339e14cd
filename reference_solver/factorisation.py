"""L D L^T of a sparse symmetric positive definite matrix, and Gauss's elimination of a small one."""

import math

from reference_solver.tape import Array, Scalar, array, named, size


class Factors:
    """L D L^T of a matrix (m, m), eliminated in the order of least degree, so that few zeros fill in.

    ``condition`` is 1 plus the sum of diagonal entries over their pivots: 1 + m where rows are orthogonal,
    1/eps where they depend on each other, NaN where an entry is. ``ok`` says whether it is below 1 over
    ``tolerance``.
    """

    def __init__(self, matrix: Array, tolerance: float) -> None:
        rows = [{j: x for j, x in enumerate(row) if x != 0} for row in matrix.tolist()]
        diagonal, left = [row.get(k, 0.0) for k, row in enumerate(rows)], set(range(len(rows)))
        self.condition: Scalar = 1.0
        #: Of each row in the order of elimination: its number, its pivot's reciprocal, and L's entries below.
        self._steps: list[tuple[int, Scalar, dict[int, Scalar]]] = []
        while left:
            k = min(left, key=lambda row: (len(rows[row]), row))
            left.discard(k)
            pivot, column = rows[k].pop(k, 0.0), rows[k]
            reciprocal = named(f"r{k}", 1.0 / pivot if pivot != 0 else math.inf)
            self.condition = self.condition + size(diagonal[k] * reciprocal)
            below = {i: named(f"l{i}_{k}", x * reciprocal) for i, x in column.items()}
            for i in below:
                del rows[i][k]
                for j in below:
                    if j <= i:
                        rows[i][j] = rows[j][i] = rows[i].get(j, 0.0) - below[i] * column[j]
            self._steps.append((k, reciprocal, below))
        self.ok: Scalar = tolerance * self.condition < 1.0

    def solve(self, right: Array) -> Array:
        """Return x (m,) with the matrix times x equal to the right-hand side, or (m, k) for k of them."""
        z = list(right) if right.ndim > 1 else right.tolist()
        for k, _, below in self._steps:
            for i, factor in below.items():
                z[i] = z[i] - factor * z[k]
        for k, reciprocal, below in reversed(self._steps):
            z[k] = z[k] * reciprocal
            for i, factor in below.items():
                z[k] = z[k] - factor * z[i]
        return array(z).reshape(right.shape)


def eliminated(matrix: Array, right: Array) -> tuple[Array, list[Scalar]]:
    """Return x (k,) with a small matrix (k, k) times x equal to the right-hand side, and the pivots."""
    A, z, size = matrix.copy(), right.copy(), len(right)
    for k in range(size):
        for i in range(k + 1, size):
            factor = A[i, k] / A[k, k]
            A[i, k + 1 :] = A[i, k + 1 :] - factor * A[k, k + 1 :]
            z[i] = z[i] - factor * z[k]
    for k in reversed(range(size)):
        z[k] = (z[k] - A[k, k + 1 :] @ z[k + 1 :]) / A[k, k]
    return z, [A[k, k] for k in range(size)]
