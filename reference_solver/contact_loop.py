"""The driver of contacts: RK4 steps that land on every touch and release, graded into and out of contact.

Numba compiles this text once for all mechanisms (see ``contact_driver``): ``step``, ``gap_accelerations`` and
``slopes``, parameters here, are functions of the mechanism's own kernel. It uses arrays and numbers only.

A contact is in one of three phases: in flight, in contact, or in contact with the force clipped because
the law would pull. Between events every right-hand side is smooth; an event is located by shortening the
step until its end lies on it. ``laws[k]`` is (K, n, a, minimum impact speed, clearance, mu/v_reg, c, 1 if
clipped), ``touch[k]`` (time of touch, expected duration, mobility), ``control`` (longest step, steps per
contact, 1 to locate events).
"""

import numpy as np

from reference_solver.contact_events import (
    CLIPPED,
    CONTACT,
    FLIGHT,
    PROBE,
    FloatArray,
    Function,
    approach,
    first_alarm,
    locate,
)
from reference_solver.contact_samples import within, write


def finite(gap: FloatArray) -> bool:
    """Return whether all gaps are finite: what overflows anywhere is in them a step later."""
    total = 0.0
    for k in range(len(gap)):
        total += gap[k, 3]
    return bool(np.isfinite(total))


def graded(h: float, duration: float, distance: float) -> float:
    """Return the step at a distance in time from an end of a contact, for a grid (i/N)^2, N = duration/h."""
    return min(h, h * h / duration + 2.0 * h * float(np.sqrt(max(distance, 0.0) / duration)))


def step_length(
    s: FloatArray, laws: FloatArray, touch: FloatArray, gap: FloatArray, t: float, control: FloatArray
) -> float:
    """Return the longest step that the phases allow."""
    h = control[0]
    for k in range(len(laws)):
        stiffness, exponent, _, _, clearance, friction, damping, _ = laws[k]
        if s[2 * k] == FLIGHT:
            if gap[k, 2] * h > 0.25 * clearance:  # a quarter of the way across
                h = 0.25 * clearance / gap[k, 2]
            continue
        start, duration, mobility = touch[k]
        depth = max(gap[k, 3], 0.0)
        if depth > 0.0:
            slope = exponent * stiffness * (np.sqrt(depth) if exponent == 1.5 else depth ** (exponent - 1.0))
            frequency = np.sqrt(slope * mobility)
            duration = min(duration, np.pi / frequency)
            # A law's damping is stiff in a contact that began slowly, friction below its regularisation
            # speed: a damper of rate r is followed by RK4 up to r h = 2.785, accurately well below it.
            spring = slope * depth / exponent
            rate = mobility * max(damping + spring * s[2 * k + 1], spring * friction)
            if rate > 0.0:
                h = min(h, 0.5 / rate)
        shortest = duration / control[1]
        h = min(h, graded(shortest, duration, t - start))
        if gap[k, 1] < 0.0:
            h = min(h, graded(shortest, duration, -depth / gap[k, 1]))
    return float(h)


def switch(
    gap_accelerations: Function,
    p: FloatArray,
    s: FloatArray,
    laws: FloatArray,
    touch: FloatArray,
    q: FloatArray,
    v: FloatArray,
    t: float,
    gap: FloatArray,
    event: int,
    spare: FloatArray,
) -> float:
    """Change a contact's phase at an event; return what happened: 1 touch, -1 release, 2 clip, 3 resume."""
    k, kind = event // 2, event % 2
    if kind == 1:
        s[2 * k] = CLIPPED if s[2 * k] == CONTACT else CONTACT
        return 2.0 if s[2 * k] == CLIPPED else 3.0
    if s[2 * k] != FLIGHT:
        s[2 * k] = FLIGHT
        return -1.0
    stiffness, exponent, factor, slowest, clearance, _, _, _ = laws[k]
    # The gap's answer to a unit force tells the effective mass, and with it how long the contact will take.
    gap_accelerations(p, s, t, q, v, spare)
    free = spare[k]
    s[2 * k] = PROBE
    gap_accelerations(p, s, t, q, v, spare)
    s[2 * k] = CONTACT
    mobility = (free - spare[k]) * clearance / (clearance + gap[k, 3])
    speed = max(gap[k, 1], slowest)
    deepest = ((exponent + 1.0) * speed * speed / (2.0 * stiffness * mobility)) ** (1.0 / (exponent + 1.0))
    s[2 * k + 1] = factor / speed
    touch[k, 0], touch[k, 1], touch[k, 2] = t, 3.0 * deepest / speed, mobility
    return 1.0


def note(
    gap_accelerations: Function,
    p: FloatArray,
    s: FloatArray,
    laws: FloatArray,
    touch: FloatArray,
    q: FloatArray,
    v: FloatArray,
    t: float,
    gap: FloatArray,
    event: int,
    spare: FloatArray,
    totals: FloatArray,
    row: FloatArray,
) -> None:
    """Change a contact's phase at an event and write the event's row of the log."""
    k = event // 2
    row[2] = switch(gap_accelerations, p, s, laws, touch, q, v, t, gap, event, spare)
    row[0], row[1], row[3], row[4] = t, k, gap[k, 1], gap[k, 3]
    for c in range(len(totals)):
        row[5 + c] = totals[c]


def advance(
    step: Function,
    gap_accelerations: Function,
    slopes: Function,
    p: FloatArray,
    s: FloatArray,
    laws: FloatArray,
    touch: FloatArray,
    q: FloatArray,
    v: FloatArray,
    gap: FloatArray,
    totals: FloatArray,
    t: float,
    end: float,
    control: FloatArray,
    log: FloatArray,
    times: FloatArray,
    samples: FloatArray,
    budget: int,
) -> tuple[float, int, int, int, int]:
    """Advance q, v, their gaps (K, 4) and the totals of work from t to ``end`` in place, event by event.

    ``log`` (rows, 5 + totals) takes (time, contact, what, rate of g, depth) and the totals of each event,
    ``samples`` a row (see ``contact_samples``) for each of the ``times`` from t to ``end``. Where events are
    located, steps do not depend on the times; else, they land on each. Returns the time reached, the events
    logged, the samples and the steps taken, and 0; or, short of the end, 1 (``budget`` of steps used), 2 (log
    full), 3 (the step met a singular configuration or overflowed).
    """
    new_q, new_v, work = np.empty_like(q), np.empty_like(v), np.empty_like(totals)
    new_gap, spare = np.empty_like(gap), np.empty(len(laws))
    events, steps, taken = 0, 0, 0
    lost = 0.0  # of h in the sum of times, carried on to the next step (Kahan 1965)
    event = first_alarm(s, laws, gap, -1) if t == 0.0 and end > 0.0 else -1
    while event >= 0:  # closed at the start
        note(gap_accelerations, p, s, laws, touch, q, v, t, gap, event, spare, totals, log[events])
        events += 1
        event = first_alarm(s, laws, gap, event)
    while True:
        while taken < len(times) and times[taken] <= t:
            write(slopes, p, s, t, q, v, totals, samples[taken])
            taken += 1
        if t >= end:
            return t, events, taken, steps, 0
        if steps >= budget:
            return t, events, taken, steps, 1
        if events >= len(log):
            return t, events, taken, steps, 2
        h, landing = control[0], end
        if control[2] > 0.0:
            h = step_length(s, laws, touch, gap, t, control)
        elif taken < len(times):
            landing = times[taken]
        last = t + h >= landing - 1e-6 * h
        if last:
            h = landing - t
        if not step(p, s, q, v, t, h, new_q, new_v, work, new_gap) or not finite(new_gap):
            return t, events, taken, steps, 3
        event, whole = first_alarm(s, laws, new_gap, -1), h
        if control[2] > 0.0:
            if event < 0:
                event, h = approach(step, p, s, laws, q, v, t, h, new_q, new_v, work, gap, new_gap)
            other = event
            while other >= 0:
                shorter = locate(step, p, s, laws, q, v, t, h, new_q, new_v, work, new_gap, other)
                if other != event and shorter >= h:
                    break
                event, h = other, shorter
                other = first_alarm(s, laws, new_gap, event)
        last = last and h == whole
        change = h + lost
        new_t = landing if last else t + change
        if taken < len(times) and times[taken] < new_t:
            taken = within(slopes, p, s, t, h, q, v, totals, new_q, new_v, work, times, taken, samples)
        lost = 0.0 if last else change - (new_t - t)
        t = new_t
        for c in range(len(q)):
            q[c], v[c] = new_q[c], new_v[c]
        for c in range(len(totals)):
            totals[c] += work[c]
        steps += 1
        for k in range(len(gap)):
            for c in range(4):
                gap[k, c] = new_gap[k, c]
        if event >= 0:
            note(gap_accelerations, p, s, laws, touch, q, v, t, gap, event, spare, totals, log[events])
            events += 1
