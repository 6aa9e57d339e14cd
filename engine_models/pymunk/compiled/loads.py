"""The loads of a mechanism on the bodies of a space, compiled: along lines, torques, springs, and weights.

They are those of the positions to which a step will move the bodies, and as far as they depend on speeds, of
velocities that are foreseen for then.
"""

import math

from numba.extending import register_jitable

from engine_models.pymunk.compiled.chipmunk import INNER


@register_jitable(**INNER)
def turned(phi, x, y):
    """Return a vector of a body's axes in the global frame."""
    if x == 0.0 and y == 0.0:  # most places are at the origin and need no turning
        return 0.0, 0.0
    cos, sin = math.cos(phi), math.sin(phi)
    return cos * x - sin * y, sin * x + cos * y


@register_jitable(**INNER)
def apart(part, i, j):
    """Return the arms from two bodies' origins to a part's places on them, and the way between these."""
    a_x, a_y = turned(i.phi, part.x_i, part.y_i)
    b_x, b_y = turned(j.phi, part.x_j, part.y_j)
    return a_x, a_y, b_x, b_y, j.x - i.x - a_x + b_x, j.y - i.y - a_y + b_y


@register_jitable(**INNER)
def drift(i, j, a_x, a_y, b_x, b_y):
    """Return the velocity of a place of body j against one of body i, at these arms."""
    return j.v_x - j.spin * b_y - i.v_x + i.spin * a_y, j.v_y + j.spin * b_x - i.v_y - i.spin * a_x


@register_jitable(**INNER)
def push_at(load, arm_x, arm_y, f_x, f_y):
    """Add a force at an arm from a body's origin to its loads."""
    load.x += f_x
    load.y += f_y
    load.torque += arm_x * f_y - arm_y * f_x


@register_jitable(**INNER)
def value(curve, pieces, x):
    """Return the value of a curve at x.

    Its pieces (n, 5) have where they begin, and their coefficients, of the third power first.
    """
    low, high = curve.first, curve.first + curve.count
    if curve.period > 0.0:
        x = pieces[low, 0] + (x - pieces[low, 0]) % curve.period
    elif curve.keeps:
        x = min(max(x, pieces[low, 0]), curve.last)
    while high - low > 1:
        middle = (low + high) // 2
        if pieces[middle, 0] <= x:
            low = middle
        else:
            high = middle
    x -= pieces[low, 0]
    return ((pieces[low, 1] * x + pieces[low, 2]) * x + pieces[low, 3]) * x + pieces[low, 4]


# s = u.d, d = p_j - p_i, with u along the line and n across it: s' = u.d' + phi_i' n.d
@register_jitable(**INNER)
def add_line(line, at, loads, curves, pieces, time_s):
    """Add the forces of a load along its line; the opposite one acts on body i at the same place."""
    i, j = at[line.row_i], at[line.row_j]
    u_x, u_y = line.u_x, line.u_y
    if line.row_i < len(at) - 1:
        u_x, u_y = turned(i.phi, u_x, u_y)
    a_x, a_y, b_x, b_y, d_x, d_y = apart(line, i, j)
    rate_x, rate_y = drift(i, j, a_x, a_y, b_x, b_y)
    rate = u_x * rate_x + u_y * rate_y + i.spin * (u_x * d_y - u_y * d_x)
    force = line.force - line.viscous * rate - line.spring * (u_x * d_x + u_y * d_y - line.free)
    if line.gas >= 0:
        force += value(curves[line.gas], pieces, at[line.gas_row].phi)
    if line.by_time >= 0:
        force += value(curves[line.by_time], pieces, time_s)
    f_x, f_y = force * u_x, force * u_y
    push_at(loads[line.row_j], b_x, b_y, f_x, f_y)
    push_at(loads[line.row_i], a_x + d_x, a_y + d_y, -f_x, -f_y)


@register_jitable(**INNER)
def add_torque(of, at, loads, curves, pieces, time_s):
    """Add the torques of a load or a drive."""
    spin = at[of.row].spin
    torque = of.torque - of.viscous * spin
    if of.by_time >= 0:
        torque += value(curves[of.by_time], pieces, time_s)
    if of.by_speed >= 0:
        torque += value(curves[of.by_speed], pieces, spin)
    loads[of.row].torque += torque


@register_jitable(**INNER)
def add_spring(spring, at, loads):
    """Add the pull of a spring with a damper; one without a length has no direction, and no force."""
    i, j = at[spring.row_i], at[spring.row_j]
    a_x, a_y, b_x, b_y, d_x, d_y = apart(spring, i, j)
    length = math.hypot(d_x, d_y)
    if length == 0.0:
        return
    d_x, d_y = d_x / length, d_y / length
    rate_x, rate_y = drift(i, j, a_x, a_y, b_x, b_y)
    pull = spring.stiffness * (length - spring.free) + spring.damping * (d_x * rate_x + d_y * rate_y)
    push_at(loads[spring.row_j], b_x, b_y, -pull * d_x, -pull * d_y)
    push_at(loads[spring.row_i], a_x, a_y, pull * d_x, pull * d_y)


@register_jitable(**INNER)
def hold(held, at, loads, share):
    """Add weights that the space does not know, leave what acts along a runner's line, take gravity back.

    Loads act for another time than the step by ``share``; the space's gravity does not, so it is made up for.
    """
    for b in range(len(held)):
        own, load = held[b], loads[b]
        if own.lifted:
            c_x, c_y = turned(at[b].phi, own.centre_x, own.centre_y)
            push_at(load, c_x, c_y, own.weight_x, own.weight_y)
        if own.runs:
            along = own.u_x * load.x + own.u_y * load.y
            load.x, load.y = along * own.u_x, along * own.u_y
        if share != 1.0:
            load.x *= share
            load.y *= share
            load.torque *= share
            if not own.lifted:
                load.x += (share - 1.0) * own.weight_x
                load.y += (share - 1.0) * own.weight_y
        if own.lifted:
            load.x += own.lift_x
            load.y += own.lift_y
