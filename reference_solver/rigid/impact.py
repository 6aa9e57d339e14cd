"""Impacts of rigid joints: the jump of {q'} when pins hit their walls while all ideal joints hold.

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

Numba compiles this module as it stands, into that of ``settling``.
"""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from reference_solver.contact.loop import INNER
from reference_solver.rigid.complementarity import complementary, solve
from reference_solver.tape import FloatArray

#: Relative slack of signs and limits when a case of sticking or sliding is judged.
SLACK = 1e-10
#: What a contact may do in an impact: stick, slide with this sign, or open.
STICK, MINUS, PLUS, OPEN = range(4)


class Hit(NamedTuple):
    """The k joints that take part in an impact, as m >= k rows of D: normals, then tangents where they rub.

    ``W`` (m, m) and ``u`` (m,) are as above; ``restitution`` and ``friction`` (k,) are e and mu, ``tangent``
    (k,) the number of a joint's row in T, or -1. ``impulse`` (m,) is Lambda; the others are memory of as many
    places, ``room`` of two columns more.
    """

    W: FloatArray
    u: FloatArray
    restitution: FloatArray
    friction: FloatArray
    tangent: Any
    impulse: FloatArray
    rubbed: FloatArray
    trial: FloatArray
    after: FloatArray
    room: FloatArray


def new_hit(joints: int, rows: int) -> Hit:
    """Return room for as many joints and rows."""
    numbers = (np.zeros(joints) for _ in range(2))
    tangent = np.full(joints, -1, dtype=np.int64)
    vectors = (np.zeros(rows) for _ in range(4))
    W, room = np.zeros((rows, rows)), np.zeros((rows, rows + 2))
    return Hit(W, np.zeros(rows), *numbers, tangent, *vectors, room)


@register_jitable(**INNER)
def find_impulses(hit, k, m):
    """Set the impulses (m,) of a hit by the laws above."""
    for i in range(k):
        hit.after[i] = (1.0 + hit.restitution[i]) * hit.u[i]
    complementary(hit.W, hit.after, k, hit.impulse, hit.trial, hit.room)
    pressed = False
    for i in range(k):
        pressed = pressed or hit.impulse[i] > 0.0
    for i in range(k, m):
        hit.impulse[i] = 0.0
    if m > k and pressed and find_rubbed(hit, k, m):
        move_back(hit, m)


@register_jitable(**INNER)
def state_of(hit, k, case, i):
    """Return what contact i does in a case, whose digits are the contacts', the last one's lowest.

    Without friction it slides or opens.
    """
    for j in range(k - 1, i, -1):
        case //= 4 if hit.tangent[j] >= 0 else 2
    return case % 4 if hit.tangent[i] >= 0 else PLUS + case % 2


@register_jitable(**INNER)
def find_rubbed(hit, k, m):
    """Set ``rubbed`` to the impulses of the first case that keeps its conditions; return whether one does."""
    W, u, room, cases, fastest = hit.W, hit.u, hit.room, 1, 0.0
    for i in range(k):
        cases *= 4 if hit.tangent[i] >= 0 else 2
    for i in range(m):
        fastest = max(fastest, abs(u[i]))
    for case in range(cases):
        # One condition per unknown: Lambda = 0 where none of these.
        for i in range(m):
            for j in range(m + 1):
                room[i, j] = 1.0 if i == j else 0.0
        for i in range(k):
            state, row = state_of(hit, k, case, i), hit.tangent[i]
            if state != OPEN:
                for j in range(m):
                    room[i, j] = W[i, j]
                room[i, m] = -(1.0 + hit.restitution[i]) * u[i]
            if row >= 0 and state == STICK:
                for j in range(m):
                    room[row, j] = W[row, j]
                room[row, m] = -u[row]
            elif row >= 0 and state != OPEN:
                room[row, i] = hit.friction[i] if state == MINUS else -hit.friction[i]
        if solve(room, m, hit.rubbed) == m and keeps(hit, k, m, case, SLACK * fastest):
            return True
    return False


@register_jitable(**INNER)
def keeps(hit, k, m, case, slow):
    """Return whether the impulses in ``rubbed`` keep the conditions of a case, to a slack of speeds."""
    impulse, after, little = hit.rubbed, hit.after, 0.0
    for i in range(m):
        after[i], little = hit.u[i], max(little, SLACK * abs(impulse[i]))
        for j in range(m):
            after[i] += hit.W[i, j] * impulse[j]
    for i in range(k):
        if impulse[i] < -little or after[i] + hit.restitution[i] * hit.u[i] < -slow:
            return False
        state, row = state_of(hit, k, case, i), hit.tangent[i]
        if row < 0:
            continue
        # Sticking is within Coulomb's limit, or sliding is opposed.
        if state == STICK and abs(impulse[row]) > hit.friction[i] * impulse[i] + little:
            return False
        if (state == MINUS and -after[row] > slow) or (state == PLUS and after[row] > slow):
            return False
    return True


@register_jitable(**INNER)
def move_back(hit, m):
    """Set the impulses to those nearest ``rubbed``, from the frictionless ones, that let no energy grow.

    The growth is g0 + s g1 + s^2 g2 with g0 <= 0 and g2 >= 0: one root in [0, 1].
    """
    start, end, g0, g1, g2 = hit.impulse, hit.rubbed, 0.0, 0.0, 0.0
    for i in range(m):
        at_start, along = hit.u[i], 0.0
        for j in range(m):
            at_start += hit.W[i, j] * start[j]
            along += hit.W[i, j] * (end[j] - start[j])
        way = end[i] - start[i]
        g0 += 0.5 * start[i] * (hit.u[i] + at_start)
        g1 += way * at_start
        g2 += 0.5 * way * along
    part = 1.0
    if g0 + g1 + g2 > 0.0:
        root = np.sqrt(max(g1 * g1 - 4.0 * g0 * g2, 0.0))
        part = -2.0 * g0 / (g1 + root) if g1 > 0.0 else (root - g1) / (2.0 * g2)
        part = min(max(part, 0.0), 1.0)
    for i in range(m):
        start[i] += part * (end[i] - start[i])
