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
from engine_models.minimal.equations import FLIGHT, GIVEN, PUSHED, IntArray, jit
from reference_solver.machine_code import compiled

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
#: What ``look_ahead`` returns: nothing but loads and the space's gravity acts; weights are to act for
#: another time than the step; a pin touches; and from here on the number of a pin that is through its wall.
NOTHING, LONGER, TOUCHING, THROUGH = range(4)
#: What ``account`` goes by: the change of velocities; the state; or the state, with joints that see no
#: curvature of their paths yet.
KNOWN, CURVED, STRAIGHT = range(3)
#: By this part diagonals are raised where rows depend on each other.
FLAT = 1e-10
#: Kinds of arrays.
ONE, MANY = "f8[::1]", "f8[:, ::1]"


@jit
def touches_within(e: FloatArray, q: FloatArray, v: FloatArray, time_s: float) -> bool:
    """Return whether a pin touches its wall, or will within a time at its present rate."""
    _, _, _, _, dx, dy, vx, vy = eq.apart(q, v, e)
    inside = e[eq.C] * e[eq.C] - dx * dx - dy * dy
    # |d|^2 grows by |d'|^2 t^2 + 2 d.d' t, which is largest at one end of the time.
    growth = (vx * vx + vy * vy) * time_s * time_s + 2.0 * (dx * vx + dy * vy) * time_s
    return bool(inside <= max(0.0, growth))


@compiled(
    f"({ONE}, {ONE}, {MANY}, {MANY}, i8[::1], {MANY}, {MANY}, {ONE}, {ONE}, {MANY})",
    error_model="numpy",
)
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
    arms, gain, touching, near = np.empty((b, 2)), np.empty(3), False, False
    for n in range(b):
        for k in range(3):
            v[3 * n + k] = state[rows[n], 3 + k]
            q[3 * n + k] = state[rows[n], k] + h * v[3 * n + k]
        ax, ay = eq.arm(q, n, origin[n, 0], origin[n, 1])
        arms[n, 0], arms[n, 1] = ax, ay
        q[3 * n], q[3 * n + 1] = q[3 * n] - ax, q[3 * n + 1] - ay
        v[3 * n], v[3 * n + 1] = v[3 * n] + v[3 * n + 2] * ay, v[3 * n + 1] - v[3 * n + 2] * ax
    for k in range(len(contacts)):
        e = contacts[k]
        _, _, _, _, dx, dy, _, _ = eq.apart(q, v, e)
        if e[eq.K] > 0.0 and not math.hypot(dx, dy) <= e[eq.R]:
            return THROUGH + k
        eq.engage(e, phases[k], q, v)
        touching |= phases[k, 0] != FLIGHT
        near |= touches_within(e, q, v, AHEAD * plan[IN_FLIGHT])
    on = h / (2.0 * plan[LAST_KICK]) if plan[LAST_KICK] > 0.0 and not touching else 0.0
    for n in range(b):
        for k in range(3):
            gain[k] = on * (state[rows[n], 3 + k] - before[n, k])
            before[n, k] = state[rows[n], 3 + k]
        v[3 * n] += gain[0] + gain[2] * arms[n, 1]
        v[3 * n + 1] += gain[1] - gain[2] * arms[n, 0]
        v[3 * n + 2] += gain[2]
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
        ax, ay = arms[n, 0], arms[n, 1]
        fx, fy, row = F[3 * n], F[3 * n + 1], rows[n]
        loads[row, 0], loads[row, 1] = share * fx - lift[n, 0], share * fy - lift[n, 1]
        loads[row, 2] = share * (F[3 * n + 2] - ax * fy + ay * fx)
    return TOUCHING if touching else LONGER if share != 1.0 else NOTHING


@compiled(
    f"({ONE}, {ONE}, i8, {MANY}, {MANY}, i8[::1], {MANY}, {MANY}, {ONE}, {ONE}, {ONE})",
    error_model="numpy",
)
def account(
    p: FloatArray,
    plan: FloatArray,
    given: int,
    before: FloatArray,
    state: FloatArray,
    rows: IntArray,
    origin: FloatArray,
    motion: FloatArray,
    told: FloatArray,
    powers: FloatArray,
    multipliers: FloatArray,
) -> None:
    """Fill places, mean velocities and accelerations of a kick (3, 3b), the multipliers (m,) and the powers.

    The multipliers solve B M^-1 B^T lambda = B (a - M^-1 F). They are those of the change of velocities, with
    contacts that do what is told of them; or those of the place and the velocities, and so are the
    accelerations then. In a flat position, where rows depend on each other, they are the shortest.
    """
    q, v, a = motion[0], motion[1], motion[2]
    masses, phases = eq.block(p, eq.BODIES).ravel(), eq.block(p, eq.PHASES)
    size, m, laws, F = len(q), len(multipliers), phases.copy(), np.empty(len(q))
    for n in range(len(rows)):
        for k in range(3):
            was, now, place = before[n, k], state[rows[n], 3 + k], state[rows[n], k]
            q[3 * n + k], v[3 * n + k], a[3 * n + k] = place, (was + now) / 2.0, (now - was) / plan[KICK]
        ax, ay = eq.arm(q, n, origin[n, 0], origin[n, 1])
        spin, gain = v[3 * n + 2], a[3 * n + 2]
        q[3 * n], q[3 * n + 1] = q[3 * n] - ax, q[3 * n + 1] - ay
        v[3 * n], v[3 * n + 1] = v[3 * n] + spin * ay, v[3 * n + 1] - spin * ax
        a[3 * n] += gain * ay + spin * spin * ax
        a[3 * n + 1] += spin * spin * ay - gain * ax
    for k in range(len(phases)):
        normal, friction = told[eq.OF_CONTACT * k + eq.NORMAL], told[eq.OF_CONTACT * k + eq.FRICTION]
        if given == KNOWN and (phases[k, 0] == PUSHED or normal != 0.0):
            phases[k, 0], phases[k, 1], phases[k, 2] = GIVEN, normal, friction
    driver = eq.forces(p, plan[TIME], q, v, F, told, powers)
    for k in range(len(phases)):
        for i in range(3):
            phases[k, i] = laws[k, i]
    g, c, gamma, swaps = np.empty(m), np.empty(m), np.empty(m), np.empty(m, np.int64)
    B, by_mass, matrix, right = np.empty((m, size)), np.empty((m, size)), np.empty((m, m)), np.empty(m)
    eq.fill_rows(p, plan[TIME], q, v, g, B, c, gamma)
    driven = eq.block(p, eq.SCALARS)[0, eq.MOTION] >= 0.0  # by the last row
    for i in range(m):
        right[i] = gamma[i] if given == CURVED or (given == STRAIGHT and driven and i == m - 1) else 0.0
        for r in range(size):
            by_mass[i, r] = B[i, r] / masses[r]
            right[i] += (B[i, r] * a[r] if given == KNOWN else 0.0) - by_mass[i, r] * F[r]
        for j in range(i + 1):
            matrix[i, j] = 0.0
            for r in range(size):
                matrix[i, j] += by_mass[i, r] * B[j, r]
            matrix[j, i] = matrix[i, j]
    for more in (0.0, FLAT):
        factors = matrix.copy()
        for i in range(m):
            factors[i, i] *= 1.0 + more
            multipliers[i] = right[i]
        eq.factor(factors, swaps)
        eq.solve(factors, swaps, multipliers)
        if np.isfinite(multipliers).all():
            break
    for r in range(size):
        if given != KNOWN:
            a[r] = F[r] / masses[r]
            for i in range(m):
                a[r] += by_mass[i, r] * multipliers[i]
    if driven:
        powers[driver] = multipliers[m - 1] * c[m - 1]
