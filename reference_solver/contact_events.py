"""Events of contacts: their alarms, and the location of the first by shortening the step until it ends there.

Part of the compiled driver (see ``contact_loop``).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Function = Callable[..., bool]

#: The phases of a contact; a probe answers with a unit normal force.
FLIGHT, CONTACT, CLIPPED, PROBE = 0.0, 1.0, 2.0, 3.0


def alarm(s: FloatArray, laws: FloatArray, gap: FloatArray, k: int, kind: int) -> float:
    """Return a number that is positive past the event: 0 is touch or release, 1 the law's change of sign."""
    phase = s[2 * k]
    if kind == 0:
        return float(gap[k, 0] if phase == FLIGHT else -gap[k, 0])
    if phase == FLIGHT or laws[k, 7] == 0.0:
        return -1.0
    clearance = laws[k, 4]
    factor = 1.0 + s[2 * k + 1] * gap[k, 1] * clearance / (clearance + gap[k, 3])
    return float(-factor if phase == CONTACT else factor)


def first_alarm(s: FloatArray, laws: FloatArray, gap: FloatArray, skip: int) -> int:
    """Return the number 2 k + kind of an alarm other than ``skip`` that has gone off, or -1."""
    for k in range(len(laws)):
        for kind in range(2):
            if 2 * k + kind != skip and alarm(s, laws, gap, k, kind) > 0.0:
                return 2 * k + kind
    return -1


def value_at(
    step: Function,
    p: FloatArray,
    s: FloatArray,
    laws: FloatArray,
    q: FloatArray,
    v: FloatArray,
    t: float,
    h: float,
    new_q: FloatArray,
    new_v: FloatArray,
    work: FloatArray,
    gap: FloatArray,
    event: int,
) -> float:
    """Return the alarm of an event after a step of length h, left in new_q, new_v and gap."""
    if not step(p, s, q, v, t, h, new_q, new_v, work, gap):
        return np.nan
    return alarm(s, laws, gap, event // 2, event % 2)


def locate(
    step: Function,
    p: FloatArray,
    s: FloatArray,
    laws: FloatArray,
    q: FloatArray,
    v: FloatArray,
    t: float,
    h: float,
    new_q: FloatArray,
    new_v: FloatArray,
    work: FloatArray,
    gap: FloatArray,
    event: int,
) -> float:
    """Return the step that ends on an event known to lie within h, or beyond it by rounding.

    Touch and release by Newton's method, since the gap's rate is known, the law's change of sign by the
    Illinois method; both within a bracket. The state after that step is left in new_q and new_v.
    """
    k, gone = event // 2, event % 2 == 0
    high, high_value = h, value_at(step, p, s, laws, q, v, t, h, new_q, new_v, work, gap, event)
    low, low_value = 0.0, 0.0
    trial, value = high, high_value
    if not gone:
        low_value = value_at(step, p, s, laws, q, v, t, 0.0, new_q, new_v, work, gap, event)
        if low_value > 0.0:
            return 0.0
    for _ in range(100):
        resolution = 4e-16 * (t + trial) + 1e-300
        if high - low <= resolution:
            break
        if gone:  # aimed past the event by rounding, so as to end on its far side
            rate = gap[k, 1] if s[2 * k] == FLIGHT else -gap[k, 1]
            trial = trial - value / rate + resolution if rate > 0.0 else low
        else:
            trial = high - high_value * (high - low) / (high_value - low_value)
        if not low < trial < high:
            trial = 0.5 * (low + high)
        value = value_at(step, p, s, laws, q, v, t, trial, new_q, new_v, work, gap, event)
        if value == 0.0 or (gone and 0.0 < value <= 4.0 * resolution * abs(gap[k, 1])):
            return trial
        if value > 0.0:
            high, high_value, low_value = trial, value, 0.5 * low_value
        else:
            low, low_value, high_value = trial, value, 0.5 * high_value
    value_at(step, p, s, laws, q, v, t, high, new_q, new_v, work, gap, event)
    return high


def peak(gap: FloatArray, new_gap: FloatArray, h: float) -> float:
    """Return the time within a step of length h at which the cubic through both ends' g and rates peaks."""
    rise, fall = gap[1], new_gap[1]
    curve = 3.0 * (new_gap[0] - gap[0]) / h - 2.0 * rise - fall
    cubic = rise + fall - 2.0 * (new_gap[0] - gap[0]) / h
    # g' = rise + 2 curve x + 3 cubic x^2 over x = time/h; its zero with g' falling.
    root = np.sqrt(max(curve * curve - 3.0 * cubic * rise, 0.0))
    x = -rise / (curve - root) if curve < root else 0.5
    return h * min(max(x, 0.0), 1.0)


def approach(
    step: Function,
    p: FloatArray,
    s: FloatArray,
    laws: FloatArray,
    q: FloatArray,
    v: FloatArray,
    t: float,
    h: float,
    new_q: FloatArray,
    new_v: FloatArray,
    work: FloatArray,
    gap: FloatArray,
    new_gap: FloatArray,
) -> tuple[int, float]:
    """Look for a pin that touches and leaves within the step: return its event and a step ending inside.

    Without one, return -1 and the whole step. The state after the returned step is left in new_q and new_v.
    """
    for k in range(len(laws)):
        if s[2 * k] == FLIGHT and gap[k, 1] > 0.0 and new_gap[k, 1] < 0.0:
            nearest = peak(gap[k], new_gap[k], h)
            value = value_at(step, p, s, laws, q, v, t, nearest, new_q, new_v, work, new_gap, 2 * k)
            if value > 0.0:
                return 2 * k, nearest
            value_at(step, p, s, laws, q, v, t, h, new_q, new_v, work, new_gap, 2 * k)
    return -1, h
