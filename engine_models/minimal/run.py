"""A run of a ``Model`` by one of SciPy's solver classes, from event to event, as a trajectory.

An event is a signal that comes to be positive: a touch or a release, or a law's force that changes its sign.
It is looked for in every step, on the solver's interpolant. A pin that has come to its rigid wall leaves it
by Newton's restitution. A flight that would be too short or too low is none: its pin would follow the wall,
which is not here, nor is friction on a wall that does not give.
"""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy.integrate
from scipy.optimize import brentq

from engine_models.engine import (
    AdapterCannot,
    Contact,
    EngineFailed,
    Impacts,
    RunSettings,
    SimulationFailed,
    Trajectory,
)
from engine_models.mechanics.impacts import along_steps, largest
from engine_models.mechanics.states import pin_gap
from engine_models.mechanics.trajectory import reactions_of
from engine_models.minimal import equations as eq
from engine_models.minimal.equations import CLIPPED, FLIGHT, PUSHED
from engine_models.minimal.model import STEEP, FloatArray, Model, Numbers
from engine_models.scene.scene import Scene
from engine_models.watch import Pace, tell

#: Absolute tolerance of sums, which takes them out of the error control.
UNCONTROLLED = 1e30
#: Signals that have just been answered are zero to round-off: they count above this, in m or as a share.
NUDGE = 1e-16
#: Coordinates are chosen anew where T has grown by so much since the last choice.
GROWN = 1.5
#: By what part of its largest the determinant of rows has fallen where their condition is looked at, and the
#: condition at which a position is singular.
FALLEN, SINGULAR = 0.2, 1e-4
#: Signals of contacts, by what is told of these, of which the rate of a gap is no event; and those that a
#: table by an angle or a speed goes to its next piece, or back.
TOUCH, SIGN, TURN, ON, BACK = eq.ROOM, eq.SHARE, eq.RATE, -1, -2
#: Evaluations after which a run tells how far it has come, and after which its pace is judged.
PAUSE, OUTLASTING = 10_000, 300_000
#: The part of a step behind which the rate of a gap is looked at first.
ASIDE = 1e-6
#: How much longer the first step from a stop may be than any before: equal samples are so but for rounding.
AS_LONG = 1.001
#: Most corrections of a located event, and the part of the step that slopes are taken over.
CORRECTIONS, DIFFERENCE = 3, 1e-3
#: The shortest flight in s, and the lowest in units in the last place of a coordinate.
SHORTEST_FLIGHT_S, LOWEST = 2e-9, 100.0
#: The push in N that a wall is tried with, beside which weights and loads are not lost.
PUSH_N = 2.0**40
#: The part of the time within which a pin hits at the same instant as another.
AT_ONCE = 1e-13
#: When which contact or table has which signal come to be positive.
Event = tuple[float, int, int]


@dataclass(frozen=True)
class Choice:
    """How a scene is solved: the class, its tolerances, and the most evaluations.

    ``atol`` is by number of a state; those behind its end are not controlled. A ``sharp`` run ends its
    steps at events, where others take the interpolant's state. Of a ``bare`` one nobody asks for the largest
    forces and depths of contacts.
    """

    method: str
    rtol: float
    atol: FloatArray
    longest_step_s: float = np.inf
    max_evaluations: int = 5_000_000
    sharp: bool = False
    bare: bool = False


class Touch(NamedTuple):
    """The begin of a contact: time, speed and sums, and (time, force, depth) since."""

    time_s: float
    speed_m_s: float
    sums: FloatArray
    trace: list[tuple[float, float, float]]


class Recording:
    """Rows of states (q, v, sums) at times, of what ``equations.rates`` tells of them, and impacts."""

    def __init__(self, scene: Scene, model: Numbers, times_s: FloatArray) -> None:
        self.scene, self.model, self.times_s, self.steps = scene, model, times_s, 0
        self.states, self.told = list[FloatArray](), list[FloatArray]()
        self.impacts: list[list[list[float]]] = [[] for _ in model.phases]

    def trajectory(self, took_s: float) -> Trajectory:
        """Return what has been recorded."""
        model, of, y, told = self.model, self.model.of, np.array(self.states), np.array(self.told)
        n, size, count = len(y), model.size, len(of.loose)
        position, contacts = y[:, :size].reshape(n, -1, 3), dict[str, Contact]()
        behind = model.first + eq.OF_CONTACT * count
        parts = dict(zip(model.parts, told[:, behind:-2].T, strict=True))
        sums: dict[Any, FloatArray] = dict(zip(model.sums, y[:, 2 * size :].T, strict=True))
        for k, pin in enumerate(of.loose):
            wall, room = model.contacts[k], pin.clearance
            assert room is not None
            gap = pin_gap(pin, position, np.zeros_like(position))[0]
            depth, power = np.hypot(*gap.T) - wall[eq.C], wall[eq.N] + 1
            first, rubs = model.first + eq.OF_CONTACT * k, room.friction is not None
            clips = wall[eq.A] > 0 and not room.may_pull
            contacts[pin.name] = Contact(
                gap_m=gap,
                penetration_m=depth,
                normal_force_N=told[:, first + eq.NORMAL],
                friction_force_N=told[:, first + eq.FRICTION] if rubs else None,
                elastic_energy_J=wall[eq.K] * np.maximum(depth, 0.0) ** power / power,
                normal_impulse_N_s=sums[pin.name, "normal_impulse_N_s"],
                normal_loss_J=sums[pin.name, "normal_loss_J"],
                friction_loss_J=sums[pin.name, "friction_loss_J"] if rubs else None,
                clipped_loss_J=sums[pin.name, "clipped_loss_J"] if clips else None,
                impacts=Impacts(*np.reshape(sorted(self.impacts[k]), (-1, 9)).T),
            )
        multipliers = told[:, 2 * size : 2 * size + model.rows]
        short = "slider." if self.scene.is_short else ""
        return Trajectory(
            **vars(reactions_of(of, multipliers, contacts, parts.get("driver"))),
            time_s=self.times_s,
            position=position,
            velocity=told[:, :size].reshape(n, -1, 3),
            driver_work_J=sums.get("driver"),
            step_s=float(self.times_s[-1]) / self.steps,
            steps=self.steps,
            solve_time_s=took_s,
            contacts=contacts,
            load_work_J={name.removeprefix(short): sums[name] for name in model.working},
        )


class Run(Recording):
    """One run: ``states`` and ``told`` have a row a time, ``impacts`` one for each contact that is over."""

    model: Model

    def __init__(self, model: Model, times_s: FloatArray, choice: Choice) -> None:
        super().__init__(model.scene, model, times_s)
        self.t: float = 0.0
        self.y: FloatArray = model.start.copy()
        self.choice, self.evaluations = choice, 0
        self._solver: Any = None
        self._interpolant: Any = None
        self._touches = dict[int, Touch]()
        self._atol = np.full(len(self.y), UNCONTROLLED)
        self._atol[: np.size(choice.atol)] = choice.atol
        self._levels = dict[tuple[int, int], float]()
        self._first_step_s: float | None = None
        self._limit_s, self._steep, self._largest = np.inf, STEEP, 0.0
        self._kinks = model.kinks if choice.sharp else []
        self._pieces = [kink.piece(self.y) for kink in self._kinks]
        self._pause, self._pace = 0, Pace(model.scene, OUTLASTING)

    def run(self) -> None:
        """Go through all times.

        Raises:
            SimulationFailed: the solver gives up, or takes too many evaluations; a position is singular; or
                a pin follows a rigid wall, or rubs on it.
        """
        end = float(self.times_s[-1])
        self._answer(None)
        self._sample(self.y)
        stops = self.model.stops_s
        if self.choice.sharp and not len(self.model.phases):  # no interpolant is as good as a step
            stops = np.union1d(stops, self.times_s)
        for stop in [*stops[(stops > 0) & (stops < end)].tolist(), end]:
            while self.t < stop:
                try:
                    self._segment(stop)
                except (Warning, ValueError) as trouble:  # LSODA's, and Radau's of a Jacobian with NaN
                    raise self._failure(str(trouble)) from trouble

    def _solver_from(self, t: float, y: FloatArray, end: float, **steps: float | None) -> Any:
        method, tolerances = self.choice.method, {"rtol": self.choice.rtol, "atol": self._atol}
        return getattr(scipy.integrate, method)(self.model, t, y, end, **tolerances, **steps)

    def _within(self, t: float) -> FloatArray:
        """Return the state at a time within the last step, on the solver's interpolant."""
        if self._interpolant is None:
            self._interpolant = self._solver.dense_output()
        return np.ascontiguousarray(self._interpolant(t))

    def _segment(self, stop: float) -> None:
        """Go on to a stop, or to what ends the segment before: an event, or a choice of coordinates."""
        model, limit = self.model, min(self._limit_s, self.choice.longest_step_s)
        first = self._first_step_s and min(AS_LONG * self._first_step_s, stop - self.t, limit)
        if not np.isfinite(model(self.t, self.y)).all():  # no first step would be short enough
            raise SimulationFailed(f"non-finite accelerations at t = {self.t:.6g} s")
        solver = self._solver = self._solver_from(self.t, self.y, stop, max_step=limit, first_step=first)
        self._limit_s = np.inf
        model(self.t, self.y)
        longest_s = 0.0
        while solver.status == "running":
            t, y, before, determinant = self.t, self.y, model.contacts_told.copy(), model.told[-2]
            message, spent = solver.step(), self.evaluations + solver.nfev
            if solver.status == "failed" or spent > self.choice.max_evaluations:
                raise self._failure(message)
            if spent > self._pause:
                tell(t)
                self._pace.judge(t, spent)
                self._pause = spent + PAUSE
            self.steps += 1
            if self.choice.method != "DOP853":  # which looks at the end of a step last
                model(solver.t, solver.y)
            (now, steep), self._interpolant = model.told[-2:].tolist(), None
            event = self._first_event(t, before)
            self.t, self.y = solver.t, solver.y.copy()
            if event is not None:
                self.t, self.y = self._located(t, y, event)
            elif self.choice.sharp and solver.status == "finished":
                self.y = model.closed(self.t, self.y, choose=False)
            self._record(t)
            if event is not None:
                self._first_step_s = None
                self._answer(event)
                break
            self._first_step_s = longest_s = max(longest_s, solver.step_size)
            if self._must_choose(determinant, now, steep, solver.step_size):
                break
        self.evaluations += solver.nfev

    def _failure(self, message: str | None) -> SimulationFailed:
        if self.model.condition(self.t, self.y) < 10 * SINGULAR:
            return self.model.singular(self.t)
        if message is None:
            reached = f"evaluations came no further than t = {self.t:.6g} s"
            advice = "take a longer step, loosen rtol and atol, or raise max_evaluations"
            return SimulationFailed(f"{self.choice.max_evaluations} {reached}: {advice}")
        return EngineFailed(f"{self.choice.method} stopped at t = {self.t:.6g} s: {message.rstrip('.')}")

    def _must_choose(self, before: float, now: float, steep: float, step_s: float) -> bool:
        """Return whether the solver is to begin anew: with other coordinates, or with a shorter step.

        The determinants, ``before`` the last step and ``now``, are those of one choice of coordinates. No
        step is longer than half the way to where rows would be singular, so that none passes that.
        """
        model = self.model
        self._largest = max(self._largest, abs(before))
        fallen = abs(now) < FALLEN * self._largest
        if not now / before > 0 or (fallen and model.condition(self.t, self.y) < SINGULAR):
            # what is driven comes to its limit as a root: the determinant's square falls evenly
            left = step_s * now**2 / (before**2 - now**2) if 0 < now / before < 1 else 0.0
            raise model.singular(self.t + left)
        if steep > max(STEEP, GROWN * self._steep):
            self.y = model.closed(self.t, self.y)
            model(self.t, self.y)
            self._steep, self._largest = float(model.told[-1]), 0.0
            return True
        if now / before < 1.0 and 0.5 * now / (before - now) < 1.0:
            self._limit_s = 0.5 * step_s * now / (before - now)
            return True
        return False

    def _signal(self, told: FloatArray, y: FloatArray, number: int, kind: int) -> float:
        """Return what is positive past an event, from what was told of contacts and the state."""
        if kind < 0:
            kink, piece = self._kinks[number], self._pieces[number]
            x = float(y[kink.coordinate])
            return x - kink.begin(piece + 1) if kind == ON else kink.begin(piece) - x
        value, phase = float(told[number, kind]), self.model.phases[number, 0]
        signed = value if phase == (CLIPPED if kind == SIGN else FLIGHT) else -value
        return signed - self._levels.get((number, kind), 0.0)

    def _kinds(self, k: int) -> tuple[int, ...]:
        """Return the kinds of events that contact k can have in its phase."""
        wall, phase = self.model.contacts[k], self.model.phases[k, 0]
        signs = wall[eq.A] > 0.0 if wall[eq.PULLS] == 0.0 else wall[eq.MU] > 0.0 and wall[eq.DRAGS] == 0.0
        return (TOUCH, SIGN) if signs and phase in (PUSHED, CLIPPED) else (TOUCH,)

    def _first_event(self, t: float, before: FloatArray) -> Event | None:
        """Return the first event in the step since t, on the interpolant."""
        now, y, events = self.model.contacts_told.copy(), self._solver.y, list[Event]()
        watched = [(k, kind) for k in range(len(now)) for kind in self._kinds(k)]
        watched += [(number, kind) for number in range(len(self._kinks)) for kind in (ON, BACK)]
        for number, kind in watched:
            at, end = partial(self._signal_at, number), self._solver.t
            past = self._signal(now, y, number, kind) > 0.0
            turned = kind == TOUCH and self._signal(before, y, number, TURN) >= 0.0
            if not past and turned and self._signal(now, y, number, TURN) < 0.0:
                begin = t + ASIDE * (end - t)  # a pin at the centre of its bearing has a rate of zero
                end = _zero(partial(at, TURN), begin, end)
                past = at(kind, end) > 0.0
            if past:
                events.append((_zero(partial(at, kind), t, end), number, kind))
        return min(events, default=None)

    def _signal_at(self, number: int, kind: int, t: float) -> float:
        """Return a signal at a time within the last step."""
        y = self._within(t)
        self.model(t, y)
        return self._signal(self.model.contacts_told, y, number, kind)

    def _located(self, t: float, y: FloatArray, event: Event) -> tuple[float, FloatArray]:
        """Return time and state of an event; a sharp run takes steps to it until its signal is zero."""
        at, number, kind = event
        if not self.choice.sharp or at <= t:
            return at, self._within(at)
        aside, signal = max(t, at - DIFFERENCE * (at - t)), partial(self._signal_at, number, kind)
        slope = (signal(at) - signal(aside)) / (at - aside)
        state = self._step_to(t, y, at)
        for _ in range(CORRECTIONS):
            self.model(at, state)
            off = self._signal(self.model.contacts_told, state, number, kind)
            earlier = at - off / slope if slope > 0.0 else at
            if not t < earlier <= self._solver.t or abs(earlier - at) <= np.spacing(at):
                break
            at = earlier
            state = self._step_to(t, y, at)
        return at, state

    def _step_to(self, t: float, y: FloatArray, end: float) -> FloatArray:
        """Return the state at a time within the last step, by the method itself."""
        solver = self._solver_from(t, y, end, first_step=end - t)
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise self._failure(message)
        self.evaluations += solver.nfev
        return np.asarray(solver.y)

    def _record(self, begin: float) -> None:
        """Record the samples between the begin of the last step and the time reached, and trace contacts."""
        due = self.times_s[len(self.states) :]
        for t in due[due <= self.t].tolist():
            self._sample(self.y if t == self.t else self._within(t))
        if not self._touches or self.choice.sharp or self.choice.bare:
            return
        for t in along_steps(np.zeros(0), begin, self.t).tolist():
            self.model(t, self._within(t))
            for k, touch in self._touches.items():
                if not touch.trace or t > touch.trace[-1][0]:
                    touch.trace.append((t, float(self.model.contacts_told[k, eq.NORMAL]), self._depth(k)))

    def _depth(self, k: int) -> float:
        return float(depth_of(self.model.contacts[k, eq.C], self.model.contacts_told[k, eq.ROOM]))

    def _sample(self, y: FloatArray) -> None:
        self.model(float(self.times_s[len(self.states)]), y)
        state = y.copy()
        for k in np.flatnonzero(self.model.phases[:, 0] == CLIPPED).tolist():
            self._clip(state, k, -1.0)
        self.states.append(state)
        self.told.append(self.model.told.copy())

    def _answer(self, event: Event | None) -> None:
        """Answer an event, and others that are due with it."""
        model, self._levels = self.model, {}
        if event is not None and event[2] < 0:
            self._pieces[event[1]] += 1 if event[2] == ON else -1
        model(self.t, self.y)
        for k in sorted(range(len(model.phases)), key=lambda k: model.contacts[k, eq.K] != 0.0):  # impacts
            for kind in self._kinds(k):
                is_event = event is not None and (k, kind) == event[1:]
                if not is_event and not self._signal(model.contacts_told, self.y, k, kind) > NUDGE:
                    continue
                phase = model.phases[k, 0]
                if model.contacts[k, eq.K] == 0.0:
                    self.y, impact = settle(model, self.t, self.y, k)
                    self.impacts[k].append([self.t, 0.0, *impact, *[np.nan] * 4])
                elif kind == SIGN:
                    self._clip(self.y, k, 1.0 if phase == PUSHED else -1.0)
                    model.phases[k, 0] = CLIPPED if phase == PUSHED else PUSHED
                elif phase == FLIGHT:
                    self._touch(k)
                else:
                    self._release(k)
                model(self.t, self.y)
                for each in self._kinds(k):
                    now = self._signal(model.contacts_told, self.y, k, each)
                    self._levels[k, each] = max(now, 0.0) * (1 + 1e-15) + NUDGE
                self._largest = 0.0
                break

    def _clip(self, y: FloatArray, k: int, sign: float) -> None:
        """Add what a contact stores to what clipping loses: all of it, from then on less what is left."""
        wall, depth = self.model.contacts[k], max(self._depth(k), 0.0)
        stored = wall[eq.K] * depth ** (wall[eq.N] + 1) / (wall[eq.N] + 1)
        y[2 * self.model.size + eq.OF_SUMS * k + 2] += sign * stored * (wall[eq.PULLS] == 0.0)

    def _sums(self, k: int) -> FloatArray:
        first = 2 * self.model.size + eq.OF_SUMS * k
        return np.array(self.y[first : first + eq.OF_SUMS])

    def _touch(self, k: int) -> None:
        model, wall = self.model, self.model.contacts[k]
        speed = float(model.contacts_told[k, eq.RATE] * wall[eq.C] / (wall[eq.C] + self._depth(k)))
        model.phases[k] = PUSHED, wall[eq.A] / max(speed, wall[eq.SLOWEST]), 0.0
        self._touches[k] = Touch(self.t, speed, self._sums(k), [])
        model(self.t, self.y)
        if len(self._kinds(k)) > 1 and model.contacts_told[k, eq.SHARE] < 0.0:  # begun on its way out
            self._clip(self.y, k, 1.0)
            model.phases[k, 0] = CLIPPED

    def _release(self, k: int) -> None:
        self.model.phases[k] = 0.0
        touch = self._touches.pop(k)
        impulse, *lost = (self._sums(k) - touch.sums).tolist()
        times, force, depth = np.transpose(touch.trace) if touch.trace else np.full((3, 1), np.nan)
        largest_of = *largest(times, force), *largest(times, depth)
        lasted = self.t - touch.time_s
        self.impacts[k].append([touch.time_s, lasted, touch.speed_m_s, impulse, sum(lost), *largest_of])


def depth_of(c: float, room: Any) -> Any:
    """Return the depth of a pin, or in n states (n,), by its clearance and what is told of its room."""
    return 2 * c * room / (c + np.sqrt(c * c + 2 * c * room))


def _zero(value: Callable[[float], float], begin: float, end: float) -> float:
    """Return where a value passes zero in a step, or has just been zero."""
    off = value(begin), value(end)
    if off[0] * off[1] >= 0.0:
        return begin if abs(off[0]) <= abs(off[1]) else end
    return float(brentq(value, begin, end, xtol=1e-300, rtol=1e-15))


def solve(scene: Scene, settings: RunSettings, choice: Callable[[Model], Choice]) -> Trajectory:
    """Return the trajectory of a scene.

    Raises:
        UnsupportedScene, SimulationFailed: see ``Model`` and ``Run.run``.
    """
    model, times = Model(scene), settings.times_s(scene)
    run = Run(model, times, choice(model))
    began = time.perf_counter()
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("error")
        run.run()
    trajectory = run.trajectory(time.perf_counter() - began)
    trajectory.position[..., 2] += model.turns_rad
    return trajectory


def settle(model: Model, t: float, y: FloatArray, k: int) -> tuple[FloatArray, tuple[float, float, float]]:
    """Return the state after a hit of pin k, and its approach speed, impulse in N s and lost energy.

    With N the row of the distance from the bearing, e the restitution and p the impulse,
    M dv = B^T l - p N^T and N dv = -(1 + e) N v.

    Raises:
        AdapterCannot: this is not followed here.
    """
    wall, name, size, mass = model.contacts[k], model.of.loose[k].name, model.size, model.masses.ravel()
    if wall[eq.MU] > 0.0:
        raise AdapterCannot(f"joint {name} touches a rigid wall that rubs at t = {t:.6g} s")
    model(t, y)
    speed, v = float(model.contacts_told[k, eq.RATE]), model.told[:size].copy()
    for other in np.flatnonzero(model.contacts[:, eq.K] == 0.0).tolist():
        room, rate = model.contacts_told[other, [eq.ROOM, eq.RATE]]
        if other != k and -room < rate * AT_ONCE * t:
            raise AdapterCannot(f"two pins hit their walls at one instant, t = {t:.6g} s")
    N = _normal(model, t, y[:size], v, k)
    B, _, c, _ = model.look(t, y[:size], y[size : 2 * size])
    dependent, free = model.order[: len(B)].astype(int), model.order[len(B) :].astype(int)
    T = np.zeros((size, len(free)))
    T[free] = np.eye(len(free))
    T[dependent] = -np.linalg.solve(B[:, dependent], B[:, free])
    response = np.linalg.solve(T.T @ (mass[:, None] * T), T.T @ N)
    e = float(wall[eq.E]) if speed >= wall[eq.SLOWEST] else 0.0
    impulse = float((1 + e) * speed / (N @ T @ response))
    after, jump, lost = y.copy(), -impulse * (T @ response), impulse * speed * (1 - e) / 2
    after[size : 2 * size] = v + jump
    if model.of.drive.prescribes:
        multipliers = np.linalg.solve(B[:, dependent].T, (mass * jump + impulse * N)[dependent])
        after[-1] += multipliers[-1] * c[-1]
    ahead = after + SHORTEST_FLIGHT_S * model(t, after)
    leaving = -float(model.contacts_told[k, eq.RATE])
    model(t + SHORTEST_FLIGHT_S, ahead)
    back = float(model.contacts_told[k, eq.RATE]) + leaving
    height = LOWEST * np.spacing(model.lever_m) * back / SHORTEST_FLIGHT_S
    short = 2 * leaving < back or leaving * abs(leaving) < 2 * height
    if e == 0.0 or short:
        raise AdapterCannot(
            f"bounces accumulate at t = {t:.6g} s: pin {name} follows its rigid wall from there on, and the "
            f"model in minimal coordinates has none that does (clearance.{name}.law = 'rigid')"
        )
    after[2 * size + eq.OF_SUMS * k :][:2] += impulse, lost
    return after, (speed, impulse, lost)


def _normal(model: Model, t: float, q: FloatArray, v: FloatArray, k: int) -> FloatArray:
    """Return the row (3b,) of the distance of pin k from its bearing: what a push of 1 N on its wall does."""
    before, F = model.phases.copy(), np.empty((2, model.size))
    told, powers = np.empty(len(model.told)), np.empty(len(model.sums) + 1)
    for row, phase in zip(F, (before[k], (eq.GIVEN, PUSH_N, 0.0)), strict=True):
        model.phases[k] = phase
        eq.forces(model.p, t, q, v, row, told, powers)
    model.phases[:] = before
    return np.asarray((F[0] - F[1]) / PUSH_N)
