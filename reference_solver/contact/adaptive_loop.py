"""The loop of error control: a method with its embedded estimate, DOP853 or DOPRI5, from event to event.

Numba compiles this module as it stands, once for all mechanisms and methods, and without Numba it runs too,
as ``contact.loop`` does, which has the events themselves. A step of DOP853 is as long as ten of RK4's, so an
event is first sought on the quintic through positions, velocities and accelerations at both ends, which costs
no right-hand side; steps that end there are then corrected by Newton's method.

Near touch and release forces go with powers of the penetration that are no whole numbers, as delta^1.5, and
no method keeps its order over them. There the step is one in s, with the time t = t0 + s^2 from a touch on
and t = t1 - s^2 up to a release: the penetration, of order s^2, has the square root s, and the force is
smooth in s.
"""

import numpy as np
from numba.extending import register_jitable

from reference_solver.contact import controlled_step, loop
from reference_solver.contact.controlled_step import (
    Course,
    Step,
    again,
    changed,
    finish,
    move_on,
    no_further,
    place_at,
    set_out,
    trial,
    within,
)
from reference_solver.contact.loop import INNER
from reference_solver.contact.types import FAILED, FLIGHT, GO, NEW, SETTLE, run_of
from reference_solver.machine_code import OPTIONS, compiled

#: Part of the clearance (or of a radian) that a pin crosses in a step of flight.
FLIGHT_PART = 0.5
#: Part of the distance in time to a release that is left to a step which does not end there.
LEFT = 0.05
#: Parts of the tolerance and of the clearance within which a step ends on its event; round-off of the gap, as
#: a part of the mechanism's length, or of how far it is from the origin; and the most trials for it.
LANDING, LANDING_CLEARANCE, ROUND_OFF, LANDINGS = 1e-2, 2e-6, 1.5e-15, 6
#: Part of a step by which one that ends short of a change of the force's sign is made longer at first.
PAST = 1e-10
#: Bounds of a contact's first step, as a part of its duration.
SHORTEST_PART, LONGEST_PART = 1e-6, 0.5


# ------------------------------------------------------------------------------------------ time


@register_jitable(**INNER)
def lasting(course, H):
    """Return how long a step of H in s lasts."""
    return H if course.sign == 0.0 else abs((2.0 * course.begin + H) * H)


@register_jitable(**INNER)
def remaining(contact, gap):
    """Return the time that a pin on its way out is from release, if the wall's elastic force alone acts.

    From rest it is 1.4716 depths over the final speed, exactly so for the exponent 1.5 (Hertz).
    """
    power = contact.exponent + 1.0
    rate, pushed = abs(gap.rate), 2.0 / power * contact.mobility * contact.stiffness * gap.depth**power
    speed = np.sqrt(rate * rate + pushed)
    return gap.depth / speed * (1.0 + 0.4716 * (1.0 - rate / speed))


@register_jitable(**INNER, forceinline=True)
def course_of(contacts, gaps, t, h, careful):
    """Return the course of a step of h at most, its length in s, and the contact released at its end, or -1.

    ``careful`` steps do not try for a release. Only one contact has the square root of its own time.
    """
    closed, k = 0, -1
    for i in range(len(contacts)):
        if contacts[i].phase != FLIGHT and contacts[i].rigid == 0.0:
            closed, k = closed + 1, i
    if closed == 1 and contacts[k].exponent % 1.0 != 0.0:
        contact, gap = contacts[k], gaps[k]
        since, left = t - contact.began_s, 0.0
        if gap.rate >= 0.0 and 0.0 <= since < contact.duration_s:
            begin = np.sqrt(since)
            return Course(contact.began_s, 1.0, begin), np.sqrt(since + h) - begin, -1
        if gap.rate < 0.0 and gap.depth > 0.0:
            left = remaining(contact, gap)
        if left > 0.0 and t + left > t:
            begin = np.sqrt(left)
            course = Course(t + left, -1.0, begin)
            if h >= (1.0 - LEFT) * left and not careful:
                return course, -begin, k
            return course, np.sqrt(max(left - h, LEFT * LEFT * left)) - begin, -1
    return Course(t, 0.0, 0.0), h, -1


# ---------------------------------------------------------------------------------------- events


@register_jitable(**INNER)
def round_off(run):
    """Return the round-off of a gap at the end of a step."""
    far = run.control[0].length
    for c in range(run.new.n):
        if c % 3 != 2:
            far = max(far, abs(run.new.y[c]))
    return ROUND_OFF * far


@register_jitable(**INNER)
def turning(run, h, k, rising):
    """Return where the gap of a contact turns that is rising, or falling, at a step's start.

    A rising one is followed no further than to where it is past its wall.
    """
    low, high = 0.0, 1.0
    for _ in range(30):
        x = 0.5 * (low + high)
        value = loop.value_on(run, h, x, 2 * k)
        if rising and run.contacts[k].phase == FLIGHT and value > 0.0:
            return x
        if (run.at.gaps[k].rate > 0.0) == rising:
            low = x
        else:
            high = x
    return high


@register_jitable(**INNER)
def root(run, h, event, low, high):
    """Return where between two places of a step the alarm of an event passes zero (Illinois method)."""
    low_value, high_value = loop.value_on(run, h, low, event), loop.value_on(run, h, high, event)
    if low_value > 0.0:
        return low
    for _ in range(60):
        if not high_value > 0.0 or high - low < 1e-12:
            break
        x = high - high_value * (high - low) / (high_value - low_value)
        if not low < x < high:
            x = 0.5 * (low + high)
        value = loop.value_on(run, h, x, event)
        if value > 0.0:
            high, high_value, low_value = x, value, 0.5 * low_value
        else:
            low, low_value, high_value = x, value, 0.5 * high_value
    return high


@register_jitable(**INNER)
def passed(contact, gap, new_gap, kind):
    """Return whether an event lies within a step, by both its ends."""
    if kind == 1 or contact.rigid != 0.0:
        return loop.gone_off(contact, new_gap, kind)
    outwards = 1.0 if contact.phase == FLIGHT else -1.0
    begin, end = outwards * gap.g, outwards * new_gap.g
    # What begins past its wall by round-off, on its way back, is past it still while it comes nearer.
    return end > 0.0 and (outwards * new_gap.rate > 0.0 or begin <= 0.0 or end > begin)


@register_jitable(**INNER, forceinline=True)
def unseen(contacts, gaps):
    """Return whether a pin is past its wall in flight, or off it in contact, by more than landing leaves."""
    for k in range(len(contacts)):
        outwards = 1.0 if contacts[k].phase == FLIGHT else -1.0
        far = 2.0 * LANDING_CLEARANCE * contacts[k].clearance
        if contacts[k].rigid == 0.0 and outwards * gaps[k].g > far:
            return True
    return False


@register_jitable(**INNER)
def first_event(run, h, skip):
    """Return the first event but ``skip`` within a step and its place in it, or -1 and 1."""
    event, place, noise = -1, 1.0, round_off(run)
    for k in range(len(run.contacts)):
        contact, gap, new_gap = run.contacts[k], run.old.gaps[k], run.new.gaps[k]
        rising = gap.rate > 0.0
        for kind in range(2):
            low, high = 0.0, -1.0
            if 2 * k + kind == skip:
                continue
            if passed(contact, gap, new_gap, kind):
                high = 1.0
                if kind == 0 and rising != (contact.phase == FLIGHT):
                    low = turning(run, h, k, rising)
            elif kind == 0 and loop.turned_back(contact, gap, new_gap):
                high = turning(run, h, k, rising)
                if run.at.gaps[k].g <= max(noise, contact.noise):
                    continue
            if high > 0.0:
                x = root(run, h, 2 * k + kind, low, high)
                if event < 0 or x < place:
                    event, place = 2 * k + kind, x
    return event, place


@register_jitable(**INNER)
def land(run, step, end, event, taken):
    """End the step on an event near a time; return it, with NaN for its end if it cannot.

    By Newton's method on the gap, of which a step from the same start is a smooth function of its end; a
    change of the force's sign has to be past. ``taken`` is whether the step has been taken already.
    """
    k, exact, t, (course, H, _) = event // 2, event % 2 == 0, run.clock[0].time, step
    latest = t + 1.5 * (end - t)
    contact, gap, control, least = run.contacts[k], run.new.gaps[k], run.control[0], round_off(run)
    if contact.rigid == 0.0:
        close = min(LANDING * control.tolerance * control.length, LANDING_CLEARANCE * contact.clearance)
        least = max(least, close)
    for trials in range(LANDINGS):
        if trials > 0 or not taken:
            if course.sign < 0.0 and exact:
                course = Course(end, -1.0, np.sqrt(end - t))
                H = -course.begin
            else:
                H = place_at(course, end) - course.begin
            if not trial(run, course, H) < 10.0 or not end_step(run, end):
                break
        if exact:
            more = -gap.g / gap.rate
            if abs(gap.g) <= least or abs(more) <= 1e-15 * end:
                return Step(course, H, end)
            if not (t < end + more < latest and (gap.rate > 0.0) == (contact.phase == FLIGHT)):
                break
        else:
            more = PAST * (end - t) * 100.0**trials
            if loop.alarm(contact, gap, 1) > 0.0:
                return Step(course, H, end)
        end += more
    return Step(course, 0.0, np.nan)


# -------------------------------------------------------------------------------------- the loop


@register_jitable(**INNER, forceinline=True)
def chosen(run):
    """Return the step to try, and the contact that is released at its end, or -1."""
    contacts, gaps, now, control = run.contacts, run.old.gaps, run.clock[0], run.control[0]
    h = loop.in_flight(
        contacts, gaps, loop.to_knot(run, min(control.step, now.longest), 1.0, 0.0), FLIGHT_PART
    )
    course, H, releasing = course_of(contacts, gaps, now.time, h, control.rejected != 0)
    step = no_further(now, course, H)
    return step, releasing if step.end < now.end else -1


@register_jitable(**INNER, forceinline=True)
def end_step(run, t):
    """Move the new state onto its constraints, and set its slope and its gaps; return whether it could."""
    return finish(run, t) and loop.set_gaps(run, t, NEW, run.new)


@register_jitable(**INNER, forceinline=True)
def tried(run, step):
    """Take a step; return its error over the tolerance, and the factor by which it changes."""
    contacts, control, duration = run.contacts, run.control[0], run.clock[0].tried
    error = trial(run, step.course, step.H) / max(1.0, noise(contacts, run.old.gaps, control, duration))
    if error <= 1.0 and not end_step(run, step.end):
        error = np.inf
    if error <= 1.0 and loop.in_flight(contacts, run.new.gaps, duration, FLIGHT_PART) < 0.5 * duration:
        error = np.inf
    return error, changed(error, control, run.method.exponent)


@register_jitable(**INNER)
def cut(run, step, releasing):
    """Return a step that has been taken, or the one to the first event in it, the event, and its place.

    Without an event that is -1; the end is NaN where the step is to be tried again, and a place of 0 says
    that the event has been passed by the round-off of one that came with it.
    """
    contacts, gaps, t = run.contacts, run.new.gaps, run.clock[0].time
    event, place, most = -1, 1.0, 2 * len(contacts)
    if loop.has_bulged(contacts, run.old.gaps, gaps, step.end - t):
        return Step(step.course, step.H, np.nan), event, place
    for trials in range(most + 1):  # another event may turn out to come before, if they are close
        other, place = first_event(run, step.end - t, event)
        if trials == 0 and other < 0 and releasing >= 0:
            gap = gaps[releasing]
            if gap.rate < 0.0 and gap.g < -0.2 * (step.end - t) * gap.rate:
                other = 2 * releasing
        if other < 0:
            break
        event = other
        if place <= 0.0 or trials == most:
            break
        step = land(run, step, t + place * (step.end - t), event, place >= 1.0)
        if np.isnan(step.end):
            return step, event, place
    if event < 0 and unseen(contacts, gaps):
        step = Step(step.course, step.H, np.nan)
    return step, event, place


@register_jitable(**INNER, forceinline=True)
def accept(run, step, event, error, factor):
    """Move on to the end of a step, and choose the one after it."""
    now, control, contacts = run.clock[0], run.control[0], run.contacts
    loop.note_largest(run, step.end - now.time, True)
    loop.settled(now, contacts, step.end > now.time)
    move_on(run, step.end, error)
    for k in range(len(contacts)):
        run.old.gaps[k] = run.new.gaps[k]
    if event < 0 and step.end < now.end:
        control.step = next_step(step.course, step.H, factor)
        if control.fresh >= 0:
            part = lasting(step.course, step.H * factor) / contacts[control.fresh].duration_s
            control.first_part, control.fresh = min(LONGEST_PART, max(SHORTEST_PART, part)), -1


@register_jitable(**INNER)
def next_step(course, H, factor):
    """Return the step in time after one of H in s."""
    if course.sign == 0.0:
        return H * factor
    reached = course.begin + H
    if course.sign < 0.0 and reached + H * factor <= 0.0:  # beyond the release
        return max(1.5 * reached * reached, factor * lasting(course, H))
    return lasting(Course(course.origin, course.sign, reached), H * factor)


@register_jitable(**INNER)
def go_on(run, event):
    """Change a contact's phase at an event, and choose the step after it; return how that ended."""
    control, contacts, k, closed = run.control[0], run.contacts, event // 2, 0
    for i in range(len(contacts)):
        closed += contacts[i].phase != FLIGHT and contacts[i].rigid == 0.0
    if loop.meet(run, event) == SETTLE:
        return SETTLE
    if event % 2 == 0 and contacts[k].phase != FLIGHT:
        if closed == 0:
            control.flight_step = control.step
        first = control.first_part * contacts[k].duration_s
        if 0.0 < first < np.inf:
            control.step, control.fresh = first, k
    elif event % 2 == 0:
        control.step, control.fresh = control.flight_step, -1
    return set_out(run)


@register_jitable(**INNER, forceinline=True)
def noise(contacts, gaps, control, h):
    """Return what round-off of positions alone makes of a step's error over the tolerance.

    It changes forces by the slope of the stiffest contact, and speeds by that for as long as the step lasts:
    a tolerance below it would have steps shortened for nothing.
    """
    steepest = 0.0
    for k in range(len(contacts)):
        if contacts[k].phase != FLIGHT and contacts[k].rigid == 0.0 and gaps[k].depth > 0.0:
            slope = contacts[k].exponent * gaps[k].elastic / gaps[k].depth
            steepest = max(steepest, slope * contacts[k].mobility)
    return steepest * ROUND_OFF * h / (control.tolerance * control.rate)


@register_jitable(**INNER)
def advance_by_events(run):
    """Advance the motion in place, as ``contact.loop.advance_by_events`` does with located events."""
    now, control = run.clock[0], run.control[0]
    status = GO
    if not now.resumed:
        loop.close_at_start(run)
        status = set_out(run)
    while status == GO:
        if not loop.write_due(run):
            return FAILED
        status = loop.due(now, len(run.records.events))
        if status != GO:
            return status
        loop.probe_now_and_then(run)
        first, releasing = chosen(run)
        error, factor = tried(run, first)
        for _ in range(loop.LANDINGS):
            landed = controlled_step.to_kink(run, first)
            if landed.H == first.H or not error <= 1.0:
                break
            first, releasing = landed, -1
            error, factor = tried(run, first)
        if not error <= 1.0:
            status = again(control, now.time, lasting(first.course, first.H * factor))
            continue
        step, event, place = cut(run, first, releasing)
        if np.isnan(step.end):
            status = again(control, now.time, 0.5 * now.tried)
            continue
        now.steps += 1
        if event < 0 or place > 0.0:
            if not within(run, step):
                return FAILED
            accept(run, step, event, error, factor)
        if event >= 0:
            status = go_on(run, event)
    return status


@compiled(**OPTIONS)
def advance(parts):
    """Advance the motion as ``advance_by_events`` does."""
    return advance_by_events(run_of(parts))
