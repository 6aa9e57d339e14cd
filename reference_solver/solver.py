"""The solver: consistent start, steps by compiled loops, events on rigid walls, recording."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Literal

import numpy as np

from reference_solver import failures
from reference_solver.energy import FLAT, Scales, check_drift, check_energy, scales_of
from reference_solver.equations import Baumgarte, Equations
from reference_solver.impacts import BLOCKED, PARADOX, SINGULAR
from reference_solver.kernel import Kernel, Topology
from reference_solver.loop import DONE, FAILED, FULL, SPENT, WALL, WITHIN, loop_of
from reference_solver.mechanism.contacts import separation
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.points import State
from reference_solver.methods import RK4, dop853, dopri5, step
from reference_solver.run import OLD, START, WEIGHT, ModeChange, Run, Solution, new_run, solution_of
from reference_solver.tape import FloatArray, RecordArray

#: The paper's own algorithm, Baumgarte's feedback, or a projection of q and q' after every step.
Stabilisation = Literal["none", "projection"] | Baumgarte
#: Flights between rigid walls that are no higher than so many times the distance's round-off are never seen;
#: nor does RK4 see those shorter than this part of its longest step.
LOWEST_FLIGHT, SHORTEST_FLIGHT = 2.0, 1e-3
#: The methods of error control, of orders 8 and 5.
METHODS = {"dop853": dop853, "dopri5": dopri5}
#: Largest violation of the constraints accepted at t = 0 in m and rad, and, per unit of speed, in velocity.
START_TOLERANCE = 1e-9
#: Positions and speeds in m, rad and s whose squares would still be numbers are below this.
LARGEST = 1e100
#: Fewer steps do not follow a contact.
FEWEST_STEPS_PER_CONTACT = 10.0
#: Evaluations of {A} times coordinates per call of the loop: a fraction of a second, to answer an interrupt.
CHUNK = 8_000_000
#: How far a sample may be past the end of a step of one length, as a part of that.
SLACK = 1e-9
#: The first step by error control, as a part of the mechanism's own time, and the first of a contact, as a
#: part of its duration; both are found anew from there.
FIRST_STEP, FIRST_PART_OF_CONTACT = 1e-3, 0.02


@dataclass(frozen=True)
class StepChoice:
    """The two rates: ``longest_s`` in flight and without contacts, and steps per contact's duration.

    Without contacts, or without ``locate_events``, every step has one length that fits into the samples'
    interval, and a contact begins and ends with a step: the plain algorithm, for comparison. Else steps are
    the run's own, and samples within them are interpolated. Pins before rigid walls bounce until a flight
    would be shorter than a part of the longest step (see ``impacts``); or, where ``lowest_flight`` is given,
    to heights of so many times the distance's round-off.
    """

    longest_s: float
    steps_per_contact: float = 100.0
    locate_events: bool = True
    lowest_flight: float | None = None


@dataclass(frozen=True)
class ErrorControl:
    """Steps of a method, each in error by no more than ``tolerance``, and no longer than ``longest_s``.

    The method is "dop853", of order 8, or "dopri5", of order 5, by which the other's runs are tested.

    The tolerance is a part of the mechanism's length for positions, of a radian for angles, and of both times
    the mechanism's own rate for velocities (see ``Scales``); it is one of a step, not of the result. Events
    are located. Pins before rigid walls bounce until a flight would be so short that its height is of the
    tolerance; or, where ``lowest_flight`` is given, of so many times the distance's round-off.
    """

    tolerance: float
    longest_s: float = np.inf
    method: Literal["dop853", "dopri5"] = "dop853"
    lowest_flight: float | None = None


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
        self._mechanism, self._choice = mechanism, choice
        self._baumgarte = stabilisation if isinstance(stabilisation, Baumgarte) else None
        self._projected, self._q_start = stabilisation == "projection", q_start
        self._equations = Equations(mechanism, q_start, self._baumgarte)
        self._names = [*self._equations.power_names, "removed"]
        self._method = METHODS[choice.method]() if isinstance(choice, ErrorControl) else RK4
        self._kernels: dict[tuple[int, ...], Kernel] = {}
        self.steps = self.settled = 0
        self._kernel(())  # compiled or loaded here and not in the run, as the loop
        loose, controlled = bool(mechanism.contacts), bool(self._method.estimates)
        self._advance = loop_of(loose, controlled, loose or controlled or bool(mechanism.knots_by_angle))

    def _kernel(self, following: tuple[int, ...]) -> Kernel:
        if following not in self._kernels:
            topology = Topology(self._mechanism, self._baumgarte, self._projected, following, self._method)
            self._kernels[following] = Kernel(topology, self._q_start)
        return self._kernels[following]

    def _new(
        self, q: FloatArray, v: FloatArray, times: FloatArray, end_time_s: float, interval_s: float
    ) -> Run:
        """Return a run: contacts in flight, the motion at t = 0, room for samples at times."""
        n, kernel = len(q), self._kernel(())
        run = new_run(self._method, self._mechanism, self._names, len(self._equations.C), times)
        run.q[:], run.v[:] = q, v
        kernel.functions["rates"](kernel.p, run.contacts.ctypes.data, 0.0, run.rows[OLD], run.rows[START])
        (state,), choice = run.state, self._choice
        scales = scales_of(self._mechanism, run.q, run.v, run.rows[START, n : 2 * n], end_time_s)
        length, rate = state["length"], state["rate"] = scales.length_m, scales.rate_s
        state["longest"], state["end"] = choice.longest_s, end_time_s
        state["lowest"], follows_all = choice.lowest_flight or LOWEST_FLIGHT, choice.lowest_flight is not None
        if isinstance(choice, ErrorControl):
            weights = 1.0 / (choice.tolerance * np.tile([length, length, 1.0], n // 3))
            run.rows[WEIGHT, : 2 * n] = np.concatenate([weights, weights / rate])
            state["controlled"], state["located"], state["tolerance"] = 1, 1, choice.tolerance
            state["step"] = state["flight_step"] = FIRST_STEP / rate
            state["first_part"] = FIRST_PART_OF_CONTACT
            # A flight as high as the tolerance, if pins are pushed on by the mechanism's own accelerations.
            shortest_s = np.sqrt(8.0 * choice.tolerance) / rate
        else:
            state["per_contact"] = choice.steps_per_contact
            state["located"] = bool(self._mechanism.contacts) and choice.locate_events
            shortest_s = SHORTEST_FLIGHT * choice.longest_s
            if not state["located"]:  # all steps have one length, of which the interval is a multiple
                intervals = max(1, round(end_time_s / interval_s))
                steps = intervals * np.ceil(interval_s / choice.longest_s * (1 - 1e-9))
                state["longest"] = (end_time_s or interval_s) / steps
                state["slack"] = SLACK * state["longest"]
        state["shortest_s"] = 0.0 if follows_all else shortest_s
        return run

    def run(
        self,
        q: FloatArray,
        v: FloatArray,
        end_time_s: float,
        samples: int,
        tell: Callable[[float], None] | None = None,
        times_s: FloatArray | None = None,
    ) -> Solution:
        """Integrate from q and v, which ``check_start`` is to have passed, as ``solve`` does.

        ``tell`` is called now and then with the time reached. With contacts ``times_s`` (s,), in order from 0
        to the end, may be those of the samples.
        """
        times = np.linspace(0.0, end_time_s, samples + 1) if times_s is None else times_s
        run = self._new(q, v, times, end_time_s, end_time_s / samples)
        try:
            solution = self._run(run, end_time_s, tell)
        except failures.SolverError as error:
            self._refuse_limit(run, error)
            raise
        if self._projected:  # beyond the limit there is nothing to project on
            self._refuse_limit(run)
        return solution

    def _refuse_limit(self, run: Run, cause: Exception | None = None) -> None:
        """Raise LimitPosition where a drive could not go on."""
        taken, q = int(run.state["taken"][0]), run.samples[:, : len(run.q)]
        if (limit_s := self._equations.limit_s(run.times, q, taken)) is not None:
            raise failures.LimitPosition(time_s=limit_s) from cause

    def _run(self, run: Run, end_time_s: float, tell: Callable[[float], None] | None) -> Solution:
        """Take a run to its end, part by part, and hold it to its energy."""
        (state,), events, method = run.state, list[RecordArray](), self._method
        self.steps = self.settled = 0
        knots = (t for t in self._mechanism.knots_s(float(state["longest"])) if 0 < t < end_time_s)
        landings = chain(knots, [end_time_s])  # steps end where prescribed motions are not smooth
        state["end"] = next(landings)
        chunk = 1 + CHUNK // (len(run.q) * len(method.weights))
        status, took, changes = SPENT, 0.0, list[ModeChange]()
        while status != DONE:
            following, begin = run.following, float(state["time"])
            state["logged"], state["budget"] = 0, state["steps"] + chunk
            self._kernel(following).bind(run)
            started = time.perf_counter()
            status = self._advance(run)
            took += time.perf_counter() - started
            events.append(state["events"][: state["logged"]].copy())
            self.steps, self.settled = int(state["steps"]), int(state["settled"])
            if tell is not None:
                tell(float(state["time"]))
            if status == WITHIN:
                self._advance = loop_of(False, False, True)
            if status == FAILED:
                self._refuse(following, run)
            if status == WALL:
                self._refuse_event(run)
                changes.append(ModeChange(float(state["time"]), run.following))
            if status in (SPENT, FULL) and state["time"] == begin:
                raise failures.Stalled(time_s=begin, steps=chunk)
            if status == DONE and state["end"] < end_time_s:
                state["end"], status = next(landings), SPENT
        if not max(np.abs(run.q).max(), np.abs(run.v).max()) < LARGEST:  # squares of more are no numbers
            raise failures.NonFiniteState(time_s=end_time_s)
        solution = solution_of(run, self._mechanism, self._names, np.concatenate(events), changes, took)
        scales = Scales(float(state["length"]), float(state["rate"]))
        sizes = scales, float(state["longest"]), float(state["tolerance"])
        check_energy(solution, *sizes)
        if not self._projected:
            check_drift(solution, *sizes, self._equations, float(state["least"]))
        return solution

    def _refuse_event(self, run: Run) -> None:
        """Say why an event on a rigid wall has no answer, if it has none."""
        fault, t, wall = (run.state[name][0].item() for name in ("fault", "time", "wall"))
        if fault == SINGULAR:
            self._equations.refuse_singular(t, run.q)
        joints = failures.listed([str(k) for k in np.flatnonzero(run.contacts["coefficient"])])
        kinds = {BLOCKED: failures.BlockedImpact, PARADOX: failures.PainleveParadox}
        if fault != 0:
            raise kinds.get(fault, failures.UnsettledEvents)(time_s=t, joints=joints, joint=wall)

    def _refuse(self, following: tuple[int, ...], run: Run) -> None:
        """Say why the step tried last could not be taken, by the equations in numbers."""
        t, h, q, v = float(run.state["time"][0]), float(run.state["tried"][0]), run.q, run.v
        equations = Equations(self._mechanism, self._q_start, self._baumgarte, following)
        phases = np.column_stack([run.contacts["phase"], run.contacts["memory"]])

        def project(t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, float, bool]:
            *result, ok = equations.project(t, q, v, phases)
            if not ok:
                equations.refuse_singular(t, q)
            return (*result, ok)

        with np.errstate(all="ignore"):
            if isinstance(self._choice, ErrorControl):
                equations.required(t, q, v, phases)
                raise failures.StepsCollapsed(time_s=t, step_s=h)
            answer = partial(equations.required, phases=phases, h=h, of=self._method)
            after = step(self._method, answer, project if self._projected else None, t, q, v, h)
        if np.isfinite(after.q).all() and np.isfinite(after.v).all():
            sound = after.ok and after.condition < FLAT
            kind = failures.StepsCollapsed if sound else failures.NearSingular
            raise kind(time_s=t, step_s=h, condition=float(after.condition))
        raise failures.NonFiniteState(time_s=t + h)


def check_start(mechanism: Mechanism, q: FloatArray, v: FloatArray) -> None:
    """Check that positions and velocities meet the constraints, and pins are inside rigid bearings.

    Raises:
        InconsistentStart: they do not, by more than ``START_TOLERANCE``.
    """
    equations, state = Equations(mechanism, q), State(q, v)
    rates = equations.system(0.0, q).B @ v - equations.C
    rigid = [joint for joint in mechanism.contacts if joint.rigid]
    outside = [float(separation(joint, state).distance) - joint.radial_clearance_m for joint in rigid]
    for what, off, size in (
        ("initial positions on the constraints", np.abs(equations.system(0.0, q).g), 1.0),
        ("initial velocities on the constraints", np.abs(rates), 1 + np.abs(v).max()),
        ("pins inside rigid bearings", np.array(outside), 1.0),
    ):
        if not off.max(initial=0.0) <= START_TOLERANCE * size:
            raise failures.InconsistentStart(f"expected {what}, got some off by {off.max():.3g}")
