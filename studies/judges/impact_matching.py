"""Impacts of a run matched one to one with those of another run of the same scene."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from engine_models.engine import Contact, FloatArray, Impacts

#: Two impacts are the same if they are no further apart than this part of the flights around them.
PART_OF_FLIGHT = 0.25
#: The columns of the largest force's error, and of that as a part of it.
FORCE_ERROR, FORCE_PART = "impact_force_error_N", "impact_force_relative_error"
#: What of an impact is judged as a part of the true one, by its column.
RELATIVE = {
    "impact_speed_relative_error": "approach_speed_m_s",
    "impact_impulse_relative_error": "normal_impulse_N_s",
    "impact_loss_relative_error": "energy_lost_J",
    FORCE_PART: "largest_normal_force_N",
    "impact_penetration_relative_error": "largest_penetration_m",
    "impact_duration_relative_error": "duration_s",
}
#: An impact is rated whose impulse is at least this part of the largest.
RATED = 1e-3
#: Samples in an impact by which its force can be interpolated.
FEWEST = 12


@dataclass(frozen=True)
class Matching:
    """Pairs of places (k,) in two lists of impacts, and how many have no partner."""

    run: np.ndarray
    true: np.ndarray
    unmatched: int
    missed: int


def match(run: FloatArray, true: FloatArray, end_s: float) -> Matching:
    """Match sorted times of impacts, (m,) and (n,) in s, those nearest to each other first.

    A pair is nearest to each other both ways, and apart by at most ``PART_OF_FLIGHT`` of the shorter flight
    beside the true impact; impacts after ``end_s`` do not count.
    """
    run, true = run[run <= end_s], true[true <= end_s]
    if not len(run) or not len(true):
        none = np.zeros(0, dtype=np.intp)
        return Matching(none, none, len(run), len(true))
    apart = np.abs(run[:, None] - true)
    nearest, back = apart.argmin(axis=0), apart.argmin(axis=1)
    flights = np.diff(np.concatenate([[0.0], true, [end_s]]))
    most = PART_OF_FLIGHT * np.minimum(flights[:-1], flights[1:])
    places = np.arange(len(true))
    mutual = (back[nearest] == places) & (apart[nearest, places] <= np.maximum(most, np.finfo(float).eps))
    matched = int(mutual.sum())
    return Matching(nearest[mutual], places[mutual], len(run) - matched, len(true) - matched)


def impact_errors(run: Impacts, true: Impacts, end_s: float) -> dict[str, float]:
    """Return a row's columns: impacts matched, unmatched and missed until ``end_s``, and largest errors.

    Relative errors are each relative to the true one of the same impact, and an impact that is missed is off
    by all of its force. Matched impacts of less than ``RATED`` of the largest impulse, as the last of bounces
    that accumulate, are in no relative error: they are ``impacts_not_rated``.
    """
    pairs = match(run.time_s, true.time_s, end_s)
    row: dict[str, float] = {
        "impacts_matched": len(pairs.run),
        "impacts_unmatched": pairs.unmatched,
        "impacts_missed": pairs.missed,
    }
    if not len(pairs.run):
        return row
    impulse = true.normal_impulse_N_s
    rated = impulse[pairs.true] >= RATED * impulse[true.time_s <= end_s].max()
    row["impacts_not_rated"] = int((~rated).sum())
    for column, name in (("impact_time_error_s", "time_s"), (FORCE_ERROR, "largest_normal_force_N")):
        off = np.abs(getattr(run, name)[pairs.run] - getattr(true, name)[pairs.true])
        row[column] = float(off.max())
    for column, name in RELATIVE.items():
        expected = getattr(true, name)[pairs.true][rated]
        if len(expected) and (expected > 0).all():
            off = np.abs(getattr(run, name)[pairs.run][rated] - expected) / expected
            row[column] = float(off.max())
    if pairs.missed and FORCE_PART in row:
        row[FORCE_PART] = max(row[FORCE_PART], 1.0)
    return {name: value for name, value in row.items() if not np.isnan(value)}


def force_error_in_phase_N(run: Contact, true: Contact, time_s: FloatArray, end_s: float) -> float:
    """Return the largest difference of normal forces at equal parts of the durations of matched impacts.

    Both contacts have samples at the same times (n,). It is NaN where an impact of the run has too few of
    them for its force to be interpolated, as one that is late by as long as it lasts.
    """
    pairs, worst = match(run.impacts.time_s, true.impacts.time_s, end_s), 0.0
    for own, other in zip(pairs.run, pairs.true, strict=True):
        phase, force = _within(run, own, time_s)
        true_phase, true_force = _within(true, other, time_s)
        if len(phase) < FEWEST:
            return np.nan
        there = (true_phase >= phase[0]) & (true_phase <= phase[-1])
        off = CubicSpline(phase, force)(true_phase[there]) - true_force[there]
        worst = max(worst, float(np.abs(off).max(initial=0.0)))
    return worst


def _within(contact: Contact, number: int, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the normal force at the samples within an impact, and at which part of its duration they are."""
    begin_s, duration_s = contact.impacts.time_s[number], contact.impacts.duration_s[number]
    inside = (time_s > begin_s) & (time_s < begin_s + duration_s)
    return (time_s[inside] - begin_s) / duration_s, contact.normal_force_N[inside]
