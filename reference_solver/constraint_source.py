"""Constraint rows in the generated code: entries of [B] and {C}, terms of [B']{q'} and of g."""

from dataclasses import dataclass

import numpy as np

from reference_solver.mechanism import GROUND, Constraint, MasslessLink, RevoluteJoint, StraightGuide
from reference_solver.mechanism_source import SIDES, MechanismWriter
from reference_solver.straight_line import (
    MINUS_ONE,
    ONE,
    ZERO,
    Sparse,
    StraightLine,
    negative,
    product,
    total,
)


@dataclass(frozen=True)
class Row:
    """One row of [B], with its C and the terms of its [B']{q'} and of its g."""

    B: Sparse
    C: str
    centripetal: list[str]
    g: list[str]


def rows_of(writer: MechanismWriter, code: StraightLine, number: int, constraint: Constraint) -> list[Row]:
    """Return the rows of a constraint, ``number`` in the mechanism's order."""
    if isinstance(constraint, RevoluteJoint):
        return _revolute(writer, code, f"u{number}", constraint)
    if isinstance(constraint, MasslessLink):
        return [_link(writer, code, f"j{number}", constraint)]
    x, y, phi = range(3 * constraint.body, 3 * constraint.body + 3)
    start = writer.parameter(f"start {number}", -writer.q_start[phi])
    if isinstance(constraint, StraightGuide):
        direction = (-np.sin(constraint.angle_rad), np.cos(constraint.angle_rad))
        a, b = (
            writer.parameter(f"{k} {number}", v, (0.0, 1.0, -1.0))
            for k, v in zip("ab", direction, strict=True)
        )
        offset = writer.parameter(f"offset {number}", -float(np.dot(direction, constraint.point)))
        along = Row({x: a, y: b}, ZERO, [], [product(a, f"q{x}"), product(b, f"q{y}"), offset])
        return [along, Row({phi: ONE}, ZERO, [], [f"q{phi}", start])]
    speed = writer.parameter(f"speed {number}", constraint.speed_rad_s)
    return [Row({phi: ONE}, speed, [], [f"q{phi}", start, negative(product(speed, "t"))])]


def _revolute(writer: MechanismWriter, code: StraightLine, name: str, joint: RevoluteJoint) -> list[Row]:
    rows = [Row({}, ZERO, [], []), Row({}, ZERO, [], [])]
    bodies = ((joint.body_i, joint.point_i), (joint.body_j, joint.point_j))
    for (side, sign), (body, point) in zip(SIDES, bodies, strict=True):
        arm = writer.arm(code, name + side, body, point)
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


def _link(writer: MechanismWriter, code: StraightLine, name: str, link: MasslessLink) -> Row:
    ends = ((link.body_i, link.point_i), (link.body_j, link.point_j))
    arms, reach, rate = writer.relative(code, name, ends)
    x, y = (code.let(f"{name}{'xy'[k]}", total(reach[k])) for k in (0, 1))
    constant = writer.parameter(f"{name} length", -(link.length_m**2) / 2)
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
