"""Joints with clearance between rigid walls: free flight, impact and following, as one hybrid automaton.

* Flight: no row for the joint. Its pin reaching the wall, |d| = c with d.d' > 0, is an event.
* Impact, closing, and what follows them: see ``rigid_settling``.
* Following: the joint has a row, g = (d.d - c^2)/2, and friction (see ``rigid_friction``). The multiplier's
  change of sign is an event at which the row is dropped.

Steps lie on a fixed grid; events cut them. After every step q and q' are projected onto the constraints.
Between events the error is of order four, as long as sliding speeds cross no kink of a friction law: at those
of the saturated linear law and of Ambrosio's, which are no events, a step's own error is of order two.
"""

import numpy as np
from numpy.typing import NDArray

from reference_solver.chunks import Tell, nobody
from reference_solver.errors import SolverError
from reference_solver.mechanism import Mechanism
from reference_solver.rigid_events import first_event
from reference_solver.rigid_joint import RigidJoint
from reference_solver.rigid_modes import Mode
from reference_solver.rigid_settling import Settling
from reference_solver.rigid_solution import Ledger, ModeChange, RigidImpact

FloatArray = NDArray[np.float64]

#: Steps per call of a kernel: a fraction of a second, so that an interrupt is answered.
CHUNK = 200_000
#: Events at one time, per joint: more than a few mean that they do not settle.
EVENTS_AT_ONCE = 20


class UnsettledEvents(SolverError):
    """The joints' events at one time have no end."""


class Automaton:
    """The state of a run: time, q, v, the joints that follow, and the ledger."""

    def __init__(
        self,
        mechanism: Mechanism,
        joints: tuple[RigidJoint, ...],
        q: FloatArray,
        v: FloatArray,
        step_s: float,
        closing_flight_fraction: float,
        compiled: bool,
    ) -> None:
        self.q, self.v, self.time_s = q, v, 0.0
        self.following: tuple[int, ...] = ()
        self.mode_changes: list[ModeChange] = []
        self.ledger = Ledger(len(joints))
        self._mechanism, self._joints, self._q_start = mechanism, joints, q.copy()
        self._h, self._compiled, self._modes = step_s, compiled, dict[tuple[int, ...], Mode]()
        self._settling = Settling(mechanism, joints, q, closing_flight_fraction * step_s, self.ledger)
        self._geometry = self._settling.geometry
        self._settle(released=None)

    @property
    def impacts(self) -> list[RigidImpact]:
        """All impulses so far, in the order of time."""
        return self._settling.impacts

    @property
    def mode(self) -> Mode:
        """Return the mechanism with the rows of the joints that follow; each set is built once."""
        if self.following not in self._modes:
            self._modes[self.following] = Mode(
                self._mechanism, self._joints, self.following, self._q_start, self._compiled
            )
        return self._modes[self.following]

    def advance(self, first: int, last: int, tell: Tell = nobody) -> None:
        """Advance from grid point ``first``, where the run stands, to ``last``, through all events between.

        Raises:
            UnsettledEvents: the events at one time have no end.
            SolverError: any other failure of a step or an impact.
        """
        done, unsettled = first, 0
        ignored: frozenset[int] = frozenset()
        while done < last:
            whole = self.time_s == done * self._h
            length = self._h if whole else (done + 1) * self._h - self.time_s
            tell(self.time_s)
            tolerance, sums = self._tolerance(), np.zeros(1 + 2 * len(self._joints))
            taken, alarmed = self.mode.until_alarm(
                self.q, self.v, self.time_s, length, min(CHUNK, last - done) if whole else 1, tolerance, sums
            )
            self.ledger.add(sums)
            if taken:
                done, unsettled, ignored = done + taken, 0, frozenset()
                self.time_s = done * self._h
            if not alarmed:
                continue
            length = (done + 1) * self._h - self.time_s
            cut, joint = first_event(self.mode, self.q, self.v, self.time_s, length, tolerance, ignored)
            self.q, self.v, sums = self.mode.step(self.q, self.v, self.time_s, cut)
            self.ledger.add(sums)
            if cut > 0:
                unsettled, ignored = 0, frozenset()
            self.time_s += cut
            if joint is None or self.time_s >= (done + 1) * self._h:
                done += 1
                self.time_s = done * self._h
            if joint is None:
                continue
            unsettled += 1
            if unsettled > EVENTS_AT_ONCE * len(self._joints):
                raise UnsettledEvents(
                    f"the rigid joints' events at t = {self.time_s:.6g} s have no end (joint {joint} last): "
                    "change the step or give the joints a minimum impact speed"
                )
            jumped = self._settle(released=joint if joint in self.following else None)
            if not jumped and joint not in self.following:
                ignored |= {joint}

    def _tolerance(self) -> FloatArray:
        """Return the round-off of every joint's g in m^2 and of its rate (J, 2)."""
        return np.asarray(self._geometry.round_off(self.q, self.v) * self._geometry.clearance_m[:, None])

    def _settle(self, released: int | None) -> bool:
        """Let the joints that touch hit, follow or leave, at the present time; return whether any hit."""
        self.v, following, hit = self._settling(self.time_s, self.q, self.v, self.following, released)
        if following != self.following:
            self.following = following
            self.mode_changes.append(ModeChange(self.time_s, following))
        return hit

    def forces(self) -> tuple[FloatArray, NDArray[np.bool_], FloatArray, FloatArray, FloatArray]:
        """Return the ideal rows' multipliers (m,), which joints follow (J,), and forces in N.

        Those are the normal forces (J,), the friction forces (J,) and both together (J, 2).
        """
        joints, where = list(self.following), self._geometry.separation(self.q, self.v)
        lambda_ = self.mode.multipliers(self.time_s, self.q, self.v)
        ideal = len(lambda_) - len(joints)
        follows, normal, friction = np.zeros(len(self._joints), dtype=bool), *np.zeros((2, len(self._joints)))
        follows[joints] = True
        normal[joints] = -lambda_[ideal:] * self._geometry.clearance_m[joints]
        for joint, force in self.mode.equations.friction_forces(self.q, self.v, lambda_).items():
            friction[joint] = force
        n = where.d / np.where(follows, where.distance_m, 1.0)[:, None]
        t = np.column_stack([-n[:, 1], n[:, 0]])
        return lambda_[:ideal], follows, normal, friction, friction[:, None] * t - normal[:, None] * n
