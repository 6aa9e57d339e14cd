"""The rows that each kind of constraint has in [B]{q'} = {C}, (1): one function for each.

Above each function stand the constraint g = 0, its time derivative g' = [B]{q'} - {C} = 0, and of the next
one, (4), the right-hand side {C'} - [B']{q'} of [B]{q''}; {C'} = 0 but for prescribed motions. There p
is a point of a body in the global frame and a leads to it from the body's centre of mass, so that
p' = (x', y') + phi' (-a_y, a_x) and p'' = (x'', y'') + phi'' (-a_y, a_x) - phi'^2 a.

``CONSTRAINTS`` names the function of each kind: a new joint is one function and one line there.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from reference_solver.mechanism.mechanism import (
    GROUND,
    Constraint,
    MasslessLink,
    Mechanism,
    PrescribedMotion,
    PrescribedSlide,
    PrescribedSpeed,
    RevoluteJoint,
    SameAngle,
    Slot,
)
from reference_solver.mechanism.motions import MOTIONS
from reference_solver.mechanism.points import State, ends_of
from reference_solver.tape import Array, Scalar, array


@dataclass(frozen=True)
class Rows:
    """The k rows of a constraint.

    ``blocks`` has (k, 3) of [B] for each body under the constraint, GROUND's dropped later; ``C`` (k,),
    ``B_dot_v`` (k,) of (4), and ``g`` (k,), gaps in m, angles in rad, links' in m^2: dg/dt = [B]{q'} - {C}.
    ``C_dot`` (k,) is {C'}, zeros where nothing is given.
    """

    blocks: dict[int, Array]
    C: Array
    B_dot_v: Array
    g: Array
    C_dot: Array | None = None


# g = p_j - p_i = 0
# g' = p_j' - p_i' = 0, so [B] is (-1, 0, a_y; 0, -1, -a_x) of body i, with the other signs of body j
# [B]{q''} = phi_j'^2 a_j - phi_i'^2 a_i
def revolute_joint(joint: RevoluteJoint, state: State, t: Scalar, start: Array) -> Rows:  # noqa: ARG001
    """Return the rows of two points that stay together: that of body j less that of body i."""
    i, j = ends_of(joint, state)
    blocks = {joint.body_i: -i.jacobian, joint.body_j: j.jacobian}
    return Rows(blocks, array([0.0, 0.0]), j.centripetal - i.centripetal, j.place - i.place)


# g = n.d = 0, d = p_j - p_i, with u along the line and n across it: u' = phi_i' n and n' = -phi_i' u
# g' = n.d' - phi_i' u.d = 0, so [B] is n times the rows of a revolute joint, with -u.d more for phi_i'
# [B]{q''} = n.(phi_j'^2 a_j - phi_i'^2 a_i) + 2 phi_i' u.d' + phi_i'^2 n.d
def slot(joint: Slot, state: State, t: Scalar, start: Array) -> Rows:  # noqa: ARG001
    """Return the row of a point that stays on a line of another body."""
    i, j = ends_of(joint, state)
    along = state.direction(joint.body_i, joint.angle_rad)
    across = array([-along[1], along[0]])
    d, d_dot = j.place - i.place, j.rate - i.rate
    of_i = -(across @ i.jacobian) - array([0.0, 0.0, along @ d])
    blocks = {joint.body_i: of_i[None], joint.body_j: (across @ j.jacobian)[None]}
    turning = 2.0 * (along @ d_dot) + i.spin * (across @ d)
    B_dot_v = across @ (j.centripetal - i.centripetal) - i.spin * turning
    return Rows(blocks, array([0.0]), array([B_dot_v]), array([across @ d]))


# g = phi_j - phi_j(0) - (phi_i - phi_i(0)) = 0
# g' = phi_j' - phi_i' = 0, so [B] is (0, 0, -1) of body i and (0, 0, 1) of body j
# [B]{q''} = 0
def same_angle(joint: SameAngle, state: State, t: Scalar, start: Array) -> Rows:  # noqa: ARG001
    """Return the row of two bodies that turn together."""
    turned_i, turned_j = (turned_by(body, state, start) for body in (joint.body_i, joint.body_j))
    blocks = {joint.body_i: array([[0.0, 0.0, -1.0]]), joint.body_j: array([[0.0, 0.0, 1.0]])}
    return Rows(blocks, array([0.0]), array([0.0]), array([turned_j - turned_i]))


# g = phi - phi(0) - omega t = 0
# g' = phi' - omega = 0, so [B] is (0, 0, 1) and {C} is omega
# [B]{q''} = 0
def prescribed_speed(driver: PrescribedSpeed, state: State, t: Scalar, start: Array) -> Rows:
    """Return the row of a body that turns at a speed of its own."""
    angle = turned_by(driver.body, state, start) - driver.speed_rad_s * t
    return Rows(
        {driver.body: array([[0.0, 0.0, 1.0]])}, array([driver.speed_rad_s]), array([0.0]), array([angle])
    )


# g = phi - phi(0) - turned(t) = 0
# g' = phi' - C(t) = 0, so [B] is (0, 0, 1) and {C} is C(t), the rate of turned(t)
# [B]{q''} = C'(t)
def prescribed_motion(driver: PrescribedMotion, state: State, t: Scalar, start: Array) -> Rows:
    """Return the row of a body that turns as a function of time says."""
    turned, speed, acceleration = MOTIONS[type(driver.motion)](driver.motion, t)
    angle = turned_by(driver.body, state, start) - turned
    block, zero = array([[0.0, 0.0, 1.0]]), array([0.0])
    return Rows({driver.body: block}, array([speed]), zero, array([angle]), array([acceleration]))


# g = u.d - (u.d)(0) - moved(t) = 0, d = p_j - p_i, with u along the line and n across it: u' = phi_i' n
# g' = u.d' + phi_i' n.d - C(t) = 0, so [B] is u times the rows of a revolute joint, with n.d more for phi_i'
# [B]{q''} = C'(t) + u.(phi_j'^2 a_j - phi_i'^2 a_i) - 2 phi_i' n.d' + phi_i'^2 u.d
def prescribed_slide(driver: PrescribedSlide, state: State, t: Scalar, start: Array) -> Rows:
    """Return the row of a point that moves along a line of another body as a function of time says."""
    moved, speed, acceleration = MOTIONS[type(driver.motion)](driver.motion, t)
    i, j = ends_of(driver, state)
    along = state.direction(driver.body_i, driver.angle_rad)
    across = array([-along[1], along[0]])
    d, d_dot = j.place - i.place, j.rate - i.rate
    of_i = array([0.0, 0.0, across @ d]) - along @ i.jacobian
    blocks = {driver.body_i: of_i[None], driver.body_j: (along @ j.jacobian)[None]}
    turning = 2.0 * (across @ d_dot) - i.spin * (along @ d)
    B_dot_v = along @ (j.centripetal - i.centripetal) + i.spin * turning
    first_i, first_j = ends_of(driver, first := State(start, start))
    began = first.direction(driver.body_i, driver.angle_rad) @ (first_j.place - first_i.place)
    g = along @ d - began - moved
    return Rows(blocks, array([speed]), array([B_dot_v]), array([g]), array([acceleration]))


def turned_by(body: int, state: State, start: Array) -> Scalar:
    """Return the angle that a body has turned since the start."""
    return 0.0 if body == GROUND else state.position(body)[2] - start[3 * body + 2]


# g = (d.d - length^2)/2 = 0, d = p_j - p_i
# g' = d.d' = 0, so [B] is d times the rows of a revolute joint
# [B]{q''} = -d'.d' + d.(phi_j'^2 a_j - phi_i'^2 a_i)
def massless_link(link: MasslessLink, state: State, t: Scalar, start: Array) -> Rows:  # noqa: ARG001
    """Return the row of two points that keep their distance."""
    i, j = ends_of(link, state)
    d, d_dot = j.place - i.place, j.rate - i.rate
    blocks = {link.body_i: -(d @ i.jacobian)[None], link.body_j: (d @ j.jacobian)[None]}
    B_dot_v = d_dot @ d_dot + d @ (j.centripetal - i.centripetal)
    g = 0.5 * (d @ d) - link.length_m * link.length_m / 2
    return Rows(blocks, array([0.0]), array([B_dot_v]), array([g]))


#: The function of each kind of constraint: of it, the state, the time and the coordinates at the start.
CONSTRAINTS: Mapping[type, Callable[[Any, State, Scalar, Array], Rows]] = MappingProxyType(
    {
        RevoluteJoint: revolute_joint,
        Slot: slot,
        SameAngle: same_angle,
        PrescribedSpeed: prescribed_speed,
        PrescribedMotion: prescribed_motion,
        PrescribedSlide: prescribed_slide,
        MasslessLink: massless_link,
    }
)


@dataclass(frozen=True)
class System:
    """The rows of all constraints at a state: [B] (m, n), and {C}, {C'}, [B']{q'} and {g}, each (m,)."""

    B: Array
    C: Array
    C_dot: Array
    B_dot_v: Array
    g: Array


def system_of(constraints: Sequence[Constraint], state: State, t: Scalar, start: Array) -> System:
    """Return the rows of constraints at a state and a time, with the coordinates at the start."""
    parts = [CONSTRAINTS[type(c)](c, state, t, start) for c in constraints]
    n, rows = len(state.q), list[list[Scalar]]()
    for part in parts:
        for k in range(len(part.C)):
            row: list[Scalar] = [0.0] * n
            for body, block in part.blocks.items():
                if body != GROUND:
                    row[3 * body : 3 * body + 3] = block[k]
            rows.append(row)
    C, B_dot_v, g = (array([x for part in parts for x in getattr(part, of)]) for of in ("C", "B_dot_v", "g"))
    C_dot = array([x for part in parts for x in (0.0 * part.C if part.C_dot is None else part.C_dot)])
    return System(array(rows).reshape(-1, n), C, C_dot, B_dot_v, g)


def row_slices(mechanism: Mechanism) -> list[slice]:
    """Return the rows of [B], and so the multipliers, of each constraint in order."""
    still = np.zeros(3 * len(mechanism.bodies))
    sizes = [len(CONSTRAINTS[type(c)](c, State(still, still), 0.0, still).C) for c in mechanism.constraints]
    ends = np.cumsum([0, *sizes])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]
