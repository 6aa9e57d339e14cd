"""What the gallery reads of the study of motions: rows by view, curves of a run, the truth beside them."""

from typing import Any

import numpy as np
import pandas as pd

from reports.quantities import finished
from reports.results import FloatArray, Results, with_columns

#: Buckets of a drawn line: in each its first, its lowest and its highest point are drawn; and of an envelope.
BUCKETS, PARTS = 250, 60
DEGREES = 180 / np.pi


def of_view(results: Results, view: str) -> pd.DataFrame:
    """Return the finished runs of a view, a scene's in the order of legends."""
    rows = with_columns(results.rows, "shortest_contact_s", "contacts_ended")
    return finished(rows[rows["view"] == view])


def has(row: Any, column: str) -> bool:
    """Return whether a run has a largest value of this column, and so a curve of it."""
    return column in row.index and pd.notna(row[column])


def angle_deg(results: Results, row: Any) -> FloatArray:
    """Return how far the crank has turned since t = 0 in degrees, (n,)."""
    angle = results.curve(row["case"], "crank_angle_rad")
    return np.asarray((angle - angle[0]) * DEGREES)


def joints_with_clearance(row: Any) -> list[str]:
    """Return the letters of the joints in which a run has contacts."""
    return [joint for joint in "OAB" if has(row, f"contact_{joint}_normal_force_N")]


def extremes(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return of a curve, (n,) and (n,), what shows in a narrow figure: peaks stay, a file is smaller."""
    size = -(-len(y) // BUCKETS)
    if size < 4:
        return x, y
    kept = set[int]()
    for start in range(0, len(y), size):
        part = y[start : start + size]
        if np.isfinite(part).all():
            kept |= {start, start + int(part.argmin()), start + int(part.argmax())}
        else:
            kept |= set(range(start, start + len(part)))
    places = sorted(kept | {len(y) - 1})
    return x[places], y[places]


def envelope(x: FloatArray, size: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the largest size in each of some parts of a curve, (n,) and (n,); not a number where it is zero.

    Zeros between two signs, and what round-off does from sample to sample, are no part of a comparison.
    """
    parts = [part[np.isfinite(part)].max(initial=0.0) for part in np.array_split(size, min(PARTS, len(size)))]
    largest = np.array(parts)
    middle = np.array([part.mean() for part in np.array_split(x, len(parts))])
    return middle, np.where(largest > 0, largest, np.nan)
