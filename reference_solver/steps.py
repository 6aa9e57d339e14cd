"""Steps of explicit Runge-Kutta methods, of one length or by their error: proposed and attempted.

Near touch and release forces go with powers of the penetration that are no whole numbers, as delta^1.5, and
no method keeps its order over them. Steps of RK4 are graded there, (i/N)^2 of the contact's duration. With
error control the step is one in s, with the time t = t0 + s^2 from a touch on and t = t1 - s^2 up to a
release: the penetration, of order s^2, has the square root s, and the force is smooth in s.

Numba compiles this module, ``events`` and ``loop`` as they stand. Where there are no contacts, no knots of
loads, or no error estimate, contacts, knots or method are None: what is about them is left out then.
"""

from typing import NamedTuple

import numpy as np

from reference_solver.machine_code import call, inner
from reference_solver.mechanism.contacts import FLIGHT
from reference_solver.methods import MOST_APART
from reference_solver.run import AT, END, GAP_FIELDS, NEW, OLD, SLOPES, SPARE, START, WEIGHT, Gap

#: Part of the clearance (or a radian) that a pin crosses in a step of flight: by RK4, and controlled.
FLIGHT_PART, CONTROLLED_FLIGHT_PART = 0.25, 0.5
#: Part of its clearance that a pin moves at least in the first step of a contact and in the last: a shorter
#: way is round-off, in which a touch looks like a release.
SHORTEST_WAY = 1e-11
#: Part of the distance in time to a release that is left to a step which does not end there.
LEFT = 0.05
#: Step control: safety factor, bounds of what a step changes by, and the weight of the error before.
SAFETY, LEAST, MOST, BETA = 0.8, 0.2, 8.0, 0.04
#: Rejections in a row: by then a step is below the round-off of time, or bounces around it. The part that is
#: tried of one of RK4's in which a stage comes too near to a singular position: stages in the middle and at
#: the end of it are well between those of the other and of the step after it.
MOST_REJECTIONS, ASIDE = 100, 2.0 / 3.0
#: Part of a step's length within which the next of its multiples is passed.
TOO_NEAR = 0.4
#: Round-off of the gap, as a part of the mechanism's length, or of how far it is from the origin.
ROUND_OFF = 1.5e-15
#: A knot nearer than this part of its period has been reached: steps end so near to it, by their first terms.
REACHED = 1e-4


class Step(NamedTuple):
    """A step of ``H`` in s from ``begin``, time = origin + sign s^2, or origin + s with sign 0; its end."""

    origin: float
    sign: float
    begin: float
    H: float
    end: float


@inner
def set_slopes(run, t, of, row):
    """Set a row to the slopes at a row's state; return the condition."""
    return call(run.rates, run.p, run.contacts, t, run.at + of * run.width, run.at + row * run.width)


@inner
def set_gaps(run, t, of):
    """Set the gaps of a row's state."""
    state = run.at + of * run.width
    call(run.gaps, run.p, run.contacts, t, state, state + 8 * run.size)


@inner
def gap_of(run, rows, of, k):
    """Return the gap of contact k in a row's state."""
    c = run.size + GAP_FIELDS * k
    row = rows[of]
    return Gap(row[c], row[c + 1], row[c + 2], row[c + 3], row[c + 4], row[c + 5], row[c + 6])


@inner
def probe(run, rows, contacts):
    """Look up the mobilities of all contacts where the bodies are now."""
    call(run.mobilities, run.p, run.contacts, run.time, run.at, run.at + SPARE * run.width)
    for k in range(len(contacts)):
        contact = contacts[k]
        contact.mobility, contact.sliding = rows[SPARE, 3 * k], rows[SPARE, 3 * k + 1]
        contact.following = rows[SPARE, 3 * k + 2]


@inner
def know_slopes(run, h):
    """Set the slopes at both ends of a step of h, if they are not known; return whether it could."""
    if run.known != 0:
        return True
    run.known = 1
    start = set_slopes(run, run.time, OLD, START)
    return set_slopes(run, run.time + h, NEW, END) < np.inf and start < np.inf


@inner
def set_within(run, rows, h, x, t):
    """Set positions, velocities and gaps at x of a step of h, by the quintic through both its ends."""
    n, old, new, start, end = run.n, rows[OLD], rows[NEW], rows[START], rows[END]
    for c in range(n):
        first, curve = h * old[n + c], 0.5 * h * h * start[n + c]
        last, new_curve = h * new[n + c], 0.5 * h * h * end[n + c]
        rise, turn, bend = new[c] - old[c] - first - curve, last - first - 2.0 * curve, new_curve - curve
        third, fourth = 10.0 * rise - 4.0 * turn + bend, -15.0 * rise + 7.0 * turn - 2.0 * bend
        fifth = 6.0 * rise - 3.0 * turn + bend
        slope = 2.0 * curve + x * (3.0 * third + x * (4.0 * fourth + x * 5.0 * fifth))
        rows[AT, c] = old[c] + x * (first + x * (curve + x * (third + x * (fourth + x * fifth))))
        rows[AT, n + c] = (first + x * slope) / h
    set_gaps(run, t + x * h, AT)


@inner
def time_at(step, s):
    """Return the time at s, and its rate."""
    if step.sign == 0.0:
        return step.origin + s, 1.0
    return step.origin + step.sign * s * s, 2.0 * step.sign * s


@inner
def place_at(step, time):
    """Return s at a time."""
    if step.sign == 0.0:
        return time - step.origin
    return np.sqrt(max(step.sign * (time - step.origin), 0.0))


@inner
def lasting(step, factor):
    """Return how long a step as many times as long as one in s lasts."""
    H = step.H * factor
    return H if step.sign == 0.0 else abs((2.0 * step.begin + H) * H)


@inner
def in_s(run, contacts, rows, h):
    """Return a step of h at most in the s of the contact that is closed, and the one released at its end.

    Only one contact has the square root of its own time. To a release, -1 without one, it takes a pin on its
    way out depth over its final speed if the wall's elastic force alone acts; from rest it is 1.4716 times
    that, exactly so for the exponent 1.5 (Hertz). A step after a rejected one does not try for it.
    """
    t, closed, k = run.time, 0, -1
    for i in range(len(contacts)):
        if contacts[i].phase != FLIGHT and contacts[i].rigid == 0.0:
            closed, k = closed + 1, i
    if closed == 1 and contacts[k].exponent % 1.0 != 0.0:
        contact, gap = contacts[k], gap_of(run, rows, OLD, k)
        since, left = t - contact.began_s, 0.0
        if gap.rate >= 0.0 and 0.0 <= since < contact.duration_s:
            begin = np.sqrt(since)
            return Step(contact.began_s, 1.0, begin, np.sqrt(since + h) - begin, t + h), -1
        if gap.rate < 0.0 and gap.depth > 0.0:
            power, rate = contact.exponent + 1.0, abs(gap.rate)
            pushed = 2.0 / power * contact.mobility * contact.stiffness * gap.depth**power
            speed = np.sqrt(rate * rate + pushed)
            left = gap.depth / speed * (1.0 + 0.4716 * (1.0 - rate / speed))
        if left > 0.0 and t + left > t:
            begin = np.sqrt(left)
            if h >= (1.0 - LEFT) * left and run.rejected == 0:
                return Step(t + left, -1.0, begin, -begin, t + left), k
            rest = max(left - h, LEFT * LEFT * left)
            return Step(t + left, -1.0, begin, np.sqrt(rest) - begin, t + left - rest), -1
    return Step(t, 0.0, 0.0, h, t + h), -1


@inner
def in_flight(run, rows, contacts, of, h, part):
    """Return a step, h at most, in which pins fly no further than a part of the clearance, or of a radian."""
    for k in range(len(contacts)):
        far, speed = part * contacts[k].clearance, gap_of(run, rows, of, k).speed
        if (contacts[k].phase == FLIGHT or contacts[k].rigid != 0.0) and speed * h > far:
            h = far / speed
    return h


@inner
def graded_step(run, rows, contacts):
    """Return the longest step of RK4 that the phases allow.

    A contact's own times are its duration, half a period of its spring, the time in which its damper or its
    friction, below the regularisation speed, takes a speed away, and the period of the pin that swings along
    its wall, pressed onto it by N: 2 pi/sqrt(N w/c) with w the mobility there. All are cut alike, and the
    duration T as by the grid T (i/N)^2 from both its ends: at x from one of them T/N^2 + 2 sqrt(T x)/N.
    """
    h = in_flight(run, rows, contacts, OLD, run.longest, FLIGHT_PART)
    decay, part = min(0.5, 200.0 / run.per_contact), 1.0 / run.per_contact
    for k in range(len(contacts)):
        contact, gap = contacts[k], gap_of(run, rows, OLD, k)
        if contact.phase == FLIGHT:
            continue
        rigid = contact.rigid != 0.0
        pressing = gap.push if rigid else gap.elastic * max(1.0, gap.push)
        swing = pressing * contact.following
        if swing > 0.0:
            h = min(h, 2.0 * np.pi * part * np.sqrt(contact.clearance / swing))
        # RK4 follows a damper of rate r up to r h = 2.785, accurately well below it.
        rate = max(contact.mobility * gap.damper, contact.sliding * pressing * contact.friction)
        if rate * h > decay:
            h = decay / rate
        if rigid:
            continue
        duration, depth, per_way = contact.duration_s, max(gap.depth, 0.0), 1.0 / abs(gap.rate)
        pushed = contact.exponent * gap.elastic * contact.mobility
        if depth > 0.0:
            duration = min(duration, np.pi * np.sqrt(depth / pushed))
        distance = run.time - contact.began_s
        if gap.rate < 0.0:
            distance = min(distance, depth * per_way)
        graded = part * (part * duration + 2.0 * np.sqrt(duration * max(distance, 0.0)))
        h = min(h, part * duration, max(graded, SHORTEST_WAY * contact.clearance * per_way))
    return h


@inner
def to_knot(run, rows, knots, h):
    """Return a step, h at most, that ends near the next knot of a load by a body's angle, if it gets there.

    It goes by the body's speed, and its acceleration at the step's start, if that is known. What is left of
    the knot in the step after it is of the fourth power of the distance.
    """
    for k in range(len(knots)):
        c, ahead = knots[k].coordinate, knots[k].period
        angle, speed, gain = rows[OLD, c], rows[OLD, run.n + c], run.controlled * rows[START, run.n + c]
        if speed < 0.0:
            ahead, speed, gain = (angle - knots[k].angle) % ahead, -speed, -gain
        else:
            ahead = (knots[k].angle - angle) % ahead
        if ahead > REACHED * knots[k].period and speed > 0.0 and speed * speed + 2.0 * gain * ahead > 0.0:
            h = min(h, 2.0 * ahead / (speed + np.sqrt(speed * speed + 2.0 * gain * ahead)))
    return h


@inner
def propose(run, rows, contacts, method, knots):
    """Return the step to try, and the contact that is released at its end, or -1.

    Steps of one length land on its multiples. From between two of them, where a shorter step has ended, they
    do so again by steps that are not much shorter: the next multiple may be a singular position.
    """
    t, h, landing, releasing = run.time, run.longest, run.end, -1
    if method is not None:
        h = min(run.step, h)
    else:
        if run.located == 0:
            while (run.landed + 1) * h <= t + run.slack:
                run.landed += 1
            landing = (run.landed + 1) * h
            if landing - t < TOO_NEAR * h:
                landing += h
                h = 0.5 * (landing - t)
            if landing > run.end - run.slack:
                landing = run.end
        elif contacts is not None:
            h = graded_step(run, rows, contacts)
        if run.rejected != 0:
            h = min(h, run.step)
    if knots is not None:
        h = to_knot(run, rows, knots, h)
    step = Step(t, 0.0, 0.0, h, t + h)
    if method is not None:
        if contacts is not None:
            h = in_flight(run, rows, contacts, OLD, h, CONTROLLED_FLIGHT_PART)
            step, releasing = in_s(run, contacts, rows, h)
    end = step.end
    if end >= landing - 1e-6 * (end - t):
        end, releasing = landing, -1
    run.tried = end - t
    H = place_at(step, end) - step.begin
    if run.located == 0 and abs(H - run.longest) < run.slack:
        H = run.longest
    return Step(step.origin, step.sign, step.begin, H, end), releasing


@inner
def changed(run, method, error):
    """Return the factor by which a step changes, from its error and the one before (Gustafsson 1991)."""
    if method is None:
        return 1.0 if error <= 1.0 else ASIDE
    most = MOST if run.rejected == 0 else 1.0
    if error > 1.0:
        return max(LEAST, SAFETY * error ** -method[0].exponent) if np.isfinite(error) else LEAST
    if error == 0.0:
        return most
    factor = SAFETY * error ** (0.2 * BETA - method[0].exponent) * run.error**BETA
    return min(most, max(LEAST, factor))


@inner
def add(out, weight, row, size):
    """Add a multiple of a row's first numbers."""
    for c in range(size):
        out[c] += weight * row[c]


@inner
def set_stage(run, rows, method, step, row):
    """Set a row of slopes by those before it, as the method has it; return the condition there."""
    at, old, slopes = rows[AT], rows[OLD], rows[SLOPES + row]
    for c in range(run.size):
        at[c] = old[c]
    for j in range(row):
        weight = step.H * method[0].matrix[row, j]
        if weight != 0.0:
            add(at, weight, rows[SLOPES + j], run.size)
    t, rate = time_at(step, step.begin + method[0].nodes[row] * step.H)
    condition = set_slopes(run, t, AT, SLOPES + row)
    if step.sign != 0.0:
        for c in range(run.size):
            slopes[c] *= rate
    return condition


@inner
def norm(run, rows, method, which):
    """Return the sum of squares of an estimate of the error per unit of s, over the tolerance."""
    out, weights, total, size = rows[AT], rows[WEIGHT], 0.0, 2 * run.n
    for c in range(size):
        out[c] = 0.0
    for j in range(method[0].stages):
        weight = method[0].estimates[which, j]
        if weight != 0.0:
            add(out, weight, rows[SLOPES + j], size)
    for c in range(size):
        part = out[c] * weights[c]
        total += part * part
    return total


@inner
def estimated(run, rows, method, step):
    """Take a step's stages to its end; return its error over the tolerance, infinite on failure."""
    size, worst, least = run.size, 1.0, np.inf
    first, start, new, old = rows[SLOPES], rows[START], rows[NEW], rows[OLD]
    _, rate = time_at(step, step.begin)
    for c in range(size):
        first[c], new[c] = rate * start[c], 0.0
    for i in range(1, method[0].stages):
        condition = set_stage(run, rows, method, step, i)
        if not condition < np.inf:
            return np.inf
        worst, least = max(worst, condition), min(least, condition)
    run.worst, run.best = worst, least
    for j in range(method[0].stages):
        add(new, method[0].weights[j], rows[SLOPES + j], size)
    for c in range(size):  # the sum first, then y, for the sake of rounding
        new[c] = old[c] + step.H * new[c]
    fifth, third = norm(run, rows, method, 0), norm(run, rows, method, 1)
    error = abs(step.H) * fifth / np.sqrt((fifth + 0.01 * third) * 2.0 * run.n + 1e-300)
    return error if np.isfinite(error + third) else np.inf


@inner
def attempt(run, rows, contacts, method, step, most):
    """Take a step onto the constraints; return its error over the tolerance, infinite on failure.

    One whose error is more than ``most`` is left where it is. A step is not to end too near to a singular
    position: the next one would begin with what is amplified.
    """
    old, new, end, size = rows[OLD], rows[NEW], rows[END], run.size
    if method is None:
        run.known, old[run.place_of_h] = 0, step.H
        state = run.at + OLD * run.width
        run.worst = call(run.stepped, run.p, run.contacts, run.time, state, run.at + NEW * run.width)
        return 0.0 if run.worst < np.inf else np.inf
    error = estimated(run, rows, method, step)
    if contacts is not None:
        # Round-off of positions changes forces by the slope of the stiffest contact, and speeds by that for
        # as long as a step lasts: a tolerance below it would have steps shortened for nothing.
        steepest = 0.0
        for k in range(len(contacts)):
            contact, gap = contacts[k], gap_of(run, rows, OLD, k)
            if contact.phase != FLIGHT and contact.rigid == 0.0 and gap.depth > 0.0:
                steepest = max(steepest, contact.exponent * gap.elastic / gap.depth * contact.mobility)
        error /= max(1.0, steepest * ROUND_OFF * run.tried / (run.tolerance * run.rate))
    if not error <= most:
        return error
    state = run.at + NEW * run.width
    if not call(run.project, run.p, run.contacts, step.end, state, run.at + END * run.width) < np.inf:
        return np.inf
    for c in range(2 * run.n):
        new[c] = end[c]
    new[size - 1] += end[2 * run.n]
    if not set_slopes(run, step.end, NEW, END) < MOST_APART * run.best:
        return np.inf
    if contacts is not None:
        set_gaps(run, step.end, NEW)
    return error
