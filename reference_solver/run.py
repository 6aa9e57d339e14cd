"""What a run is, and what it gives.

Records of where it is, of contacts and of events, and rows of states and slopes, are what the loop works on.
Samples of the motion, forces and sums, and what contacts did, are its solution.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_solver.mechanism.contacts import FLIGHT, steepest
from reference_solver.mechanism.loads import apart_m
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.methods import Method
from reference_solver.tape import FloatArray, RecordArray

#: Rows of a run: states at a step's start, at its end and within it; slopes at both ends; 1 over the
#: tolerances of y, 0 of the sums; memory; from DENSE on coefficients of dense output, and from SLOPES on the
#: slopes of stages, at the end, and what dense output takes beside them.
OLD, NEW, AT, START, END, WEIGHT, SPARE, DENSE = range(8)
#: Slopes and rows of dense output at the most, DOP853's; and events in the log.
MOST_SLOPES, MOST_DENSE, LOG_ROWS = 16, 4, 1024
SLOPES = DENSE + 3 + MOST_DENSE


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
#: duration expected then, and ``kernel.mobilities`` (``following``: along its wall). Its law: clearance,
#: stiffness, exponent, damping factor, minimum impact speed, steepest slope of friction in s/m, whether the
#: force is clipped, restitution, coefficient of friction. Of a rigid wall: that it is one, the round-off of g
#: and of its rate, and that it takes no part in a step. Since its touch: the largest normal force in N and
#: penetration, and their times; at the touch: rate of g, impulse and losses by then. Of a rigid wall at an
#: event: see ``impacts``. Then the columns of its impulse in the sums, of its losses behind it how many, its
#: number, and its row and that of its tangent, or -1, in ``kernel.walls``.
CONTACT_RECORD = np.dtype(
    record(
        "phase memory began_s duration_s mobility sliding following clearance stiffness exponent factor "
        "slowest friction clipped restitution coefficient rigid noise rate_noise ignored force force_s "
        "deepest deepest_s approach impulse dissipated "
        "distance bare rate rests share pull follows released touches hits takes_part closes short chosen "
        "wanted part sticks normal tangential lost",
        "column losses number joint tangent",
    )
)

#: What an event is: a touch, a release, the force clipped, the force back; on rigid walls see ``Impact``.
TOUCH, RELEASE, CLIP, RESUME, IMPACT, CLOSING, SUPPORT = 1, -1, 2, 3, 4, 5, 6
KINDS = {IMPACT: "impact", CLOSING: "closing", SUPPORT: "support"}
#: An event: contact, and what it is; rate of g, penetration; of the contact that was until then its begin and
#: approach speed, largest force and penetration with their times, impulse and losses; of a rigid
#: wall the tangential impulse and the effective mass.
OF_EVENT = "time_s rate depth began_s approach force force_s deepest deepest_s impulse lost tangential mass"
EVENT_RECORD = np.dtype(record(OF_EVENT, "contact what"))

#: Where a run is, and how it steps. In floats: time, end, the longest step, steps per contact; tolerance, the
#: mechanism's length in m and rate in 1/s, the next step and that of the last flight, a contact's first step
#: as a part of its duration, the last error over the tolerance; the worst condition so far, the least at a
#: sample, and worst and least of the step tried last, with its length; how far a sample may be past a step's
#: end; and flights between rigid walls that are not followed: shorter than so many seconds, or no higher than
#: so many times the distance's round-off; and the time of the last event on them. In integers: coordinates,
#: numbers in y, rigid joints and rows of ``kernel.walls``; whether steps go by their error, events are
#: located, slopes at both ends of a step are known, and a call goes on where the last one ended; steps, their
#: limit, samples and events so far, steps landed on when all are of one length, rejections in a row, the
#: contact that has just begun or -1, the one of the last event on a rigid wall or -1; such events so far and
#: at that time, and why one has no answer or 0; what the kernel's functions are called with, addresses of
#: numbers, contacts, rows and samples and how long these are in bytes, where a state has the length of a
#: step, and how much of a row is a state; and the functions. Then the log.
RUN_RECORD = np.dtype(
    [
        *record(
            "time end longest per_contact tolerance length rate step flight_step first_part error "
            "condition least worst best tried slack shortest_s lowest last_s",
            "n size rigid_joints wall_rows controlled located known resumed steps budget taken logged landed "
            "rejected fresh wall settled at_once fault "
            "p contacts at width samples sample_width place_of_h whole "
            "rates forces project gaps mobilities walls walls_p resolve stepped",
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
RECORDS = RUN_RECORD, CONTACT_RECORD, METHOD_RECORD, KNOT_RECORD
#: What a contact dissipates by (see ``contacts.rates_of``).
LOSSES = ("loss", "clip", "slide", "impact", "closing")
#: What an event that ends a contact tells of it.
ENDED = ["time_s", "contact", "what", "approach", "impulse", "tangential", "lost", "mass", "began_s"]
ENDED += ["force", "force_s", "deepest", "deepest_s"]


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


class ModeChange(NamedTuple):
    """From this time on the pins of these contacts follow their rigid walls, and the others fly."""

    time_s: float
    following: tuple[int, ...]


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
    def following(self) -> tuple[int, ...]:
        """Return the contacts whose pins follow rigid walls."""
        follows = (self.contacts["rigid"] != 0.0) & (self.contacts["phase"] != FLIGHT)
        return tuple(np.flatnonzero(follows).tolist())


def new_run(
    method: Method, mechanism: Mechanism, sums: list[str], multipliers: int, times: FloatArray
) -> Run:
    """Return a run of zeros by a method, pins in flight; a kernel has to be bound to it.

    ``sums`` are named as in ``Equations.power_names``; {lambda} has so many multipliers.
    """
    n, joints, K = 3 * len(mechanism.bodies), mechanism.contacts, len(mechanism.contacts)
    contacts, knots = np.zeros(K, CONTACT_RECORD), np.array([*mechanism.knots_by_angle], KNOT_RECORD)
    size, gaps = 2 * n + len(sums), GAP_FIELDS * K
    rigid = [joint for joint in joints if joint.rigid]
    wall_rows = len(rigid)
    samples = np.zeros((len(times), size + multipliers + 4 * K))
    for k, (contact, joint) in enumerate(zip(contacts, joints, strict=True)):
        law, friction = joint.law, joint.friction
        contact["clearance"], contact["rigid"] = joint.radial_clearance_m, joint.rigid
        contact["friction"] = 0.0 if friction is None else friction.coefficient * steepest(friction)
        contact["slowest"], contact["number"] = law.minimum_impact_speed_m_s, k
        if joint.rigid:
            contact["restitution"], contact["tangent"] = law.restitution, -1
            contact["joint"] = sum(other.rigid for other in joints[:k])
            if friction is not None:
                contact["coefficient"], contact["tangent"] = friction.coefficient, wall_rows
                wall_rows += 1
        else:
            contact["stiffness"], contact["exponent"] = law.stiffness, law.exponent
            contact["factor"], contact["clipped"] = law.damping_factor, law.clipped
        contact["column"] = sums.index(f"normal{k}")
        contact["losses"] = sum(name in sums for name in (f"loss{k}", f"clip{k}", f"slide{k}"))
    of_walls = 6 * len(rigid) + wall_rows * (n + wall_rows + 2)  # see ``kernel.walls``
    height = max(SLOPES + MOST_SLOPES, DENSE + wall_rows + 2)  # see ``impacts.resolve``
    rows = np.zeros((height, max(size + gaps + 1 + 2 * n, 3 * K, of_walls)))
    state = np.zeros(1, RUN_RECORD)
    (run,) = state
    run["n"], run["size"], run["wall"], run["fresh"], run["condition"] = n, size, -1, -1, 1.0
    run["least"], run["error"], run["rigid_joints"], run["wall_rows"] = np.inf, 1.0, len(rigid), wall_rows
    run["contacts"], run["at"], run["width"] = contacts.ctypes.data, rows.ctypes.data, rows.strides[0]
    run["samples"], run["sample_width"] = samples.ctypes.data, samples.strides[0]
    run["place_of_h"], run["whole"] = size + gaps, size + gaps + 1 + 2 * n
    return Run(state, rows, contacts, record_of(method), knots, times, samples)


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


@dataclass(frozen=True)
class Solution:
    """The motion of a mechanism with n coordinates, m constraint rows and K contacts, at s times.

    ``time_s`` (s,), ``q`` and ``v`` (s, n), ``multipliers`` (s, m) by the rows of [B] (see ``row_slices``).
    ``phases`` (s, K, 2) are phase and memory of every contact (see ``run``). ``normal_force_N`` and
    ``friction_force_N`` (s, K) are without impulses: the one presses the pin inwards, the other is on the pin
    along t.

    ``sums`` are integrals since t = 0 (s,) by RK4's own quadrature: "drivers", their work in J, that of
    impulses included; "loadk", that of load k, if it is no function of where the bodies are; of contact k
    "normalk", the normal impulse in N s, and energies dissipated in J: "lossk" by a compliant wall, "clipk"
    where its force was clipped, "impactk" and "closingk" by a rigid one (friction's part included), and
    "slidek" by friction; "removed" is what the stabilisation has removed, negative where it has added some:
    by projection or by Baumgarte's feedback (see ``Equations``).

    ``events`` (E,) is the log of compliant contacts (see ``run.EVENT_RECORD``), ``impacts`` are in the order
    of the contacts' ends, ``mode_changes`` are those of pins on rigid walls; ``steps`` counts all steps,
    taken in ``solve_time_s``. ``condition`` is the constraints' worst at any stage of a step (see
    ``factorisation.Factors``): it may amplify round-off in {lambda}, by its square root in {q''}.
    """

    mechanism: Mechanism
    time_s: FloatArray
    q: FloatArray
    v: FloatArray
    multipliers: FloatArray
    phases: FloatArray
    normal_force_N: FloatArray
    friction_force_N: FloatArray
    sums: dict[str, FloatArray]
    events: RecordArray
    impacts: tuple[Impact, ...]
    mode_changes: tuple[ModeChange, ...]
    steps: int
    solve_time_s: float = 0.0
    condition: float = 1.0

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Return which pins touch their walls, (s, K)."""
        return np.asarray(self.phases[..., 0] != FLIGHT)

    @property
    def gap_m(self) -> FloatArray:
        """Return d, from bearing centre to pin centre, (s, K, 2)."""
        gaps = [apart_m(joint, self.q) for joint in self.mechanism.contacts]
        return np.asarray(np.reshape(gaps, (-1, len(self.q), 2)).swapaxes(0, 1))

    def losses_J(self) -> FloatArray:
        """Return the energy that all contacts have dissipated, (s,)."""
        lost = [value for name, value in self.sums.items() if name.rstrip("0123456789") in LOSSES]
        return np.sum(lost, axis=0) if lost else np.zeros(len(self.time_s))


def solution_of(
    run: Run, of: Mechanism, names: list[str], events: RecordArray, changes: list[ModeChange], took_s: float
) -> Solution:
    """Return what a run of a mechanism with a log (E,) and changes of mode gives, its sums by their names."""
    samples, n, pairs, (state,) = run.samples, len(run.q), 2 * len(run.contacts), run.state
    sizes = n, n, len(names), samples.shape[1] - 2 * (n + pairs) - len(names), pairs, pairs
    ends = np.cumsum(sizes)[:-1].tolist()
    q, v, sums, multipliers, forces, phases = map(np.ascontiguousarray, np.split(samples, ends, axis=1))
    happened, nan = list[Impact](), np.nan
    ended = events[(events["what"] == RELEASE) | (events["what"] >= IMPACT)]
    for t, k, what, speed, impulse, rubbed, lost, mass, began, *largest in ended[ENDED].tolist():
        if what == RELEASE:
            happened.append(Impact(began, k, "contact", t - began, speed, impulse, nan, lost, nan, *largest))
        else:
            happened.append(Impact(t, k, KINDS[what], 0.0, speed, impulse, rubbed, lost, mass))
    motion = of, run.times, q, v, multipliers, phases.reshape(len(samples), -1, 2)
    return Solution(
        *motion,
        normal_force_N=forces[:, ::2],
        friction_force_N=forces[:, 1::2],
        sums=dict(zip(names, sums.T, strict=True)),
        events=events[events["what"] < IMPACT],
        impacts=tuple(happened),
        mode_changes=tuple(changes),
        steps=int(state["steps"]),
        solve_time_s=took_s,
        condition=float(state["condition"]),
    )
