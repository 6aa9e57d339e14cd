"""The equations of motion of a tree whose loops are closed: rates, accelerations, the torque of a driver.

Of the coordinates' rates u' some are independent, z', one may be prescribed, and loops make the others
dependent: B u' = 0 gives u' = T z' + T_d C(t), by elimination of B in a fixed order (see ``partition``). All
coordinates are integrated, so that no loop is ever solved for positions. B u'' + bias = 0 gives u'' = T z'' +
b with the same elimination. With the masses M of all coordinates, their inertial forces h, and Q of the
forces on the bodies,

    T^T M T z'' = T^T (Q - h - M b),      the driver's torque or force  T_d^T (M u'' + h - Q)

For elements p and q (see ``tree``), G their product and G' its derivative by delta, and with the movers of an
element, its coordinate along R a, and its frame's angle along u J R a, M has the products of the movers'
directions, and h those of a mover's with 2 u_q' w_g' J R_g b - u_q w_g'^2 R_g b.
"""

from collections.abc import Iterable, Mapping
from functools import cached_property

import numpy as np

from engine_models.mechanics.equations.frames import ByCoordinate, Frames, nonzero, rate_of
from engine_models.mechanics.equations.partition import Partition, Step
from engine_models.mechanics.equations.tree import Element, Tree, is_number
from reference_solver.factorisation import Factors
from reference_solver.mechanism.mechanism import GROUND
from reference_solver.tape import Array, Scalar, array

#: The number, as if it were a coordinate's, of what is always 1.
ONE = GROUND - 1


class Loops:
    """Rows by coordinates, eliminated step by step, so that coordinates are sums of those ``given``.

    ``of_given`` has the parts of these sums; ``determinants`` are those of the steps.
    """

    def __init__(self, rows: list[ByCoordinate], steps: tuple[Step, ...], given: Iterable[int]) -> None:
        left = [ByCoordinate(row) for row in rows]
        self.determinants, waiting = list[Scalar](), set(range(len(rows)))
        solved = list[tuple[int, ByCoordinate]]()
        for step in steps:
            waiting -= {*step.rows}
            own = [left[r] for r in step.rows]
            inverse, determinant = _inverse([[row[c] for c in step.columns] for row in own])
            self.determinants.append(determinant)
            others = [k for k in dict.fromkeys(k for row in own for k in row) if k not in step.columns]
            for c, weights in zip(step.columns, inverse, strict=True):
                parts = ByCoordinate()
                for k in others:
                    products = (w * row[k] for w, row in zip(weights, own, strict=True) if k in row)
                    parts[k] = -sum(products, start=0.0)
                solved.append((c, nonzero(parts)))
            for row in (left[r] for r in sorted(waiting)):
                for c, parts in solved[-len(step.columns) :]:
                    if c in row:
                        factor = row.pop(c)
                        for k, part in parts.items():
                            row[k] += factor * part
        self.of_given = {k: ByCoordinate({k: 1.0}) for k in given}
        for c, parts in reversed(solved):
            sums = ByCoordinate()
            for k, part in parts.items():
                for i, value in self.of_given[k].items():
                    sums[i] += part * value
            self.of_given[c] = nonzero(sums)


class Posture:
    """Where a tree's bodies are and how they move, at coordinates u and independent rates z' by numbers.

    Coordinates that follow from loops are not among u (see ``Frames``, also for ``subtracted``). ``driven``
    has the speed and the acceleration of the driven coordinate where there is one. ``q`` and ``v`` have the
    (x, y, phi) of every body, 3b each.
    """

    def __init__(
        self,
        tree: Tree,
        partition: Partition,
        u: Mapping[int, Scalar],
        z: Mapping[int, Scalar],
        driven: tuple[Scalar, Scalar] | None,
        subtracted: bool = False,
    ) -> None:
        self.tree, self.partition, self.frames = tree, partition, Frames(tree, u, subtracted)
        self._driven, self._of_driver = driven, tree.structure.driven
        self.given = dict(z)
        if driven is not None:
            assert self._of_driver is not None
            self.given[self._of_driver] = driven[0]
        self.loops = Loops(self.frames.loops, partition.steps, self.given)
        of_given = self.loops.of_given
        #: The rates of all coordinates.
        self.rates = [self._sum(of_given[k], self.given) for k in range(len(tree.structure.coordinates))]

    @staticmethod
    def _sum(parts: ByCoordinate, values: Mapping[int, Scalar]) -> Scalar:
        return sum((part * values[k] for k, part in parts.items() if k in values), start=0.0)

    @cached_property
    def q(self) -> list[Scalar]:
        """(x, y, phi) of every body."""
        tree, q = self.tree, list[Scalar]()
        for body in range(len(tree.mechanism.bodies)):
            frame = tree.frame(body)
            angle = 0.0 if frame == GROUND else self.frames.u[frame]
            q += [*self.frames.vector(tree.centres[body]), angle + tree.offset(body)]
        return q

    @cached_property
    def v(self) -> list[Scalar]:
        """The rates of these."""
        v = list[Scalar]()
        for body in range(len(self.tree.mechanism.bodies)):
            columns = self.frames.columns(self.tree.centres[body])
            for axis in range(2):
                v.append(sum((c[axis] * self.rates[k] for k, c in columns.items()), start=0.0))
            v.append(rate_of(self.rates, self.tree.frame(body)))
        return v

    def reduced(self, row: ByCoordinate) -> ByCoordinate:
        """Return T^T of generalised forces, or of the derivatives of a speed, by coordinate."""
        sums = ByCoordinate()
        for k, value in row.items():
            for i, part in self.loops.of_given[k].items():
                sums[i] += part * value
        return sums

    def accelerations(self, F: Array, more: ByCoordinate | None = None) -> tuple[ByCoordinate, Scalar]:
        """Return z'' by coordinate, and the driver's torque or force, under forces F (3b,) on the bodies.

        ``more`` are generalised forces beside F.
        """
        Q = self._forces(F)
        for k, force in (more or {}).items():
            Q[k] += force
        right = self.reduced(Q)
        for i, force in self._inertia_forces.items():
            right[i] -= force
        return self._answer(right)

    def answer_to(self, row: ByCoordinate) -> tuple[ByCoordinate, Scalar]:
        """Return z'' by coordinate, and the driver's torque or force, of generalised forces alone."""
        return self._answer(self.reduced(row))

    def _answer(self, right: ByCoordinate) -> tuple[ByCoordinate, Scalar]:
        free, driven = self.partition.independent, self._of_driver
        solved, _ = self._factors.solve(array([right[i] for i in free]), np.zeros(0))
        found = ByCoordinate(zip(free, solved, strict=True))
        if driven is None:
            return found, 0.0
        needed = sum((self._entry(driven, j) * value for j, value in found.items()), start=0.0)
        return found, needed - right[driven]

    @cached_property
    def _factors(self) -> Factors:
        free = self.partition.independent
        matrix = array([[self._entry(min(i, j), max(i, j)) for j in free] for i in free])
        return Factors(matrix, np.zeros((0, len(free))))

    def _entry(self, i: int, j: int) -> Scalar:
        """Return an entry of T^T M T."""
        sums: Scalar = 0.0
        for (k, other), mass in self._masses.items():
            one, two = self.loops.of_given[k], self.loops.of_given[other]
            pairs = ((i, j),) if k == other else ((i, j), (j, i))
            products = (one[a] * two[b] for a, b in pairs if a in one and b in two)
            sums = sums + sum(products, start=0.0) * mass
        return sums

    @cached_property
    def _inertia_forces(self) -> ByCoordinate:
        """T^T (h + M b) by what is given.

        Of one freedom they are those at a rate of 1, times the square of the rate: a few products less.
        """
        if len(self.partition.independent) > 1 or self._of_driver is not None:
            return self._inertia_forces_at(self.rates)
        ((i, rate),) = self.given.items()
        (force,) = self._inertia_forces_at(
            [self.loops.of_given[k][i] for k in range(len(self.rates))]
        ).values() or (0.0,)
        return ByCoordinate({i: (rate * rate) * force})

    def _inertia_forces_at(self, rates: list[Scalar]) -> ByCoordinate:
        """Return the same at rates of all coordinates."""
        known: dict[int, Scalar] = {ONE: 1.0}
        if self._of_driver is not None:
            assert self._driven is not None
            known[self._of_driver] = self._driven[1]
        rows = [
            ByCoordinate(parts | {ONE: self.frames.bias(row, rates)})
            for row, parts in zip(self.tree.rows, self.frames.loops, strict=True)
        ]
        sums = Loops(rows, self.partition.steps, (*self.given, ONE)).of_given
        b = nonzero(ByCoordinate((k, self._sum(sums[k], known)) for k in sums if k != ONE))
        forces = self.reduced(self._inertial(rates))
        # T^T M first: b, which is known last, is then waited for by one product alone.
        columns = {k: ByCoordinate() for k in b}
        for pair, mass in self._masses.items():
            for k, other in dict.fromkeys((pair, pair[::-1])):
                if k in b:
                    for i, part in self.loops.of_given[other].items():
                        columns[k][i] += mass * part
        for k, column in columns.items():
            for i, part in column.items():
                forces[i] += part * b[k]
        return forces

    def _movers(self, element: Element) -> list[tuple[int, Scalar, bool]]:
        """Return the coordinates that move an element, with their factors, and whether they turn it."""
        frame, way = element
        movers: list[tuple[int, Scalar, bool]] = [] if way is None else [(way, 1.0, False)]
        return movers if frame == GROUND else [*movers, (frame, self.frames.factor(way), True)]

    @cached_property
    def _masses(self) -> dict[tuple[int, int], Scalar]:
        """M of all pairs of coordinates that have an entry, the lower number first."""
        M: dict[tuple[int, int], Scalar] = {(k, k): mass for k, mass in self.tree.inertias.items()}
        for (p, q), constants in self.tree.masses.items():
            G, slope = self.frames.combined(p[0], q[0], constants)
            # Directions of movers: R a.R b = J R a.J R b = G, R a.J R b = G', J R a.R b = -G'.
            for k, u, turns in self._movers(p):
                for other, w, turned in self._movers(q):
                    product = G if turns == turned else slope if turned else -slope
                    if p == q and k > other:
                        continue
                    twice, pair = (2.0 if p != q and k == other else 1.0), (min(k, other), max(k, other))
                    M[pair] = M.get(pair, 0.0) + twice * (u * (w * product))
        return {pair: mass for pair, mass in M.items() if not (is_number(mass) and mass == 0.0)}

    def _inertial(self, rates: list[Scalar]) -> ByCoordinate:
        """Return h by coordinate, at rates of all coordinates."""
        h, frames = ByCoordinate(), self.frames
        for (p, q), constants in self.tree.masses.items():
            G, slope = frames.combined(p[0], q[0], constants)
            for one, other, turned in ((p, q, slope), (q, p, -slope))[: 1 if p == q else 2]:
                (frame, way), turning = other, rate_of(rates, other[0])
                if frame == GROUND:
                    continue
                pull = frames.factor(way) * (turning * turning)
                swing = 0.0 if way is None else 2.0 * (rates[way] * turning)
                for k, u, turns in self._movers(one):
                    # Of -w^2 R b along R a and J R a: -G and G'; of J R b: G' and G.
                    part = swing * G + pull * turned if turns else swing * turned - pull * G
                    h[k] += u * part
        return h

    def _forces(self, F: Array) -> ByCoordinate:
        """Return Q by coordinate of forces F (3b,) on the bodies."""
        sums = dict[Element, tuple[Scalar, Scalar]]()
        Q = ByCoordinate()
        for body in range(len(self.tree.mechanism.bodies)):
            x, y, torque = F[3 * body : 3 * body + 3]
            for share, terms in self.tree.carried[body]:
                for element, a in terms.items():
                    old = sums.get(element, (0.0, 0.0))
                    along, across = a[0] * x + a[1] * y, a[0] * y - a[1] * x
                    sums[element] = old[0] + share * along, old[1] + share * across
            if (frame := self.tree.frame(body)) != GROUND:
                Q[frame] += torque
        for element, pair in sums.items():
            # R a.F = c X + s Y, J R a.F = c Y - s X, with X of a.F and Y of a x F
            along, across = self.frames.combined(GROUND, element[0], pair)
            for k, u, turns in self._movers(element):
                Q[k] += u * (across if turns else along)
        return Q


def _inverse(block: list[list[Scalar]]) -> tuple[list[list[Scalar]], Scalar]:
    """Return the inverse of a matrix (1, 1) or (2, 2), and its determinant."""
    if len(block) == 1:
        return [[1.0 / block[0][0]]], block[0][0]
    (a, b), (c, d) = block
    determinant = a * d - b * c
    inverse = 1.0 / determinant
    return [[d * inverse, -(b * inverse)], [-(c * inverse), a * inverse]], determinant
