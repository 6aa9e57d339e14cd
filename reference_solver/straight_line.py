"""Straight-line code as text: named values in order, structural zeros and ones never written."""

from collections.abc import Iterable, Mapping

#: A sparse row or vector: what stands at each index, as the name of a value or a literal.
Sparse = dict[int, str]

ZERO, ONE, MINUS_ONE = "0.0", "1.0", "-1.0"


def product(*factors: str) -> str:
    """Return the product, folded where a factor is zero, one or minus one."""
    if ZERO in factors:
        return ZERO
    negative = factors.count(MINUS_ONE) % 2
    kept = [factor for factor in factors if factor not in (ONE, MINUS_ONE)]
    return ("-" if negative else "") + "*".join(kept) if kept else (MINUS_ONE if negative else ONE)


def total(terms: Iterable[str]) -> str:
    """Return the sum of the terms that are not zero."""
    kept = [term for term in terms if term != ZERO]
    return " + ".join(kept).replace("+ -", "- ") if kept else ZERO


def negative(term: str) -> str:
    """Return minus a single term."""
    return product(MINUS_ONE, term) if not term.startswith("-") else (term[1:] if term != MINUS_ONE else ONE)


def dot(a: Mapping[int, str], b: Mapping[int, str]) -> str:
    """Return the inner product of two sparse vectors."""
    return total(product(a[k], b[k]) for k in a if k in b)


class StraightLine:
    """Lines of code under construction; nothing is computed twice."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._names: dict[str, str] = {}

    def let(self, name: str, expression: str) -> str:
        """Return a name that holds the expression, or the expression itself where it is atomic."""
        if expression.lstrip("-").replace(".", "").replace("_", "").isalnum():
            return expression
        if expression not in self._names:
            self._names[expression] = name
            self.lines.append(f"{name} = {expression}")
        return self._names[expression]


class Factors:
    """L D L^T of a sparse symmetric positive definite matrix, eliminated in the order of least degree.

    ``ok`` names whether every pivot is above ``tolerance`` times its diagonal entry. It is computed without a
    branch on a line of its own: Numba refuses a branch within a tuple of more than thirty.
    """

    def __init__(
        self, code: StraightLine, matrix: Mapping[tuple[int, int], str], size: int, tolerance: str
    ) -> None:
        entries: dict[tuple[int, int], str] = {}
        for (i, j), value in matrix.items():
            entries[i, j] = entries[j, i] = value
        self.order: list[int] = []
        self.reciprocal: Sparse = {}
        self.column: dict[int, Sparse] = {}
        self._code = code
        conditions = []
        remaining = set(range(size))
        while remaining:
            k = min(remaining, key=lambda row: (sum((row, j) in entries for j in remaining), row))
            remaining.discard(k)
            self.order.append(k)
            pivot = code.let(f"d{k}", entries[k, k])
            conditions.append(f"({pivot} > {tolerance}*{matrix[k, k]})")
            self.reciprocal[k] = code.let(f"r{k}", f"1.0/{pivot}")
            below = sorted(j for j in remaining if (j, k) in entries)
            self.column[k] = {
                i: code.let(f"l{i}_{k}", product(entries[i, k], self.reciprocal[k])) for i in below
            }
            for i in below:
                for j in (j for j in below if j <= i):
                    update = negative(product(self.column[k][i], entries[j, k]))
                    new = total([entries.get((i, j), ZERO), update])
                    entries[i, j] = entries[j, i] = code.let(f"s{i}_{j}_{k}", new)
        self.ok = code.let("ok", " & ".join(conditions)) if conditions else "True"

    def solve(self, name: str, right: Mapping[int, str]) -> Sparse:
        """Return the solution, named ``name`` and the row's number."""
        code, z = self._code, dict(right)
        for k in self.order:
            for i, factor in self.column[k].items():
                step = negative(product(factor, z[k]))
                z[i] = code.let(f"{name}z{i}_{k}", total([z[i], step]))
        solution: Sparse = {}
        for k in reversed(self.order):
            terms = [negative(product(factor, solution[i])) for i, factor in self.column[k].items()]
            solution[k] = code.let(f"{name}{k}", total([product(z[k], self.reciprocal[k]), *terms]))
        return solution
