"""What is noted of a crank-slider after every step of its run: impacts, flight, forces and the deviation.

Numba compiles this module as it stands (see ``reference_solver.contact.members``). Between the ends of a
step, which no event lies within, penetrations and the slider's deviation are the cubics through values and
rates at both; forces are the law's on them.
"""

import math

import numpy as np
from numba.extending import register_jitable

from reference_solver.contact import loop, types
from reference_solver.contact.loop import INNER, OPTIONS, cubic, depth_rate

__all__ = ["COMPILED_WITH", "NOTES_RECORD", "OPTIONS", "observe"]

#: Modules whose constants the machine code has taken over.
COMPILED_WITH = (types, loop)

#: When the notes begin, crank radius and rod length; at the step before: time, crank angle, the slider's
#: deviation from where ideal joints would have it, and its rate. What is noted: time in which all pins fly,
#: impulses of impacts, speeds of touches, the largest normal force and deviation, and the integral of the
#: deviation's square; how many touches, and impacts that are over.
NOTES_RECORD = types.record(
    "from_s crank_m rod_m time angle deviation rate flight_s impulse speed force far square", "touches over"
)

#: Where in a step the force is looked at: its maximum is known to 1e-4 of it with steps of half a radian of a
#: contact's swing.
PARTS = 8
#: Gauss's places in (-1, 1) and weights, by which the integral of a cubic's square is exact.
GAUSS = (
    (-0.8611363115940526, 0.34785484513745385),
    (-0.33998104358485626, 0.6521451548625461),
    (0.33998104358485626, 0.6521451548625461),
    (0.8611363115940526, 0.34785484513745385),
)
#: A largest rate between the ends of a step, as a part of that at them: of a cubic that turns back.
FASTER = 1.5


@register_jitable(**INNER)
def deviation_at(note, motion):
    """Return how far the slider is from its place with ideal joints at the crank's angle, and its rate."""
    angle, speed, n = motion.y[2], motion.y[motion.n + 2], motion.n
    r, sine, cosine = note.crank_m, math.sin(angle), math.cos(angle)
    reach = math.sqrt(max(note.rod_m * note.rod_m - r * r * sine * sine, 0.0))
    ideal, slope = r * cosine + reach, -r * sine - r * r * sine * cosine / reach
    return motion.y[6] - ideal, motion.y[n + 6] - slope * speed


@register_jitable(**INNER)
def farthest(x, h, value, rate, new_value, new_rate):
    """Return the largest size of such a cubic from x on to the end of the step."""
    begin, _, _ = cubic(x, h, value, rate, new_value, new_rate)
    most = max(abs(begin), abs(new_value))
    change, start, stop = new_value - value, h * rate, h * new_rate
    second, third = 3.0 * change - 2.0 * start - stop, start + stop - 2.0 * change
    # Where start + 2 second x + 3 third x^2 = 0.
    under = second * second - 3.0 * third * start
    if under >= 0.0:
        q = -second - math.copysign(math.sqrt(under), second)
        for turn in (q / (3.0 * third), start / q):
            if x < turn < 1.0:
                there, _, _ = cubic(turn, h, value, rate, new_value, new_rate)
                most = max(most, abs(there))
    return most


@register_jitable(**INNER)
def integral_of_square(x, h, value, rate, new_value, new_rate):
    """Return the integral over time of such a cubic's square, from x on to the end of the step."""
    total, half = 0.0, 0.5 * (1.0 - x)
    for place, weight in GAUSS:
        there, _, _ = cubic(x + half * (1.0 + place), h, value, rate, new_value, new_rate)
        total += weight * there * there
    return half * h * total


@register_jitable(**INNER)
def force_of(contact, damping, depth, rate):
    """Return the normal force of the law in N at a penetration and its rate."""
    elastic = contact.stiffness * max(depth, 0.0) ** contact.exponent
    return elastic * (1.0 + contact.memory * rate) + damping * rate


@register_jitable(**INNER)
def strongest(largest, contact, past, gap, x, h):
    """Return the largest normal force of a contact from x on to the end of a step, or ``largest``."""
    rate = depth_rate(contact, gap)
    damping = gap.damper - gap.elastic * contact.memory
    deepest = max(past.depth, gap.depth) + 4.0 / 27.0 * h * (abs(past.rate) + abs(rate))
    if not force_of(contact, damping, deepest, FASTER * max(past.rate, rate, 0.0)) > largest:
        return largest
    for part in range(PARTS + 1):
        at = x + (1.0 - x) * part / PARTS
        depth, speed, _ = cubic(at, h, past.depth, past.rate, gap.depth, rate)
        largest = max(largest, force_of(contact, damping, depth, speed))
    return largest


@register_jitable(**INNER)
def note_step(note, past, contacts, motion, time, deviation, rate):
    """Note what lies within a step, as far as that is within the notes' time."""
    h, closed = time - note.time, False
    x = max(0.0, (note.from_s - note.time) / h)
    for k in range(len(contacts)):
        closed = closed or past[k].phase != types.FLIGHT
        if past[k].phase == types.CONTACT:
            note.force = strongest(note.force, contacts[k], past[k], motion.gaps[k], x, h)
    if not closed:
        note.flight_s += (1.0 - x) * h
    note.square += integral_of_square(x, h, note.deviation, note.rate, deviation, rate)
    bound = max(abs(note.deviation), abs(deviation)) + 4.0 / 27.0 * h * (abs(note.rate) + abs(rate))
    if bound > note.far:
        note.far = max(note.far, farthest(x, h, note.deviation, note.rate, deviation, rate))


@register_jitable(**INNER)
def note_event(note, past, event, sums, angle, touches, noted):
    """Note a touch, or that an impact is over; return how many touches are noted."""
    before, late = past[event.contact], event.time_s >= note.from_s
    if event.what == 1:
        before.impulse = sums[before.sum] if late else np.nan
        if late:
            note.touches += 1
            note.speed += event.rate
            touches[noted] = angle % (2.0 * math.pi)
            return noted + 1
    elif event.what == -1 and not math.isnan(before.impulse):
        note.over += 1
        note.impulse += sums[before.sum] - before.impulse
    return noted


def observe(notes, past, contacts, motion, clock, events, event_sums, first, touches, noted):
    """Take notes of a member (see ``members.observer_type``)."""
    note, time, angle = notes[0], clock[0].time, motion.y[2]
    deviation, rate = deviation_at(note, motion)
    if first >= 0 and time > note.time and time > note.from_s:
        note_step(note, past, contacts, motion, time, deviation, rate)
    if first >= 0:
        for e in range(first, clock[0].events):
            # A pin that is closed at the start touches there, which is noted with the first step.
            there = angle if events[e].time_s == time else note.angle
            noted = note_event(note, past, events[e], event_sums[e], there, touches, noted)
    for k in range(len(contacts)):
        gap = motion.gaps[k]
        past[k].depth = gap.depth
        past[k].rate = depth_rate(contacts[k], gap)
        past[k].phase = contacts[k].phase
        if first < 0:
            past[k].impulse = np.nan
            past[k].phase = types.CONTACT if gap.g > 0.0 else types.FLIGHT
    note.time, note.angle, note.deviation, note.rate = time, angle, deviation, rate
    return noted
