"""Impacts in time: instants that resolve them, and the largest value of what was sampled there."""

from dataclasses import fields, replace

import numpy as np
from numpy.polynomial import Polynomial

from engine_models.engine import FloatArray, Impacts, Trajectory

#: Instants within an impact.
POINTS = 40
#: Parts of a step of the methods that choose theirs: of some radian of a contact's swing.
PARTS = 8
#: Samples to either side of the largest one through which a polynomial is laid.
BESIDE = 3
#: Samples nearer to each other, as a part of the time of those through which a polynomial is laid, are one;
#: and of fewer it is none.
NEAREST, FEWEST = 0.03, 3


def instants_in(begin_s: float, end_s: float, count: int = POINTS) -> FloatArray:
    """Return instants within an impact, (count,), closer to one another towards both ends."""
    part = (1 - np.cos(np.pi * np.arange(1, count + 1) / (count + 1))) / 2
    return np.asarray(begin_s + (end_s - begin_s) * part)


def along_steps(steps_s: FloatArray, begin_s: float, end_s: float) -> FloatArray:
    """Return times within an impact that cut each of the steps taken in it into ``PARTS``, with its ends."""
    inside = steps_s[(steps_s > begin_s) & (steps_s < end_s)]
    ends = np.concatenate([[begin_s], inside, [end_s]])
    return np.asarray(np.interp(np.arange(PARTS * (len(ends) - 1) + 1) / PARTS, np.arange(len(ends)), ends))


def largest(time_s: FloatArray, value: FloatArray) -> tuple[float, float]:
    """Return the largest value of a smooth signal and its time, from samples (k,) that resolve it.

    It is that of the polynomial through the samples around the largest one: of ``instants_in`` half a sine
    it is exact to 1e-8 of it.
    """
    k = int(np.argmax(value))
    best = float(value[k]), float(time_s[k])
    if not 0 < k < len(value) - 1:
        return best
    near = slice(max(0, k - BESIDE), k + BESIDE + 1)
    times, values = time_s[near] - time_s[k], value[near]
    apart = np.append(True, np.diff(times) > NEAREST * np.ptp(times))
    if apart.sum() < FEWEST:
        return best
    through = Polynomial.fit(times[apart], values[apart], int(apart.sum()) - 1)
    roots = through.deriv().roots()
    turns = roots.real[abs(roots.imag) == 0] + time_s[k]
    turns = turns[(time_s[k - 1] < turns) & (turns < time_s[k + 1])]
    found = [(float(through(turn - time_s[k])), float(turn)) for turn in turns]
    return max([best, *(each for each in found if each[0] <= 2 * best[0] - values.min())])


def with_largest(run: Trajectory) -> Trajectory:
    """Return a run whose impacts have their largest forces and penetrations, from its samples within them."""
    names, contacts = [each.name for each in fields(Impacts) if each.name.startswith("largest_")], {}
    for joint, of in run.contacts.items():
        first = np.searchsorted(run.time_s, of.impacts.time_s)
        last = np.searchsorted(run.time_s, of.impacts.time_s + of.impacts.duration_s, "right")
        found = np.full((len(first), 4), np.nan)
        for row, begin, end in zip(found, first, last, strict=True):
            if end - begin > 2 * BESIDE:
                values = (of.normal_force_N[begin:end], of.penetration_m[begin:end])
                row[:] = [x for value in values for x in largest(run.time_s[begin:end], value)]
        impacts = replace(of.impacts, **dict(zip(names, found.T, strict=True)))
        contacts[joint] = replace(of, impacts=impacts)
    return replace(run, contacts=contacts)
