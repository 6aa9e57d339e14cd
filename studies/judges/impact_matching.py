"""Impacts of a run matched one to one with those of another run of the same scene."""

from dataclasses import dataclass

import numpy as np

from engine_models.engine import FloatArray, Impacts

#: Two impacts are the same if they are no further apart than this part of the flights around them.
PART_OF_FLIGHT = 0.25


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
    """Return a row's columns: impacts matched, unmatched and missed until ``end_s``, and errors.

    Time by its largest error; speed, impulse and energy lost by the largest error relative to the largest of
    the true ones.
    """
    pairs = match(run.time_s, true.time_s, end_s)
    row: dict[str, float] = {
        "impacts_matched": len(pairs.run),
        "impacts_unmatched": pairs.unmatched,
        "impacts_missed": pairs.missed,
    }
    if not len(pairs.run):
        return row
    row["impact_time_error_s"] = float(np.abs(run.time_s[pairs.run] - true.time_s[pairs.true]).max())
    for name, column in (
        ("approach_speed_m_s", "impact_speed_relative_error"),
        ("normal_impulse_N_s", "impact_impulse_relative_error"),
        ("energy_lost_J", "impact_loss_relative_error"),
    ):
        expected = getattr(true, name)
        scale = float(np.abs(expected[pairs.true]).max())
        if scale > 0:
            off = np.abs(getattr(run, name)[pairs.run] - expected[pairs.true]).max()
            row[column] = float(off / scale)
    return row
