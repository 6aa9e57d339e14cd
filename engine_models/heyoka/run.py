"""A run by heyoka from event to event; samples and integrals are read off its Taylor series afterwards."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from engine_models.engine import EngineFailed, FloatArray, SimulationFailed
from engine_models.heyoka.systems import Event, System, Systems
from engine_models.mechanics.impacts import along_steps
from engine_models.pace import Pace
from engine_models.progress import tell
from engine_models.scene.scene import Scene
from engine_models.scipy_ivp.model import Derivative
from engine_models.scipy_ivp.run import Record

#: Steps after which a run tells how far it has come, and after which its pace is judged.
PAUSE, OUTLASTING = 10_000, 30_000
#: The end of an independent variable whose end is an event's.
NEVER = 1e300
#: A flight begins at the wall but for the error of its release, and heyoka may lose all roots of an event
#: that begins at zero. So a touch is told past where the pin then is, by this part of the links' lengths: a
#: few units in the last place of a pin's position.
PAST = 1e-15
#: Gauss's quadrature in a step, exact for polynomials of degree 31, beyond any order here.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class Piece:
    """What one integrator did: to an event, to the end of the run, or for ``PAUSE`` steps.

    ``phases`` are those of ``Derivative.phases``; ``series``, None if not kept, is a function of the system's
    own variable.
    """

    system: System
    phases: FloatArray
    series: Any
    end_s: float
    end: FloatArray
    event: Event | None


class Flight:
    """A run of a scene by its integrators, in steps up to the longest; ``steps`` counts those so far."""

    def __init__(
        self, scene: Scene, derivative: Derivative, systems: Systems, longest_s: float, max_steps: int
    ) -> None:
        self._derivative, self._systems = derivative, systems
        self._end_s, self._longest_s, self._max_steps = scene.end_time_s, longest_s, max_steps
        self._past_m = PAST * sum(link.length_m for link in (scene.crank, scene.rod) if link)
        self._pace = Pace(scene, OUTLASTING)
        self.steps = 0

    def pieces(self, kept: bool) -> Iterator[Piece]:
        """Yield the run's pieces, with their series if they are to be kept.

        Raises:
            SimulationFailed: the state is no longer finite, or the steps are too many.
        """
        derivative, t = self._derivative, 0.0
        y, roots = derivative.start[: 2 * derivative.n], dict[int, float]()
        for contact in begun(derivative):
            roots[contact] = self._root(contact, y)
        while t < self._end_s:
            piece, roots = self._piece(t, y, roots, kept)
            yield piece
            t, y = piece.end_s, piece.end
            tell(t)
            self._pace.judge(t, self.steps)
            if self.steps >= self._max_steps and t < self._end_s:
                raise SimulationFailed(
                    f"{self.steps} steps came no further than t = {t:.6g} s: "
                    "loosen step_tolerance, or raise max_steps"
                )
            if piece.event is not None:
                contact, kind = piece.event
                derivative.switch(contact, kind, y)
                if kind == 0 and roots.pop(contact, None) is None:
                    roots[contact] = self._root(contact, y)

    def _root(self, contact: int, y: FloatArray) -> float:
        return float(np.sqrt(max(self._derivative.gaps(y)["depth"][contact], 0.0)))

    def _piece(
        self, t: float, y: FloatArray, roots: dict[int, float], kept: bool
    ) -> tuple[Piece, dict[int, float]]:
        """Return the next piece from y at t, and the roots of the penetrations at its end."""
        phases = self._derivative.phases()
        system = self._systems.of(tuple(phases[::2]))
        integrator, touching = system.integrator, system.touching
        if integrator.with_events:
            integrator.reset_cooldowns()
        past = np.maximum(self._derivative.gaps(y)["g"], 0.0) + self._past_m if len(phases) else ()
        integrator.pars[:] = [self._end_s, *phases[1::2], *past][: len(integrator.pars)]
        integrator.time = 0.0 if touching else t
        integrator.state[:] = [*y, *[roots[k] for k in touching], *([t] if touching else [])]
        until, longest = (NEVER, np.inf) if touching else (self._end_s, self._longest_s)
        outcome, _, _, steps, series, _ = integrator.propagate_until(
            until, max_steps=min(PAUSE, self._max_steps - self.steps), max_delta_t=longest, c_output=kept
        )
        self.steps += steps
        state, n = integrator.state.copy(), len(y)
        t = float(state[-1] if touching else integrator.time)
        if not np.isfinite(state).all():
            raise EngineFailed(f"heyoka stopped at t = {t:.6g} s: non-finite state")
        number = -1 - int(outcome)  # of the terminal event, if there was one
        event = system.events[number] if number in range(len(system.events)) else None
        if number == len(system.events):
            t = self._end_s
        return Piece(system, phases, series, t, state[:n], event), dict(
            zip(touching, state[n:].tolist(), strict=False)
        )


def begun(derivative: Derivative) -> list[int]:
    """Begin the contacts of pins in the wall at the start, clipped where they would pull, and return them."""
    inside = []
    for contact, kind in derivative.events:
        if derivative.alarm(contact, kind, derivative.start) > 0:
            derivative.switch(contact, kind, derivative.start)
            inside += [contact] * (kind == 0)
    return inside


class Reading:
    """Reads a record off the pieces of a run: samples of y at the times, with the sums of its powers."""

    def __init__(self, derivative: Derivative, times: FloatArray) -> None:
        self._derivative, self._times = derivative, times
        self._y = derivative.start
        self.record = Record(derivative)

    def read(self, pieces: Iterable[Piece]) -> Record:
        """Return the record of a run."""
        derivative, record = self._derivative, self.record
        for k, piece in enumerate(pieces):
            derivative.set_phases(piece.phases)
            if k == 0:
                record.sample([self._y])
                for contact in piece.system.touching:
                    record.touch(contact, 0.0, self._y)
            self._read_series(piece)
            self._y = np.concatenate([piece.end, self._y[len(piece.end) :]])
            if piece.event is not None and piece.event[1] == 0:
                contact = piece.event[0]
                note = record.touch if derivative.flying(contact) else record.release
                note(contact, piece.end_s, self._y)
        # The end itself, where rounding keeps it out of the series.
        record.sample([self._y] * (len(self._times) - len(record.y)))
        return record

    def _read_series(self, piece: Piece) -> None:
        """Take the samples within a piece, and add to the sums what it adds."""
        series = piece.series
        ends, clock = series.times, piece.system.clock(series, series.times)
        taken = len(self.record.y)
        times = self._times[taken : np.searchsorted(self._times, clock[-1], side="right")]
        at = times if not piece.system.touching else [_when(series, ends, clock, t) for t in times.tolist()]
        if piece.system.touching:
            inside = along_steps(ends, ends[0], ends[-1])
            states = np.array(series(inside))[:, : 2 * self._derivative.n]
            rows = np.pad(states, ((0, 0), (0, len(self._derivative.sums))))
            self.record.trace(piece.system.clock(series, inside), [*rows])
        marks = [*zip(ends[1:].tolist(), [False] * len(ends), strict=False), *((s, True) for s in at)]
        before = float(ends[0])
        for s, is_sample in sorted(marks):
            self._add(piece, before, s)
            before = s
            if is_sample:
                row = np.array(series(s))[: 2 * self._derivative.n]
                self.record.sample([np.concatenate([row, self._y[len(row) :]])])

    def _add(self, piece: Piece, begin: float, end: float) -> None:
        """Add to the sums the integrals of the powers over a part of a step."""
        n, touching = 2 * self._derivative.n, len(piece.system.touching)
        if not self._derivative.sums or end <= begin:
            return
        at = (begin + end) / 2 + (end - begin) / 2 * NODES
        states, clock = np.array(piece.series(at)), piece.system.clock(piece.series, at)
        slow = np.prod(states[:, n : n + touching], axis=1)  # of the time, by the independent variable
        none = np.zeros(len(self._derivative.sums))
        rows = (
            self._derivative.right(t, np.append(y, none)) for t, y in zip(clock, states[:, :n], strict=True)
        )
        powers = np.array([row[n:] for row in rows])
        self._y = np.concatenate([self._y[:n], self._y[n:] + (end - begin) / 2 * (WEIGHTS * slow) @ powers])


def _when(series: Any, ends: FloatArray, clock: FloatArray, time_s: float) -> float:
    """Return where the clock of a series shows a time, between the steps' ends at which it is known."""
    k = int(np.clip(np.searchsorted(clock, time_s), 1, len(clock) - 1))
    if not clock[k - 1] < time_s < clock[k]:
        return float(ends[k] if time_s >= clock[k] else ends[k - 1])
    return float(brentq(lambda s: series(s)[-1] - time_s, ends[k - 1], ends[k], xtol=1e-300, rtol=1e-15))
