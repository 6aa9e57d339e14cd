"""What becomes of the pins that touch their walls at one time: they hit, and then follow or leave.

* Impact (``rigid.impact``): of the pins that touch within round-off those that come or rest take part at
  once, and rub; two that hit at different times, however close, do so one after the other. Two that hit in
  turns ever faster, each thrown out by the other's impact, go on at one time when round-off hides the
  distances in between: their speeds fall more slowly.
* Closing: an impact has e = 0 if the next flight would be too short, or its approach is below the joint's
  minimum. Too short is 2 v+/a below ``shortest_flight_s``, or v+^2/2a within round-off of the distance, with
  a the acceleration towards the wall. A pin on its wall that another's impact throws off for as short a
  flight is kept there: normal speeds are projected out, which takes energy too. So rapidly converging bounces
  (Zeno), of one joint or of several in turns, end; the energy this takes is a line of its own in the ledger.
  What friction does in the bounces left out is done at once: the error is of second order in their speed.
* Following or leaving: pins on the wall without normal speed are sorted by the complementarity of
  accelerations and normal forces (Pfeiffer and Glocker 1996). Friction is part of the accelerations: its law
  is regularised, so that at the given speeds it is a given part of each normal force. Then
  a_n = b + (W_nn - W_nt diag(mu f)) F_n, and one set of forces fits as long as all principal minors of this
  matrix are positive; otherwise there is ``PainleveParadox``.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reference_solver.contact.types import Impact
from reference_solver.contact.wall_friction import LEAST_MOBILITY
from reference_solver.contact.walls import Separation, separation
from reference_solver.equations import Equations, Phases
from reference_solver.failures import PainleveParadox
from reference_solver.mechanism.contact_laws import FRICTION_LAWS, RigidWall
from reference_solver.rigid.complementarity import complementary, least_minor_ratio
from reference_solver.rigid.impact import Eliminated, Jump, Touching, impact
from reference_solver.solution import ModeChange
from reference_solver.tape import FloatArray

#: Impacts at one time, of pins that hit in turns, after which all that touch take part in one.
MOST_IN_TURNS = 100


class Settling:
    """Settles the pins of a mechanism's joints with rigid walls; it keeps lists of impacts and of changes.

    ``equations`` are those of no pin following. A flight shorter than ``shortest_flight_s``, or no higher
    than ``lowest_flight`` times the distance's round-off, is not followed; half of that tells pins that touch
    at one time from others. ``add(name, value)`` adds to the
    ledger what is integrated elsewhere (see ``contact.force.rates_of``).
    """

    def __init__(
        self,
        equations: Equations,
        shortest_flight_s: float,
        lowest_flight: float,
        add: Callable[[str, float], None],
    ) -> None:
        self.impacts, self.changes = list[Impact](), list[ModeChange]()
        rigid = [(k, joint) for k, joint in enumerate(equations.mechanism.contacts) if joint.rigid]
        #: Their numbers among the contacts.
        self.numbers = np.array([k for k, _ in rigid])
        self._joints = tuple(joint for _, joint in rigid)
        self._clearance_m = np.array([joint.radial_clearance_m for joint in self._joints])
        walls = [joint.law for joint in self._joints if isinstance(joint.law, RigidWall)]
        self._restitution = np.array([wall.restitution for wall in walls])
        self._slowest_m_s = np.array([wall.minimum_impact_speed_m_s for wall in walls])
        laws = [joint.friction for joint in self._joints]
        self._friction = np.array([0.0 if law is None else law.coefficient for law in laws])
        self._equations, self._shortest_flight_s, self._add = equations, shortest_flight_s, add
        self._lowest_flight = lowest_flight
        self._phases: Phases = None

    def where(self, q: FloatArray, v: FloatArray) -> Separation:
        """Return where the pins stand."""
        return separation(self._joints, q, v)

    def __call__(
        self,
        t: float,
        q: FloatArray,
        v: FloatArray,
        phases: Phases,
        following: tuple[int, ...],
        released: int | None,
    ) -> tuple[FloatArray, tuple[int, ...], bool]:
        """Return v after impacts, the contacts whose pins follow from now on, and whether any pin hit.

        ``phases`` are those of compliant contacts beside them; ``released`` is the contact whose force has
        just changed sign.
        """
        self._phases, where = phases, self.where(q, v)
        touching = where.distance_m >= self._clearance_m - 0.5 * self._lowest_flight * where.round_off[:, 0]
        follows = np.isin(self.numbers, following)
        touching |= follows
        noise, hits, before = where.round_off[:, 1], 0, np.zeros(0)
        while (hitting := touching & (where.normal_speed > noise) & ~follows).any():
            if hits > MOST_IN_TURNS or np.array_equal(v, before):
                break
            taking_part = touching & ((where.normal_speed >= -noise) | (hits == MOST_IN_TURNS))
            before, hits = v, hits + 1
            v = self._hit(t, q, v, np.flatnonzero(taking_part), hitting)
            where = self.where(q, v)
            follows &= np.abs(where.normal_speed) <= noise
        closed = touching & (np.abs(where.normal_speed) <= noise)
        if released is not None:
            closed[self.numbers == released] = False
        places = np.flatnonzero(closed)
        pressed = places[self._pressing(t, q, v, places)[0] > 0]
        return v, tuple(int(k) for k in self.numbers[pressed]), hits > 0

    def _hit(
        self,
        t: float,
        q: FloatArray,
        v: FloatArray,
        touching: NDArray[np.intp],
        hitting: NDArray[np.bool_],
    ) -> FloatArray:
        """Return v after pins have hit, and enter the impulses in the list and in the ledger."""
        where, hits = self.where(q, v), hitting[touching]
        approach, restitution = where.normal_speed[touching], self._restitution[touching]

        def jump(rebounds: NDArray[np.bool_]) -> Jump:
            at_rest, after = self._touching(where, touching), np.where(rebounds, restitution, 0.0)
            return impact(self._equations, t, q, v, replace(at_rest, restitution=after))

        after = jump(hits)
        slow = approach < self._slowest_m_s[touching]
        closing = hits & (slow | self._short_flights(t, q, after.v, touching)[touching])
        closing &= restitution > 0
        left_out = np.zeros(len(touching))
        if closing.any():
            leaving = np.maximum(-self.where(q, after.v).normal_speed[touching], 0.0)
            left_out = np.where(closing & ~slow, leaving, 0.0)
            after = jump(hits & ~closing)
        self._add("drivers", after.driver_work_J)
        for i, k in enumerate(self.numbers[touching]):
            normal, lost = float(after.normal_impulse_N_s[i]), float(after.energy_lost_J[i])
            kind = "closing" if closing[i] else "impact" if hits[i] else "support"
            self._add(f"normal{k}", normal)
            self._add(f"{'closing' if closing[i] else 'impact'}{k}", lost)
            if normal != 0:
                tangential, mass = float(after.tangential_impulse_N_s[i]), float(after.effective_mass_kg[i])
                speed = float(approach[i])
                self.impacts.append(Impact(t, int(k), kind, 0.0, speed, normal, tangential, lost, mass))
        v, thrown = self._caught(t, q, after.v, touching)
        return self._rubbed(t, q, v, touching, left_out + thrown)

    def _short_flights(
        self, t: float, q: FloatArray, v: FloatArray, touching: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Return which joints (J,), leaving their walls with v, would be back too soon."""
        where = self.where(q, v)
        closed = touching[np.abs(where.normal_speed[touching]) <= where.round_off[touching, 1]]
        outward = where.normal @ self._pressing(t, q, v, closed)[1] + where.turning
        inward = np.maximum(-where.normal_speed, 0.0)
        lowest = self._lowest_flight * where.round_off[:, 0]
        shortest = np.maximum(self._shortest_flight_s * outward, np.sqrt(8 * lowest * np.maximum(outward, 0)))
        return np.asarray((outward > 0) & (2 * inward < shortest))

    def _caught(
        self, t: float, q: FloatArray, v: FloatArray, touching: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        """Return v with the joints kept on their walls that another's impact throws off for too short.

        Second are the speeds at which they would have left, (k,) of those that touch.
        """
        where = self.where(q, v)
        leaving = where.normal_speed[touching] < -where.round_off[touching, 1]
        leaving &= self._short_flights(t, q, v, touching)[touching]
        thrown = np.where(leaving, -where.normal_speed[touching], 0.0)
        if not leaving.any():
            return v, thrown
        still = np.abs(where.normal_speed[touching]) <= where.round_off[touching, 1]
        caught = touching[leaving | still]
        rows = where.normal[caught]
        answer = Eliminated(self._equations, t, q, rows, len(rows))
        speeds = rows @ v
        impulse = -np.linalg.lstsq(answer.W, speeds, rcond=None)[0]
        self._add("drivers", float(answer.reactions.T @ self._equations.speeds(t) @ impulse))
        for k, outward, lost in zip(self.numbers[caught], impulse, -speeds * impulse / 2, strict=True):
            self._add(f"normal{k}", -float(outward))
            self._add(f"closing{k}", float(lost))
        return np.asarray(v + answer.motion @ impulse), thrown

    def _rubbed(
        self, t: float, q: FloatArray, v: FloatArray, touching: NDArray[np.intp], leaving: FloatArray
    ) -> FloatArray:
        """Return v with what friction does in bounces that are left out, of pins that leave so fast (k,).

        Along the normal they give what following gives in as long a time. But impacts rub by all of Coulomb's
        coefficient, and hold a pin that has come to rest, where following rubs by the law's part at the
        sliding speed: a difference of the first order in the speed.
        """
        if self._friction[touching].any():
            for joint, speed in zip(touching, leaving, strict=True):
                if speed > 0 and self._restitution[joint] < 1:
                    v = v + self._more_rubbed(t, q, v, touching, joint, speed)
        return v

    def _more_rubbed(
        self, t: float, q: FloatArray, v: FloatArray, touching: NDArray[np.intp], joint: int, speed: float
    ) -> FloatArray:
        """Return what friction changes v by in a joint's bounces, the first one at this speed.

        They last for T = 2 w/(a (1 - e)). In that time a pin that flies is accelerated, and hits once with
        what has come together, or follows. Nothing where another wall loses its pin meanwhile.
        """
        where, nothing = self.where(q, v), np.zeros_like(v)
        closed = touching[np.abs(where.normal_speed[touching]) <= where.round_off[touching, 1]]
        if joint not in closed:
            return nothing
        following, flying = (
            self._pressing(t, q, v, places)[1] for places in (closed, closed[closed != joint])
        )
        outward = float(where.normal[joint] @ flying + where.turning[joint])
        if outward <= 0:
            return nothing
        restitution = self._restitution[joint] if speed >= self._slowest_m_s[joint] else 0.0
        lasting = 2 * speed / (outward * (1 - restitution))
        rubbing, k = closed[self._friction[closed] > 0], len(closed)
        rows = np.concatenate([where.normal[closed], where.tangent[rubbing]])
        answer = Eliminated(self._equations, t, q, rows, k)
        # Rows of normals turn with the pins: both ways end with speeds along those of now.
        turned = np.linalg.lstsq(answer.W[:k, :k], lasting * where.turning[closed], rcond=None)[0]
        start = v + answer.motion[:, :k] @ turned
        hit = impact(self._equations, t, q, start + lasting * flying, self._touching(where, closed))
        impulse = np.linalg.lstsq(answer.W, rows @ (hit.v - start - lasting * following), rcond=None)[0]
        change = answer.motion @ impulse
        if np.any(np.abs(where.normal[closed] @ change) > where.round_off[closed, 1]):
            return nothing
        self._add("drivers", float(answer.reactions.T @ self._equations.speeds(t) @ impulse))
        for number, outwards in zip(self.numbers[closed], impulse, strict=False):
            self._add(f"normal{number}", -float(outwards))
        lost = -impulse * (rows @ (v + change / 2))
        for number, part in zip(self.numbers[np.concatenate([closed, rubbing])], lost, strict=True):
            self._add(f"closing{number}", float(part))
        return np.asarray(change)

    def _touching(self, where: Separation, joints: NDArray[np.intp]) -> Touching:
        """Return these joints, none of which rebounds."""
        normal, tangent = -where.normal[joints], where.tangent[joints]
        return Touching(normal, tangent, np.zeros(len(joints)), self._friction[joints])

    def _pressing(
        self, t: float, q: FloatArray, v: FloatArray, closed: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the walls' inward forces on joints without normal speed (k,) and all accelerations (n,).

        Raises:
            PainleveParadox: no or more than one set of forces fits.
        """
        accelerations, _ = self._equations.accelerations(t, q, v, self._phases)
        if not len(closed):
            return np.zeros(0), accelerations
        where, k = self.where(q, v), len(closed)
        inward = -(where.normal @ accelerations + where.turning)[closed]
        shares = np.zeros(k)
        for i, joint in enumerate(closed):
            if (law := self._joints[joint].friction) is not None:
                sliding = float(where.tangent[joint] @ v)
                shares[i] = law.coefficient * FRICTION_LAWS[law.kind](law, sliding)
        rubbing = shares != 0
        rows = np.concatenate([-where.normal[closed], where.tangent[closed[rubbing]]])
        answer = Eliminated(self._equations, t, q, rows, k)
        # Of unit normal forces, with the friction that comes with each.
        forces = np.concatenate([np.eye(k), -np.diag(shares)[rubbing]])
        W = answer.W[:k] @ forces
        if least_minor_ratio(W, answer.W[:k, :k]) <= LEAST_MOBILITY:
            raise PainleveParadox(t, tuple(int(k) for k in self.numbers[closed[rubbing]]))
        pressing = complementary(W, inward)
        return pressing, accelerations + answer.motion @ (forces @ pressing)
