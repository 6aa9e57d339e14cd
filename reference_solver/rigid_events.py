"""Events of rigid joints within a step, by shortening the step until it ends on one."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from reference_solver.errors import EventLost
from reference_solver.rigid_modes import Mode

FloatArray = NDArray[np.float64]

#: Halvings in search of a step's beginning before an event: further ones are below any time's last place.
HALVINGS = 60


def first_event(
    mode: Mode,
    q: FloatArray,
    v: FloatArray,
    t: float,
    h: float,
    tolerance: FloatArray,
    ignored: frozenset[int],
) -> tuple[float, int | None]:
    """Return the step up to the first event within h, and its joint; h and None without one.

    A joint in flight reaches its wall, found too where it touches and leaves within the step (its distance
    peaks, once); the force of a joint that follows changes sign, seen at the step's end. ``ignored`` joints
    have just had their event at t and take no part.

    Raises:
        EventLost: the search for an event within the step has come to nothing.
        SolverError: a step of the search failed.
    """

    def gap(joint: int, column: int) -> Callable[[float], float]:
        def value(length: float) -> float:
            return float(mode.gaps(*mode.step(q, v, t, length)[:2])[joint, column])

        return value

    def pull(row: int) -> Callable[[float], float]:
        def value(length: float) -> float:
            after_q, after_v, _ = mode.step(q, v, t, length)
            return float(mode.multipliers(t + length, after_q, after_v)[row])

        return value

    before, (after_q, after_v, _) = mode.gaps(q, v), mode.step(q, v, t, h)
    after = mode.gaps(after_q, after_v)
    first: tuple[float, int | None] = (h, None)

    def searched(value: Callable[[float], float], longest: float, joint: int, noise: float = 0.0) -> float:
        try:
            return zero(value, longest, noise)
        except (RuntimeError, ValueError) as trouble:  # brentq's: no convergence; no change of sign, or NaN
            raise EventLost(t, h, joint, str(trouble).rstrip(".")) from trouble

    for joint in range(len(before)):
        if joint in ignored:
            continue
        if joint in mode.following:
            row = mode.following.index(joint) - len(mode.following)
            past, event, at = pull(row)(h) > 0, pull(row), h
        else:
            event, at = gap(joint, 0), h
            past = after[joint, 0] > 0 and bool(np.any(after[joint] > tolerance[joint]))
            if not past and before[joint, 1] > 0 > after[joint, 1]:
                rate = gap(joint, 1)
                at = searched(lambda length, rate=rate: -rate(length), h, joint)  # type: ignore[misc]
                past = event(at) > tolerance[joint, 0]
        if past:
            length = searched(event, at, joint, 0.0 if joint in mode.following else tolerance[joint, 0])
            if first[1] is None or length < first[0]:
                first = length, joint
    return first


def zero(value: Callable[[float], float], h: float, noise: float = 0.0) -> float:
    """Return the length in [0, h] at which a value, positive at h, turns positive (Brent 1973).

    Where the value is within ``noise`` of zero at 0, as just after an impact, it must first be below: the
    step is halved until it is. Where it never is, return the longest of these steps that ends within the
    noise, and 0 without one.
    """
    low, high, trial, within = 0.0, h, h, 0.0
    if value(0.0) >= -noise:
        for _ in range(HALVINGS):
            trial /= 2
            found = value(trial)
            if found < -noise:
                low = trial
                break
            if found > 0:
                high = trial
            if found <= noise:
                within = max(within, trial)
        else:
            return within
    return float(brentq(value, low, high, xtol=1e-300, rtol=4 * np.finfo(float).eps))
