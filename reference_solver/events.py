"""Events within a step: touch, release and changes of the force's sign; what they do to contacts.

Between events every right-hand side is smooth. An event is first sought on the quintic through positions,
velocities and accelerations at both ends of the step, which costs no right-hand side; the step to it is then
corrected by Newton's method.
"""

import numpy as np

from reference_solver.machine_code import inner
from reference_solver.mechanism.contacts import CLIPPED, CONTACT, FLIGHT
from reference_solver.run import AT, CLIP, NEW, OLD, RELEASE, RESUME, TOUCH
from reference_solver.steps import ROUND_OFF, Step, attempt, gap_of, know_slopes, place_at, probe, set_within

#: Rejections after which a pin that may have been out within a step is taken to be in: round-off looks so.
MOST_HALVED = 20
#: Part of a step by which one that ends short of a change of the force's sign is made longer at first.
PAST = 1e-10
#: Parts of the tolerance and of the clearance within which a step ends on its event; the most trials for it.
LANDING, LANDING_CLEARANCE, LANDINGS = 1e-2, 2e-6, 6
#: The parts of a step to which the turn of a gap is located, and a contact's largest force.
TURNED, PEAK = 1e-9, 1e-6


@inner
def alarm(contact, gap, kind):
    """Return a number that is positive past the event: 0 is touch or release, 1 a change of the force's sign.

    A rigid wall is touched by the first, and released by the second.
    """
    if contact.phase == FLIGHT:
        return gap.g if kind == 0 else -1.0
    if contact.rigid != 0.0:
        return -1.0 if kind == 0 else -gap.push
    if kind == 0:
        return -gap.g
    if contact.clipped == 0.0:
        return -1.0
    return -gap.push if contact.phase == CONTACT else gap.push


@inner
def passed(contact, gap, new_gap, kind):
    """Return whether an event lies within a step, by both its ends.

    A pin before a rigid wall passes it by more than round-off, or on its way out. A compliant contact that
    begins past its event by round-off passes it only if it goes on.
    """
    value = alarm(contact, new_gap, kind)
    if kind == 1:
        return value > 0.0
    if contact.rigid != 0.0:
        past = value > contact.noise or (value > 0.0 and new_gap.rate > contact.rate_noise)
        return past and contact.ignored == 0.0
    outwards = 1.0 if contact.phase == FLIGHT else -1.0
    begin, end = outwards * gap.g, outwards * new_gap.g
    return end > 0.0 and (outwards * new_gap.rate > 0.0 or begin <= 0.0 or end > begin)


@inner
def alarm_at(run, rows, contacts, h, x, event):
    """Return an event's alarm at x of a step of h."""
    set_within(run, rows, h, x, run.time)
    return alarm(contacts[event // 2], gap_of(run, rows, AT, event // 2), event % 2)


@inner
def turning(run, rows, contacts, h, k, rising):
    """Return where a gap turns that is rising, or falling, at a step's start (Illinois method).

    A rising one is followed no further than to where it is past its wall.
    """
    low, high = 0.0, 1.0
    low_rate, high_rate = gap_of(run, rows, OLD, k).rate, gap_of(run, rows, NEW, k).rate
    for _ in range(30):
        if high - low < TURNED:
            break
        x = high - high_rate * (high - low) / (high_rate - low_rate)
        if not low < x < high:
            x = 0.5 * (low + high)
        value, rate = alarm_at(run, rows, contacts, h, x, 2 * k), gap_of(run, rows, AT, k).rate
        if rising and contacts[k].phase == FLIGHT and value > 0.0:
            return x
        if (rate > 0.0) == rising:
            low, low_rate, high_rate = x, rate, 0.5 * high_rate
        else:
            high, high_rate, low_rate = x, rate, 0.5 * low_rate
    return high


@inner
def root(run, rows, contacts, h, event, low, high):
    """Return where between two places of a step the alarm of an event passes zero (Illinois method)."""
    low_value = alarm_at(run, rows, contacts, h, low, event)
    high_value = alarm_at(run, rows, contacts, h, high, event)
    if low_value > 0.0:
        return low
    for _ in range(60):
        if not high_value > 0.0 or high - low < 1e-12:
            break
        x = high - high_value * (high - low) / (high_value - low_value)
        if not low < x < high:
            x = 0.5 * (low + high)
        value = alarm_at(run, rows, contacts, h, x, event)
        if value > 0.0:
            high, high_value, low_value = x, value, 0.5 * low_value
        else:
            low, low_value, high_value = x, value, 0.5 * high_value
    return high


@inner
def gap_noise(run, rows, lever):
    """Return the round-off of a gap at the end of a step, that of angles times a lever included."""
    far = run.length
    for c in range(run.n):
        far = max(far, abs(rows[NEW, c]) * (lever if c % 3 == 2 else 1.0))
    return ROUND_OFF * far


@inner
def first_event(run, rows, contacts, h, skip):
    """Return the first event but ``skip`` within a step and its place in it, or -1 and 1.

    An event is numbered 2 k + kind of contact k.
    """
    event, place = -1, 1.0
    for k in range(len(contacts)):
        contact, gap, new_gap = contacts[k], gap_of(run, rows, OLD, k), gap_of(run, rows, NEW, k)
        flies, rising = contact.phase == FLIGHT, gap.rate > 0.0
        for kind in range(2):
            low, high = 0.0, -1.0
            if 2 * k + kind == skip:
                continue
            if passed(contact, gap, new_gap, kind):
                know_slopes(run, h)
                high = 1.0
                if kind == 0 and rising != flies:
                    low = turning(run, rows, contacts, h, k, rising)
            elif kind == 0 and flies and contact.ignored == 0.0 and rising and new_gap.rate < 0.0:
                know_slopes(run, h)
                high = turning(run, rows, contacts, h, k, rising)
                if gap_of(run, rows, AT, k).g <= max(gap_noise(run, rows, 0.0), contact.noise):
                    continue
            if high > 0.0:
                x = root(run, rows, contacts, h, 2 * k + kind, low, high)
                if event < 0 or x < place:
                    event, place = 2 * k + kind, x
    return event, place


@inner
def land(run, rows, contacts, method, step, end, event, taken):
    """End the step on an event near a time; return it, with NaN for its end if it cannot.

    By Newton's method on the gap, of which a step from the same start is a smooth function of its end; a
    change of the force's sign has to be past. ``taken`` is whether the step has been taken already.
    """
    k, exact, t = event // 2, event % 2 == 0, run.time
    contact, latest, least = contacts[k], t + 1.5 * (end - t), gap_noise(run, rows, 0.0)
    if contact.rigid == 0.0 and run.controlled != 0:
        close = min(LANDING * run.tolerance * run.length, LANDING_CLEARANCE * contact.clearance)
        least = max(least, close)
    for trials in range(LANDINGS):
        if trials > 0 or not taken:
            if step.sign < 0.0 and exact:
                begin = np.sqrt(end - t)
                step = Step(end, -1.0, begin, -begin, end)
            else:
                step = Step(step.origin, step.sign, step.begin, place_at(step, end) - step.begin, end)
            if not attempt(run, rows, contacts, method, step, 10.0) < 10.0:
                break
        gap = gap_of(run, rows, NEW, k)
        if exact:
            more = -gap.g / gap.rate
            if abs(gap.g) <= least or abs(more) <= 1e-15 * end:
                return step
            ahead = t < end + more < latest and (gap.rate > 0.0) == (contact.phase == FLIGHT)
            if trials == LANDINGS - 1 or not ahead:
                if abs(gap.g) <= gap_noise(run, rows, run.length):  # angles are coarse after many turns
                    return step
                break
        else:
            more = PAST * (end - t) * 100.0**trials
            if alarm(contact, gap, 1) > 0.0:
                return step
        end += more
    return Step(step.origin, step.sign, step.begin, 0.0, np.nan)


@inner
def cut(run, rows, contacts, method, step, releasing):
    """Return a step that has been taken, or the one to the first event in it, the event, and its place.

    Without an event that is -1; the end is NaN where the step is to be tried again, and a place of 0 says
    that the event has been passed by the round-off of one that came with it. Where events are not located,
    the whole step is returned.
    """
    event, place, most, t = -1, 1.0, 2 * len(contacts), run.time
    again = Step(step.origin, step.sign, step.begin, step.H, np.nan)
    if run.located == 0:
        for k in range(2 * len(contacts)):
            if event < 0 and alarm(contacts[k // 2], gap_of(run, rows, NEW, k // 2), k % 2) > 0.0:
                event = k
        return step, event, place
    for k in range(len(contacts)):
        # A pin that moves inwards at both ends may have been out in between where the cubic through g and its
        # rates comes near to rising, and has the wall in reach: it is back, and off again, in a shorter step.
        gap, new_gap, h = gap_of(run, rows, OLD, k), gap_of(run, rows, NEW, k), step.end - t
        inwards = contacts[k].phase == FLIGHT and gap.rate < 0.0 and new_gap.rate < 0.0
        if inwards and run.rejected < MOST_HALVED:
            steepest = 1.5 * (new_gap.g - gap.g) / h - 0.25 * (gap.rate + new_gap.rate)
            excess = steepest - 0.25 * min(gap.rate, new_gap.rate)
            if excess > 0.0 and max(gap.g, new_gap.g) + excess * h > contacts[k].noise:
                return again, event, place
    for trials in range(most + 1):  # another event may turn out to come before, if they are close
        other, place = first_event(run, rows, contacts, step.end - t, event)
        if trials == 0 and other < 0 and releasing >= 0:
            gap = gap_of(run, rows, NEW, releasing)
            if gap.rate < 0.0 and gap.g < -0.2 * (step.end - t) * gap.rate:
                other = 2 * releasing
        if other < 0:
            break
        event = other
        if place <= 0.0 or trials == most:
            break
        step = land(run, rows, contacts, method, step, t + place * (step.end - t), event, place >= 1.0)
        if np.isnan(step.end):
            return step, event, place
    for k in range(len(contacts)):  # past its wall in flight, or off it in contact
        outwards = 1.0 if contacts[k].phase == FLIGHT else -1.0
        far = 2.0 * LANDING_CLEARANCE * contacts[k].clearance
        if event < 0 and contacts[k].rigid == 0.0 and outwards * gap_of(run, rows, NEW, k).g > far:
            return again, event, place
    return step, event, place


@inner
def note(run, rows, contacts, event):
    """Change a compliant contact's phase at an event and write the event into the log."""
    k, entry, first = event // 2, run.events[run.logged], 2 * run.n
    contact, gap, old = contacts[k], gap_of(run, rows, OLD, k), rows[OLD]
    impulse, lost = old[first + contact.column], 0.0
    for c in range(contact.losses):
        lost += old[first + contact.column + 1 + c]
    run.logged += 1
    entry.time_s, entry.contact, entry.rate, entry.depth = run.time, k, gap.rate, gap.depth
    entry.began_s, entry.approach = contact.began_s, contact.approach
    entry.force, entry.force_s = contact.force, contact.force_s
    entry.deepest, entry.deepest_s = contact.deepest, contact.deepest_s
    entry.impulse, entry.lost = impulse - contact.impulse, lost - contact.dissipated
    if event % 2 == 1:
        contact.phase = CLIPPED if contact.phase == CONTACT else CONTACT
        entry.what = CLIP if contact.phase == CLIPPED else RESUME
    elif contact.phase != FLIGHT:
        contact.phase, entry.what = FLIGHT, RELEASE
        run.step, run.fresh = run.flight_step, -1
    else:
        closed = 0
        for i in range(len(contacts)):
            closed += contacts[i].phase != FLIGHT and contacts[i].rigid == 0.0
        if closed == 0:
            run.flight_step = run.step
        probe(run, rows, contacts)  # the mobility tells how long the contact will take
        n, speed = contact.exponent, max(gap.rate, contact.slowest)
        energy = (n + 1.0) * speed * speed / (2.0 * contact.stiffness * contact.mobility)
        contact.phase, entry.what, contact.memory = CONTACT, TOUCH, contact.factor / speed
        contact.began_s = contact.force_s = contact.deepest_s = run.time
        contact.force, contact.deepest = -np.inf, 0.0
        contact.approach, contact.impulse, contact.dissipated = gap.rate, impulse, lost
        contact.duration_s = 3.0 * energy ** (1.0 / (n + 1.0)) / speed
        if 0.0 < contact.duration_s < np.inf:
            run.step, run.fresh = run.first_part * contact.duration_s, k


@inner
def falls(contact, gap, new_gap, h):
    """Return whether the normal force falls at the end of a step of h, by the cubic of its penetration."""
    c, new_depth = contact.clearance, new_gap.depth
    rate, slope = gap.rate * c / (c + gap.depth), new_gap.rate * c / (c + new_depth)
    curve = ((4.0 * slope + 2.0 * rate) - 6.0 * (new_depth - gap.depth) / h) / h
    stiffer = contact.exponent * new_gap.elastic * slope * (1.0 + contact.memory * slope)
    return stiffer + new_gap.damper * curve * new_depth <= 0.0


@inner
def keep_largest(contact, gap, time):
    """Keep force and penetration at a time, if they are a contact's largest so far; return the force."""
    force = gap.elastic * gap.push
    if force > contact.force:
        contact.force, contact.force_s = force, time
    if gap.depth > contact.deepest:
        contact.deepest, contact.deepest_s = gap.depth, time
    return force


@inner
def force_at(run, rows, contacts, h, x, k):
    """Return the normal force of a contact at x of a step of h, and keep it if it is the largest so far."""
    set_within(run, rows, h, x, run.time)
    return keep_largest(contacts[k], gap_of(run, rows, AT, k), run.time + x * h)


@inner
def note_largest(run, rows, contacts, h):
    """Note the largest normal forces and penetrations of the compliant contacts in a step of h.

    Within it they are sought on the quintic: where the penetration turns, and by thirds where the force does.
    """
    for k in range(len(contacts)):
        contact, gap, new_gap = contacts[k], gap_of(run, rows, OLD, k), gap_of(run, rows, NEW, k)
        if contact.phase != CONTACT or contact.rigid != 0.0:
            continue
        force, new_force = gap.elastic * gap.push, keep_largest(contact, new_gap, run.time + h)
        turns, over = gap.rate > 0.0 > new_gap.rate, new_force < force < contact.force
        peaks = not over and falls(contact, gap, new_gap, h)
        if turns or peaks:
            know_slopes(run, h)
        if turns:
            force_at(run, rows, contacts, h, turning(run, rows, contacts, h, k, True), k)
        low, high = 0.0, 1.0
        while peaks and high - low > PEAK:
            x, y = (2.0 * low + high) / 3.0, (low + 2.0 * high) / 3.0
            if force_at(run, rows, contacts, h, x, k) < force_at(run, rows, contacts, h, y, k):
                low = x
            else:
                high = y
