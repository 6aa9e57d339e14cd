"""A run by ``solve_ivp``: from event to event, or in one go over a right-hand side that switches."""

from collections.abc import Sequence

import numpy as np

from engine_models.engine import FloatArray
from engine_models.mechanics.impacts import along_steps, largest
from engine_models.scipy_ivp.calls import Calls
from engine_models.scipy_ivp.contact import Event, alarms, crossing, nearest
from engine_models.scipy_ivp.derivative import Derivative
from reference_solver.run import Impact


class Record:
    """One run: ``y`` and ``phases`` have a row for every sample, ``ends`` the contacts that are over."""

    def __init__(self, derivative: Derivative) -> None:
        self._derivative = derivative
        #: Of contacts that are on: time, y and speed of the touch, and what ``trace`` has found since.
        self._touches: dict[int, tuple[float, FloatArray, float, list[tuple[float, ...]]]] = {}
        self.y: list[FloatArray] = []
        self.phases: list[FloatArray] = []
        self.ends: list[Impact] = []

    def sample(self, rows: Sequence[FloatArray]) -> None:
        """Record samples, each (size of y,), in the present phases."""
        self.y.extend(rows)
        self.phases.extend(self._derivative.phases() for _ in rows)

    def touch(self, contact: int, t: float, y: FloatArray) -> None:
        """Begin a contact."""
        self._touches[contact] = (t, y, float(self._derivative.gaps(y)["rate"][contact]), [])

    def trace(self, times: FloatArray, rows: Sequence[FloatArray]) -> None:
        """Look at the contacts that are on, at times in the present phases, with y in rows."""
        for t, y in zip(times, rows, strict=True):
            pressed = self._derivative.pressed(y)
            for contact, (_, _, _, trace) in self._touches.items():
                trace.append((t, *pressed[contact]))

    def release(self, contact: int, t: float, y: FloatArray) -> None:
        """End a contact, if it has begun."""
        if contact not in self._touches:
            return
        begin, before, speed, trace = self._touches.pop(contact)
        change = self._derivative.named_sums(y - before)
        impulse, unknown = float(change[f"normal{contact}"]), float("nan")
        lost = sum(float(change.get(f"{part}{contact}", 0.0)) for part in ("loss", "clip", "slide"))
        of_contact = (begin, contact, "contact", t - begin, speed, impulse, unknown, lost, unknown)
        times, forces, depths = np.transpose(trace) if trace else np.full((3, 1), unknown)
        self.ends.append(Impact(*of_contact, *largest(times, forces), *largest(times, depths)))


class LocatedRun:
    """A run in which every event is located by ``solve_ivp`` and the integration begun anew from there."""

    def __init__(self, derivative: Derivative, calls: Calls, times: FloatArray) -> None:
        self._derivative, self._calls, self._times = derivative, calls, times
        #: Where the driver's speed is not smooth: the integration begins anew, as from an event.
        self._knots = [t for t in derivative.mechanism.knots_s(float(times[-1])) if t < times[-1]]
        self.record = Record(derivative)

    def run(self) -> Record:
        """Run through all times and return their record.

        Raises:
            SimulationFailed: see ``Calls.solve``.
        """
        t = float(self._times[0])
        y, answered = self._answer(t, self._derivative.start, None)
        self.record.sample([y])
        while t < self._times[-1]:
            t, y, event = self._segment(t, y, answered)
            y, answered = self._answer(t, y, event)
        return self.record

    def _answer(self, t: float, y: FloatArray, event: Event | None) -> tuple[FloatArray, set[Event]]:
        """Answer an event, and any other alarm that is on as well; return y after it, and what was answered.

        A compliant contact has another phase then, from a rigid wall a pin rebounds.
        """
        answered = set[Event]()
        for contact, kind in [*([event] if event else []), *self._derivative.events]:
            due = (contact, kind) == event or self._derivative.due(contact, kind, y)
            if not due or (contact, kind) in answered:
                continue
            answered.add((contact, kind))
            if self._derivative.rigid(contact):
                y, impacts = self._derivative.rebound(t, y)
                self.record.ends.extend(impacts)
                continue
            if kind == 0 and not self._calls.bare:
                note = self.record.touch if self._derivative.flying(contact) else self.record.release
                note(contact, t, y)
            self._derivative.switch(contact, kind, y)
        return y, answered

    def _segment(
        self, t: float, y: FloatArray, answered: set[Event]
    ) -> tuple[float, FloatArray, Event | None]:
        """Go to the next event or to the end, and record the samples on the way."""
        derivative, times = self._derivative, self._times[len(self.record.y) :]
        watched = alarms(derivative, y, answered)
        in_flight = [k for k in range(derivative.contact_count) if derivative.flying(k)]
        marks = [nearest(derivative, k) for k in in_flight]
        stop = min([knot for knot in self._knots if knot > t], default=float(times[-1]))
        times = times[times <= stop]
        ends = times if len(times) and times[-1] == stop else np.append(times, stop)
        states, roots, course = self._calls.solve(t, y, ends, [*watched, *marks])
        parting = [root for root in roots if root.watch.event is None and root.t > t]
        missed = [root.t for root in parting if derivative.gaps(root.y)["g"][root.watch.contact] > 0]
        if missed:  # a step that ends where the pin is nearest to the wall shows its touch
            stop, times = min(missed), times[times < min(missed)]
            states, roots, course = self._calls.solve(t, y, np.append(times, stop), watched)
        derivative.close_clipped(y, [*states, *(root.y for root in roots)])
        self.record.sample(states[: len(times)])
        ended = [root for root in roots if root.watch.event is not None]
        end = ended[0].t if ended else stop
        if course is not None and len(in_flight) < derivative.contact_count:
            inside = along_steps(course.ts, t, end)
            self.record.trace(inside, [*np.ascontiguousarray(course(inside).T)])
        if ended:
            return end, ended[0].y, ended[0].watch.event
        return end, states[-1], None


def switching_run(derivative: Derivative, calls: Calls, times: FloatArray) -> Record:
    """Return the record of a run whose right-hand side switches; impacts are read off afterwards.

    Raises:
        SimulationFailed: see ``Calls.solve``.
    """
    record = Record(derivative)
    crossings = [crossing(derivative, k) for k in range(derivative.contact_count)]
    states, roots, course = calls.solve(float(times[0]), derivative.start, times[1:], crossings)
    for t, y in zip(times, (derivative.start, *states), strict=True):
        derivative.sense(y, calls.memory_at(t))
        record.sample([y])
    begun: dict[int, float] = {}
    for watch, t, y in roots:
        if derivative.gaps(y)["rate"][watch.contact] > 0:
            record.touch(watch.contact, t, y)
            begun[watch.contact] = t
        elif watch.contact in begun:
            touch = begun.pop(watch.contact)
            assert course is not None
            for at in along_steps(course.ts, touch, t):
                state = np.ascontiguousarray(course(at))
                derivative.sense(state, calls.memory_at(at))
                record.trace(np.array([at]), [state])
            record.release(watch.contact, t, y)
    return record
