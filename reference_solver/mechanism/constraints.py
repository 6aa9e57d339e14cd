"""The rows that each kind of constraint has in [B]{q'} = {C}, (1): one function for each.

Above each function stand the constraint g = 0, its time derivative g' = [B]{q'} - {C} = 0, and of the next
one, (4), the right-hand side {C'} - [B']{q'} of [B]{q''}; {C'} = 0 but for prescribed motions. There p
is a point of a body in the global frame and a leads to it from the body's centre of mass, so that
p' = (x', y') + phi' (-a_y, a_x) and p'' = (x'', y'') + phi'' (-a_y, a_x) - phi'^2 a.

A new joint is a function, and a line in ``rows_of``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from reference_solver.mechanism.contacts import ClearanceJoint
from reference_solver.mechanism.data import GROUND, Guide, Line, Motion, Pin
from reference_solver.mechanism.motions import moved
from reference_solver.mechanism.points import State, ends_of, line_at
from reference_solver.tape import Array, FloatArray, Scalar, array


@dataclass(frozen=True)
class PrescribedMotion:
    """One row of [B]: the body turns as a function of time says. The multiplier is the torque in N m."""

    body: int
    motion: Motion
    name: str = field(default="drive", compare=False)


@dataclass(frozen=True)
class PrescribedSlide(Line):
    """One row of [B]: the point of body j moves along the line of body i as a function of time says.

    Nothing keeps it on the line. The multiplier is the driver's force in N on body j along the line.
    """

    motion: Motion
    name: str = field(default="drive", compare=False)


Driver = PrescribedMotion | PrescribedSlide
#: A joint with clearance has a row while its pin follows a rigid wall.
Constraint = Pin | Guide | Driver | ClearanceJoint


@dataclass(frozen=True)
class Rows:
    """The k rows of a constraint.

    ``blocks`` has (k, 3) of [B] for each body under the constraint, GROUND's dropped later; ``B_dot_v`` (k,)
    is of (4), and ``g`` (k,) are gaps in m, angles in rad, walls' in m^2: dg/dt = [B]{q'} - {C}. What is
    given, {C} and {C'}, is one number each.
    """

    blocks: dict[int, Array]
    B_dot_v: Array
    g: Array
    C: Scalar = 0.0
    C_dot: Scalar = 0.0


# g = p_j - p_i = 0
# g' = p_j' - p_i' = 0, so [B] is (-1, 0, a_y; 0, -1, -a_x) of body i, with the other signs of body j
# [B]{q''} = phi_j'^2 a_j - phi_i'^2 a_i
def revolute_joint(joint: Pin, state: State) -> Rows:
    """Return the rows of two points that stay together; their multipliers are the force in N on body j."""
    i, j = ends_of(joint, state)
    blocks = {joint.body_i: -i.jacobian, joint.body_j: j.jacobian}
    return Rows(blocks, j.centripetal - i.centripetal, j.place - i.place)


# g = n.d = 0, d = p_j - p_i, with u along the line and n across it: u' = phi_i' n and n' = -phi_i' u
# g' = n.d' - phi_i' u.d = 0, so [B] is n times the rows of a revolute joint, with -u.d more for phi_i'
# [B]{q''} = n.(phi_j'^2 a_j - phi_i'^2 a_i) + 2 phi_i' u.d' + phi_i'^2 n.d
#
# Unless body j turns freely: g = phi_j - phi_j(0) - (phi_i - phi_i(0)) = 0
# g' = phi_j' - phi_i' = 0, so [B] is (0, 0, -1) of body i and (0, 0, 1) of body j
# [B]{q''} = 0
def guided(guide: Guide, state: State, start: Array) -> Rows:
    """Return the row of a point that stays on a line of another body, and of two bodies that turn together.

    The multipliers are the force in N on body j along n, and the moment in N m on it.
    """
    i, j, along, across, d = line_at(guide, state)
    d_dot = j.rate - i.rate
    of_i = -(across @ i.jacobian) - array([0.0, 0.0, along @ d])
    of_j, turning = across @ j.jacobian, 2.0 * (along @ d_dot) + i.spin * (across @ d)
    B_dot_v = across @ (j.centripetal - i.centripetal) - i.spin * turning
    if guide.turns:
        blocks = {guide.body_i: of_i[None], guide.body_j: of_j[None]}
        return Rows(blocks, array([B_dot_v]), array([across @ d]))
    blocks = {guide.body_i: array([of_i, [0.0, 0.0, -1.0]]), guide.body_j: array([of_j, [0.0, 0.0, 1.0]])}
    turned_i, turned_j = (turned_by(body, state, start) for body in (guide.body_i, guide.body_j))
    return Rows(blocks, array([B_dot_v, 0.0]), array([across @ d, turned_j - turned_i]))


# g = phi - phi(0) - turned(t) = 0
# g' = phi' - C(t) = 0, so [B] is (0, 0, 1) and {C} is C(t), the rate of turned(t)
# [B]{q''} = C'(t)
def prescribed_motion(driver: PrescribedMotion, state: State, start: Array) -> Rows:
    """Return the row of a body that turns as a function of time says."""
    turned, speed, acceleration = moved(driver.motion, state.t)
    angle = turned_by(driver.body, state, start) - turned
    blocks = {driver.body: array([[0.0, 0.0, 1.0]])}
    return Rows(blocks, array([0.0]), array([angle]), speed, acceleration)


# g = u.d - (u.d)(0) - moved(t) = 0, d = p_j - p_i, with u along the line and n across it: u' = phi_i' n
# g' = u.d' + phi_i' n.d - C(t) = 0, so [B] is u times the rows of a revolute joint, with n.d more for phi_i'
# [B]{q''} = C'(t) + u.(phi_j'^2 a_j - phi_i'^2 a_i) - 2 phi_i' n.d' + phi_i'^2 u.d
def prescribed_slide(driver: PrescribedSlide, state: State, start: Array) -> Rows:
    """Return the row of a point that moves along a line of another body as a function of time says."""
    way, speed, acceleration = moved(driver.motion, state.t)
    i, j, along, across, d = line_at(driver, state)
    of_i = array([0.0, 0.0, across @ d]) - along @ i.jacobian
    blocks = {driver.body_i: of_i[None], driver.body_j: (along @ j.jacobian)[None]}
    turning = 2.0 * (across @ (j.rate - i.rate)) - i.spin * (along @ d)
    B_dot_v = along @ (j.centripetal - i.centripetal) + i.spin * turning
    _, _, along_first, _, first = line_at(driver, State(start, start))
    g = along @ d - along_first @ first - way
    return Rows(blocks, array([B_dot_v]), array([g]), speed, acceleration)


def turned_by(body: int, state: State, start: Array) -> Scalar:
    """Return the angle that a body has turned since the start."""
    return 0.0 if body == GROUND else state.position(body)[2] - start[3 * body + 2]


# g = (d.d - c^2)/2 = 0, d = p_j - p_i
# g' = d.d' = 0, so [B] is d times the rows of a revolute joint
# [B]{q''} = -d'.d' + d.(phi_j'^2 a_j - phi_i'^2 a_i)
def following(joint: ClearanceJoint, state: State) -> Rows:
    """Return the row of a pin that follows its wall, at a distance c from its bearing.

    The force on body j is lambda d, lambda in N/m: the wall pushes the pin inwards while lambda < 0.
    """
    i, j = ends_of(joint, state)
    d, d_dot, c = j.place - i.place, j.rate - i.rate, joint.radial_clearance_m
    blocks = {joint.body_i: -(d @ i.jacobian)[None], joint.body_j: (d @ j.jacobian)[None]}
    B_dot_v = d_dot @ d_dot + d @ (j.centripetal - i.centripetal)
    return Rows(blocks, array([B_dot_v]), array([0.5 * (d @ d) - c * c / 2]))


def rows_of(constraint: Constraint, state: State, start: Array) -> Rows:
    """Return the rows of a constraint at a state, with the coordinates at the start."""
    match constraint:
        case Pin():
            return revolute_joint(constraint, state)
        case Guide():
            return guided(constraint, state, start)
        case PrescribedMotion():
            return prescribed_motion(constraint, state, start)
        case PrescribedSlide():
            return prescribed_slide(constraint, state, start)
        case ClearanceJoint():
            return following(constraint, state)


@dataclass(frozen=True)
class System:
    """The rows of all constraints at a state: [B] (m, n), and {C}, {C'}, [B']{q'} and {g}, each (m,)."""

    B: Array
    C: Array
    C_dot: Array
    B_dot_v: Array
    g: Array


def system_of(constraints: Sequence[Constraint], state: State, start: Array) -> System:
    """Return the rows of constraints at a state, with the coordinates at the start."""
    parts = [rows_of(c, state, start) for c in constraints]
    n, rows = len(state.q), list[list[Scalar]]()
    for part in parts:
        for k in range(len(part.g)):
            row: list[Scalar] = [0.0] * n
            for body, block in part.blocks.items():
                if body != GROUND:
                    row[3 * body : 3 * body + 3] = block[k]
            rows.append(row)
    C, C_dot = (array([x for p in parts for x in [getattr(p, of)] * len(p.g)]) for of in ("C", "C_dot"))
    B_dot_v, g = (array([x for part in parts for x in getattr(part, of)]) for of in ("B_dot_v", "g"))
    return System(array(rows).reshape(-1, n), C, C_dot, B_dot_v, g)


def row_slices(constraints: Sequence[Constraint], n: int) -> list[slice]:
    """Return the rows of [B] (m, n), and so the multipliers, of each constraint in order."""
    still = np.zeros(n)
    ends = np.cumsum([0, *(len(rows_of(c, State(still, still), still).g) for c in constraints)])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


def row_dependence(B: Array, inverse_mass: Array, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Return the singular values (m,), falling, of the rows of [B] (m, n), each of length 1 in [M]^-1's norm.

    Also of every row its share in those below a tolerance, or in the least.
    """
    scaled = B * np.sqrt(inverse_mass)
    size = np.linalg.norm(scaled, axis=1, keepdims=True)
    left, values, _ = np.linalg.svd(scaled / np.where(size > 0, size, 1.0))
    values = np.append(values, np.zeros(len(left) - len(values)))
    small = values <= max(tolerance, values.min(initial=np.inf))
    return values, np.linalg.norm(left[:, small], axis=1)
