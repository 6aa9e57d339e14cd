"""The equations of motion of any planar mechanism in the coordinates of ``tree``, as machine code.

With z the independent ones among the coordinates u, bodies move as J T z'' + bias, so that

    M z'' = q,  M = sum of m (J T)^T (J T) + I T^T T,  q = sum of (J T)^T (m g - m bias) + T^T Q,

Q being what acts along coordinates. There is no multiplier. What is driven is the first of z, a function of
the time; the equation along it gives the drive's torque or force.

A state z (state,) is u, its rate, the time, and sums of powers; of dependent coordinates it has values near
those that close the loops. A pin that follows a rigid wall has psi of its gap d = c (cos(psi), sin(psi)) in
place of d_x, and nothing in place of d_y: the wall's force is what the equation along the normal leaves over.
A state whose gaps all are gaps is y.
"""

import math

import numpy as np
from numpy.typing import NDArray

from studies.truth.kinematics import factor, make_rows, move, solve
from studies.truth.machine import bare, within
from studies.truth.physics import (
    BY,
    BY_SPEED,
    GAS,
    MU,
    PHASE,
    PULLS,
    TURN,
    TURN_BY_TIME,
    TURNING_VISCOUS,
    WHAT,
    WHERE,
    B,
    C,
    K,
    N,
    R,
    effort,
    friction_share,
    load_part,
    prescribed,
)
from studies.truth.record import OF_JOINT, OF_TOLD, Mechanism, Packed, parts

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: Columns of a joint's phase: what its contact is, its a/v0 while it touches, and the piece of its friction.
#: Rows behind the joints' are of tables that go by the state, whose PIECE is the one that they are in.
CONTACT, MEMORY, PIECE = range(3)
#: Contacts: none, one whose wall pushes by its law, and one whose law would pull: there is no force then, but
#: of Kelvin and Voigt's law no friction only.
FLIGHT, PUSHED, CLIPPED = 0.0, 1.0, 2.0
#: Of a rigid wall: its pin follows it.
FOLLOWS = 3.0
#: What is told of a joint, three numbers of each; then the drive's torque or force, and that of each part.
NORMAL, FRICTION, SLIDING = range(3)
#: Columns of ``joints``: the first coordinate of a gap, and the angles of pin and bearing.
GAP, OF_PIN, OF_BEARING = range(3)


@within
def place(m: Mechanism, phases: FloatArray, z: FloatArray) -> None:
    """Fill coordinates and rates from a state z, the driven one from its time, and close the loops."""
    w, size = m.work, len(m.work.u)
    for i in range(size):
        w.u[i], w.v[i], w.b[i] = z[i], z[size + i], 0.0
    if m.driven >= 0:
        went, speed, acceleration = prescribed(m.drive, m.tables, z[2 * size])
        w.u[m.driven], w.v[m.driven] = m.begin + went, speed
        m.answer[0] = acceleration
    for k in range(len(m.walls)):
        if phases[k, CONTACT] == FOLLOWS:
            x, c = m.joints[k, GAP], m.walls[k, C]
            cos, sin, rate = c * math.cos(z[x]), c * math.sin(z[x]), z[size + x]
            w.u[x], w.u[x + 1], w.v[x], w.v[x + 1] = cos, sin, -rate * sin, rate * cos
            w.b[x], w.b[x + 1] = -rate * rate * cos, -rate * rate * sin
    move(m.tree, w)


@bare
def fill_sliding_row(m: Mechanism, k: int) -> float:
    """Return the sliding speed, that of the pin's surface against the bearing's, counter-clockwise.

    It is ``row`` . u', both surfaces where the contact's force acts: in the middle of the penetration.
    """
    w, x, row = m.work, m.joints[k, GAP], m.row
    distance = math.hypot(w.u[x], w.u[x + 1])
    depth = max(distance - m.walls[k, C], 0.0)
    for i in range(len(row)):
        row[i] = 0.0
    if m.joints[k, OF_PIN] >= 0:
        row[m.joints[k, OF_PIN]] += m.walls[k, R] - m.walls[k, C] - depth / 2
    if m.joints[k, OF_BEARING] >= 0:
        row[m.joints[k, OF_BEARING]] -= m.walls[k, R] + depth / 2
    row[x] -= w.u[x + 1] / distance
    row[x + 1] += w.u[x] / distance
    sliding = 0.0
    for i in range(len(row)):
        sliding += row[i] * w.v[i]
    return sliding


@bare
def add_contact(m: Mechanism, k: int, phase: FloatArray, told: FloatArray, powers: FloatArray) -> None:
    """Add the force of a wall, in its phase (3,), to Q; fill what is told (3,) and its powers (4,)."""
    w, x, wall = m.work, m.joints[k, GAP], m.walls[k]
    distance = math.hypot(w.u[x], w.u[x + 1])
    n_x, n_y = w.u[x] / distance, w.u[x + 1] / distance
    rate = n_x * w.v[x] + n_y * w.v[x + 1]
    spring = wall[K] * max(distance - wall[C], 0.0) ** wall[N]
    if phase[CONTACT] == CLIPPED and wall[PULLS] == 0.0:
        powers[2] = -spring * rate
        return
    force = spring * (1.0 + phase[MEMORY] * rate) + wall[B] * rate
    m.Q[x] -= force * n_x
    m.Q[x + 1] -= force * n_y
    told[NORMAL], powers[0], powers[1] = force, force, (force - spring) * rate
    if wall[MU] > 0.0 and phase[CONTACT] == PUSHED:
        sliding = fill_sliding_row(m, k)
        rub = wall[MU] * force * friction_share(wall, phase[PIECE], sliding)
        told[FRICTION], told[SLIDING], powers[3] = -rub, sliding, rub * sliding
        for i in range(len(m.row)):
            m.Q[i] -= rub * m.row[i]


@within
def add_loads(m: Mechanism, phases: FloatArray, t: float, told: FloatArray, powers: FloatArray) -> None:
    """Add the parts of loads to q or Q; fill their forces (p,) and powers (p,)."""
    w, size = m.work, len(m.work.u)
    for p in range(len(m.loads.what)):
        kind, where = m.loads.what[p, WHAT], m.loads.what[p, WHERE]
        turns = kind in (TURN, TURNING_VISCOUS, TURN_BY_TIME)
        at = rate = by = piece = 0.0
        if turns:
            rate = w.v[where] if where >= 0 else 0.0
        else:
            at = w.value[where]
            for i in range(size):
                rate += w.J[where, i] * w.v[i]
        if kind == GAS:
            angle = m.loads.what[p, BY]
            by, piece = w.u[angle] if angle >= 0 else 0.0, phases[m.loads.what[p, PHASE], PIECE]
        force, lost = load_part(m.loads, m.tables, p, piece, t, by, at, rate)
        told[p], powers[p] = force, lost * rate
        if not turns:
            for i in range(len(m.q)):
                m.q[i] += force * m.Jz[where - m.tree.acting, i]
        elif where >= 0:
            m.Q[where] += force


@within
def assemble(m: Mechanism) -> None:
    """Fill Jz, M and q of no load, contact or drive, and clear Q; coordinates and rows are right."""
    w, size, first = m.work, len(m.work.u), m.tree.acting
    n, bodies = size - m.tree.closing, len(m.masses)
    make_rows(m.tree, w)
    for r in range(len(m.Jz)):
        for i in range(n):
            m.Jz[r, i] = w.J[first + r, w.order[i]]
        for d in range(n, size):
            k = w.order[d]
            slope = w.J[first + r, k]
            if slope != 0.0:
                for i in range(n):
                    m.Jz[r, i] += slope * w.T[k, i]
    for i in range(n):
        force = 0.0
        for r in range(bodies):
            force += m.Jz[r, i] * (m.weights[r] - m.masses[r] * w.bias[first + r])
        m.q[i] = force
        for j in range(i + 1):
            mass = 0.0
            for r in range(bodies):
                mass += m.masses[r] * m.Jz[r, i] * m.Jz[r, j]
            for c in range(len(m.inertias)):
                mass += m.inertias[c] * w.T[c, i] * w.T[c, j]
            m.M[i, j] = m.M[j, i] = mass
    for i in range(size):
        m.Q[i] = 0.0
    for c in range(len(m.inertias)):
        m.Q[c] -= m.inertias[c] * w.b[c]


@bare
def rates(p: Packed, phases: FloatArray, z: FloatArray, out: FloatArray, told: FloatArray) -> None:
    """Fill z' (state,), with every joint and table in its phase (3,), and what is told; close loops in z.

    In M z'' - q + sum F (n + mu f row) = 0 of pins that follow, z'' = psi'' dd/dpsi + bias.
    """
    m = parts(p)
    w, size, joints = m.work, len(m.work.u), len(m.walls)
    n, time = size - m.tree.closing, 2 * size
    sums, work, driver = time + 1, time + 1 + OF_JOINT * joints, OF_TOLD * joints
    for i in range(time, len(z)):
        out[i] = 0.0
    for i in range(len(told)):
        told[i] = 0.0
    place(m, phases, z)
    assemble(m)
    add_loads(m, phases, z[time], told[driver + 1 :], out[work + 1 :])
    driven, k = m.driven >= 0, m.drive.coordinate
    if k >= 0 and not driven:
        piece = phases[m.drive.phase, PIECE] if m.drive.kind == BY_SPEED else 0.0
        told[driver] = effort(m.drive, m.tables, piece, z[time], w.v[k])
        m.Q[k] += told[driver]
    for k in range(joints):
        at = sums + OF_JOINT * k
        if phases[k, CONTACT] != FLIGHT and phases[k, CONTACT] != FOLLOWS:
            add_contact(m, k, phases[k], told[OF_TOLD * k : OF_TOLD * k + 3], out[at : at + OF_JOINT])
    for i in range(n):
        for j in range(size):
            m.q[i] += w.T[j, i] * m.Q[j]
    for k in range(joints):
        if phases[k, CONTACT] == FOLLOWS:
            x, y = w.place[m.joints[k, GAP]], w.place[m.joints[k, GAP] + 1]
            d_x, d_y = w.u[m.joints[k, GAP]], w.u[m.joints[k, GAP] + 1]
            for i in range(n):
                m.M[i, x] = m.M[i, y] * d_x - m.M[i, x] * d_y
                m.M[i, y] = 0.0
            m.M[x, y], m.M[y, y] = d_x / m.walls[k, C], d_y / m.walls[k, C]
            if m.walls[k, MU] > 0.0:
                sliding = fill_sliding_row(m, k)
                share = m.walls[k, MU] * friction_share(m.walls[k], phases[k, PIECE], sliding)
                told[OF_TOLD * k + SLIDING], told[OF_TOLD * k + FRICTION] = sliding, -share
                for i in range(n):
                    for j in range(size):
                        m.M[i, y] += share * m.row[j] * w.T[j, i]
    first = 1 if driven else 0
    for i in range(first, n):
        m.a[i - first] = m.q[i] - m.M[i, 0] * m.answer[0] if driven else m.q[i]
        for j in range(first, n):
            m.A[i - first, j - first] = m.M[i, j]
    factor(m.A, m.swaps)
    solve(m.A, m.swaps, m.a)
    for i in range(first, n):
        m.answer[i] = m.a[i - first]
    if driven:
        for j in range(n):
            told[driver] += m.M[0, j] * m.answer[j]
        told[driver] -= m.q[0]
    if m.drive.coordinate >= 0:
        out[work] = told[driver] * w.v[m.drive.coordinate]
    for i in range(size):
        out[i] = w.v[i]
        if w.place[i] < first or w.place[i] >= n:
            z[i], z[size + i] = w.u[i], w.v[i]
    for i in range(n):
        out[size + w.order[i]] = m.answer[i]
    for k in range(joints):
        if phases[k, CONTACT] == FOLLOWS:
            gap, at = m.joints[k, GAP], OF_TOLD * k
            x, y = w.place[gap], w.place[gap + 1]
            turn, force = m.answer[x], m.answer[y]
            told[at + NORMAL] = out[sums + OF_JOINT * k] = force
            told[at + FRICTION] *= force
            out[sums + OF_JOINT * k + 3] = -told[at + FRICTION] * told[at + SLIDING]
            out[gap], out[gap + 1], out[size + gap], out[size + gap + 1] = z[size + gap], 0.0, turn, 0.0
            m.answer[x], m.answer[y] = -w.u[gap + 1] * turn, w.u[gap] * turn
    for i in range(n, size):
        k = w.order[i]
        acceleration = w.b[k]
        for j in range(n):
            acceleration += w.T[k, j] * m.answer[j]
        out[size + k] = acceleration
    out[time] = 1.0


@bare
def sample(p: Packed, position: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> None:
    """Fill places, velocities and accelerations (bodies, 2) of centres, at the last state of ``rates``."""
    m = parts(p)
    w, first = m.work, m.tree.acting
    for r in range(len(m.masses)):
        b, x = r // 2, r % 2
        position[b, x], velocity[b, x], acceleration[b, x] = w.value[first + r], 0.0, w.bias[first + r]
        for i in range(len(w.u)):
            velocity[b, x] += w.J[first + r, i] * w.v[i]
        for i in range(len(m.q)):
            acceleration[b, x] += m.Jz[r, i] * m.answer[i]
