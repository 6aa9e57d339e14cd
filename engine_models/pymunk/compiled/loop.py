"""The loop that steps a Pymunk space and reads it, compiled: no Python between two steps."""

import math

from numba.extending import register_jitable

from engine_models.mechanics import contact_law
from engine_models.pymunk.compiled import chipmunk, compliant_contact, pin, records
from engine_models.pymunk.compiled.chipmunk import INNER, OPTIONS, read, set_sweeps, space_step, write
from engine_models.pymunk.compiled.compliant_contact import push
from engine_models.pymunk.compiled.pin import enter_means, locate, touches_within
from engine_models.pymunk.compiled.records import CONTACT, LOST

#: Modules whose text the machine code has taken over, and the options that it is compiled with.
COMPILED_WITH = (chipmunk, compliant_contact, contact_law, pin, records)
__all__ = ["COMPILED_WITH", "OPTIONS", "START_KICKS", "advance", "gas_force", "stay"]

#: Kicks that have the full number of sweeps (see ``stepping``), and are read.
START_KICKS = 5
CRANK, SLIDER = 0, 2
#: Steps of flight before a touch that are short: a joint answers to a change of the step for two of them.
AHEAD = 2.0
#: How many times shorter a step may be than the one before it. Joints close in it what the longer one has
#: left open, at a speed that grows with this ratio; at 30 they shake pins against their walls.
AT_ONCE = 8.0
#: Room for rounding where a time is divided into steps, as a part of one.
ROOM = 1e-6


def advance(run, bodies, state, loads, turn, weights, pins, kicks, turns, gas, rows, out):
    """Take the kicks of a run (1,) up to the last of a block or the run's end, or until a pin is lost.

    ``state`` (bodies + 1,), ``loads`` (bodies + 1,) and ``turn`` (2,) are the buffers of its space,
    ``weights`` (bodies,) in N pull its bodies down; ``pins`` (p,) are its contacts, and ``kicks`` (p, kicks)
    their logs. Of every kick ``turns`` (kicks, 2) has the crank's angle before the step and its speed, none
    where the space knows them. ``gas`` (pieces, 5) is the slider's load by the crank's angle, see
    ``gas_force``. Of those kicks that are read ``rows`` (n,) get the times, and ``out`` (n, bodies, 9)
    positions, velocities before and velocities after.
    """
    of = run[0]
    loaded = of.torque_N_m != 0.0 or of.force_N != 0.0 or len(gas) > 0
    varies, first = of.per_sample == 0, of.kick + 1
    follows = varies or len(pins) > 0 or len(gas) > 0
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
            turn[0], turn[1] = turns[of.kick - first, 0], turns[of.kick - first, 1]
            write(bodies[:1], of.io.turn)
            state[CRANK].phi, state[CRANK].spin = turn[0], turn[1]
        _locate_all(pins, state, drift_s)
        next_s = _next_step(of, pins, state) if varies else of.flight_s
        kick_s = (drift_s + next_s) / 2
        step_s = drift_s if of.kick > 0 else kick_s
        # A step kicks for as long as it moves; loads are to act for as long as from its middle to the next's.
        share = kick_s / step_s if abs(next_s - drift_s) > ROOM * next_s else 1.0
        touching = _in_contact(pins)
        if loaded or touching or share != 1.0:
            _clear(of, loads)
            if len(gas) > 0:
                loads[SLIDER].x += gas_force(gas, state[CRANK].phi + drift_s * state[CRANK].spin)
            _push_all(of, pins, state, loads, kick_s, kicks)
            if share != 1.0:
                _stretch(loads, weights, share)
            write(bodies, of.io.loads)
        if _any_lost(pins):
            return
        if of.kick > 0 or of.half_kick_start:
            space_step(of.io.space, step_s)
        if follows or reading or _is_read(of, of.kick + 1):
            read(bodies, of.io.state)
        if _any_lost(pins):
            return
        if touching:
            _finish_all(pins, state, kicks)
        if reading:
            _enter_velocities(out, of.row, 6, state)
            _enter_row(of, rows[of.row], out, state, kick_s, sample)
            of.row += 1
        of.step_s = next_s


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
def gas_force(gas, angle):
    """Return the force in N at a crank angle from a periodic cubic spline.

    A row has where a piece begins, in rad, and its coefficients, of the third power first.
    """
    at = gas[0, 0] + (angle - gas[0, 0]) % (2 * math.pi)
    low, high = 0, len(gas)
    while high - low > 1:
        middle = (low + high) // 2
        if gas[middle, 0] <= at:
            low = middle
        else:
            high = middle
    x = at - gas[low, 0]
    return ((gas[low, 1] * x + gas[low, 2]) * x + gas[low, 3]) * x + gas[low, 4]


@register_jitable(**INNER)
def _enter_velocities(out, row, column, state):
    for b in range(out.shape[1]):
        out[row, b, column], out[row, b, column + 1] = state[b].v_x, state[b].v_y
        out[row, b, column + 2] = state[b].spin


@register_jitable(**INNER)
def _clear(of, loads):
    """Leave of the loads the constant ones."""
    for b in range(len(loads)):
        loads[b].x = loads[b].y = loads[b].torque = 0.0
    loads[CRANK].torque = of.torque_N_m
    if len(loads) > SLIDER:
        loads[SLIDER].x = of.force_N


@register_jitable(**INNER)
def _locate_all(pins, state, drift_s):
    for p in range(len(pins)):
        if not pins[p].native:
            locate(pins[p], state[pins[p].bearing], state[pins[p].pin], drift_s)


@register_jitable(**INNER)
def _in_contact(pins):
    touching = False
    for p in range(len(pins)):
        touching = touching or (pins[p].phase == CONTACT and not pins[p].native)
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
def _stretch(loads, weights, share):
    """Have loads act for another time than the step, and the bodies' weights with them."""
    for b in range(len(loads)):
        loads[b].x *= share
        loads[b].y *= share
        loads[b].torque *= share
    for b in range(len(weights)):
        loads[b].y -= (share - 1.0) * weights[b]


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
