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

The loop calls ``resolve`` at such an event. Numba compiles it once for all mechanisms.
"""

from collections import namedtuple
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from reference_solver.equations import LEAST_MOBILITY
from reference_solver.machine_code import Function, call, entry, inner
from reference_solver.mechanism.contacts import CONTACT, FLIGHT
from reference_solver.run import CLOSING, DENSE, IMPACT, LOG_ROWS, OLD, RECORDS, SPARE, SUPPORT

#: Flights that are as high as so many times the distance's round-off take sqrt(2 x 4 x height/a).
FLIGHT_HEIGHT = 8.0
#: A contact row that is this small a part of itself once the ideal joints are eliminated depends on them; so
#: it does on other contacts' rows once these are eliminated.
DEPENDENT, LEAST_MINOR = 1e-12, 1e-12
#: Part of the largest term by which complementarity may be missed, and slack of signs and limits when a case
#: of sticking or sliding is judged.
SLACK, CASE_SLACK = 16 * float(np.finfo(float).eps), 1e-10
#: Impacts at one time, of pins that hit in turns, after which all that touch take part in one; events at one
#: time, per contact: more than a few mean that they have no end; and pivots of complementarity.
MOST_IN_TURNS, EVENTS_AT_ONCE, MOST_PIVOTS = 100, 20, 1000
#: What a contact that rubs may do in an impact: stick, or slide by impulses of this sign.
SLIDES = (0.0, -1.0, 1.0)
#: What the equations ask of an impulse.
OFF, EQUAL, ONE_SIDED = 0.0, 1.0, 2.0
#: Why an event has no answer (see ``Solver``).
SINGULAR, BLOCKED, PARADOX, UNSETTLED = 1, 2, 3, 4
#: Numbers of every joint in ``kernel.walls``, a row for velocities before an impact, and those of an event.
PER_JOINT, BEGIN, ROOM = 6, DENSE, DENSE + 1
#: An event's run, contacts and rows; speeds u (S,) and W (S, S); the equations (S, S + 4), their right-hand
#: side and solution, and impulses without friction.
Event = namedtuple("Event", "run contacts rows u W A b z plain")


@inner
def look(event):
    """Have the contacts know their walls at a run's state.

    The round-off of speeds that have come out of faster ones is that of the fastest.
    """
    run = event.run
    if not call(run.walls, run.walls_p, run.contacts, run.time, run.at, run.at + SPARE * run.width) < np.inf:
        run.fault = SINGULAR
    S, told = len(event.u), event.rows[SPARE, PER_JOINT * run.rigid_joints :]
    for i in range(S):
        for j in range(S):
            event.W[i, j] = told[S * (i + 1) + j]
    for contact in event.contacts:
        if contact.rigid != 0.0:
            j, at = contact.joint, event.rows[SPARE, PER_JOINT * contact.joint :]
            contact.distance, contact.noise, contact.rate = at[0], at[1], -event.u[j]
            contact.rate_noise = max(contact.rate_noise, at[2])
            contact.rests = abs(contact.rate) <= contact.rate_noise
            contact.bare, contact.share, contact.pull = at[3], at[4], at[5]


@inner
def speed(event, of, i):
    """Return the speed along row i that impulses z make of speeds (S,), or the acceleration by forces."""
    total = of[i]
    for j in range(len(of)):
        total += event.W[i, j] * event.z[j]
    return total


@inner
def energy(event):
    """Return the kinetic energy that impulses add: each times the mean of the speeds before and after."""
    total = 0.0
    for i in range(len(event.z)):
        total += 0.5 * event.z[i] * (event.u[i] + speed(event, event.u, i))
    return total


@inner
def pivot(A, i):
    """Exchange z_i and w_i of w = A z + b, b being column S; column S + 1 says whether it is exchanged."""
    p, S = A[i, i], len(A)
    for r in range(S):
        if r != i:
            factor = A[r, i] / p
            for c in range(S + 1):
                A[r, c] = A[r, c] - factor * A[i, c] if c != i else factor
    for c in range(S + 1):
        A[i, c] = -A[i, c] / p if c != i else 1.0 / p
    A[i, S + 1] = 1.0 - A[i, S + 1]


@inner
def solve(event, kind):
    """Set z to impulses or forces of the chosen contacts, w = W z + b being what they make of b (S,).

    Of normals z >= 0, w >= 0 and z.w = 0 where their ``kind`` is ONE_SIDED, else w = 0, as of tangents that
    stick; other tangents have a ``part`` of their normals. Return success. By principal pivots, of the least
    index (Murty 1974): the solution is unique for a matrix with positive principal minors (Cottle, Pang and
    Stone 1992). Symmetric positive definite is enough. Contacts that repeat others are left out.
    """
    A, z, S, scale = event.A, event.z, len(event.b), 0.0
    for i in range(S):
        for j in range(S):
            A[i, j] = event.W[i, j]
        A[i, S], A[i, S + 1], A[i, S + 3], scale = event.b[i], 0.0, OFF, scale + abs(event.b[i])
    for contact in event.contacts:
        if contact.chosen != 0.0:
            A[contact.joint, S + 3] = kind
            if event.W[contact.joint, contact.joint] < DEPENDENT * contact.bare:
                event.run.fault = BLOCKED
            if contact.sticks != 0.0:
                A[contact.tangent, S + 3] = EQUAL
            if contact.part != 0.0:
                for i in range(S):
                    A[i, contact.joint] += contact.part * event.W[i, contact.tangent]
    for i in range(S):
        A[i, S + 2] = event.W[i, i]
        if A[i, S + 3] == EQUAL and A[i, i] > LEAST_MINOR * A[i, S + 2]:
            pivot(A, i)
    for _ in range(MOST_PIVOTS):
        i = 0
        while i < S:
            unit = 1.0 if A[i, S + 1] == 0.0 else A[i, S + 2]
            repeats = A[i, S + 1] == 0.0 and abs(A[i, i]) <= LEAST_MINOR * A[i, S + 2]
            if A[i, S + 3] == ONE_SIDED and A[i, S] * unit < -SLACK * scale and not repeats:
                break
            i += 1
        if i == S or A[i, i] <= 0.0:
            break
        pivot(A, i)
    for j in range(S):
        z[j] = 0.0 if A[j, S + 1] == 0.0 else max(A[j, S], 0.0) if A[j, S + 3] == ONE_SIDED else A[j, S]
    for contact in event.contacts:
        if contact.chosen != 0.0 and contact.part != 0.0:
            z[contact.tangent] = contact.part * z[contact.joint]
    return i == S


@inner
def rub(event):
    """Find the impulses with friction, by the first case that keeps its conditions, or else those without.

    They may not let the kinetic energy grow: on the way s from those without it does so by
    g0 + s g1 + s^2 g2, with g0 <= 0 and g2 >= 0.
    """
    z, plain, S, cases, fastest = event.z, event.plain, len(event.z), 1, 0.0
    for i in range(S):
        plain[i], fastest = z[i], max(fastest, abs(event.u[i]))
    g0 = energy(event)
    for contact in event.contacts:
        cases *= 3 if contact.chosen != 0.0 and contact.coefficient > 0.0 else 1
    for case in range(cases):
        left, little = case, 0.0
        for contact in event.contacts:
            if contact.chosen != 0.0 and contact.coefficient > 0.0:
                contact.part, contact.sticks = contact.coefficient * SLIDES[left % 3], left % 3 == 0
                left //= 3
        kept = solve(event, ONE_SIDED)
        for i in range(S):
            little = max(little, CASE_SLACK * abs(z[i]))
        for contact in event.contacts:
            if contact.chosen != 0.0 and contact.sticks != 0.0:  # within Coulomb's limit
                limit = contact.coefficient * z[contact.joint] + little
                kept = kept and abs(z[contact.tangent]) <= limit
            elif contact.chosen != 0.0 and contact.part != 0.0:  # against the sliding
                after = speed(event, event.u, contact.tangent)
                kept = kept and (after if contact.part > 0.0 else -after) <= CASE_SLACK * fastest
        if kept:
            grown, g1, part = energy(event), 0.0, 1.0
            for i in range(S):
                event.b[i], z[i] = z[i] - plain[i], plain[i]  # the way
            if grown > 0.0:
                for i in range(S):
                    g1 += event.b[i] * speed(event, event.u, i)
                g2 = grown - g0 - g1
                root = np.sqrt(max(g1 * g1 - 4.0 * g0 * g2, 0.0))
                part = -2.0 * g0 / (g1 + root) if g1 > 0.0 else (root - g1) / (2.0 * g2)
            for i in range(S):
                z[i] += min(max(part, 0.0), 1.0) * event.b[i]
            return
    for i in range(S):
        z[i] = plain[i]


@inner
def change(event):
    """Change velocities by the impulses z, which the contacts get, with what each loses."""
    run, rows, n, S = event.run, event.rows, event.run.n, len(event.z)
    first = PER_JOINT * run.rigid_joints + S + S * S
    for c in range(n):
        rows[BEGIN, c] = rows[OLD, n + c]
    for i in range(S):
        for c in range(n):
            rows[OLD, n + c] += event.z[i] * rows[SPARE, first + i * n + c]
    for contact in event.contacts:
        contact.normal = contact.tangential = contact.lost = 0.0
        if contact.chosen != 0.0:
            j, row = contact.joint, contact.tangent
            contact.normal = event.z[j]
            contact.lost = -0.5 * event.z[j] * (event.u[j] + speed(event, event.u, j))
            if row >= 0:
                contact.tangential = event.z[row]
                contact.lost -= 0.5 * event.z[row] * (event.u[row] + speed(event, event.u, row))
    for i in range(S):
        rows[OLD, 2 * n] += event.z[i] * rows[SPARE, first + S * n + i]


@inner
def choose(contact, chosen):
    """Have a contact take part in the equations, or not, without friction."""
    contact.chosen, contact.part, contact.sticks = chosen, 0.0, 0.0


@inner
def press(event):
    """Find the inward forces on the chosen contacts, which have no normal speed."""
    event.b[:] = 0.0
    for contact in event.contacts:
        if contact.rigid != 0.0:
            j, contact.part = contact.joint, -contact.share
            event.b[j], minor = contact.pull, event.W[j, j] + contact.part * event.W[j, contact.tangent]
            if contact.chosen != 0.0 and not minor > LEAST_MOBILITY * event.W[j, j]:
                event.run.fault = PARADOX
    if not solve(event, ONE_SIDED):
        event.run.fault = PARADOX


@inner
def collide(event):
    """Change velocities by an impact, and find which pins, leaving their walls, would be back too soon."""
    rubs, run = False, event.run
    for i in range(len(event.b)):
        event.b[i] = event.u[i]
    for contact in event.contacts:
        choose(contact, contact.takes_part)
        if contact.chosen != 0.0:
            event.b[contact.joint] *= 1.0 + contact.wanted
            rubs = rubs or contact.coefficient > 0.0
    solve(event, ONE_SIDED)
    if rubs:
        rub(event)
    change(event)
    look(event)
    for contact in event.contacts:
        choose(contact, contact.takes_part != 0.0 and contact.rests != 0.0)
    press(event)
    for contact in event.contacts:
        if contact.takes_part != 0.0:
            outward = -speed(event, event.b, contact.joint)
            height = FLIGHT_HEIGHT * run.lowest * contact.noise * max(outward, 0.0)
            shortest = max(run.shortest_s * outward, np.sqrt(height))
            contact.short = outward > 0.0 and 2.0 * max(-contact.rate, 0.0) < shortest


@inner
def hit(event):
    """Have those that take part hit at once, and those with ``hits`` rebound; log and ledger get that."""
    run, rows, again, thrown = event.run, event.rows, False, False
    sums = rows[OLD, 2 * run.n :]
    work = sums[0]
    for contact in event.contacts:
        contact.approach, contact.closes = contact.rate, 0.0
        contact.wanted = contact.restitution if contact.hits != 0.0 else 0.0
    collide(event)
    for contact in event.contacts:
        late = contact.approach < contact.slowest or contact.short != 0.0
        if contact.takes_part != 0.0 and contact.wanted > 0.0 and late:
            contact.closes, contact.wanted, again = 1.0, 0.0, True
    if again:
        for c in range(run.n):
            rows[OLD, run.n + c] = rows[BEGIN, c]
        sums[0] = work
        look(event)
        collide(event)
    for contact in event.contacts:
        if contact.takes_part == 0.0:
            continue
        sums[contact.column] += contact.normal
        sums[contact.column + (2 if contact.closes != 0.0 else 1)] += contact.lost
        if contact.normal != 0.0:
            entry = run.events[run.logged]
            entry.time_s, entry.contact, entry.approach = run.time, contact.number, contact.approach
            entry.what = CLOSING if contact.closes != 0.0 else IMPACT if contact.hits != 0.0 else SUPPORT
            entry.impulse, entry.tangential, entry.lost = contact.normal, contact.tangential, contact.lost
            entry.mass = 1.0 / event.W[contact.joint, contact.joint]
            run.logged += 1
        leaves = contact.rate < -contact.rate_noise and contact.short != 0.0
        choose(contact, leaves or contact.rests != 0.0)
        thrown = thrown or leaves
    if thrown:  # pins that another's impact throws off for too short a flight are kept on their walls
        for i in range(len(event.b)):
            event.b[i] = event.u[i]
        solve(event, EQUAL)
        change(event)
        for contact in event.contacts:
            if contact.chosen != 0.0:
                sums[contact.column] += contact.normal
                sums[contact.column + 2] += contact.lost
        look(event)


@inner
def resolve(run, contacts, rows):
    """Let pins that touch hit, follow or leave; return 1 where others follow now or none can, else 0."""
    n, S = run.n, run.wall_rows
    speeds, room, free = rows[SPARE, PER_JOINT * run.rigid_joints :], rows[ROOM : ROOM + S], rows[ROOM + S]
    for i in range(3 * S):
        free[i] = 0.0
    vectors = free[:S], free[S : 2 * S], free[2 * S : 3 * S]
    event = Event(run, contacts, rows, speeds[:S], room[:, :S], room[:, S : 2 * S + 4], *vectors)
    run.at_once = run.at_once + 1 if run.time == run.last_s else 1
    run.last_s, run.settled = run.time, run.settled + 1
    if run.at_once > EVENTS_AT_ONCE * len(contacts):
        run.fault = UNSETTLED
        return 1.0
    for contact in contacts:
        contact.rate_noise = 0.0
        choose(contact, 0.0)
    look(event)
    for contact in contacts:
        if contact.rigid != 0.0:
            near = contact.clearance - 0.5 * run.lowest * contact.noise
            contact.follows = contact.phase != FLIGHT
            came = contact.number == run.wall  # within the round-off of time, too
            contact.released = contact.follows if came else 0.0
            contact.touches = contact.follows != 0.0 or contact.distance >= near or came
    turns, moved, most = 0, True, min(MOST_IN_TURNS, LOG_ROWS // 2 // run.rigid_joints - 1)
    while moved and turns <= most and run.fault == 0:
        comes, moved = False, False
        for contact in contacts:
            touches = contact.touches != 0.0
            contact.hits = touches and contact.rate > contact.rate_noise and contact.follows == 0.0
            contact.takes_part = touches and (contact.rate >= -contact.rate_noise or turns == most)
            comes = comes or contact.hits != 0.0
        if not comes:
            break
        hit(event)
        turns += 1
        for c in range(n):
            moved = moved or rows[BEGIN, c] != rows[OLD, n + c]
        for contact in contacts:
            contact.follows = contact.follows != 0.0 and contact.rests != 0.0
    for contact in contacts:
        choose(contact, contact.touches != 0.0 and contact.rests != 0.0 and contact.released == 0.0)
    press(event)
    changes = run.fault != 0
    for contact in contacts:
        if contact.rigid != 0.0:
            phase = CONTACT if event.z[contact.joint] > 0.0 else FLIGHT
            stays = contact.number == run.wall and contact.released == 0.0 and phase == FLIGHT
            contact.ignored = 1.0 if turns == 0 and stays else contact.ignored if turns > 0 else 0.0
            changes = changes or contact.phase != phase
            contact.phase = phase
    return 1.0 if changes else 0.0


@cache
def resolver() -> Function:
    """Return ``resolve`` for calls by address."""

    def made() -> tuple[Any, Callable[..., Any]]:
        from numba import carray, float64, from_dtype, int64, types

        def enter(state, contacts, t, at, count):  # type: ignore[no-untyped-def]  # noqa: ARG001
            run = carray(state, 1)[0]
            shape = ROOM + run.wall_rows + 1, run.width // 8
            return resolve(run, carray(contacts, count), carray(at, shape))

        run, contact, row = map(types.CPointer, (*map(from_dtype, RECORDS[:2]), float64))
        return float64(run, contact, float64, row, int64), enter

    return entry("resolve", made)
