"""The loop that steps a Pymunk space and reads it, compiled: no Python between two steps."""

import math

from numba.extending import register_jitable

from engine_models.kernels import compiled
from engine_models.pymunk.compiled.chipmunk import INNER, OPTIONS, read, set_sweeps, space_step, write
from engine_models.pymunk.compiled.compliant_contact import push
from engine_models.pymunk.compiled.loads import add_line, add_spring, add_torque, hold
from engine_models.pymunk.compiled.pin import enter_means, locate, touches_within
from engine_models.pymunk.compiled.records import CONTACT, LOST

#: Kicks that have the full number of sweeps (see ``stepping``), and are read.
START_KICKS = 6
#: Steps of flight before a touch that are short: a joint answers to a change of the step for two of them.
AHEAD = 2.0
#: How many times shorter a step may be than the one before it. Joints close in it what the longer one has
#: left open, at a speed that grows with this ratio; at 30 they shake pins against their walls.
AT_ONCE = 8.0
#: Room for rounding where a time is divided into steps, as a part of one.
ROOM = 1e-6


@compiled(**OPTIONS)
def advance(
    run, bodies, state, before, at, loads, turn, held, lines, torques, springs, curves, pieces, pins, kicks,
    turns, rows, out,
):  # fmt: skip
    """Take the kicks of a run (1,) up to the last of a block or the run's end, or until a pin is lost.

    ``state`` (bodies + 1,), ``loads`` (bodies + 1,) and ``turn`` (2 or 4,) are the buffers of its space;
    ``before`` and ``at`` (bodies + 1,) have the velocities of the kick before, and the state that loads which
    feel velocities are given. ``held`` (bodies,) tells how the space has each body. ``lines``, ``torques``
    and ``springs`` are the loads, with the ``pieces`` (n, 5) of their ``curves``; ``pins`` (p,) are its
    contacts, and ``kicks`` (p, kicks) their logs. Of every kick ``turns`` (kicks, 2 or 4) has angle and speed
    of the driven body before the step, or its place and velocity; none where the space knows them. Of those
    kicks that are read ``rows`` (n,) get the times, and ``out`` (n, bodies, 9) positions, velocities before
    and velocities after.
    """
    of = run[0]
    varies, first = of.per_sample == 0, of.kick + 1
    followed, driven = bodies[: of.followed], bodies[of.driven : of.driven + 1]
    read(bodies, of.io.state)
    while of.kick < of.last and not (of.kick >= of.end and of.kick >= START_KICKS - 1):
        of.kick += 1
        if of.kick == START_KICKS:
            set_sweeps(of.io.space, of.contact_sweeps if of.touching > 0 else of.flight_sweeps)
        drift_s = of.step_s if of.kick > 0 else 0.0
        sample = _arrive(of, drift_s)
        reading = sample or _is_read(of, of.kick)
        if reading:
            _enter_velocities(out, of.row, 3, state)
        if len(turns) > 0:
            for k in range(len(turn)):
                turn[k] = turns[of.kick - first, k]
            write(driven, of.io.turn)
            _enter_turn(state[of.driven], turn)
        _move(of, state, drift_s)
        if of.feels:
            _foresee(of, state, before, at, drift_s)
        touching = _locate_all(pins, state)
        next_s = _next_step(of, pins, state) if varies else of.flight_s
        kick_s = (drift_s + next_s) / 2
        step_s = drift_s if of.kick > 0 else kick_s
        # A step kicks for as long as it moves; loads are to act for as long as from its middle to the next's.
        share = kick_s / step_s if abs(next_s - drift_s) > ROOM * next_s else 1.0
        if of.loaded > 0 or touching or share != 1.0:
            changed = of.followed if touching else of.loaded
            changed = len(bodies) if share != 1.0 else changed
            _clear(loads)
            felt = at if of.feels else state
            _add_loads(of, state, felt, loads, lines, torques, springs, curves, pieces)
            _push_all(of, pins, state, loads, kick_s, kicks)
            hold(held[:changed], state, loads, share)
            write(bodies[:changed], of.io.loads)
        if _any_lost(pins):
            return
        if of.kick > 0 or of.half_kick_start:
            space_step(of.io.space, step_s)
        all_next = _is_read(of, of.kick + 1) or (varies and of.leads)
        read(bodies if reading or all_next else followed, of.io.state)
        if _any_lost(pins):
            return
        if touching:
            _finish_all(pins, state, kicks)
        if reading:
            _enter_velocities(out, of.row, 6, state)
            _enter_row(of, rows[of.row], out, state, kick_s, sample)
            of.row += 1
        of.step_s, of.kick_s = next_s, kick_s


@register_jitable(**INNER)
def _enter_turn(body, turn):
    """Set what a driven body has been given: angle and speed, or place and velocity."""
    if len(turn) == 2:
        body.phi, body.spin = turn[0], turn[1]
    else:
        body.x, body.y, body.v_x, body.v_y = turn[0], turn[1], turn[2], turn[3]


@register_jitable(**INNER)
def _move(of, state, drift_s):
    """Move the followed bodies to where the step will have moved them."""
    for b in range(of.followed):
        body = state[b]
        body.x += body.v_x * drift_s
        body.y += body.v_y * drift_s
        body.phi += body.spin * drift_s


@register_jitable(**INNER)
def _foresee(of, state, before, at, drift_s):
    """Set the state in which the followed bodies, once they are moved, are kicked.

    Their velocity then is the one of half a step before and half of what the last kick changed, as those
    half a step after are not known yet. Without half a kick at the start it is the one that a user reads.
    """
    on = drift_s / (2 * of.kick_s) if of.kick > 0 and of.half_kick_start else 0.0
    for b in range(of.followed):
        now, old, then = state[b], before[b], at[b]
        then.x, then.y, then.phi = now.x, now.y, now.phi
        then.v_x, then.v_y = now.v_x + on * (now.v_x - old.v_x), now.v_y + on * (now.v_y - old.v_y)
        then.spin = now.spin + on * (now.spin - old.spin)
        old.v_x, old.v_y, old.spin = now.v_x, now.v_y, now.spin


@register_jitable(**INNER)
def _add_loads(of, state, felt, loads, lines, torques, springs, curves, pieces):
    """Add the loads of the mechanism, its drive's torque among them, with the velocities that each feels."""
    time_s = of.clock_s + of.time_s
    for n in range(len(lines)):
        add_line(lines[n], state if lines[n].own else felt, loads, curves, pieces, time_s)
    for n in range(len(torques)):
        add_torque(torques[n], state if torques[n].own else felt, loads, curves, pieces, time_s)
    for n in range(len(springs)):
        add_spring(springs[n], felt, loads)


@register_jitable(**INNER)
def _arrive(of, step_s):
    """Set the time of a run's kick after a step; return whether it is that of a sample."""
    if of.per_sample > 0:
        of.time_s = of.kick * of.flight_s
        return of.kick <= of.end and of.kick % of.per_sample == 0
    if of.kick > 0 and not of.leads:
        of.time_s += step_s
        return False
    of.time_s = of.next_sample * of.interval_s
    if of.next_sample == of.samples:
        of.end = of.kick
    of.next_sample += 1
    return of.kick <= of.end


@register_jitable(**INNER)
def _is_read(of, kick):
    """Return whether a kick's state is read, sample or not."""
    return kick < START_KICKS or (of.every > 0 and kick % of.every == 0)


@register_jitable(**INNER)
def _next_step(of, pins, state):
    """Return the step after a kick with all pins located, and set whether it leads to a sample."""
    longest = of.flight_s
    for p in range(len(pins)):
        if touches_within(pins[p], state[pins[p].bearing], state[pins[p].pin], AHEAD * of.flight_s):
            longest = max(of.contact_s, of.step_s / AT_ONCE)
    rest = of.next_sample * of.interval_s - of.time_s
    steps = max(1.0, math.ceil(rest / longest - ROOM))
    of.leads = steps == 1.0
    return rest / steps


@register_jitable(**INNER)
def _enter_velocities(out, row, column, state):
    for b in range(out.shape[1]):
        out[row, b, column], out[row, b, column + 1] = state[b].v_x, state[b].v_y
        out[row, b, column + 2] = state[b].spin


@register_jitable(**INNER)
def _clear(loads):
    for b in range(len(loads)):
        loads[b].x = loads[b].y = loads[b].torque = 0.0


@register_jitable(**INNER)
def _locate_all(pins, state):
    """Locate the pins of compliant contacts; return whether one touches."""
    touching = False
    for p in range(len(pins)):
        if not pins[p].native and locate(pins[p], state[pins[p].bearing], state[pins[p].pin]):
            touching = True
    return touching


@register_jitable(**INNER)
def _push_all(of, pins, state, loads, kick_s, kicks):
    """Add the forces of the compliant contacts to the loads."""
    for p in range(len(pins)):
        contact = pins[p]
        if contact.phase == CONTACT and not contact.native:
            entry = kicks[p, contact.kicks]
            push(contact, state, loads, kick_s, entry)
            entry.step, entry.time_s = of.kick, of.time_s
            contact.kicks += 1


@register_jitable(**INNER)
def _enter_row(of, row, out, state, kick_s, sample):
    """Enter the times of a kick, and the positions at it."""
    row.kick, row.time_s, row.step_s, row.kick_s = of.kick, of.time_s, of.step_s, kick_s
    row.sample = sample
    row.kept = sample or (of.kick <= of.end and of.every > 0 and of.kick % of.every == 0)
    for b in range(out.shape[1]):
        out[of.row, b, 0], out[of.row, b, 1], out[of.row, b, 2] = state[b].x, state[b].y, state[b].phi


@register_jitable(**INNER)
def _finish_all(pins, state, kicks):
    for p in range(len(pins)):
        contact = pins[p]
        if contact.phase == CONTACT and not contact.native:
            enter_means(contact, state[contact.bearing], state[contact.pin], kicks[p, contact.kicks - 1])


@register_jitable(**INNER)
def _any_lost(pins):
    lost = False
    for p in range(len(pins)):
        lost = lost or pins[p].phase >= LOST
    return lost


def stay(_body, _step_s):
    """Leave a body where it is: the position update of a step that only kicks."""
