"""What the loop of contacts and the kernels that it calls share: records of contacts, arrays of a state."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from reference_solver.methods import Method, Tableau, dop853, tableau
from reference_solver.tape import FloatArray, RecordArray

#: The phases of a contact: flight, contact (of a rigid wall: its pin follows it), and contact with the force
#: clipped because the law would pull.
FLIGHT, CONTACT, CLIPPED = 0.0, 1.0, 2.0

#: How ``contact.loop.advance`` ends: at the end, with its budget of steps used, with the log full, at a step
#: that met a singular configuration or overflowed, at an event on a rigid wall that is to be settled, or at
#: such an event that has no answer. It goes on until then.
DONE, SPENT, FULL, FAILED, SETTLE, REFUSED, GO = range(7)


def record(floats: str, integers: str = "") -> np.dtype[np.void]:
    """Return the type of records with these fields, named with blanks between them."""
    kinds = (floats, np.float64), (integers, np.int64)
    return np.dtype([(name, kind) for names, kind in kinds for name in names.split()])


#: A contact. Its state: phase and memory (see ``mechanism.contact_laws``), the time of its touch, the
#: duration expected then, and its ``Equations.mobilities`` when last looked up. Its law: radial clearance,
#: stiffness, exponent, damping factor, minimum impact speed, steepest slope of friction in s/m, and whether
#: the force is clipped. Of a rigid wall: that it is one, the round-off of g and of its rate, and that it
#: takes no part in a step. Since its touch: the largest normal force in N and penetration, and their times.
CONTACT_RECORD = record(
    "phase memory began_s duration_s mobility sliding following "
    "clearance stiffness exponent factor slowest friction clipped rigid noise rate_noise ignored "
    "force force_s deepest deepest_s"
)

#: A contact's gap at a state: g in m, which has the sign of the penetration, its rate, the speed of the pin's
#: centre in its bearing, the penetration, and in contact the elastic force, the damper in N s/m, and the
#: normal force as a part of the elastic one; on a rigid wall the normal force in N.
GAP_RECORD = record("g rate speed depth elastic damper push")

#: An event: contact, what = 1 for touch, -1 release, 2 force clipped, 3 force back; rate of g, penetration;
#: and of the contact that was until then the largest force and penetration, with their times.
EVENT_RECORD = record("time_s rate depth force force_s deepest deepest_s", "contact what")

#: Where a run is, and how it steps: time, what rounding has taken from it, the longest step, steps per
#: contact, the step tried last, the end, the worst condition so far and the least at a sample; the interval
#: on whose multiples steps land, or 0, and how many of them have been reached; whether events are located;
#: events, samples and steps so far, the most steps, the contact whose event on a rigid wall is to be settled,
#: and whether it goes on where its last call ended, as if that had not: slopes at the start of a step are
#: known then, and differ by round-off from such anew; and what the kernel's functions are called with:
#: addresses of its numbers, of contacts, rows, ``old`` among them, and samples, how long these are in bytes,
#: and where a state has the length of a step; and the functions themselves.
CLOCK_RECORD = record(
    "time lost longest per_contact tried end condition least interval",
    "landed located events taken steps budget rigid resumed "
    "p contacts rows width old samples sample_width place_of_h "
    "rates forces project gaps mobilities step",
)

#: Error control: tolerance, the mechanism's length in m and its rate in 1/s, the next step and that of the
#: last flight, a contact's first step as a part of its duration, the last error over the tolerance, and the
#: worst and the least condition in the step tried last; how many steps in a row have been rejected, and the
#: contact that has just begun, or -1. Of it RK4 has length and rate alone.
CONTROL_RECORD = record(
    "tolerance length rate step flight_step first_part error condition least", "rejected fresh"
)

#: An angle in rad, modulo a period, at which a load by a body's angle is not smooth, the coordinate, and
#: whether its first derivative jumps there: 1 of a kink, on which steps end to round-off, else 0.
KNOT_RECORD = record("angle period", "coordinate kink")


class Impact(NamedTuple):
    """A contact that is over, or an impulse on a rigid wall.

    ``kind``: a "contact" with a compliant wall; an "impact" with a rigid one's restitution; a "closing"
    without rebound, after which the pin follows it; a "support", passed on by a pin that followed its wall
    when another hit. The approach speed and the impulse along n are positive, the latter pushing the pin
    inwards; the tangential one is on the pin along t (see ``contact.walls``). ``energy_lost_J`` is this
    contact's part, friction's included; ``effective_mass_kg`` is its own on a rigid wall. What a compliant
    contact does not tell is NaN; so are, of a rigid wall, the largest normal force and penetration, and their
    times.
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
    largest_normal_force_N: float = math.nan
    largest_normal_force_time_s: float = math.nan
    largest_penetration_m: float = math.nan
    largest_penetration_time_s: float = math.nan


class Motion(NamedTuple):
    """A state: the number n of coordinates, y (2n + s,), and the contacts' gaps (K,), ``GAP_RECORD``.

    y has coordinates, velocities, and the sums of powers since t = 0.
    """

    n: int
    y: FloatArray
    gaps: RecordArray

    @property
    def q(self) -> FloatArray:
        """Return the coordinates (n,), a view."""
        return self.y[: self.n]

    @property
    def v(self) -> FloatArray:
        """Return the velocities (n,), a view."""
        return self.y[self.n : 2 * self.n]

    @property
    def sums(self) -> FloatArray:
        """Return the sums (s,), a view."""
        return self.y[2 * self.n :]


class Records(NamedTuple):
    """What a run writes: events with the sums (s,) at their times, and at sample times rows of ``samples``.

    These have y, {lambda} (m,) of the mechanism's own rows, of every contact the normal force and friction
    (2K,), and of every contact phase and memory (2K,).
    """

    events: RecordArray
    event_sums: FloatArray
    time: FloatArray
    samples: FloatArray


class Run(NamedTuple):
    """What a loop works on: a method, contacts (K,), the state, and records.

    ``new`` is the state at the end of a step, ``at`` one within it. Rows of ``slopes`` have rates of y; the
    last ones are ``OLD`` to ``AT``, the memory of these states, and ``START`` to ``SPARE``.
    ``control`` (1,) is error control, ``clock`` (1,) where the run is, ``knots`` are angles
    of bodies at which steps are to end.
    """

    method: Tableau
    contacts: RecordArray
    old: Motion
    new: Motion
    at: Motion
    slopes: FloatArray
    control: RecordArray
    clock: RecordArray
    records: Records
    knots: RecordArray


#: Rows of a run's slopes: those of stages, at the end, and what dense output takes beside them; 1 over the
#: tolerances of y, 0 of the sums; at most so many coefficients of dense output; and from the end on states
#: at a step's start, at its end and within it; slopes at both ends; and three numbers per contact.
_LARGEST = tableau(dop853())
WEIGHT = len(_LARGEST.nodes)
DENSE_ROW, DENSE_ROWS = WEIGHT + 1, 3 + len(_LARGEST.dense)
ROWS = DENSE_ROW + DENSE_ROWS + 6
OLD, NEW, AT, START, END, SPARE = range(-6, 0)


def new_run(
    method: Method,
    contacts: RecordArray,
    sizes: tuple[int, int, int],
    times: FloatArray,
    log_rows: int,
    knots: Sequence[tuple[float, float, int, int]] = (),
) -> Run:
    """Return a run of zeros by a method; a kernel has to be bound to it.

    Sizes are the numbers of coordinates, sums and {lambda}; ``log_rows`` is that of events, ``knots`` are as
    in ``KNOT_RECORD``.
    """
    (n, sums, multipliers), K = sizes, len(contacts)
    size, gaps = 2 * n + sums, len(GAP_RECORD.names or ()) * K
    slopes = np.zeros((ROWS, max(size + gaps + 1 + 2 * n, 3 * K)))
    old, new, at = (
        Motion(n, slopes[row, :size], slopes[row, size : size + gaps].view(GAP_RECORD))
        for row in (OLD, NEW, AT)
    )
    log = np.zeros(log_rows, EVENT_RECORD), np.zeros((log_rows, sums))
    records = Records(*log, times, np.zeros((len(times), size + multipliers + 4 * K)))
    control, clock = np.zeros(1, CONTROL_RECORD), np.zeros(1, CLOCK_RECORD)
    where = np.array(list(knots), KNOT_RECORD)
    clock["contacts"], clock["place_of_h"] = contacts.ctypes.data, size + gaps
    clock["rows"], clock["width"] = slopes.ctypes.data, slopes.strides[0]
    clock["old"] = slopes[OLD].ctypes.data
    clock["samples"], clock["sample_width"] = records.samples.ctypes.data, records.samples.strides[0]
    return Run(tableau(method), contacts, old, new, at, slopes, control, clock, records, where)


def plain(parts: Any) -> Any:
    """Return tuples of arrays without the names of their fields: Numba knows the types of these at once."""
    return tuple(map(plain, parts)) if isinstance(parts, tuple) else parts


@register_jitable
def run_of(parts: Any) -> Run:
    """Return the run that plain tuples are."""
    method, contacts, old, new, at, slopes, control, clock, records, knots = parts
    tableau = Tableau(method[0], method[1], method[2], method[3], method[4], method[5])
    states = motion_of(old), motion_of(new), motion_of(at)
    written = Records(records[0], records[1], records[2], records[3])
    return Run(tableau, contacts, states[0], states[1], states[2], slopes, control, clock, written, knots)


@register_jitable
def motion_of(parts: Any) -> Motion:
    """Return the state that a plain tuple is."""
    return Motion(parts[0], parts[1], parts[2])
