"""What the loop of contacts and the kernels that it calls share: records of contacts, arrays of a state."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: The phases of a contact: flight, contact (of a rigid wall: its pin follows it), and contact with the force
#: clipped because the law would pull.
FLIGHT, CONTACT, CLIPPED = 0.0, 1.0, 2.0

#: How ``contact.loop.advance`` ends: at the end, with its budget of steps used, with the log full, at a step
#: that met a singular configuration or overflowed, or at an event on a rigid wall that is to be settled. It
#: goes on until then.
DONE, SPENT, FULL, FAILED, SETTLE, GO = range(6)

#: A contact. Its state: phase and memory (see ``contact_laws``), and since its touch the time, the duration
#: expected, and the mobility in 1/kg of the gap. Its law: radial clearance, stiffness, exponent, damping
#: factor, minimum impact speed, steepest slope of friction in s/m, and whether the force is clipped. Of a
#: rigid wall: that it is one, the round-off of g and of its rate, and that it takes no part in this step.
CONTACT_RECORD = np.dtype(
    [
        (name, np.float64)
        for name in (
            *("phase", "memory", "began_s", "duration_s", "mobility"),
            *("clearance", "stiffness", "exponent", "factor", "slowest", "friction", "clipped"),
            *("rigid", "noise", "rate_noise", "ignored"),
        )
    ]
)

#: A contact's gap at a state: g in m, which has the sign of the penetration, its rate, the speed of the pin's
#: centre in its bearing, the penetration, and in contact the elastic force, the damper in N s/m, and the
#: normal force as a part of the elastic one; on a rigid wall the normal force in N.
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
#: contact, the step tried last, the end; whether events are located; events, samples and steps so far, the
#: most steps, and the contact whose event on a rigid wall is to be settled.
CLOCK_RECORD = np.dtype(
    [
        *((name, np.float64) for name in ("time", "lost", "longest", "per_contact", "tried", "end")),
        *((name, np.int64) for name in ("located", "events", "taken", "steps", "budget", "rigid")),
    ]
)

#: Error control: tolerance, the mechanism's length in m and its rate in 1/s, the next step and that of the
#: last flight, a contact's first step as a part of its duration, and the last error over the tolerance; how
#: many steps in a row have been rejected, and the contact that has just begun, or -1.
CONTROL_RECORD = np.dtype(
    [
        *(
            (name, np.float64)
            for name in ("tolerance", "length", "rate", "step", "flight_step", "first_part", "error")
        ),
        *((name, np.int64) for name in ("rejected", "fresh")),
    ]
)


class Impact(NamedTuple):
    """A contact that is over, or an impulse on a rigid wall.

    ``kind``: a "contact" with a compliant wall; an "impact" with a rigid one's restitution; a "closing"
    without rebound, after which the pin follows it; a "support", passed on by a pin that followed its wall
    when another hit. The approach speed and the impulse along n are positive, the latter pushing the pin
    inwards; the tangential one is on the pin along t (see ``rigid_geometry``). ``energy_lost_J`` is this
    contact's part, friction's included; ``effective_mass_kg`` is its own on a rigid wall. What a compliant
    contact does not tell is NaN.
    """

    time_s: float
    contact: int
    kind: str
    duration_s: float
    approach_speed_m_s: float
    normal_impulse_N_s: float
    tangential_impulse_N_s: float
    energy_lost_J: float
    effective_mass_kg: float


class Motion(NamedTuple):
    """A state: q and v (n,), the sums of powers since t = 0 (s,), and the contacts' gaps (K,)."""

    q: FloatArray
    v: FloatArray
    sums: FloatArray
    gaps: NDArray[np.void]


class Rates(NamedTuple):
    """What changes at a state: {q''} (n,) and powers (s,); {lambda} (m,) and the contacts' forces (2K,).

    {lambda} is that of the mechanism's own rows; forces are of every contact the normal one and friction.
    """

    a: FloatArray
    powers: FloatArray
    multipliers: FloatArray
    forces: FloatArray


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
    forces: FloatArray


class Work(NamedTuple):
    """What a loop works on: two states, rates in a step and at a sample, and a number per contact (K,)."""

    new: Motion
    at: Motion
    rates: Rates
    new_rates: Rates
    at_rates: Rates
    sample_rates: Rates
    spare: FloatArray


class Control(NamedTuple):
    """Error control: its record (1,), and what its steps work on.

    ``weights`` are 1 over the tolerance of coordinates and velocities, 0 of the sums. Motion and the work's
    ``new`` are views of ``y`` and ``new_y`` (see ``new_motion``); ``stage`` is one in between. ``K`` has
    slopes by row, ``slope`` and ``new_slope`` those at both ends in time, ``dense`` what dense output takes.
    """

    record: NDArray[np.void]
    weights: FloatArray
    y: FloatArray
    new_y: FloatArray
    stage: FloatArray
    slope: FloatArray
    new_slope: FloatArray
    zeros: FloatArray
    K: FloatArray
    dense: FloatArray


def new_motion(n: int, sums: int, contacts: int) -> Motion:
    """Return a state of zeros: views of one array, their ``base``."""
    y = np.zeros(2 * n + sums)
    return Motion(y[:n], y[n : 2 * n], y[2 * n :], np.zeros(contacts, GAP_RECORD))


def new_work(n: int, sums: int, contacts: int, rows: int) -> Work:
    """Return what a loop works on, with m = ``rows`` multipliers."""
    sizes = n, sums, rows, 2 * contacts
    first, second, third, fourth = (Rates(*(np.zeros(size) for size in sizes)) for _ in range(4))
    new, at = (new_motion(n, sums, contacts) for _ in range(2))
    return Work(new, at, first, second, third, fourth, np.zeros(contacts))


def new_control(motion: Motion, new: Motion, slopes: int, dense: int) -> Control:
    """Return error control for steps from one motion to another."""
    y, new_y = motion.q.base, new.q.base
    assert y is not None
    assert new_y is not None
    weights, stage, slope, new_slope, zeros = np.zeros((5, len(y)))
    tables = np.zeros((slopes, len(y))), np.zeros((dense, len(y)))
    record = np.zeros(1, CONTROL_RECORD)
    return Control(record, weights, y, new_y, stage, slope, new_slope, zeros, *tables)
