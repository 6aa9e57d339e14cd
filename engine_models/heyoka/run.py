"""A run by heyoka from event to event: its own calls, and states handed on between its integrators."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import numpy as np

from engine_models.engine import AdapterCannot, EngineFailed, FloatArray, SimulationFailed
from engine_models.heyoka.drafts import Event
from engine_models.heyoka.series import Series
from engine_models.heyoka.systems import Beyond, System, Systems
from engine_models.mechanics.equations.partition import SingularPosition
from engine_models.pace import Pace
from engine_models.progress import tell
from engine_models.scene.parts import AnyScene

#: Steps after which a run tells how far it has come, and after which its pace is judged.
PAUSE, OUTLASTING = 10_000, 30_000
#: The end of an independent variable whose end is an event's.
NEVER = 1e300
#: How an integration ends that no event has ended: at the end of the run, or without a finite state.
ENDED, LOST = hy.taylor_outcome.time_limit, hy.taylor_outcome.err_nf_state


@dataclass(frozen=True)
class Piece:
    """What one integrator did: to an event, to the end of the run, or for ``PAUSE`` steps.

    ``series`` is a function of the system's own variable; ``pars`` and ``end`` are its parameters, and its
    state at the end; ``number`` is that of the event among the system's, and beyond them without one.
    """

    system: System
    pars: FloatArray
    series: Series
    end: FloatArray
    number: int

    @property
    def event(self) -> Event | None:
        """The event that has ended it, if one has."""
        return self.system.events[self.number] if self.number < len(self.system.events) else None


class Flight:
    """A run of a scene by its integrators, in steps up to the longest; ``steps`` counts those so far.

    The integrators are at the start once it is made, and run for one flight at a time. ``system`` is the one
    that runs, or has run last.
    """

    def __init__(self, scene: AnyScene, systems: Systems, longest_s: float, max_steps: int) -> None:
        self._scene, self._systems = scene, systems
        self._longest_s, self._max_steps = longest_s, max_steps
        self._pace, self.steps = Pace(scene, OUTLASTING), 0
        try:
            self.system = systems.begin()
        except (Beyond, SingularPosition) as reason:
            raise AdapterCannot(f"heyoka's model does not begin: {reason}") from None

    def run(self, take: Callable[[Piece], None] | None = None) -> None:
        """Run to the end; pieces are made for who is to ``take`` them, if anybody.

        Raises:
            SimulationFailed: the state is no longer finite, the steps are too many, or rigid walls have come
                to what the model has no rule for.
        """
        systems, options = self._systems, dict[str, Any]()
        until, most = NEVER if systems.timed else self._scene.end_time_s, min(PAUSE, self._max_steps)
        try:
            following: System | None = self.system
            while following is not None:
                self.system = system = following
                if take is not None:
                    series, pars = Series(system.integrator.time), system.pars.copy()
                    options = {"callback": series, "write_tc": True}
                longest = np.inf if system.stretched else self._longest_s
                ended, _, _, taken, _, _ = system.integrator.propagate_until(until, most, longest, **options)
                self.steps += taken
                number = ~int(ended)  # of the event, as heyoka counts them
                if take is not None:
                    take(Piece(system, pars, series, system.state.copy(), number))
                    tell(system.time_s)
                if number >= len(system.ways) or self.steps >= self._max_steps:
                    following = self._paused(system, ended)
                else:
                    way = system.ways[number] or systems.way(system, number)
                    following = way()
        except (Beyond, SingularPosition) as reason:
            at = f"t = {self.system.time_s:.6g} s"
            raise AdapterCannot(f"heyoka's model ends at {at}: {reason}") from None

    def position(self) -> FloatArray:
        """Return the bodies' coordinates at the end of what has been run, (b, 3)."""
        system = self.system
        (row,) = system.told((), system.state[None], system.pars)
        return np.asarray(row[: 3 * len(self._scene.mechanism.bodies)]).reshape(-1, 3)

    def _paused(self, system: System, ended: Any) -> System | None:
        """Return the system that goes on where no event has been, None at the end of the run."""
        t = system.time_s
        if ended == ENDED:
            return None
        if ended == LOST or not np.isfinite(system.state).all():
            raise EngineFailed(f"heyoka stopped at t = {t:.6g} s: non-finite state")
        if self.steps >= self._max_steps:
            raise SimulationFailed(
                f"{self.steps} steps came no further than t = {t:.6g} s: "
                "loosen step_tolerance, or raise max_steps"
            )
        tell(t)
        self._pace.judge(t, self.steps)
        return system
