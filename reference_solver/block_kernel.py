"""The compiled face for large mechanisms: one kernel for all of them, sparse in 2x2 blocks, run by Numba.

The records and their meaning are in ``block_plan``; ``p`` is a plan. Coordinates end with the frame's three.
All is in one file, since Numba's cache watches that of the function called alone.
"""

from math import cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from reference_solver.block_plan import Plan
from reference_solver.kernel_store import njit

FloatArray = NDArray[np.float64]

inlined = njit(error_model="numpy", fastmath={"contract"}, forceinline=True)
compiled = njit(error_model="numpy", fastmath={"contract"}, cache=True)

#: The four stages of (11)-(13): their times, the way from the state to the next one, both in steps, and their
#: weights in six times the mean.
TIME, AHEAD, WEIGHT = (0.0, 0.5, 0.5, 1.0), (0.5, 0.5, 1.0, 0.0), (1.0, 2.0, 2.0, 1.0)


@inlined
def turn(p: Plan, q: FloatArray) -> None:
    """Write the ends' arms and their w at coordinates q."""
    for b in range(len(p.bodies)):
        body = p.bodies[b]
        body.cos, body.sin = cos(q[3 * b + 2]), sin(q[3 * b + 2])
    for e in range(len(p.ends)):
        end = p.ends[e]
        body = p.bodies[end.body]
        end.arm_x = body.cos * end.point_x - body.sin * end.point_y
        end.arm_y = body.sin * end.point_x + body.cos * end.point_y
        end.w_x, end.w_y = end.w0_x - end.arm_y, end.w0_y + end.arm_x


@inlined
def factor(p: Plan) -> bool:
    """Factor [B][M]^-1[B]^T = L D L^T in place; return whether all pivots are above round-off."""
    for n in range(len(p.blocks)):
        G = p.blocks[n]
        G.xx, G.xy, G.yx, G.yy = G.xx_0, G.xy_0, G.yx_0, G.yy_0
    for n in range(len(p.pairs)):
        pair = p.pairs[n]
        G, i, j = p.blocks[pair.block], p.ends[pair.i], p.ends[pair.j]
        r = p.bodies[i.body].inverse_inertia
        G.xx += r * i.w_x * j.w_x
        G.xy += r * i.w_x * j.w_y
        G.yx += r * i.w_y * j.w_x
        G.yy += r * i.w_y * j.w_y
    for k in range(len(p.rows)):
        D, row = p.blocks[k], p.rows[k]
        row.floor_x, row.floor_y = p.tolerance * D.xx, p.tolerance * D.yy
    ok = True
    for k in range(len(p.rows)):
        D, row = p.blocks[k], p.rows[k]
        r = 1.0 / D.xx
        u = D.yx * r
        second = D.yy - u * D.yx
        ok &= (D.xx > row.floor_x) & (second > row.floor_y)
        yy = 1.0 / second
        xy = -u * yy
        xx = r - u * xy
        row.inverse_xx, row.inverse_xy, row.inverse_yy = xx, xy, yy
        for n in range(row.first_below, row.last_below):
            G = p.blocks[n]
            G.L_xx, G.L_xy = G.xx * xx + G.xy * xy, G.xx * xy + G.xy * yy
            G.L_yx, G.L_yy = G.yx * xx + G.yy * xy, G.yx * xy + G.yy * yy
        for n in range(row.first_update, row.last_update):
            update = p.updates[n]
            G, left, right = p.blocks[update.block], p.blocks[update.i], p.blocks[update.j]
            G.xx -= left.L_xx * right.xx + left.L_xy * right.xy
            G.xy -= left.L_xx * right.yx + left.L_xy * right.yy
            G.yx -= left.L_yx * right.xx + left.L_yy * right.xy
            G.yy -= left.L_yx * right.yx + left.L_yy * right.yy
    return ok


@inlined
def solve(p: Plan) -> None:
    """Overwrite the rows' z with the solution of [B][M]^-1[B]^T x = z."""
    for k in range(len(p.rows)):
        row = p.rows[k]
        for n in range(row.first_below, row.last_below):
            L = p.blocks[n]
            below = p.rows[L.row]
            below.z_x -= L.L_xx * row.z_x + L.L_xy * row.z_y
            below.z_y -= L.L_yx * row.z_x + L.L_yy * row.z_y
    for k in range(len(p.rows) - 1, -1, -1):
        row = p.rows[k]
        x = row.inverse_xx * row.z_x + row.inverse_xy * row.z_y
        y = row.inverse_xy * row.z_x + row.inverse_yy * row.z_y
        for n in range(row.first_below, row.last_below):
            L = p.blocks[n]
            below = p.rows[L.row]
            x -= L.L_xx * below.z_x + L.L_yx * below.z_y
            y -= L.L_xy * below.z_x + L.L_yy * below.z_y
        row.z_x, row.z_y = x, y


@inlined
def add_rows(p: Plan, scale: float, x: FloatArray) -> None:
    """Add scale times [B]x to z."""
    for e in range(len(p.ends)):
        end = p.ends[e]
        row, c = p.rows[end.row], 3 * end.body
        row.z_x += scale * (end.xx * x[c] + end.xy * x[c + 1] + end.w_x * x[c + 2])
        row.z_y += scale * (end.yx * x[c] + end.yy * x[c + 1] + end.w_y * x[c + 2])


@inlined
def add_forces(p: Plan, scale: float, x: FloatArray) -> None:
    """Add scale times [M]^-1[B]^T z to x."""
    for e in range(len(p.ends)):
        end = p.ends[e]
        row, body, c = p.rows[end.row], p.bodies[end.body], 3 * end.body
        x[c] += scale * body.inverse_mass * (end.xx * row.z_x + end.yx * row.z_y)
        x[c + 1] += scale * body.inverse_mass * (end.xy * row.z_x + end.yy * row.z_y)
        x[c + 2] += scale * body.inverse_inertia * (end.w_x * row.z_x + end.w_y * row.z_y)


@inlined
def add_violation(p: Plan, scale: float, t: float, q: FloatArray) -> None:
    """Add scale times {g} to z."""
    for k in range(len(p.rows)):
        row = p.rows[k]
        row.z_x += scale * (row.d_x - row.C * t)
        row.z_y += scale * row.d_y
    for e in range(len(p.ends)):
        end = p.ends[e]
        row, c = p.rows[end.row], 3 * end.body
        row.z_x += scale * (end.xx * q[c] + end.xy * q[c + 1] + end.w0_x * q[c + 2] + end.arm_x)
        row.z_y += scale * (end.yx * q[c] + end.yy * q[c + 1] + end.w0_y * q[c + 2] + end.arm_y)


@inlined
def keep_weights(p: Plan) -> None:
    """Keep z as the weights of ``weighed``."""
    for k in range(len(p.rows)):
        row = p.rows[k]
        row.weight_x, row.weight_y = row.z_x, row.z_y


@inlined
def weighed(p: Plan) -> float:
    """Return the sum of z times the weights kept."""
    sum_ = 0.0
    for k in range(len(p.rows)):
        row = p.rows[k]
        sum_ += row.z_x * row.weight_x + row.z_y * row.weight_y
    return sum_


@inlined
def start_rows(p: Plan, of_C: float) -> None:
    """Overwrite z with C times a factor."""
    for k in range(len(p.rows)):
        row = p.rows[k]
        row.z_x, row.z_y = of_C * row.C, 0.0


@inlined
def add_springs(p: Plan, q: FloatArray, v: FloatArray, a: FloatArray) -> None:
    """Add [M]^-1{F} of the springs and dampers to the accelerations a."""
    for n in range(len(p.springs)):
        s = p.springs[n]
        i, j, at_i, at_j = 3 * s.body_i, 3 * s.body_j, p.bodies[s.body_i], p.bodies[s.body_j]
        x_i, y_i = at_i.cos * s.x_i - at_i.sin * s.y_i, at_i.sin * s.x_i + at_i.cos * s.y_i
        x_j, y_j = at_j.cos * s.x_j - at_j.sin * s.y_j, at_j.sin * s.x_j + at_j.cos * s.y_j
        x, y = q[j] + x_j - q[i] - x_i, q[j + 1] + y_j - q[i + 1] - y_i
        x_rate = v[j] - v[j + 2] * y_j - v[i] + v[i + 2] * y_i
        y_rate = v[j + 1] + v[j + 2] * x_j - v[i + 1] - v[i + 2] * x_i
        length = sqrt(x * x + y * y)
        tension = s.stiffness * (length - s.free_length) + s.damping * (x * x_rate + y * y_rate) / length
        x, y = tension / length * x, tension / length * y
        a[i] += at_i.inverse_mass * x
        a[i + 1] += at_i.inverse_mass * y
        a[i + 2] += at_i.inverse_inertia * (x_i * y - y_i * x)
        a[j] -= at_j.inverse_mass * x
        a[j + 1] -= at_j.inverse_mass * y
        a[j + 2] -= at_j.inverse_inertia * (x_j * y - y_j * x)


@inlined
def accelerations(p: Plan, t: float, q: FloatArray, v: FloatArray, a: FloatArray) -> bool:
    """Write {A} to a and {lambda} to the rows' z, (3)-(10); return whether the pivots are sound."""
    turn(p, q)
    for c in range(len(a)):
        a[c] = p.free[c]
    add_springs(p, q, v, a)
    start_rows(p, p.two_alpha)
    for e in range(len(p.ends)):
        end = p.ends[e]
        row, rate = p.rows[end.row], v[3 * end.body + 2]
        row.z_x += rate * rate * end.arm_x
        row.z_y += rate * rate * end.arm_y
    add_rows(p, -1.0, a)
    if p.two_alpha != 0.0:
        add_rows(p, -p.two_alpha, v)
    if p.beta_squared != 0.0:
        add_violation(p, -p.beta_squared, t, q)
    ok = factor(p)
    solve(p)
    add_forces(p, 1.0, a)
    return ok


@inlined
def feedback_power(p: Plan, t: float, q: FloatArray, v: FloatArray) -> float:
    """Return ``Equations.feedback_power`` at the state of the last ``accelerations``, overwriting z."""
    start_rows(p, -p.two_alpha)
    add_rows(p, p.two_alpha, v)
    add_violation(p, p.beta_squared, t, q)
    keep_weights(p)
    start_rows(p, -1.0)
    add_rows(p, 1.0, v)
    solve(p)
    return weighed(p)


@inlined
def copy(source: FloatArray, target: FloatArray) -> None:
    """Overwrite the leading entries of the target; a slice would take Numba seconds to compile."""
    for c in range(min(len(source), len(target))):
        target[c] = source[c]


@inlined
def project(
    p: Plan, t: float, q: FloatArray, v: FloatArray, a: FloatArray, rest: FloatArray
) -> tuple[bool, float]:
    """Move q by one Newton step, then v exactly, onto the constraints; return as ``accelerations``.

    Returned with it is the energy removed (see ``readable.project_with_loss``). ``a`` is room of the size of
    q, ``rest`` holds zeros.
    """
    turn(p, q)
    for c in range(len(a)):
        a[c] = p.free[c]
    add_springs(p, q, rest, a)
    start_rows(p, 0.0)
    add_rows(p, -1.0, a)
    keep_weights(p)
    start_rows(p, 0.0)
    add_violation(p, 1.0, t, q)
    ok = factor(p)
    solve(p)
    removed = weighed(p)
    add_forces(p, -1.0, q)
    turn(p, q)
    start_rows(p, -1.0)
    add_rows(p, 1.0, v)
    ok &= factor(p)
    solve(p)
    copy(v, a)
    add_forces(p, -1.0, v)
    for b in range(len(p.bodies) - 1):
        x, y, phi = 3 * b, 3 * b + 1, 3 * b + 2
        straight = (a[x] - v[x]) * (a[x] + v[x]) + (a[y] - v[y]) * (a[y] + v[y])
        removed += 0.5 * straight / p.bodies[b].inverse_mass
        removed += 0.5 * (a[phi] - v[phi]) * (a[phi] + v[phi]) / p.bodies[b].inverse_inertia
    return ok, removed


@inlined
def add_mean(
    state: FloatArray, h: float, sixfold_mean: FloatArray, lost: FloatArray, new: FloatArray
) -> None:
    """Write new = state + h mean with the rounding carried on to the next step (Kahan 1965)."""
    for c in range(len(state)):
        change = h / 6.0 * sixfold_mean[c] + lost[c]
        new[c] = state[c] + change
        lost[c] = change - (new[c] - state[c])


@compiled
def advance(
    p: Plan, q: FloatArray, v: FloatArray, h: float, first: int, count: int, projected: bool
) -> tuple[int, float, float]:
    """Take RK4 steps number first to first + count - 1 in place.

    Returns how many, the drivers' work, and the energy that the stabilisation has removed. Fewer than
    ``count`` mean that the step begun from the state left in q and v met a singular configuration or
    overflowed.
    """
    n = len(q) + 3
    q_now, x, x_mean, x_lost, rest = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    v_now, y, y_mean, y_lost, a = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    copy(q, q_now)
    copy(v, v_now)
    done, work, removed = 0, 0.0, 0.0
    while done < count:
        t, ok, power, loss = (first + done) * h, True, 0.0, 0.0
        for c in range(n):
            x[c], y[c], x_mean[c], y_mean[c] = q_now[c], v_now[c], 0.0, 0.0
        for k in range(4):
            weight, ahead = WEIGHT[k], AHEAD[k] * h
            ok &= accelerations(p, t + TIME[k] * h, x, y, a)
            for driver in p.drivers:
                power += weight * p.rows[driver].C * p.rows[driver].z_x
            if k == 0 and (p.two_alpha != 0.0 or p.beta_squared != 0.0):
                loss = h * feedback_power(p, t, x, y)
            for c in range(n):
                x_mean[c] += weight * y[c]
                y_mean[c] += weight * a[c]
                x[c], y[c] = q_now[c] + ahead * y[c], v_now[c] + ahead * a[c]
        add_mean(q_now, h, x_mean, x_lost, x)
        add_mean(v_now, h, y_mean, y_lost, y)
        if projected:
            held, loss = project(p, t + h, x, y, a, rest)
            ok &= held
        if not ok:
            break
        copy(x, q_now)
        copy(y, v_now)
        work += h / 6.0 * power
        removed += loss
        done += 1
    copy(q_now, q)
    copy(v_now, v)
    return done, work, removed


@compiled
def multipliers(p: Plan, t: float, q: FloatArray, v: FloatArray) -> bool:
    """Write {lambda} at a state to the rows' z; return whether the pivots are sound."""
    n = len(q) + 3
    x, y, a = np.zeros(n), np.zeros(n), np.zeros(n)
    copy(q, x)
    copy(v, y)
    return accelerations(p, t, x, y, a)
