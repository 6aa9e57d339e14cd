"""The event loop: explicit Runge-Kutta steps, of one length or by their error, from event to event.

A step is proposed, attempted, and accepted or rejected; where an event lies within it, the step is taken
again so that it ends there; then the contact changes its phase. Between events every right-hand side is
smooth. An event is first sought on the quintic through positions, velocities and accelerations at both ends
of the step, which costs no right-hand side; the step to it is then corrected by Newton's method.

Near touch and release forces go with powers of the penetration that are no whole numbers, as delta^1.5, and
no method keeps its order over them. Steps of RK4 are graded there, (i/N)^2 of the contact's duration. With
error control the step is one in s, with the time t = t0 + s^2 from a touch on and t = t1 - s^2 up to a
release: the penetration, of order s^2, has the square root s, and the force is smooth in s.

Numba compiles this module as it stands, once for all mechanisms. Where there are no contacts, no
knots of loads, or no error estimate, contacts, knots or method are None: what is about them is left out then,
and compiled when it is needed. A kernel's functions are called by address.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from reference_solver.machine_code import OPTIONS, call, compiled
from reference_solver.mechanism.contacts import CLIPPED, CONTACT, FLIGHT
from reference_solver.methods import MOST_APART
from reference_solver.run import (
    AT,
    CLIP,
    DENSE,
    DEPENDENT,
    DONE,
    END,
    FAILED,
    FLIGHT_HEIGHT,
    FULL,
    GAP_FIELDS,
    LOG_ROWS,
    NEW,
    OLD,
    REBOUND,
    RELEASE,
    RESUME,
    SLOPES,
    SPARE,
    SPENT,
    START,
    SUPPORT,
    TOUCH,
    WALL,
    WALL_FIELDS,
    WEIGHT,
    Gap,
)

inner = register_jitable(**OPTIONS, no_cfunc_wrapper=True)

#: Part of the clearance (or of a radian) that a pin crosses in a step of flight, by RK4 and with error
#: control.
FLIGHT_PART, CONTROLLED_FLIGHT_PART = 0.25, 0.5
#: Part of its clearance that a pin moves at least in the first step of a contact and in the last: a shorter
#: way is round-off, in which a touch looks like a release.
SHORTEST_WAY = 1e-11
#: Part of the distance in time to a release that is left to a step which does not end there.
LEFT = 0.05
#: Step control: safety factor, bounds of what a step changes by, and the weight of the error before.
SAFETY, LEAST, MOST, BETA = 0.8, 0.2, 8.0, 0.04
#: Bounds of a contact's first step, as a part of its duration.
SHORTEST_PART, LONGEST_PART = 1e-6, 0.5
#: Rejections in a row: by then a step is below the round-off of time, or bounces around it. The part that is
#: tried of one of RK4's in which a stage comes too near to a singular position: stages in the middle and at
#: the end of it are well between those of the other and of the step after it.
MOST_REJECTIONS, ASIDE = 100, 2.0 / 3.0
#: Part of a step's length within which the next of its multiples is passed.
TOO_NEAR = 0.4
#: Rejections after which a pin that may have been out within a step is taken to be in: round-off looks so.
MOST_HALVED = 20
#: Parts of the tolerance and of the clearance within which a step ends on its event; round-off of the gap, as
#: a part of the mechanism's length, or of how far it is from the origin; and the most trials for it.
LANDING, LANDING_CLEARANCE, ROUND_OFF, LANDINGS = 1e-2, 2e-6, 1.5e-15, 6
#: Part of a step by which one that ends short of a change of the force's sign is made longer at first.
PAST = 1e-10
#: A knot nearer than this part of its period has been reached: steps end so near to it, by their first terms.
REACHED = 1e-4
#: A kink has been reached where it is nearer than this part of the angle, or of its period: some round-off.
AT_KINK = 1e-14
#: How often a step is taken again that passes a kink, by what it may grow where it ends just before one, and
#: the part of the longest step by which RK4's end before it.
KINK_TRIALS, STRETCHED, SHORT = 8, 1.1, 1e-3
#: Mobilities are looked up again after so many steps, in which bodies turn little.
STEPS_BETWEEN_PROBES = 16
#: Where in a step RK4's dense output takes an additional slope; not 1/2, where all quartics with the same
#: ends share it.
INSIDE = 1.0 / 3.0
#: How far from its supposed place in a step, as a part of it, a contact's largest force is looked for.
ASIDE_OF_PEAK = 0.1


class Step(NamedTuple):
    """A step of ``H`` in s from ``begin``, time = origin + sign s^2, or origin + s with sign 0; its end."""

    origin: float
    sign: float
    begin: float
    H: float
    end: float


# ----------------------------------------------------------------------- calls of the kernel


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
def any_closed(contacts):
    """Return whether a contact is not in flight."""
    for k in range(len(contacts)):
        if contacts[k].phase != FLIGHT:
            return True
    return False


# ---------------------------------------------------------------------------------- time over a step


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


# ------------------------------------------------------------------------------- the next step


@inner
def in_flight(run, rows, contacts, of, h, part):
    """Return a step, h at most, in which pins fly no further than a part of the clearance, or of a radian."""
    for k in range(len(contacts)):
        far, speed = part * contacts[k].clearance, gap_of(run, rows, of, k).speed
        if (contacts[k].phase == FLIGHT or contacts[k].rigid != 0.0) and speed * h > far:
            h = far / speed
    return h


@inner
def graded(h, duration, distance, shortest):
    """Return the step at a distance in time from an end of a contact, for a grid (i/N)^2, N = duration/h."""
    step = h * h / duration + 2.0 * h * np.sqrt(max(distance, 0.0) / duration)
    return min(h, max(step, shortest))


@inner
def graded_step(run, rows, contacts):
    """Return the longest step of RK4 that the phases allow.

    A contact's own times are its duration, half a period of its spring, the time in which its damper or its
    friction, below the regularisation speed, takes a speed away, and the period of the pin that swings along
    its wall, pressed onto it by N: 2 pi/sqrt(N w/c) with w the mobility there. All are cut alike.
    """
    h = in_flight(run, rows, contacts, OLD, run.longest, FLIGHT_PART)
    decay = min(0.5, 200.0 / run.per_contact)
    for k in range(len(contacts)):
        contact, gap = contacts[k], gap_of(run, rows, OLD, k)
        if contact.phase == FLIGHT:
            continue
        rigid = contact.rigid != 0.0
        pressing = gap.push if rigid else gap.elastic * max(1.0, gap.push)
        swing = np.sqrt(max(pressing, 0.0) * contact.following / contact.clearance)
        if swing > 0.0:
            h = min(h, 2.0 * np.pi / (swing * run.per_contact))
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
        longest, shortest = duration / run.per_contact, SHORTEST_WAY * contact.clearance / abs(gap.rate)
        h = min(h, graded(longest, duration, run.time - contact.began_s, shortest))
        if gap.rate < 0.0:
            h = min(h, graded(longest, duration, -depth / gap.rate, shortest))
    return h


@inner
def to_knot(run, rows, knots, h, curved, short):
    """Return a step, h at most, that ends near the next knot of a load by a body's angle, if it gets there.

    It goes by the body's speed, and ``curved`` times its acceleration at the step's start, if that is known.
    What is left of the knot in the step after it is of the fourth power of the distance. Before a kink it
    ends ``short`` of it, in s (see ``to_kink``).
    """
    for k in range(len(knots)):
        knot = knots[k]
        c, ahead = knot.coordinate, knot.period
        angle, speed, gain = rows[OLD, c], rows[OLD, run.n + c], curved * rows[START, run.n + c]
        if speed < 0.0:
            ahead, speed, gain = (angle - knot.angle) % ahead, -speed, -gain
        else:
            ahead = (knot.angle - angle) % ahead
        near = AT_KINK * max(abs(angle), knot.period) if knot.kink != 0 else REACHED * knot.period
        if ahead > near and speed > 0.0 and speed * speed + 2.0 * gain * ahead > 0.0:
            reach = 2.0 * ahead / (speed + np.sqrt(speed * speed + 2.0 * gain * ahead))
            h = min(h, reach - short if knot.kink != 0 and reach > 2.0 * short else reach)
    return h


@inner
def to_kink(run, rows, knots, h, most, short):
    """Return the step, ``most`` at most, in place of one of h that has passed a kink, or come near to one.

    That is one on to the first such kink, by the speed at the end of h; without one it is h. Stages of RK4
    are off by the third power of the step, and beyond a kink that makes an error of the fourth, by chance: so
    a step ends ``short`` of a kink, in s, and a short one goes on to it.
    """
    aim, landed, first = short if h > 2.0 * short else 0.0, h, np.inf
    for k in range(len(knots)):
        knot = knots[k]
        if knot.kink == 0:
            continue
        c = knot.coordinate
        angle, change = rows[OLD, c], rows[NEW, c] - rows[OLD, c]
        near, sign = AT_KINK * max(abs(angle), knot.period), 1.0 if change > 0.0 else -1.0
        way, speed = sign * change, sign * rows[NEW, run.n + c]
        ahead = sign * (knot.angle - angle) % knot.period
        if not near < ahead < min(knot.period - near, first * way):
            continue
        first, landed, beyond = ahead / way, h, way - ahead + aim * speed
        if beyond > -REACHED * knot.period and abs(beyond) > max(near, 0.5 * aim * speed):
            landed = h - beyond / speed if speed > 0.0 else 0.0
            if not 0.0 < landed < STRETCHED * h:
                landed = h * first
    return landed if landed <= min(most, STRETCHED * h) else h


@inner
def propose(run, rows, contacts, method, knots):
    """Return the step to try, and the contact that is released at its end, or -1.

    Steps of one length land on its multiples. From between two of them, where a shorter step has ended, they
    do so again by steps that are not much shorter: the next multiple may be a singular position.
    """
    t, h, landing, releasing = run.time, run.longest, run.end, -1
    step = Step(t, 0.0, 0.0, h, t + h)
    if method is not None:
        h = min(run.step, h)
        if knots is not None:
            h = to_knot(run, rows, knots, h, 1.0, 0.0)
        step = Step(t, 0.0, 0.0, h, t + h)
        if contacts is not None:
            h = in_flight(run, rows, contacts, OLD, h, CONTROLLED_FLIGHT_PART)
            step, releasing = in_s(run, contacts, rows, h)
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
        if knots is not None:
            h = to_knot(run, rows, knots, h, 0.0, SHORT * run.longest)
        if run.rejected != 0:
            h = min(h, run.step)
        step = Step(t, 0.0, 0.0, h, t + h)
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
def next_step(step, factor):
    """Return the step in time after one in s."""
    reached, H = step.begin + step.H, step.H * factor
    if step.sign == 0.0:
        return H
    if step.sign < 0.0 and reached + H <= 0.0:  # beyond the release
        return max(1.5 * reached * reached, factor * lasting(step, 1.0))
    return abs((2.0 * reached + H) * H)


# ---------------------------------------------------------------------------------------- a step


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
def round_off_error(run, rows, contacts):
    """Return what round-off of positions alone makes of a step's error over the tolerance.

    It changes forces by the slope of the stiffest contact, and speeds by that for as long as the step lasts:
    a tolerance below it would have steps shortened for nothing.
    """
    steepest = 0.0
    for k in range(len(contacts)):
        contact, gap = contacts[k], gap_of(run, rows, OLD, k)
        if contact.phase != FLIGHT and contact.rigid == 0.0 and gap.depth > 0.0:
            steepest = max(steepest, contact.exponent * gap.elastic / gap.depth * contact.mobility)
    return steepest * ROUND_OFF * run.tried / (run.tolerance * run.rate)


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
        run.worst = call(run.step_function, run.p, run.contacts, run.time, state, run.at + NEW * run.width)
        total = 0.0
        for c in range(size):
            new[c] += old[c] if c >= 2 * run.n else 0.0
            total += new[c]
        return 0.0 if run.worst < np.inf and np.isfinite(total) else np.inf
    error = estimated(run, rows, method, step)
    if contacts is not None:
        error /= max(1.0, round_off_error(run, rows, contacts))
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


@inner
def know_slopes(run, h):
    """Set the slopes at both ends of a step of h, if they are not known; return whether it could."""
    if run.known != 0:
        return True
    run.known = 1
    start = set_slopes(run, run.time, OLD, START)
    return set_slopes(run, run.time + h, NEW, END) < np.inf and start < np.inf


# ---------------------------------------------------------------------------------------- events


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

    Of a pin before a rigid wall it is to be no round-off. What begins past its wall by round-off, on its way
    back, is past it still while it comes nearer.
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
def bulged(run, rows, contacts, h):
    """Return whether a pin that moves inwards at both ends of a step of h may have been out in between.

    That is where the cubic through both ends' g and rates comes near to rising, and has the wall in reach. A
    pin that has just hit may be back, and off again, within a step: the shorter one sees it.
    """
    for k in range(len(contacts)):
        gap, new_gap = gap_of(run, rows, OLD, k), gap_of(run, rows, NEW, k)
        if contacts[k].phase == FLIGHT and gap.rate < 0.0 and new_gap.rate < 0.0:
            steepest = 1.5 * (new_gap.g - gap.g) / h - 0.25 * (gap.rate + new_gap.rate)
            excess = steepest - 0.25 * min(gap.rate, new_gap.rate)
            if excess > 0.0 and max(gap.g, new_gap.g) + excess * h > contacts[k].noise:
                return True
    return False


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
def alarm_at(run, rows, contacts, h, x, event):
    """Return an event's alarm at x of a step of h."""
    set_within(run, rows, h, x, run.time)
    return alarm(contacts[event // 2], gap_of(run, rows, AT, event // 2), event % 2)


@inner
def turning(run, rows, contacts, h, k, rising):
    """Return where the gap of a contact turns that is rising, or falling, at a step's start.

    A rising one is followed no further than to where it is past its wall.
    """
    low, high = 0.0, 1.0
    for _ in range(30):
        x = 0.5 * (low + high)
        value = alarm_at(run, rows, contacts, h, x, 2 * k)
        if rising and contacts[k].phase == FLIGHT and value > 0.0:
            return x
        if (gap_of(run, rows, AT, k).rate > 0.0) == rising:
            low = x
        else:
            high = x
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
def gap_noise(run, rows):
    """Return the round-off of a gap at the end of a step."""
    far = run.length
    for c in range(run.n):
        if c % 3 != 2:
            far = max(far, abs(rows[NEW, c]))
    return ROUND_OFF * far


@inner
def first_event(run, rows, contacts, h, skip):
    """Return the first event but ``skip`` within a step and its place in it, or -1 and 1.

    An event is numbered 2 k + kind of contact k.
    """
    event, place, noise = -1, 1.0, gap_noise(run, rows)
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
                if gap_of(run, rows, AT, k).g <= max(noise, contact.noise):
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
    contact, latest, least = contacts[k], t + 1.5 * (end - t), gap_noise(run, rows)
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
            if not (t < end + more < latest and (gap.rate > 0.0) == (contact.phase == FLIGHT)):
                break
        else:
            more = PAST * (end - t) * 100.0**trials
            if alarm(contact, gap, 1) > 0.0:
                return step
        end += more
    return Step(step.origin, step.sign, step.begin, 0.0, np.nan)


@inner
def unseen(run, rows, contacts):
    """Return whether a pin is past its wall in flight, or off it in contact, by more than landing leaves."""
    for k in range(len(contacts)):
        outwards = 1.0 if contacts[k].phase == FLIGHT else -1.0
        far = 2.0 * LANDING_CLEARANCE * contacts[k].clearance
        if contacts[k].rigid == 0.0 and outwards * gap_of(run, rows, NEW, k).g > far:
            return True
    return False


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
    if run.rejected < MOST_HALVED and bulged(run, rows, contacts, step.end - t):
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
    if event < 0 and unseen(run, rows, contacts):
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
def look(run, row):
    """Set a row to what the kernel says of the rigid walls; return whether it could."""
    return call(run.walls, run.walls_p, run.contacts, run.time, run.at, run.at + row * run.width) < np.inf


@inner
def push_back(run, rows, contacts, row, k):
    """Set what walls do to their pins, that of contact k and those that follow; return whether all push.

    With k it is impulses, by which its speed along the normal changes from u to -e u and the others' to zero;
    with k = -1 forces, by which pins that follow have no acceleration along the normal. The walls are in a
    row, and the results in the column after the matrix of mobilities, W of all R rigid joints.
    """
    R, S, n, at = run.rigid_joints, run.wall_rows, run.n, rows[row]
    D, W = WALL_FIELDS * R, WALL_FIELDS * R + 2 * S * n
    free = W + S * S + S
    for i in range(R):
        for j in range(R + 1):
            rows[DENSE + i, j] = 1.0 if i == j else 0.0
    for a in range(len(contacts)):
        if a == k or (contacts[a].rigid != 0.0 and contacts[a].phase != FLIGHT):
            i = contacts[a].number
            for b in range(len(contacts)):
                if b == k or (contacts[b].rigid != 0.0 and contacts[b].phase != FLIGHT):
                    rows[DENSE + i, contacts[b].number] = at[W + i * S + contacts[b].number]
            right = at[WALL_FIELDS * i + 1] * (1.0 + (contacts[a].restitution if a == k else 0.0))
            if k < 0:
                right = at[WALL_FIELDS * i + 2]
                for c in range(n):
                    right -= at[D + i * n + c] * at[free + c]
            rows[DENSE + i, R] = right
    for i in range(R):  # W is positive definite
        pivot = rows[DENSE + i, i]
        if not (pivot == 1.0 or pivot > DEPENDENT * at[WALL_FIELDS * i + 5]):
            return False
        for j in range(R + 1):
            rows[DENSE + i, j] /= pivot
        for other in range(R):
            factor = rows[DENSE + other, i]
            if other != i and factor != 0.0:
                add(rows[DENSE + other], -factor, rows[DENSE + i], R + 1)
    for i in range(R):
        if rows[DENSE + i, R] < 0.0:
            return False
    return True


@inner
def bounce(run, rows, contacts, k):
    """Have a pin hit its rigid wall and fly off again; return whether that is all there is to the event.

    It is, where no other pin hits, there is no friction, all that follow are pushed by the impact and go on
    following, and this one does not come too slowly or leave for too short a flight. Otherwise nothing is
    changed, and ``impacts.resolve`` has to do it.
    """
    contact, R, S, n = contacts[k], run.rigid_joints, run.wall_rows, run.n
    simple = contact.phase == FLIGHT and len(rows) > R + DENSE
    for i in range(len(contacts)):
        if contacts[i].rigid != 0.0:
            near = gap_of(run, rows, OLD, i).g > -run.lowest * contacts[i].noise
            simple = simple and contacts[i].friction == 0.0
            simple = simple and (i == k or contacts[i].phase != FLIGHT or not near)
    if not (simple and look(run, SPARE)):
        return False
    at, after, old, kept = rows[SPARE], rows[AT], rows[OLD], rows[END]
    first, motion, W = WALL_FIELDS * contact.number, WALL_FIELDS * R + S * n, WALL_FIELDS * R + 2 * S * n
    rate, rate_noise = at[first + 1], at[first + 4]
    if not (rate > max(rate_noise, contact.slowest) and push_back(run, rows, contacts, SPARE, k)):
        return False
    for c in range(n):
        kept[c] = old[n + c]
    for i in range(R):
        impulse = kept[n + i] = rows[DENSE + i, R]
        for c in range(n):
            old[n + c] += impulse * at[motion + i * n + c]
    rebounds = look(run, AT) and push_back(run, rows, contacts, AT, -1)
    if rebounds:
        own, free, outward = WALL_FIELDS * R + contact.number * n, W + S * S + S, after[first + 2]
        for c in range(n):
            pushed = after[free + c]
            for i in range(R):
                pushed += rows[DENSE + i, R] * after[motion + i * n + c]
            outward -= after[own + c] * pushed
        height = FLIGHT_HEIGHT * run.lowest * after[first + 3] * max(outward, 0.0)
        rebounds = outward <= 0.0 or -2.0 * after[first + 1] >= max(run.shortest_s * outward, np.sqrt(height))
    if not rebounds:
        for c in range(n):
            old[n + c] = kept[c]
        return False
    for i in range(len(contacts)):
        if i == k or (contacts[i].rigid != 0.0 and contacts[i].phase != FLIGHT):
            other, j, entry = contacts[i], contacts[i].number, run.events[run.logged]
            restitution = other.restitution if i == k else 0.0
            approach, impulse = at[WALL_FIELDS * j + 1], kept[n + j]
            lost, mass = 0.5 * (1.0 - restitution) * approach * impulse, 1.0 / at[W + j * S + j]
            old[2 * n] += at[W + S * S + j] * impulse
            old[2 * n + other.column] += impulse
            old[2 * n + other.column + 1] += lost
            other.noise = after[WALL_FIELDS * j + 3]
            other.rate_noise = max(at[WALL_FIELDS * j + 4], after[WALL_FIELDS * j + 4])
            entry.time_s, entry.contact, entry.what = run.time, i, REBOUND if i == k else SUPPORT
            entry.approach, entry.impulse, entry.lost, entry.mass = approach, impulse, lost, mass
            run.logged += 1
    set_gaps(run, run.time, OLD)
    return True


# ------------------------------------------------------------------------- the largest of a contact


@inner
def rises(contact, gap, elastic, ends, h, x):
    """Return whether the normal force rises at x of a step of h, by the cubic of its penetration.

    That goes through values and rates at both ends. The part of the damper that is not in proportion to the
    elastic force there is taken from ``gap``.
    """
    value, rate, new_value, new_rate = ends
    change, start, stop = new_value - value, h * rate, h * new_rate
    second, third = 3.0 * change - 2.0 * start - stop, start + stop - 2.0 * change
    depth = value + x * (start + x * (second + x * third))
    slope = (start + x * (2.0 * second + x * 3.0 * third)) / h
    curve = (2.0 * second + x * 6.0 * third) / (h * h)
    if elastic < 0.0:
        elastic = contact.stiffness * max(depth, 0.0) ** contact.exponent
    stiffer = contact.exponent * elastic * slope * (1.0 + contact.memory * slope)
    return stiffer + (gap.damper + (elastic - gap.elastic) * contact.memory) * curve * depth > 0.0


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

    Within it they are sought on the quintic: where the penetration turns, and by a parabola around where its
    cubic says that the force does.
    """
    for k in range(len(contacts)):
        contact, gap, new_gap = contacts[k], gap_of(run, rows, OLD, k), gap_of(run, rows, NEW, k)
        if contact.phase != CONTACT or contact.rigid != 0.0:
            continue
        force, new_force = gap.elastic * gap.push, keep_largest(contact, new_gap, run.time + h)
        turns, falls = gap.rate > 0.0 > new_gap.rate, new_force < force < contact.force
        c = contact.clearance
        rate, new_rate = gap.rate * c / (c + gap.depth), new_gap.rate * c / (c + new_gap.depth)
        ends = gap.depth, rate, new_gap.depth, new_rate
        inside = not falls and not rises(contact, new_gap, new_gap.elastic, ends, h, 1.0)
        if not (turns or inside):
            continue
        know_slopes(run, h)
        if turns:
            x = turning(run, rows, contacts, h, k, True)
            keep_largest(contact, gap_of(run, rows, AT, k), run.time + x * h)
        if inside:
            low, high = 0.0, 1.0
            for _ in range(20):
                x = 0.5 * (low + high)
                if rises(contact, new_gap, -1.0, ends, h, x):
                    low = x
                else:
                    high = x
            x = min(max(low, ASIDE_OF_PEAK), 1.0 - ASIDE_OF_PEAK)
            before = force_at(run, rows, contacts, h, x - ASIDE_OF_PEAK, k)
            at = force_at(run, rows, contacts, h, x, k)
            after = force_at(run, rows, contacts, h, x + ASIDE_OF_PEAK, k)
            bend = before - 2.0 * at + after
            if bend < 0.0:
                x += 0.5 * ASIDE_OF_PEAK * (before - after) / bend
                force_at(run, rows, contacts, h, min(max(x, 0.0), 1.0), k)


# --------------------------------------------------------------------------------------- samples


@inner
def write(run, rows, contacts, samples, t, of):
    """Write the sample of a row's state; return whether it could."""
    row, out = run.taken, run.samples + run.taken * run.sample_width + 8 * run.size
    condition = call(run.forces, run.p, run.contacts, t, run.at + of * run.width, out)
    run.least = min(run.least, condition)
    for c in range(run.size):
        samples[row, c] = rows[of, c]
    if contacts is not None:
        phases = samples.shape[1] - 2 * len(contacts)
        for k in range(len(contacts)):
            samples[row, phases + 2 * k] = contacts[k].phase
            samples[row, phases + 2 * k + 1] = contacts[k].memory
    run.taken += 1
    return condition < np.inf


@inner
def interpolate(run, rows, method, step, x, parts):
    """Set y of AT to that at x of a step, by the first rows of dense output; of RK4 q by the quintic."""
    if method is None:
        set_within(run, rows, step.end - run.time, x, run.time)
    for c in range(0 if run.controlled != 0 else run.n, run.size):
        change = 0.0
        for i in range(parts - 1, -1, -1):
            change = (change + rows[DENSE + i, c]) * (x if i % 2 == 0 else 1.0 - x)
        rows[AT, c] = rows[OLD, c] + change


@inner
def write_within(run, rows, contacts, method, times, samples, step):
    """Write the samples before the end of a step by the method's interpolant: of order 7 in s, or 4.

    Return whether it could. RK4's is, of velocities and sums, the quartic through values and slopes at both
    ends and the slope at a third of the step, evaluated on the cubic: in error by O(h^5), as the step itself
    is. (The quintic's own derivative would divide the round-off of q by h, and graded steps are short.)
    """
    if run.taken == len(times) or times[run.taken] >= step.end:
        return True
    ok, size, H = know_slopes(run, step.end - run.time), run.size, step.H
    _, first = time_at(step, step.begin)
    _, last = time_at(step, step.begin + H)
    for c in range(size):
        change = rows[NEW, c] - rows[OLD, c]
        start, stop = H * (first * rows[START, c]), H * (last * rows[END, c])
        rows[DENSE, c], rows[DENSE + 1, c] = change, start - change
        rows[DENSE + 2, c] = 2.0 * change - start - stop
    parts = 4
    if method is None:
        interpolate(run, rows, method, step, INSIDE, 3)
        ok = set_slopes(run, run.time + INSIDE * H, AT, SLOPES) < np.inf and ok
        for c in range(size):  # x^2 (1 - x)^2 has the slope 4/27 there
            cubic = rows[DENSE, c] + (rows[DENSE + 1, c] + rows[DENSE + 2, c]) / 3.0
            rows[DENSE + 3, c] = 6.75 * (H * rows[SLOPES, c] - cubic)
    else:
        stages, parts = method[0].stages, 3 + method[0].dense_rows
        for c in range(size):
            rows[SLOPES, c], rows[SLOPES + stages, c] = first * rows[START, c], last * rows[END, c]
        for row in range(stages + 1, method[0].slopes):
            ok = set_stage(run, rows, method, step, row) < np.inf and ok
        for i in range(method[0].dense_rows):
            for c in range(size):
                total = 0.0
                for j in range(method[0].slopes):
                    total += method[0].dense[i, j] * rows[SLOPES + j, c]
                rows[DENSE + 3 + i, c] = H * total
    while run.taken < len(times) and times[run.taken] < step.end:
        time = times[run.taken]
        interpolate(run, rows, method, step, (place_at(step, time) - step.begin) / H, parts)
        ok = write(run, rows, contacts, samples, time, AT) and ok
    return ok


# -------------------------------------------------------------------------------------- the loop


@inner
def set_out(run, rows, contacts, method):
    """Set slopes and gaps where a run, or a part of it, begins; return whether it could.

    Compliant contacts that are closed at the start of a run touch then.
    """
    run.known = 0
    if contacts is not None:
        set_gaps(run, run.time, OLD)
        for k in range(len(contacts)):
            closed = contacts[k].phase == FLIGHT and gap_of(run, rows, OLD, k).g > 0.0
            if run.time == 0.0 and run.end > 0.0 and contacts[k].rigid == 0.0 and closed:
                note(run, rows, contacts, 2 * k)
        probe(run, rows, contacts)  # pins may have begun to follow rigid walls
    if method is None:
        return True
    run.known = 1
    return set_slopes(run, run.time, OLD, START) < np.inf


@inner
def move_on(run, rows, contacts, method, step, error, event, factor):
    """Move on to the end of a step, and choose the one after it."""
    old, new = rows[OLD], rows[NEW]
    for c in range(run.whole):
        old[c] = new[c]
    if method is not None:
        for c in range(run.size):
            rows[START, c] = rows[END, c]
    if contacts is not None:
        if run.wall >= 0 and step.end > run.time:  # all contacts take part again
            run.wall = -1
            for k in range(len(contacts)):
                contacts[k].ignored = 0.0
    run.time, run.condition = step.end, max(run.condition, run.worst)
    run.error, run.rejected = max(error, 1e-4), 0
    if run.controlled != 0 and event < 0 and step.end < run.end:
        run.step = next_step(step, factor)
        if contacts is not None:
            if run.fresh >= 0:
                part = lasting(step, factor) / contacts[run.fresh].duration_s
                run.first_part, run.fresh = min(LONGEST_PART, max(SHORTEST_PART, part)), -1


@compiled(**OPTIONS)
def advance(state, rows, contacts, method, knots, times, samples):
    """Advance the motion to the run's end in place, event by event; return how that ended.

    See ``run.Run`` of the arguments; contacts, method and knots may be None. Events are added to the log,
    and a sample is written for each of the times up to the end; steps do not depend on them.
    """
    run = state[0]
    if run.resumed == 0:
        if not set_out(run, rows, contacts, method):
            return FAILED
    while True:
        while run.taken < len(times) and times[run.taken] <= run.time + run.slack:
            if not write(run, rows, contacts, samples, run.time, OLD):
                return FAILED
        run.resumed = run.time < run.end
        if run.resumed == 0:
            return DONE
        if run.steps >= run.budget:
            return SPENT
        if contacts is not None:
            if run.logged >= LOG_ROWS - len(contacts):
                return FULL
            if run.located != 0 and run.steps % STEPS_BETWEEN_PROBES == 0 and any_closed(contacts):
                probe(run, rows, contacts)
        step, releasing = propose(run, rows, contacts, method, knots)
        error, t = attempt(run, rows, contacts, method, step, 1.0), run.time
        if knots is not None:
            for _ in range(KINK_TRIALS):
                short = 0.0 if run.controlled != 0 else SHORT * run.longest
                landed = to_kink(run, rows, knots, step.end - t, run.end - t, short)
                end = t + landed
                if landed == step.end - t or not (error <= 1.0 and end > t):
                    break
                step = Step(step.origin, step.sign, step.begin, place_at(step, end) - step.begin, end)
                releasing = -1
                error = attempt(run, rows, contacts, method, step, 1.0)
        event, place, factor, longer = -1, 1.0, changed(run, method, error), step
        if contacts is not None:
            if error <= 1.0:
                if method is not None:
                    reach = in_flight(run, rows, contacts, NEW, step.end - t, CONTROLLED_FLIGHT_PART)
                    error = np.inf if reach < 0.5 * (step.end - t) else error
                    factor = changed(run, method, error)
            if error <= 1.0:
                step, event, place = cut(run, rows, contacts, method, step, releasing)
                if np.isnan(step.end):
                    error, step, factor = np.inf, Step(t, 0.0, 0.0, longer.end - t, longer.end), 0.5
        if not error <= 1.0:
            run.step, run.rejected = lasting(step, factor), run.rejected + 1
            if not t + run.step > t or run.rejected >= MOST_REJECTIONS:
                return FAILED
            continue
        run.steps += 1
        if event < 0 or place > 0.0:
            if not write_within(run, rows, contacts, method, times, samples, step):
                return FAILED
            if contacts is not None:
                note_largest(run, rows, contacts, step.end - t)
            move_on(run, rows, contacts, method, step, error, event, factor)
        if contacts is not None:
            if event >= 0:
                if contacts[event // 2].rigid == 0.0:
                    note(run, rows, contacts, event)
                elif not bounce(run, rows, contacts, event // 2):
                    run.wall, run.resumed = event // 2, 0
                    return WALL
                if run.controlled != 0 and not set_slopes(run, run.time, OLD, START) < np.inf:
                    return FAILED
