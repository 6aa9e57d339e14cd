"""Rebounds from rigid walls as the reference has them, for engines that locate touches and go on from there.

Such an engine integrates flights. At a touch the velocities jump by the laws of ``rigid.impact``, until
bounces accumulate: then a pin comes to rest on its wall and is to follow it, which takes rows that come and
go, and so is where the runs of these engines end.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import AdapterCannot, FloatArray
from engine_models.scene.scene import Scene
from reference_solver.contact.types import Impact
from reference_solver.contact.walls import Separation, separation
from reference_solver.equations import Equations
from reference_solver.mechanism.contact_laws import RigidWall
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.rigid.impact import Jump, Touching, impact

#: A flight as low as so many times the distance's round-off is the last one: touches are located to some
#: units of that, so that lower flights are not seen as such.
LOWEST_FLIGHT = 64.0


class Rebound(NamedTuple):
    """What an impact does: {q'} after it (n,), what every pin in it did, and the drivers' work in J."""

    v: FloatArray
    impacts: tuple[Impact, ...]
    driver_work_J: float


class Walls:
    """The rigid walls of a scene's mechanism in one run, begun at the coordinates ``q_start`` (n,)."""

    def __init__(self, scene: Scene, mechanism: Mechanism, q_start: FloatArray) -> None:
        rigid = [(k, joint, joint.law) for k, joint in enumerate(mechanism.contacts) if joint.rigid]
        #: Their numbers among the contacts.
        self.numbers = tuple(k for k, _, _ in rigid)
        self._names = [scene.joints_with_clearance[k] for k in self.numbers]
        self._equations, self._joints = Equations(mechanism, q_start), tuple(joint for _, joint, _ in rigid)
        self._clearance_m = np.array([joint.radial_clearance_m for joint in self._joints])
        walls = [law for *_, law in rigid if isinstance(law, RigidWall)]
        self._restitution = np.array([wall.restitution for wall in walls])
        self._slowest_m_s = np.array([wall.minimum_impact_speed_m_s for wall in walls])
        laws = [joint.friction for joint in self._joints]
        self._friction = np.array([0.0 if law is None else law.coefficient for law in laws])
        #: When each pin left its wall, and how fast.
        self._left_s, self._leaving_m_s = np.full((2, len(rigid)), np.inf)

    def rebound(self, t: float, q: FloatArray, v: FloatArray, contact: int) -> Rebound:
        """Return the impact of a contact's pin, and of all that touch with it within round-off.

        Raises:
            AdapterCannot: a pin does not leave, or its flight was so low that bounces have accumulated.
            SolverError: as ``rigid.impact`` does.
        """
        where = separation(self._joints, q, v)
        touching = where.distance_m >= self._clearance_m - where.round_off[:, 0]
        touching[self.numbers.index(contact)] = True
        places = np.flatnonzero(touching & (where.normal_speed >= -where.round_off[:, 1]))
        jump = self._jump(t, q, v, where, places)
        hit = places[jump.normal_impulse_N_s != 0]
        self._require_flight(t, where, hit, -where.normal[hit] @ jump.v)
        done = (jump.normal_impulse_N_s, jump.tangential_impulse_N_s, jump.energy_lost_J)
        columns = zip(places, where.normal_speed[places], *done, jump.effective_mass_kg, strict=True)
        impacts = [Impact(t, self.numbers[k], "impact", 0.0, *map(float, of)) for k, *of in columns]
        return Rebound(jump.v, tuple(each for each in impacts if each.normal_impulse_N_s), jump.driver_work_J)

    def _jump(
        self, t: float, q: FloatArray, v: FloatArray, where: Separation, places: NDArray[np.intp]
    ) -> Jump:
        """Return the impact of the pins in some places, by the reference's laws."""
        rows, friction = (-where.normal[places], where.tangent[places]), self._friction[places]
        return impact(self._equations, t, q, v, Touching(*rows, self._restitution[places], friction))

    def _require_flight(
        self, t: float, where: Separation, hit: NDArray[np.intp], leaving_m_s: FloatArray
    ) -> None:
        """Require that pins that hit came from a flight, of height v T/4, and leave for one."""
        heights = self._leaving_m_s[hit] * np.abs(t - self._left_s[hit]) / 4
        still = (heights <= LOWEST_FLIGHT * where.round_off[hit, 0]) | (
            leaving_m_s <= where.round_off[hit, 1]
        )
        still |= where.normal_speed[hit] < self._slowest_m_s[hit]
        if still.any():
            joint = self._names[hit[int(np.argmax(still))]]
            raise AdapterCannot(
                f"bounces accumulate at t = {t:.6g} s: pin {joint} comes to rest on its wall, and this "
                f"project's model of the engine has none that follows it (clearance.{joint}.law = 'rigid')"
            )
        self._left_s[hit], self._leaving_m_s[hit] = t, leaving_m_s
