"""Friction of pins that follow rigid walls: it changes the equations of motion by few columns.

A pin that follows has one row g = (d.d - c^2)/2 of [B], and F_n = -lambda c presses it inwards. Friction is
F_t = -mu F_n f(v_t) on the pin along t, with v_t the sliding speed and f one of the friction laws, which are
regularised: F_t is a function of the state and of F_n, also at v_t = 0, where a pin creeps rather than
sticks. With T the row of sliding speed, which holds the torque arms R_i and R_j = R_i - c of both bodies,

    {q''} = [M]^-1 ({F} + [B]^T {lambda} + [T]^T {tau}),   tau = s lambda of the pin's own row, s = mu c f.

Friction in r joints so changes the matrix of {lambda} by rank r, and makes it unsymmetric. The equations
are factored as ever. With {lambda}_0 of no friction, [X] and [Y] the {q''} and multipliers of forces [T]^T
alone, and [Y]_R those rows of it that belong to the r pins,

    {lambda} = {lambda}_0 + [Y]{tau},   ([1] - [S][Y]_R) {tau} = [S] {lambda}_0R,   [S] = diag(s).

The pivots of this small matrix are, joint by joint, what friction makes of the joint's mobility along its
normal, as a part of the one it has without. They have to be positive: otherwise a wall that pushes harder
would bring the pin nearer (Painleve 1895; Genot and Brogliato 1999), and no force fits.

Friction is a damper of v_t of rate mu F_n f' w at most, w = [T][X] being the mobility along t that the rows
leave. Classical RK4 is stable up to h rate = 2.785. The step has to keep below with the
law's steepest f', wherever v_t is: a reversal may come within any step, and a step beyond the limit would
throw v_t from side to side.
"""

import numpy as np

from reference_solver.factorisation import Factors, eliminated
from reference_solver.mechanism.contacts import FRICTION_LAWS, ClearanceJoint, separation, steepest
from reference_solver.mechanism.data import FrictionLaw
from reference_solver.mechanism.points import State
from reference_solver.tape import Array, Scalar, array, both, larger

#: The least part of a normal mobility that friction may leave: below are round-off and forces without bound.
LEAST_MOBILITY = 1e-9


#: A pin that follows its wall with friction: its row of [B], its number among the contacts, it and its law.
Rubbing = tuple[int, int, ClearanceJoint, FrictionLaw]


def rubbed(
    pins: list[Rubbing], state: State, factors: Factors, multipliers: Array
) -> tuple[Array, Array, Array, Array, Scalar, Scalar]:
    """Return what friction of r pins changes, from the equations' factors and {lambda} without it.

    That is the change of {q''} (n,); {lambda} (m,) with it; the forces (r,) in N on the pins along t, and the
    speeds (r,) against which they act; the rate of the damper that friction is; and whether it leaves the
    pins their mobility.
    """
    rows = [row for row, *_ in pins]
    T = array([separation(joint, state).tangent for *_, joint, _ in pins])
    sliding, shares = T @ state.v, list[Scalar]()
    for (*_, joint, law), speed in zip(pins, sliding, strict=True):
        shares.append(law.coefficient * joint.radial_clearance_m * FRICTION_LAWS[law.law](law, speed))
    s = array(shares)
    X, Y = factors.solve(T.T, np.zeros((len(multipliers), len(T))))
    small = np.eye(len(rows)) - s[:, None] * Y[rows]
    tau, pivots = eliminated(small, s * multipliers[rows])
    lambda_ = multipliers + Y @ tau
    ok: Scalar = True
    damper: Scalar = 0.0
    for i, (row, _, joint, law) in enumerate(pins):
        ok = both(ok, pivots[i] > LEAST_MOBILITY)
        # d tau/d v_t of each joint alone: of several the sum is not below the largest rate.
        pressing = larger(-(joint.radial_clearance_m * lambda_[row]), 0.0)
        slope = law.coefficient * steepest(law)
        damper = damper + slope * pressing * (T[i] @ X[:, i]) / small[i, i]
    return X @ tau, lambda_, tau, sliding, damper, ok
