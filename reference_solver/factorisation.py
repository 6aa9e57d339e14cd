"""Elimination of the equations of motion with their constraints, and Gauss's of a small matrix."""

import math
from dataclasses import dataclass

from reference_solver.tape import Array, Scalar, Value, array, both, named, size

#: Rows left, a constraint among them, at which no quotient waits for another: they are multiplied up instead.
FEW = 3


@dataclass(frozen=True)
class Pivot:
    """A row k: 1 over its diagonal entry, its other entries, and these over the diagonal one, or 0 for 1/0.

    With a ``scale`` other than 1 all that are left are multiplied by it, the diagonal entry, and not divided.
    """

    k: int
    reciprocal: Scalar
    column: dict[int, Scalar]
    parts: dict[int, Scalar]
    scale: Scalar

    def forward(self, z: list[Scalar]) -> None:
        """Take the row out of what is left of a right-hand side."""
        taken = self.parts if _is_one(self.scale) else self.column
        for i, entry in taken.items():
            z[i] = z[i] * self.scale - entry * z[self.k]

    def back(self, z: list[Scalar]) -> None:
        """Put the solution in its place, those behind being there."""
        z[self.k] = z[self.k] * self.reciprocal
        for i, part in self.parts.items():
            z[self.k] = z[self.k] - part * z[i]


@dataclass(frozen=True)
class Pair:
    """A coordinate k and a constraint r, in which it has the entry ``sign``, together.

    ``mass`` is the coordinate's diagonal entry; ``column`` has its other entries, ``row`` the constraint's.
    """

    k: int
    r: int
    sign: float
    mass: Scalar
    column: dict[int, Scalar]
    row: dict[int, Scalar]

    def forward(self, z: list[Scalar]) -> None:
        """Take both out of what is left of a right-hand side."""
        z[self.r] = self.sign * z[self.r]
        force = self.sign * (z[self.k] - self.mass * z[self.r])
        for i, entry in self.column.items():
            z[i] = z[i] - entry * z[self.r]
        for i, entry in self.row.items():
            z[i] = z[i] - entry * force

    def back(self, z: list[Scalar]) -> None:
        """Put the solution in its places, those behind being there."""
        force, motion = z[self.k], z[self.r]
        for i, entry in self.row.items():
            motion = motion - self.sign * entry * z[i]
        for i, entry in self.column.items():
            force = force - entry * z[i]
        z[self.k], z[self.r] = motion, self.sign * (force - self.mass * motion)


class Factors:
    """Elimination of [M]{x} - [B]^T{y} = {F}, [B]{x} = {c}; [M] (n, n) is positive definite, [B] (m, n).

    Where a coordinate has the entry 1 or -1 in a constraint, both go first, and no quotient is taken: the
    coordinate follows from others, as a bar's centre from its angle. What is left are few coordinates, whose
    matrix is as positive definite, and then the constraints between them (Benzi, Golub and Liesen 2005: the
    null-space method, and then the Schur complement's). That row comes first each time which has the least
    entries, so that few zeros fill in.

    ``condition`` tells how nearly constraints depend on each other: it is 1, and 1 for each that goes with a
    coordinate, and for each other one its square over that of what the ones before have left of it, in the
    norm of [M]^-1; 1 + m where all are orthogonal, 1/eps where they depend on each other, NaN where an entry
    is. ``ok`` says whether it is below 1 over ``tolerance``, and pivots of coordinates are positive: no NaN.
    """

    def __init__(self, M: Array, B: Array, tolerance: float = 0.0) -> None:
        n, above, below = len(M), M.tolist(), B.tolist()
        whole = [[*row, *(other[k] for other in below)] for k, row in enumerate(above)]
        whole += [[*row, *[0.0] * len(below)] for row in below]
        self._rows = [{j: x for j, x in enumerate(row) if not _is_zero(x)} for row in whole]
        self._n, self._left, self._steps = n, set(range(len(whole))), list[Pivot | Pair]()
        while pairs := [pair for k in self._left if k < n for pair in self._pairs(k)]:
            self._take_pair(*min(pairs)[1:])
        self.condition: Scalar = 1.0 + len(self._steps)
        self.ok: Scalar = True
        scale: Scalar = 1.0
        while self._left:
            pivot = self._take(min(self._left, key=lambda k: (k >= n, len(self._rows[k]), k)))
            if pivot.k >= n:
                row = enumerate(below[pivot.k - n])
                squares = [x * x * (1.0 / above[j][j]) for j, x in row if not _is_zero(x)]
                part = size(sum(squares, 0.0) * pivot.reciprocal * scale)
                self.condition = self.condition + (math.inf if _is_zero(pivot.reciprocal) else part)
            elif not _is_known(pivot.reciprocal):
                self.ok = both(self.ok, pivot.reciprocal > 0.0)
            scale = scale * pivot.scale
        self.ok = both(self.ok, tolerance * self.condition < 1.0)

    def solve(self, F: Array, c: Array) -> tuple[Array, Array]:
        """Return {x} (n,) and {y} (m,), or (n, k) and (m, k) for as many right-hand sides."""
        z = [*F, *c] if F.ndim > 1 else [*F.tolist(), *c.tolist()]
        for step in self._steps:
            step.forward(z)
        for step in reversed(self._steps):
            step.back(z)
        return array(z[: self._n]).reshape(F.shape), -array(z[self._n :]).reshape(c.shape)

    def _pairs(self, k: int) -> list[tuple[int, int, int]]:
        """Return the pairs of a coordinate, the one that fills in least being the least."""
        row = self._rows[k]
        return [(len(row) * len(self._rows[r]), k, r) for r, x in row.items() if r >= self._n and _is_one(x)]

    def _taken(self, k: int) -> dict[int, Scalar]:
        """Return a row, taken out of those that are left."""
        self._left.discard(k)
        for i in self._rows[k].keys() - {k}:
            del self._rows[i][k]
        return self._rows[k]

    def _take_pair(self, k: int, r: int) -> None:
        column, row = self._taken(k), self._taken(r)
        mass, sign = column.pop(k, 0.0), column.pop(r)
        entries = [(i, column.get(i, 0.0), row.get(i, 0.0)) for i in sorted({*column, *row})]
        for i, u, w in entries:
            for j, other_u, other_w in entries:
                if j <= i:
                    change = sign * (u * other_w + w * other_u) - mass * (w * other_w)
                    self._set(i, j, self._rows[i].get(j, 0.0) - change)
        self._steps.append(Pair(k, r, sign, mass, column, row))

    def _take(self, k: int) -> Pivot:
        column = self._taken(k)
        pivot = column.pop(k, 0.0)
        is_few = len(column) == len(self._left) < FEW and max(column, default=0) >= self._n
        scale = pivot if is_few and not _is_known(pivot) else 1.0
        reciprocal = named(f"r{k}", 0.0 if _is_zero(pivot) else 1.0 / pivot)
        parts = {i: named(f"l{i}_{k}", x * reciprocal) for i, x in column.items()}
        taken = parts if _is_one(scale) else column
        for i in column:
            for j in column:
                if j <= i:
                    self._set(i, j, self._rows[i].get(j, 0.0) * scale - taken[i] * column[j])
        step = Pivot(k, reciprocal, column, parts, scale)
        self._steps.append(step)
        return step

    def _set(self, i: int, j: int, new: Scalar) -> None:
        for a, b in {(i, j), (j, i)}:
            self._rows[a].pop(b, None)
            if not _is_zero(new):
                self._rows[a][b] = new


def _is_zero(x: Scalar) -> bool:
    return not isinstance(x, Value) and bool(x == 0)


def _is_known(x: Scalar) -> bool:
    return isinstance(x, Value) and x.node.known


def _is_one(x: Scalar) -> bool:
    return not isinstance(x, Value) and bool(abs(x) == 1)


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
