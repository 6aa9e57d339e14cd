"""Elimination of the equations of motion with their constraints, and Gauss's of a small matrix."""

import math
from dataclasses import dataclass

from reference_solver.tape import Array, Scalar, Value, array, both

#: Rows left, a constraint among them, at which no quotient waits for another: they are multiplied up instead.
FEW = 3
#: What a coordinate's quotient costs beside its entries. In long chains all centres would follow from all
#: angles, were angles not taken between them; found on those by counting.
QUOTIENT = 4


@dataclass(frozen=True)
class Pivot:
    """A row k: 1 over its diagonal entry, or 0 for 1/0, and its other entries as ``parts`` of that one.

    What is left is multiplied by ``scale`` and loses ``column`` times the row: 1 and those parts, or, with no
    quotient, the diagonal entry and the entries themselves.
    """

    k: int
    reciprocal: Scalar
    parts: dict[int, Scalar]
    scale: Scalar
    column: dict[int, Scalar]

    def forward(self, z: list[Scalar]) -> None:
        """Take the row out of what is left of a right-hand side."""
        for i, entry in self.column.items():
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

    Where a coordinate has the entry 1 or -1 in a constraint, both go together, and no quotient is taken: the
    coordinate follows from others, as a bar's centre from its angle. Others go alone, with a matrix that is
    as positive definite, and constraints that are left come last (Benzi, Golub and Liesen 2005: the
    null-space method, then the Schur complement's). The least costly goes first, so that few zeros fill in.

    ``condition`` tells how nearly constraints depend on each other: it is 1, and 1 for each that goes with a
    coordinate, and for each other one its square over that of what the ones before have left of it, in the
    norm of [M]^-1; 1 + m where all are orthogonal, 1/eps where they depend on each other, NaN where an entry
    is. ``ok`` says whether it is below 1 over ``tolerance``, and pivots of coordinates are positive: no NaN.
    """

    def __init__(self, M: Array, B: Array, tolerance: float = 0.0) -> None:
        n, above, below = len(M), M.tolist(), B.tolist()
        self._rows = [{j: x for j, x in enumerate(row) if x != 0} for row in (*above, *below)]
        for r in range(n, len(self._rows)):
            for k, entry in self._rows[r].items():
                self._rows[k][r] = entry
        self._n, self._left, self._steps = n, set(range(len(self._rows))), list[Pivot | Pair]()
        self._eliminate()
        self.condition: Scalar = 1.0
        self.ok: Scalar = True
        scale: Scalar = 1.0
        for step in self._steps:
            if isinstance(step, Pair):
                self.condition = self.condition + 1.0
                continue
            if step.k >= n:
                row = enumerate(below[step.k - n])
                squares = [x * x * (1.0 / above[j][j]) for j, x in row if x != 0]
                part = abs(sum(squares, 0.0) * step.reciprocal * scale)
                self.condition = self.condition + (math.inf if step.reciprocal == 0 else part)
            elif not _is_known(step.reciprocal):
                self.ok = both(self.ok, step.reciprocal > 0.0)
            scale = scale * step.scale
        self.ok = both(self.ok, tolerance * self.condition < 1.0)

    def solve(self, F: Array, c: Array) -> tuple[Array, Array]:
        """Return {x} (n,) and {y} (m,), or (n, k) and (m, k) for as many right-hand sides."""
        z = [*F, *c] if F.ndim > 1 else [*F.tolist(), *c.tolist()]
        for step in self._steps:
            step.forward(z)
        for step in reversed(self._steps):
            step.back(z)
        return array(z[: self._n]).reshape(F.shape), -array(z[self._n :]).reshape(c.shape)

    def _eliminate(self) -> None:
        """Take all rows, the least costly first; what others cost changes with their entries."""
        costs = {k: self._cost(k) for k in self._left}
        while costs:
            *_, k, r = min(costs.values())
            step = self._pivot(k) if r is None else self._pair(k, r)
            self._steps.append(step)
            changed = {*step.column, *(step.row if isinstance(step, Pair) else ())}
            changed |= {j for i in changed if i >= self._n for j in self._rows[i]}
            costs = {i: cost for i, cost in costs.items() if i not in (k, r)}
            costs |= {i: self._cost(i) for i in changed}

    def _cost(self, k: int) -> tuple[int, int, int, int | None]:
        """Return a row by what it costs, with the constraint that it goes with, or None.

        A coordinate that goes alone brings the constraints that it is in a diagonal entry, and a pair is to
        have none: so it comes after all pairs.
        """
        row, n = self._rows[k], self._n
        constraints = [r for r in row if r >= n]
        if k < n and (pairs := [(len(self._rows[r]), r) for r in constraints if row[r] in (1, -1)]):
            entries, r = min(pairs)
            return 0, len(row) * entries, k, r
        return (2 if k >= n else 1 if constraints else 0), len(row) ** 2 + QUOTIENT, k, None

    def _taken(self, k: int) -> dict[int, Scalar]:
        """Return a row, taken out of those that are left."""
        self._left.discard(k)
        for i in self._rows[k].keys() - {k}:
            del self._rows[i][k]
        return self._rows[k]

    def _pair(self, k: int, r: int) -> Pair:
        column, row = self._taken(k), self._taken(r)
        mass, sign = column.pop(k, 0.0), column.pop(r)
        entries = [(i, column.get(i, 0.0), row.get(i, 0.0)) for i in sorted({*column, *row})]
        for i, u, w in entries:
            for j, other_u, other_w in entries:
                if j <= i:
                    change = sign * (u * other_w + w * other_u) - mass * (w * other_w)
                    self._set(i, j, self._rows[i].get(j, 0.0) - change)
        return Pair(k, r, sign, mass, column, row)

    def _pivot(self, k: int) -> Pivot:
        row = self._taken(k)
        pivot = row.pop(k, 0.0)
        reciprocal = 0.0 if pivot == 0 else 1.0 / pivot
        parts = {i: x * reciprocal for i, x in row.items()}
        is_few = len(row) == len(self._left) < FEW and max(row, default=0) >= self._n
        scale, column = (pivot, row) if is_few and not _is_known(pivot) else (1.0, parts)
        for i in row:
            for j in row:
                if j <= i:
                    self._set(i, j, self._rows[i].get(j, 0.0) * scale - column[i] * row[j])
        return Pivot(k, reciprocal, parts, scale, column)

    def _set(self, i: int, j: int, new: Scalar) -> None:
        for a, b in {(i, j), (j, i)}:
            self._rows[a].pop(b, None)
            if new != 0:
                self._rows[a][b] = new


def _is_known(x: Scalar) -> bool:
    return isinstance(x, Value) and x.node.known


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
