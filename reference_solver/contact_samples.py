"""Samples within a step of ``contact_loop``: dense output from the states and slopes at the step's ends.

Part of the compiled driver (see ``contact_loop``). Within a step of length h the right-hand side is smooth,
since events end steps. Over x = (time - t)/h, positions are the
quintic through q, q' and q'' at both ends, in error by O(h^6). Velocities, and the sums of work, impulse and
losses, are quartics through value and slope at both ends and the slope at a third of the step, evaluated at
the interpolated state there: in error by O(h^5), as the step itself is. (The quintic's own derivative would
divide the round-off of q by h, and graded steps are short.)

A sample is a row of ``samples``: q, q', the sums since t = 0, the contacts' phases s, and {lambda} there.
"""

import numpy as np

from reference_solver.contact_events import FloatArray, Function

#: Where in the step the additional slope is taken; not 1/2, where all quartics with the same ends share it.
INSIDE = 1.0 / 3.0


def quintic(
    q: float, v: float, a: float, new_q: float, new_v: float, new_a: float, h: float, x: float
) -> float:
    """Return at x the quintic with these values and derivatives in time at both ends."""
    start, curve = h * v, 0.5 * h * h * a
    rise = new_q - q - start - curve
    slope = h * (new_v - v) - 2.0 * curve
    bend = 0.5 * h * h * (new_a - a)
    cubic = 10.0 * rise - 4.0 * slope + bend
    quartic = -15.0 * rise + 7.0 * slope - 2.0 * bend
    return q + x * (start + x * (curve + x * (cubic + x * (quartic + x * (6.0 * rise - 3.0 * slope + bend)))))


def quartic(change: float, slope: float, new_slope: float, bump: float, x: float) -> float:
    """Return at x what a quantity has changed by, with the slopes at both ends per unit of x.

    ``bump`` x^2 (1 - x)^2 is what the quartic has beyond the cubic through both ends.
    """
    rest, turn = change - slope, new_slope - slope
    return x * (slope + x * (3.0 * rest - turn + x * (turn - 2.0 * rest) + bump * (1.0 - x) * (1.0 - x)))


def bump_of(change: float, slope: float, new_slope: float, inside: float) -> float:
    """Return the quartic's bump from its slope at ``INSIDE``."""
    rest, turn, x = change - slope, new_slope - slope, INSIDE
    cubic = slope + x * (2.0 * (3.0 * rest - turn) + x * 3.0 * (turn - 2.0 * rest))
    return (inside - cubic) / (2.0 * x * (1.0 - x) * (1.0 - 2.0 * x))


def write(
    slopes: Function,
    p: FloatArray,
    s: FloatArray,
    t: float,
    q: FloatArray,
    v: FloatArray,
    totals: FloatArray,
    row: FloatArray,
) -> None:
    """Write the sample of a state."""
    n, size = len(q), len(totals)
    a, rate, lambda_ = np.empty(n), np.empty(size), np.empty(len(row) - 2 * n - size - len(s))
    slopes(p, s, t, q, v, a, rate, lambda_)
    for c in range(n):
        row[c], row[n + c] = q[c], v[c]
    for c in range(size):
        row[2 * n + c] = totals[c]
    for c in range(len(s)):
        row[2 * n + size + c] = s[c]
    for c in range(len(lambda_)):
        row[2 * n + size + len(s) + c] = lambda_[c]


def state_at(
    x: float,
    h: float,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    new_q: FloatArray,
    new_v: FloatArray,
    new_a: FloatArray,
    bump: FloatArray,
    at_q: FloatArray,
    at_v: FloatArray,
) -> None:
    """Write q and q' at x to ``at_q`` and ``at_v``."""
    for c in range(len(q)):
        at_q[c] = quintic(q[c], v[c], a[c], new_q[c], new_v[c], new_a[c], h, x)
        at_v[c] = v[c] + quartic(new_v[c] - v[c], h * a[c], h * new_a[c], bump[c], x)


def within(
    slopes: Function,
    p: FloatArray,
    s: FloatArray,
    t: float,
    h: float,
    q: FloatArray,
    v: FloatArray,
    totals: FloatArray,
    new_q: FloatArray,
    new_v: FloatArray,
    work: FloatArray,
    times: FloatArray,
    taken: int,
    samples: FloatArray,
) -> int:
    """Write the samples from number ``taken`` on that lie before t + h; return the number of the next one.

    The step goes from q and v at t to new_q and new_v and adds ``work`` to the totals.
    """
    n, size = len(q), len(totals)
    a, new_a, inside, bump = np.empty(n), np.empty(n), np.empty(n), np.zeros(n)
    rate, new_rate, inside_rate, sum_bump = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    at_q, at_v, at_totals = np.empty(n), np.empty(n), np.empty(size)
    lambda_ = np.empty(samples.shape[1] - 2 * n - size - len(s))
    slopes(p, s, t, q, v, a, rate, lambda_)
    slopes(p, s, t + h, new_q, new_v, new_a, new_rate, lambda_)
    state_at(INSIDE, h, q, v, a, new_q, new_v, new_a, bump, at_q, at_v)
    slopes(p, s, t + INSIDE * h, at_q, at_v, inside, inside_rate, lambda_)
    for c in range(n):
        bump[c] = bump_of(new_v[c] - v[c], h * a[c], h * new_a[c], h * inside[c])
    for c in range(size):
        sum_bump[c] = bump_of(work[c], h * rate[c], h * new_rate[c], h * inside_rate[c])
    while taken < len(times) and times[taken] < t + h:
        x = (times[taken] - t) / h
        state_at(x, h, q, v, a, new_q, new_v, new_a, bump, at_q, at_v)
        for c in range(size):
            at_totals[c] = totals[c] + quartic(work[c], h * rate[c], h * new_rate[c], sum_bump[c], x)
        write(slopes, p, s, times[taken], at_q, at_v, at_totals, samples[taken])
        taken += 1
    return taken
