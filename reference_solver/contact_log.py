"""The log of events that ``contact_loop`` keeps, and the impacts read from it."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: Columns of an event in the log, ahead of the totals at that time.
EVENT = 5


def impacts_of(contact: int, events: FloatArray, rate_names: tuple[str, ...]) -> FloatArray:
    """Return a contact's ends: time, duration, approach speed, normal impulse and energy lost, (I, 5).

    ``events`` (E, 5 + totals) is the log; its totals are the drivers' work, then those of ``rate_names``.
    """
    ends = events[(events[:, 1] == contact) & (np.abs(events[:, 2]) == 1)]
    touches, releases = ends[: len(ends) // 2 * 2].reshape(-1, 2, events.shape[1]).swapaxes(0, 1)
    change = (releases - touches)[:, EVENT + 1 :]
    impulse = change[:, rate_names.index(f"normal{contact}")]
    mine = [k for k, name in enumerate(rate_names) if name.endswith(str(contact)) and "normal" not in name]
    lost = change[:, mine].sum(axis=1)
    return np.column_stack([touches[:, 0], releases[:, 0] - touches[:, 0], touches[:, 3], impulse, lost])
