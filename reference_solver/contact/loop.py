"""The loop of contacts: steps that land on every touch and release, graded into and out of contact.

Numba compiles this module as it stands, once for all mechanisms: ``step``, ``slopes`` and
``mobilities`` are functions of the mechanism's own kernel (see ``kernel``), called by address, which
costs 5 % of a step. Without Numba it runs too, as the readable face (see ``faces``). Between events every
right-hand side is smooth; an event is located by shortening the step until its end lies on it.
"""

from typing import NamedTuple

import numpy as np
from numba import from_dtype
from numba.extending import register_jitable
from numba.types import FunctionType, NamedUniTuple, boolean, float64, int64
from numba.types import NamedTuple as NumbaTuple

from reference_solver.contact import types
from reference_solver.contact.types import (
    CLIPPED,
    CLOCK_RECORD,
    CONTACT,
    CONTACT_RECORD,
    DONE,
    EVENT_RECORD,
    FAILED,
    FLIGHT,
    FULL,
    GAP_RECORD,
    GO,
    SETTLE,
    SPENT,
    Motion,
    Rates,
    Records,
    Work,
)

#: Modules whose constants the machine code has taken over.
COMPILED_WITH = (types,)

#: All memory is the caller's, so that references of arrays need not be counted, which took half of the time.
OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}
INNER = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

ARRAY, TABLE = float64[::1], float64[:, ::1]
CONTACTS, GAPS, EVENTS, CLOCK = (
    from_dtype(dtype)[::1] for dtype in (CONTACT_RECORD, GAP_RECORD, EVENT_RECORD, CLOCK_RECORD)
)
MOTION = NumbaTuple((ARRAY, ARRAY, ARRAY, GAPS), Motion)
RATES = NamedUniTuple(ARRAY, 4, Rates)
RECORDS = NumbaTuple((EVENTS, TABLE, ARRAY, TABLE, TABLE, TABLE, TABLE, TABLE, TABLE), Records)
STEP = FunctionType(boolean(ARRAY, CONTACTS, float64, float64, MOTION, MOTION))
SLOPES = FunctionType(boolean(ARRAY, CONTACTS, float64, MOTION, RATES))
MOBILITIES = FunctionType(boolean(ARRAY, MOTION, ARRAY))
WORK = NumbaTuple((MOTION, MOTION, RATES, RATES, RATES, RATES, ARRAY), Work)


class Kernel(NamedTuple):
    """The functions of a mechanism, compiled or readable (see ``kernel`` and ``faces``)."""

    step: object
    slopes: object
    mobilities: object


KERNEL = NumbaTuple((STEP, SLOPES, MOBILITIES), Kernel)
ADVANCE = int64(KERNEL, ARRAY, CONTACTS, MOTION, CLOCK, RECORDS, WORK)


#: Where in a step dense output takes an additional slope; not 1/2, where all quartics with the same ends
#: share it.
INSIDE = 1.0 / 3.0


# ---------------------------------------------------------------------------------------- events


@register_jitable(**INNER)
def alarm(contact, gap, kind):
    """Return a number that is positive past the event: 0 is touch or release, 1 a change of the force's sign.

    A rigid wall is touched by the first, and released by the second.
    """
    if kind == 0:
        if contact.phase == FLIGHT:
            return gap.g
        return -1.0 if contact.rigid != 0.0 else -gap.g
    if contact.phase == FLIGHT:
        return -1.0
    if contact.rigid != 0.0:
        return -gap.push
    if contact.clipped == 0.0:
        return -1.0
    return -gap.push if contact.phase == CONTACT else gap.push


@register_jitable(**INNER)
def gone_off(contact, gap, kind):
    """Return whether an alarm has; of a pin before a rigid wall, that it is no round-off."""
    value = alarm(contact, gap, kind)
    if contact.rigid == 0.0 or contact.phase != FLIGHT or kind == 1:
        return value > 0.0
    if contact.ignored != 0.0:
        return False
    return value > contact.noise or (value > 0.0 and gap.rate > contact.rate_noise)


@register_jitable(**INNER)
def first_alarm(contacts, gaps, skip):
    """Return the number 2 k + kind of an alarm other than ``skip`` that has gone off, or -1."""
    for k in range(len(contacts)):
        for kind in range(2):
            if 2 * k + kind != skip and gone_off(contacts[k], gaps[k], kind):
                return 2 * k + kind
    return -1


@register_jitable(**INNER)
def value_at(step, p, contacts, t, h, old, new, event):
    """Return the alarm of an event after a step of length h, left in ``new``."""
    if not step(p, contacts, t, h, old, new):
        return np.nan
    return alarm(contacts[event // 2], new.gaps[event // 2], event % 2)


@register_jitable(**INNER)
def locate(step, p, contacts, t, h, old, new, event):
    """Return the step that ends on an event known to lie within h, or beyond it by rounding.

    Touch and release by Newton's method, since the gap's rate is known, the law's change of sign by the
    Illinois method; both within a bracket. The state after that step is left in ``new``.
    """
    k, gone = event // 2, event % 2 == 0
    high, high_value = h, value_at(step, p, contacts, t, h, old, new, event)
    low, low_value = 0.0, 0.0
    trial, value = high, high_value
    if not gone:
        low_value = value_at(step, p, contacts, t, 0.0, old, new, event)
        if low_value > 0.0:
            return 0.0
    for _ in range(100):
        resolution = 4e-16 * (t + trial) + 1e-300
        if high - low <= resolution:
            break
        if gone:  # aimed past the event by rounding, so as to end on its far side
            rate = new.gaps[k].rate if contacts[k].phase == FLIGHT else -new.gaps[k].rate
            trial = trial - value / rate + resolution if rate > 0.0 else low
        else:
            trial = high - high_value * (high - low) / (high_value - low_value)
        if not low < trial < high:
            trial = 0.5 * (low + high)
        value = value_at(step, p, contacts, t, trial, old, new, event)
        if value == 0.0 or (gone and 0.0 < value <= 4.0 * resolution * abs(new.gaps[k].rate)):
            return trial
        if value > 0.0:
            high, high_value, low_value = trial, value, 0.5 * low_value
        else:
            low, low_value, high_value = trial, value, 0.5 * high_value
    value_at(step, p, contacts, t, high, old, new, event)
    return high


@register_jitable(**INNER)
def peak(g, rise, new_g, fall, h):
    """Return the time within h at which the cubic through both ends' g and rates, rise and fall, peaks."""
    mean = (new_g - g) / h
    curve = 3.0 * mean - 2.0 * rise - fall
    cubic = rise + fall - 2.0 * mean
    # g' = rise + 2 curve x + 3 cubic x^2 over x = time/h; its zero with g' falling.
    root = np.sqrt(max(curve * curve - 3.0 * cubic * rise, 0.0))
    x = -rise / (curve - root) if curve < root else 0.5
    return h * min(max(x, 0.0), 1.0)


@register_jitable(**INNER)
def turned_back(contact, gap, new_gap):
    """Return whether a pin in flight has been nearest to its wall within a step."""
    return contact.phase == FLIGHT and contact.ignored == 0.0 and gap.rate > 0.0 and new_gap.rate < 0.0


@register_jitable(**INNER)
def approach(step, p, contacts, t, h, old, new, skip):
    """Look for a pin that touches and leaves within the step: return its event and a step ending inside.

    Without one but ``skip``, return -1 and the whole step. The state after the returned step is left in
    ``new``. The peak is sought by cubics through ever nearer ends, as long as it may be past the wall: it is
    higher than a trial by rate^2/(2 |g''|), of which twice is allowed for.
    """
    for k in range(len(contacts)):
        if 2 * k != skip and turned_back(contacts[k], old.gaps[k], new.gaps[k]):
            low, g, rise = 0.0, old.gaps[k].g, old.gaps[k].rate
            high, new_g, fall = h, new.gaps[k].g, new.gaps[k].rate
            bend = (rise - fall) / h
            for _ in range(20):
                nearest = low + peak(g, rise, new_g, fall, high - low)
                value = value_at(step, p, contacts, t, nearest, old, new, 2 * k)
                if value > contacts[k].noise:
                    return 2 * k, nearest
                rate = new.gaps[k].rate
                if not (low < nearest < high and value + rate * rate / bend > contacts[k].noise):
                    break
                if rate > 0.0:
                    low, g, rise = nearest, value, rate
                else:
                    high, new_g, fall = nearest, value, rate
            value_at(step, p, contacts, t, h, old, new, 2 * k)
    return -1, h


@register_jitable(**INNER)
def switch(mobilities, p, contacts, t, motion, event, spare):
    """Change a contact's phase at an event; return what happened: 1 touch, -1 release, 2 clip, 3 resume."""
    k, kind = event // 2, event % 2
    contact = contacts[k]
    if kind == 1:
        contact.phase = CLIPPED if contact.phase == CONTACT else CONTACT
        return 2 if contact.phase == CLIPPED else 3
    if contact.phase != FLIGHT:
        contact.phase = FLIGHT
        return -1
    # The mobility tells how long the contact will take.
    mobilities(p, motion, spare)
    contact.phase, contact.mobility = CONTACT, spare[k]
    gap, n = motion.gaps[k], contact.exponent
    speed = max(gap.rate, contact.slowest)
    energy = (n + 1.0) * speed * speed / (2.0 * contact.stiffness * contact.mobility)
    contact.memory = contact.factor / speed
    contact.began_s, contact.duration_s = t, 3.0 * energy ** (1.0 / (n + 1.0)) / speed
    return 1


@register_jitable(**INNER)
def note(mobilities, p, contacts, motion, event, spare, clock, records):
    """Change a contact's phase at an event and write the event into the log."""
    now = clock[0]
    entry, k = records.events[now.events], event // 2
    entry.time_s, entry.contact = now.time, k
    entry.what = switch(mobilities, p, contacts, now.time, motion, event, spare)
    entry.rate, entry.depth = motion.gaps[k].rate, motion.gaps[k].depth
    for c in range(len(motion.sums)):
        records.event_sums[now.events, c] = motion.sums[c]
    now.events += 1


# ------------------------------------------------------------------------------- the next step


@register_jitable(**INNER)
def graded(h, duration, distance):
    """Return the step at a distance in time from an end of a contact, for a grid (i/N)^2, N = duration/h."""
    return min(h, h * h / duration + 2.0 * h * np.sqrt(max(distance, 0.0) / duration))


@register_jitable(**INNER)
def step_length(contacts, gaps, now):
    """Return the longest step that the phases allow."""
    h = now.longest
    for k in range(len(contacts)):
        contact, gap = contacts[k], gaps[k]
        if contact.phase == FLIGHT or contact.rigid != 0.0:
            if gap.speed * h > 0.25 * contact.clearance:  # a quarter of the way across, or of a radian along
                h = 0.25 * contact.clearance / gap.speed
            continue
        duration, depth = contact.duration_s, max(gap.depth, 0.0)
        if depth > 0.0:
            slope = contact.exponent * gap.elastic / depth
            duration = min(duration, np.pi / np.sqrt(slope * contact.mobility))
            # A law's damping is stiff in a contact that began slowly, friction below its regularisation
            # speed: a damper of rate r is followed by RK4 up to r h = 2.785, accurately well below it.
            rate = contact.mobility * max(gap.damper, gap.elastic * contact.friction)
            if rate > 0.0:
                h = min(h, 0.5 / rate)
        shortest = duration / now.per_contact
        h = min(h, graded(shortest, duration, now.time - contact.began_s))
        if gap.rate < 0.0:
            h = min(h, graded(shortest, duration, -depth / gap.rate))
    return h


# -------------------------------------------------------------------------------- dense output
#
# Over x = (time - t)/h, positions are the quintic through q, q' and q'' at both ends, in error by O(h^6).
# Velocities, and the sums, are quartics through value and slope at both ends and the slope at a third of the
# step, evaluated at the interpolated state there: in error by O(h^5), as the step itself is. (The quintic's
# own derivative would divide the round-off of q by h, and graded steps are short.)


@register_jitable(**INNER)
def quintic(rise, slope, new_slope, curve, new_curve):
    """Return the coefficients of x^3 to x^5 of a change with these slopes and half curvatures at x = 0 and 1.

    All are per unit of x; ``rise`` is the whole change less ``slope`` and ``curve``.
    """
    turn = new_slope - slope - 2.0 * curve
    bend = new_curve - curve
    cubic, quartic = 10.0 * rise - 4.0 * turn + bend, -15.0 * rise + 7.0 * turn - 2.0 * bend
    return cubic, quartic, 6.0 * rise - 3.0 * turn + bend


@register_jitable(**INNER)
def quartic(change, slope, new_slope, bump, x):
    """Return at x what a quantity has changed by, with the slopes at both ends per unit of x.

    ``bump`` x^2 (1 - x)^2 is what the quartic has beyond the cubic through both ends.
    """
    rest, turn = change - slope, new_slope - slope
    return x * (slope + x * (3.0 * rest - turn + x * (turn - 2.0 * rest) + bump * (1.0 - x) * (1.0 - x)))


@register_jitable(**INNER)
def bump_of(change, slope, new_slope, inside):
    """Return the quartic's bump from its slope at ``INSIDE``."""
    rest, turn, x = change - slope, new_slope - slope, INSIDE
    cubic = slope + x * (2.0 * (3.0 * rest - turn) + x * 3.0 * (turn - 2.0 * rest))
    return (inside - cubic) / (2.0 * x * (1.0 - x) * (1.0 - 2.0 * x))


@register_jitable(**INNER)
def write(slopes, p, contacts, t, motion, now, records, rates):
    """Write the sample of a state, of which rates are found on the way; return whether it could."""
    row = now.taken
    ok = slopes(p, contacts, t, motion, rates)
    for c in range(len(motion.q)):
        records.q[row, c], records.v[row, c] = motion.q[c], motion.v[c]
    for c in range(len(motion.sums)):
        records.sums[row, c] = motion.sums[c]
    for k in range(len(contacts)):
        records.phases[row, 2 * k], records.phases[row, 2 * k + 1] = contacts[k].phase, contacts[k].memory
    for c in range(len(rates.forces)):
        records.forces[row, c] = rates.forces[c]
    for r in range(records.multipliers.shape[1]):
        records.multipliers[row, r] = rates.multipliers[r]
    now.taken += 1
    return ok


@register_jitable(**INNER)
def between(at, x, h, ends, rates, bumps):
    """Set q, v and sums of ``at`` to those at x of a step of h, from states and rates at both its ends."""
    (old, new), (slope, new_slope) = ends, rates
    for c in range(len(old.q)):
        start, curve = h * old.v[c], 0.5 * h * h * slope.a[c]
        rise = new.q[c] - old.q[c] - start - curve
        third, fourth, fifth = quintic(rise, start, h * new.v[c], curve, 0.5 * h * h * new_slope.a[c])
        at.q[c] = old.q[c] + x * (start + x * (curve + x * (third + x * (fourth + x * fifth))))
        change = new.v[c] - old.v[c]
        at.v[c] = old.v[c] + quartic(change, h * slope.a[c], h * new_slope.a[c], bumps.a[c], x)
    for c in range(len(old.sums)):
        powers = h * slope.powers[c], h * new_slope.powers[c]
        at.sums[c] = old.sums[c] + quartic(new.sums[c], powers[0], powers[1], bumps.powers[c], x)


@register_jitable(**INNER)
def within(slopes, p, contacts, h, old, now, records, work):
    """Write the samples before the end of a step of h from ``old`` to the new state; return whether it could.

    The sums of the new state are those of the step alone.
    """
    t, end, new, at = now.time, now.time + h, work.new, work.at
    rates, new_rates, bumps = work.rates, work.new_rates, work.at_rates
    ok = slopes(p, contacts, t, old, rates) and slopes(p, contacts, end, new, new_rates)
    for c in range(len(old.v)):
        bumps.a[c] = 0.0
    for c in range(len(old.sums)):
        bumps.powers[c] = 0.0
    between(at, INSIDE, h, (old, new), (rates, new_rates), bumps)
    ok = slopes(p, contacts, t + INSIDE * h, at, bumps) and ok
    for c in range(len(old.v)):
        change = new.v[c] - old.v[c]
        bumps.a[c] = bump_of(change, h * rates.a[c], h * new_rates.a[c], h * bumps.a[c])
    for c in range(len(old.sums)):
        powers = h * rates.powers[c], h * new_rates.powers[c]
        bumps.powers[c] = bump_of(new.sums[c], powers[0], powers[1], h * bumps.powers[c])
    while now.taken < len(records.time) and records.time[now.taken] < end:
        time = records.time[now.taken]
        between(at, (time - t) / h, h, (old, new), (rates, new_rates), bumps)
        ok = write(slopes, p, contacts, time, at, now, records, work.sample_rates) and ok
    return ok


# -------------------------------------------------------------------------------------- the loop


@register_jitable(**INNER)
def finite(gaps):
    """Return whether all gaps are finite: what overflows anywhere is in them a step later."""
    total = 0.0
    for k in range(len(gaps)):
        total += gaps[k].depth
    return np.isfinite(total)


@register_jitable(**INNER)
def take(old, new):
    """Move the state on to ``new``, whose sums are those of the step alone."""
    for c in range(len(old.q)):
        old.q[c], old.v[c] = new.q[c], new.v[c]
    for c in range(len(old.sums)):
        old.sums[c] += new.sums[c]
    for k in range(len(old.gaps)):
        old.gaps[k] = new.gaps[k]


@register_jitable(**INNER)
def suspicious(contacts, gaps, new_gaps):
    """Return whether an event may lie within a step: an alarm has gone off, or a pin has turned back."""
    for k in range(len(contacts)):
        if turned_back(contacts[k], gaps[k], new_gaps[k]):
            return True
    return first_alarm(contacts, new_gaps, -1) >= 0


@register_jitable(**INNER)
def cut(step, p, contacts, t, h, old, new):
    """Return the first event within a step of h, -1 without one, and the step up to it, left in ``new``."""
    event, other = -1, first_alarm(contacts, new.gaps, -1)
    while True:
        if other >= 0:
            shorter = locate(step, p, contacts, t, h, old, new, other)
            if event >= 0 and shorter >= h:
                return event, h
            event, h = other, shorter
        else:
            other, inside = approach(step, p, contacts, t, h, old, new, event)
            if other < 0:
                return event, h
            event, h = other, locate(step, p, contacts, t, inside, old, new, other)
        other = first_alarm(contacts, new.gaps, event)


@register_jitable(**INNER)
def close_at_start(mobilities, p, contacts, motion, spare, clock, records):
    """Note the touch of compliant contacts that are closed at the start of a run."""
    now = clock[0]
    for k in range(len(contacts)):
        closed = contacts[k].rigid == 0.0 and contacts[k].phase == FLIGHT and motion.gaps[k].g > 0.0
        if now.time == 0.0 and now.end > 0.0 and closed:
            note(mobilities, p, contacts, motion, 2 * k, spare, clock, records)


@register_jitable(**INNER)
def due(slopes, p, contacts, motion, now, records, rates):
    """Write the samples of the present time; return GO if a step is to come, or how the call ends."""
    while now.taken < len(records.time) and records.time[now.taken] <= now.time:
        if not write(slopes, p, contacts, now.time, motion, now, records, rates):
            return FAILED
    if now.time >= now.end:
        return DONE
    if now.steps >= now.budget:
        return SPENT
    return FULL if now.events >= len(records.events) else GO


@register_jitable(**INNER)
def settled(now, contacts, moved):
    """Have all contacts take part again, once time has moved on since an event on a rigid wall."""
    if now.rigid >= 0 and moved:
        now.rigid = -1
        for k in range(len(contacts)):
            contacts[k].ignored = 0.0


def advance(kernel, p, contacts, motion, clock, records, work):
    """Advance the motion to the clock's end in place, event by event; return how that ended.

    Events are added to the log, and a sample is written for each of the records' times up to the end. Where
    events are located, steps do not depend on the times; else, they land on each. An event on a rigid wall
    ends the call: whoever called settles it.
    """
    step, slopes, mobilities = kernel.step, kernel.slopes, kernel.mobilities
    now, new, spare = clock[0], work.new, work.spare
    close_at_start(mobilities, p, contacts, motion, spare, clock, records)
    while True:
        status = due(slopes, p, contacts, motion, now, records, work.sample_rates)
        if status != GO:
            return status
        t = now.time
        h, landing = now.longest, now.end
        if now.located:
            h = step_length(contacts, motion.gaps, now)
        elif now.taken < len(records.time):
            landing = records.time[now.taken]
        last = t + h >= landing - 1e-6 * h
        if last:
            h = landing - t
        now.tried = h
        if not step(p, contacts, t, h, motion, new) or not finite(new.gaps):
            return FAILED
        event, whole = -1, h
        if suspicious(contacts, motion.gaps, new.gaps):
            if now.located:
                event, h = cut(step, p, contacts, t, h, motion, new)
            else:
                event = first_alarm(contacts, new.gaps, -1)
        last = last and h == whole
        change = h + now.lost
        new_t = landing if last else t + change
        inside = now.taken < len(records.time) and records.time[now.taken] < new_t
        if inside and not within(slopes, p, contacts, h, motion, now, records, work):
            return FAILED
        now.lost = 0.0 if last else change - (new_t - t)
        now.time = new_t
        take(motion, new)
        now.steps += 1
        settled(now, contacts, new_t > t)
        if event >= 0 and contacts[event // 2].rigid != 0.0:
            now.rigid = event // 2
            return SETTLE
        if event >= 0:
            note(mobilities, p, contacts, motion, event, spare, clock, records)
