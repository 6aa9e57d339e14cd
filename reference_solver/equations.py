"""Equations (1)-(10) of Grigore, Stanescu and Pandrea (ECCOMAS 2008), in their order: the text to read.

Letters are the paper's: M, B, C, F, q, lambda. The constraint force is +B^T lambda. ``_dot`` is a time
derivative. Position-level constraints g, needed for stabilisation only, are measured from the start: a guide
keeps the body's initial angle, and a driver's angle is the initial one plus what it has turned by.

The same text is both faces of the algorithm: of numbers it is the readable one, of a tape's values (see
``tape``) it writes the compiled one.
"""

import math
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from reference_solver import failures
from reference_solver.factorisation import Factors, eliminated
from reference_solver.mechanism import contacts
from reference_solver.mechanism.constraints import System, row_dependence, row_slices, system_of
from reference_solver.mechanism.contacts import CONTACT, FLIGHT, contact_force, rates_of, separation
from reference_solver.mechanism.data import GROUND, Spring
from reference_solver.mechanism.loads import Forces, forces_of, integrated, power_of
from reference_solver.mechanism.mechanism import Mechanism, light
from reference_solver.mechanism.points import State
from reference_solver.methods import RK4, Method
from reference_solver.tape import Array, FloatArray, Scalar, array, both, choose, larger, smaller

#: Phase and memory of every contact, (K, 2); None where all are in flight.
Phases = Array | None

#: A pivot that is mere round-off, relative to its diagonal entry: the row depends on others.
PIVOT_TOLERANCE_PER_ROW = 64 * float(np.finfo(float).eps)
#: Share of a constraint in a dependence of rows from which on it takes part.
INVOLVED = 1e-3
#: Constraints are closed, in m and rad; steps of Newton's method for it; how often a driven mechanism's limit
#: is tried for, and to which part of the time it is told.
CLOSED, NEWTON_STEPS, MOST_TRIALS, RESOLVED = 1e-9, 8, 500, 1e-9
#: Part of the largest mass, and of the largest inertia, from which down a body is light.
LIGHT = 1e-4
#: The least part of a normal mobility that friction may leave: below are round-off and forces without bound.
LEAST_MOBILITY = 1e-9


@dataclass(frozen=True)
class Baumgarte:
    """Baumgarte's (1972) gains in 1/s: -2 alpha (B q' - C) - beta^2 g joins the right-hand side of (4)."""

    alpha_s: float
    beta_s: float


@dataclass(frozen=True)
class Answer:
    """{q''} (n,) and {lambda} (m,) at a state, and what is integrated with them.

    ``powers`` are by name in W, normal forces in N (see ``Equations.power_names``); ``friction_N`` has the
    friction force of every contact, on its pin along t; ``removed_W`` is what Baumgarte's feedback takes
    away; ``damper_per_s`` is the rate of the damper that friction of pins that follow rigid walls is, 0
    without; ``condition`` is that of the constraints (see ``factorisation.Factors``), no less than what light
    bodies make of it anywhere, and infinite where [B] has not full row rank or friction leaves such pins no
    mobility.
    """

    accelerations: Array
    multipliers: Array
    powers: dict[str, Scalar]
    friction_N: list[Scalar]
    removed_W: Scalar
    damper_per_s: Scalar
    condition: Scalar


class Equations:
    """The paper's equations for one mechanism with n = 3 x bodies coordinates and m constraint rows.

    ``q_start`` (n,) are the initial coordinates, from which g is measured. Pins of the contacts in
    ``following`` follow their rigid walls: each has a row more, g = (d.d - c^2)/2, behind all others. The
    ``phases`` that methods take are phase and memory (a/v0) of every contact, constant between events (see
    ``loop``); without them all contacts are in flight.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        q_start: Array,
        baumgarte: Baumgarte | None = None,
        following: tuple[int, ...] = (),
    ) -> None:
        self.mechanism, self.q_start, self._baumgarte = mechanism, q_start, baumgarte
        self.n, self.following = 3 * len(mechanism.bodies), following
        joints = [(k, mechanism.contacts[k]) for k in following]
        self._constraints = (*mechanism.constraints, *(joint for _, joint in joints))
        self.mass = mechanism.masses
        self.inverse_mass = 1.0 / self.mass
        #: Condition up to which constraints may seem to depend on each other by light bodies alone.
        spreads = (reduce(larger, of) / reduce(smaller, of) for of in (self.mass[::3], self.mass[2::3]))
        self._lightness = LIGHT * reduce(larger, spreads)
        #: {C} (m,) at t = 0: what the constraint rows ask of [B]{q'}; not zero in drivers' rows alone.
        self.C = self.system(0.0, np.zeros(self.n)).C
        rows = enumerate(joints, self.own_rows)
        #: The pins that follow with friction: row of [B], number among the contacts, joint and law.
        self.rubbing = [(row, k, joint, law) for row, (k, joint) in rows if (law := joint.friction)]

    @property
    def own_rows(self) -> int:
        """Number of rows of the mechanism's own constraints, which come first."""
        return len(self.C) - len(self.following)

    @property
    def power_names(self) -> list[str]:
        """Names of what is integrated: the drivers' power {lambda}^T{C}, contacts' rates, loads' powers."""
        contacts, loads = enumerate(self.mechanism.contacts), enumerate(self.mechanism.loads)
        rates = (name for k, joint in contacts for name in rates_of(joint, k))
        return ["drivers", *rates, *(f"load{k}" for k, load in loads if integrated(load))]

    def system(self, t: Scalar, q: Array, v: Array | None = None) -> System:
        """Return the rows of (1), [B]{q'} = {C}, with what (4) needs and with {g}; at rest without v."""
        state = State(q, np.zeros(self.n) if v is None else v, t)
        return system_of(self._constraints, state, self.q_start)

    def _compliant(self, phases: Phases) -> list[tuple[Any, ...]]:
        """Return number, joint, phase and memory of every compliant contact."""
        joints = self.mechanism.contacts
        phases = np.full((len(joints), 2), FLIGHT) if phases is None else phases
        return [(k, joint, *phases[k]) for k, joint in enumerate(joints) if not joint.rigid]

    def forces(
        self, t: Scalar, q: Array, v: Array, phases: Phases = None
    ) -> tuple[Array, dict[str, Scalar], list[Scalar]]:
        """Return {F(q, q', t)} (n,) of (2): gravity, loads, compliant contacts; their rates, and friction."""
        state, rates = State(q, v, t), dict.fromkeys(self.power_names, 0.0)
        friction: list[Scalar] = [0.0] * len(self.mechanism.contacts)
        forces = [forces_of(load, state) for load in self.mechanism.loads]
        for k, load in enumerate(self.mechanism.loads):
            if integrated(load):
                rates[f"load{k}"] = power_of(load, forces[k], state)
        for k, joint, phase, memory in self._compliant(phases):
            force, own_rates, friction[k] = contact_force(joint, phase, memory, state)
            forces.append(force)
            rates |= zip(rates_of(joint, k), own_rates, strict=True)
        return self._sum(forces), rates, friction

    def stored_force(self, q: Array, phases: Phases = None) -> Array:
        """Return the part of {F} (n,) that has a potential: gravity, torques, springs, elastic contacts.

        It is what is applied at rest; a clipped contact still stores its elastic energy.
        """
        state = State(q, np.zeros(self.n))
        stored = (x for x in self.mechanism.loads if isinstance(x, Spring) or not integrated(x))
        forces = [forces_of(load, state) for load in stored]
        for _, joint, phase, _ in self._compliant(phases):
            forces.append(contact_force(joint, smaller(phase, CONTACT), 0.0, state)[0])
        return self._sum(forces)

    def _sum(self, forces: list[Forces]) -> Array:
        """Return gravity and the forces on all bodies, (n,)."""
        weights = [-self.mechanism.gravity_m_s2 * body.mass_kg for body in self.mechanism.bodies]
        sideways = [self.mechanism.gravity_x_m_s2 * body.mass_kg for body in self.mechanism.bodies]
        F: list[Scalar] = [x for pull in zip(sideways, weights, strict=True) for x in (*pull, 0.0)]
        for force in forces:
            for body, parts in force.items():
                if body != GROUND:
                    F[3 * body : 3 * body + 3] = [x + y for x, y in zip(F[3 * body :], parts, strict=False)]
        return array(F)

    def factors(self, B: Array) -> Factors:
        """Return the factors of (2) and (4), [M]{x} - [B]^T{y} = {F}, [B]{x} = {c}.

        (5) to (10) solve them by eliminating all of {x} at first, with [M]* = ([B][M]^-1[B]^T)^-1. Here that
        goes first which takes no quotient; [M]* is never formed.
        """
        return Factors(np.diag(self.mass), B, len(B) * PIVOT_TOLERANCE_PER_ROW)

    def answer(self, t: Scalar, q: Array, v: Array, phases: Phases = None) -> Answer:
        """Return {q''} = {A}, {lambda} and powers, equations (3)-(10)."""
        system = self.system(t, q, v)
        F, powers, friction = self.forces(t, q, v, phases)
        factors = self.factors(system.B)  # (1) [B]
        right, removed = system.C_dot - system.B_dot_v, 0.0
        if self._baumgarte is not None:
            right, removed = self._fed_back(self._baumgarte, system, v, factors, right)
        A, lambda_ = factors.solve(F, right)  # (4), then (7) to (10)
        ok, damper = factors.ok, 0.0
        if self.rubbing:
            change, lambda_, damper, mobile = self._rubbed(State(q, v), factors, lambda_, friction, powers)
            A, ok = A + change, both(ok, mobile)
        for row, k in enumerate(self.following, self.own_rows):
            powers[f"normal{k}"] = -(self.mechanism.contacts[k].radial_clearance_m * lambda_[row])
        powers["drivers"] = lambda_ @ system.C
        condition = choose(ok, larger(factors.condition, self._lightness), math.inf)
        return Answer(A, lambda_, powers, friction, removed, damper, condition)

    def _rubbed(
        self,
        state: State,
        factors: Factors,
        multipliers: Array,
        friction: list[Scalar],
        powers: dict[str, Scalar],
    ) -> tuple[Array, Array, Scalar, Scalar]:
        """Return the change of {q''} (n,) by friction of r pins that follow rigid walls; {lambda} with it.

        Also the rate of the damper that friction is, and whether it leaves the pins their mobility. Forces in
        N on pins along t, and their powers, are put among the others.

        A pin that follows has one row g = (d.d - c^2)/2 of [B], and F_n = -lambda c presses it inwards.
        Friction is F_t = -mu F_n f(v_t) on the pin along t, with v_t the sliding speed and f one of the
        friction laws, which are regularised: F_t is a function of the state and of F_n, also at v_t = 0,
        where a pin creeps rather than sticks. With T the row of sliding speed, which holds the torque arms
        R_i and R_j = R_i - c of both bodies,

            {q''} = [M]^-1 ({F} + [B]^T {lambda} + [T]^T {tau}),   tau = s lambda of the pin's own row,

        s = mu c f. This changes the matrix of {lambda} by rank r, and makes it unsymmetric. The equations are
        factored as ever. With {lambda}_0 of no friction, [X] and [Y] the {q''} and multipliers of forces
        [T]^T alone, [Y]_R those rows of it that belong to the r pins, and [S] = diag(s),

            {lambda} = {lambda}_0 + [Y]{tau},   ([1] - [S][Y]_R) {tau} = [S] {lambda}_0R.

        The pivots of this small matrix are, joint by joint, what friction makes of the joint's mobility along
        its normal, as a part of the one it has without. They have to be positive: otherwise a wall that
        pushes harder would bring the pin nearer (Painleve 1895; Genot and Brogliato 1999), and no force fits.

        Friction is a damper of v_t of rate mu F_n f' w at most, w = [T][X] being the mobility along t that
        the rows leave. Classical RK4 is stable up to h rate = 2.785. The step has to keep below with the
        law's steepest f', wherever v_t is: a reversal may come within any step, and a step beyond the limit
        would throw v_t from side to side.
        """
        pins, shares = self.rubbing, list[Scalar]()
        rows = [row for row, *_ in pins]
        T = array([separation(joint, state).tangent for *_, joint, _ in pins])
        sliding = T @ state.v
        for (*_, joint, law), speed in zip(pins, sliding, strict=True):
            part = contacts.FRICTION_LAWS[law.law](law, speed)
            shares.append(law.coefficient * joint.radial_clearance_m * part)
        s = array(shares)
        X, Y = factors.solve(T.T, np.zeros((len(multipliers), len(T))))
        small = np.eye(len(rows)) - s[:, None] * Y[rows]
        tau, pivots = eliminated(small, s * multipliers[rows])
        lambda_ = multipliers + Y @ tau
        ok: Scalar = True
        damper: Scalar = 0.0
        for i, (row, k, joint, law) in enumerate(pins):
            ok = both(ok, pivots[i] > LEAST_MOBILITY)
            # d tau/d v_t of each joint alone: of several the sum is not below the largest rate.
            pressing = larger(-(joint.radial_clearance_m * lambda_[row]), 0.0)
            slope = law.coefficient * contacts.steepest(law)
            damper = damper + slope * pressing * (T[i] @ X[:, i]) / small[i, i]
            friction[k], powers[f"slide{k}"] = tau[i], -(tau[i] * sliding[i])
        return X @ tau, lambda_, damper, ok

    def _fed_back(
        self, gains: Baumgarte, system: System, v: Array, factors: Factors, right: Array
    ) -> tuple[Array, Scalar]:
        """Return the right-hand side of (4) with Baumgarte's feedback, and the power that this takes away.

        The feedback adds -[M]*(2 alpha g' + beta^2 g) to {lambda}, with g' = [B]{q'} - {C}, and its forces do
        the power of these multipliers times [B]{q'}. The part times {C} is in the drivers' work already; what
        is left, and removed, is g'^T [M]* (2 alpha g' + beta^2 g): a damper and a spring of the violation.

        The other multipliers' power on the violation, {lambda}^T g', is not counted. It pays for a violation
        that RK4's error has put in without work, and with it the ledger's residual is larger, not smaller.
        """
        drift = system.B @ v - system.C
        feedback = 2 * gains.alpha_s * drift + gains.beta_s * gains.beta_s * system.g
        _, multipliers = factors.solve(np.zeros(self.n), drift)
        return right - feedback, multipliers @ feedback

    def required(
        self, t: float, q: FloatArray, v: FloatArray, phases: Phases = None, h: float = 0.0, of: Method = RK4
    ) -> Answer:
        """Return the answer in numbers, for a step of h by a method.

        Raises:
            SingularConfiguration: [B] has not full row rank.
            PainleveParadox: friction leaves a pin that follows its wall no mobility along its normal.
            FrictionTooStiff: a step of h is too long at this state.
        """
        answer = self.answer(t, q, v, phases)
        if not answer.condition < math.inf and np.isfinite(q).all() and np.isfinite(v).all():
            if not self.factors(self.system(0.0, q).B).ok:
                self.refuse_singular(t, q)
            joints = failures.listed([str(k) for _, k, *_ in self.rubbing])
            raise failures.PainleveParadox(time_s=t, joints=joints)
        if h * answer.damper_per_s > of.damper_limit:
            rate, needed_s = answer.damper_per_s, of.damper_limit / answer.damper_per_s
            raise failures.FrictionTooStiff(time_s=t, step_s=h, rate=rate, needed_s=float(needed_s))
        return answer

    def refuse_singular(self, t: float, q: FloatArray) -> None:
        """Say why [B] has not full row rank.

        Raises:
            SingularConfiguration: with its rank; TooLight: it has, but for a light body.
            NonFiniteState: it has overflowed.
        """
        tolerance = np.sqrt(len(self.C) * PIVOT_TOLERANCE_PER_ROW)
        if not np.isfinite(q).all():
            raise failures.NonFiniteState(time_s=t)
        if (reason := light(self.mechanism.bodies)) is not None:
            raise failures.TooLight(reason)
        values, shares = row_dependence(self.system(0.0, q).B, self.inverse_mass, tolerance)
        rank, rows = int((values > tolerance).sum()), shares > INVOLVED
        own = enumerate(row_slices(self.mechanism.constraints, self.n))
        names = [self.mechanism.name_of(k) for k, part in own if rows[part].any()]
        walls = zip(self.following, rows[self.own_rows :], strict=True)
        joints = *dict.fromkeys(names), *(f"the wall of contact {k}" for k, there in walls if there)
        raise failures.SingularConfiguration(
            rank=rank, rows=len(self.C), time_s=t, joints=joints, names=failures.listed(joints)
        )

    def limit_s(self, times_s: FloatArray, q: FloatArray, taken: int) -> float | None:
        """Return when a driven mechanism without freedom comes to where it cannot follow; None if it can.

        The constraints are closed on and on in time, from the last of the ``taken`` samples, at times (s,)
        with coordinates (s, n), at which they are closed: by Newton's method, with ever shorter steps.
        """
        if len(self.C) != self.n or not self.mechanism.prescribed or taken == 0:
            return None
        last = taken - 1
        while last > 0 and not np.abs(self.system(times_s[last], q[last]).g).max() < CLOSED:
            last //= 2
        t, place, step = float(times_s[last]), q[last], float(times_s[1] - times_s[0])
        end = float(times_s[min(taken, len(times_s) - 1)])
        for _ in range(MOST_TRIALS):
            if t >= end or step < RESOLVED * end:
                return None if t >= end else t
            change = np.linalg.lstsq(self.system(0.0, place).B, step * self.system(t, place).C, rcond=None)[0]
            new, far, move = place + change, np.abs(change).max(), np.inf
            for _ in range(NEWTON_STEPS):
                if np.abs(move).max() > CLOSED:
                    move = self._project_q(t + step, new, None)[0] - new
                    new = new + move
            if np.abs(move).max() <= CLOSED and np.abs(new - place - change).max() <= far:
                t, place, step = t + step, new, 1.5 * step
            else:
                step /= 2
        return None

    def project(
        self, t: Scalar, q: Array, v: Array, phases: Phases = None
    ) -> tuple[Array, Array, Scalar, Scalar]:
        """Return q and then q' moved onto the constraints, the energy lost in J, and success."""
        q, removed_q, ok = self._project_q(t, q, phases)
        v, removed_v, still_ok = self._project_v(t, q, v)
        return q, v, removed_q + removed_v, both(ok, still_ok)

    def _project_q(self, t: Scalar, q: Array, phases: Phases) -> tuple[Array, Scalar, Scalar]:
        """Return q moved onto the constraints, the energy lost in J, and whether [B] has full row rank.

        It is the least change in the norm of [M], one Newton step, which leaves a violation quadratic in the
        one before: (2) and (4) without forces, and with {g} on the right. The energy is no difference of
        nearly equal ones, but the work that the forces with a potential do along the move: exactly where they
        are constant, else but for terms quadratic in the move, which is itself of order h^5.
        """
        system = self.system(t, q)
        factors = self.factors(system.B)
        move, _ = factors.solve(np.zeros(self.n), system.g)
        removed = -(move @ self.stored_force(q, phases))
        return q - move, removed, factors.ok

    def _project_v(self, t: Scalar, q: Array, v: Array) -> tuple[Array, Scalar, Scalar]:
        """Return q' moved onto the constraints, the energy lost in J, and whether [B] has full row rank.

        T(v) - T(v') = (v - v')^T[M](v + v')/2, with v' as rounded: what rounding adds the next projection
        removes, and both have to be counted.
        """
        system = self.system(t, q, v)
        factors = self.factors(system.B)
        move, _ = factors.solve(np.zeros(self.n), system.B @ v - system.C)
        new = v - move
        removed = sum(m / 2 * ((a - b) * (a + b)) for m, a, b in zip(self.mass, v, new, strict=True))
        return new, removed, factors.ok
