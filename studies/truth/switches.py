"""Where the equations change: touch and release, clipping, and the kinks of friction and of tables.

Each is a signal that is negative until then. A step over one is repeated with other lengths until the signal
is zero to round-off. A signal that rises and falls within a step is followed to its peak first, so that a
touch shorter than a step is seen.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.truth.equations import (
    CLIPPED,
    CONTACT,
    FLIGHT,
    FOLLOWS,
    GAP,
    MEMORY,
    NORMAL,
    PIECE,
    PUSHED,
    SLIDING,
)
from studies.truth.machine import bare
from studies.truth.physics import DEAD, DRAGS, FULL, KIND, MU, PULLS, SLOWEST, A, B, C, K
from studies.truth.record import ASIDE, OF_TOLD, OUT, SLOPE, TOLD, TRIAL, Watched
from studies.truth.stepping import REJECT, Problem
from studies.truth.tables import knot

FloatArray = NDArray[np.float64]
#: The signals of a joint: its gap, the sign of its force, and the piece of its friction, or of a table, left
#: downwards and upwards.
ROOM, SIGN, DOWN, UP = range(4)
#: Most trials for a switch, and the part of a step and of a signal within which it is found.
TRIALS, SHORT = 80, 1e-15
#: Part of a signal's range by which it may miss zero in the cubic through a step and yet be followed.
NEAR = 0.1
#: Part of its clearance by which a rigid wall stands back from a pin that is leaving it (its memory is 1).
LEFT = 4e-15
#: Part of a step over which rates of signals are taken.
DIFFERENCE = 1e-4


@bare
def gap_of(m: Watched, phases: FloatArray, z: FloatArray, k: int) -> tuple[float, float, float, float]:
    """Return the gap of joint k and its rate."""
    x, size = m.joints[k, GAP], len(m.row)
    if phases[k, CONTACT] == FOLLOWS:
        c, rate = m.walls[k, C], z[size + x]
        cos, sin = c * np.cos(z[x]), c * np.sin(z[x])
        return cos, sin, -rate * sin, rate * cos
    return z[x], z[x + 1], z[size + x], z[size + x + 1]


@bare
def signal(of: Problem, m: Watched, z: FloatArray, k: int, which: int) -> float:
    """Return a signal of joint k, or of a table, -inf where it can do nothing in the present phase."""
    phases = of.phases
    if k >= len(m.walls):
        if which < DOWN:
            return -np.inf
        kink = m.kinks[k - len(m.walls)]
        table, piece = kink[0], phases[k, PIECE]
        count = float(m.tables.at[table, 1])
        if m.tables.ends[table, 1] == 0.0 and (piece < 0.0 if which == DOWN else piece >= count):
            return -np.inf
        now = z[len(m.row) * kink[2] + kink[1]] + m.beside[k - len(m.walls)]
        edge = knot(m.tables, table, piece + (1.0 if which == UP else 0.0))
        return float(now - edge if which == UP else edge - now)
    wall, contact = m.walls[k], phases[k, CONTACT]
    if contact == FOLLOWS and which <= SIGN:
        return -told(of, m, z, k, NORMAL) if which == ROOM else -np.inf
    if contact == FLIGHT and which != ROOM:
        return -np.inf
    d_x, d_y, v_x, v_y = gap_of(m, phases, z, k)
    distance = np.hypot(d_x, d_y)
    if which == ROOM:
        part = distance / wall[C]
        gap = 0.5 * (part - 1.0) * (part + 1.0)
        if wall[K] == np.inf:
            return float(gap - LEFT * phases[k, MEMORY])
        return float(gap if contact == FLIGHT else -gap)
    if which == SIGN:
        if wall[DRAGS] == 1.0 or (wall[MU] == 0.0 if wall[PULLS] == 1.0 else wall[A] == 0.0):
            return -np.inf
        rate = (d_x * v_x + d_y * v_y) / distance
        share = 1.0 + phases[k, MEMORY] * rate
        if wall[PULLS] == 1.0:
            spring, damper = wall[K] * max(distance - wall[C], 0.0), wall[B] * rate
            share = (spring + damper) / (spring + abs(damper))
        return float(share if contact == CLIPPED else -share)
    piece = phases[k, PIECE]
    if wall[MU] == 0.0 or contact == CLIPPED:
        return -np.inf
    limit = _limit(wall, piece if which == UP else -piece)
    if limit == np.inf:
        return -np.inf
    speed = told(of, m, z, k, SLIDING)
    return float(((speed if which == UP else -speed) - limit) / wall[FULL])


@bare
def _limit(wall: FloatArray, piece: float) -> float:
    """Return the sliding speed that ends a piece of friction upwards; tanh is smooth, but steep about 0."""
    if piece == 2.0:
        return np.inf
    if wall[KIND] == 2.0:
        return np.inf if piece > 0.0 else 0.0
    if piece == -2.0:
        return float(-wall[FULL])
    if piece == -1.0:
        return float(-wall[DEAD])
    return float(wall[DEAD] if piece == 0.0 and wall[DEAD] > 0.0 else wall[FULL])


@bare
def told(of: Problem, m: Watched, z: FloatArray, k: int, what: int) -> float:
    """Return what a state tells of joint k: the force that presses its pin inwards, or its sliding speed."""
    rates = of.rates
    rates(of.p, of.phases, z, m.room[OUT], m.room[TOLD])
    return float(m.room[TOLD, OF_TOLD * k + what])


@bare
def switch(of: Problem, m: Watched, z: FloatArray, k: int, which: int) -> None:
    """Change the phase of joint k, or of a table, whose signal has come to zero."""
    phases = of.phases
    if k >= len(m.walls):
        phases[k, PIECE] += 1.0 if which == UP else -1.0
        return
    wall, contact, piece = m.walls[k], phases[k, CONTACT], phases[k, PIECE]
    if which == ROOM and contact == FLIGHT:
        d_x, d_y, v_x, v_y = gap_of(m, phases, z, k)
        rate = (d_x * v_x + d_y * v_y) / np.hypot(d_x, d_y)
        phases[k, CONTACT] = PUSHED
        phases[k, MEMORY] = wall[A] / max(rate, wall[SLOWEST])
    elif which == ROOM:
        phases[k, CONTACT] = FLIGHT
    elif which == SIGN:
        phases[k, CONTACT] = PUSHED if contact == CLIPPED else CLIPPED
    elif wall[KIND] == 2.0:
        phases[k, PIECE] = -piece
    else:
        part = 1.0 if wall[DEAD] > 0.0 else 2.0
        phases[k, PIECE] = piece + part if which == UP else piece - part
    if which <= SIGN and phases[k, CONTACT] == PUSHED and wall[MU] > 0.0:
        phases[k, PIECE] = piece_of(wall, told(of, m, z, k, SLIDING))


@bare
def piece_of(wall: FloatArray, speed: float) -> float:
    """Return friction's piece at a sliding speed."""
    way = 1.0 if speed > 0.0 else -1.0
    if wall[KIND] == 2.0:
        return way
    if abs(speed) >= wall[FULL]:
        return 2.0 * way
    return way if abs(speed) >= wall[DEAD] > 0.0 else 0.0


@bare
def _rate(of: Problem, m: Watched, y: FloatArray, h: float, k: int, which: int) -> float:
    """Return a signal's rate, which is exact for a gap but for round-off."""
    if k < len(m.walls) and which == ROOM and of.phases[k, CONTACT] != FOLLOWS:
        d_x, d_y, v_x, v_y = gap_of(m, of.phases, y, k)
        speed = (d_x * v_x + d_y * v_y) / m.walls[k, C] ** 2
        return float(speed if of.phases[k, CONTACT] == FLIGHT else -speed)
    slope, aside, rise, rates = m.room[SLOPE], m.room[ASIDE], 0.0, of.rates
    rates(of.p, of.phases, y, slope, m.room[TOLD])
    for way in (1.0, -1.0):
        for i in range(len(y)):
            aside[i] = y[i] + way * DIFFERENCE * h * slope[i]
        rise += way * signal(of, m, aside, k, which)
    return float(rise / (2.0 * DIFFERENCE * h))


@bare
def first_switch(
    of: Problem, step: Any, m: Watched, y: FloatArray, end: FloatArray, h: float
) -> tuple[float, int, int, int]:
    """Return when in a step from y to ``end`` the first switch is, its joint and signal, and the trials.

    The joint is -1 where there is none. States are (2, state).
    """
    first, joint, kind, trials = h, -1, 0, 0
    for k in range(len(of.phases)):
        for which in range(4):
            if signal(of, m, y[0], k, which) != -np.inf:
                at, more = _crossing(of, step, m, y, end[0], h, k, which)
                trials += more
                if 0.0 <= at <= first and (at < first or joint < 0):
                    first, joint, kind = at, k, which
    return first, joint, kind, trials


@bare
def _crossing(
    of: Problem, step: Any, m: Watched, y: FloatArray, end: FloatArray, h: float, k: int, which: int
) -> tuple[float, int]:
    """Return when a signal passes zero upwards, -1 where it does not, and the trials."""
    low, high, trials, trial = 0.0, h, 0, m.room[TRIAL : TRIAL + 2]
    g_low, g_high = signal(of, m, y[0], k, which), signal(of, m, end, k, which)
    r_low, r_high = _rate(of, m, y[0], h, k, which), _rate(of, m, end, h, k, which)
    if g_high <= 0.0 or (r_low <= 0.0 and r_high <= 0.0):
        if not r_low > 0.0 > r_high or not _may_reach_zero(g_low, g_high, r_low, r_high, h):
            return -1.0, trials
        high, g_high, trials = _zero(of, step, m, y, h, k, which, low, high, r_low, r_high, True)
        if g_high <= 0.0:
            return -1.0, trials
    if g_low >= 0.0 or r_low < 0.0:  # it may just have been switched here: begin in the dip behind
        if r_low >= 0.0:
            return 0.0, trials
        g_low = 0.0
        while g_low >= 0.0:
            low = 0.5 * (low if low > 0.0 else high)
            if step(of, y, low, trial) >= REJECT:
                return low, trials + 1
            g_low, trials = signal(of, m, trial[0], k, which), trials + 1
            if g_low >= 0.0:
                high, g_high = low, g_low
            if low < SHORT * h:
                return 0.0, trials
    high, _, more = _zero(of, step, m, y, h, k, which, low, high, g_low, g_high, False)
    return high, trials + more


@bare
def _zero(
    of: Problem,
    step: Any,
    m: Watched,
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

    By false position with halved weights (Illinois). A peak above zero need not be found any closer. Where a
    step has no end it is returned as one, for whoever takes it finds that too.
    """
    trial, side, g, at = m.room[TRIAL : TRIAL + 2], 0, 0.0, high
    close = SHORT if not peak else 1e-12 * abs(at_high - at_low)
    for count in range(TRIALS):
        at = (low * at_high - high * at_low) / (at_high - at_low)
        if step(of, y, at, trial) >= REJECT:
            return at, 1.0, count + 1
        g = signal(of, m, trial[0], k, which)
        value = _rate(of, m, trial[0], h, k, which) if peak else g
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


@bare
def _may_reach_zero(g0: float, g1: float, r0: float, r1: float, h: float) -> bool:
    """Return whether the cubic through both ends of a step comes to zero, or near it."""
    highest = max(g0, g1)
    for i in range(1, 16):
        s = i / 16
        value = (1 + 2 * s) * (1 - s) ** 2 * g0 + s * s * (3 - 2 * s) * g1
        highest = max(highest, value + h * s * (1 - s) * ((1 - s) * r0 - s * r1))
    return highest > -NEAR * (highest - min(g0, g1))
