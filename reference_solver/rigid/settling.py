"""What becomes of the pins that touch their walls at one time: they hit, and then follow or leave.

* Impact (``rigid.impact``): of the pins that touch within round-off those that come or rest take part at
  once, and rub; two that hit at different times, however close, do so one after the other. Two that hit in
  turns ever faster, each thrown out by the other's impact, go on at one time when round-off hides the
  distances in between: their speeds fall more slowly.
* Closing: an impact has e = 0 if the next flight would be too short, or its approach is below the joint's
  minimum. Too short is 2 v+/a below ``shortest_s``, or v+^2/2a within round-off of the distance, with
  a the acceleration towards the wall. A pin on its wall that another's impact throws off for as short a
  flight is kept there: normal speeds are projected out, which takes energy too. So rapidly converging bounces
  (Zeno), of one joint or of several in turns, end; the energy this takes is a line of its own in the ledger.
  What friction does in the bounces left out is done at once: the error is of second order in their speed.
* Following or leaving: pins on the wall without normal speed are sorted by the complementarity of
  accelerations and normal forces (Pfeiffer and Glocker 1996). Friction is part of the accelerations: its law
  is regularised, so that at the given speeds it is a given part of each normal force. Then
  a_n = b + (W_nn - W_nt diag(mu f)) F_n, and one set of forces fits as long as all principal minors of this
  matrix are positive; otherwise there is Painleve's paradox.

Numba compiles this module as it stands, once for all mechanisms; without Numba it runs too, as the readable
face does. Functions return whether they could do what they are for; else ``control`` has the fault.
"""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from reference_solver.contact import types
from reference_solver.contact.loop import INNER
from reference_solver.contact.wall_friction import LEAST_MOBILITY
from reference_solver.machine_code import call
from reference_solver.rigid import complementarity
from reference_solver.rigid.impact import Hit, find_impulses
from reference_solver.rigid.walls import Walls
from reference_solver.tape import FloatArray, RecordArray

#: A contact row that is this small a part of itself once the ideal joints are eliminated depends on them.
DEPENDENT = 1e-12
#: Impacts at one time, of pins that hit in turns, after which all that touch take part in one.
MOST_IN_TURNS = 100
#: Rows of the log that an event may need for each pin.
ROWS_OF_EVENT = MOST_IN_TURNS + 1
#: Flights that are as high as so many times the distance's round-off take sqrt(2 x 4 x height/a).
FLIGHT = 8.0
#: What an impact on a wall may be (see ``contact.types.Impact``), by its number in the log.
KINDS = ("impact", "closing", "support")
IMPACT, CLOSING, SUPPORT = range(3)
#: Why pins do not settle: a singular position, an impact that is blocked, and Painleve's paradox.
NONE, SINGULAR, BLOCKED, PARADOX, UNSETTLED = range(5)
#: Rows of vectors: velocities before an impact, and before what friction does in bounces that are left out;
#: accelerations with the pins that are pressed, and with those that follow, or fly, instead of bouncing;
#: velocities after these.
BEFORE, START, PUSHED, FOLLOWING, FLYING, AFTER = range(6)
ROWS = 6

#: A flight shorter than so many seconds, or no higher than ``lowest`` times the distance's round-off, is not
#: followed; half of that tells pins that touch at one time from others. The rest counts: impacts in the log,
#: events settled, and those at one time; why there is no way on; whether gaps are of another kernel, and
#: whether a call is to settle alone; the address of ``walls`` of a kernel without pins that follow, and of
#: what it is called with.
CONTROL_RECORD = types.record("shortest_s lowest", "logged settled at_once fault stale alone look p numbers")
#: An impact in the log (see ``contact.types.Impact``).
IMPACT_RECORD = types.record("time_s approach normal tangential lost mass", "contact kind")


class Settling(NamedTuple):
    """What pins settle by: the walls, and memory.

    ``active`` (S,) are rows of the walls, ``vectors`` have n places each, ``plain`` (R, R) is a matrix.
    """

    walls: Walls
    hit: Hit
    control: RecordArray
    log: RecordArray
    active: Any
    vectors: FloatArray
    plain: FloatArray


@register_jitable
def settling_of(parts):
    """Return what pins settle by, of plain tuples (see ``contact.types.plain``)."""
    (numbers, of_joints, rows, motion, mobility, drivers, free, joints), of_hit = parts[0], parts[1]
    walls = Walls(numbers, of_joints, rows, motion, mobility, drivers, free, joints)
    W, u, restitution, friction, tangent, impulse, rubbed, trial, after, room = of_hit
    hit = Hit(W, u, restitution, friction, tangent, impulse, rubbed, trial, after, room)
    return Settling(walls, hit, parts[2], parts[3], parts[4], parts[5], parts[6])


@register_jitable(**INNER)
def refuse(s, fault):
    """Note a fault; return False."""
    s.control[0].fault = fault
    return False


@register_jitable(**INNER)
def look(clock, s):
    """Set the walls at a state; return whether it could.

    The round-off of speeds that have come out of faster ones is that of the fastest.
    """
    now, control = clock[0], s.control[0]
    if not call(control.look, control.p, now.contacts, now.time, now.old, control.numbers) < np.inf:
        return refuse(s, SINGULAR)
    for j in range(len(s.walls.joints)):
        joint, at = s.walls.joints[j], s.walls.of_joints[j]
        joint.distance, joint.rate, joint.turning, joint.noise = at[0], at[1], at[2], at[3]
        joint.rate_noise, joint.bare, joint.share = at[4], at[5], at[6]
        joint.rate_noise = joint.fastest_noise = max(joint.rate_noise, joint.fastest_noise)
    return True


@register_jitable(**INNER)
def along(row, vector):
    """Return the sum of products of a row's entries and a vector's."""
    total = 0.0
    for c in range(len(row)):
        total += row[c] * vector[c]
    return total


@register_jitable(**INNER)
def add(vector, factor, row):
    """Add a multiple of a row to a vector."""
    for c in range(len(row)):
        vector[c] += factor * row[c]


@register_jitable(**INNER)
def copy(source, vector):
    """Copy the first numbers of a vector."""
    for c in range(len(source)):
        vector[c] = source[c]


@register_jitable(**INNER)
def rests(joint):
    """Return whether a pin has no normal speed but round-off."""
    return abs(joint.rate) <= joint.rate_noise


@register_jitable(**INNER)
def gather(s):
    """List the rows of the chosen joints; return how many normals, and with tangents that rub; -1 if blocked.

    The hit gets their mobilities, and what of a joint belongs to it.
    """
    joints, W, active, hit, k = s.walls.joints, s.walls.mobility, s.active, s.hit, 0
    for j in range(len(joints)):
        if joints[j].chosen != 0:
            if W[j, j] < DEPENDENT * joints[j].bare:
                refuse(s, BLOCKED)
                return -1, -1
            active[k], k = j, k + 1
    m = k
    for i in range(k):
        joint = joints[active[i]]
        hit.restitution[i], hit.friction[i], hit.tangent[i] = joint.wanted, joint.coefficient, -1
        if joint.coefficient > 0.0:
            hit.tangent[i], active[m], m = m, joint.tangent, m + 1
    for i in range(m):
        for j in range(m):
            hit.W[i, j] = W[active[i], active[j]]
    return k, m


# ----------------------------------------------------------------------------------- impacts


@register_jitable(**INNER)
def collide(s, v):
    """Change velocities v by the impact of the chosen joints; their impulses and losses are left in them."""
    k, m = gather(s)
    if k < 0:
        return False
    walls, hit = s.walls, s.hit
    for i in range(m):
        hit.u[i] = along(walls.rows[s.active[i]], v)
    find_impulses(hit, k, m)
    for i in range(m):
        add(v, hit.impulse[i], walls.motion[s.active[i]])
    for i in range(k):
        joint, row = walls.joints[s.active[i]], hit.tangent[i]
        joint.normal, joint.lost = hit.impulse[i], lost_by(hit, i, m)
        joint.tangential = 0.0
        if row >= 0:
            joint.tangential = hit.impulse[row]
            joint.lost += lost_by(hit, row, m)
    return True


@register_jitable(**INNER)
def lost_by(hit, i, m):
    """Return what an impulse takes: it times the mean of the speeds along its row before and after."""
    mean = hit.u[i]
    for j in range(m):
        mean += 0.5 * hit.W[i, j] * hit.impulse[j]
    return -(hit.impulse[i] * mean)


@register_jitable(**INNER)
def press(s, pushed):
    """Set the walls' inward forces on the chosen joints, which have no normal speed, and accelerations."""
    walls, hit, joints = s.walls, s.hit, s.walls.joints
    copy(walls.free, pushed)
    for j in range(len(joints)):
        joints[j].force = 0.0
    k, _ = gather(s)
    if k < 1:
        return k == 0
    rubs = False
    for i in range(k):
        one = s.active[i]
        hit.u[i] = along(walls.rows[one], walls.free) - joints[one].turning
        for j in range(k):
            other = s.active[j]
            s.plain[i, j] = walls.mobility[one, other]
            hit.W[i, j] = s.plain[i, j]
            if joints[other].share != 0.0:
                hit.W[i, j] -= joints[other].share * walls.mobility[one, joints[other].tangent]
                rubs = True
    if rubs and complementarity.least_minor_ratio(hit.W, s.plain, k, hit.room) <= LEAST_MOBILITY:
        return refuse(s, PARADOX)
    complementarity.complementary(hit.W, hit.u, k, hit.impulse, hit.trial, hit.room)
    for i in range(k):
        one, force = s.active[i], hit.impulse[i]
        joints[one].force = force
        add(pushed, force, walls.motion[one])
        if joints[one].share != 0.0:
            add(pushed, -joints[one].share * force, walls.motion[joints[one].tangent])
    return True


@register_jitable(**INNER)
def find_short(s):
    """Note of all joints whether their pins, leaving their walls, would be back too soon."""
    joints, pushed, control = s.walls.joints, s.vectors[PUSHED], s.control[0]
    for j in range(len(joints)):
        joints[j].chosen = joints[j].takes_part != 0 and rests(joints[j])
    if not press(s, pushed):
        return False
    for j in range(len(joints)):
        joint = joints[j]
        outward = joint.turning - along(s.walls.rows[j], pushed)
        shortest = control.shortest_s * outward
        shortest = max(shortest, np.sqrt(FLIGHT * control.lowest * joint.noise * max(outward, 0.0)))
        joint.short = outward > 0.0 and 2.0 * max(-joint.rate, 0.0) < shortest
    return True


@register_jitable(**INNER)
def hit_together(clock, state, s):
    """Have the joints that take part hit, and enter the impulses in the log and in the ledger."""
    v, joints, start, again = state.y[state.n : 2 * state.n], s.walls.joints, s.vectors[BEFORE], False
    copy(v, start)
    for j in range(len(joints)):
        joint = joints[j]
        joint.chosen = joint.takes_part
        joint.approach, joint.leaving, joint.closes = joint.rate, 0.0, 0
        joint.wanted = joint.restitution if joint.hits != 0 else 0.0
    if not (collide(s, v) and look(clock, s) and find_short(s)):
        return False
    for j in range(len(joints)):
        joint = joints[j]
        joint.chosen = joint.takes_part
        if joint.takes_part != 0 and joint.hits != 0 and joint.restitution > 0.0:
            slow = joint.approach < joint.slowest
            if slow or joint.short != 0:
                joint.closes, joint.wanted, again = 1, 0.0, True
                joint.leaving = 0.0 if slow else max(-joint.rate, 0.0)
    if again:
        copy(start, v)
        if not (collide(s, v) and look(clock, s) and find_short(s)):
            return False
    enter(clock[0].time, state, s)
    return catch(clock, state, s) and make_up_for_bounces(clock, state, s)


@register_jitable(**INNER)
def enter(t, state, s):
    """Enter the impulses of the joints that take part in the log and in the ledger."""
    sums = state.y[2 * state.n :]
    for j in range(len(s.walls.joints)):
        joint = s.walls.joints[j]
        if joint.takes_part == 0:
            continue
        sums[0] += s.walls.drivers[j] * joint.normal
        if joint.tangent >= 0:
            sums[0] += s.walls.drivers[joint.tangent] * joint.tangential
        kind = CLOSING if joint.closes != 0 else IMPACT if joint.hits != 0 else SUPPORT
        sums[joint.column] += joint.normal
        sums[joint.column + (2 if kind == CLOSING else 1)] += joint.lost
        if joint.normal != 0.0:
            entry = s.log[s.control[0].logged]
            entry.time_s, entry.contact, entry.kind, entry.approach = t, joint.contact, kind, joint.approach
            entry.normal, entry.tangential, entry.lost = joint.normal, joint.tangential, joint.lost
            entry.mass = 1.0 / s.walls.mobility[j, j]
            s.control[0].logged += 1


@register_jitable(**INNER)
def change_speeds(state, s, k, m):
    """Change v by the impulses along the active rows that change speeds along them by the hit's u.

    The ledger gets what they are and lose.
    """
    v, sums, hit, joints = state.y[state.n : 2 * state.n], state.y[2 * state.n :], s.hit, s.walls.joints
    for i in range(m):
        hit.room[i, m] = hit.u[i]
        for j in range(m):
            hit.room[i, j] = hit.W[i, j]
    complementarity.solve(hit.room, m, hit.impulse)
    for i in range(m):
        hit.after[i] = along(s.walls.rows[s.active[i]], v)
        add(v, hit.impulse[i], s.walls.motion[s.active[i]])
    for i in range(k):
        column, row = joints[s.active[i]].column, hit.tangent[i]
        sums[column] += hit.impulse[i]
        sums[column + 2] -= hit.impulse[i] * (hit.after[i] + 0.5 * hit.u[i])
        if row >= 0:
            sums[column + 2] -= hit.impulse[row] * (hit.after[row] + 0.5 * hit.u[row])
    for i in range(m):
        sums[0] += s.walls.drivers[s.active[i]] * hit.impulse[i]


@register_jitable(**INNER)
def catch(clock, state, s):
    """Keep pins on their walls that another's impact throws off for too short a flight."""
    joints, thrown = s.walls.joints, False
    for j in range(len(joints)):
        joint = joints[j]
        leaves = joint.takes_part != 0 and joint.rate < -joint.rate_noise and joint.short != 0
        if leaves:
            joint.leaving -= joint.rate
            thrown = True
        joint.chosen = leaves or (joint.takes_part != 0 and rests(joint))
    if not thrown:
        return True
    k, _ = gather(s)
    if k < 0:
        return False
    for i in range(k):
        s.hit.tangent[i] = -1
        s.hit.u[i] = -along(s.walls.rows[s.active[i]], state.y[state.n : 2 * state.n])
    change_speeds(state, s, k, k)
    return look(clock, s)


@register_jitable(**INNER)
def make_up_for_bounces(clock, state, s):
    """Change v by what friction does in bounces that are left out.

    Along the normal they give what following gives in as long a time. But impacts rub by all of Coulomb's
    coefficient, and hold a pin that has come to rest, where following rubs by the law's part at the sliding
    speed: a difference of the first order in the speed.
    """
    joints, rubs = s.walls.joints, False
    for j in range(len(joints)):
        rubs = rubs or (joints[j].takes_part != 0 and joints[j].coefficient > 0.0)
    if not rubs:
        return True
    for j in range(len(joints)):
        joint = joints[j]
        bounces = joint.takes_part != 0 and joint.leaving > 0.0 and joint.restitution < 1.0
        if bounces and not (rub_as_bounces(state, s, j) and look(clock, s)):
            return False
    return True


@register_jitable(**INNER)
def rub_as_bounces(state, s, j):
    """Change v by what friction does in the bounces of joint j.

    They last for T = 2 w/(a (1 - e)), w the speed at which the first one leaves. In that time a pin that
    flies is accelerated, and hits once with what has come together, or follows. Nothing where another wall
    loses its pin meanwhile.
    """
    walls, joints, hit, n, joint = s.walls, s.walls.joints, s.hit, state.n, s.walls.joints[j]
    v, after = state.y[n : 2 * n], s.vectors[AFTER]
    flying, following = s.vectors[FLYING], s.vectors[FOLLOWING]
    if not rests(joint):
        return True
    for i in range(len(joints)):
        joints[i].chosen, joints[i].wanted = joints[i].takes_part != 0 and rests(joints[i]), 0.0
    if not press(s, following):
        return False
    joint.chosen = 0
    if not press(s, flying):
        return False
    joint.chosen = 1
    outward = joint.turning - along(walls.rows[j], flying)
    if outward <= 0.0:
        return True
    restitution = joint.restitution if joint.leaving >= joint.slowest else 0.0
    lasting = 2.0 * joint.leaving / (outward * (1.0 - restitution))
    # Rows of normals turn with the pins: both ways end with speeds along those of now.
    k, m = gather(s)
    if k < 0:
        return False
    for i in range(k):
        hit.room[i, k] = -lasting * joints[s.active[i]].turning
        for other in range(k):
            hit.room[i, other] = hit.W[i, other]
    complementarity.solve(hit.room, k, hit.impulse)
    copy(v, after)
    for i in range(k):
        add(after, hit.impulse[i], walls.motion[s.active[i]])
    copy(after, s.vectors[START])
    add(after, lasting, flying)
    if not collide(s, after):
        return False
    for c in range(n):
        after[c] -= s.vectors[START, c] + lasting * following[c]
    for i in range(m):
        hit.u[i] = along(walls.rows[s.active[i]], after)
    for i in range(k):
        if abs(hit.u[i]) > joints[s.active[i]].rate_noise:
            return True
    change_speeds(state, s, k, m)
    return True


# ---------------------------------------------------------------------------------- settling


@register_jitable(**INNER)
def begin(contacts, s):
    """Find the joints whose pins touch their walls."""
    for j in range(len(s.walls.joints)):
        joint = s.walls.joints[j]
        contact = contacts[joint.contact]
        joint.follows = contact.phase != types.FLIGHT
        near = contact.clearance - 0.5 * s.control[0].lowest * joint.noise
        joint.touches = joint.follows != 0 or joint.distance >= near


@register_jitable(**INNER)
def find_hitting(joints):
    """Find the joints whose pins touch and come to their walls; return whether there are any."""
    found = False
    for j in range(len(joints)):
        joint = joints[j]
        joint.hits = joint.touches != 0 and joint.rate > joint.rate_noise and joint.follows == 0
        found = found or joint.hits != 0
    return found


@register_jitable(**INNER)
def settle(contacts, clock, state, s):
    """Let the pins that touch rigid walls hit, follow or leave.

    The clock has the time, and in ``rigid`` the contact whose event it is, or -1. Return GO where the same
    pins follow as before, SETTLE where others do, REFUSED where there is no way on.
    """
    now, joints, turns, moved = clock[0], s.walls.joints, 0, True
    touched = now.rigid
    released = touched if touched >= 0 and contacts[touched].phase != types.FLIGHT else -1
    for j in range(len(joints)):
        joints[j].fastest_noise = 0.0
    if not look(clock, s):
        return types.REFUSED
    begin(contacts, s)
    while find_hitting(joints) and turns <= MOST_IN_TURNS and moved:
        for j in range(len(joints)):
            joint = joints[j]
            comes = joint.rate >= -joint.rate_noise or turns == MOST_IN_TURNS
            joint.takes_part = joint.touches != 0 and comes
        if not hit_together(clock, state, s):
            return types.REFUSED
        turns, moved = turns + 1, False
        for c in range(state.n):
            moved = moved or state.y[state.n + c] != s.vectors[BEFORE, c]
        for j in range(len(joints)):
            joints[j].follows = joints[j].follows != 0 and rests(joints[j])
    for j in range(len(joints)):
        joint = joints[j]
        joint.chosen = joint.touches != 0 and rests(joint) and joint.contact != released
    if not press(s, s.vectors[PUSHED]):
        return types.REFUSED
    status = types.GO
    for j in range(len(joints)):
        joint = joints[j]
        contact, phase = contacts[joint.contact], types.CONTACT if joint.force > 0.0 else types.FLIGHT
        if contact.phase != phase:
            contact.phase, status = phase, types.SETTLE
        contact.noise, contact.rate_noise = joint.noise, joint.rate_noise
        if joint.contact == touched and released < 0 and turns == 0 and phase == types.FLIGHT:
            contact.ignored = 1.0
    return status
