"""Impacts in time: instants that resolve them, and the largest value of what was sampled there."""

from dataclasses import fields, replace

import numpy as np
from numpy.polynomial import Polynomial

from engine_models.engine import Contact, FloatArray, Impacts, Trajectory

#: Instants within an impact.
POINTS = 40
#: Samples to either side of the largest one through which a polynomial is laid.
BESIDE = 3


def instants_in(touch_s: FloatArray, duration_s: FloatArray) -> FloatArray:
    """Return instants within each of m contacts, (m, POINTS), closer to one another towards both ends."""
    part = (1 - np.cos(np.pi * np.arange(1, POINTS + 1) / (POINTS + 1))) / 2
    return np.asarray(touch_s[:, None] + duration_s[:, None] * part)


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
    through = Polynomial.fit(time_s[near], value[near], len(time_s[near]) - 1)
    roots = through.deriv().roots()
    turns = roots.real[(abs(roots.imag) == 0) & (time_s[k - 1] < roots.real) & (roots.real < time_s[k + 1])]
    return max([best, *((float(through(turn)), float(turn)) for turn in turns)])


def largest_of_each(time_s: FloatArray, value: FloatArray) -> FloatArray:
    """Return the largest value of each of m signals and its time, (2, m), from samples (m, k)."""
    found = [largest(times, values) for times, values in zip(time_s, value, strict=True)]
    return np.asarray(np.reshape(found, (-1, 2)).T)


def with_largest(run: Trajectory) -> Trajectory:
    """Return a run whose impacts have their largest forces and penetrations, from its samples within them."""
    return replace(run, contacts={joint: _with_largest(run, of) for joint, of in run.contacts.items()})


def _with_largest(run: Trajectory, contact: Contact) -> Contact:
    impacts = contact.impacts
    first = np.searchsorted(run.time_s, impacts.time_s)
    last = np.searchsorted(run.time_s, impacts.time_s + impacts.duration_s, "right")
    found = np.full((len(first), 4), np.nan)
    for row, begin, end in zip(found, first, last, strict=True):
        if end - begin >= POINTS:
            values = (contact.normal_force_N[begin:end], contact.penetration_m[begin:end])
            row[:] = [x for value in values for x in largest(run.time_s[begin:end], value)]
    names = [field.name for field in fields(Impacts) if field.name.startswith("largest_")]
    return replace(contact, impacts=replace(impacts, **dict(zip(names, found.T, strict=True))))
