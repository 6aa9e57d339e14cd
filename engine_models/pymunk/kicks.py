"""What a step of a space is given, and what it has done, compiled: on the numbers of ``minimal.equations``.

A step moves the bodies by h with the velocities that it finds, and then kicks these by the loads and by the
joints' impulses, all at the new places. So loads are those of the places to which the step will move the
bodies. Of velocities it knows those of half a step before; loads are given what these will be, as far as half
of the last kick tells, and laws of contacts what they are.
"""

import math

import numpy as np

from engine_models.engine import FloatArray
from engine_models.minimal import equations as eq
from engine_models.minimal.equations import FLIGHT, GIVEN, PUSHED, IntArray, entry, jit

#: The numbers of a plan: the time after a step, how long it is, how long the last kick was, or 0 for who
#: foresees nothing; the time then left to the next sample; how long steps are in flight and in contact; and,
#: filled, how many steps are left, how long the next one is, and the kick.
TIME, STEP, LAST_KICK, LEFT, IN_FLIGHT, IN_CONTACT, STEPS, NEXT, KICK = range(9)
#: Steps of flight before a touch that are short: a joint answers to a change of the step for two of them.
AHEAD = 2.0
#: How many times shorter a step may be than the one before it. Joints close in it what the longer one has
#: left open, at a speed that grows with this ratio; at 30 they shake pins against their walls.
AT_ONCE = 8.0
#: Room for rounding where a time is divided into steps, as a part of one.
ROUNDING = 1e-6
#: What ``look_ahead`` returns: nothing acts but what the space knows; loads do; a pin touches; and from here
#: on the number of a pin that is through its wall.
NOTHING, LOADS, TOUCHING, THROUGH = range(4)
#: What ``react`` is given: the accelerations, or nothing; or nothing, of a mechanism whose joints see no
#: curvature of their paths yet.
KNOWN, CURVED, STRAIGHT = range(3)


@jit
def to_centre(q: FloatArray, b: int, origin: FloatArray) -> tuple[float, float]:
    """Return the way from a body's centre of mass to its origin in the frame."""
    return eq.arm(q, b, origin[b, 0], origin[b, 1])


@jit
def touches_within(e: FloatArray, q: FloatArray, v: FloatArray, time_s: float) -> bool:
    """Return whether a pin touches its wall, or will within a time at its present rate."""
    _, _, _, _, dx, dy, vx, vy = eq.apart(q, v, e)
    inside = e[eq.C] * e[eq.C] - dx * dx - dy * dy
    # |d|^2 grows by |d'|^2 t^2 + 2 d.d' t, which is largest at one end of the time.
    return inside <= max(0.0, (vx * vx + vy * vy) * time_s * time_s + 2.0 * (dx * vx + dy * vy) * time_s)


@entry
def look_ahead(
    p: FloatArray,
    plan: FloatArray,
    state: FloatArray,
    before: FloatArray,
    rows: IntArray,
    origin: FloatArray,
    lift: FloatArray,
    told: FloatArray,
    powers: FloatArray,
    loads: FloatArray,
) -> int:
    """Plan the kick after a step, and fill ``loads`` (b, 3) on the origins of the space's bodies for it.

    ``state`` (b, 6) is that of the space's bodies before the step. The velocities of ``before`` (b, 3), those
    of a kick before, become those of now. ``told`` and ``powers`` are filled as ``equations.forces`` does.
    """
    contacts, phases, b = eq.block(p, eq.CONTACTS), eq.block(p, eq.PHASES), len(rows)
    h, q, v, F = plan[STEP], np.empty(3 * b), np.empty(3 * b), np.empty(3 * b)
    on = h / (2.0 * plan[LAST_KICK]) if plan[LAST_KICK] > 0.0 else 0.0
    for n in range(b):
        for k in range(3):
            now = state[rows[n], 3 + k]
            q[3 * n + k] = state[rows[n], k] + h * now
            v[3 * n + k] = now + on * (now - before[n, k])
            before[n, k] = now
        ax, ay = to_centre(q, n, origin)
        q[3 * n], q[3 * n + 1] = q[3 * n] - ax, q[3 * n + 1] - ay
        v[3 * n], v[3 * n + 1] = v[3 * n] + v[3 * n + 2] * ay, v[3 * n + 1] - v[3 * n + 2] * ax
    touching, near = False, False
    for k in range(len(contacts)):
        e = contacts[k]
        _, _, _, _, dx, dy, _, _ = eq.apart(q, v, e)
        if e[eq.K] > 0.0 and not math.hypot(dx, dy) <= e[eq.R]:
            return THROUGH + k
        eq.engage(e, phases[k], q, v)
        touching |= phases[k, 0] != FLIGHT
        near |= touches_within(e, q, v, AHEAD * plan[IN_FLIGHT])
    plan[NEXT] = plan[IN_FLIGHT]
    if plan[IN_CONTACT] < plan[IN_FLIGHT]:
        longest = max(plan[IN_CONTACT], h / AT_ONCE) if near else plan[IN_FLIGHT]
        plan[STEPS] = max(1.0, math.ceil(plan[LEFT] / longest - ROUNDING))
        plan[NEXT] = plan[LEFT] / plan[STEPS]
    plan[KICK] = (h + plan[NEXT]) / 2.0
    # A step kicks for as long as it moves; loads are to act from its middle to that of the next one.
    share = plan[KICK] / h if abs(plan[NEXT] - h) > ROUNDING * h else 1.0
    eq.forces(p, plan[TIME], q, v, F, told, powers)
    for n in range(b):
        ax, ay = to_centre(q, n, origin)
        fx, fy, row = F[3 * n], F[3 * n + 1], rows[n]
        loads[row, 0], loads[row, 1] = share * fx - lift[n, 0], share * fy - lift[n, 1]
        loads[row, 2] = share * (F[3 * n + 2] - ax * fy + ay * fx)
    if touching:
        return TOUCHING
    return LOADS if len(eq.block(p, eq.PARTS)) > 0 or share != 1.0 else NOTHING


@jit
def find_reactions(
    p: FloatArray,
    t: float,
    given: int,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    told: FloatArray,
    powers: FloatArray,
    multipliers: FloatArray,
    matrix: FloatArray,
    right: FloatArray,
) -> None:
    """Do as ``react``."""
    contacts, phases, bodies = eq.block(p, eq.CONTACTS), eq.block(p, eq.PHASES), eq.block(p, eq.BODIES)
    size, m, laws = len(q), len(right), phases.copy()
    F, g, c, gamma = np.empty(size), np.empty(m), np.empty(m), np.empty(m)
    B, by_mass, swaps = np.empty((m, size)), np.empty((m, size)), np.empty(m, np.int64)
    for k in range(len(contacts)):
        of_contact = told[eq.OF_CONTACT * k : eq.OF_CONTACT * (k + 1)]
        if given == KNOWN and (phases[k, 0] == PUSHED or of_contact[eq.NORMAL] != 0.0):
            phases[k, 0], phases[k, 1], phases[k, 2] = GIVEN, of_contact[eq.NORMAL], of_contact[eq.FRICTION]
    driver = eq.forces(p, t, q, v, F, told, powers)
    phases[:] = laws
    eq.fill_rows(p, t, q, v, g, B, c, gamma)
    is_driven = eq.block(p, eq.SCALARS)[0, eq.MOTION] >= 0.0
    for i in range(m):
        right[i] = gamma[i] if given == CURVED or (is_driven and i == m - 1) else 0.0
        if given == KNOWN:
            right[i] = 0.0
        for r in range(size):
            by_mass[i, r] = B[i, r] / bodies[r // 3, 1 if r % 3 == 2 else 0]
            right[i] -= by_mass[i, r] * F[r]
            if given == KNOWN:
                right[i] += B[i, r] * a[r]
    for i in range(m):
        multipliers[i] = right[i]
        for j in range(m):
            matrix[i, j] = 0.0
            for r in range(size):
                matrix[i, j] += by_mass[i, r] * B[j, r]
    factors = matrix.copy()
    eq.factor(factors, swaps)
    eq.solve(factors, swaps, multipliers)
    if given != KNOWN:
        for r in range(size):
            a[r] = F[r] / bodies[r // 3, 1 if r % 3 == 2 else 0]
            for i in range(m):
                a[r] += by_mass[i, r] * multipliers[i]
    if is_driven:
        powers[driver] = multipliers[m - 1] * c[m - 1]


@entry
def react(
    p: FloatArray,
    t: float,
    given: int,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    told: FloatArray,
    powers: FloatArray,
    multipliers: FloatArray,
    matrix: FloatArray,
    right: FloatArray,
) -> None:
    """Fill the multipliers (m,) of all rows in a state, and the powers; and the accelerations if not given.

    They solve B M^-1 B^T lambda = B (a - M^-1 F), of which matrix and right side are left. Contacts in
    ``told`` do what is told of them.
    """
    find_reactions(p, t, given, q, v, a, told, powers, multipliers, matrix, right)


@entry
def account(
    p: FloatArray,
    plan: FloatArray,
    given: int,
    before: FloatArray,
    state: FloatArray,
    rows: IntArray,
    origin: FloatArray,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    told: FloatArray,
    powers: FloatArray,
    multipliers: FloatArray,
    matrix: FloatArray,
    right: FloatArray,
) -> None:
    """Fill the places, the mean velocities and the accelerations of a kick, and do as ``react``."""
    kick_s = plan[KICK]
    for n in range(len(rows)):
        row = rows[n]
        for k in range(3):
            was, now = before[n, k], state[row, 3 + k]
            q[3 * n + k], v[3 * n + k], a[3 * n + k] = state[row, k], (was + now) / 2.0, (now - was) / kick_s
        ax, ay = to_centre(q, n, origin)
        spin, gain = v[3 * n + 2], a[3 * n + 2]
        q[3 * n], q[3 * n + 1] = q[3 * n] - ax, q[3 * n + 1] - ay
        v[3 * n], v[3 * n + 1] = v[3 * n] + spin * ay, v[3 * n + 1] - spin * ax
        a[3 * n] += gain * ay + spin * spin * ax
        a[3 * n + 1] += spin * spin * ay - gain * ax
    find_reactions(p, plan[TIME], given, q, v, a, told, powers, multipliers, matrix, right)
