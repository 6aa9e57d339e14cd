"""Where a joint's contact changes its law: touch and release, clipping, and the kinks of friction and of gas.

Each is a signal that is negative until then. A step over one is repeated with other lengths until the signal
is zero to round-off. A signal that rises and falls within a step is followed to its peak first, so that a
touch shorter than a step is seen.
"""

from typing import Any

import numpy as np
from numba import njit

from studies.independent.equations import (
    CLIPPED,
    CONTACT,
    FLIGHT,
    FOLLOWS,
    GAS,
    MEMORY,
    NORMAL,
    PIECE,
    PUSHED,
    SLIDING,
    STATE,
    placed,
)
from studies.independent.loads import gas_knot
from studies.independent.mechanism import SIZE, FloatArray, Mechanism, Walls
from studies.independent.stepping import Table

#: The signals of a joint: its gap, the sign of its force, and friction's piece left downwards and upwards.
GAP, SIGN, DOWN, UP = range(4)
#: Most trials for a switch, and parts of a step and of a signal's range within which it is found.
TRIALS, SHORT, ZERO = 80, 1e-15, 1e-15
#: Part of a signal's range by which it may miss zero in the cubic through a step and yet be followed.
NEAR = 0.1
#: Part of its clearance by which a rigid wall stands back from a pin that is leaving it (its memory is 1).
LEFT = 4e-15
#: Part of a step over which rates of signals are taken.
DIFFERENCE = 1e-4


@njit(error_model="numpy")
def signal(rates: Any, m: Mechanism, phases: FloatArray, z: FloatArray, k: int, which: int) -> float:
    """Return a signal of joint k, or of the gas, -inf where it can do nothing in the joint's phase."""
    if k == GAS:
        if which < DOWN or not m.load.kinks:
            return -np.inf
        edge = gas_knot(m.load, phases[GAS, PIECE] + (1.0 if which == UP else 0.0))
        return float(z[0] - edge if which == UP else edge - z[0])
    walls, x, contact = m.walls, 2 * k + 1, phases[k, CONTACT]
    if contact == FOLLOWS and which <= SIGN:
        return -told(rates, m, phases, z, k, NORMAL) if which == GAP else -np.inf
    y = placed(walls, phases, z)
    distance = np.hypot(y[x], y[x + 1])
    if which == GAP:
        part = distance / walls.c[k]
        gap = 0.5 * (part - 1.0) * (part + 1.0)
        if walls.K[k] == np.inf:
            return float(gap - LEFT * phases[k, MEMORY])
        return float(gap if contact == FLIGHT else -gap)
    if contact == FLIGHT:
        return -np.inf
    if which == SIGN:
        if walls.drags[k] or (walls.mu[k] == 0.0 if walls.pulls[k] else walls.a[k] == 0.0):
            return -np.inf
        rate = (y[x] * y[SIZE + x] + y[x + 1] * y[SIZE + x + 1]) / distance
        share = 1.0 + phases[k, MEMORY] * rate
        if walls.pulls[k]:
            spring, damper = walls.K[k] * max(distance - walls.c[k], 0.0), walls.b[k] * rate
            share = (spring + damper) / (spring + abs(damper))
        return float(share if contact == CLIPPED else -share)
    piece, full = phases[k, PIECE], walls.full[k]
    if walls.mu[k] == 0.0 or contact == CLIPPED:
        return -np.inf
    limit = _limit(walls, k, piece if which == UP else -piece)
    if limit == np.inf:
        return -np.inf
    speed = told(rates, m, phases, z, k, SLIDING)
    return float(((speed if which == UP else -speed) - limit) / full)


@njit(error_model="numpy")
def _limit(walls: Walls, k: int, piece: float) -> float:
    """Return the sliding speed that ends a piece of friction upwards; tanh is smooth, but steep about 0."""
    if piece == 2.0:
        return np.inf
    if walls.kind[k] == 2:
        return np.inf if piece > 0.0 else 0.0
    if piece == -2.0:
        return float(-walls.full[k])
    if piece == -1.0:
        return float(-walls.dead[k])
    return float(walls.dead[k] if piece == 0.0 and walls.dead[k] > 0.0 else walls.full[k])


@njit(error_model="numpy")
def told(rates: Any, m: Mechanism, phases: FloatArray, z: FloatArray, k: int, what: int) -> float:
    """Return what a state tells of joint k: the force that presses its pin inwards, or its sliding speed."""
    out = np.empty((4, 3))
    rates(m, phases, z, np.empty(STATE), out)
    return float(out[k, what])


@njit(error_model="numpy")
def switch(rates: Any, m: Mechanism, phases: FloatArray, y: FloatArray, k: int, which: int) -> None:
    """Change the phase of joint k, or of the gas, whose signal has come to zero."""
    if k == GAS:
        phases[GAS, PIECE] += 1.0 if which == UP else -1.0
        return
    walls, x, contact, piece = m.walls, 2 * k + 1, phases[k, CONTACT], phases[k, PIECE]
    if which == GAP and contact == FLIGHT:
        rate = (y[x] * y[SIZE + x] + y[x + 1] * y[SIZE + x + 1]) / np.hypot(y[x], y[x + 1])
        phases[k, CONTACT] = PUSHED
        phases[k, MEMORY] = walls.a[k] / max(rate, walls.slowest[k])
    elif which == GAP:
        phases[k, CONTACT] = FLIGHT
    elif which == SIGN:
        phases[k, CONTACT] = PUSHED if contact == CLIPPED else CLIPPED
    elif walls.kind[k] == 2:
        phases[k, PIECE] = -piece
    else:
        part = 1.0 if walls.dead[k] > 0.0 else 2.0
        phases[k, PIECE] = piece + part if which == UP else piece - part
    if which <= SIGN and phases[k, CONTACT] == PUSHED and walls.mu[k] > 0.0:
        phases[k, PIECE] = piece_of(walls, k, told(rates, m, phases, y, k, SLIDING))


@njit(error_model="numpy")
def piece_of(walls: Walls, k: int, speed: float) -> float:
    """Return friction's piece at a sliding speed."""
    way = 1.0 if speed > 0.0 else -1.0
    if walls.kind[k] == 2:
        return way
    if abs(speed) >= walls.full[k]:
        return 2.0 * way
    return way if abs(speed) >= walls.dead[k] > 0.0 else 0.0


@njit(error_model="numpy")
def _rate(rates: Any, m: Mechanism, phases: FloatArray, y: FloatArray, h: float, k: int, which: int) -> float:
    """Return a signal's rate, which is exact for a gap but for round-off."""
    if which == GAP and phases[k, CONTACT] != FOLLOWS:
        x = 2 * k + 1
        speed = (y[x] * y[SIZE + x] + y[x + 1] * y[SIZE + x + 1]) / m.walls.c[k] ** 2
        return float(speed if phases[k, CONTACT] == FLIGHT else -speed)
    f = np.empty(STATE)
    rates(m, phases, y, f, np.empty((4, 3)))
    f *= DIFFERENCE * h
    rise = signal(rates, m, phases, y + f, k, which) - signal(rates, m, phases, y - f, k, which)
    return float(rise / (2.0 * DIFFERENCE * h))


@njit(error_model="numpy")
def first_switch(
    step: Any,
    table: Table,
    rates: Any,
    m: Mechanism,
    phases: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    end: FloatArray,
    h: float,
) -> tuple[float, int, int, int]:
    """Return when in a step from y to ``end`` the first switch is, its joint and signal, and the trials.

    The joint is -1 where there is none.
    """
    first, joint, kind, trials = h, -1, 0, 0
    for k in range(4):
        for which in range(4):
            if (k == GAS or m.walls.c[k] > 0.0) and signal(rates, m, phases, y, k, which) != -np.inf:
                at, more = _crossing(step, table, rates, m, phases, scale, y, end, h, k, which)
                trials += more
                if 0.0 <= at <= first and (at < first or joint < 0):
                    first, joint, kind = at, k, which
    return first, joint, kind, trials


@njit(error_model="numpy")
def _crossing(
    step: Any,
    table: Table,
    rates: Any,
    m: Mechanism,
    phases: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    end: FloatArray,
    h: float,
    k: int,
    which: int,
) -> tuple[float, int]:
    """Return when a signal passes zero upwards, -1 where it does not, and the trials."""
    low, high, trials = 0.0, h, 0
    g_low, g_high = signal(rates, m, phases, y, k, which), signal(rates, m, phases, end, k, which)
    r_low = _rate(rates, m, phases, y, h, k, which)
    r_high = _rate(rates, m, phases, end, h, k, which)
    if g_high <= 0.0 or (r_low <= 0.0 and r_high <= 0.0):
        if not r_low > 0.0 > r_high or not _may_reach_zero(g_low, g_high, r_low, r_high, h):
            return -1.0, trials
        high, g_high, trials = _zero(
            step, table, rates, m, phases, scale, y, h, k, which, low, high, r_low, r_high, True
        )
        if g_high <= 0.0:
            return -1.0, trials
    if g_low >= 0.0 or r_low < 0.0:  # it may just have been switched here: begin in the dip behind
        if r_low >= 0.0:
            return 0.0, trials
        trial, g_low = np.empty(len(y)), 0.0
        while g_low >= 0.0:
            low = 0.5 * (low if low > 0.0 else high)
            step(table, rates, m, phases, scale, y, low, trial)
            g_low, trials = signal(rates, m, phases, trial, k, which), trials + 1
            if g_low >= 0.0:
                high, g_high = low, g_low
            if low < SHORT * h:
                return 0.0, trials
    high, _, more = _zero(
        step, table, rates, m, phases, scale, y, h, k, which, low, high, g_low, g_high, False
    )
    return high, trials + more


@njit(error_model="numpy")
def _zero(
    step: Any,
    table: Table,
    rates: Any,
    m: Mechanism,
    phases: FloatArray,
    scale: FloatArray,
    y: FloatArray,
    h: float,
    k: int,
    which: int,
    low: float,
    high: float,
    at_low: float,
    at_high: float,
    peak: bool,
) -> tuple[float, float, int]:
    """Return the step in which a signal comes to zero, or to its ``peak``, the signal there, and the trials.

    By false position with halved weights (Illinois). A peak above zero need not be found any closer.
    """
    trial, side, g, at = np.empty(len(y)), 0, 0.0, high
    close = SHORT if not peak else 1e-12 * abs(at_high - at_low)
    for count in range(TRIALS):
        at = (low * at_high - high * at_low) / (at_high - at_low)
        step(table, rates, m, phases, scale, y, at, trial)
        g = signal(rates, m, phases, trial, k, which)
        value = _rate(rates, m, phases, trial, h, k, which) if peak else g
        if abs(value) <= close or high - low <= SHORT * h or (peak and g > 0.0):
            return at, g, count + 1
        if (value > 0.0) == (at_high > 0.0):
            high, at_high = at, value
            at_low = 0.5 * at_low if side == 1 else at_low
            side = 1
        else:
            low, at_low = at, value
            at_high = 0.5 * at_high if side == -1 else at_high
            side = -1
    return at, g, TRIALS


@njit(error_model="numpy")
def _may_reach_zero(g0: float, g1: float, r0: float, r1: float, h: float) -> bool:
    """Return whether the cubic through both ends of a step comes to zero, or near it."""
    highest = max(g0, g1)
    for i in range(1, 16):
        s = i / 16
        value = (1 + 2 * s) * (1 - s) ** 2 * g0 + s * s * (3 - 2 * s) * g1
        highest = max(highest, value + h * s * (1 - s) * ((1 - s) * r0 - s * r1))
    return highest > -NEAR * (highest - min(g0, g1))
