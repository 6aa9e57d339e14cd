"""heyoka's integrators of a scene, one for every combination of its contacts' phases, and ways between them.

All that a run needs from event to event is compiled by heyoka: the integrators, and functions of the state at
an event that return the state from which the next integrator goes on.
"""

import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property, partial
from typing import Any

import heyoka as hy
import numpy as np

from engine_models.engine import FloatArray, RunSettings
from engine_models.heyoka.drafts import CLIP, HIGHER, LOWER, OVER, PAST, SMALL_STEP, TOUCH, Draft, Event
from engine_models.heyoka.equations import Motion, Phases
from engine_models.heyoka.pieces import Knots, in_pieces
from engine_models.heyoka.series import Series
from engine_models.mechanics.equations.mechanism import mechanism_of
from engine_models.mechanics.equations.partition import SMALL, Partition, choose_partition
from engine_models.mechanics.equations.structure import structure_of
from engine_models.mechanics.equations.tree import Tree
from engine_models.mechanics.start_check import checked_start
from engine_models.mechanics.states import lever_m
from engine_models.scene.parts import AnyScene
from reference_solver.contact.types import CLIPPED, CONTACT, FLIGHT
from reference_solver.mechanism.mechanism import ClearanceJoint

#: Bounces between rigid walls have come together where a flight takes no longer than this part of what the
#: quickest body takes for a radian: it is some 1e-13 m high.
SHORTEST = 1e-5
#: Powers of every period in which series at touch have terms.
POWERS = 3
#: Pins that hit rigid walls are told apart by so many times the part of a length that ``PAST`` is.
TOGETHER = 32.0
#: By how many pieces of a function an event goes on.
TURNED = {HIGHER: 1, LOWER: -1}


#: A function of a system's state.
OfState = Callable[[FloatArray], Any]


class Beyond(Exception):
    """What the model has no rule for; the message says what."""


def without_gaps(tolerance: float, periods: Sequence[int]) -> float:
    """Return the largest tolerance, up to one given, whose order is in no gap of the series at a touch.

    There the series of a contact whose force is K w^2n have the powers 0, 1 and 2 of every period, 2n + 2,
    and next to nothing in between. heyoka takes the step from the last two terms, of the order
    -ln(tolerance)/2 + 1 and the one before: in a gap it would be too long.
    """
    while any(math.ceil(1 - math.log(tolerance) / 2) % period > POWERS for period in periods):
        tolerance /= math.e**2
    return tolerance


class System:
    """An integrator, by the phases of its contacts; ``state`` and ``pars`` are views of what is in it.

    If it is ``timed`` the time is the last variable, else it is the integrator's own. ``ways`` has for
    every one of ``events`` what makes the next system ready and returns it, or None at the end of the run;
    what is not made yet is None itself. ``stretched`` says that the independent variable does not run as the
    time does: pins touch walls that give.
    """

    def __init__(self, draft: Draft, integrator: Any) -> None:
        self.draft, self.integrator = draft, integrator
        self.state, self.pars = integrator.state, integrator.pars
        self.phases, self.stretched, self.timed = draft.phases, draft.stretched, "time" in draft.names
        self.events: list[Event] = [*draft.events]
        self.ways: list[Callable[[], System | None] | None] = [None] * len(self.events)
        variables = [*draft.variables.values()]
        self._told = cache(lambda names: hy.cfunc(draft.told(names), vars=variables))

    def compiled(self, values: Sequence[hy.expression]) -> OfState:
        """Return expressions as a function of the state, with the parameters at the time of the call."""
        function = hy.cfunc(values, vars=[*self.draft.variables.values()])
        return partial(function, pars=self.pars) if function.nparams else function

    @cached_property
    def alarm(self) -> OfState:
        """The draft's ``alarms``."""
        return self.compiled([*self.draft.alarms.values()])

    @cached_property
    def determinants(self) -> OfState:
        """Those of the steps that are watched."""
        return self.compiled(self.draft.determinants)

    @property
    def time_s(self) -> float:
        """The time that the integrator has reached."""
        return float(self.state[-1] if self.timed else self.integrator.time)

    def clock(self, series: Series, own: FloatArray) -> FloatArray:
        """Return the times in s of values of the independent variable, (n,) each."""
        return series.at(own)[:, -1] if self.timed else own

    def told(self, names: Sequence[str], states: FloatArray, pars: FloatArray) -> FloatArray:
        """Return rows of q, v, powers by name, and dt/ds, of states (n, size), in a piece's parameters."""
        function, columns = self._told(tuple(names)), np.ascontiguousarray(states.T)
        of_all = np.tile(pars[: function.nparams, None], len(states))
        return np.array(function(columns, **({"pars": of_all} if function.nparams else {})).T)

    def resume(self) -> "System":
        """Make the integrator ready to go on with other parameters."""
        if self.events:
            self.integrator.reset_cooldowns()
        return self


class Restart:
    """Goes from the state of one system to that of the next."""

    def __init__(self, old: System, new: System, function: OfState) -> None:
        self._old, self._new, self._function, self._integrator = old, new, function, new.integrator
        #: What both have in common: of another partition there are other levels, at the end.
        levels = 0 if new.draft.partition == old.draft.partition else len(old.draft.partition.watched)
        common = 0 if new is old else len(old.pars) - levels
        self._own_pars, self._old_pars = new.pars[:common], old.pars[:common]

    def __call__(self) -> System:
        """Return the next system, which has come into its state."""
        new, integrator = self._new, self._integrator
        new.state[:] = self._function(self._old.state)
        self._own_pars[:] = self._old_pars
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
    """The integrators of a scene at a tolerance, compiled when a run first asks for them.

    ``run_with`` has the settings of the runs that have been: to go through one again compiles nothing.
    """

    def __init__(self, scene: AnyScene, tolerance: float) -> None:
        q, v = (of.ravel() for of in checked_start(scene))
        self.mechanism, self._tables = in_pieces(mechanism_of(scene))
        self._tolerance, self._q, self._v = tolerance, q, v
        self._structure = structure_of(self.mechanism, q)
        self._tree = Tree(self._structure, self.mechanism, q)
        self._u, self._rates = self._tree.coordinates(q, v)
        self._past_m = PAST * max([*map(self._length, self.mechanism.contacts), lever_m(scene)])
        falling = math.sqrt(math.hypot(*scene.gravity) / lever_m(scene))
        fastest = [motion.fastest for motion in self.mechanism.prescribed]
        quickest = max(np.abs(v[2::3]).max(), falling, *fastest)
        self._shortest_s = SHORTEST / quickest if quickest else 0.0
        self._knots = Knots(self._tables, scene.end_time_s, self.timed)
        #: The integrator of a partition and of contacts in phases.
        self._of, self._bounces = cache(self._make), list[Bounce]()
        self.run_with = set[RunSettings]()

    def _length(self, joint: ClearanceJoint) -> float:
        """Return how long in m the arms between a bearing and its pin are, or a way there at the start."""
        terms = self._tree.gap(joint).items()
        ways = [float(abs(self._u[way])) for (_, way), _ in terms if way is not None]
        return max(sum(math.hypot(*arm) for (_, way), arm in terms if way is None), *ways, 0.0)

    @property
    def timed(self) -> bool:
        """Whether the time is a variable, whose end is an event's."""
        by_time = any(table.of is None for table in self._tables)
        return bool(self.mechanism.contacts) or by_time or self._structure.driven is not None

    def begin(self) -> System:
        """Return the system that a run begins with, in its state.

        Raises:
            SingularPosition: it is at one.
            Beyond: it is at a rigid wall.
        """
        for bounce in self._bounces:
            bounce.last_s = -np.inf
        system = self._of(choose_partition(self._tree, self._u), (FLIGHT,) * len(self.mechanism.contacts))
        known = {f"z{k}": value for k, value in enumerate(self._u)}
        known |= {f"u{k}": value for k, value in enumerate(self._rates)}
        for k, joint in enumerate(self.mechanism.contacts):
            known[f"reach{k}"] = (joint.radial_clearance_m + self._past_m) ** 2
        known["time"] = system.integrator.time = 0.0
        system.state[:] = [known[name] for name in system.draft.names]
        self._knots.begin(system.pars, self._q, self._v)
        self._set_levels(system)
        return self._settled(system.resume(), (TOUCH, CLIP))

    def _set_levels(self, system: System) -> None:
        """Set the levels down to which determinants may fall, by what they are now."""
        if count := len(system.draft.partition.watched):
            system.pars[-count:] = SMALL * system.determinants(system.state)

    def way(self, system: System, number: int) -> Callable[[], System | None]:
        """Return what makes the system ready that follows one of the events of a system.

        Raises:
            Beyond: the model has no rule for it.
        """
        way = system.ways[number] = system.ways[number] or self._way(system, system.events[number])
        return way

    def _make(self, partition: Partition, phases: Phases) -> System:
        of = self._structure, partition, self.mechanism, self._tables, self._q, phases, self._knots
        draft = Draft(Motion(*of), self._past_m)
        rising = hy.event_direction.positive
        integrator = hy.taylor_adaptive(
            draft.flow(),
            [0.0] * len(draft.names),
            tol=without_gaps(self._tolerance, draft.periods),
            t_events=[hy.t_event(value, direction=rising) for value in draft.events.values()],
            fast_math=True,  # a third less time without contacts, as accurate to the last digit but one
        )
        return System(draft, integrator)

    def _way(self, system: System, event: Event) -> Callable[[], System | None]:
        kind, k = event
        if kind == OVER:
            return lambda: system.resume() if self._knots.pass_time(system.pars) else None
        if kind in TURNED:
            return self._turned(system, k, TURNED[kind])
        if kind == SMALL_STEP:
            return self._rearranging(system, event)
        joint, phases = self.mechanism.contacts[k], system.phases
        if joint.rigid:
            return self._at_rigid_wall(system, k)
        if kind == CLIP:
            after = CLIPPED if phases[k] == CONTACT else CONTACT
        else:
            after = CONTACT if phases[k] == FLIGHT else FLIGHT
        return self._then_settled(self._restart(system, (*phases[:k], after, *phases[k + 1 :]), event))

    def _turned(self, system: System, k: int, by: int) -> Callable[[], System]:
        """Return what goes on with another piece of a function."""
        own, go_on = system.pars[self._knots.places[k]], self._knots.walks[k].go_on

        def turned() -> System:
            go_on(own, by)
            return system.resume()

        return turned

    def _rearranging(self, system: System, event: Event) -> Callable[[], System]:
        """Return what goes on with coordinates that are independent where the system is."""
        coordinates = system.compiled(system.draft.coordinates)

        @cache
        def restart(partition: Partition) -> Restart:
            to = self._of(partition, system.phases)
            return Restart(system, to, system.compiled(system.draft.restart(to.draft, event)))

        def rearrange() -> System:
            u, own = coordinates(system.state)[: len(self._u)], system.integrator.time
            new = restart(choose_partition(self._tree, u.tolist()))()
            if not self.timed:
                new.integrator.time = own
            self._set_levels(new)
            return new

        return rearrange

    def _at_rigid_wall(self, system: System, k: int) -> Callable[[], System]:
        event, joint, phases = (TOUCH, k), self.mechanism.contacts[k], system.phases
        held = [j for j, phase in enumerate(phases) if self.mechanism.contacts[j].rigid and phase != FLIGHT]
        closed, open_ = ((*phases[:k], phase, *phases[k + 1 :]) for phase in (CONTACT, FLIGHT))
        if k in held:
            return self._then_settled(self._restart(system, open_, event, 0.0))
        if held:
            raise Beyond("a pin hits its rigid wall while another follows its own")
        rebound = self._restart(system, phases, event, joint.wall.restitution)
        close = cache(partial(self._restart, system, closed, event, 0.0))
        bounce = Bounce(rebound, lambda: self._settled(close()()), self._shortest_s)
        self._bounces.append(bounce)
        others = [j for j, one in enumerate(self.mechanism.contacts) if one.rigid and j != k]
        if not others:
            return self._then_settled(bounce)
        depths = system.compiled(system.draft.approaching(others))

        def alone() -> System:
            if depths(system.state).max() > -TOGETHER * self._past_m:
                raise Beyond("two pins hit their rigid walls at one time")
            return self._settled(bounce())

        return alone

    def _restart(
        self, system: System, phases: Phases, event: Event, restitution: float | None = None
    ) -> Restart:
        to = self._of(system.draft.partition, phases)
        return Restart(system, to, system.compiled(system.draft.restart(to.draft, event, restitution)))

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
        values = zip(alarms, system.alarm(system.state).tolist(), strict=True)
        return next((event for event, value in values if value >= 0 and event[0] in kinds), None)
