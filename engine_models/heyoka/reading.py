"""Reads a run off the Taylor series of its pieces: samples, what powers add up to, impacts, forces."""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

from engine_models.engine import FloatArray
from engine_models.heyoka.drafts import TOUCH
from engine_models.heyoka.run import Piece
from engine_models.mechanics.equations.derivative import Derivative
from engine_models.mechanics.impacts import along_steps, largest
from reference_solver.contact.types import CONTACT, FLIGHT, Impact
from reference_solver.contact.walls import Separation, separation
from reference_solver.equations import Equations
from reference_solver.mechanism.points import State
from reference_solver.rigid.walls import walls_at
from reference_solver.solution import Solution

#: Gauss's quadrature in a step, exact for polynomials of degree 31, beyond any order here.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
UNKNOWN = float("nan")


@dataclass
class Touch:
    """A contact that is on: when and how fast it began, the sums then, and its course since.

    That has rows of time, normal force and penetration.
    """

    time_s: float
    speed_m_s: float
    sums: FloatArray
    course: list[FloatArray] = field(default_factory=list)


class HeldDerivative(Derivative):
    """The equations of all coordinates, also of pins that follow rigid walls."""

    def forces(self, t: float, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return {lambda} (m,), and every contact's normal force and friction (2K,), in its present phase."""
        phases = self.phases().reshape(-1, 2)
        joints = self.mechanism.contacts
        held = tuple(k for k, joint in enumerate(joints) if joint.rigid and phases[k, 0] == CONTACT)
        if not held:
            return super().forces(t, y)
        equations = Equations(self.mechanism, self.start[: self.n], following=held)
        answer = equations.required(t, y[: self.n], y[self.n : 2 * self.n], phases)
        normal = [answer.powers[f"normal{k}"] for k in range(len(joints))]
        pairs = np.column_stack([normal, answer.friction_N])
        return np.array(answer.multipliers[: equations.own_rows], dtype=float), pairs.ravel()


class Reading:
    """A run's samples as they are read: rows of q, v (n,) each and sums, phases, and contacts that are over.

    ``derivative`` has the mechanism's own equations, in all coordinates.
    """

    def __init__(self, derivative: Derivative, times: FloatArray) -> None:
        self._derivative, self._times, self._n = derivative, times, derivative.n
        self._joints = derivative.mechanism.contacts
        self._last: Piece | None = None
        self._sums, self._touches = np.zeros(len(derivative.sums)), dict[int, Touch]()
        self._rows, self._phases, self._impacts = list[FloatArray](), list[FloatArray](), list[Impact]()

    def take(self, piece: Piece) -> None:
        """Read the run's next piece."""
        start = self._told(piece, piece.series.times[:1])
        if self._last is None:
            self._sample(piece, start, self._sums[None])
        self._change(self._last, piece, start[0])
        self._follow(piece)
        self._last = piece

    def solution(self, steps: int) -> Solution:
        """Return the solution of a run that has been read, with the forces at its samples."""
        last, missing = self._last, len(self._times) - len(self._rows)
        assert last is not None
        # The end, where rounding has it past the series.
        end = np.repeat(self._told(last, None), missing, axis=0)
        self._sample(last, end, np.tile(self._sums, (missing, 1)))
        return self._derivative.solution(self._times, self._rows, self._phases, self._impacts, steps)

    def _told(self, piece: Piece, own: FloatArray | None) -> FloatArray:
        """Return rows of q, v, powers and dt/ds at values of the independent variable, or at the end."""
        states = piece.end[None] if own is None else piece.series.at(own)
        return piece.system.told(self._derivative.sums, states, piece.pars)

    def _sample(self, piece: Piece, told: FloatArray, sums: FloatArray) -> None:
        """Record samples in the phases of a piece."""
        self._rows += [*np.column_stack([told[:, : 2 * self._n], sums])]
        self._phases += [piece.system.draft.phases_and_memories(piece.end)] * len(told)

    def _change(self, before: Piece | None, piece: Piece, start: FloatArray) -> None:
        """Note what has become of the contacts between two pieces, at the start of the second."""
        t = float(piece.system.clock(piece.series, piece.series.times[:1])[0])
        for k, joint in enumerate(self._joints):
            was, now = FLIGHT if before is None else before.system.phases[k], piece.system.phases[k]
            if joint.rigid:
                if before is not None and was == FLIGHT and before.event == (TOUCH, k):
                    self._hit(k, t, self._told(before, None)[0], closing=now == CONTACT)
            elif was == FLIGHT != now:
                where = self._separation(k, start)
                speed = where.rate * where.distance / joint.radial_clearance_m
                self._touches[k] = Touch(t, float(speed), self._sums)
            elif was != FLIGHT == now:
                self._release(k, t)

    def _separation(self, k: int, told: FloatArray) -> Separation:
        return separation(self._joints[k], State(told[: self._n], told[self._n : 2 * self._n]))

    def _hit(self, k: int, t: float, told: FloatArray, closing: bool) -> None:
        """Record an impact at a rigid wall, and add up what it does."""
        wall, (q, v) = self._joints[k].wall, np.split(told[: 2 * self._n], 2)
        equations, place = self._derivative.readable, sum(joint.rigid for joint in self._joints[:k])
        joints, walls = walls_at(equations, equations.required(t, q, v), t, q, v)
        speed, mass = float(joints[place]["rate"]), float(1.0 / walls["mobility"][place, place])
        rebounds = not closing and speed >= wall.minimum_impact_speed_m_s
        restitution = wall.restitution if rebounds else 0.0
        impulse, lost = (1 + restitution) * mass * speed, (1 - restitution**2) / 2 * mass * speed**2
        kind = "impact" if rebounds or wall.restitution == 0 else "closing"
        work = float(walls["drivers"][place]) * impulse
        gains = {f"normal{k}": impulse, f"{kind}{k}": lost, "drivers": work}
        self._sums = self._sums + [gains.get(name, 0.0) for name in self._derivative.sums]
        self._impacts.append(Impact(t, k, kind, 0.0, speed, impulse, 0.0, lost, mass))

    def _release(self, k: int, t: float) -> None:
        """Record a contact that has ended."""
        touch, sums = self._touches.pop(k), self._derivative.sums
        change = dict(zip(sums, (self._sums - touch.sums).tolist(), strict=True))
        lost = sum(change.get(f"{part}{k}", 0.0) for part in ("loss", "clip", "slide"))
        times, forces, depths = np.concatenate(touch.course, axis=1)
        of_contact = (touch.time_s, k, "contact", t - touch.time_s, touch.speed_m_s, change[f"normal{k}"])
        found = (*largest(times, forces), *largest(times, depths))
        self._impacts.append(Impact(*of_contact, UNKNOWN, lost, UNKNOWN, *found))

    def _follow(self, piece: Piece) -> None:
        """Take the samples within a piece, add up its powers, and trace the contacts that are on."""
        ends, system = piece.series.times, piece.system
        clock = system.clock(piece.series, ends)
        taken = len(self._rows)
        times = self._times[taken : np.searchsorted(self._times, clock[-1], side="right")]
        at = np.array([self._when(piece, clock, t) for t in times.tolist()]) if system.timed else times
        edges = np.union1d(ends, at)
        half, middle = np.diff(edges)[:, None] / 2, (edges[1:] + edges[:-1])[:, None] / 2
        told = self._told(piece, (middle + half * NODES).ravel())[:, 2 * self._n :]
        rates = (told[:, :-1] * told[:, -1:]).reshape(len(half), len(NODES), len(self._sums))
        parts = half * np.einsum("k,ekp->ep", WEIGHTS, rates)
        sums = self._sums + np.concatenate([np.zeros((1, len(self._sums))), np.cumsum(parts, axis=0)])
        if len(at):
            self._sample(piece, self._told(piece, at), sums[np.searchsorted(edges, at)])
        self._sums = sums[-1]
        if system.stretched:
            inside = along_steps(ends, ends[0], ends[-1])
            told, when = self._told(piece, inside), system.clock(piece.series, inside)
            states = piece.series.at(inside)
            for k, touch in self._touches.items():
                force = told[:, 2 * self._n + self._derivative.sums.index(f"normal{k}")]
                depth = states[:, system.draft.names.index(f"w{k}")] ** 2
                touch.course.append(np.array([when, force, depth]))

    @staticmethod
    def _when(piece: Piece, clock: FloatArray, time_s: float) -> float:
        """Return where the clock of a piece shows a time, between the steps' ends at which it is known."""
        ends, series = piece.series.times, piece.series
        k = int(np.clip(np.searchsorted(clock, time_s), 1, len(clock) - 1))
        if not clock[k - 1] < time_s < clock[k]:
            return float(ends[k] if time_s >= clock[k] else ends[k - 1])

        def early(own: float) -> float:
            return float(series.at(np.array([own]))[0, -1]) - time_s

        return float(brentq(early, ends[k - 1], ends[k], xtol=1e-300, rtol=1e-15))
