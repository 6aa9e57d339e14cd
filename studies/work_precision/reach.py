"""Until when a run's slider is where it should be, and how far it is off by then: from one run's samples.

With clearance errors grow until they are as large as the clearance lets them be: an error at the end of the
motion then ranks nobody. What a setting resolves is seen before.
"""

import numpy as np

from engine_models.engine import ROUNDING, FloatArray
from engine_models.mechanics.states import observed_m
from studies.judges.comparison import Judged
from studies.judges.horizon import first_beyond_s
from studies.judges.metrics import ROUND_OFF
from studies.running.case import Row

#: A slider is lost that is off by this, or by this part of the smallest clearance.
LOST_M, LOST_PART = 1e-6, 0.1
#: Fixed times in s by their names; and after how many impacts of the truth, if there are as many.
TIMES_S, IMPACTS = {"6ms": 0.006, "12ms": 0.012}, 3


def reach(found: Judged) -> Row:
    """Return the horizons of a run with clearance, and its slider's errors until times before the end.

    ``reached_1um_s`` and ``reached_clearance_s`` are the first times at which it is lost, or
    ``compared_until_s``. Of fixed times only those before that have an error, with the truth's uncertainty.
    """
    end_s, truth = found.compared_until_s, found.solved.truth
    time_s, true_m = truth.time_s, observed_m(found.own, truth)
    off_m = np.abs(observed_m(found.own, found.run) - true_m)
    repeats = [np.abs(observed_m(found.own, repeat) - true_m) for repeat in found.solved.repeats]
    doubt_m = np.max(repeats, axis=0) + ROUND_OFF * np.abs(true_m).max()
    smallest_m = min(room.radial_clearance_m for room in found.own.clearances.values())
    row: Row = {
        "smallest_clearance_m": smallest_m,
        "reached_1um_s": min(first_beyond_s(time_s, off_m, LOST_M), end_s),
        "reached_clearance_s": min(first_beyond_s(time_s, off_m, LOST_PART * smallest_m), end_s),
    }
    for name, at_s in _times_s(found).items():
        if at_s < end_s:
            before = time_s <= at_s * (1 + ROUNDING)
            row[f"slider_position_error_until_{name}_m"] = float(off_m[before].max())
            row[f"slider_position_uncertainty_until_{name}_m"] = float(doubt_m[before].max())
    return row


def _times_s(found: Judged) -> dict[str, float]:
    """Return the fixed times by their names, that of the third impact's end among them."""
    impacts = [contact.impacts for contact in found.solved.truth.contacts.values()]
    ends: FloatArray = np.sort(np.concatenate([each.time_s + each.duration_s for each in impacts]))
    return {"3_impacts": float(ends[IMPACTS - 1]), **TIMES_S} if len(ends) >= IMPACTS else TIMES_S
