"""What a run is: records of where it is, of contacts and of events, and rows of states and slopes."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reference_solver.mechanism.contacts import ClearanceJoint, steepest
from reference_solver.methods import Method
from reference_solver.tape import FloatArray, RecordArray

#: How ``loop.advance`` ends: at the end, with its budget of steps used, with the log full, at a step that met
#: a singular configuration or overflowed, or at an event on a rigid wall that ``impacts`` is to resolve.
DONE, SPENT, FULL, FAILED, WALL = range(5)

#: Rows of a run: states at a step's start, at its end and within it; slopes at both ends; 1 over the
#: tolerances of y, 0 of the sums; memory; from DENSE on coefficients of dense output, and from SLOPES on the
#: slopes of stages, at the end, and what dense output takes beside them.
OLD, NEW, AT, START, END, WEIGHT, SPARE, DENSE = range(8)
#: Slopes and rows of dense output at the most, DOP853's; and events in the log.
MOST_SLOPES, MOST_DENSE, LOG_ROWS = 16, 4, 256
SLOPES = DENSE + 3 + MOST_DENSE

#: A contact row that is this small a part of itself once the ideal joints are eliminated depends on them.
DEPENDENT = 1e-12
#: Flights that are as high as so many times the distance's round-off take sqrt(2 x 4 x height/a).
FLIGHT_HEIGHT = 8.0


def record(floats: str, integers: str = "") -> list[tuple[str, type]]:
    """Return the fields of records with these names, blanks between them."""
    kinds = (floats, np.float64), (integers, np.int64)
    return [(name, kind) for names, kind in kinds for name in names.split()]


class Gap(NamedTuple):
    """A contact's gap at a state, as the kernel's ``gaps`` writes it behind y.

    ``g`` in m has the sign of the penetration, ``rate`` is its rate, ``speed`` that of the pin's centre in
    its bearing; then the penetration, and in contact the elastic force, the damper in N s/m, and the normal
    force as a part of the elastic one; on a rigid wall the normal force in N.
    """

    g: float
    rate: float
    speed: float
    depth: float
    elastic: float
    damper: float
    push: float


GAP_FIELDS = len(Gap._fields)

#: A contact. Its state: phase and memory (see ``mechanism.contacts``), the time of its touch, the
#: duration expected then, and its ``Equations.mobilities`` when last looked up. Its law: radial clearance,
#: stiffness, exponent, damping factor, minimum impact speed, steepest slope of friction in s/m, whether the
#: force is clipped, and restitution. Of a rigid wall: that it is one, the round-off of g and of its rate, and
#: that it takes no part in a step. Since its touch: the largest normal force in N and penetration, and their
#: times; at the touch: rate of g, impulse and losses by then. Then the columns of its impulse in the sums, of
#: its losses behind it how many, and of a rigid joint its number among them.
CONTACT_RECORD = np.dtype(
    record(
        "phase memory began_s duration_s mobility sliding following clearance stiffness exponent factor "
        "slowest friction clipped restitution rigid noise rate_noise ignored force force_s deepest deepest_s "
        "approach impulse dissipated",
        "column losses number",
    )
)

#: What an event is: a touch, a release, the force clipped, the force back, a rebound from a rigid wall.
TOUCH, RELEASE, CLIP, RESUME, REBOUND = 1, -1, 2, 3, 4
#: An event: contact, and what it is; rate of g, penetration; of the contact that was until then its begin and
#: approach speed, largest force and penetration with their times, impulse and losses; of a rebound the
#: effective mass.
OF_EVENT = "time_s rate depth began_s approach force force_s deepest deepest_s impulse lost mass"
EVENT_RECORD = np.dtype(record(OF_EVENT, "contact what"))

#: Where a run is, and how it steps. In floats: time, end, the longest step, steps per contact; tolerance, the
#: mechanism's length in m and rate in 1/s, the next step and that of the last flight, a contact's first step
#: as a part of its duration, the last error over the tolerance; the worst condition so far, the least at a
#: sample, and worst and least of the step tried last, with its length; how far a sample may be past a step's
#: end; and flights between rigid walls that are not followed: shorter than so many seconds, or no higher than
#: so many times the distance's round-off. In integers: coordinates, numbers in y,
#: rigid joints and rows of ``impacts.walls_at``; whether steps go by their error, events are located, slopes
#: at both ends of a step are known, and a call goes on where the last one ended; steps, their limit, samples
#: and events so far, steps landed on when all are of one length, rejections in a row, the contact that has
#: just begun or -1, the one whose event on a rigid wall is to be resolved or -1; what the kernel's functions
#: are called with, addresses of numbers, contacts, rows and samples and how long these are in bytes, where a
#: state has the length of a step, and how much of a row is a state; and the functions. Then the log.
RUN_RECORD = np.dtype(
    [
        *record(
            "time end longest per_contact tolerance length rate step flight_step first_part error "
            "condition least worst best tried slack shortest_s lowest",
            "n size rigid_joints wall_rows controlled located known resumed steps budget taken logged landed "
            "rejected fresh wall "
            "p contacts at width samples sample_width place_of_h whole "
            "rates forces project gaps mobilities walls walls_p step_function",
        ),
        ("events", EVENT_RECORD, LOG_ROWS),
    ]
)

#: A method with an error estimate, its arrays filled up with zeros (see ``methods.Method``): one over its
#: order, numbers of stages, of slopes, and of rows of dense output.
METHOD_RECORD = np.dtype(
    [
        *record("exponent", "stages slopes dense_rows"),
        ("nodes", np.float64, MOST_SLOPES),
        ("weights", np.float64, MOST_SLOPES),
        ("matrix", np.float64, (MOST_SLOPES, MOST_SLOPES)),
        ("estimates", np.float64, (2, MOST_SLOPES)),
        ("dense", np.float64, (MOST_DENSE, MOST_SLOPES)),
    ]
)

#: An angle in rad, modulo a period, at which a load by a body's angle is not smooth, and the coordinate.
KNOT_RECORD = np.dtype(record("angle period", "coordinate"))

#: Of R rigid joints, (R,) each: their ``Separation``, the mobility along the normal that free bodies would
#: have, in 1/kg, and friction as a part of the normal force.
OF_WALLS = "distance", "rate", "turning", "noise", "rate_noise", "bare", "share"


def wall_record(R: int, S: int, n: int) -> np.dtype[np.void]:
    """Return what R joints with rigid walls are at a state, no pin following: how they answer to impulses.

    They push along S rows ``D`` (S, n) of {q'}: of every joint the inward normal speed, then of those with
    friction the tangential one. ``motion`` (S, n) are {q'} per unit of each impulse, ``W`` (S, S) speeds
    along all rows, ``drivers`` (S,) the work of the drivers; ``free`` (n,) are the accelerations.
    """
    sizes = {"D": (S, n), "motion": (S, n), "W": (S, S), "drivers": (S,), "free": (n,)}
    return np.dtype([(name, float, size) for name, size in (dict.fromkeys(OF_WALLS, (R,)) | sizes).items()])


class Impact(NamedTuple):
    """A contact that is over, or an impulse on a rigid wall.

    ``kind``: a "contact" with a compliant wall; an "impact" with a rigid one's restitution; a "closing"
    without rebound, after which the pin follows it; a "support", passed on by a pin that followed its wall
    when another hit. The approach speed and the impulse along n are positive, the latter pushing the pin
    inwards; the tangential one is on the pin along t (see ``contacts``). ``energy_lost_J`` is this
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


class Run(NamedTuple):
    """What the loop works on: ``state`` (1,), rows, contacts (K,), method (1,) or None, knots, and samples.

    A row of OLD, NEW and AT is a state: y with n coordinates, velocities and sums of powers since t = 0, the
    contacts' gaps, and for a step of one length this and what rounding has taken. ``samples`` at ``times``
    have y, {lambda} (m,) of the mechanism's own rows, of every contact the normal force and friction (2K,),
    and of every contact phase and memory (2K,).
    """

    state: RecordArray
    rows: FloatArray
    contacts: RecordArray
    method: RecordArray | None
    knots: RecordArray
    times: FloatArray
    samples: FloatArray

    @property
    def q(self) -> FloatArray:
        """Return the coordinates (n,), a view."""
        return self.rows[OLD, : self.state["n"][0]]

    @property
    def v(self) -> FloatArray:
        """Return the velocities (n,), a view."""
        return self.rows[OLD, len(self.q) : 2 * len(self.q)]

    @property
    def sums(self) -> FloatArray:
        """Return the sums, a view."""
        return self.rows[OLD, 2 * len(self.q) : self.state["size"][0]]


def new_run(
    method: Method,
    joints: Sequence[ClearanceJoint],
    sums: list[str],
    sizes: tuple[int, int],
    times: FloatArray,
    knots: Sequence[tuple[float, float, int]] = (),
) -> Run:
    """Return a run of zeros by a method, pins in flight; a kernel has to be bound to it.

    ``sums`` are named as in ``Equations.power_names``; sizes are the numbers of coordinates and {lambda}.
    """
    (n, multipliers), K = sizes, len(joints)
    contacts = np.zeros(K, CONTACT_RECORD)
    size, gaps = 2 * n + len(sums), GAP_FIELDS * K
    rigid = [joint for joint in joints if joint.rigid]
    wall_rows = len(rigid) + sum(joint.friction is not None for joint in rigid)
    of_walls = wall_record(len(rigid), wall_rows, n).itemsize // 8 if rigid else 0
    rows = np.zeros((SLOPES + MOST_SLOPES, max(size + gaps + 1 + 2 * n, 3 * K, of_walls)))
    samples = np.zeros((len(times), size + multipliers + 4 * K))
    for k, (contact, joint) in enumerate(zip(contacts, joints, strict=True)):
        law, friction = joint.law, joint.friction
        contact["clearance"], contact["rigid"] = joint.radial_clearance_m, joint.rigid
        contact["friction"] = 0.0 if friction is None else friction.coefficient * steepest(friction)
        contact["slowest"] = law.minimum_impact_speed_m_s
        if joint.rigid:
            contact["restitution"] = law.restitution
        else:
            contact["stiffness"], contact["exponent"] = law.stiffness, law.exponent
            contact["factor"], contact["clipped"] = law.damping_factor, law.clipped
        contact["column"] = sums.index(f"normal{k}")
        contact["losses"] = sum(name in sums for name in (f"loss{k}", f"clip{k}", f"slide{k}"))
        contact["number"] = sum(other.rigid for other in joints[:k])
    state = np.zeros(1, RUN_RECORD)
    (run,) = state
    run["n"], run["size"], run["wall"], run["fresh"], run["condition"] = n, size, -1, -1, 1.0
    run["least"], run["error"], run["rigid_joints"], run["wall_rows"] = np.inf, 1.0, len(rigid), wall_rows
    run["contacts"], run["at"], run["width"] = contacts.ctypes.data, rows.ctypes.data, rows.strides[0]
    run["samples"], run["sample_width"] = samples.ctypes.data, samples.strides[0]
    run["place_of_h"], run["whole"] = size + gaps, size + gaps + 1 + 2 * n
    return Run(state, rows, contacts, record_of(method), np.array(list(knots), KNOT_RECORD), times, samples)


def record_of(method: Method) -> RecordArray | None:
    """Return a method with an error estimate as ``METHOD_RECORD`` (1,), None of another."""
    if not method.estimates:
        return None
    records, count, stages = np.zeros(1, METHOD_RECORD), len(method.nodes), len(method.weights)
    (record,) = records
    record["exponent"], record["stages"], record["slopes"] = 1.0 / method.order, stages, count
    record["nodes"][:count], record["weights"][:stages] = method.nodes, method.weights
    record["dense_rows"] = len(method.dense)
    for name in ("matrix", "estimates", "dense"):
        for k, row in enumerate(getattr(method, name)):
            record[name][k, : len(row)] = row
    return records
