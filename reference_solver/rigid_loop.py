"""The loop of rigid joints between events: RK4 steps up to the first that may hold one.

This text is also part of every generated module with rigid joints, where Numba compiles it: ``step``,
``gaps`` and ``multipliers``, parameters here, are functions of that module. It uses arrays and numbers only.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Function = Callable[..., Any]


def alarmed(gap: FloatArray, new_gap: FloatArray, follows: NDArray[np.bool_], tolerance: FloatArray) -> bool:
    """Return whether a pin in flight is past its wall, or its distance has peaked within the step.

    ``tolerance`` (J, 2) is round-off of g and of its rate: a pin within both has just left the wall.
    """
    for k in range(len(gap)):
        if not follows[k]:
            if new_gap[k, 0] > 0.0 and (new_gap[k, 1] > tolerance[k, 1] or new_gap[k, 0] > tolerance[k, 0]):
                return True
            if gap[k, 1] > 0.0 and new_gap[k, 1] < 0.0:
                return True
    return False


def until_alarm(
    step: Function,
    gaps: Function,
    multipliers: Function,
    p: FloatArray,
    q: FloatArray,
    v: FloatArray,
    t: float,
    h: float,
    count: int,
    follows: NDArray[np.bool_],
    tolerance: FloatArray,
    lambda_: FloatArray,
    sums: FloatArray,
) -> tuple[int, int]:
    """Take up to ``count`` steps of h from t in place; stop before a step that may hold an event.

    ``lambda_`` (m,) is room for the multipliers; those of the joints that follow are its last. The steps add
    to ``sums`` (1 + 2J,). Returns the steps taken, and 0, or 1 for an alarm in the next step, or 2 where it
    cannot be taken.
    """
    new_q, new_v = np.empty_like(q), np.empty_like(v)
    gap, new_gap = np.empty((len(follows), 2)), np.empty((len(follows), 2))
    following = 0
    for follow in follows:
        following += 1 if follow else 0
    added, done = np.empty_like(sums), 0
    gaps(p, q, v, gap)
    while done < count:
        now = t + done * h
        for c in range(len(q)):
            new_q[c], new_v[c] = q[c], v[c]
        for c in range(len(sums)):
            added[c] = 0.0
        if not step(p, now, h, new_q, new_v, added):
            return done, 2
        gaps(p, new_q, new_v, new_gap)
        if alarmed(gap, new_gap, follows, tolerance):
            return done, 1
        if following > 0:
            if not multipliers(p, now + h, new_q, new_v, lambda_):
                return done, 2
            for row in range(len(lambda_) - following, len(lambda_)):
                if lambda_[row] > 0.0:
                    return done, 1
        for c in range(len(q)):
            q[c], v[c] = new_q[c], new_v[c]
        for c in range(len(sums)):
            sums[c] += added[c]
        gap, new_gap = new_gap, gap
        done += 1
    return done, 0
