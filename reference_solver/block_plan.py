"""A mechanism as the records of the block kernel.

Every constraint is one block of two multipliers; a driver's second row is a dummy, its diagonal entry one.
Every end of a constraint on a moving body is  B = [E | w],  w = w0 + (-y, x),  with the constant E (2, 2)
under the body's (x, y), and under its angle the constant w0 and the signed arm (x, y) = R(phi) point. So a
block of [B][M]^-1[B]^T is a constant plus a sum of w w^T / inertia over the ends that share a body. Blocks
stand in the order of their elimination. The frame is one more body, of no inverse mass, behind the others.
"""

from collections.abc import Iterable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_solver.arrays import MechanismArrays, row_slices
from reference_solver.elimination import Elimination, least_degree
from reference_solver.equations import PIVOT_TOLERANCE_PER_ROW, Baumgarte
from reference_solver.mechanism import (
    GROUND,
    Constraint,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    SpringDamper,
    StraightGuide,
)

FloatArray = NDArray[np.float64]
Records = NDArray[np.void]


def _record(integers: str, constants: str, computed: str = "") -> np.dtype[np.void]:
    names = [(name, np.int64) for name in integers.split()]
    return np.dtype(names + [(name, np.float64) for name in f"{constants} {computed}".split()])


#: In 1/kg and 1/(kg m^2).
BODY = _record("", "inverse_mass inverse_inertia", computed="cos sin")
#: The point is in the body's frame, in m, and negative on body i of a joint.
END = _record("body row", "xx xy yx yy w0_x w0_y point_x point_y", computed="arm_x arm_y w_x w_y")
#: The two rows of a constraint: the first in [B]; where its column of blocks below the diagonal and its
#: elimination steps begin and end; C and the constant part d of {g}; the right-hand side, then solution z;
#: the weights of z in the energy that a stabilisation removes; of the pivot block the least values and the
#: inverse.
ROWS = _record(
    "row first_below last_below first_update last_update",
    "C d_x d_y",
    computed="z_x z_y weight_x weight_y floor_x floor_y inverse_xx inverse_xy inverse_yy",
)
#: First all diagonal blocks, then column by column those below; the constant part, the matrix, and L.
BLOCK = _record("row", "xx_0 xy_0 yx_0 yy_0", computed="xx xy yx yy L_xx L_xy L_yx L_yy")
#: Two ends on one body and the block they add to.
PAIR = _record("block i j", "")
#: One elimination step: the product of L of block i and the transpose of block j is taken from a block.
UPDATE = _record("block i j", "")
SPRING = _record("body_i body_j", "x_i y_i x_j y_j stiffness damping free_length")


class Plan(NamedTuple):
    """A mechanism with b bodies and k constraints; the kernel writes the computed fields of its records."""

    bodies: Records  # (b + 1,)
    ends: Records
    rows: Records  # (k,)
    blocks: Records
    pairs: Records
    updates: Records
    springs: Records
    drivers: NDArray[np.int64]  # which rows have C
    free: FloatArray  # (3b + 3,), [M]^-1{F} of gravity and torques
    two_alpha: float  # Baumgarte's gains, or zero
    beta_squared: float
    tolerance: float  # the least pivot, relative to its diagonal entry


def make_plan(mechanism: Mechanism, q_start: FloatArray, baumgarte: Baumgarte | None) -> Plan:
    """Return the plan of a mechanism; ``q_start`` (3b,) are the coordinates that {g} is measured from.

    Raises:
        ValueError: the mechanism contains what the block kernel has no code for.
    """
    if mechanism.contacts:
        raise ValueError(
            f"contacts: expected none in the block kernel, which serves mechanisms of many bodies, "
            f"got {len(mechanism.contacts)}"
        )
    constant = MechanismArrays(mechanism, q_start)
    elimination = least_degree(mechanism.constraints)
    bodies = np.zeros(len(mechanism.bodies) + 1, BODY)
    bodies["inverse_mass"][:-1] = constant.inverse_mass[::3]
    bodies["inverse_inertia"][:-1] = constant.inverse_mass[2::3]
    rows, ends = _rows_and_ends(mechanism, constant, elimination.order)
    blocks, pairs, updates = _matrix(mechanism, elimination, bodies, rows, ends)
    return Plan(
        bodies,
        ends,
        rows,
        blocks,
        pairs,
        updates,
        springs=_springs(mechanism),
        drivers=np.flatnonzero(rows["C"]),
        free=np.append(constant.inverse_mass * constant.F, np.zeros(3)),
        two_alpha=2 * baumgarte.alpha_s if baumgarte else 0.0,
        beta_squared=baumgarte.beta_s**2 if baumgarte else 0.0,
        tolerance=len(constant.C) * PIVOT_TOLERANCE_PER_ROW,
    )


def _rows_and_ends(
    mechanism: Mechanism, constant: MechanismArrays, order: list[int]
) -> tuple[Records, Records]:
    """Return the constraints in order, and their ends on moving bodies."""
    slices, rows, ends = row_slices(mechanism), np.zeros(len(order), ROWS), []
    for k, constraint in enumerate(order):
        of = slices[constraint]
        d = _two(constant.d[of])
        for body, point in _sides(mechanism.constraints[constraint]):
            if body == GROUND:
                d += point
            else:
                B = _two(constant.E[of, constant.columns(body)])
                ends.append((body, k, *B[:, :2].ravel(), *B[:, 2], *point, 0.0, 0.0, 0.0, 0.0))
        rows[["row", "C", "d_x", "d_y"]][k] = (of.start, constant.C[of.start], *d)
    return rows, np.array(ends, END)


def _sides(constraint: Constraint) -> list[tuple[int, FloatArray]]:
    """Return the bodies of a constraint, each with its point as it enters {g}: negative on body i."""
    if isinstance(constraint, RevoluteJoint):
        return [
            (constraint.body_i, -np.array(constraint.point_i, dtype=float)),
            (constraint.body_j, np.array(constraint.point_j, dtype=float)),
        ]
    if isinstance(constraint, StraightGuide | PrescribedSpeed):
        return [(constraint.body, np.zeros(2))]
    raise ValueError(
        f"constraints: expected joints, guides and drivers in the block kernel, which serves mechanisms of "
        f"many bodies, got a {type(constraint).__name__}"
    )


def _two(values: FloatArray) -> FloatArray:
    """Return one or two rows of a vector or a matrix as two, with zeros."""
    return np.concatenate([values, np.zeros((2 - len(values), *values.shape[1:]))])


def _matrix(
    mechanism: Mechanism, elimination: Elimination, bodies: Records, rows: Records, ends: Records
) -> tuple[Records, Records, Records]:
    """Return blocks, pairs of ends and elimination steps; write to ``rows`` where each column's begin."""
    size, below = len(rows), elimination.below
    places = [(k, k) for k in range(size)] + [(i, k) for k, column in enumerate(below) for i in column]
    number = {place: n for n, place in enumerate(places)}
    rows["first_below"], rows["last_below"] = _spans(size, below)
    steps = [[(i, j, k) for i in column for j in column if j <= i] for k, column in enumerate(below)]
    rows["first_update"], rows["last_update"] = _spans(0, steps)
    updates = [(number[i, j], number[i, k], number[j, k]) for column in steps for i, j, k in column]

    constant = np.zeros((len(places), 2, 2))
    for k, constraint in enumerate(elimination.order):
        if isinstance(mechanism.constraints[constraint], PrescribedSpeed):
            constant[k, 1, 1] = 1.0  # the dummy
    pairs = []
    on_body: dict[int, list[int]] = {}
    for e, body in enumerate(ends["body"]):
        on_body.setdefault(body, []).append(e)
    for body, sharing in on_body.items():
        for e, f in product(sharing, repeat=2):
            if ends["row"][e] >= ends["row"][f]:
                n = number[ends["row"][e], ends["row"][f]]
                constant[n] += bodies["inverse_mass"][body] * _E(ends[e]) @ _E(ends[f]).T
                pairs.append((n, e, f))
    blocks = np.zeros(len(places), BLOCK)
    blocks["row"] = [i for i, _ in places]
    blocks["xx_0"], blocks["xy_0"], blocks["yx_0"], blocks["yy_0"] = constant.reshape(-1, 4).T
    return blocks, np.array(pairs, PAIR), np.array(updates, UPDATE)


def _E(end: np.void) -> FloatArray:
    return np.array([[end["xx"], end["xy"]], [end["yx"], end["yy"]]])


def _spans(start: int, columns: Iterable[Sequence[object]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where each column begins and ends in their concatenation, counted from ``start``."""
    ends = np.cumsum([start, *(len(column) for column in columns)])
    return ends[:-1], ends[1:]


def _springs(mechanism: Mechanism) -> Records:
    size = len(mechanism.bodies) + 1  # the frame's index, -1, is the last
    springs = [
        (
            s.body_i % size,
            s.body_j % size,
            *s.point_i,
            *s.point_j,
            s.stiffness_N_m,
            s.damping_N_s_m,
            s.free_length_m,
        )
        for s in mechanism.loads
        if isinstance(s, SpringDamper)
    ]
    return np.array(springs, SPRING)
