"""The loop of contacts: steps that land on every touch and release, graded into and out of contact.

Numba compiles this module as it stands, once for all mechanisms: ``step``, ``slopes`` and
``mobilities`` are functions of the mechanism's own kernel (see ``kernel``), called by address, which
costs 5 % of a step. Without Numba it runs too, as the readable face (see ``faces``). Between events every
right-hand side is smooth; an event is located by shortening the step until its end lies on it.
"""

import numpy as np
from numba.extending import register_jitable

from reference_solver.contact import types
from reference_solver.machine_code import OPTIONS, call, compiled

INNER = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

#: The slope that makes dense output a quartic; rows of slopes in all.
BUMP, ROWS = 0, 4
#: Part of its clearance that a pin moves at least in the first step of a contact and in the last: a shorter
#: way is round-off, in which a touch looks like a release.
SHORTEST_WAY = 1e-11
#: A knot nearer than this part of its period has been reached: steps end so near to it, by their first terms.
REACHED = 1e-4
#: A kink has been reached where it is nearer than this part of the angle, or of its period: some round-off.
AT_KINK = 1e-14
#: How often a step is taken again that passes a kink, by what it may grow where it ends just before one, and
#: the part of the longest step by which RK4's end before it.
LANDINGS, STRETCHED, SHORT = 8, 1.1, 1e-3
#: Mobilities are looked up again after so many steps, in which bodies turn little.
STEPS_BETWEEN_PROBES = 16
#: Where in a step dense output takes an additional slope; not 1/2, where all quartics with the same ends
#: share it.
INSIDE = 1.0 / 3.0
#: The part of a step that is tried where a stage comes too near to a singular position, and how often: stages
#: in the middle and at the end of the one are well between those of the other and of the step after it.
ASIDE, SHORTENED = 2.0 / 3.0, 4
#: How often a step is shortened where friction of a pin that follows a rigid wall is too stiff for it: near
#: a jam its damping grows within few steps by orders of magnitude.
MOST_SHORTENED = 60
#: How often a step is halved in which a pin may have been out: in still shorter ones round-off looks so.
HALVED = 20
#: How far from its supposed place in a step, as a part of it, a contact's largest force is looked for.
ASIDE_OF_PEAK = 0.1


# ----------------------------------------------------------------------- calls of the kernel


@register_jitable(**INNER, forceinline=True)
def address(run, row):
    """Return the address of a row of slopes, or of a state."""
    return run.clock[0].rows + (row if row >= 0 else row + len(run.slopes)) * run.clock[0].width


@register_jitable(**INNER, forceinline=True)
def set_slopes(run, t, of, row):
    """Set a row to the slopes at a state; return the condition."""
    now = run.clock[0]
    return call(now.rates, now.p, now.contacts, t, address(run, of), address(run, row))


@register_jitable(**INNER, forceinline=True)
def set_gaps(run, t, of, motion):
    """Set the gaps of a state, that in row ``of``; return whether it could."""
    now, state = run.clock[0], address(run, of)
    return call(now.gaps, now.p, now.contacts, t, state, state + 8 * len(motion.y)) < np.inf


@register_jitable(**INNER, forceinline=True)
def take_step(run, h):
    """Take a step of h from ``old`` to ``new``; return its condition, infinite on failure."""
    now = run.clock[0]
    run.slopes[types.OLD, now.place_of_h] = h
    return call(now.step, now.p, now.contacts, now.time, address(run, types.OLD), address(run, types.NEW))


# ---------------------------------------------------------------------------------------- events


@register_jitable(**INNER)
def alarm(contact, gap, kind):
    """Return a number that is positive past the event: 0 is touch or release, 1 a change of the force's sign.

    A rigid wall is touched by the first, and released by the second.
    """
    if kind == 0:
        if contact.phase == types.FLIGHT:
            return gap.g
        return -1.0 if contact.rigid != 0.0 else -gap.g
    if contact.phase == types.FLIGHT:
        return -1.0
    if contact.rigid != 0.0:
        return -gap.push
    if contact.clipped == 0.0:
        return -1.0
    return -gap.push if contact.phase == types.CONTACT else gap.push


@register_jitable(**INNER)
def gone_off(contact, gap, kind):
    """Return whether an alarm has; of a pin before a rigid wall, that it is no round-off."""
    value = alarm(contact, gap, kind)
    if contact.rigid == 0.0 or contact.phase != types.FLIGHT or kind == 1:
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
def value_at(run, h, event):
    """Return the alarm of an event after a step of length h, left in ``new``."""
    if not take_step(run, h) < np.inf:
        return np.nan
    return alarm(run.contacts[event // 2], run.new.gaps[event // 2], event % 2)


@register_jitable(**INNER)
def locate(run, h, event):
    """Return the step that ends on an event known to lie within h, or beyond it by rounding.

    Touch and release by Newton's method, since the gap's rate is known, the law's change of sign by the
    Illinois method; both within a bracket. The state after that step is left in ``new``.
    """
    k, gone, t = event // 2, event % 2 == 0, run.clock[0].time
    contact, gap = run.contacts[k], run.new.gaps[k]
    high, high_value = h, value_at(run, h, event)
    low, low_value = 0.0, 0.0
    trial, value = high, high_value
    if not gone:
        low_value = value_at(run, 0.0, event)
        if low_value > 0.0:
            return 0.0
    for _ in range(100):
        resolution = 4e-16 * (t + trial) + 1e-300
        if high - low <= resolution:
            break
        if gone:  # aimed past the event by rounding, so as to end on its far side
            rate = gap.rate if contact.phase == types.FLIGHT else -gap.rate
            trial = trial - value / rate + resolution if rate > 0.0 else low
        else:
            trial = high - high_value * (high - low) / (high_value - low_value)
        if not low < trial < high:
            trial = 0.5 * (low + high)
        value = value_at(run, trial, event)
        if value == 0.0 or (gone and 0.0 < value <= 4.0 * resolution * abs(gap.rate)):
            return trial
        if value > 0.0:
            high, high_value, low_value = trial, value, 0.5 * low_value
        else:
            low, low_value, high_value = trial, value, 0.5 * high_value
    value_at(run, high, event)
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
    return contact.phase == types.FLIGHT and contact.ignored == 0.0 and gap.rate > 0.0 and new_gap.rate < 0.0


@register_jitable(**INNER)
def has_bulged(contacts, gaps, new_gaps, h):
    """Return whether a pin that moves inwards at both ends of a step of h may have been out in between.

    That is where the cubic through both ends' g and rates comes near to rising, and has the wall in reach. A
    pin that has just hit may be back, and off again, within a step: the shorter one sees it.
    """
    for k in range(len(contacts)):
        rate, new_rate = gaps[k].rate, new_gaps[k].rate
        if contacts[k].phase == types.FLIGHT and rate < 0.0 and new_rate < 0.0:
            steepest = 1.5 * (new_gaps[k].g - gaps[k].g) / h - 0.25 * (rate + new_rate)
            excess = steepest - 0.25 * min(rate, new_rate)
            if excess > 0.0 and max(gaps[k].g, new_gaps[k].g) + excess * h > contacts[k].noise:
                return True
    return False


@register_jitable(**INNER)
def approach(run, h, skip):
    """Look for a pin that touches and leaves within the step: return its event and a step ending inside.

    Without one but ``skip``, return -1 and the whole step. The state after the returned step is left in
    ``new``. The peak is sought by cubics through ever nearer ends, as long as it may be past the wall: it is
    higher than a trial by rate^2/(2 |g''|), of which twice is allowed for.
    """
    contacts, old, new = run.contacts, run.old, run.new
    for k in range(len(contacts)):
        if 2 * k != skip and turned_back(contacts[k], old.gaps[k], new.gaps[k]):
            low, g, rise = 0.0, old.gaps[k].g, old.gaps[k].rate
            high, new_g, fall = h, new.gaps[k].g, new.gaps[k].rate
            bend = (rise - fall) / h
            for _ in range(20):
                nearest = low + peak(g, rise, new_g, fall, high - low)
                value = value_at(run, nearest, 2 * k)
                if value > contacts[k].noise:
                    return 2 * k, nearest
                rate = new.gaps[k].rate
                if not (low < nearest < high and value + rate * rate / bend > contacts[k].noise):
                    break
                if rate > 0.0:
                    low, g, rise = nearest, value, rate
                else:
                    high, new_g, fall = nearest, value, rate
            value_at(run, h, 2 * k)
    return -1, h


@register_jitable(**INNER)
def probe(run):
    """Look up the mobilities of all contacts where the bodies are now."""
    contacts, looked_up = run.contacts, run.slopes[types.SPARE]
    now = run.clock[0]
    old, out = address(run, types.OLD), address(run, types.SPARE)
    call(now.mobilities, now.p, now.contacts, now.time, old, out)
    for k in range(len(contacts)):
        contacts[k].mobility, contacts[k].sliding = looked_up[3 * k], looked_up[3 * k + 1]
        contacts[k].following = looked_up[3 * k + 2]


@register_jitable(**INNER, forceinline=True)
def probe_now_and_then(run):
    """Look up the mobilities where a contact has lasted for some steps: its bodies have turned."""
    closed = False
    for k in range(len(run.contacts)):
        closed = closed or run.contacts[k].phase != types.FLIGHT
    if closed and run.clock[0].steps % STEPS_BETWEEN_PROBES == 0:
        probe(run)


@register_jitable(**INNER)
def switch(run, event):
    """Change a contact's phase at an event; return what happened: 1 touch, -1 release, 2 clip, 3 resume."""
    k, kind = event // 2, event % 2
    contact, gap, n = run.contacts[k], run.old.gaps[k], run.contacts[k].exponent
    if kind == 1:
        contact.phase = types.CLIPPED if contact.phase == types.CONTACT else types.CONTACT
        return 2 if contact.phase == types.CLIPPED else 3
    if contact.phase != types.FLIGHT:
        contact.phase = types.FLIGHT
        return -1
    probe(run)  # the mobility tells how long the contact will take
    contact.phase = types.CONTACT
    speed = max(gap.rate, contact.slowest)
    energy = (n + 1.0) * speed * speed / (2.0 * contact.stiffness * contact.mobility)
    contact.memory = contact.factor / speed
    contact.began_s = contact.force_s = contact.deepest_s = run.clock[0].time
    contact.force, contact.deepest = -np.inf, 0.0
    contact.duration_s = 3.0 * energy ** (1.0 / (n + 1.0)) / speed
    return 1


@register_jitable(**INNER)
def note(run, event):
    """Change a contact's phase at an event and write the event into the log."""
    now, k = run.clock[0], event // 2
    entry, gap, sums = run.records.events[now.events], run.old.gaps[k], run.records.event_sums
    entry.time_s, entry.contact = now.time, k
    entry.what = switch(run, event)
    entry.rate, entry.depth = gap.rate, gap.depth
    entry.force, entry.force_s = run.contacts[k].force, run.contacts[k].force_s
    entry.deepest, entry.deepest_s = run.contacts[k].deepest, run.contacts[k].deepest_s
    for c in range(sums.shape[1]):
        sums[now.events, c] = run.old.y[2 * run.old.n + c]
    now.events += 1


# ------------------------------------------------------------------------------- the next step


@register_jitable(**INNER)
def graded(h, duration, distance, shortest):
    """Return the step at a distance in time from an end of a contact, for a grid (i/N)^2, N = duration/h."""
    step = h * h / duration + 2.0 * h * np.sqrt(max(distance, 0.0) / duration)
    return min(h, max(step, shortest))


@register_jitable(**INNER)
def in_flight(contacts, gaps, h, part):
    """Return a step, h at most, in which pins fly no further than a part of the clearance, or of a radian."""
    for k in range(len(contacts)):
        far = part * contacts[k].clearance
        if (contacts[k].phase == types.FLIGHT or contacts[k].rigid != 0.0) and gaps[k].speed * h > far:
            h = far / gaps[k].speed
    return h


@register_jitable(**INNER, forceinline=True)
def step_length(contacts, gaps, now):
    """Return the longest step that the phases allow.

    A contact's own times are its duration, half a period of its spring, the time in which its damper or its
    friction, below the regularisation speed, takes a speed away, and the period of the pin that swings along
    its wall, pressed onto it by N: 2 pi/sqrt(N w/c) with w the mobility there. All are cut alike.
    """
    h, decay = in_flight(contacts, gaps, now.longest, 0.25), min(0.5, 200.0 / now.per_contact)
    for k in range(len(contacts)):
        contact, gap = contacts[k], gaps[k]
        if contact.phase == types.FLIGHT:
            continue
        rigid = contact.rigid != 0.0
        pressing = gap.push if rigid else gap.elastic * max(1.0, gap.push)
        swing = np.sqrt(max(pressing, 0.0) * contact.following / contact.clearance)
        if swing > 0.0:
            h = min(h, 2.0 * np.pi / (swing * now.per_contact))
        # RK4 follows a damper of rate r up to r h = 2.785, accurately well below it.
        rate = max(contact.mobility * gap.damper, contact.sliding * pressing * contact.friction)
        if rate > 0.0:
            h = min(h, decay / rate)
        if rigid:
            continue
        duration, depth = contact.duration_s, max(gap.depth, 0.0)
        if depth > 0.0:
            slope = contact.exponent * gap.elastic / depth
            duration = min(duration, np.pi / np.sqrt(slope * contact.mobility))
        longest, shortest = duration / now.per_contact, SHORTEST_WAY * contact.clearance / abs(gap.rate)
        h = min(h, graded(longest, duration, now.time - contact.began_s, shortest))
        if gap.rate < 0.0:
            h = min(h, graded(longest, duration, -depth / gap.rate, shortest))
    return h


@register_jitable(**INNER, forceinline=True)
def to_knot(run, h, curved, short):
    """Return a step, h at most, that ends near the next knot of a load by a body's angle, if it gets there.

    It goes by the body's speed, and ``curved`` times its acceleration at the step's start, if that is known.
    What is left of the knot in the step after it is of the fourth power of the distance. Before a kink it
    ends ``short`` of it, in s (see ``to_kink``).
    """
    n, y = run.old.n, run.old.y
    for k in range(len(run.knots)):
        knot = run.knots[k]
        c, ahead = knot.coordinate, knot.period
        speed, gain = y[n + c], curved * run.slopes[types.START, n + c]
        if speed < 0.0:
            ahead, speed, gain = (y[c] - knot.angle) % ahead, -speed, -gain
        else:
            ahead = (knot.angle - y[c]) % ahead
        near = AT_KINK * max(abs(y[c]), knot.period) if knot.kink != 0 else REACHED * knot.period
        if ahead > near and speed > 0.0 and speed * speed + 2.0 * gain * ahead > 0.0:
            reach = 2.0 * ahead / (speed + np.sqrt(speed * speed + 2.0 * gain * ahead))
            h = min(h, reach - short if knot.kink != 0 and reach > 2.0 * short else reach)
    return h


@register_jitable(**INNER, forceinline=True)
def to_kink(run, h, most, short):
    """Return the step, ``most`` at most, in place of one of h that has passed a kink, or come near to one.

    That is one on to the first such kink, by the speed at the end of h; without one it is h. Stages of RK4
    are off by the third power of the step, and beyond a kink that makes an error of the fourth, by chance: so
    a step ends ``short`` of a kink, in s, and a short one goes on to it.
    """
    n, y, new_y, first = run.old.n, run.old.y, run.new.y, np.inf
    aim, landed = short if h > 2.0 * short else 0.0, h
    for k in range(len(run.knots)):
        knot = run.knots[k]
        if knot.kink == 0:
            continue
        c = knot.coordinate
        near = AT_KINK * max(abs(y[c]), knot.period)
        sign = 1.0 if new_y[c] > y[c] else -1.0
        way, speed, ahead = (
            sign * (new_y[c] - y[c]),
            sign * new_y[n + c],
            sign * (knot.angle - y[c]) % knot.period,
        )
        if not near < ahead < min(knot.period - near, first * way):
            continue
        first, landed, beyond = ahead / way, h, way - ahead + aim * speed
        if beyond > -REACHED * knot.period and abs(beyond) > max(near, 0.5 * aim * speed):
            landed = h - beyond / speed if speed > 0.0 else 0.0
            if not 0.0 < landed < STRETCHED * h:
                landed = h * first
    return landed if landed <= min(most, STRETCHED * h) else h


# -------------------------------------------------------------------------------- dense output
#
# Over x = (time - t)/h, positions are the quintic through q, q' and q'' at both ends, in error by O(h^6).
# Velocities, and the sums, are quartics through value and slope at both ends and the slope at a third of the
# step, evaluated at the interpolated state there: in error by O(h^5), as the step itself is. (The quintic's
# own derivative would divide the round-off of q by h, and graded steps are short.)


@register_jitable(**INNER)
def on_quintic(run, h, c, x):
    """Return a coordinate and its velocity at x of a step of h, on the quintic."""
    n, y, new_y, slopes = run.old.n, run.old.y, run.new.y, run.slopes
    start, curve = h * y[n + c], 0.5 * h * h * slopes[types.START, n + c]
    stop, new_curve = h * new_y[n + c], 0.5 * h * h * slopes[types.END, n + c]
    rise, turn, bend = new_y[c] - y[c] - start - curve, stop - start - 2.0 * curve, new_curve - curve
    third, fourth = 10.0 * rise - 4.0 * turn + bend, -15.0 * rise + 7.0 * turn - 2.0 * bend
    fifth = 6.0 * rise - 3.0 * turn + bend
    slope = 2.0 * curve + x * (3.0 * third + x * (4.0 * fourth + x * 5.0 * fifth))
    place = y[c] + x * (start + x * (curve + x * (third + x * (fourth + x * fifth))))
    return place, (start + x * slope) / h


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
def write(run, t, of, motion):
    """Write the sample of a state, that in row ``of``; return whether it could."""
    now, samples, contacts = run.clock[0], run.records.samples, run.contacts
    row, phases = now.taken, samples.shape[1] - 2 * len(contacts)
    out = now.samples + row * now.sample_width + 8 * len(motion.y)
    condition = call(now.forces, now.p, now.contacts, t, address(run, of), out)
    now.least = min(now.least, condition)
    for c in range(len(motion.y)):
        samples[row, c] = motion.y[c]
    for k in range(len(contacts)):
        samples[row, phases + 2 * k] = contacts[k].phase
        samples[row, phases + 2 * k + 1] = contacts[k].memory
    now.taken += 1
    return condition < np.inf


@register_jitable(**INNER)
def change_of(run, c):
    """Return what a velocity or a sum changes by in a step: the new state's sums are of the step alone."""
    return run.new.y[c] - run.old.y[c] if c < 2 * run.old.n else run.new.y[c]


@register_jitable(**INNER)
def between(run, x, h):
    """Set y of ``at`` to that at x of a step of h, from states and slopes at both its ends."""
    n, y, slopes = run.old.n, run.old.y, run.slopes
    for c in range(n):
        run.at.y[c], _ = on_quintic(run, h, c, x)
    for c in range(n, len(y)):
        slope, new_slope = h * slopes[types.START, c], h * slopes[types.END, c]
        run.at.y[c] = y[c] + quartic(change_of(run, c), slope, new_slope, slopes[BUMP, c], x)


@register_jitable(**INNER)
def within(run, h):
    """Write the samples before the end of a step of h; return whether it could."""
    now, slopes = run.clock[0], run.slopes
    t, end, times = now.time, now.time + h, run.records.time
    ok = set_slopes(run, t, types.OLD, types.START) < np.inf
    ok = ok and set_slopes(run, end, types.NEW, types.END) < np.inf
    for c in range(len(run.old.y)):
        slopes[BUMP, c] = 0.0
    between(run, INSIDE, h)
    ok = set_slopes(run, t + INSIDE * h, types.AT, BUMP) < np.inf and ok
    for c in range(run.old.n, len(run.old.y)):
        slope, new_slope, inside = h * slopes[types.START, c], h * slopes[types.END, c], h * slopes[BUMP, c]
        slopes[BUMP, c] = bump_of(change_of(run, c), slope, new_slope, inside)
    while now.taken < len(times) and times[now.taken] < end:
        time = times[now.taken]
        between(run, (time - t) / h, h)
        ok = write(run, time, types.AT, run.at) and ok
    return ok


# ------------------------------------------------------------------------- the largest of a contact


@register_jitable(**INNER)
def value_on(run, h, x, event):
    """Return an event's alarm at x of a step of h, on the quintic through both its ends, left in ``at``."""
    at, n = run.at, run.old.n
    for c in range(n):
        at.y[c], at.y[n + c] = on_quintic(run, h, c, x)
    set_gaps(run, run.clock[0].time + x * h, types.AT, at)
    return alarm(run.contacts[event // 2], at.gaps[event // 2], event % 2)


@register_jitable(**INNER)
def cubic(x, h, value, rate, new_value, new_rate):
    """Return at x of a step of h the cubic through values and rates at its ends, and its two derivatives."""
    change, start, stop = new_value - value, h * rate, h * new_rate
    second, third = 3.0 * change - 2.0 * start - stop, start + stop - 2.0 * change
    slope, curve = start + x * (2.0 * second + x * 3.0 * third), 2.0 * second + x * 6.0 * third
    return value + x * (start + x * (second + x * third)), slope / h, curve / (h * h)


@register_jitable(**INNER)
def depth_rate(contact, gap):
    """Return the rate of a penetration."""
    return gap.rate * contact.clearance / (contact.clearance + gap.depth)


@register_jitable(**INNER)
def rises(contact, gap, elastic, depth, rate, curve):
    """Return whether the normal force rises at a penetration, by its elastic force and both derivatives.

    The part of the damper that is not in proportion to the elastic force is taken from ``gap``.
    """
    stiffer = contact.exponent * elastic * rate * (1.0 + contact.memory * rate)
    damper = gap.damper + (elastic - gap.elastic) * contact.memory
    return stiffer + damper * curve * depth > 0.0


@register_jitable(**INNER)
def place_of_largest(contact, gap, new_gap, h):
    """Return about where in a step of h the normal force peaks, by the penetration's cubic; 1 at its end."""
    force, new_force = gap.elastic * gap.push, new_gap.elastic * new_gap.push
    if new_force < force < contact.force:
        return 1.0
    ends = gap.depth, depth_rate(contact, gap), new_gap.depth, depth_rate(contact, new_gap)
    if rises(contact, new_gap, new_gap.elastic, *cubic(1.0, h, *ends)):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(20):
        x = 0.5 * (low + high)
        depth, rate, curve = cubic(x, h, *ends)
        elastic = contact.stiffness * max(depth, 0.0) ** contact.exponent
        if rises(contact, new_gap, elastic, depth, rate, curve):
            low = x
        else:
            high = x
    return low


@register_jitable(**INNER)
def keep_largest(contact, gap, time):
    """Keep force and penetration at a time, if they are a contact's largest so far; return the force."""
    force = gap.elastic * gap.push
    if force > contact.force:
        contact.force, contact.force_s = force, time
    if gap.depth > contact.deepest:
        contact.deepest, contact.deepest_s = gap.depth, time
    return force


@register_jitable(**INNER)
def force_on(run, h, x, k):
    """Return the normal force of a contact at x of a step of h, and keep it if it is the largest so far."""
    value_on(run, h, x, 2 * k)
    return keep_largest(run.contacts[k], run.at.gaps[k], run.clock[0].time + x * h)


@register_jitable(**INNER, forceinline=True)
def note_largest(run, h, slopes_known):
    """Note the largest normal forces and penetrations of the compliant contacts in a step of h.

    Within it they are sought where cubics say, and by a parabola around that, on the quintic, for which the
    slopes at both ends have to be known.
    """
    contacts, t = run.contacts, run.clock[0].time
    for k in range(len(contacts)):
        contact, gap, new_gap = contacts[k], run.old.gaps[k], run.new.gaps[k]
        if contact.phase != types.CONTACT or contact.rigid != 0.0:
            continue
        keep_largest(contact, new_gap, t + h)
        x, turns = place_of_largest(contact, gap, new_gap, h), gap.rate > 0.0 > new_gap.rate
        if (x < 1.0 or turns) and not slopes_known:
            set_slopes(run, t, types.OLD, types.START)
            set_slopes(run, t + h, types.NEW, types.END)
        if turns:
            force_on(run, h, peak(gap.g, gap.rate, new_gap.g, new_gap.rate, h) / h, k)
        if x < 1.0:
            x = min(max(x, ASIDE_OF_PEAK), 1.0 - ASIDE_OF_PEAK)
            before, at, after = (
                force_on(run, h, x - ASIDE_OF_PEAK, k),
                force_on(run, h, x, k),
                force_on(run, h, x + ASIDE_OF_PEAK, k),
            )
            bend = before - 2.0 * at + after
            if bend < 0.0:
                x += 0.5 * ASIDE_OF_PEAK * (before - after) / bend
                force_on(run, h, min(max(x, 0.0), 1.0), k)


# -------------------------------------------------------------------------------------- the loop


@register_jitable(**INNER)
def finite(gaps):
    """Return whether all gaps are finite: what overflows anywhere is in them a step later."""
    total = 0.0
    for k in range(len(gaps)):
        total += gaps[k].depth
    return np.isfinite(total)


@register_jitable(**INNER, forceinline=True)
def take(old, new):
    """Move the state on to ``new``, whose sums are those of the step alone."""
    for c in range(len(old.y)):
        old.y[c] = new.y[c] if c < 2 * old.n else old.y[c] + new.y[c]
    for k in range(len(old.gaps)):
        old.gaps[k] = new.gaps[k]


@register_jitable(**INNER, forceinline=True)
def suspicious(contacts, gaps, new_gaps):
    """Return whether an event may lie within a step: an alarm has gone off, or a pin has turned back."""
    for k in range(len(contacts)):
        if turned_back(contacts[k], gaps[k], new_gaps[k]):
            return True
    return first_alarm(contacts, new_gaps, -1) >= 0


@register_jitable(**INNER)
def cut(run, h):
    """Return the first event within a step of h, -1 without one, and the step up to it, left in ``new``.

    Where events are not located, it is the whole step.
    """
    event, other = -1, first_alarm(run.contacts, run.new.gaps, -1)
    if not run.clock[0].located:
        return other, h
    while True:
        if other >= 0:
            shorter = locate(run, h, other)
            if event >= 0 and shorter >= h:
                return event, h
            event, h = other, shorter
        else:
            other, inside = approach(run, h, event)
            if other < 0:
                return event, h
            event, h = other, locate(run, inside, other)
        other = first_alarm(run.contacts, run.new.gaps, event)


@register_jitable(**INNER)
def close_at_start(run):
    """Note the touch of compliant contacts that are closed at the start of a run."""
    now, contacts = run.clock[0], run.contacts
    for k in range(len(contacts)):
        closed = contacts[k].rigid == 0.0 and contacts[k].phase == types.FLIGHT and run.old.gaps[k].g > 0.0
        if now.time == 0.0 and now.end > 0.0 and closed:
            note(run, 2 * k)


@register_jitable(**INNER, forceinline=True)
def write_due(run):
    """Write the samples of the present time; return whether it could."""
    now, times, ok = run.clock[0], run.records.time, True
    while ok and now.taken < len(times) and times[now.taken] <= now.time:
        ok = write(run, now.time, types.OLD, run.old)
    return ok


@register_jitable(**INNER)
def due(now, log_rows):
    """Return GO if a step is to come, or how the call ends."""
    now.resumed = now.time < now.end
    if not now.resumed:
        return types.DONE
    if now.steps >= now.budget:
        return types.SPENT
    return types.FULL if now.events >= log_rows else types.GO


@register_jitable(**INNER)
def rubs(contacts):
    """Return whether a pin follows a rigid wall with friction."""
    for k in range(len(contacts)):
        if contacts[k].rigid != 0.0 and contacts[k].phase != types.FLIGHT and contacts[k].friction > 0.0:
            return True
    return False


@register_jitable(**INNER, forceinline=True)
def settled(now, contacts, moved):
    """Have all contacts take part again, once time has moved on since an event on a rigid wall."""
    if now.rigid >= 0 and moved:
        now.rigid = -1
        for k in range(len(contacts)):
            contacts[k].ignored = 0.0


@register_jitable(**INNER)
def meet(run, event):
    """Change a contact's phase at an event; one on a rigid wall is left to the caller. Return how it went."""
    contact = run.contacts[event // 2]
    if contact.rigid == 0.0:
        note(run, event)
        return types.GO
    run.clock[0].rigid, run.clock[0].resumed = event // 2, 0
    return types.SETTLE


@register_jitable(**INNER)
def advance_by_events(run):
    """Advance the motion to the clock's end in place, event by event; return how that ended.

    Events are added to the log, and a sample is written for each of the records' times up to the end. Steps
    do not depend on them; where no events are located, they land on multiples of the clock's interval. An
    event on a rigid wall ends the call: whoever called settles it.
    """
    now, contacts, old, new, times = run.clock[0], run.contacts, run.old, run.new, run.records.time
    if not now.resumed:
        close_at_start(run)
        if now.located:  # pins may have begun to follow rigid walls
            probe(run)
    while True:
        if now.taken < len(times) and times[now.taken] <= now.time and not write_due(run):
            return types.FAILED
        status = due(now, len(run.records.events))
        if status != types.GO:
            return status
        t, h, landing = now.time, now.longest, now.end
        if now.located:
            probe_now_and_then(run)
            h = step_length(contacts, old.gaps, now)
        elif now.interval > 0.0:
            while (now.landed + 1) * now.interval <= t:
                now.landed += 1
            landing = min(landing, (now.landed + 1) * now.interval)
        short = SHORT * now.longest
        h = to_knot(run, h, 0.0, short)
        last = t + h >= landing - 1e-6 * h
        if last:
            h = landing - t
        now.tried = h
        condition = take_step(run, h)
        for _ in range(MOST_SHORTENED if rubs(contacts) else SHORTENED):
            if condition < np.inf:
                break
            h, last = ASIDE * h, False
            condition = take_step(run, h)
        for _ in range(HALVED):
            if not (now.located and condition < np.inf and has_bulged(contacts, old.gaps, new.gaps, h)):
                break
            h, last = 0.5 * h, False
            condition = take_step(run, h)
        for _ in range(LANDINGS):
            landed = to_kink(run, h, landing - t, short)
            if landed == h or not condition < np.inf:
                break
            h, last = landed, False
            condition = take_step(run, h)
        if not condition < np.inf or not finite(new.gaps):
            return types.FAILED
        now.condition = max(now.condition, condition)
        event, whole = -1, h
        if suspicious(contacts, old.gaps, new.gaps):
            event, h = cut(run, h)
        last = last and h == whole
        change = h + now.lost
        new_t = landing if last else t + change
        if now.taken < len(times) and times[now.taken] < new_t and not within(run, h):
            return types.FAILED
        note_largest(run, h, False)
        now.lost = 0.0 if last else change - (new_t - t)
        now.time = new_t
        take(old, new)
        now.steps += 1
        settled(now, contacts, new_t > t)
        if event >= 0 and meet(run, event) == types.SETTLE:
            return types.SETTLE


@compiled(**OPTIONS)
def advance(parts):
    """Advance the motion as ``advance_by_events`` does."""
    return advance_by_events(types.run_of(parts))


@register_jitable(**INNER)
def move_on(run):
    """Move a state without contacts on to ``new``, with what rounding has taken."""
    y, new_y, first = run.slopes[types.OLD], run.slopes[types.NEW], 2 * run.old.n
    for c in range(first):
        y[c] = new_y[c]
    for c in range(first, len(run.old.y)):
        y[c] += new_y[c]
    for c in range(run.clock[0].place_of_h + 1, len(y)):
        y[c] = new_y[c]


@compiled(**OPTIONS)
def advance_equally(parts):
    """Advance a run without events by equal steps, of which samples are multiples; return how that ended."""
    run = types.run_of(parts)
    now, times, h = run.clock[0], run.records.time, run.clock[0].longest
    now.tried = h
    while now.taken < len(times):
        due = round(times[now.taken] / h)
        while now.steps < due:
            now.time = now.steps * h
            if now.steps >= now.budget:
                return types.SPENT
            condition = take_step(run, h)
            if not condition < np.inf:
                return types.FAILED
            now.condition = max(now.condition, condition)
            move_on(run)
            now.steps += 1
        now.time = now.steps * h
        if not write(run, times[now.taken], types.OLD, run.old):
            return types.FAILED
    return types.DONE


@compiled(**OPTIONS)
def write_within(parts, h):
    """Write the samples before the end of a step of h that has been taken; return whether it could."""
    run = types.run_of(parts)
    times = run.records.time
    return (
        run.clock[0].taken == len(times)
        or times[run.clock[0].taken] >= run.clock[0].time + h
        or within(run, h)
    )
