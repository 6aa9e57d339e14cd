"""The solver: consistent start, steps by compiled loops, events on rigid walls, recording."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Literal

import numpy as np

from reference_solver import failures
from reference_solver.checks import POSITIVE, is_count, is_number, require, require_positive, require_vector
from reference_solver.contact import types
from reference_solver.contact.walls import separation
from reference_solver.equations import Answer, Baumgarte, Equations
from reference_solver.guard import Guard
from reference_solver.mechanism.contact_laws import RigidWall, steepest
from reference_solver.mechanism.mechanism import ClearanceJoint, Mechanism
from reference_solver.mechanism.points import State
from reference_solver.mechanism.scales import Scales, scales_of
from reference_solver.methods import RK4, dop853, dopri5, step
from reference_solver.solution import Solution, columns_of, contact_impacts
from reference_solver.tape import FloatArray, RecordArray

if TYPE_CHECKING:  # it brings Numba, which takes a moment
    from reference_solver.kernel import Kernel
    from reference_solver.rigid.bouncing import Bouncing


#: The paper's own algorithm, Baumgarte's feedback, or a projection of q and q' after every step.
Stabilisation = Literal["none", "projection"] | Baumgarte
#: Flights between rigid walls that are no higher than so many times the distance's round-off are never seen.
LOWEST_FLIGHT = 2.0
#: The methods of error control, of orders 8 and 5.
METHODS = {"dop853": dop853, "dopri5": dopri5}
#: Takes the time in s that a run has reached.
Tell = Callable[[float], None]

#: Largest violation of the constraints accepted at t = 0 in m and rad, and, per unit of speed, in velocity.
START_TOLERANCE = 1e-9
#: Fewer steps do not follow a contact.
FEWEST_STEPS_PER_CONTACT = 10.0
#: Events, and evaluations of {A} times coordinates, per call of a loop: a fraction of a second, to answer an
#: interrupt.
LOG_ROWS, CHUNK = 256, 8_000_000
#: The first step by error control, as a part of the mechanism's own time, and the first of a contact, as a
#: part of its duration; both are found anew from there.
FIRST_STEP, FIRST_PART_OF_CONTACT = 1e-3, 0.02


@dataclass(frozen=True)
class StepChoice:
    """The two rates: ``longest_s`` in flight and without contacts, and steps per contact's duration.

    Without ``locate_events`` every step has the length ``longest_s`` and a contact begins and ends with a
    step: the plain algorithm, for comparison. Pins before rigid walls bounce until a flight would be shorter
    than the part ``closing_flight_fraction`` of the longest step (see ``rigid.settling``); or, where
    ``lowest_flight`` is given, to heights of so many times the distance's round-off.
    """

    longest_s: float
    steps_per_contact: float = 100.0
    locate_events: bool = True
    closing_flight_fraction: float = 1e-3
    lowest_flight: float | None = None

    def __post_init__(self) -> None:
        require_positive(self, "longest_s", "steps_per_contact", "closing_flight_fraction")
        require_flight("StepChoice", self.lowest_flight)

    def at(self, longest_s: float) -> "StepChoice":
        """Return both rates in proportion, at another longest step."""
        per_contact = self.steps_per_contact * self.longest_s / longest_s
        return replace(
            self, longest_s=longest_s, steps_per_contact=max(FEWEST_STEPS_PER_CONTACT, per_contact)
        )


@dataclass(frozen=True)
class ErrorControl:
    """Steps of a method, each in error by no more than ``tolerance``, and no longer than ``longest_s``.

    The method is "dop853", of order 8, or "dopri5", of order 5, by which the other's runs are tested.

    The tolerance is a part of the mechanism's length for positions, of a radian for angles, and of both times
    the mechanism's own rate for velocities (see ``scales``); it is one of a step, not of the result. Events
    are located. Pins before rigid walls bounce until a flight would be so short that its height is of the
    tolerance; or, where ``lowest_flight`` is given, of so many times the distance's round-off.
    """

    tolerance: float
    longest_s: float = np.inf
    method: Literal["dop853", "dopri5"] = "dop853"
    lowest_flight: float | None = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"ErrorControl.method: expected dop853 or dopri5, got {self.method!r}")
        tolerance, longest = self.tolerance, self.longest_s
        valid, wanted = is_number(tolerance) and 0 < tolerance < 1, "a finite number > 0 and < 1"
        require("ErrorControl.tolerance", tolerance, valid, wanted)
        require("ErrorControl.longest_s", longest, longest > 0, "a number > 0")
        require_flight("ErrorControl", self.lowest_flight)


def nobody(_: float) -> None:
    """Tell nobody how far a run has come."""


def solve(
    mechanism: Mechanism,
    q: FloatArray,
    v: FloatArray,
    *,
    end_time_s: float,
    samples: int,
    step: StepChoice | ErrorControl | float,
    stabilisation: Stabilisation = "projection",
) -> Solution:
    """Integrate from coordinates q and velocities v, each (3 x bodies,), and record ``samples + 1`` states.

    ``step`` is the longest one in s, or both rates, of the paper's RK4; or the error control of DOP853. Where
    events are located, and with error control, steps are the run's own, whatever the samples: those within a
    step are interpolated, at the order of the step. Else all steps of RK4 have one length that fits into the
    samples' interval. Steps end where prescribed motions, and loads by a body's angle, are not smooth.

    Raises:
        ValueError: one of these is out of range, or walls are rigid without projection or located events.
        InconsistentStart: q or v violate the constraints, or a pin is outside a rigid bearing.
        SolverError: a step or an impact failed; it says which and when.
    """
    require_run(end_time_s, samples)
    choice = step if isinstance(step, StepChoice | ErrorControl) else StepChoice(step)
    q, v = (require_vector(name, x, 3 * len(mechanism.bodies)) for name, x in (("q", q), ("v", v)))
    check_start(mechanism, q, v)
    return Solver(mechanism, q, choice, stabilisation).run(q, v, end_time_s, samples)


class Solver:
    """Runs one mechanism; its kernels are made with it, those of pins that follow walls when first needed.

    ``q_start`` (n,) are the coordinates that {g} is measured from. ``steps`` and ``settled``, events on rigid
    walls, count those of the present run.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        q_start: FloatArray,
        choice: StepChoice | ErrorControl,
        stabilisation: Stabilisation = "projection",
    ) -> None:
        self._mechanism, self._choice, self._joints = mechanism, choice, mechanism.contacts
        valid = stabilisation in ("none", "projection") or isinstance(stabilisation, Baumgarte)
        require("stabilisation", stabilisation, valid, "none, projection or Baumgarte's gains")
        self._rigid = any(joint.rigid for joint in self._joints)
        located = isinstance(choice, ErrorControl) or choice.locate_events
        if self._rigid and not (stabilisation == "projection" and located):
            raise ValueError(
                "rigid walls: expected stabilisation = projection and located events, got others"
            )
        self._baumgarte = stabilisation if isinstance(stabilisation, Baumgarte) else None
        self._projected = stabilisation == "projection"
        self._q_start = require_vector("q_start", q_start, 3 * len(mechanism.bodies))
        self._equations = Equations(mechanism, self._q_start, self._baumgarte)
        self._names = [*self._equations.power_names, "removed"]
        self._method = METHODS[choice.method]() if isinstance(choice, ErrorControl) else RK4
        self._kernels: dict[tuple[int, ...], Kernel] = {}
        self.steps = self.settled = 0
        # Loops are compiled or loaded here and not in the run: a run of no length does it.
        run = self._new(self._q_start, np.zeros_like(self._q_start), np.zeros(1), 0.0, 1.0)
        self._gaps(run)
        bouncing = self._bouncing(run)
        if bouncing is not None:
            self._settle(run, bouncing)
        self._loop(run, bouncing)()

    def _kernel(self, following: tuple[int, ...]) -> "Kernel":
        from reference_solver.kernel import Kernel, Topology

        if following not in self._kernels:
            topology = Topology(self._mechanism, self._baumgarte, self._projected, following, self._method)
            self._kernels[following] = Kernel(topology, self._q_start)
        return self._kernels[following]

    @property
    def _chunk(self) -> int:
        """The steps of one call."""
        return 1 + CHUNK // (self._equations.n * len(self._method.weights))

    def _new(
        self, q: FloatArray, v: FloatArray, times: FloatArray, end_time_s: float, interval_s: float
    ) -> types.Run:
        """Return a run: contacts in flight, the motion at t = 0, room for samples at times."""
        contacts = np.array([contact_record(joint) for joint in self._joints], types.CONTACT_RECORD)
        sizes = len(q), len(self._names), len(self._equations.C)
        knots, kernel = self._mechanism.knots_by_angle, self._kernel(())
        run = types.new_run(self._method, contacts, sizes, times, LOG_ROWS, knots)
        kernel.bind(run)
        run.old.q[:], run.old.v[:] = q, v
        set_out(run, self._mechanism, self._choice, kernel, end_time_s, interval_s)
        return run

    def _shortest_flight_s(self, run: types.Run) -> float:
        """Return the flight between rigid walls that is not followed any more, if heights do not decide."""
        if self._choice.lowest_flight is not None:
            return 0.0
        if isinstance(self._choice, StepChoice):
            return self._choice.closing_flight_fraction * float(run.clock["longest"][0])
        # A flight of this height, if pins are pushed on by the mechanism's own accelerations.
        return float(np.sqrt(8.0 * self._choice.tolerance) * run.control["step"][0] / FIRST_STEP)

    def _gaps(self, run: types.Run) -> None:
        """Set the contacts' gaps of a run's motion at its start."""
        self._kernel(()).set_gaps(run)

    def _bouncing(self, run: types.Run) -> "Bouncing | None":
        """Return the events on rigid walls of a run that is to begin; None without rigid walls."""
        if not self._rigid:
            return None
        from reference_solver.rigid.bouncing import Bouncing

        lowest, shortest_s = self._choice.lowest_flight or LOWEST_FLIGHT, self._shortest_flight_s(run)
        kernel = self._kernel(())
        look = kernel["walls"].address
        return Bouncing(self._equations, self._names, look, kernel.p, shortest_s, lowest)

    def _settle(self, run: types.Run, bouncing: "Bouncing") -> int:
        """Settle an event on rigid walls, no pin following."""
        bouncing.settling.control["alone"] = 1
        return int(self._loop(run, bouncing)())

    def _loop(self, run: types.Run, bouncing: "Bouncing | None") -> Callable[[], int]:
        """Return what advances a run from its present state on: all that is timed of a run."""
        from reference_solver.contact import adaptive_loop, loop, smooth_loop

        kernel = self._kernel(() if bouncing is None else bouncing.following)
        kernel.bind(run)
        parts, controlled = types.plain(run), isinstance(self._choice, ErrorControl)
        if bouncing is not None:
            from reference_solver.rigid.loop import bounce_by_error, bounce_by_steps

            bounce = bounce_by_error if controlled else bounce_by_steps
            return partial(bounce, parts, types.plain(bouncing.settling))
        if controlled:
            return partial(adaptive_loop.advance if self._joints else smooth_loop.advance, parts)
        if kernel.topology.by_events:
            return partial(loop.advance, parts)

        def advance() -> int:
            from reference_solver.crossing import crossed

            status = int(loop.advance_equally(parts))
            while status == types.FAILED and crossed(kernel, run, float(run.clock["longest"][0])):
                status = int(loop.advance_equally(parts))
            return status

        return advance

    def run(
        self,
        q: FloatArray,
        v: FloatArray,
        end_time_s: float,
        samples: int,
        tell: Tell = nobody,
        times_s: FloatArray | None = None,
    ) -> Solution:
        """Integrate from q and v, which ``check_start`` is to have passed, as ``solve`` does.

        ``tell`` is called now and then with the time reached. With contacts ``times_s`` (s,), in order from 0
        to the end, may be those of the samples.
        """
        require_run(end_time_s, samples)
        times = np.linspace(0.0, end_time_s, samples + 1) if times_s is None else times_s
        run = self._new(q, v, times, end_time_s, end_time_s / samples)
        motion, records, now = run.old, run.records, run.clock[0]
        self.steps = self.settled = 0
        events, sums = [np.zeros(0, types.EVENT_RECORD)], [np.zeros((0, len(self._names)))]
        knots = (t for t in self._mechanism.knots_s(float(now["longest"])) if 0 < t < end_time_s)
        landings = chain(knots, [end_time_s])  # steps end where prescribed motions are not smooth
        now["end"] = next(landings)
        status, bouncing, took = types.SPENT, self._bouncing(run), 0.0
        self._gaps(run)
        if bouncing is not None:
            self._settle_first(bouncing, run)
        while status != types.DONE:
            following = () if bouncing is None else bouncing.following
            begin, chunk = float(now["time"]), self._chunk
            now["events"], now["budget"] = 0, now["steps"] + chunk
            advance = self._loop(run, bouncing)
            started = time.perf_counter()
            status = advance()
            took += time.perf_counter() - started
            if bouncing is not None:
                bouncing.take(run, status)
            self.steps, self.settled = int(now["steps"]), 0 if bouncing is None else bouncing.settled
            tell(float(now["time"]))
            events.append(records.events[: now["events"]].copy())
            sums.append(records.event_sums[: now["events"]].copy())
            if status == types.FAILED:
                self._refuse(following, run)
            if status in (types.SPENT, types.FULL) and now["time"] == begin:
                raise failures.Stalled(begin, chunk)
            if status == types.DONE and now["end"] < end_time_s:
                now["end"], status = next(landings), types.GO
        if not (np.isfinite(motion.q).all() and np.isfinite(motion.v).all()):
            raise failures.NonFiniteState(end_time_s, float(now["longest"]))
        solution = self._solution(run, np.concatenate(events), np.concatenate(sums), bouncing, took)
        scales = Scales(float(run.control["length"][0]), float(run.control["rate"][0]))
        tolerance = self._choice.tolerance if isinstance(self._choice, ErrorControl) else None
        guard = Guard(solution, scales, float(now["longest"]), tolerance)
        guard.check_energy()
        if not self._projected:
            guard.check_drift(self._equations, float(now["least"]))
        return solution

    def _settle_first(self, bouncing: "Bouncing", run: types.Run) -> None:
        """Settle at t = 0, while compliant contacts that begin closed push; the loop notes their touch."""
        contacts, gaps = run.contacts, run.old.gaps
        closed = (contacts["rigid"] == 0) & (gaps["g"] > 0)
        speed = np.maximum(gaps["rate"], contacts["slowest"])[closed]
        contacts["phase"][closed] = types.CONTACT
        contacts["memory"][closed] = contacts["factor"][closed] / speed
        status = self._settle(run, bouncing)
        contacts["phase"][closed], contacts["memory"][closed] = types.FLIGHT, 0.0
        bouncing.take(run, status)

    def _refuse(self, following: tuple[int, ...], run: types.Run) -> None:
        """Say why the step tried last could not be taken, by the equations in numbers."""
        t, h, (n, y, _) = float(run.clock["time"][0]), float(run.clock["tried"][0]), run.old
        equations = Equations(self._mechanism, self._q_start, self._baumgarte, following)
        phases = np.column_stack([run.contacts["phase"], run.contacts["memory"]])
        q, v = y[:n], y[n : 2 * n]

        def answer(t: float, q: FloatArray, v: FloatArray) -> Answer:
            return equations.required(t, q, v, phases, h, self._method)

        def project(t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, float, bool]:
            *result, ok = equations.project(t, q, v, phases)
            if not ok and np.isfinite(q).all():
                equations.refuse_singular(t, q)
            return (*result, ok)

        with np.errstate(all="ignore"):
            if isinstance(self._choice, ErrorControl):
                equations.required(t, q, v, phases)
                raise failures.StepsCollapsed(t, h)
            after = step(self._method, answer, project if self._projected else None, t, q, v, h)
        if np.isfinite(after.q).all() and np.isfinite(after.v).all() and not after.ok:
            raise failures.NearSingular(t, h, float(after.condition))
        raise failures.NonFiniteState(t + h, h)

    def _solution(
        self,
        run: types.Run,
        events: RecordArray,
        event_sums: FloatArray,
        bouncing: "Bouncing | None",
        took_s: float,
    ) -> Solution:
        compliant = (k for k, joint in enumerate(self._joints) if not joint.rigid)
        ended = [i for k in compliant for i in contact_impacts(events, event_sums, self._names, k)]
        hit, changes = ([], []) if bouncing is None else (bouncing.impacts, bouncing.changes)
        return Solution(
            mechanism=self._mechanism,
            time_s=run.records.time,
            **columns_of(run.records.samples, run.old.n, self._names, len(self._joints)),
            events=events,
            impacts=tuple(sorted([*hit, *ended], key=lambda i: i.time_s + i.duration_s)),
            mode_changes=tuple(changes),
            steps=self.steps,
            solve_time_s=took_s,
            condition=float(run.clock["condition"][0]),
        )


def set_out(
    run: types.Run,
    mechanism: Mechanism,
    choice: StepChoice | ErrorControl,
    kernel: "Kernel",
    end_time_s: float,
    interval_s: float,
) -> None:
    """Set clock and control of a run of zeros whose motion and contacts are those of its start.

    ``kernel`` tells the accelerations there. Steps of one length land on multiples of ``interval_s``.
    """
    (now,), (n, y, _) = run.clock, run.old
    now["longest"], now["end"], now["rigid"], now["condition"] = choice.longest_s, end_time_s, -1, 1.0
    now["least"] = np.inf
    kernel["rates"](kernel.p, run.contacts.ctypes.data, 0.0, y, run.slopes[types.START])
    a = run.slopes[types.START, n : 2 * n]
    scales = scales_of(mechanism, run.old.q, run.old.v, a, end_time_s)
    run.control["length"], run.control["rate"] = scales.length_m, scales.rate_s
    if isinstance(choice, ErrorControl):
        set_control(run, choice, scales)
        return
    now["per_contact"], now["located"] = choice.steps_per_contact, run.contacts.size and choice.locate_events
    if not now["located"]:
        now["interval"] = interval_s
        intervals = max(1, round(end_time_s / interval_s))  # the step is the same for all that it fits
        steps = intervals * np.ceil(interval_s / choice.longest_s * (1 - 1e-9))
        now["longest"] = (end_time_s or interval_s) / steps


def set_control(run: types.Run, choice: ErrorControl, scales: Scales) -> None:
    """Set error control by the mechanism's scales at a run's start."""
    from reference_solver.contact.types import WEIGHT

    n = run.old.n
    tolerances = choice.tolerance * np.tile([scales.length_m, scales.length_m, 1.0], n // 3)
    first, part = FIRST_STEP / scales.rate_s, FIRST_PART_OF_CONTACT
    run.slopes[WEIGHT, : 2 * n] = 1.0 / np.concatenate([tolerances, scales.rate_s * tolerances])
    control = (choice.tolerance, scales.length_m, scales.rate_s, first, first, part)
    run.control[0] = (*control, 1.0, 1.0, 1.0, 0, -1)


def contact_record(joint: ClearanceJoint) -> tuple[float, ...]:
    """Return a contact in flight as ``CONTACT_RECORD`` has it."""
    law, clearance, friction = joint.law, joint.radial_clearance_m, joint.friction
    state, unknown = (types.FLIGHT, *[0.0] * 6), [0.0] * 4
    slope = 0.0 if friction is None else friction.coefficient * steepest(friction)
    if isinstance(law, RigidWall):
        return *state, clearance, *[0.0] * 4, slope, 0.0, 1.0, 0.0, 0.0, 0.0, *unknown
    compliant = (law.stiffness, law.exponent, law.damping_factor, law.minimum_impact_speed_m_s, slope)
    return *state, clearance, *compliant, float(law.clipped), 0.0, 0.0, 0.0, 0.0, *unknown


def require_flight(part: str, lowest: float | None) -> None:
    """Raise ValueError unless a lowest flight is none, or one that round-off does not hide."""
    valid = lowest is None or (is_number(lowest) and lowest >= LOWEST_FLIGHT)
    require(f"{part}.lowest_flight", lowest, valid, f"a finite number >= {LOWEST_FLIGHT:g} or None")


def require_run(end_time_s: float, samples: int) -> None:
    """Raise ValueError unless a run has an end and samples."""
    require("end_time_s", end_time_s, is_number(end_time_s) and end_time_s > 0, POSITIVE)
    require("samples", samples, is_count(samples), "an integer >= 1")


def check_start(mechanism: Mechanism, q: FloatArray, v: FloatArray) -> None:
    """Check that positions and velocities meet the constraints, and pins are inside rigid bearings.

    Raises:
        InconsistentStart: they do not, by more than ``START_TOLERANCE``.
    """
    equations = Equations(mechanism, q)
    gap = np.abs(equations.violation(0.0, q)).max(initial=0)
    if not gap <= START_TOLERANCE:
        raise failures.InconsistentStart(f"initial positions: expected g = 0, got a violation of {gap:.3g}")
    rate = np.abs(equations.constraint_matrix(q) @ v - equations.C).max(initial=0)
    if not rate <= START_TOLERANCE * (1 + np.abs(v).max()):
        raise failures.InconsistentStart(
            f"initial velocities: expected [B]q' = C, got a violation of {rate:.3g}"
        )
    rigid = [(k, joint) for k, joint in enumerate(mechanism.contacts) if joint.rigid]
    for k, joint in rigid:
        outside = float(separation(joint, State(q, v)).distance) - joint.radial_clearance_m
        if not outside <= START_TOLERANCE:
            raise failures.InconsistentStart(
                f"contacts[{k}]: expected the pin inside its bearing, got it {outside:.3g} m past the wall"
            )
