"""Joints with clearance between rigid walls: free flight, impact and following, as one hybrid automaton.

* Flight: no row for the joint. Its pin reaching the wall, |d| = c with d.d' > 0, is an event.
* Impact (``rigid_impact``): all pins that touch within round-off take part at once; two that hit at different
  times, however close, do so one after the other.
* Closing: an impact has e = 0 if the next flight would be too short, or its approach is below the joint's
  minimum. Too short is 2 v+/a below ``closing_flight_fraction`` of the step, or v+^2/2a within round-off of
  the distance, with a the acceleration towards the wall. A pin on its wall that another's impact throws off
  for as short a flight is kept there: normal speeds are projected out, which takes energy too. So rapidly
  converging bounces (Zeno), of one joint or of several in turns, end; the energy this takes is a line of
  its own in the ledger.
* Following: pins on the wall without normal speed are sorted by the complementarity of accelerations and
  forces (Pfeiffer and Glocker 1996): those pressed outwards have a row, g = (d.d - c^2)/2, from then on, the
  others leave. The multiplier's change of sign is an event at which the joint's row is dropped. Sliding is
  free of friction.

Steps lie on a fixed grid; events cut them. After every step q and q' are projected onto the constraints.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reference_solver.complementarity import complementary
from reference_solver.equations import Equations
from reference_solver.errors import SolverError
from reference_solver.mechanism import Mechanism
from reference_solver.rigid_events import first_event
from reference_solver.rigid_impact import Eliminated, Jump, Touching, impact
from reference_solver.rigid_joint import JointGeometry, RigidJoint
from reference_solver.rigid_modes import Mode
from reference_solver.rigid_solution import ModeChange, RigidImpact

FloatArray = NDArray[np.float64]

#: Events at one time, per joint: more than a few mean that they do not settle.
EVENTS_AT_ONCE = 20


#: A flight that leaves the wall by less than this many times the distance's round-off cannot be followed.
DEEPEST_UNSEEN = 2.0


class UnsettledEvents(SolverError):
    """The joints' events at one time have no end."""


class Automaton:
    """The state of a run: time, q, v, the joints that follow, and the ledger's sums."""

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
        self.impacts: list[RigidImpact] = []
        self.mode_changes: list[ModeChange] = []
        self.constraint_work_J = self.impact_loss_J = self.closing_loss_J = 0.0
        self._mechanism, self._joints, self._q_start = mechanism, joints, q.copy()
        self._h, self._shortest_flight_s = step_s, closing_flight_fraction * step_s
        self._compiled, self._modes = compiled, dict[tuple[int, ...], Mode]()
        self._ideal, self._geometry = Equations(mechanism, q), JointGeometry(mechanism, joints)
        self._settle(released=None)

    @property
    def mode(self) -> Mode:
        """Return the mechanism with the rows of the joints that follow; each set is built once."""
        if self.following not in self._modes:
            self._modes[self.following] = Mode(
                self._mechanism, self._joints, self.following, self._q_start, self._compiled
            )
        return self._modes[self.following]

    def advance(self, first: int, last: int) -> None:
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
            tolerance = self._tolerance()
            taken, work, alarmed = self.mode.until_alarm(
                self.q, self.v, self.time_s, length, last - done if whole else 1, tolerance
            )
            self.constraint_work_J += work
            if taken:
                done, unsettled, ignored = done + taken, 0, frozenset()
                self.time_s = done * self._h
            if not alarmed:
                continue
            length = (done + 1) * self._h - self.time_s
            cut, joint = first_event(
                self.mode, self._geometry, self.q, self.v, self.time_s, length, tolerance, ignored
            )
            self.q, self.v, work = self.mode.step(self.q, self.v, self.time_s, cut)
            self.constraint_work_J += work
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
        where = self._geometry.separation(self.q, self.v)
        round_off = self._geometry.round_off(self.q, self.v)
        touching = where.distance_m >= self._geometry.clearance_m - round_off[:, 0]
        touching[list(self.following)] = True
        hitting = touching & (where.normal_speed > round_off[:, 1])
        hitting[list(self.following)] = False
        if hitting.any():
            self._hit(np.flatnonzero(touching), hitting)
            where = self._geometry.separation(self.q, self.v)
        closed = touching & (np.abs(where.normal_speed) <= round_off[:, 1])
        if released is not None:
            closed[released] = False
        places = np.flatnonzero(closed)
        following = tuple(int(k) for k in places[self._pressing(places, self.v)[0] > 0])
        if following != self.following:
            self.following = following
            self.mode_changes.append(ModeChange(self.time_s, following))
        return bool(hitting.any())

    def _hit(self, touching: NDArray[np.intp], hitting: NDArray[np.bool_]) -> None:
        """Let pins hit: change v, and enter the impulses in the list and in the ledger."""
        joints = [self._joints[k] for k in touching]
        where, hits = self._geometry.separation(self.q, self.v), hitting[touching]
        friction = np.where(hits, [joint.friction_coefficient for joint in joints], 0.0)
        approach = where.normal_speed[touching]

        def jump(rebounds: NDArray[np.bool_]) -> Jump:
            restitution = np.where(rebounds, [joint.restitution for joint in joints], 0.0)
            contacts = Touching(-where.normal[touching], where.tangent[touching], restitution, friction)
            return impact(self._ideal, self.time_s, self.q, self.v, contacts)

        found = jump(hits)
        slow = approach < [joint.minimum_impact_speed_m_s for joint in joints]
        closing = hits & (slow | self._short_flights(touching, found.v)[touching])
        closing &= np.array([joint.restitution > 0 for joint in joints])
        if closing.any():
            found = jump(hits & ~closing)
        for i, k in enumerate(touching):
            if found.normal_impulse_N_s[i] == 0:
                continue
            kind: Literal["impact", "closing", "support"] = (
                "closing" if closing[i] else "impact" if hits[i] else "support"
            )
            self.impacts.append(
                RigidImpact(
                    self.time_s,
                    int(k),
                    kind,
                    float(approach[i]),
                    float(found.normal_impulse_N_s[i]),
                    float(found.tangential_impulse_N_s[i]),
                    float(found.energy_lost_J[i]),
                    float(found.effective_mass_kg[i]),
                )
            )
        self.v = found.v
        self.constraint_work_J += found.driver_work_J
        self.closing_loss_J += float(found.energy_lost_J[closing].sum())
        self.impact_loss_J += float(found.energy_lost_J[~closing].sum())
        self._catch(touching)

    def _short_flights(self, touching: NDArray[np.intp], v: FloatArray) -> NDArray[np.bool_]:
        """Return which joints (J,), leaving their walls with v, would be back too soon."""
        where, round_off = self._geometry.separation(self.q, v), self._geometry.round_off(self.q, v)
        closed = touching[np.abs(where.normal_speed[touching]) <= round_off[touching, 1]]
        outward = where.normal @ self._pressing(closed, v)[1] + where.turning
        inward = np.maximum(-where.normal_speed, 0.0)
        lowest = DEEPEST_UNSEEN * round_off[:, 0]
        shortest = np.maximum(self._shortest_flight_s * outward, np.sqrt(8 * lowest * np.maximum(outward, 0)))
        return np.asarray((outward > 0) & (2 * inward < shortest))

    def _catch(self, touching: NDArray[np.intp]) -> None:
        """Keep on their walls the joints that another's impact throws off for too short a flight."""
        where, round_off = self._geometry.separation(self.q, self.v), self._geometry.round_off(self.q, self.v)
        leaving = where.normal_speed[touching] < -round_off[touching, 1]
        leaving &= self._short_flights(touching, self.v)[touching]
        if not leaving.any():
            return
        still = np.abs(where.normal_speed[touching]) <= round_off[touching, 1]
        rows = where.normal[touching[leaving | still]]
        answer = Eliminated(self._ideal, self.time_s, self.q, rows)
        speeds = rows @ self.v
        impulse = -np.linalg.lstsq(answer.W, speeds, rcond=None)[0]
        self.v = self.v + answer.motion @ impulse
        self.constraint_work_J += float(answer.reactions.T @ self._ideal.C @ impulse)
        self.closing_loss_J -= float(speeds @ impulse) / 2

    def _pressing(self, closed: NDArray[np.intp], v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the walls' inward forces on joints without normal speed (k,) and all accelerations (n,)."""
        accelerations, _ = self._ideal.accelerations(self.time_s, self.q, v)
        if not len(closed):
            return np.zeros(0), accelerations
        where = self._geometry.separation(self.q, v)
        inward = -(where.normal @ accelerations + where.turning)[closed]
        answer = Eliminated(self._ideal, self.time_s, self.q, -where.normal[closed])
        forces = complementary(answer.W, inward)
        return forces, accelerations + answer.motion @ forces

    def forces(self) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
        """Return the ideal rows' multipliers (m,), which joints follow (J,), and their forces (J, 2) in N."""
        lambda_ = self.mode.multipliers(self.time_s, self.q, self.v)
        ideal, links = lambda_[: len(self._ideal.C)], lambda_[len(self._ideal.C) :]
        following, force = np.zeros(len(self._joints), dtype=bool), np.zeros((len(self._joints), 2))
        following[list(self.following)] = True
        force[following] = links[:, None] * self._geometry.offsets(self.q)[following]
        return ideal, following, force
