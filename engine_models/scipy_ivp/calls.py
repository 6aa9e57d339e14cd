"""Calls of SciPy on a scene's equations: counted, silent, bounded, and failures told as such."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.integrate import OdeSolution, ode, odeint, solve_ivp
from scipy.optimize import OptimizeResult

from engine_models.engine import EngineFailed, FloatArray, SimulationFailed
from engine_models.pace import Pace
from engine_models.progress import tell
from engine_models.scene.scene import Scene
from engine_models.scipy_ivp.contact import Watch
from engine_models.scipy_ivp.derivative import Derivative

#: Absolute tolerance of the sums in y, which takes them out of the error control. It is finite because Radau
#: differences the right-hand side by steps of a part of it.
UNCONTROLLED = 1e30
#: The methods that are none of ``solve_ivp``, and whose loops over steps are compiled: LSODA by a call of its
#: own, and DOP853 by an integrator of the class ``ode``.
ODEINT, ODE_DOP853 = COMPILED = "odeint", "dop853"
#: Evaluations in a step of the latter.
STAGES = 12
#: Of t and y.
OfTime = Callable[[float, FloatArray], float]
#: The status of a solution that an event has ended.
STOPPED = 1
#: Evaluations after which a run tells how far it has come, and after which its pace is judged.
PAUSE, OUTLASTING = 10_000, 300_000


@dataclass(frozen=True)
class Choice:
    """How SciPy is called; a run fails that takes more than ``max_evaluations``."""

    method: str
    rtol: float
    atol: float
    longest_step_s: float
    max_evaluations: int


class Root(NamedTuple):
    """Where a watched function was zero: the time, and y there."""

    watch: Watch
    t: float
    y: FloatArray


class Calls:
    """The calls of one run. With ``memory`` (K,) the right-hand side sets the contacts' phases itself.

    ``bare`` calls are those that a user would write: nothing is counted, nobody told, and no sample taken but
    that of the end.
    """

    def __init__(
        self,
        scene: Scene,
        derivative: Derivative,
        choice: Choice,
        memory: FloatArray | None = None,
        bare: bool = False,
    ) -> None:
        self._derivative, self._choice, self._memory, self.bare = derivative, choice, memory, bare
        self._atol = np.full(len(derivative.start), choice.atol)
        self._atol[2 * derivative.n :] = UNCONTROLLED
        #: Accepted steps so far.
        self.steps = 0
        #: The end of the last step, the memories with the times from which on they hold.
        self._last_time_s = 0.0
        self._times: list[float] = []
        self._memories: list[FloatArray] = []
        #: Calls of the right-hand side so far, and at which to look up again.
        self._called, self._pause = 0, 0
        self._pace = Pace(scene, OUTLASTING)
        if choice.method not in COMPILED:
            solve_ivp(lambda _, y: -y, (0.0, 1.0), [1.0], choice.method)  # loads it, out of any timing

    def memory_at(self, t: float) -> FloatArray:
        """Return the memory (K,) that was valid in the step that t is in."""
        return self._memories[max(int(np.searchsorted(self._times, t)) - 1, 0)]

    def solve(
        self, t: float, y: FloatArray, times: FloatArray, watched: Sequence[Watch]
    ) -> tuple[list[FloatArray], list[Root], OdeSolution | None]:
        """Integrate from y at t to the last of the times, or to an alarm.

        Return y at the times, roots, and y as a function of time where there are contacts to be looked into.

        Raises:
            SimulationFailed: too many evaluations, a singular configuration, steps too short to go on, or
                anything that SciPy warns of.
        """
        if self._choice.method in COMPILED:
            by = self._by_odeint if self._choice.method == ODEINT else self._by_ode
            return by(t, y, times[-1:] if self.bare else times), [], None
        if self.bare:
            solution = self._solution(self._derivative.right, t, y, float(times[-1]), None, watched)
            states = [] if solution.status == STOPPED else [solution.y[:, -1].copy()]
        else:
            solution = self._watched_solution(t, y, times, watched)
            states = list(np.ascontiguousarray(np.transpose(solution.y)))
        found = zip(watched, solution.t_events or [], solution.y_events or [], strict=False)
        roots = [Root(of, float(t), y) for of, at, there in found for t, y in zip(at, there, strict=True)]
        return states, roots, solution.sol

    def _by_odeint(self, t: float, y: FloatArray, times: FloatArray) -> list[FloatArray]:
        """Return y at the times by ``odeint``, which knows no events and is heard of at its end alone."""
        choice = self._choice
        with self.failing():
            states, told = odeint(
                self._derivative.right,
                y,
                np.append(t, times),
                rtol=choice.rtol,
                atol=self._atol,
                hmax=choice.longest_step_s,
                mxstep=choice.max_evaluations,
                tfirst=True,
                full_output=True,
            )
        if not np.isfinite(states[-1]).all():
            raise self._failure("non-finite state", SimulationFailed)
        self.steps += int(told["nst"][-1])
        self._last_time_s = float(told["tcur"][-1])
        return list(states[1:])

    def _by_ode(self, t: float, y: FloatArray, times: FloatArray) -> list[FloatArray]:
        """Return y at the times by ``ode``'s integrator, which knows no events, samples or steps.

        The right-hand side is called twice in succession at one time where a step is accepted: at its last
        stage, and at its end. A sample is one step from the last such end, as short as that takes.
        """
        ends, last = [(t, y)], np.nan

        def seen(at: float, state: FloatArray) -> FloatArray:
            nonlocal last
            if at == last:
                ends.append((at, state.copy()))
            last = at
            return self._derivative(at, state)

        if self.bare:
            return [self._to(float(times[-1]), t, y, self._derivative.right)]
        end = self._to(float(times[-1]), t, y, seen)
        self.steps += len(ends) - 1
        begins = np.searchsorted([at for at, _ in ends], times[:-1], "right") - 1
        states = []
        for at, (begin, there) in zip(times[:-1].tolist(), (ends[k] for k in begins), strict=True):
            states.append(self._to(at, begin, there, self._derivative.right, at - begin))
        return [*states, end]

    def _to(
        self,
        end: float,
        t: float,
        y: FloatArray,
        right: Callable[[float, FloatArray], FloatArray],
        first_step_s: float = 0.0,
    ) -> FloatArray:
        """Return y at an end, from y at t, by ``ode``'s integrator; it chooses a first step of 0."""
        choice = self._choice
        solver = ode(right).set_integrator(
            ODE_DOP853,
            rtol=choice.rtol,
            atol=choice.atol,
            nsteps=choice.max_evaluations // STAGES + 1,
            max_step=choice.longest_step_s,
            first_step=first_step_s,
        )
        with self.failing():
            state: FloatArray = solver.set_initial_value(y, t).integrate(end) if end > t else y
        self._last_time_s = end
        return state

    @contextmanager
    def failing(self) -> Iterator[None]:
        """Let what SciPy warns of in this block be a failed run, and numbers overflow."""
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("error")
                yield
        except (Warning, ValueError) as trouble:  # a value error is Radau's about a Jacobian with NaN
            raise self._failure(str(trouble)) from trouble

    def _watched_solution(
        self, t: float, y: FloatArray, times: FloatArray, watched: Sequence[Watch]
    ) -> OptimizeResult:
        """Return what ``solve_ivp`` does, with samples at the times, or say why it does not."""
        with self.failing():
            if not np.isfinite(self._right(t, y)).all():
                # No first step would be short enough.
                raise self._failure("non-finite accelerations", SimulationFailed)
            events: list[OfTime] = [*watched, self._step_taken]
            solution = self._solution(self._right, t, y, float(times[-1]), times, events)
        if not solution.success:
            raise self._failure(solution.message)
        self.steps -= 1  # the call at the start
        return solution

    def _solution(
        self,
        right: Callable[[float, FloatArray], FloatArray],
        t: float,
        y: FloatArray,
        end: float,
        times: FloatArray | None,
        events: Sequence[OfTime],
    ) -> OptimizeResult:
        choice = self._choice
        return solve_ivp(
            right,
            (t, end),
            y,
            choice.method,
            times,
            events=events or None,
            rtol=choice.rtol,
            atol=self._atol,
            max_step=choice.longest_step_s,
            dense_output=self._derivative.contact_count > 0 and not self.bare,
        )

    def _right(self, t: float, y: FloatArray) -> FloatArray:
        self._called += 1
        if self._memory is not None:
            self._derivative.sense(y, self._memory)
        return self._derivative(t, y)

    def _step_taken(self, t: float, y: FloatArray) -> float:
        """Return 1, as an event that never happens, which is called at the start and after accepted steps.

        It looks up now and then: not in the right-hand side, whose exceptions Fortran prints.
        """
        if self._called > self._pause:
            self._look_up(t)
        self.steps, self._last_time_s = self.steps + 1, t
        if self._memory is not None:
            self._memory[:] = self._derivative.remember(y, self._memory)
            if not (self._memories and np.array_equal(self._memory, self._memories[-1], equal_nan=True)):
                self._times.append(t)
                self._memories.append(self._memory.copy())
        return 1.0

    def _look_up(self, t: float) -> None:
        """Tell how far the run has come, and end one that does not get on."""
        if self._called > self._choice.max_evaluations:
            raise SimulationFailed(
                f"{self._choice.max_evaluations} evaluations came no further than t = {t:.6g} s: "
                "take a longer step, loosen rtol and atol, or raise max_evaluations"
            )
        tell(t)
        self._pace.judge(t, self._called)
        self._pause = min(self._called + PAUSE, self._choice.max_evaluations)

    def _failure(self, message: str, failed: type[SimulationFailed] = EngineFailed) -> SimulationFailed:
        reached = self._last_time_s
        reason = self._derivative.diagnosis(reached) or message.rstrip(".")
        return failed(f"{self._choice.method} stopped at t = {reached:.6g} s: {reason}")
