"""The equations of motion while pins follow their walls, with friction: the text to read.

A pin that follows has one row g = (d.d - c^2)/2 of [B], and F_n = -lambda c presses it inwards. Friction is
F_t = -mu F_n f(v_t) on the pin along t, with v_t the sliding speed and f one of the friction laws, which are
regularised: F_t is a function of the state and of F_n, also at v_t = 0, where a pin creeps rather than
sticks. With T the row of sliding speed, which holds the torque arms R_i and R_j = R_i - c of both bodies,

    {q''} = [M]^-1 ({F} + [B]^T {lambda} + [T]^T {tau}),   tau = s lambda of the pin's own row, s = mu c f.

Friction in r joints so changes the matrix of {lambda} by rank r, and makes it unsymmetric. [B][M]^-1[B]^T is
factored as ever. With {lambda}_0 of no friction, [X] = ([B][M]^-1[B]^T)^-1 [B][M]^-1[T]^T and [X]_R those of
its rows that belong to the r pins,

    {lambda} = {lambda}_0 - [X]{tau},   ([1] + [S][X]_R) {tau} = [S] {lambda}_0R,   [S] = diag(s).

The pivots of this small matrix are, joint by joint, what friction makes of the joint's mobility along its
normal, as a part of the one it has without. They have to be positive: otherwise a wall that pushes harder
would bring the pin nearer (Painleve 1895; Genot and Brogliato 1999), and no force fits.

Friction is a damper of v_t of rate mu F_n f' w at most, w = [T][M]^-1([T]^T - [B]^T[X]) being the mobility
along t that the rows leave. Classical RK4 is stable up to h rate = 2.785. The step has to keep below with the
law's steepest f', wherever v_t is: a reversal may come within any step, and a step beyond the limit would
throw v_t from side to side.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reference_solver.contact_laws import FRICTION_LAWS, steepest
from reference_solver.equations import Answer, Equations
from reference_solver.errors import SolverError
from reference_solver.factors import eliminated
from reference_solver.mechanism import GROUND, Mechanism
from reference_solver.points import State
from reference_solver.rigid_joint import RigidJoint
from reference_solver.tape import Array, Scalar, array, both, larger, named, sqrt

FloatArray = NDArray[np.float64]

#: Classical RK4's limit of h times a damper's rate, on the negative real axis.
RK4_DAMPER_LIMIT = 2.785
#: The least part of a normal mobility that friction may leave: below are round-off and forces without bound.
LEAST_MOBILITY = 1e-9


class PainleveParadox(SolverError):
    """Friction leaves a pin no motion that answers its wall's push along the normal."""

    def __init__(self, time_s: float, joints: tuple[int, ...]) -> None:
        super().__init__(
            f"rigid joints {', '.join(map(str, joints))} at t = {time_s:.6g} s: with friction the normal "
            "mobility is not positive (Painleve's paradox): lower the friction or use a compliant law"
        )


class FrictionTooStiff(SolverError):
    """The step is too long for the damping by regularised friction; one below ``needed_s`` is not."""

    def __init__(self, time_s: float, h: float, rate: float) -> None:
        self.needed_s = RK4_DAMPER_LIMIT / rate
        super().__init__(
            f"step {h:.3g} s at t = {time_s:.6g} s: friction in rigid joints damps sliding at {rate:.3g} 1/s "
            f"and needs a step below {self.needed_s:.3g} s: shorten the step or raise the "
            "regularisation speed"
        )


def held(mechanism: Mechanism, joints: tuple[RigidJoint, ...], following: tuple[int, ...]) -> Mechanism:
    """Return the mechanism with one more row for each joint that follows its wall, its last."""
    links = tuple(joints[k].link() for k in following)
    return Mechanism(
        mechanism.bodies, (*mechanism.constraints, *links), mechanism.loads, mechanism.gravity_m_s2
    )


class FollowingEquations(Equations):
    """The equations of a mechanism whose last rows belong to joints in ``following``, with their friction.

    The mechanism is that of ``held``, of numbers or of a tape's values, like ``q_start``.
    """

    def __init__(
        self, mechanism: Mechanism, joints: tuple[RigidJoint, ...], following: tuple[int, ...], q_start: Array
    ) -> None:
        super().__init__(mechanism, q_start)
        self.joints, self.following = joints, following
        first = len(self.C) - len(following)
        #: Row, number and friction of the joints that follow with friction.
        self.rubbing = [
            (first + i, k, law) for i, k in enumerate(following) if (law := joints[k].friction) is not None
        ]

    @property
    def power_names(self) -> list[str]:
        """Names of the drivers' power, of every joint's normal force, and of its power lost in friction."""
        numbers = range(len(self.joints))
        return ["drivers", *(f"normal{k}" for k in numbers), *(f"slide{k}" for k in numbers)]

    def answer(self, t: Scalar, q: Array, v: Array) -> Answer:
        """Return {q''}, {lambda} and powers; ``ok`` also says that friction leaves the pins mobility."""
        found = super().answer(t, q, v)
        if self.rubbing:
            found = self._rubbed(t, q, v, found)
        powers = {**dict.fromkeys(self.power_names, 0.0), **found.powers}
        for row, k in enumerate(self.following, len(self.C) - len(self.following)):
            powers[f"normal{k}"] = -(self.joints[k].radial_clearance_m * found.multipliers[row])
        return replace(found, powers=powers)

    def _rubbed(self, t: Scalar, q: Array, v: Array, found: Answer) -> Answer:
        """Return the answer with friction."""
        state, B, rows = State(q, v), self.system(t, q, v).B, [row for row, *_ in self.rubbing]
        T = array([sliding_row(self.joints[k], state) for _, k, _ in self.rubbing])
        sliding = named("sliding", T @ v, "friction of pins that follow")
        s = named("s", self.shares(sliding))
        weighted = self.inverse_mass[:, None] * T.T
        X = self.factors(B).solve(B @ weighted)
        motion = weighted - (B * self.inverse_mass).T @ X
        small = np.eye(len(rows)) + s[:, None] * X[rows]
        tau, pivots = eliminated(small, s * found.multipliers[rows])
        lambda_ = found.multipliers - X @ named("tau", tau)
        ok, damper = found.ok, 0.0
        for i, (row, k, law) in enumerate(self.rubbing):
            ok = both(ok, pivots[i] > LEAST_MOBILITY)
            # d tau/d v_t of each joint alone: of several the sum is not below the largest rate.
            pressing = larger(-(self.joints[k].radial_clearance_m * lambda_[row]), 0.0)
            slope = law.coefficient * steepest(law)
            damper = damper + slope * pressing * (T[i] @ motion[:, i]) / small[i, i]
        powers = {f"slide{k}": -(tau[i] * sliding[i]) for i, (_, k, _) in enumerate(self.rubbing)}
        powers["drivers"] = lambda_ @ self.C
        return Answer(found.accelerations + motion @ tau, lambda_, powers, 0.0, damper, ok)

    def required(self, t: float, q: FloatArray, v: FloatArray, h: float = 0.0) -> Answer:
        """Return the answer in numbers, for a step of h.

        Raises:
            SingularConfiguration: [B] has not full row rank.
            PainleveParadox: friction leaves a pin no mobility along its normal.
            FrictionTooStiff: a step of h is too long at this state.
        """
        found = self.answer(t, q, v)
        if not found.ok and np.isfinite(q).all() and np.isfinite(v).all():
            if not self.factors(self.system(t, q, v).B).ok:
                self.refuse_singular(t, q)
            raise PainleveParadox(t, tuple(k for _, k, _ in self.rubbing))
        if h * found.damper_per_s > RK4_DAMPER_LIMIT:
            raise FrictionTooStiff(t, h, float(found.damper_per_s))
        return found

    def shares(self, sliding: Array) -> Array:
        """Return s = mu c f(v_t) (r,) in m of the joints that rub."""
        return array(
            [
                law.coefficient * self.joints[k].radial_clearance_m * FRICTION_LAWS[law.kind](law, speed)
                for (_, k, law), speed in zip(self.rubbing, sliding, strict=True)
            ]
        )

    def friction_forces(self, q: FloatArray, v: FloatArray, lambda_: FloatArray) -> dict[int, float]:
        """Return the force F_t in N on the pins along t by joint, of those that have friction."""
        sliding = [sliding_row(self.joints[k], State(q, v)) @ v for _, k, _ in self.rubbing]
        forces = zip(self.rubbing, self.shares(np.array(sliding)), strict=True)
        return {k: float(share * lambda_[row]) for (row, k, _), share in forces}


def sliding_row(joint: RigidJoint, state: State) -> Array:
    """Return the row (n,) that gives the sliding speed from {q'}."""
    i, j = state.point(joint.body_i, joint.point_i), state.point(joint.body_j, joint.point_j)
    d = j.place - i.place
    distance = sqrt(d @ d)
    along = array([-(d[1] / distance), d[0] / distance])
    radii = (-joint.bearing_radius_m, joint.bearing_radius_m - joint.radial_clearance_m)
    row: list[Scalar] = [0.0] * len(state.q)
    for point, sign, radius in zip((i, j), (-1, 1), radii, strict=True):
        if point.body != GROUND:
            entries = sign * (along @ point.jacobian)
            row[3 * point.body : 3 * point.body + 3] = [entries[0], entries[1], entries[2] + radius]
    return array(row)
