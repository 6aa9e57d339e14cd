"""A mechanism's points and parameters as code, on which constraints, loads and contacts are written.

Coordinates are named q0, q1, ..., velocities v0, v1, ...; parameters are inputs p[...], so that one
compilation serves every mechanism of the same topology.
"""

import numpy as np
from numpy.typing import NDArray

from reference_solver.arrays import row_slices
from reference_solver.mechanism import GROUND, Mechanism, Point
from reference_solver.straight_line import MINUS_ONE, ONE, ZERO, StraightLine, negative, product, total

SIDES = (("i", MINUS_ONE), ("j", ONE))

#: Two points, each by its body and its place there; their arms; the terms of every coordinate's acceleration.
Ends = tuple[tuple[int, Point], tuple[int, Point]]
Arms = list[tuple[str, str]]
Terms = dict[int, list[str]]


class MechanismWriter:
    """Writes arms and forces of one mechanism; ``parameters`` collects the values of p[...] as they occur."""

    def __init__(self, mechanism: Mechanism, q_start: NDArray[np.float64]) -> None:
        self.mechanism, self.q_start = mechanism, q_start
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
        kind, value = self._mass(column)
        return self.parameter(f"{kind} {column // 3}", 1 / value)

    def half_mass(self, column: int) -> str:
        """Return half the diagonal entry of [M] of a coordinate."""
        kind, value = self._mass(column)
        return self.parameter(f"half {kind} {column // 3}", value / 2)

    def _mass(self, column: int) -> tuple[str, float]:
        body = self.mechanism.bodies[column // 3]
        return ("inertia", body.inertia_kg_m2) if column % 3 == 2 else ("mass", body.mass_kg)

    def arm(self, code: StraightLine, name: str, body: int, point: Point) -> tuple[str, str]:
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

    def between(
        self, code: StraightLine, name: str, ends: Ends
    ) -> tuple[Arms, tuple[str, ...], tuple[str, ...]]:
        """Return the arms of two points, the vector from the first to the second, and its rate."""
        arms, reach = self.reach(code, name, ends)
        _, _, rate = self.relative(code, name, ends)
        return arms, reach, tuple(code.let(f"{name}_rate{'xy'[k]}", total(rate[k])) for k in (0, 1))

    def reach(self, code: StraightLine, name: str, ends: Ends) -> tuple[Arms, tuple[str, ...]]:
        """Return the arms of two points, and the vector from the first to the second."""
        arms, reach, _ = self.relative(code, name, ends)
        return arms, tuple(code.let(f"{name}{'xy'[k]}", total(reach[k])) for k in (0, 1))

    def relative(
        self, code: StraightLine, name: str, ends: Ends
    ) -> tuple[Arms, list[list[str]], list[list[str]]]:
        """Return the arms of two points, and the terms of the vector between and of its rate, by axis."""
        arms = [self.arm(code, name + side, *end) for (side, _), end in zip(SIDES, ends, strict=True)]
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
