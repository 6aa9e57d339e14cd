"""Impacts on rigid walls, and what the pins that touch them at one time do then: they follow, or leave.

N are the rows of inward normal speed u_n at the joints that touch, T those of tangential speed u_t, D both.
The impulses Lambda obey  u+ = u- + W Lambda,  W = D ([M]^-1 - [M]^-1 B^T G^-1 B [M]^-1) D^T,
G = B [M]^-1 B^T: the impulses of the ideal joints are eliminated. For one frictionless contact this is

    q'+ = q'- - (1 + e) [M]^-1 B^T (B [M]^-1 B^T)^-1 (B q'-)_n

with the contact's row in B and e applied to that row only, and the loss is (1 - e^2)/2 v_n^2/W_nn.

* Normal: Newton's law with complementarity (Moreau 1988; Pfeiffer and Glocker 1996): all pins that touch take
  part at once,  Lambda_n >= 0,  u_n+ + e u_n- >= 0,  one of them zero; e = 0 where a pin does not approach.
* Tangential: Coulomb's law on the impulse (Whittaker 1904; Kane and Levinson 1985): the impulse that leaves
  u_t+ = 0 if it is at most mu Lambda_n, else mu Lambda_n against the sliding that remains.
* That law can create energy where normal and tangential motion are coupled (Kane 1984). Then the impulses
  are moved back towards the frictionless ones, Lambda = (1 - s) Lambda_0 + s Lambda_1, with the largest s at
  which the kinetic energy does not grow: both ends keep the laws' signs and limits, and so does every s.
* In turns: of the pins that touch within round-off those that come or rest take part at once; two that hit at
  different times, however close, do so one after the other. Two that hit in turns ever faster, each thrown
  out by the other's impact, go on at one time when round-off hides the distances in between.
* Closing: an impact has e = 0 if the next flight would be too short, or its approach is below the joint's
  minimum. Too short is 2 v+/a below the run's ``shortest_s``, or v+^2/2a within round-off of the distance,
  with a the acceleration towards the wall. A pin on its wall that another's impact throws off for as short a
  flight is kept there: normal speeds are projected out, which takes energy too. So rapidly converging bounces
  (Zeno), of one joint or of several in turns, end; the energy this takes is a line of its own in the ledger.
* Following or leaving: pins on the wall without normal speed are sorted by the complementarity of
  accelerations and normal forces (Pfeiffer and Glocker 1996). Friction is part of the accelerations: its law
  is regularised, so that at the given speeds it is a given part of each normal force. Then
  a_n = b + (W_nn - W_nt diag(mu f)) F_n, and one set of forces fits as long as all principal minors of this
  matrix are positive; otherwise there is Painleve's paradox.

A pin that hits alone, without friction, and flies off again has its rebound in the loop (``loop.bounce``).
"""

from itertools import chain, combinations, product
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_solver import failures
from reference_solver.equations import Answer, Equations
from reference_solver.mechanism.contacts import CONTACT, FLIGHT, FRICTION_LAWS, separation
from reference_solver.mechanism.points import State
from reference_solver.run import DEPENDENT, FLIGHT_HEIGHT, OLD, Impact, Run, wall_record
from reference_solver.tape import Array, FloatArray, Scalar, array
from reference_solver.wall_friction import LEAST_MOBILITY

Chosen = NDArray[np.bool_]
#: How pins of rigid joints answer to impulses and forces at a state: see ``run.wall_record``.
Walls = Any


class ModeChange(NamedTuple):
    """From this time on the pins of these contacts follow their rigid walls, and the others fly."""

    time_s: float
    following: tuple[int, ...]


EPS, TINY = float(np.finfo(float).eps), float(np.finfo(float).tiny)
#: Units of the largest term by which complementarity may be missed, part of its diagonal's product below
#: which a minor is round-off, and slack of signs and limits when a case of sticking or sliding is judged.
SLACK, LEAST_MINOR, CASE_SLACK = 16 * EPS, 1e-12, 1e-10
#: Impacts at one time, of pins that hit in turns, after which all that touch take part in one; and events at
#: one time, per contact: more than a few mean that they have no end.
MOST_IN_TURNS, EVENTS_AT_ONCE = 100, 20
#: What a contact may do in an impact: stick, slide with this sign, or open.
STICK, MINUS, PLUS, OPEN = range(4)


# ------------------------------------------------------------------------------ small systems


def solve(A: FloatArray, b: FloatArray) -> tuple[FloatArray, bool]:
    """Return x of A x = b, and whether A has full rank, whatever the units of its rows and columns are."""
    if not (len(b) and np.isfinite(A).all() and np.isfinite(b).all()):
        return np.zeros(len(b)), len(b) == 0
    rows = 1.0 / np.maximum(np.abs(A).max(axis=1), TINY)
    columns = 1.0 / np.maximum(np.abs(A * rows[:, None]).max(axis=0), TINY)
    x, _, rank, _ = np.linalg.lstsq(A * rows[:, None] * columns, b * rows, rcond=len(b) * EPS)
    return columns * x, bool(rank == len(b))


def complementary(W: FloatArray, b: FloatArray) -> FloatArray:
    """Return z >= 0 with W z + b >= 0 and z.(W z + b) = 0, for a W with positive principal minors.

    The solution is unique (Cottle, Pang and Stone 1992); symmetric positive definite is enough. Where
    round-off leaves several sets of positive z nearly right, the one that violates its signs least is taken,
    and of equals the smallest. Sets of contacts that repeat one another are left out: fewer will do.
    """
    k, best, least = len(b), np.zeros(len(b)), np.inf
    z, full = solve(W, -b)
    if full and (z >= 0.0).all():  # all push, as most often
        return z
    for size in range(k + 1):
        for members in map(list, reversed(list(combinations(range(k), size)))):
            z = np.zeros(k)
            z[members], full = solve(W[np.ix_(members, members)], -b[members])
            others = [i for i in range(k) if i not in members]
            short = np.concatenate([-z[members] * W[members, members], -(W @ z + b)[others]])
            violation = short.max(initial=0.0)
            if full and violation < least:
                best, least = np.maximum(z, 0.0), violation
            if least <= SLACK * np.abs(b).max(initial=0.0):
                return best
    return best


def least_minor_ratio(W: FloatArray, plain: FloatArray) -> float:
    """Return the least ratio of the principal minors of W to those of another matrix, both (k, k).

    Minors of that which are round-off beside the product of its diagonal are left out; 1 with none left.
    """
    sets = chain.from_iterable(combinations(range(len(W)), size) for size in range(1, len(W) + 1))
    parts = [np.ix_(members, members) for members in sets]
    minors = [(np.linalg.det(W[x]), np.linalg.det(plain[x]), np.diag(plain[x]).prod()) for x in parts]
    return float(min([1.0, *(minor / of for minor, of, size in minors if of > LEAST_MINOR * size)]))


# ---------------------------------------------------------------------------------- one impact


def find_impulses(
    W: FloatArray, u: FloatArray, restitution: FloatArray, friction: FloatArray, tangent: list[int]
) -> FloatArray:
    """Return the impulses (m,) of k joints that hit, by the laws above.

    W (m, m) and u (m,) are of their normals, then of tangents where they rub; ``tangent`` (k,) is the number
    of a joint's row there, or -1.
    """
    k, m = len(restitution), len(u)
    plain = np.zeros(m)
    plain[:k] = complementary(W[:k, :k], (1.0 + restitution) * u[:k])
    if m == k or not (plain > 0.0).any():
        return plain
    every: tuple[int, ...] = (STICK, MINUS, PLUS, OPEN)
    for case in product(*(every if row >= 0 else (PLUS, OPEN) for row in tangent)):
        # One condition per unknown: Lambda = 0 where none of these.
        A, b = np.eye(m), np.zeros(m)
        for i, (state, row) in enumerate(zip(case, tangent, strict=True)):
            if state != OPEN:
                A[i], b[i] = W[i], -(1.0 + restitution[i]) * u[i]
            if row >= 0 and state == STICK:
                A[row], b[row] = W[row], -u[row]
            elif row >= 0 and state != OPEN:
                A[row, i] = friction[i] if state == MINUS else -friction[i]
        rubbed, kept = solve(A, b)
        after, little, slow = u + W @ rubbed, CASE_SLACK * np.abs(rubbed).max(), CASE_SLACK * np.abs(u).max()
        for i, (state, row) in enumerate(zip(case, tangent, strict=True)):
            kept = kept and rubbed[i] >= -little and after[i] + restitution[i] * u[i] >= -slow
            # What is beyond Coulomb's limit, or slides in the wrong direction.
            stuck = abs(rubbed[row]) - friction[i] * rubbed[i] - little
            beyond = stuck, -after[row] - slow, after[row] - slow
            kept = kept and (row < 0 or state == OPEN or beyond[state] <= 0.0)
        if kept:
            # The kinetic energy grows by g0 + s g1 + s^2 g2 on the way s, with g0 <= 0 and g2 >= 0.
            way, part = rubbed - plain, 1.0
            g0 = plain @ (u + 0.5 * W @ plain)
            g1, g2 = way @ (u + W @ plain), 0.5 * way @ W @ way
            if g0 + g1 + g2 > 0.0:
                root = np.sqrt(max(float(g1 * g1 - 4.0 * g0 * g2), 0.0))
                part = -2.0 * g0 / (g1 + root) if g1 > 0.0 else (root - g1) / (2.0 * g2)
            return np.asarray(plain + min(max(part, 0.0), 1.0) * way)
    return plain


# ------------------------------------------------------------------------------------- walls


def walls_at(equations: Equations, answer: Answer, t: Scalar, q: Array, v: Array) -> list[Scalar]:
    """Return the numbers of ``wall_record`` at a state of n coordinates, no pin following.

    ``answer`` is that of the equations there.
    """
    state, system = State(q, v), equations.system(t, q, v)
    joints = [joint for joint in equations.mechanism.contacts if joint.rigid]
    at = [separation(joint, state) for joint in joints]
    tangents = [each.tangent for each, joint in zip(at, joints, strict=True) if joint.friction is not None]
    D = array([*(-each.normal for each in at), *tangents])
    motion, reactions = equations.factors(system.B).solve(D.T, np.zeros((len(system.C), len(D))))
    W = D @ motion
    numbers = list[list[Scalar]]()
    for each, joint, row in zip(at, joints, D, strict=False):
        bare = (row * row) @ equations.inverse_mass
        law = joint.friction
        sliding = each.tangent @ v
        share = 0.0 if law is None else law.coefficient * FRICTION_LAWS[law.law](law, sliding)
        numbers.append([each.distance, each.rate, each.turning, each.noise, each.rate_noise, bare, share])
    parts = array(numbers).T, D, motion.T, 0.5 * (W + W.T), reactions.T @ system.C, answer.accelerations
    return [x for part in parts for x in np.asarray(part).ravel()]


def at_rest(walls: Walls) -> Chosen:
    """Return which pins have no normal speed but round-off."""
    return np.asarray(np.abs(walls.rate) <= walls.rate_noise)


def free_to_move(t: float, walls: Walls, chosen: Chosen) -> list[int]:
    """Return the chosen joints, all of which have a mobility along their normals.

    Raises:
        BlockedImpact: one has none.
    """
    joints = np.flatnonzero(chosen)
    if (np.diag(walls.W)[joints] < DEPENDENT * walls.bare[joints]).any():
        raise failures.BlockedImpact(time_s=t)
    return [int(j) for j in joints]


# ------------------------------------------------------------------------------------ events


class Impacts:
    """A run's events on rigid walls: impacts and changes so far, and which contacts' pins follow.

    ``kernel`` is one without such pins; sums are named as in ``Equations.power_names``.
    """

    def __init__(self, equations: Equations, sums: list[str], kernel: Any) -> None:
        self._equations, self._kernel = equations, kernel
        self._contact = [k for k, joint in enumerate(equations.mechanism.contacts) if joint.rigid]
        self._column = [sums.index(f"normal{k}") for k in self._contact]
        rigid = [equations.mechanism.contacts[k] for k in self._contact]
        self._restitution = np.array([joint.law.restitution for joint in rigid])
        self._slowest = np.array([joint.law.minimum_impact_speed_m_s for joint in rigid])
        laws = [joint.friction for joint in rigid]
        self._friction = np.array([0.0 if law is None else law.coefficient for law in laws])
        rows = np.cumsum([law is not None for law in laws]) + len(rigid) - 1
        self._tangent = [-1 if law is None else int(row) for law, row in zip(laws, rows, strict=True)]
        R, S, n = len(rigid), len(rigid) + sum(law is not None for law in laws), equations.n
        self._record = wall_record(R, S, n)
        self._noise, self._at_once, self._last_s = np.zeros(R), 0, -1.0
        self.following: tuple[int, ...] = ()
        self.impacts, self.changes, self.resolved = list[Impact](), list[ModeChange](), 0

    def resolve(self, run: Run) -> None:
        """Let the pins that touch rigid walls hit, follow or leave; the run tells whose event it is.

        Raises:
            SingularConfiguration, BlockedImpact, PainleveParadox, UnsettledEvents: it says when.
        """
        state, contacts = run.state[0], run.contacts[self._contact]
        t, touched = float(state["time"]), int(state["wall"])
        self._at_once = self._at_once + 1 if t == self._last_s else 1
        self._last_s, self.resolved = t, self.resolved + 1
        if self._at_once > EVENTS_AT_ONCE * len(run.contacts):
            raise failures.UnsettledEvents(time_s=t, joint=touched)
        self._noise[:] = 0.0
        walls, mine = self._walls(run), np.array(self._contact) == touched
        follows = contacts["phase"] != FLIGHT
        released = mine & follows
        near = contacts["clearance"] - 0.5 * state["lowest"] * walls.noise
        touches, turns, moved = follows | (walls.distance >= near), 0, True
        while moved and turns <= MOST_IN_TURNS:
            hits = touches & (walls.rate > walls.rate_noise) & ~follows
            if not hits.any():
                break
            takes_part, before = touches & (walls.rate >= -walls.rate_noise), run.v.copy()
            walls = self._hit(run, walls, touches if turns == MOST_IN_TURNS else takes_part, hits)
            turns, moved, follows = turns + 1, bool((run.v != before).any()), follows & at_rest(walls)
        force, _ = self._press(t, walls, touches & at_rest(walls) & ~released)
        phase = np.where(force > 0.0, CONTACT, FLIGHT)
        for name, values in (("phase", phase), ("noise", walls.noise), ("rate_noise", walls.rate_noise)):
            run.contacts[name][self._contact] = values
        if turns == 0:
            run.contacts["ignored"][self._contact] = mine & ~released & (phase == FLIGHT)
        following = tuple(k for k, there in zip(self._contact, force > 0.0, strict=True) if there)
        if following != self.following:
            self.following = following
            self.changes.append(ModeChange(t, following))

    def _walls(self, run: Run) -> Walls:
        """Return the walls at a run's state; round-off of speeds from faster ones is that of the fastest."""
        at, t, p = np.zeros(1, self._record), float(run.state["time"][0]), self._kernel.p
        look = self._kernel.functions["walls"]
        if not look(p, run.contacts.ctypes.data, t, run.rows[OLD], at) < np.inf:
            self._equations.refuse_singular(t, run.q)
        walls = SimpleNamespace(**{name: at[name][0] for name in self._record.names or ()})
        walls.rate_noise = self._noise = np.maximum(self._noise, walls.rate_noise)
        return walls

    def _hit(self, run: Run, walls: Walls, takes_part: Chosen, hits: Chosen) -> Walls:
        """Have joints hit at once, those with ``hits`` by their restitution; return the walls after that.

        The impulses are entered in the log and in the ledger.
        """
        start, wanted = run.v.copy(), np.where(hits, self._restitution, 0.0)
        t, closes = float(run.state["time"][0]), np.zeros(len(hits), dtype=bool)
        while True:
            impulses = self._collide(run, walls, takes_part, wanted)
            after = self._walls(run)
            short = self._short(run, after, takes_part)
            late = takes_part & (wanted > 0.0) & ((walls.rate < self._slowest) | short)
            if closes.any() or not late.any():
                break
            closes, wanted = late, np.where(late, 0.0, wanted)
            run.v[:] = start
        for j in np.flatnonzero(takes_part):
            normal, tangential, lost = (float(part[j]) for part in impulses)
            row, column = self._tangent[j], self._column[j]
            run.sums[0] += walls.drivers[j] * normal + (walls.drivers[row] * tangential if row >= 0 else 0.0)
            run.sums[column] += normal
            run.sums[column + (2 if closes[j] else 1)] += lost
            if normal != 0.0:
                kind = "closing" if closes[j] else "impact" if hits[j] else "support"
                numbers = 0.0, float(walls.rate[j]), normal, tangential, lost, float(1.0 / walls.W[j, j])
                self.impacts.append(Impact(t, self._contact[j], kind, *numbers))
        leaves = takes_part & (after.rate < -after.rate_noise) & short
        if not leaves.any():
            return after
        # Pins that another's impact throws off for too short a flight are kept on their walls.
        joints = free_to_move(t, after, leaves | (takes_part & at_rest(after)))
        u = after.D[joints] @ run.v
        impulse, _ = solve(after.W[np.ix_(joints, joints)], -u)
        run.v[:] += impulse @ after.motion[joints]
        columns = np.array([self._column[j] for j in joints])
        run.sums[0] += after.drivers[joints] @ impulse
        run.sums[columns] += impulse
        run.sums[columns + 2] -= 0.5 * impulse * u  # u becomes 0
        return self._walls(run)

    def _collide(
        self, run: Run, walls: Walls, chosen: Chosen, restitution: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Change velocities by the impact of the chosen joints; return their impulses and losses, (R,)."""
        joints = free_to_move(float(run.state["time"][0]), walls, chosen)
        rubbing = [j for j in joints if self._friction[j] > 0.0]
        rows = [*joints, *(self._tangent[j] for j in rubbing)]
        tangent = [len(joints) + rubbing.index(j) if j in rubbing else -1 for j in joints]
        W, u = walls.W[np.ix_(rows, rows)], walls.D[rows] @ run.v
        impulse = find_impulses(W, u, restitution[joints], self._friction[joints], tangent)
        run.v[:] += impulse @ walls.motion[rows]
        lost = -(impulse * (u + 0.5 * W @ impulse))  # times the mean of the speeds before and after
        normals, tangentials, losses = np.zeros((3, len(chosen)))
        normals[joints], losses[joints] = impulse[: len(joints)], lost[: len(joints)]
        tangentials[rubbing] = impulse[len(joints) :]
        losses[rubbing] += lost[len(joints) :]
        return normals, tangentials, losses

    def _press(self, t: float, walls: Walls, chosen: Chosen) -> tuple[FloatArray, FloatArray]:
        """Return inward forces (R,) on the chosen joints, without normal speed, and accelerations (n,)."""
        joints, force = free_to_move(t, walls, chosen), np.zeros(len(chosen))
        if not joints:
            return force, walls.free
        plain = walls.W[np.ix_(joints, joints)]
        matrix, share = plain.copy(), walls.share[joints]
        rubbing = np.flatnonzero(share)
        tangents = [self._tangent[joints[i]] for i in rubbing]
        matrix[:, rubbing] -= share[rubbing] * walls.W[np.ix_(joints, tangents)]
        if len(rubbing) and least_minor_ratio(matrix, plain) <= LEAST_MOBILITY:
            names = failures.listed([str(self._contact[joints[i]]) for i in rubbing])
            raise failures.PainleveParadox(time_s=t, joints=names)
        pushes = complementary(matrix, walls.D[joints] @ walls.free - walls.turning[joints])
        force[joints] = pushes
        rubs = (share * pushes)[rubbing] @ walls.motion[tangents]
        return force, walls.free + pushes @ walls.motion[joints] - rubs

    def _short(self, run: Run, walls: Walls, takes_part: Chosen) -> Chosen:
        """Return which pins, leaving their walls, would be back too soon."""
        state = run.state[0]
        _, pushed = self._press(float(state["time"]), walls, takes_part & at_rest(walls))
        outward = walls.turning - walls.D[: len(walls.rate)] @ pushed
        height = FLIGHT_HEIGHT * state["lowest"] * walls.noise * np.maximum(outward, 0.0)
        shortest = np.maximum(state["shortest_s"] * outward, np.sqrt(height))
        return np.asarray((outward > 0.0) & (2.0 * np.maximum(-walls.rate, 0.0) < shortest))
