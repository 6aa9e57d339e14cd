"""The reference's equations as a right-hand side y' = f(t, y) that an integrator from outside can call.

y = (q, q', sums) holds coordinates, n velocities, and integrals since t = 0: a driver's work where there is
one, then what every contact adds up (``contact.rates_of``), then works of loads. The text is the reference's
own, (1)-(10) without stabilisation, in the reference's compiled functions.
"""

import math
from collections.abc import Sequence
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import AdapterCannot, FloatArray, SimulationFailed
from engine_models.mechanics.equations import mechanism_of
from engine_models.mechanics.start_check import checked_start
from engine_models.scene.scene import Scene
from engine_models.scipy_ivp.rebounds import Rebounds
from reference_solver.equations import Equations
from reference_solver.failures import SolverError
from reference_solver.kernel import Kernel, Topology
from reference_solver.mechanism.contact_laws import stored_J
from reference_solver.run import (
    CLIPPED,
    CONTACT,
    CONTACT_RECORD,
    EVENT_RECORD,
    FLIGHT,
    Gap,
    Impact,
    record,
    set_contact,
)
from reference_solver.solution import Solution

#: Part of the largest coordinate by which rounding may keep apart two pins that touch at one instant.
ROUND_OFF = 8 * float(np.finfo(float).eps)
#: Flights between rigid walls as low as so many times the distance's round-off are not followed: touches are
#: located to some units of that.
LOWEST_FLIGHT = 64.0
#: Fields of a gap (see ``reference_solver.run.Gap``) whose zeros are watched.
WATCHED = ("g", "rate", "push")
GAP_RECORD = np.dtype(record(" ".join(Gap._fields)))


def _integrated(equations: Equations) -> list[str]:
    """Return the names of the powers that are not zero at all times."""
    driven = equations.mechanism.prescribed or any(c != 0 for c in equations.C)
    return equations.power_names[0 if driven else 1 :]


class Derivative:
    """f(t, y) of a scene, with the phases of its K contacts, which are constant between events.

    The contacts are in flight to begin with (see ``reference_solver.loop``). ``start`` is y at t = 0;
    ``sums`` names the integrals in it, behind ``n`` coordinates and as many velocities.
    """

    def __init__(self, scene: Scene) -> None:
        q, v = checked_start(scene)
        mechanism = mechanism_of(scene)
        topology, q_start = Topology(mechanism), q.ravel()
        self.n, self.readable = q.size, Equations(mechanism, q_start)
        self.mechanism, self._joints, self._rows = mechanism, mechanism.contacts, len(self.readable.C)
        self._forces = np.empty(self._rows + 2 * len(self._joints))
        self._rates = np.empty(2 * self.n + len(self.readable.power_names) + 2)
        self._gaps = np.zeros(len(self._joints), GAP_RECORD)
        self._contacts = np.zeros(len(self._joints), CONTACT_RECORD)
        for contact, joint in zip(self._contacts, self._joints, strict=True):
            set_contact(contact, joint)
        self.sums = tuple(_integrated(self.readable))
        self.contact_count = len(self._joints)
        self._rigid = {
            k: scene.joints_with_clearance[k] for k, joint in enumerate(self._joints) if joint.rigid
        }
        self._rebounds = Rebounds(mechanism, q_start, LOWEST_FLIGHT) if self._rigid else None
        #: Contact and kind of every alarm; the force of a contact changes its law only where that is clipped.
        clipped = [k for k, joint in enumerate(self._joints) if not joint.rigid and joint.compliance.clipped]
        self.events = [(k, 0) for k in range(self.contact_count)] + [(k, 1) for k in clipped]
        self._refused: tuple[float, FloatArray] | None = None
        self.start = np.concatenate([q, v, np.zeros(len(self.sums))], axis=None)
        self._first = len(self.readable.power_names) - len(self.sums)
        self._kernel, self._at = Kernel(topology, q_start), self._contacts.ctypes.data
        #: By field and contact: functions of sign, level, t and y, sign times the field less the level.
        self.watched = {
            (field, k): partial(self._watched, field, k)
            for field, k in product(WATCHED, range(self.contact_count))
        }

    def _watched(self, field: str, contact: int, sign: float, level: float, _: float, y: FloatArray) -> float:
        return sign * float(self.gaps(y)[contact][field]) - level

    def right(self, t: float, y: FloatArray) -> FloatArray:
        """Return y' in the present phases, not finite where [B] has lost rank: that rejects a step.

        It is written over a copy of y, which is contiguous, as the compiled function takes for granted.
        """
        return self._evaluated(t, y)[0]

    def _evaluated(self, t: float, y: FloatArray) -> tuple[FloatArray, bool]:
        """Return y' and whether there is one."""
        n, rates = 2 * self.n, self._rates
        ok = self._kernel["rates"](self._kernel.p, self._at, t, np.ascontiguousarray(y), rates) < math.inf
        rate = np.concatenate([rates[:n], rates[n + self._first : -2]])
        if not ok:
            rate[self.n] = math.inf
        return rate, ok

    def __call__(self, t: float, y: FloatArray) -> FloatArray:
        """Return the same, and keep in mind where there is none."""
        rate, ok = self._evaluated(t, y)
        if not ok:
            self._refused = (t, y.copy())
        return rate

    def diagnosis(self, since_s: float) -> str:
        """Return what is wrong at the last state without y', empty if there was none since a time."""
        if self._refused is None or self._refused[0] < since_s or not np.isfinite(self._refused[1]).all():
            return ""
        t, y = self._refused
        q, v = np.split(y[: 2 * self.n], 2)
        try:
            self.readable.accelerations(t, q, v, self.phases().reshape(-1, 2))
        except SolverError as error:
            return str(error)
        return f"the constraint matrix is about to lose rank at t = {t:.6g} s"

    def forces(self, t: float, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return {lambda} (m,), and every contact's normal force and friction (2K,), in its present phase."""
        self(t, y)
        self._kernel["forces"](self._kernel.p, self._at, t, np.ascontiguousarray(y), self._forces)
        return self._forces[: self._rows].copy(), self._forces[self._rows :].copy()

    def solution(
        self,
        time_s: FloatArray,
        samples: Sequence[FloatArray],
        phases: Sequence[FloatArray],
        impacts: Sequence[Impact],
        steps: int,
    ) -> Solution:
        """Return a run with samples of y and phases at times as a solution, with the forces at them."""
        y, forces = np.array(samples), []
        for t, at, then in zip(time_s, y, phases, strict=True):
            self.set_phases(then)
            forces.append(self.forces(t, at))
        multipliers, of_contacts = (np.array(column) for column in zip(*forces, strict=True))
        return Solution(
            mechanism=self.mechanism,
            time_s=time_s,
            q=y[:, : self.n],
            v=y[:, self.n : 2 * self.n],
            multipliers=multipliers,
            phases=np.reshape(phases, (len(y), -1, 2)),
            normal_force_N=of_contacts[:, ::2],
            friction_force_N=of_contacts[:, 1::2],
            sums=self.named_sums(y),
            events=np.zeros(0, EVENT_RECORD),
            impacts=tuple(impacts),
            mode_changes=(),
            steps=steps,
        )

    def named_sums(self, y: FloatArray) -> dict[str, FloatArray]:
        """Return the integrals in y, (..., size), by name."""
        last = y[..., y.shape[-1] - len(self.sums) :]
        return dict(zip(self.sums, np.moveaxis(last, -1, 0), strict=True))

    def close_clipped(self, before: FloatArray, later: Sequence[FloatArray]) -> None:
        """Set in later y what clipped contacts have lost since ``before``: the energy of their springs.

        No force acts there, so that a solver's steps are long, and a quadrature over them is of no use.
        """
        for k in np.flatnonzero(self._contacts["phase"] == CLIPPED):
            place, stored = 2 * self.n + self.sums.index(f"clip{k}"), self._stored_J(before)[k]
            for y in later:
                y[place] = before[place] + stored - self._stored_J(y)[k]

    def _stored_J(self, y: FloatArray) -> FloatArray:
        """Return what every contact's spring stores, (K,)."""
        return stored_J(self._contacts["stiffness"], self._contacts["exponent"], self.gaps(y)["depth"])

    def gaps(self, y: FloatArray) -> NDArray[np.void]:
        """Return every contact's gap (K,), records of ``GAP_RECORD``."""
        self._kernel["gaps"](self._kernel.p, self._at, 0.0, np.ascontiguousarray(y), self._gaps)
        return np.array(self._gaps)

    def pressed(self, y: FloatArray) -> FloatArray:
        """Return every contact's normal force in N, in its present phase, and penetration, (K, 2)."""
        gaps, pushing = self.gaps(y), self._contacts["phase"] == CONTACT
        return np.column_stack([np.where(pushing, gaps["elastic"] * gaps["push"], 0.0), gaps["depth"]])

    def phases(self) -> FloatArray:
        """Return every contact's phase and a/v0, (2K,)."""
        return np.column_stack([self._contacts["phase"], self._contacts["memory"]]).ravel()

    def set_phases(self, phases: FloatArray) -> None:
        """Set every contact's phase and a/v0, (2K,)."""
        self._contacts["phase"], self._contacts["memory"] = phases[::2], phases[1::2]

    def flying(self, contact: int) -> bool:
        """Return whether a contact is in flight."""
        return bool(self._contacts["phase"][contact] == FLIGHT)

    def alarm_of(self, contact: int, kind: int) -> tuple[str, float]:
        """Return the watched field, and its sign past an event, 0 if there is none in the present phase.

        Of kind 0 that is touch or release, of kind 1 clip or resume.
        """
        phase = self._contacts["phase"][contact]
        if kind == 0:
            return "g", 1.0 if phase == FLIGHT else -1.0
        return "push", 0.0 if phase == FLIGHT else -1.0 if phase == CONTACT else 1.0

    def alarm(self, contact: int, kind: int, y: FloatArray) -> float:
        """Return a number positive past an event (see ``alarm_of``)."""
        field, sign = self.alarm_of(contact, kind)
        return float(self.watched[field, contact](sign, 0.0, 0.0, y))

    def due(self, contact: int, kind: int, y: FloatArray) -> bool:
        """Return whether an event has come: its alarm is on, or a pin less than round-off short of it."""
        alarm, (_, sign) = self.alarm(contact, kind, y), self.alarm_of(contact, kind)
        if kind != 0 or (alarm > 0 and not self.rigid(contact)):
            return alarm > 0
        rate = sign * self.gaps(y)["rate"][contact]
        return bool(rate > 0 and -alarm < ROUND_OFF * np.abs(y[: self.n]).max())

    def rigid(self, contact: int) -> bool:
        """Return whether a contact is with a rigid wall, from which its pin rebounds."""
        return contact in self._rigid

    def rebound(self, t: float, y: FloatArray) -> tuple[FloatArray, list[Impact]]:
        """Return y after the impacts of the pins that touch rigid walls, and what these did.

        Raises:
            AdapterCannot: bounces have accumulated: a pin is to follow its wall, which takes rows that come
                and go.
            SimulationFailed: there is no way on.
        """
        assert self._rebounds is not None
        q, v = np.split(y[: 2 * self.n], 2)
        try:
            after = self._rebounds(t, q, v)
        except SolverError as error:
            raise SimulationFailed(str(error)) from error
        if after.following:
            joint = self._rigid[after.following[0]]
            raise AdapterCannot(
                f"bounces accumulate at t = {t:.6g} s: pin {joint} comes to rest on its wall, and this "
                f"project's model of the engine has none that follows it (clearance.{joint}.law = 'rigid')"
            )
        gains = {"drivers": after.driver_work_J}
        for impact in after.impacts:
            for of, gain in (("normal", impact.normal_impulse_N_s), ("impact", impact.energy_lost_J)):
                gains[f"{of}{impact.contact}"] = gains.get(f"{of}{impact.contact}", 0.0) + gain
        sums = y[2 * self.n :] + [gains.get(name, 0.0) for name in self.sums]
        return np.concatenate([q, after.v, sums]), after.impacts

    def switch(self, contact: int, kind: int, y: FloatArray) -> None:
        """Change a contact's phase at an event, where a touch stores its a/v0."""
        phase = self._contacts["phase"]
        if kind == 1:
            phase[contact] = CLIPPED if phase[contact] == CONTACT else CONTACT
        elif self.flying(contact):
            self._contacts["memory"][contact] = self._memory(contact, self.gaps(y)["rate"][contact])
            phase[contact] = CONTACT
        else:
            phase[contact] = FLIGHT

    def sense(self, y: FloatArray, memory: FloatArray) -> None:
        """Set every phase by the signs of penetration and force at y.

        ``memory`` (K,) has the contacts' a/v0; where that is NaN the present speed stands for v0.
        """
        gaps, contacts = self.gaps(y), self._contacts
        for k in range(len(memory)):
            contacts["phase"][k] = CONTACT if gaps["g"][k] > 0 else FLIGHT
            if gaps["g"][k] > 0:
                new = self._memory(k, abs(gaps["rate"][k]))
                contacts["memory"][k] = new if np.isnan(memory[k]) else memory[k]
        clipped = (contacts["phase"] == CONTACT) & (contacts["clipped"] > 0) & (self.gaps(y)["push"] < 0)
        contacts["phase"][clipped] = CLIPPED

    def remember(self, y: FloatArray, memory: FloatArray) -> FloatArray:
        """Return the memory after a step that ended at y: a/v0 of contacts begun in it, NaN in flight."""
        self.sense(y, memory)
        return np.where(self._contacts["phase"] == FLIGHT, np.nan, self._contacts["memory"])

    def _memory(self, contact: int, speed_m_s: float) -> float:
        law = self._joints[contact].compliance
        return law.damping_factor / max(speed_m_s, law.minimum_impact_speed_m_s)
