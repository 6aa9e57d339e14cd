"""The paper's equations as straight-line code for one topology: the stages of ``equations``, written out.

What the mechanism does not contain does not occur in the text: no zero entry, no absent load, no arm of a pin
at a centre of mass. Parameters (masses, points, speeds) are inputs p[...], so that one compilation serves
every mechanism of the same topology. Coordinates are named q0, q1, ..., velocities v0, v1, ...
"""

from reference_solver.constraint_source import Row, rows_of
from reference_solver.contact_source import write_contact, write_elastic
from reference_solver.equations import PIVOT_TOLERANCE_PER_ROW, Baumgarte
from reference_solver.mechanism import (
    SpringDamper,
    Torque,
)
from reference_solver.mechanism_source import MechanismWriter, Terms
from reference_solver.straight_line import (
    Factors,
    Sparse,
    StraightLine,
    dot,
    negative,
    product,
    total,
)


class EquationsWriter(MechanismWriter):
    """Writes the equations of one mechanism."""

    def rows(self, code: StraightLine) -> list[Row]:
        """Return the constraint rows in the order of [B]."""
        return [row for k, c in enumerate(self.mechanism.constraints) for row in rows_of(self, code, k, c)]

    def free_accelerations(self, code: StraightLine, stored: bool = False) -> Sparse:
        """Return [M]^-1{F} by coordinate: gravity, torques, springs and dampers, contacts.

        If only what is ``stored``: the part that has a potential, in which no velocity occurs.
        """
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
                self._spring(code, f"k{number}", load, terms, stored)
        for number, joint in enumerate(self.mechanism.contacts):
            (write_elastic if stored else write_contact)(self, code, number, joint, terms)
        return {column: code.let(f"f{column}", total(parts)) for column, parts in terms.items()}

    def _spring(
        self, code: StraightLine, name: str, spring: SpringDamper, terms: Terms, stored: bool
    ) -> None:
        ends = ((spring.body_i, spring.point_i), (spring.body_j, spring.point_j))
        if stored:
            arms, (x, y) = self.reach(code, name, ends)
        else:
            arms, (x, y), (rate_x, rate_y) = self.between(code, name, ends)
        length = code.let(f"{name}_length", f"sqrt({x}*{x} + {y}*{y})")
        stiffness, damping, free_length = (
            self.parameter(f"{name} {k}", v)
            for k, v in enumerate((spring.stiffness_N_m, spring.damping_N_s_m, spring.free_length_m))
        )
        tension = f"{stiffness}*({length} - {free_length})"
        if not stored:
            speed = code.let(f"{name}_speed", f"({x}*{rate_x} + {y}*{rate_y})/{length}")
            tension += f" + {damping}*{speed}"
        pull = code.let(f"{name}_pull", f"({tension})/{length}")
        self.push(ends, arms, (negative(product(pull, x)), negative(product(pull, y))), terms)

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
        """Return the code of (3)-(10), the names of its accelerations and multipliers, and its condition.

        With Baumgarte's feedback the code names ``removing``, ``Equations.feedback_power``.
        """
        code = StraightLine()
        rows, free = self.rows(code), self.free_accelerations(code)
        BW, factors = self.factors(code, rows)
        right, drift, feedback = {}, {}, {}
        for r, row in enumerate(rows):
            terms = [negative(term) for term in row.centripetal]
            terms += [negative(product(entry, free[c])) for c, entry in row.B.items()]
            if baumgarte is not None:
                drift[r] = code.let(f"drift{r}", total([*_rate(row), negative(row.C)]))
                gap = code.let(f"gap{r}", total(row.g))
                damper = product(self.parameter("2 alpha", 2 * baumgarte.alpha_s), drift[r])
                spring = product(self.parameter("beta^2", baumgarte.beta_s**2), gap)
                feedback[r] = code.let(f"feedback{r}", total([damper, spring]))
                terms.append(negative(feedback[r]))
            right[r] = code.let(f"h{r}", total(terms))
        lambda_ = factors.solve("lambda", right)
        accelerations = [code.let(f"a{c}", total([free[c], *_column(BW, c, lambda_)])) for c in range(self.n)]
        if baumgarte is not None:
            code.lines.append(f"removing = {dot(factors.solve('x', drift), feedback)}")
        return code, accelerations, [lambda_[r] for r in range(self.m)], factors.ok

    def projection(self, of: str, ledger: bool = False) -> tuple[StraightLine, list[str], str]:
        """Return the code that moves ``of`` = q or v onto the constraints, new names, and its condition.

        With the ``ledger`` the energy removed follows the new names (see ``readable.project_with_loss``).
        """
        code = StraightLine()
        rows = self.rows(code)
        BW, factors = self.factors(code, rows)
        right = {
            r: code.let(f"h{r}", total(row.g if of == "q" else [*_rate(row), negative(row.C)]))
            for r, row in enumerate(rows)
        }
        mu = factors.solve("mu", right)
        results = [
            code.let(f"new{c}", total([f"{of}{c}", *map(negative, _column(BW, c, mu))]))
            for c in range(self.n)
        ]
        if ledger and of == "q":
            stored = self.free_accelerations(code, stored=True)
            works = {r: code.let(f"e{r}", dot(row.B, stored)) for r, row in enumerate(rows)}
            results.append(code.let("removed", total(negative(product(mu[r], e)) for r, e in works.items())))
        elif ledger:
            moved = [(c, new) for c, new in enumerate(results) if new != f"v{c}"]
            terms = [f"{self.half_mass(c)}*(v{c} - {new})*(v{c} + {new})" for c, new in moved]
            results.append(code.let("removed", total(terms)))
        return code, results, factors.ok


def _rate(row: Row) -> list[str]:
    """Return the terms of a row's [B]{q'}."""
    return [product(entry, f"v{c}") for c, entry in row.B.items()]


def _column(BW: list[Sparse], c: int, x: Sparse) -> list[str]:
    """Return the terms of coordinate c in [M]^-1[B]^T x."""
    return [product(row[c], x[r]) for r, row in enumerate(BW) if c in row]
