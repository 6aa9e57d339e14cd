"""What the loop of contacts and the kernels that it calls share: records of contacts, arrays of a state."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: The phases of a contact: flight, contact, contact with the force clipped because the law would pull, and a
#: probe, which answers with a unit normal force.
FLIGHT, CONTACT, CLIPPED, PROBE = 0.0, 1.0, 2.0, 3.0

#: A contact. Its state: phase and memory (see ``contact_laws``), and since its touch the time, the duration
#: expected, and the mobility in 1/kg of the gap. Its law: radial clearance, stiffness, exponent, damping
#: factor, minimum impact speed, steepest slope of friction in s/m, and whether the force is clipped.
CONTACT_RECORD = np.dtype(
    [
        (name, np.float64)
        for name in (
            *("phase", "memory", "began_s", "duration_s", "mobility"),
            *("clearance", "stiffness", "exponent", "factor", "slowest", "friction", "clipped"),
        )
    ]
)

#: A contact's gap at a state: g in m, which has the sign of the penetration, its rate, the speed of the pin's
#: centre in its bearing, the penetration, and in contact the elastic force, the damper in N s/m, and the
#: normal force as a part of the elastic one.
GAP_RECORD = np.dtype(
    [(name, np.float64) for name in ("g", "rate", "speed", "depth", "elastic", "damper", "push")]
)

#: An event: contact, what = 1 for touch, -1 release, 2 force clipped, 3 force back; rate of g, penetration.
EVENT_RECORD = np.dtype(
    [
        ("time_s", np.float64),
        ("contact", np.int64),
        ("what", np.int64),
        ("rate", np.float64),
        ("depth", np.float64),
    ]
)

#: Where a run is, and how it steps: time, what rounding has taken from it, the longest step, steps per
#: contact, whether events are located, the end; events, samples and steps so far, and the most steps.
CLOCK_RECORD = np.dtype(
    [
        *((name, np.float64) for name in ("time", "lost", "longest", "per_contact", "end")),
        *((name, np.int64) for name in ("located", "events", "taken", "steps", "budget")),
    ]
)


class Motion(NamedTuple):
    """A state: q and v (n,), the sums of powers since t = 0 (s,), and the contacts' gaps (K,)."""

    q: FloatArray
    v: FloatArray
    sums: FloatArray
    gaps: NDArray[np.void]


class Rates(NamedTuple):
    """What changes at a state: {q''} (n,), powers (s,), and {lambda} (m,)."""

    a: FloatArray
    powers: FloatArray
    multipliers: FloatArray


class Records(NamedTuple):
    """What a run writes: events with the sums at their times, and at sample times the state and {lambda}."""

    events: NDArray[np.void]
    event_sums: FloatArray
    time: FloatArray
    q: FloatArray
    v: FloatArray
    sums: FloatArray
    phases: FloatArray
    multipliers: FloatArray


def new_motion(n: int, sums: int, contacts: int) -> Motion:
    """Return a state of zeros."""
    return Motion(np.zeros(n), np.zeros(n), np.zeros(sums), np.zeros(contacts, GAP_RECORD))
