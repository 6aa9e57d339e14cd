"""A run of a ``Model`` by one of SciPy's solver classes, from event to event, as a trajectory.

An event is a signal that comes to be positive: a touch or a release, or a law's force that changes its sign.
It is looked for in every step, on the solver's interpolant.
"""

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.integrate import DOP853, LSODA, Radau
from scipy.optimize import brentq

from engine_models.engine import (
    Contact,
    EngineFailed,
    FloatArray,
    Impacts,
    RunSettings,
    SimulationFailed,
    Trajectory,
)
from engine_models.mechanics.impacts import along_steps, largest
from engine_models.mechanics.states import pin_gap
from engine_models.minimal import equations as eq
from engine_models.minimal.equations import CLIPPED, FLIGHT, PUSHED
from engine_models.minimal.model import STEEP, Model, Numbers
from engine_models.minimal.rigid import settle
from engine_models.pace import Pace
from engine_models.progress import tell
from engine_models.scene.scene import Scene

METHODS = {"DOP853": DOP853, "LSODA": LSODA, "Radau": Radau}
#: Absolute tolerance of sums, which takes them out of the error control.
UNCONTROLLED = 1e30
#: Signals that have just been answered are zero to round-off: they count above this, in m or as a share.
NUDGE = 1e-16
#: Coordinates are chosen anew where T has grown by so much since the last choice.
GROWN = 1.5
#: By what part of its largest the determinant of rows has fallen where their condition is looked at, and the
#: condition at which a position is singular.
FALLEN, SINGULAR = 0.2, 1e-4
#: Kinds of events: of a contact, and where a table by an angle or a speed goes from a piece to the next.
TOUCH, SIGN, KINK = range(3)
#: Evaluations after which a run tells how far it has come, and after which its pace is judged.
PAUSE, OUTLASTING = 10_000, 300_000
#: The part of a step behind which the rate of a gap is looked at first.
ASIDE = 1e-6
#: Most corrections of a located event, and the part of the step that slopes are taken over.
CORRECTIONS, DIFFERENCE = 3, 1e-3


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


class Event(NamedTuple):
    """When which signal of which contact has come to be positive, or which kink is passed."""

    time_s: float
    number: int
    kind: int


@dataclass
class Touch:
    """The begin of a contact: time, speed and sums, and (time, force, depth) since."""

    time_s: float
    speed_m_s: float
    sums: FloatArray
    trace: list[tuple[float, float, float]] = field(default_factory=list)


class Run:
    """One run: ``states`` and ``told`` have a row a time, ``impacts`` one for each contact that is over."""

    def __init__(self, model: Model, times_s: FloatArray, choice: Choice) -> None:
        self.scene, self.model, self.times_s, self.choice = model.scene, model, times_s, choice
        self.t: float = 0.0
        self.y: FloatArray = model.start.copy()
        self.states, self.told, self.steps, self.evaluations = list[FloatArray](), list[FloatArray](), 0, 0
        self.impacts: list[list[list[float]]] = [[] for _ in model.phases]
        self._touches = dict[int, Touch]()
        self._atol = np.full(len(self.y), UNCONTROLLED)
        self._atol[: np.size(choice.atol)] = choice.atol
        self._levels = dict[tuple[int, int], float]()
        self._first_step_s: float | None = None
        self._limit_s, self._steep, self._largest = np.inf, STEEP, 0.0
        self._pieces = [kink.piece(self.y) for kink in model.kinks]
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

    def _segment(self, stop: float) -> None:
        """Go on to a stop, or to what ends the segment before: an event, or a choice of coordinates."""
        model, limit = self.model, min(self._limit_s, self.choice.longest_step_s)
        first = None if self._first_step_s is None else min(self._first_step_s, stop - self.t, limit)
        tolerances = {"rtol": self.choice.rtol, "atol": self._atol}
        if not np.isfinite(model(self.t, self.y)).all():  # no first step would be short enough
            raise SimulationFailed(f"non-finite accelerations at t = {self.t:.6g} s")
        solver = METHODS[self.choice.method](
            model, self.t, self.y, stop, max_step=limit, first_step=first, **tolerances
        )
        self._limit_s = np.inf
        model(self.t, self.y)
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
            model(solver.t, solver.y)
            event = self._first_event(solver, t, before)
            self.t, self.y = (
                (solver.t, solver.y.copy()) if event is None else self._located(solver, t, y, event)
            )
            if self.choice.sharp and solver.status == "finished" and event is None:
                self.y, self._largest = model.closed(self.t, self.y), 0.0
            self._record(solver, t)
            if event is not None:
                self._first_step_s = None
                self._answer(event)
                break
            self._first_step_s = solver.step_size
            if self._must_choose(determinant, solver.step_size):
                break
        else:
            self._first_step_s = max(solver.step_size, self._first_step_s or 0.0)
        self.evaluations += solver.nfev

    def _failure(self, message: str | None) -> SimulationFailed:
        if self.model.condition(self.t, self.y) < 10 * SINGULAR:
            return self.model.singular(self.t)
        if message is None:
            reached = f"evaluations came no further than t = {self.t:.6g} s"
            advice = "take a longer step, loosen rtol and atol, or raise max_evaluations"
            return SimulationFailed(f"{self.choice.max_evaluations} {reached}: {advice}")
        return EngineFailed(f"{self.choice.method} stopped at t = {self.t:.6g} s: {message.rstrip('.')}")

    def _must_choose(self, before: float, step_s: float) -> bool:
        """Return whether the solver is to begin anew: with other coordinates, or with a shorter step.

        No step is longer than half the way to where rows would be singular, so that none passes that.
        """
        model, now, steep = self.model, float(self.model.told[-2]), float(self.model.told[-1])
        self._largest = max(self._largest, abs(before))
        if not now / before > 0 or (
            abs(now) < FALLEN * self._largest and model.condition(self.t, self.y) < SINGULAR
        ):
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

    def _signal(self, told: FloatArray, k: int, kind: int) -> float:
        """Return what is positive past an event of contact k, from what was told of it."""
        phase = self.model.phases[k, 0]
        if kind == TOUCH:
            return float(told[k, eq.ROOM] if phase == FLIGHT else -told[k, eq.ROOM])
        return float(-told[k, eq.SHARE] if phase == PUSHED else told[k, eq.SHARE])

    def _above(self, level: float, k: int, kind: int, told: FloatArray) -> float:
        return self._signal(told, k, kind) - level

    def _kinds(self, k: int) -> tuple[int, ...]:
        """Return the kinds of events that contact k can have in its phase."""
        wall, phase = self.model.contacts[k], self.model.phases[k, 0]
        signs = wall[eq.A] > 0.0 if wall[eq.PULLS] == 0.0 else wall[eq.MU] > 0.0 and wall[eq.DRAGS] == 0.0
        return (TOUCH, SIGN) if signs and phase in (PUSHED, CLIPPED) else (TOUCH,)

    def _first_event(self, solver: DOP853, t: float, before: FloatArray) -> Event | None:
        """Return the first event in the last step, on the interpolant."""
        model, now = self.model, self.model.contacts_told.copy()
        events, ways = list[Event](), dict[int, int]()
        for k in range(len(now)):
            flies = model.phases[k, 0] == FLIGHT
            for kind in self._kinds(k):
                level, end = self._levels.get((k, kind), 0.0), solver.t
                past = self._signal(now, k, kind) > level
                rate, rate_now = (told[k, eq.RATE] * (1 if flies else -1) for told in (before, now))
                if not past and kind == TOUCH and rate >= 0.0 > rate_now:
                    begin = t + ASIDE * (end - t)  # a pin at the centre of its bearing has a rate of zero
                    end = self._root(solver, partial(_rate, k), begin, end)
                    past = self._signal(self._told(solver.dense_output(), end), k, kind) > level
                if past:
                    at = self._root(solver, partial(self._above, level, k, kind), t, end)
                    events.append(Event(at, k, kind))
        for number, kink in enumerate(model.kinks if self.choice.sharp else []):
            way = np.sign(kink.piece(solver.y) - self._pieces[number])
            if way:
                edge = kink.begin(self._pieces[number] + (way > 0))
                events.append(Event(self._kink(solver, t, edge, kink.coordinate), number, KINK))
                ways[number] = int(way)
        first = min(events, default=None)
        if first is not None and first.kind == KINK:
            self._pieces[first.number] += ways[first.number]
        return first

    def _kink(self, solver: DOP853, begin: float, at: float, coordinate: int) -> float:
        """Return when in the last step a coordinate passes a value."""
        course = solver.dense_output()
        off = [float(course(t)[coordinate]) - at for t in (begin, solver.t)]
        if off[0] * off[1] >= 0.0:
            return begin if abs(off[0]) < abs(off[1]) else solver.t
        return float(brentq(lambda t: float(course(t)[coordinate]) - at, begin, solver.t, rtol=1e-15))

    def _told(self, course: Callable[[float], FloatArray], t: float) -> FloatArray:
        """Return what is told of contacts at a time within the last step."""
        self.model(t, np.ascontiguousarray(course(t)))
        return self.model.contacts_told

    def _root(self, solver: DOP853, value: Callable[[FloatArray], float], begin: float, end: float) -> float:
        """Return where a value of what is told passes zero in the last step."""
        course = solver.dense_output()

        def at(t: float) -> float:
            return float(value(self._told(course, t)))

        if at(begin) * at(end) >= 0.0:  # it has just been zero
            return begin if abs(at(begin)) <= abs(at(end)) else end
        return float(brentq(at, begin, end, xtol=1e-300, rtol=1e-15))

    def _located(self, solver: DOP853, t: float, y: FloatArray, event: Event) -> tuple[float, FloatArray]:
        """Return time and state of an event; a sharp run takes steps to it until its signal is zero."""
        course, at = solver.dense_output(), event.time_s
        if not self.choice.sharp or at <= t:
            return at, np.ascontiguousarray(course(at))
        _, k, kind = event
        if kind == KINK:
            return at, self._step_to(t, y, at)
        level = self._levels.get((k, kind), 0.0)
        aside = max(t, at - DIFFERENCE * (at - t))
        rise = self._above(level, k, kind, self._told(course, at))
        slope = (rise - self._above(level, k, kind, self._told(course, aside))) / (at - aside)
        state = self._step_to(t, y, at)
        for _ in range(CORRECTIONS):
            self.model(at, state)
            off = self._above(level, k, kind, self.model.contacts_told)
            earlier = at - off / slope if slope > 0.0 else at
            if not t < earlier <= solver.t or abs(earlier - at) <= np.spacing(at):
                break
            at = earlier
            state = self._step_to(t, y, at)
        return at, state

    def _step_to(self, t: float, y: FloatArray, end: float) -> FloatArray:
        """Return the state at a time within the last step, by the method itself."""
        solver = METHODS[self.choice.method](
            self.model, t, y, end, rtol=self.choice.rtol, atol=self._atol, first_step=end - t
        )
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise self._failure(message)
        self.evaluations += solver.nfev
        return np.asarray(solver.y)

    def _record(self, solver: DOP853, begin: float) -> None:
        """Record the samples between the begin of the last step and the time reached, and trace contacts."""
        due = self.times_s[len(self.states) :]
        due = due[due <= self.t]
        traced = self._touches and not (self.choice.sharp or self.choice.bare)
        course = solver.dense_output() if len(due) or traced else None
        for t in due.tolist():
            assert course is not None
            self._sample(self.y if t == self.t else np.ascontiguousarray(course(t)))
        if traced:
            assert course is not None
            for t in along_steps(np.zeros(0), begin, self.t).tolist():
                told = self._told(course, t)
                for k, touch in self._touches.items():
                    if touch.trace and t <= touch.trace[-1][0]:
                        continue
                    touch.trace.append((t, told[k, eq.NORMAL], self._depth(told, k)))

    def _depth(self, told: FloatArray, k: int) -> float:
        c, room = self.model.contacts[k, eq.C], told[k, eq.ROOM]
        return float(2 * c * room / (c + np.sqrt(c * c + 2 * c * room)))

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
        model(self.t, self.y)
        for k in range(len(model.phases)):
            for kind in self._kinds(k):
                is_event = event is not None and (k, kind) == event[1:]
                if not is_event and not self._signal(model.contacts_told, k, kind) > NUDGE:
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
                    now = self._signal(model.contacts_told, k, each)
                    self._levels[k, each] = max(now, 0.0) * (1 + 1e-15) + NUDGE
                self._largest = 0.0
                break

    def _clip(self, y: FloatArray, k: int, sign: float) -> None:
        """Add what a contact stores to what clipping loses: all of it, from then on less what is left."""
        wall, depth = self.model.contacts[k], max(self._depth(self.model.contacts_told, k), 0.0)
        stored = wall[eq.K] * depth ** (wall[eq.N] + 1) / (wall[eq.N] + 1)
        y[2 * self.model.size + eq.OF_SUMS * k + 2] += sign * stored * (wall[eq.PULLS] == 0.0)

    def _sums(self, k: int) -> FloatArray:
        first = 2 * self.model.size + eq.OF_SUMS * k
        return np.array(self.y[first : first + eq.OF_SUMS])

    def _touch(self, k: int) -> None:
        model, wall, told = self.model, self.model.contacts[k], self.model.contacts_told[k]
        speed = float(told[eq.RATE] * wall[eq.C] / (wall[eq.C] + self._depth(self.model.contacts_told, k)))
        model.phases[k] = PUSHED, wall[eq.A] / max(speed, wall[eq.SLOWEST]), 0.0
        self._touches[k] = Touch(self.t, speed, self._sums(k))
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


def _rate(k: int, told: FloatArray) -> float:
    return float(told[k, eq.RATE])


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
    trajectory = trajectory_of(run, time.perf_counter() - began)
    trajectory.position[..., 2] += model.turns_rad
    return trajectory


class Recorded(Protocol):
    """Rows of states (q, v, sums) and of what ``equations.rates`` tells of them, and impacts."""

    scene: Scene
    times_s: FloatArray
    states: list[FloatArray]
    told: list[FloatArray]
    steps: int
    impacts: list[list[list[float]]]

    @property
    def model(self) -> Numbers:
        """The mechanism's numbers."""


def trajectory_of(run: Recorded, took_s: float) -> Trajectory:
    """Return what a run has recorded."""
    model, of, scene = run.model, run.model.of, run.scene
    y, told = np.array(run.states), np.array(run.told)
    n, size = len(y), model.size
    position, velocity = y[:, :size].reshape(n, -1, 3), told[:, :size].reshape(n, -1, 3)
    multipliers, told_of = told[:, 2 * size :], told[:, 2 * size + model.rows + len(model.phases) :]
    sums: dict[Any, FloatArray] = dict(zip(model.sums, y[:, 2 * size :].T, strict=True))
    parts = told_of[:, eq.OF_CONTACT * len(model.phases) :]
    by_contact = told_of[:, : eq.OF_CONTACT * len(model.phases)].reshape(n, -1, eq.OF_CONTACT)
    forces, across, moments, contacts, row = {}, {}, {}, {}, 0
    for pin in of.ideal:
        forces[pin.name], row = multipliers[:, row : row + 2], row + 2
    for guide in of.guides:
        across[guide.name], row = multipliers[:, row], row + 1
        if not guide.turns:
            moments[guide.name], row = multipliers[:, row], row + 1
    for k, pin in enumerate(of.loose):
        contact = contact_of(model, k, position, by_contact[:, k], sums, run.impacts[k])
        normal = contact.gap_m / np.maximum(np.hypot(*contact.gap_m.T), 1e-300)[:, None]
        left = np.stack([-normal[:, 1], normal[:, 0]], axis=-1)
        force = -by_contact[:, k, eq.NORMAL, None] * normal + by_contact[:, k, eq.FRICTION, None] * left
        contacts[pin.name], forces[pin.name] = contact, -force if pin.bearing_on_j else force
    effort = None
    if of.drive.prescribes:
        effort = multipliers[:, row]
    elif of.drive.law is not None:
        effort = parts[:, model.parts.index("driver")]
    short = "slider." if scene.is_short else ""
    undamped = {f"spring:{spring.name}" for spring in of.springs if not spring.damping_N_s_m}
    works = [name for name in model.parts if name not in {"driver", *undamped}]
    return Trajectory(
        time_s=run.times_s,
        position=position,
        velocity=velocity,
        joint_force_N={pin.name: forces[pin.name] for pin in of.pins},
        guide_force_N=across,
        guide_moment_N_m=moments,
        driver_torque_N_m=effort,
        driver_work_J=sums.get("driver"),
        step_s=float(run.times_s[-1]) / run.steps,
        steps=run.steps,
        solve_time_s=took_s,
        contacts=contacts,
        load_work_J={name.removeprefix(short): sums[name] for name in works},
    )


def contact_of(
    model: Numbers,
    k: int,
    position: FloatArray,
    told: FloatArray,
    sums: Mapping[Any, FloatArray],
    impacts: list[list[float]],
) -> Contact:
    """Return what contact k did, from the bodies' positions and what was told of it, (n, 6)."""
    pin, wall = model.of.loose[k], model.contacts[k]
    room = pin.clearance
    assert room is not None
    gap = pin_gap(pin, position, np.zeros_like(position)).gap_m
    depth = np.hypot(*gap.T) - wall[eq.C]
    own = {name: sums[pin.name, name] for name in ("normal_impulse_N_s", "normal_loss_J")}
    rubs, clips = room.friction is not None, wall[eq.A] > 0 and not room.may_pull
    order = sorted(impacts, key=lambda impact: impact[0])
    return Contact(
        gap_m=gap,
        penetration_m=depth,
        normal_force_N=told[:, eq.NORMAL],
        friction_force_N=told[:, eq.FRICTION] if rubs else None,
        elastic_energy_J=wall[eq.K] * np.maximum(depth, 0.0) ** (wall[eq.N] + 1) / (wall[eq.N] + 1),
        friction_loss_J=sums[pin.name, "friction_loss_J"] if rubs else None,
        clipped_loss_J=sums[pin.name, "clipped_loss_J"] if clips else None,
        impacts=Impacts(*np.reshape(order, (-1, 9)).T),
        **own,
    )
