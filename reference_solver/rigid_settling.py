"""What becomes of the pins that touch their walls at one time: they hit, and then follow or leave.

* Impact (``rigid_impact``): all pins that touch within round-off take part at once, and rub; two that hit at
  different times, however close, do so one after the other.
* Closing: an impact has e = 0 if the next flight would be too short, or its approach is below the joint's
  minimum. Too short is 2 v+/a below ``shortest_flight_s``, or v+^2/2a within round-off of the distance, with
  a the acceleration towards the wall. A pin on its wall that another's impact throws off for as short a
  flight is kept there: normal speeds are projected out, which takes energy too. So rapidly converging bounces
  (Zeno), of one joint or of several in turns, end; the energy this takes is a line of its own in the ledger.
* Following or leaving: pins on the wall without normal speed are sorted by the complementarity of
  accelerations and normal forces (Pfeiffer and Glocker 1996). Friction is part of the accelerations: its law
  is regularised, so that at the given speeds it is a given part of each normal force. Then
  a_n = b + (W_nn - W_nt diag(mu f)) F_n, and one set of forces fits as long as all principal minors of this
  matrix are positive; otherwise there is ``PainleveParadox``.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reference_solver.complementarity import complementary, least_minor_ratio
from reference_solver.contact_laws import FRICTION_LAWS
from reference_solver.equations import Equations
from reference_solver.mechanism import Mechanism
from reference_solver.rigid_friction import LEAST_MOBILITY, PainleveParadox
from reference_solver.rigid_impact import Eliminated, Jump, Touching, impact
from reference_solver.rigid_joint import JointGeometry, RigidJoint
from reference_solver.rigid_solution import Ledger, RigidImpact

FloatArray = NDArray[np.float64]

#: A flight that leaves the wall by less than this many times the distance's round-off cannot be followed.
DEEPEST_UNSEEN = 2.0


class Settling:
    """Settles the joints of one mechanism; it keeps the list of impacts and their part of the ledger."""

    def __init__(
        self,
        mechanism: Mechanism,
        joints: tuple[RigidJoint, ...],
        q_start: FloatArray,
        shortest_flight_s: float,
        ledger: Ledger,
    ) -> None:
        self.impacts: list[RigidImpact] = []
        self.geometry = JointGeometry(mechanism, joints)
        self._joints, self._ledger, self._shortest_flight_s = joints, ledger, shortest_flight_s
        self._ideal = Equations(mechanism, q_start)

    def __call__(
        self, t: float, q: FloatArray, v: FloatArray, following: tuple[int, ...], released: int | None
    ) -> tuple[FloatArray, tuple[int, ...], bool]:
        """Return v after impacts, the joints that follow from now on, and whether any pin hit.

        ``released`` is the joint whose force has just changed sign.
        """
        where, round_off = self.geometry.separation(q, v), self.geometry.round_off(q, v)
        touching = where.distance_m >= self.geometry.clearance_m - round_off[:, 0]
        touching[list(following)] = True
        hitting = touching & (where.normal_speed > round_off[:, 1])
        hitting[list(following)] = False
        if hitting.any():
            v = self._hit(t, q, v, np.flatnonzero(touching), hitting)
            where = self.geometry.separation(q, v)
        closed = touching & (np.abs(where.normal_speed) <= round_off[:, 1])
        if released is not None:
            closed[released] = False
        places = np.flatnonzero(closed)
        pressed = places[self._pressing(t, q, v, places)[0] > 0]
        return v, tuple(int(k) for k in pressed), bool(hitting.any())

    def _hit(
        self,
        t: float,
        q: FloatArray,
        v: FloatArray,
        touching: NDArray[np.intp],
        hitting: NDArray[np.bool_],
    ) -> FloatArray:
        """Return v after pins have hit, and enter the impulses in the list and in the ledger."""
        joints = [self._joints[k] for k in touching]
        where, hits = self.geometry.separation(q, v), hitting[touching]
        friction = np.array([joint.friction_coefficient for joint in joints])
        approach = where.normal_speed[touching]

        def jump(rebounds: NDArray[np.bool_]) -> Jump:
            restitution = np.where(rebounds, [joint.restitution for joint in joints], 0.0)
            contacts = Touching(-where.normal[touching], where.tangent[touching], restitution, friction)
            return impact(self._ideal, t, q, v, contacts)

        found = jump(hits)
        slow = approach < [joint.minimum_impact_speed_m_s for joint in joints]
        closing = hits & (slow | self._short_flights(t, q, found.v, touching)[touching])
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
                    t,
                    int(k),
                    kind,
                    float(approach[i]),
                    float(found.normal_impulse_N_s[i]),
                    float(found.tangential_impulse_N_s[i]),
                    float(found.energy_lost_J[i]),
                    float(found.effective_mass_kg[i]),
                )
            )
        self._ledger.constraint_work_J += found.driver_work_J
        self._ledger.normal_impulse_N_s[touching] += found.normal_impulse_N_s
        self._ledger.closing_loss_J[touching] += np.where(closing, found.energy_lost_J, 0.0)
        self._ledger.impact_loss_J[touching] += np.where(closing, 0.0, found.energy_lost_J)
        return self._caught(t, q, found.v, touching)

    def _short_flights(
        self, t: float, q: FloatArray, v: FloatArray, touching: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Return which joints (J,), leaving their walls with v, would be back too soon."""
        where, round_off = self.geometry.separation(q, v), self.geometry.round_off(q, v)
        closed = touching[np.abs(where.normal_speed[touching]) <= round_off[touching, 1]]
        outward = where.normal @ self._pressing(t, q, v, closed)[1] + where.turning
        inward = np.maximum(-where.normal_speed, 0.0)
        lowest = DEEPEST_UNSEEN * round_off[:, 0]
        shortest = np.maximum(self._shortest_flight_s * outward, np.sqrt(8 * lowest * np.maximum(outward, 0)))
        return np.asarray((outward > 0) & (2 * inward < shortest))

    def _caught(self, t: float, q: FloatArray, v: FloatArray, touching: NDArray[np.intp]) -> FloatArray:
        """Return v with the joints kept on their walls that another's impact throws off for too short."""
        where, round_off = self.geometry.separation(q, v), self.geometry.round_off(q, v)
        leaving = where.normal_speed[touching] < -round_off[touching, 1]
        leaving &= self._short_flights(t, q, v, touching)[touching]
        if not leaving.any():
            return v
        still = np.abs(where.normal_speed[touching]) <= round_off[touching, 1]
        kept = touching[leaving | still]
        rows = where.normal[kept]
        answer = Eliminated(self._ideal, t, q, rows, len(rows))
        speeds = rows @ v
        impulse = -np.linalg.lstsq(answer.W, speeds, rcond=None)[0]
        self._ledger.constraint_work_J += float(answer.reactions.T @ self._ideal.C @ impulse)
        self._ledger.normal_impulse_N_s[kept] -= impulse
        self._ledger.closing_loss_J[kept] -= speeds * impulse / 2
        return np.asarray(v + answer.motion @ impulse)

    def _pressing(
        self, t: float, q: FloatArray, v: FloatArray, closed: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the walls' inward forces on joints without normal speed (k,) and all accelerations (n,).

        Raises:
            PainleveParadox: no or more than one set of forces fits.
        """
        accelerations, _ = self._ideal.accelerations(t, q, v)
        if not len(closed):
            return np.zeros(0), accelerations
        where, k = self.geometry.separation(q, v), len(closed)
        inward = -(where.normal @ accelerations + where.turning)[closed]
        shares = np.zeros(k)
        for i, joint in enumerate(closed):
            if (law := self._joints[joint].friction) is not None:
                sliding = float(where.tangent[joint] @ v)
                shares[i] = law.coefficient * FRICTION_LAWS[law.kind](law, sliding)
        rubbing = shares != 0
        rows = np.concatenate([-where.normal[closed], where.tangent[closed[rubbing]]])
        answer = Eliminated(self._ideal, t, q, rows, k)
        # Of unit normal forces, with the friction that comes with each.
        forces = np.concatenate([np.eye(k), -np.diag(shares)[rubbing]])
        W = answer.W[:k] @ forces
        if least_minor_ratio(W, answer.W[:k, :k]) <= LEAST_MOBILITY:
            raise PainleveParadox(t, tuple(int(joint) for joint in closed[rubbing]))
        pressing = complementary(W, inward)
        return pressing, accelerations + answer.motion @ (forces @ pressing)
