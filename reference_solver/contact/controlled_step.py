"""A step of a method with its embedded error estimate, DOP853 or DOPRI5, its samples, and the step after it.

Numba compiles this module with the loops that take such steps, ``smooth_loop`` and ``adaptive_loop``. The
methods are in Hairer, Norsett and Wanner (1993, II.5 and II.10).
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from reference_solver import methods
from reference_solver.contact import loop
from reference_solver.contact.loop import INNER
from reference_solver.contact.types import AT, DENSE_ROW, END, FAILED, GO, NEW, OLD, START, WEIGHT
from reference_solver.machine_code import call

#: Step control: safety factor, bounds of what a step changes by, and the weight of the error before.
SAFETY, LEAST, MOST, BETA = 0.8, 0.2, 8.0, 0.04
#: Rejections in a row: halved as often, any step is below the round-off of time, or bounces around it.
MOST_REJECTIONS = 100


class Course(NamedTuple):
    """How time goes over a step, time = origin + sign s^2, or origin + s with sign 0, and where s begins."""

    origin: float
    sign: float
    begin: float


class Step(NamedTuple):
    """A step: how time goes over it, its length in s, and the time at its end."""

    course: Course
    H: float
    end: float


@register_jitable(**INNER, forceinline=True)
def time_at(course, s):
    """Return the time at s, and its rate."""
    if course.sign == 0.0:
        return course.origin + s, 1.0
    return course.origin + course.sign * s * s, 2.0 * course.sign * s


@register_jitable(**INNER)
def place_at(course, time):
    """Return s at a time."""
    if course.sign == 0.0:
        return time - course.origin
    return np.sqrt(max(course.sign * (time - course.origin), 0.0))


@register_jitable(**INNER, forceinline=True)
def no_further(now, course, H):
    """Return a step of H in s, or the one to the end of the run if that ends beyond it or just before."""
    end, _ = time_at(course, course.begin + H)
    if end >= now.end - 1e-9 * (now.end - now.time):
        end = now.end
        H = place_at(course, end) - course.begin
    now.tried = end - now.time
    return Step(course, H, end)


@register_jitable(**INNER, forceinline=True)
def to_kink(run, step):
    """Return the step on to a kink that one just taken has passed (see ``loop.to_kink``), or that step."""
    now = run.clock[0]
    h, left = step.end - now.time, now.end - now.time
    landed = loop.to_kink(run, h, left, 0.0)
    end = now.time + landed
    if landed == h or not end > now.time:
        return step
    return Step(step.course, place_at(step.course, end) - step.course.begin, end)


# ---------------------------------------------------------------------------------------- a step


@register_jitable(**INNER, forceinline=True)
def set_out(run):
    """Set the slope at the start of a step; return GO, or FAILED where there is none."""
    now = run.clock[0]
    return GO if loop.set_slopes(run, now.time, OLD, START) < np.inf else FAILED


@register_jitable(**INNER)
def add(out, scale, weights, rows, slopes):
    """Add ``scale`` times the sum of the first rows of slopes by weights.

    Inlined by force, its loops are not vectorised, and a step takes half as long again.
    """
    for j in range(rows):
        weight = scale * weights[j]
        if weight != 0.0:
            for c in range(len(out)):
                out[c] += weight * slopes[j, c]


@register_jitable(**INNER, forceinline=True)
def evaluate(run, course, H, row):
    """Set a row of slopes by those before it, as the method has it; return the condition there.

    Not inlined, it would make steps a tenth slower.
    """
    y, stage, method = run.old.y, run.at.y, run.method
    for c in range(len(y)):
        stage[c] = y[c]
    add(stage, H, method.matrix[row], row, run.slopes)
    t, rate = time_at(course, course.begin + method.nodes[row] * H)
    condition = loop.set_slopes(run, t, AT, row)
    if course.sign != 0.0:
        for c in range(len(y)):
            run.slopes[row, c] *= rate
    return condition


@register_jitable(**INNER)
def norm(out, estimate, slopes):
    """Return the sum of squares of an estimate of the error per unit of s, over the tolerance."""
    for c in range(len(out)):
        out[c] = 0.0
    add(out, 1.0, estimate, len(estimate), slopes)
    total = 0.0
    for c in range(len(out)):
        part = out[c] * slopes[WEIGHT, c]
        total += part * part
    return total


@register_jitable(**INNER, forceinline=True)
def trial(run, course, H):
    """Take a step of H in s; return its error over the tolerance, infinite on failure."""
    y, new_y, slopes, method = run.old.y, run.new.y, run.slopes, run.method
    worst, least = 1.0, np.inf
    _, rate = time_at(course, course.begin)
    for c in range(len(y)):
        slopes[0, c], new_y[c] = rate * slopes[START, c], 0.0
    for i in range(1, len(method.weights)):
        condition = evaluate(run, course, H, i)
        if not condition < np.inf:
            return np.inf
        worst, least = max(worst, condition), min(least, condition)
    run.control[0].condition, run.control[0].least = worst, least
    add(new_y, 1.0, method.weights, len(method.weights), slopes)
    for c in range(len(y)):  # the sum first, then y, for the sake of rounding
        new_y[c] = y[c] + H * new_y[c]
    fifth, third = norm(run.at.y, method.estimates[0], slopes), norm(run.at.y, method.estimates[1], slopes)
    error = abs(H) * fifth / np.sqrt((fifth + 0.01 * third) * 2.0 * run.old.n + 1e-300)
    return error if np.isfinite(error + third) else np.inf


@register_jitable(**INNER, forceinline=True)
def finish(run, t):
    """Move the new state onto its constraints, and set its slope; return whether it could.

    A step is not to end too near to a singular position: the next one would begin with what is amplified.
    """
    now, new, slopes = run.clock[0], run.new.y, run.slopes
    to, out = loop.address(run, NEW), loop.address(run, END)
    if not call(now.project, now.p, now.contacts, t, to, out) < np.inf:
        return False
    for c in range(2 * run.new.n):
        new[c] = slopes[END, c]
    new[len(new) - 1] += slopes[END, 2 * run.new.n]
    return loop.set_slopes(run, t, NEW, END) < methods.MOST_APART * run.control[0].least


@register_jitable(**INNER, forceinline=True)
def move_on(run, end, error):
    """Move on to the end of a step."""
    now, control, old, new = run.clock[0], run.control[0], run.old, run.new
    for c in range(len(old.y)):
        old.y[c], run.slopes[START, c] = new.y[c], run.slopes[END, c]
    now.time = end
    now.condition = max(now.condition, control.condition)
    control.error, control.rejected = max(error, 1e-4), 0


# --------------------------------------------------------------------------------- the next step


@register_jitable(**INNER, forceinline=True)
def changed(error, control, exponent):
    """Return the factor by which a step changes, from its error and the one before (Gustafsson 1991).

    The exponent is 1 over the order of the error.
    """
    most = MOST if control.rejected == 0 else 1.0
    if error > 1.0:
        return max(LEAST, SAFETY * error**-exponent) if np.isfinite(error) else LEAST
    if error == 0.0:
        return most
    factor = SAFETY * error ** (0.2 * BETA - exponent) * control.error**BETA
    return min(most, max(LEAST, factor))


@register_jitable(**INNER)
def again(control, t, h):
    """Have a step tried again at a length; return GO, or FAILED where there is no length left."""
    control.step, control.rejected = h, control.rejected + 1
    return GO if t + h > t and control.rejected < MOST_REJECTIONS else FAILED


# ---------------------------------------------------------------------------------- dense output


@register_jitable(**INNER)
def within(run, step):
    """Write the samples before the end of a step by the method's own interpolant: of order 7 in s, or 4.

    Return whether it could. A step without samples takes none of the interpolant's slopes.
    """
    if run.clock[0].taken == len(run.records.time) or run.records.time[run.clock[0].taken] >= step.end:
        return True
    y, new_y, at_y, slopes, method = run.old.y, run.new.y, run.at.y, run.slopes, run.method
    stages, rows = len(method.weights), 3 + len(method.dense)
    now, times, ok, (course, H, end) = run.clock[0], run.records.time, True, step
    _, first = time_at(course, course.begin)
    _, last = time_at(course, course.begin + H)
    for c in range(len(y)):
        slopes[0, c], slopes[stages, c] = first * slopes[START, c], last * slopes[END, c]
    for row in range(stages + 1, len(method.nodes)):
        ok = evaluate(run, course, H, row) < np.inf and ok
    for c in range(len(y)):
        change, start, stop = new_y[c] - y[c], H * slopes[0, c], H * slopes[stages, c]
        slopes[DENSE_ROW, c], slopes[DENSE_ROW + 1, c] = change, start - change
        slopes[DENSE_ROW + 2, c] = 2.0 * change - start - stop
        for i in range(len(method.dense)):
            total = 0.0
            for j in range(method.dense.shape[1]):
                total += method.dense[i, j] * slopes[j, c]
            slopes[DENSE_ROW + 3 + i, c] = H * total
    while now.taken < len(times) and times[now.taken] < end:
        time = times[now.taken]
        x = (place_at(course, time) - course.begin) / H
        for c in range(len(y)):
            change = 0.0
            for i in range(rows - 1, -1, -1):
                change = (change + slopes[DENSE_ROW + i, c]) * (x if i % 2 == 0 else 1.0 - x)
            at_y[c] = y[c] + change
        ok = loop.write(run, time, AT, run.at) and ok
    return ok
