"""The motions in which members of a sweep end, told apart by the slider's position once a turn."""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reports.results import FloatArray

#: The most turns after which a motion repeats, and the part of the largest deviation within which it does.
LONGEST_PERIOD, BACK = 4, 1e-3
#: Motions that repeat are the same one if they differ by less than this part of the largest deviation.
ALIKE = 1e-2


def periods(strobe_m: FloatArray) -> NDArray[np.int_]:
    """Return after how many turns motions repeat, (n,), from the slider once a turn, (n, turns).

    It is 0 where one does not within ``LONGEST_PERIOD``. A motion of fewer turns is not known to repeat.
    """
    size, found = np.abs(strobe_m).max(axis=1), np.zeros(len(strobe_m), int)
    for period in range(min(LONGEST_PERIOD, strobe_m.shape[1] - 1), 0, -1):
        back = np.abs(strobe_m[:, period:] - strobe_m[:, :-period]).max(axis=1)
        found[back <= BACK * size] = period
    return found


def motions(rows: pd.DataFrame) -> pd.Series:
    """Return in words the motion of each member, none of which failed, in the last half of its turns.

    Motions of one period are told apart by their mean, and lettered from the least on. At the wall a pin's
    swing dies out slowly: that is one motion.
    """
    turns = rows["strobe_m"].map(len).min()
    strobe = np.array([list(own)[-(turns // 2) :] for own in rows["strobe_m"]])
    period, size = periods(strobe), np.abs(strobe).max()
    settled = rows["impacts_per_revolution"].to_numpy() == 0
    found = pd.Series("impacts, not repeating", rows.index)
    found[settled] = "at the wall"
    for turn in range(1, LONGEST_PERIOD + 1):
        which = np.flatnonzero((period == turn) & ~settled)
        kinds = [*_clusters(strobe[which, -turn:].mean(axis=1), ALIKE * size)]
        words = "impacts, every turn" if turn == 1 else f"impacts, every {turn} turns"
        for k, own in enumerate(kinds):
            letter = f", {chr(ord('a') + k % 26)}" if len(kinds) > 1 else ""
            found.iloc[which[own]] = words + letter
    return found


def _clusters(values: FloatArray, distance: float) -> Iterator[NDArray[np.int_]]:
    """Yield the places of values that are no farther from their neighbours, from the least values on."""
    order = np.argsort(values, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(values[order]) > distance) + 1) if len(values) else []
