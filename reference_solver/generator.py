"""The paper's equations as straight-line code for one topology: the stages of ``equations``, written out.

What the mechanism does not contain does not occur in the text: no zero entry, no absent load, no arm of a pin
at a centre of mass. Parameters (masses, points, speeds) are inputs p[...], so that one compilation serves
every mechanism of the same topology. Coordinates are named q0, q1, ..., velocities v0, v1, ...
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_solver.arrays import row_slices
from reference_solver.contact_source import write_contact
from reference_solver.equations import PIVOT_TOLERANCE_PER_ROW, Baumgarte
from reference_solver.mechanism import (
    GROUND,
    Constraint,
    MasslessLink,
    Mechanism,
    Point,
    RevoluteJoint,
    SpringDamper,
    StraightGuide,
    Torque,
)
from reference_solver.straight_line import (
    MINUS_ONE,
    ONE,
    ZERO,
    Factors,
    Sparse,
    StraightLine,
    dot,
    negative,
    product,
    total,
)

SIDES = (("i", MINUS_ONE), ("j", ONE))

#: Two points, each by its body and its place there; their arms; the terms of every coordinate's acceleration.
Ends = tuple[tuple[int, Point], tuple[int, Point]]
Arms = list[tuple[str, str]]
Terms = dict[int, list[str]]


@dataclass(frozen=True)
class Row:
    """One row of [B], with its C and the terms of its [B']{q'} and of its g."""

    B: Sparse
    C: str
    centripetal: list[str]
    g: list[str]


class EquationsWriter:
    """Writes the equations of one mechanism; ``parameters`` collects the values of p[...] as they occur."""

    def __init__(self, mechanism: Mechanism, q_start: NDArray[np.float64]) -> None:
        self.mechanism, self._q_start = mechanism, q_start
        self.n = 3 * len(mechanism.bodies)
        self.m = sum(rows.stop - rows.start for rows in row_slices(mechanism))
        self._positions: dict[str, int] = {}
        self.parameters: list[float] = []

    def parameter(self, key: str, value: float, structural: tuple[float, ...] = ()) -> str:
        """Return the code of a parameter; a value among the structural ones is written out instead."""
        if value in structural:
            return repr(float(value) if value else 0.0)
        if key not in self._positions:
            self._positions[key] = len(self.parameters)
            self.parameters.append(float(value))
        return f"p[{self._positions[key]}]"

    def inverse_mass(self, column: int) -> str:
        """Return the diagonal entry of [M]^-1 of a coordinate."""
        body = self.mechanism.bodies[column // 3]
        if column % 3 == 2:
            return self.parameter(f"inertia {column // 3}", 1 / body.inertia_kg_m2)
        return self.parameter(f"mass {column // 3}", 1 / body.mass_kg)

    def _arm(self, code: StraightLine, name: str, body: int, point: Point) -> tuple[str, str]:
        """Return the arm from a body's centre of mass to a point of it, in the global frame."""
        x, y = (self.parameter(f"{name}{k}", value, (0.0,)) for k, value in enumerate(point))
        if body == GROUND or x == y == ZERO:
            return x, y
        for function in ("cos", "sin"):
            code.let(f"{function}{body}", f"{function}(q{3 * body + 2})")
        return (
            code.let(f"{name}x", total([product(f"cos{body}", x), negative(product(f"sin{body}", y))])),
            code.let(f"{name}y", total([product(f"sin{body}", x), product(f"cos{body}", y)])),
        )

    def rows(self, code: StraightLine) -> list[Row]:
        """Return the constraint rows in the order of [B]."""
        return [row for k, c in enumerate(self.mechanism.constraints) for row in self._rows(code, k, c)]

    def _rows(self, code: StraightLine, number: int, constraint: Constraint) -> list[Row]:
        if isinstance(constraint, RevoluteJoint):
            return self._revolute(code, f"u{number}", constraint)
        if isinstance(constraint, MasslessLink):
            return [self._link(code, f"j{number}", constraint)]
        x, y, phi = range(3 * constraint.body, 3 * constraint.body + 3)
        start = self.parameter(f"start {number}", -self._q_start[phi])
        if isinstance(constraint, StraightGuide):
            direction = (-np.sin(constraint.angle_rad), np.cos(constraint.angle_rad))
            a, b = (
                self.parameter(f"{k} {number}", v, (0.0, 1.0, -1.0))
                for k, v in zip("ab", direction, strict=True)
            )
            offset = self.parameter(f"offset {number}", -float(np.dot(direction, constraint.point)))
            along = Row({x: a, y: b}, ZERO, [], [product(a, f"q{x}"), product(b, f"q{y}"), offset])
            return [along, Row({phi: ONE}, ZERO, [], [f"q{phi}", start])]
        speed = self.parameter(f"speed {number}", constraint.speed_rad_s)
        return [Row({phi: ONE}, speed, [], [f"q{phi}", start, negative(product(speed, "t"))])]

    def _revolute(self, code: StraightLine, name: str, joint: RevoluteJoint) -> list[Row]:
        rows = [Row({}, ZERO, [], []), Row({}, ZERO, [], [])]
        bodies = ((joint.body_i, joint.point_i), (joint.body_j, joint.point_j))
        for (side, sign), (body, point) in zip(SIDES, bodies, strict=True):
            arm = self._arm(code, name + side, body, point)
            for k, row in enumerate(rows):
                row.g.append(product(sign, arm[k]))
                if body == GROUND:
                    continue
                column, phi = 3 * body + k, 3 * body + 2
                row.B[column] = sign
                row.B[phi] = product(sign, ONE if k else MINUS_ONE, arm[1 - k])
                row.g.append(product(sign, f"q{column}"))
                row.centripetal.append(negative(product(sign, arm[k], f"v{phi}", f"v{phi}")))
        return rows

    def _link(self, code: StraightLine, name: str, link: MasslessLink) -> Row:
        ends = ((link.body_i, link.point_i), (link.body_j, link.point_j))
        arms, reach, rate = self._relative(code, name, ends)
        x, y = (code.let(f"{name}{'xy'[k]}", total(reach[k])) for k in (0, 1))
        constant = self.parameter(f"{name} length", -(link.length_m**2) / 2)
        # Velocities occur in terms only, not in lines: the projection of q has none.
        centripetal = [f"({total(rate[k])})*({total(rate[k])})" for k in (0, 1)]
        B: Sparse = {}
        for (side, sign), (body, _), arm in zip(SIDES, ends, arms, strict=True):
            if body == GROUND:
                continue
            turn = total([product(y, arm[0]), negative(product(x, arm[1]))])
            entries = (x, y, code.let(f"{name}_turn_{side}", turn))
            B.update((3 * body + k, product(sign, e)) for k, e in enumerate(entries) if e != ZERO)
            omega = f"v{3 * body + 2}"
            for d, component in zip((x, y), arm, strict=True):
                centripetal.append(negative(product(sign, component, omega, omega, d)))
        return Row(B, ZERO, centripetal, [f"0.5*({x}*{x} + {y}*{y})", constant])

    def free_accelerations(self, code: StraightLine) -> Sparse:
        """Return [M]^-1{F} by coordinate: gravity, torques, springs and dampers."""
        terms: Terms = {column: [] for column in range(self.n)}
        if self.mechanism.gravity_m_s2:
            for column in range(1, self.n, 3):
                terms[column].append(negative(self.parameter("gravity", self.mechanism.gravity_m_s2)))
        for number, load in enumerate(self.mechanism.loads):
            if isinstance(load, Torque):
                column = 3 * load.body + 2
                torque = self.parameter(f"torque {number}", load.torque_N_m)
                terms[column].append(product(torque, self.inverse_mass(column)))
            else:
                self._spring(code, f"k{number}", load, terms)
        for number, joint in enumerate(self.mechanism.contacts):
            write_contact(self, code, number, joint, terms)
        return {column: code.let(f"f{column}", total(parts)) for column, parts in terms.items()}

    def _spring(self, code: StraightLine, name: str, spring: SpringDamper, terms: Terms) -> None:
        ends = ((spring.body_i, spring.point_i), (spring.body_j, spring.point_j))
        arms, (x, y), (rate_x, rate_y) = self.between(code, name, ends)
        length = code.let(f"{name}_length", f"sqrt({x}*{x} + {y}*{y})")
        stiffness, damping, free_length = (
            self.parameter(f"{name} {k}", v)
            for k, v in enumerate((spring.stiffness_N_m, spring.damping_N_s_m, spring.free_length_m))
        )
        speed = code.let(f"{name}_speed", f"({x}*{rate_x} + {y}*{rate_y})/{length}")
        tension = f"({stiffness}*({length} - {free_length}) + {damping}*{speed})/{length}"
        pull = code.let(f"{name}_pull", tension)
        self.push(ends, arms, (negative(product(pull, x)), negative(product(pull, y))), terms)

    def between(
        self, code: StraightLine, name: str, ends: Ends
    ) -> tuple[Arms, tuple[str, ...], tuple[str, ...]]:
        """Return the arms of two points, the vector from the first to the second, and its rate."""
        arms, reach, rate = self._relative(code, name, ends)
        return (
            arms,
            tuple(code.let(f"{name}{'xy'[k]}", total(reach[k])) for k in (0, 1)),
            tuple(code.let(f"{name}_rate{'xy'[k]}", total(rate[k])) for k in (0, 1)),
        )

    def _relative(
        self, code: StraightLine, name: str, ends: Ends
    ) -> tuple[Arms, list[list[str]], list[list[str]]]:
        """Return the arms of two points, and the terms of the vector between and of its rate, by axis."""
        arms = [self._arm(code, name + side, *end) for (side, _), end in zip(SIDES, ends, strict=True)]
        reach: list[list[str]] = [[], []]
        rate: list[list[str]] = [[], []]
        for (_, sign), (body, _), arm in zip(SIDES, ends, arms, strict=True):
            for k in (0, 1):
                reach[k].append(product(sign, arm[k]))
                if body != GROUND:
                    turn = product(sign, ONE if k else MINUS_ONE, f"v{3 * body + 2}", arm[1 - k])
                    reach[k].append(product(sign, f"q{3 * body + k}"))
                    rate[k] += [product(sign, f"v{3 * body + k}"), turn]
        return arms, reach, rate

    def push(
        self,
        ends: Ends,
        arms: Arms,
        force: tuple[str, str],
        terms: Terms,
        twist: tuple[str, str] = (ZERO, ZERO),
    ) -> None:
        """Add to the accelerations a force on the second point, its reaction on the first, and torques."""
        for (_, sign), (body, _), arm, moment in zip(SIDES, ends, arms, twist, strict=True):
            if body == GROUND:
                continue
            x, y, phi = range(3 * body, 3 * body + 3)
            fx, fy = (product(sign, component) for component in force)
            terms[x].append(product(fx, self.inverse_mass(x)))
            terms[y].append(product(fy, self.inverse_mass(y)))
            for part in (product(arm[0], fy), negative(product(arm[1], fx)), moment):
                terms[phi].append(product(part, self.inverse_mass(phi)))

    def factors(self, code: StraightLine, rows: list[Row]) -> tuple[list[Sparse], Factors]:
        """Return [B][M]^-1 by row, and the factors of [B][M]^-1[B]^T."""
        BW = [
            {c: code.let(f"w{r}_{c}", product(entry, self.inverse_mass(c))) for c, entry in row.B.items()}
            for r, row in enumerate(rows)
        ]
        matrix = {
            (i, j): code.let(f"g{i}_{j}", dot(BW[i], rows[j].B))
            for i in range(self.m)
            for j in range(i + 1)
            if not BW[i].keys().isdisjoint(rows[j].B)
        }
        return BW, Factors(code, matrix, self.m, repr(self.m * PIVOT_TOLERANCE_PER_ROW))

    def accelerations(self, baumgarte: Baumgarte | None) -> tuple[StraightLine, list[str], list[str], str]:
        """Return the code of (3)-(10), the names of its accelerations and multipliers, and its condition."""
        code = StraightLine()
        rows, free = self.rows(code), self.free_accelerations(code)
        BW, factors = self.factors(code, rows)
        right = {}
        for r, row in enumerate(rows):
            terms = [negative(term) for term in row.centripetal]
            terms += [negative(product(entry, free[c])) for c, entry in row.B.items()]
            if baumgarte is not None:
                rate = code.let(f"rate{r}", total([*_rate(row), negative(row.C)]))
                gap = code.let(f"gap{r}", total(row.g))
                terms.append(negative(product(self.parameter("2 alpha", 2 * baumgarte.alpha_s), rate)))
                terms.append(negative(product(self.parameter("beta^2", baumgarte.beta_s**2), gap)))
            right[r] = code.let(f"h{r}", total(terms))
        lambda_ = factors.solve("lambda", right)
        accelerations = [code.let(f"a{c}", total([free[c], *_column(BW, c, lambda_)])) for c in range(self.n)]
        return code, accelerations, [lambda_[r] for r in range(self.m)], factors.ok

    def projection(self, of: str) -> tuple[StraightLine, list[str], str]:
        """Return the code that moves ``of`` = q or v onto the constraints, new names, and its condition."""
        code = StraightLine()
        rows = self.rows(code)
        BW, factors = self.factors(code, rows)
        right = {
            r: code.let(f"h{r}", total(row.g if of == "q" else [*_rate(row), negative(row.C)]))
            for r, row in enumerate(rows)
        }
        mu = factors.solve("mu", right)
        moved = [
            code.let(f"new{c}", total([f"{of}{c}", *map(negative, _column(BW, c, mu))]))
            for c in range(self.n)
        ]
        return code, moved, factors.ok


def _rate(row: Row) -> list[str]:
    """Return the terms of a row's [B]{q'}."""
    return [product(entry, f"v{c}") for c, entry in row.B.items()]


def _column(BW: list[Sparse], c: int, x: Sparse) -> list[str]:
    """Return the terms of coordinate c in [M]^-1[B]^T x."""
    return [product(row[c], x[r]) for r, row in enumerate(BW) if c in row]
