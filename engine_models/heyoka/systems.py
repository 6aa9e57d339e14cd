"""heyoka's integrators of a scene, one for every combination of its contacts' phases, and ways between them.

All that a run needs from event to event is compiled by heyoka: the integrators, and functions of the state at
an event that return the state from which the next integrator goes on.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import heyoka as hy
import numpy as np

from engine_models.engine import FloatArray
from engine_models.heyoka.drafts import CLIP, HIGHER, LOWER, OVER, PAST, TOUCH, Draft, Event
from engine_models.heyoka.equations import Motion, Phases
from engine_models.heyoka.pieces import Knots, drive_of, gas_of
from engine_models.heyoka.series import Series
from engine_models.mechanics.crank_motion import expected_speeds_rad_s
from engine_models.mechanics.minimal.tree import THETA, Tree
from engine_models.mechanics.start_check import checked_start
from engine_models.reference.model import mechanism_of
from engine_models.scene.scene import Scene
from reference_solver.contact.types import CLIPPED, CONTACT, FLIGHT

#: Bounces between rigid walls have come together where a flight takes no longer than this part of what the
#: crank takes for a radian: it is some 1e-13 m high.
SHORTEST = 1e-5
#: Powers of every period in which series at touch have terms.
POWERS = 3
#: Pins that hit rigid walls are told apart by so many times the part of a length that ``PAST`` is.
TOGETHER = 32.0
#: By how many pieces of the gas an event goes on.
TURNED = {HIGHER: 1, LOWER: -1}


class Beyond(Exception):
    """What the model of rigid walls has no rule for; the message says what."""


def without_gaps(tolerance: float, periods: Sequence[int]) -> float:
    """Return the largest tolerance, up to one given, whose order is in no gap of the series at a touch.

    There the series of a contact whose force is K w^2n have the powers 0, 1 and 2 of every period, 2n + 2,
    and next to nothing in between. heyoka takes the step from the last two terms, of the order
    -ln(tolerance)/2 + 1 and the one before: in a gap it would be too long.
    """
    while any(math.ceil(1 - math.log(tolerance) / 2) % period > POWERS for period in periods):
        tolerance /= math.e**2
    return tolerance


@dataclass
class System:
    """An integrator, by the phases of its contacts; ``state`` and ``pars`` are views of what is in it.

    Where there are contacts the time is the last variable, else it is the integrator's own. ``ways`` has for
    every one of ``events`` what makes the next system ready and returns it, or None at the end of the run;
    what is not made yet is None itself. ``stretched`` says that the independent variable does not run as the
    time does: pins touch walls that give. ``alarm`` is the draft's ``alarms`` as a function of the state.
    """

    draft: Draft
    integrator: Any
    events: list[Event]
    state: FloatArray = field(init=False)
    pars: FloatArray = field(init=False)
    ways: list[Callable[[], "System | None"] | None] = field(init=False)
    stretched: bool = field(init=False)
    alarm: Callable[[FloatArray], Any] | None = field(init=False, default=None)
    _told: dict[tuple[str, ...], Any] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Take the views."""
        self.state, self.pars = self.integrator.state, self.integrator.pars
        self.ways, self.stretched = [None] * len(self.events), self.draft.stretched

    @property
    def phases(self) -> Phases:
        """The phases of its contacts."""
        return self.draft.phases

    @property
    def time_s(self) -> float:
        """The time that the integrator has reached."""
        return float(self.state[-1] if self.phases else self.integrator.time)

    def clock(self, series: Series, own: FloatArray) -> FloatArray:
        """Return the times in s of values of the independent variable, (n,) each."""
        return series.at(own)[:, -1] if self.phases else own

    def told(self, names: Sequence[str], states: FloatArray, pars: FloatArray) -> FloatArray:
        """Return rows of q, v, powers by name, and dt/ds, of states (n, size), in a piece's parameters."""
        key = tuple(names)
        if key not in self._told:
            self._told[key] = hy.cfunc(self.draft.told(key), vars=[*self.draft.variables.values()])
        function, columns = self._told[key], np.ascontiguousarray(states.T)
        if function.nparams:
            of_all = np.ascontiguousarray(np.tile(pars[: function.nparams, None], len(states)))
            return np.array(function(columns, pars=of_all).T)
        return np.array(function(columns).T)

    def resume(self) -> "System":
        """Make the integrator ready to go on with other parameters."""
        if self.events:
            self.integrator.reset_cooldowns()
        return self


class Restart:
    """Goes from the state of one system to that of the next."""

    def __init__(self, old: System, new: System, function: Callable[[FloatArray], FloatArray]) -> None:
        self._old, self._new, self._function, self._integrator = old, new, function, new.integrator
        self._pars = None if new is old else old.pars

    def __call__(self) -> System:
        """Return the next system, which has come into its state."""
        new, integrator = self._new, self._integrator
        new.state[:] = self._function(self._old.state)
        if self._pars is not None:
            new.pars[:] = self._pars
        integrator.time = 0.0
        integrator.reset_cooldowns()
        return new


class Bounce:
    """An impact at a rigid wall; the pin flies on, or follows where bounces have come together."""

    def __init__(self, rebound: Restart, close: Callable[[], System], shortest_s: float) -> None:
        self._rebound, self._close, self._shortest_s = rebound, close, shortest_s
        self.last_s = -np.inf

    def __call__(self) -> System:
        """Return the next system."""
        system = self._rebound()
        before, self.last_s = self.last_s, system.state[-1]
        return system if self.last_s - before > self._shortest_s else self._close()


class Systems:
    """The integrators of a scene at a tolerance, made when they are first asked for.

    ``compiled_s`` is how long that has taken so far.
    """

    def __init__(self, scene: Scene, tolerance: float) -> None:
        q, v = checked_start(scene)
        self.mechanism, self._tolerance = mechanism_of(scene), tolerance
        tree, self._angle = Tree(self.mechanism), float(q[THETA // 3, 2])
        names = [f"{of}{place}" for of in "zu" for place in tree.coordinates]
        self._start = dict(zip(names, tree.start(q.ravel(), v.ravel()).tolist(), strict=True))
        self._past_m = PAST * sum(link.length_m for link in (scene.crank, scene.rod) if link)
        falling = np.sqrt(scene.weight_m_s2 / scene.crank.length_m)
        quickest = max(float(np.abs(expected_speeds_rad_s(scene)).max()), falling)
        self._shortest_s = SHORTEST / quickest if quickest else 0.0
        self._drive, self._gas = drive_of(self.mechanism), gas_of(self.mechanism)
        self._knots = Knots(self._drive, self._gas, scene.end_time_s, self.timed)
        self._made, self._bounces = dict[Phases, System](), list[Bounce]()
        self.compiled_s, self._compiling = 0.0, False

    @property
    def timed(self) -> bool:
        """Whether the time is a variable, whose end is an event's."""
        return bool(self.mechanism.contacts)

    def begin(self) -> System:
        """Return the system that a run begins with, in its state."""
        for bounce in self._bounces:
            bounce.last_s = -np.inf
        system = self._of((FLIGHT,) * len(self.mechanism.contacts))
        reaches = {
            f"reach{k}": (joint.radial_clearance_m + self._past_m) ** 2
            for k, joint in enumerate(self.mechanism.contacts)
        }
        known = {**self._start, **reaches, "time": 0.0}
        system.integrator.time = 0.0
        system.state[:] = [known[name] for name in system.draft.names]
        self._knots.begin(system.pars, self._angle)
        return self._settled(system.resume(), (TOUCH, CLIP))

    def way(self, system: System, number: int) -> Callable[[], System | None]:
        """Return what makes the system ready that follows one of the events of a system.

        Raises:
            Beyond: the model has no rule for it.
        """
        if system.ways[number] is None:
            with self._timed():
                system.ways[number] = self._way(system, system.events[number])
        way = system.ways[number]
        assert way is not None
        return way

    @contextmanager
    def _timed(self) -> Iterator[None]:
        """Add what is compiled in this block to the time that compiling has taken."""
        began, inner, self._compiling = time.perf_counter(), self._compiling, True
        yield
        self._compiling = inner
        if not inner:
            self.compiled_s += time.perf_counter() - began

    def _of(self, phases: Phases) -> System:
        """Return the integrator of contacts in these phases."""
        if phases not in self._made:
            with self._timed():
                self._made[phases] = self._make(phases)
        return self._made[phases]

    def _make(self, phases: Phases) -> System:
        pieces = {"drive": self._drive, "gas": self._gas}
        terms = {of: one.terms for of, one in pieces.items() if one is not None}
        draft = Draft(Motion(self.mechanism, self._angle, phases, terms), self._past_m)
        alarms = {**draft.alarms, **draft.stops()}
        rising = hy.event_direction.positive
        integrator = hy.taylor_adaptive(
            draft.flow(),
            [0.0] * len(draft.names),
            tol=without_gaps(self._tolerance, draft.periods),
            t_events=[hy.t_event(value, direction=rising) for value in alarms.values()],
            fast_math=True,  # a third less time without contacts, as accurate to the last digit but one
        )
        return System(draft, integrator, [*alarms])

    def _way(self, system: System, event: Event) -> Callable[[], System | None]:
        kind, k = event
        if kind == OVER:
            return lambda: system.resume() if self._knots.pass_time(system.pars) else None
        if kind in TURNED:
            return partial(self._turned, system, TURNED[kind])
        joint, phases = self.mechanism.contacts[k], system.phases
        if joint.rigid:
            return self._at_rigid_wall(system, k)
        if kind == CLIP:
            after = CLIPPED if phases[k] == CONTACT else CONTACT
        else:
            after = CONTACT if phases[k] == FLIGHT else FLIGHT
        return self._then_settled(self._restart(system, (*phases[:k], after, *phases[k + 1 :]), event))

    def _turned(self, system: System, by: int) -> System:
        self._knots.pass_angle(system.pars, by)
        return system.resume()

    def _at_rigid_wall(self, system: System, k: int) -> Callable[[], System]:
        event, joint, phases = (TOUCH, k), self.mechanism.contacts[k], system.phases
        held = [j for j, phase in enumerate(phases) if self.mechanism.contacts[j].rigid and phase != FLIGHT]
        closed, open_ = ((*phases[:k], phase, *phases[k + 1 :]) for phase in (CONTACT, FLIGHT))
        if k in held:
            return self._then_settled(self._restart(system, open_, event, 0.0))
        if held:
            raise Beyond("a pin hits its rigid wall while another follows its own")
        rebound = self._restart(system, phases, event, joint.wall.restitution)
        close = cache(partial(self._closing, system, closed, event))
        bounce = Bounce(rebound, lambda: self._settled(close()()), self._shortest_s)
        self._bounces.append(bounce)
        others = [j for j, one in enumerate(self.mechanism.contacts) if one.rigid and j != k]
        if not others:
            return self._then_settled(bounce)
        depths = system.draft.compiled(system.draft.approaching(others), system.pars)

        def alone() -> System:
            if depths(system.state).max() > -TOGETHER * self._past_m:
                raise Beyond("two pins hit their rigid walls at one time")
            return self._settled(bounce())

        return alone

    def _closing(self, system: System, phases: Phases, event: Event) -> Restart:
        """Return what has a pin follow its wall, without its normal speed."""
        with self._timed():
            return self._restart(system, phases, event, 0.0)

    def _restart(
        self, system: System, phases: Phases, event: Event, restitution: float | None = None
    ) -> Restart:
        to, draft = self._of(phases), system.draft
        return Restart(system, to, draft.compiled(draft.restart(to.draft, event, restitution), system.pars))

    def _then_settled(self, restart: Callable[[], System]) -> Callable[[], System]:
        """Return the same, followed where there are more pins by what is due at the same time."""
        return restart if len(self.mechanism.contacts) == 1 else lambda: self._settled(restart())

    def _settled(self, system: System, kinds: Sequence[int] = (TOUCH,)) -> System:
        """Return the system after all events that are due at its start."""
        while (event := self._due(system, kinds)) is not None:
            if self.mechanism.contacts[event[1]].rigid and system.phases[event[1]] == FLIGHT:
                raise Beyond("a pin is at its rigid wall at the start, or as another touches")
            following = self.way(system, system.events.index(event))()
            assert following is not None
            system = following
        return system

    def _due(self, system: System, kinds: Sequence[int]) -> Event | None:
        """Return the first event of some kinds that has come, or would begin at zero, None without one."""
        alarms = system.draft.alarms
        if not alarms:
            return None
        if system.alarm is None:
            with self._timed():
                system.alarm = system.draft.compiled([*alarms.values()], system.pars)
        values = zip(alarms, system.alarm(system.state).tolist(), strict=True)
        return next((event for event, value in values if value >= 0 and event[0] in kinds), None)
