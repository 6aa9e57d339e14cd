"""Any planar mechanism in minimal coordinates, as one compiled function of numbers.

Coordinates q (3b,) are (x, y, phi) of the centres of mass, a state is y = (q, v, sums). Joints, guides and
a driver are rows g(q, t) = 0, with

    B = dg/dq,  B v = c(t),  B a = gamma.

As many coordinates as there are rows depend on the others, z, and v = T z' + w. With masses M and forces F on
the bodies

    T^T M T z'' = T^T (F - M a0),    a0 the accelerations of z'' = 0,

and the multipliers, which are the forces of joints, guides and driver, follow from  B^T lambda = M a - F  in
the rows of the dependent coordinates. So rates of z alone decide: those of dependent coordinates in v are
not read. A mechanism is one array of numbers p, by the blocks below, and so the equations are compiled once.
"""

import math

import numpy as np
from numpy.typing import NDArray

from reference_solver.machine_code import compiled

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: How functions are compiled that others call: kept, they are compiled once for all of these.
jit = compiled(error_model="numpy")
#: Blocks of p: bodies (mass, mass, inertia); joints; contacts; parts of loads; curves; their pieces; scalars;
#: coordinates, dependent ones first, and their units; contacts' phases; and what the last evaluation tells.
#: (For each int of Python's Numba would compile ``block`` again.)
BODIES, JOINTS, CONTACTS, PARTS, CURVES, PIECES, SCALARS, ORDER, PHASES, TOLD = map(np.int64, range(10))
#: Kinds of joints, by their rows: a pin two; across a line; equal angles; a driven angle; a driven way.
PIN, ACROSS, PARALLEL, DRIVEN_ANGLE, DRIVEN_WAY = range(5)
#: Kinds of parts of loads: along a line; torques; between two points.
LINE, TURN, PULL = range(3)
#: Columns of a part behind its kind and its ends: the angle of its line, a constant, a damper, a spring and
#: its free place; curves over a body's angle, the time and the rate (-1: none); and that body.
ANGLE, CONSTANT, DAMPER, SPRING, FREE, BY_ANGLE, BY_TIME, BY_RATE, OF_BODY = range(7, 16)
#: Motions: constant speed, ramp, sine, table; -1 is none.
STEADY, RAMP, SINE, TABLE = range(4)
#: Scalars: gravity, the clock at t = 0, the motion with its numbers and its curve, and the count of rows.
GX, GY, CLOCK, MOTION, M1, M2, M3, M4, MCURVE, ROWS = range(10)
#: Columns of a contact behind its ends: clearance and bearing radius in m; F = K delta^N (1 + A delta'/v0) +
#: D delta'; the least v0, or the slowest speed that rebounds with E from a rigid wall. A law that PULLS is
#: left as it is but for its friction, which acts also then where it DRAGS. Friction is MU F f(v), f = 1 at
#: FULL speed, 0 below the DEAD one, or tanh.
C, R, K, N, A, D, SLOWEST, E, PULLS, DRAGS, MU, FULL, DEAD, TANH = range(6, 20)
#: Phases of a contact, beside the a/v0 that it remembers: flight; its law pushes; it would pull, so that
#: there is no force, or no friction; and forces that are given, normal and friction.
FLIGHT, PUSHED, CLIPPED, GIVEN = range(4)
#: What is told of a contact: its forces; (d^2 - c^2)/(2 c) of its gap d, and the rate of that; the sign of
#: the law's force; and the sliding speed.
NORMAL, FRICTION, ROOM, RATE, SHARE, SLIDING = range(6)
#: How much is told of a contact, and its sums: of its normal force, and of what that, clipping and friction
#: dissipate.
OF_CONTACT, OF_SUMS = 6, 4


@jit
def block(p: Array, k: int) -> Array:
    """Return a block of p."""
    first, rows, columns = int(p[3 * k]), int(p[3 * k + 1]), int(p[3 * k + 2])
    return p[first : first + rows * columns].reshape((rows, columns))


@jit
def curve_at(p: Array, number: float, x: float) -> tuple[float, float, float]:
    """Return value and two derivatives of a curve, which repeats, or goes on beyond its ends, or is held."""
    curve, pieces = block(p, CURVES)[int(number)], block(p, PIECES)
    low, high, period, last, holds = int(curve[0]), int(curve[0] + curve[1]), curve[2], curve[3], curve[4]
    first = pieces[low, 0]
    if period > 0.0:
        x = first + (x - first) % period
    elif holds > 0.0:
        x = min(max(x, first), last)
    while high - low > 1:
        middle = (low + high) // 2
        if pieces[middle, 0] <= x:
            low = middle
        else:
            high = middle
    a, s = pieces[low], x - pieces[low, 0]
    value = ((a[1] * s + a[2]) * s + a[3]) * s + a[4]
    return value, (3.0 * a[1] * s + 2.0 * a[2]) * s + a[3], 6.0 * a[1] * s + 2.0 * a[2]


@jit
def driven(p: Array, t: float) -> tuple[float, float, float]:
    """Return how far what is driven has gone since the start, its speed and its acceleration."""
    s = block(p, SCALARS)[0]
    kind, a, b, c, d, clock = int(s[MOTION]), s[M1], s[M2], s[M3], s[M4], s[CLOCK]
    if kind == RAMP:  # from a by b within c
        x, x0 = min((clock + t) / c, 1.0), min(clock / c, 1.0)
        went = x**4 * (2.5 - 3.0 * x + x * x) - x0**4 * (2.5 - 3.0 * x0 + x0 * x0)
        went = c * went + max(clock + t - c, 0.0) - max(clock - c, 0.0)
        speed = a + b * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        return a * t + b * went, speed, 30.0 * b / c * (x * (1.0 - x)) ** 2
    if kind == SINE:  # mean a, amplitude b, rate c, phase d
        phase, half = c * clock + d, 0.5 * c * t
        # cos(phase) - cos(phase + c t), without their difference
        went = 2.0 * math.sin(half) * math.sin(half + phase) / c
        return a * t + b * went, a + b * math.sin(c * t + phase), b * c * math.cos(c * t + phase)
    if kind == TABLE:
        place, speed, acceleration = curve_at(p, s[MCURVE], clock + t)
        return place - curve_at(p, s[MCURVE], clock)[0], speed, acceleration
    return a * t, a, 0.0


@jit
def arm(q: Array, body: int, x: float, y: float) -> tuple[float, float]:
    """Return a vector of a body's axes in the frame."""
    if body < 0:
        return x, y
    c, s = math.cos(q[3 * body + 2]), math.sin(q[3 * body + 2])
    return c * x - s * y, s * x + c * y


@jit
def spin(v: Array, body: int) -> float:
    """Return the angular speed of a body, or of q its angle."""
    return v[3 * body + 2] if body >= 0 else 0.0


@jit
def apart(q: Array, v: Array, e: Array) -> tuple[float, ...]:
    """Return arms of the points of e = (body i, x, y, body j, x, y), the vector between, and its rate."""
    i, j = int(e[0]), int(e[3])
    ax, ay = arm(q, i, e[1], e[2])
    bx, by = arm(q, j, e[4], e[5])
    dx, dy, vx, vy = bx - ax, by - ay, 0.0, 0.0
    if i >= 0:
        dx, dy = dx - q[3 * i], dy - q[3 * i + 1]
        vx, vy = -v[3 * i] + v[3 * i + 2] * ay, -v[3 * i + 1] - v[3 * i + 2] * ax
    if j >= 0:
        dx, dy = dx + q[3 * j], dy + q[3 * j + 1]
        vx, vy = vx + v[3 * j] - v[3 * j + 2] * by, vy + v[3 * j + 1] + v[3 * j + 2] * bx
    return ax, ay, bx, by, dx, dy, vx, vy


@jit
def push(row: Array, e: Array, ax: float, ay: float, bx: float, by: float, fx: float, fy: float) -> None:
    """Add a force on point j of e, and the opposite one on point i, to generalised forces."""
    i, j = int(e[0]), int(e[3])
    if i >= 0:
        row[3 * i] -= fx
        row[3 * i + 1] -= fy
        row[3 * i + 2] -= ax * fy - ay * fx
    if j >= 0:
        row[3 * j] += fx
        row[3 * j + 1] += fy
        row[3 * j + 2] += bx * fy - by * fx


@jit
def direction(q: Array, body: int, angle: float) -> tuple[float, float]:
    """Return the direction of a line of a body."""
    turned = angle + spin(q, body)
    return math.cos(turned), math.sin(turned)


@jit
def fill_rows(p: Array, t: float, q: Array, v: Array, g: Array, B: Array, c: Array, gamma: Array) -> None:
    """Fill g, B, c and gamma of all rows."""
    r, joints = 0, block(p, JOINTS)
    B[:], c[:], gamma[:] = 0.0, 0.0, 0.0
    for k in range(len(joints)):  # an array's iterator would give rows of another type
        e = joints[k]
        kind, i, j, ends = int(e[0]), int(e[1]), int(e[4]), e[1:7]
        ax, ay, bx, by, dx, dy, vx, vy = apart(q, v, ends)
        wi, wj = spin(v, i), spin(v, j)
        if kind == PIN:
            push(B[r], ends, ax, ay, bx, by, 1.0, 0.0)
            push(B[r + 1], ends, ax, ay, bx, by, 0.0, 1.0)
            g[r], g[r + 1] = dx, dy
            gamma[r], gamma[r + 1] = wj * wj * bx - wi * wi * ax, wj * wj * by - wi * wi * ay
            r += 2
            continue
        if kind in (PARALLEL, DRIVEN_ANGLE):
            if i >= 0:
                B[r, 3 * i + 2] -= 1.0
            B[r, 3 * j + 2] += 1.0
            g[r] = spin(q, j) - spin(q, i) - e[7]
        else:  # u.d with u at 90 degrees, or along: the force acts at point j on both bodies
            ux, uy = direction(q, i, e[7])
            if kind == ACROSS:
                ux, uy = -uy, ux
            push(B[r], ends, ax + dx, ay + dy, bx, by, ux, uy)
            g[r] = ux * dx + uy * dy - e[8]
            # (u.d)'' = u.d'' + 2 u'.d' + u''.d with u' = wi (-uy, ux)
            gamma[r] = ux * (wj * wj * bx - wi * wi * ax) + uy * (wj * wj * by - wi * wi * ay)
            gamma[r] += wi * wi * (ux * dx + uy * dy) - 2.0 * wi * (ux * vy - uy * vx)
        if kind >= DRIVEN_ANGLE:
            went, speed, acceleration = driven(p, t)
            g[r], c[r], gamma[r] = g[r] - went, speed, gamma[r] + acceleration
        r += 1


@jit
def friction_share(e: Array, sliding: float) -> float:
    """Return the part of MU F that rubs at a sliding speed, with its sign."""
    if e[TANH] > 0.0:
        return math.tanh(sliding / e[FULL])
    return math.copysign(min(1.0, max(0.0, (abs(sliding) - e[DEAD]) / (e[FULL] - e[DEAD]))), sliding)


@jit
def add_contact(e: Array, phase: Array, q: Array, v: Array, F: Array, told: Array, powers: Array) -> None:
    """Add what a contact does in its phase to F; fill what is told of it and its powers."""
    ax, ay, bx, by, dx, dy, vx, vy = apart(q, v, e)
    distance = math.hypot(dx, dy)
    told[NORMAL] = told[FRICTION] = told[SLIDING] = 0.0
    told[SHARE] = 1.0
    told[ROOM] = 0.5 * (distance - e[C]) * (distance + e[C]) / e[C]
    told[RATE] = (dx * vx + dy * vy) / e[C]
    powers[:] = 0.0
    if distance == 0.0:
        return
    nx, ny = dx / distance, dy / distance
    rate, depth = nx * vx + ny * vy, distance - e[C]
    half = 0.5 * max(depth, 0.0)
    of_i, of_j = e[R] + half, e[R] - e[C] - half  # surfaces meet in the middle of the penetration
    sliding = nx * vy - ny * vx + spin(v, int(e[3])) * of_j - spin(v, int(e[0])) * of_i
    told[SLIDING] = sliding
    if phase[0] == FLIGHT:
        return
    elastic = e[K] * max(depth, 0.0) ** e[N]
    told[SHARE] = 1.0 + phase[1] * rate
    if e[PULLS] > 0.0 and e[DRAGS] == 0.0:
        told[SHARE] = (elastic + e[D] * rate) / (elastic + abs(e[D] * rate) + 1e-300)
    if phase[0] == CLIPPED and e[PULLS] == 0.0:
        powers[2] = -elastic * rate
        return
    force = elastic * (1.0 + phase[1] * rate) + e[D] * rate
    rub = 0.0
    if e[MU] > 0.0 and phase[0] == PUSHED:
        rub = -e[MU] * force * friction_share(e, sliding)
    if phase[0] == GIVEN:
        force, rub = phase[1], phase[2]
    ax, ay, bx, by = ax + of_i * nx, ay + of_i * ny, bx + of_j * nx, by + of_j * ny
    push(F, e, ax, ay, bx, by, -force * nx - rub * ny, -force * ny + rub * nx)
    told[NORMAL], told[FRICTION] = force, rub
    powers[0], powers[1], powers[3] = force, (force - elastic) * rate, -rub * sliding


@jit
def engage(e: Array, phase: Array, q: Array, v: Array) -> None:
    """Set the phase of a contact by a state, for who looks at states alone; a touch remembers a/v0."""
    _, _, _, _, dx, dy, vx, vy = apart(q, v, e)
    distance = math.hypot(dx, dy)
    if distance <= e[C] or e[K] == 0.0:
        phase[0] = FLIGHT
        return
    rate = (dx * vx + dy * vy) / distance
    if phase[0] == FLIGHT:
        phase[1] = e[A] / max(rate, e[SLOWEST])
    force = e[K] * (distance - e[C]) ** e[N] * (1.0 + phase[1] * rate) + e[D] * rate
    phase[0] = CLIPPED if force < 0.0 and e[DRAGS] == 0.0 else PUSHED


@jit
def forces(p: Array, t: float, q: Array, v: Array, F: Array, told: Array, powers: Array) -> int:
    """Fill the forces F (3b,) on the bodies, what is told of contacts and loads, and their powers."""
    s, bodies, phases = block(p, SCALARS)[0], block(p, BODIES), block(p, PHASES)
    contacts, parts = block(p, CONTACTS), block(p, PARTS)
    for b in range(len(bodies)):
        F[3 * b], F[3 * b + 1], F[3 * b + 2] = bodies[b, 0] * s[GX], bodies[b, 0] * s[GY], 0.0
    at, place_of = 0, 0
    for k in range(len(contacts)):
        of_k = told[at : at + OF_CONTACT]
        add_contact(contacts[k], phases[k], q, v, F, of_k, powers[place_of : place_of + OF_SUMS])
        at, place_of = at + OF_CONTACT, place_of + OF_SUMS
    for k in range(len(parts)):
        e = parts[k]
        kind, ends = int(e[0]), e[1:7]
        rate = place = ux = uy = ax = ay = bx = by = 0.0
        if kind == TURN:
            place, rate = spin(q, int(e[4])) - spin(q, int(e[1])), spin(v, int(e[4])) - spin(v, int(e[1]))
        else:
            ax, ay, bx, by, dx, dy, vx, vy = apart(q, v, ends)
            if kind == PULL:
                place = math.hypot(dx, dy)
                if place > 0.0:
                    ux, uy = dx / place, dy / place
            else:
                ux, uy = direction(q, int(e[1]), e[ANGLE])
                ax, ay = ax + dx, ay + dy
                place = ux * dx + uy * dy
                rate = spin(v, int(e[1])) * (ux * dy - uy * dx)
            rate += ux * vx + uy * vy
        elastic = e[SPRING] * (e[FREE] - place)
        force = e[CONSTANT] - e[DAMPER] * rate
        if e[BY_ANGLE] >= 0.0:
            force += curve_at(p, e[BY_ANGLE], q[3 * int(e[OF_BODY]) + 2])[0]
        if e[BY_TIME] >= 0.0:
            force += curve_at(p, e[BY_TIME], s[CLOCK] + t)[0]
        if e[BY_RATE] >= 0.0:
            force += curve_at(p, e[BY_RATE], rate)[0]
        powers[place_of] = (force + elastic if kind == LINE else force) * rate  # a spring has a potential
        told[at] = force = force + elastic
        if kind == TURN:
            F[3 * int(e[4]) + 2] += force
            if e[1] >= 0.0:
                F[3 * int(e[1]) + 2] -= force
        else:
            push(F, ends, ax, ay, bx, by, force * ux, force * uy)
        at, place_of = at + 1, place_of + 1
    return place_of


@compiled("void(f8[::1], f8[::1], f8[:, ::1])", error_model="numpy")
def drive(p: Array, t: Array, motion: Array) -> None:
    """Fill what ``driven`` returns at times (n,), (n, 3)."""
    for n in range(len(t)):
        motion[n, 0], motion[n, 1], motion[n, 2] = driven(p, t[n])


@compiled(
    "void(f8[::1], f8, f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])",
    error_model="numpy",
)
def look(p: Array, t: float, q: Array, v: Array, B: Array, g: Array, c: Array, gamma: Array) -> None:
    """Fill B (n, m, 3b), g, c and gamma (n, m) at a time in states (n, 3b)."""
    for n in range(len(q)):
        fill_rows(p, t, q[n], v[n], g[n], B[n], c[n], gamma[n])


@jit
def factor(M: Array, swaps: IntArray) -> float:
    """Replace M by its factors, by Gauss's elimination with row pivots; return its determinant."""
    n, determinant = len(M), 1.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(M[i, k]) > abs(M[best, k]):
                best = i
        swaps[k] = best
        if best != k:
            determinant = -determinant
            for j in range(n):
                M[k, j], M[best, j] = M[best, j], M[k, j]
        determinant *= M[k, k]
        for i in range(k + 1, n):
            if M[i, k] != 0.0:
                M[i, k] /= M[k, k]
                for j in range(k + 1, n):
                    M[i, j] -= M[i, k] * M[k, j]
    return determinant


@jit
def solve(M: Array, swaps: IntArray, x: Array) -> None:
    """Replace x by the solution of M x, by factors."""
    n = len(M)
    for k in range(n):
        x[k], x[swaps[k]] = x[swaps[k]], x[k]
    for i in range(1, n):
        for j in range(i):
            x[i] -= M[i, j] * x[j]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= M[i, j] * x[j]
        x[i] /= M[i, i]


@jit
def solve_transposed(M: Array, swaps: IntArray, x: Array) -> None:
    """Replace x by the solution of M^T x, by factors of M."""
    n = len(M)
    for i in range(n):
        for j in range(i):
            x[i] -= M[j, i] * x[j]
        x[i] /= M[i, i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[i] -= M[j, i] * x[j]
    for k in range(n - 1, -1, -1):
        x[k], x[swaps[k]] = x[swaps[k]], x[k]


@compiled("void(f8[::1], f8, f8[::1], f8[::1])", error_model="numpy")
def rates(p: Array, t: float, y: Array, out: Array) -> None:
    """Fill y' (state,), and in p's last block v (3b,), a (3b,), the multipliers and what ``forces`` tells.

    The last two numbers told are the determinant of the dependent coordinates' rows, and the largest of T.
    """
    masses, told, scalars = block(p, BODIES).ravel(), block(p, TOLD)[0], block(p, SCALARS)[0]
    size, m, (places, unit) = len(masses), int(scalars[ROWS]), block(p, ORDER)
    order = places.astype(np.int64)
    n, q, v, a, sums = size - m, y[:size], told[:size], told[size : 2 * size], out[2 * size :]
    dependent, free = order[:m], order[m:]
    g, c, gamma, B, F = np.empty(m), np.empty(m), np.empty(m), np.empty((m, size)), np.empty(size)
    v[:] = 0.0
    fill_rows(p, t, q, v, g, B, c, gamma)
    G, swaps, T, largest = np.empty((m, m)), np.empty(m, np.int64), np.zeros((size, n)), 0.0
    for i in range(m):
        for j in range(m):
            G[i, j] = B[i, dependent[j]]
    told[len(told) - 2] = factor(G, swaps)
    solve(G, swaps, c)
    for i in range(m):
        v[dependent[i]] = c[i]
    for k in range(n):
        z, column = free[k], B[:, free[k]].copy()
        solve(G, swaps, column)
        v[z], T[z, k] = y[size + z], 1.0
        for i in range(m):
            r = dependent[i]
            T[r, k] = -column[i]
            v[r] -= column[i] * v[z]
            largest = max(largest, abs(column[i]) * unit[z] / unit[r])
    told[len(told) - 1] = largest
    fill_rows(p, t, q, v, g, B, c, gamma)
    solve(G, swaps, gamma)
    a[:] = 0.0
    for i in range(m):
        a[dependent[i]] = gamma[i]
    driver = forces(p, t, q, v, F, told[2 * size + m :], sums)
    for k in range(len(block(p, CONTACTS))):
        sums[OF_SUMS * k + 2] = 0.0  # what clipping loses has a kink where the contact ends, and is known
    M, x, swaps_z = np.zeros((n, n)), np.zeros(n), np.empty(n, np.int64)
    for r in range(size):
        for i in range(n):
            if T[r, i] != 0.0:
                x[i] += T[r, i] * (F[r] - masses[r] * a[r])
                for j in range(n):
                    M[i, j] += masses[r] * T[r, i] * T[r, j]
    factor(M, swaps_z)
    solve(M, swaps_z, x)
    for r in range(size):
        for i in range(n):
            a[r] += T[r, i] * x[i]
    for r in range(2 * size):
        out[r] = told[r]
    multipliers = told[2 * size : 2 * size + m]
    for i in range(m):
        r = dependent[i]
        multipliers[i] = masses[r] * a[r] - F[r]
    solve_transposed(G, swaps, multipliers)
    if scalars[MOTION] >= 0.0:  # the driver's row is the last, and so is the sum of its work
        sums[driver] = multipliers[m - 1] * driven(p, t)[1]
