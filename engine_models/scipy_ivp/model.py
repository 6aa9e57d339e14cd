"""The reference's equations as a right-hand side y' = f(t, y) that an integrator from outside can call.

y = (q, q', sums) holds n coordinates, n velocities, and integrals since t = 0: a driver's work where there is
one, then what every contact adds up (``contact.rates_of``), then works of loads. The text is the reference's
own, (1)-(10) without stabilisation, compiled: a call from Python takes 1-2 us, most of it Python's and not
the equations'.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray
from engine_models.mechanics.start_check import checked_start
from engine_models.reference.model import mechanism_of
from engine_models.scene.scene import Scene
from reference_solver.compiled.kernel import Kernel, Topology, places
from reference_solver.compiled.store import load_kernel
from reference_solver.contact import types
from reference_solver.equations import Equations
from reference_solver.failures import SolverError
from reference_solver.solution import Solution
from reference_solver.solver import contact_record

#: A contact that is over: time of touch, contact, duration, approach speed, normal impulse and energy lost.
ContactEnd = tuple[float, int, float, float, float, float]


def derivative_source(topology: Topology) -> str:
    """Return a module with ``evaluate`` and, for contacts, ``gaps`` (see ``kernel.Kernel.gaps``).

    ``evaluate(p, contacts, t, y, rate, forces)`` writes y', and in ``forces`` {lambda} and the contacts'
    forces, and tells whether it could.
    """
    kernel = Kernel(topology)
    draft = kernel.begin()
    answer = draft.equations.answer(draft.t, draft.q, draft.v, draft.phases)
    powers = [answer.powers[name] for name in _integrated(draft.equations)]
    stores = places("rate[{}]", [*draft.v, *answer.accelerations, *powers])
    forces = list(answer.multipliers)
    for k, friction in enumerate(answer.friction_N):
        forces += [answer.powers[f"normal{k}"], friction]
    stores += places("forces[{}]", forces)
    arguments = ["p", "contacts", "t", "y", "rate", "forces"]
    kernel.entry("evaluate", arguments, draft, answer.ok, stores, "y")
    if topology.mechanism.contacts:
        kernel.gaps()
    return kernel.source()


def _integrated(equations: Equations) -> list[str]:
    """Return the names of the powers that are not zero at all times."""
    driven = equations.mechanism.prescribed or any(c != 0 for c in equations.C)
    return equations.power_names[0 if driven else 1 :]


_source_of = cache(derivative_source)


class Derivative:
    """f(t, y) of a scene, with the phases of its K contacts, which are constant between events.

    The contacts are in flight to begin with (see ``contact.loop``).
    ``start`` is y at t = 0; ``sums`` names the integrals behind q and q' in it.
    """

    def __init__(self, scene: Scene) -> None:
        q, v = checked_start(scene)
        mechanism = mechanism_of(scene)
        topology = Topology(mechanism)
        self._kernel = load_kernel(_source_of(topology.marked()))
        self._parameters = topology.parameters(self._kernel, q.ravel())
        self._readable = Equations(mechanism, q.ravel())
        self.mechanism, self._joints, self._rows = mechanism, mechanism.contacts, len(self._readable.C)
        self._forces = np.empty(self._rows + 2 * len(self._joints))
        self._contacts = np.array([contact_record(joint) for joint in self._joints], types.CONTACT_RECORD)
        self.n = self._readable.n
        self.sums = tuple(_integrated(self._readable))
        self.contact_count = len(self._joints)
        #: Contact and kind of every alarm; the force of a contact changes its law only where that is clipped.
        clipped = [k for k, joint in enumerate(self._joints) if joint.compliance.clipped]
        self.events = [(k, 0) for k in range(self.contact_count)] + [(k, 1) for k in clipped]
        self.start = np.concatenate([q.ravel(), v.ravel(), np.zeros(len(self.sums))])
        self._refused: tuple[float, FloatArray] | None = None
        # Compiled or loaded here, out of any timing.
        self(0.0, self.start)
        if self._joints:
            self.gaps(self.start)

    def __call__(self, t: float, y: FloatArray) -> FloatArray:
        """Return y' in the present phases, NaN where [B] has lost rank: an integrator rejects such a step."""
        rate = np.empty_like(y)
        if not self._kernel.evaluate(self._parameters, self._contacts, t, y, rate, self._forces):
            rate[:] = np.nan
            self._refused = (t, y.copy())
        return rate

    def diagnosis(self, since_s: float) -> str:
        """Return what is wrong at the last state without y', empty if there was none since a time."""
        if self._refused is None or self._refused[0] < since_s or not np.isfinite(self._refused[1]).all():
            return ""
        t, y = self._refused
        try:
            self._readable.accelerations(t, y[: self.n], y[self.n : 2 * self.n], self.phases().reshape(-1, 2))
        except SolverError as error:
            return str(error)
        return f"the constraint matrix is about to lose rank at t = {t:.6g} s"

    def forces(self, t: float, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return {lambda} (m,), and every contact's normal force and friction (2K,), in its present phase."""
        self(t, y)
        return self._forces[: self._rows].copy(), self._forces[self._rows :].copy()

    def solution(
        self,
        end_time_s: float,
        samples: Sequence[FloatArray],
        phases: Sequence[FloatArray],
        ends: Sequence[ContactEnd],
        steps: int,
    ) -> Solution:
        """Return a run with equally spaced samples of y and phases as a solution, with the forces at them."""
        y, forces, unknown = np.array(samples), [], float("nan")
        time = np.linspace(0.0, end_time_s, len(y))
        for t, at, then in zip(time, y, phases, strict=True):
            self.set_phases(then)
            forces.append(self.forces(t, at))
        multipliers, of_contacts = (np.array(column) for column in zip(*forces, strict=True))
        impacts = [
            types.Impact(t, k, "contact", duration, speed, impulse, unknown, lost, unknown)
            for t, k, duration, speed, impulse, lost in ends
        ]
        return Solution(
            mechanism=self.mechanism,
            time_s=time,
            q=y[:, : self.n],
            v=y[:, self.n : 2 * self.n],
            multipliers=multipliers,
            phases=np.reshape(phases, (len(y), -1, 2)),
            normal_force_N=of_contacts[:, ::2],
            friction_force_N=of_contacts[:, 1::2],
            sums=self.named_sums(y),
            events=np.zeros(0, types.EVENT_RECORD),
            impacts=tuple(impacts),
            mode_changes=(),
            steps=steps,
        )

    def named_sums(self, y: FloatArray) -> dict[str, FloatArray]:
        """Return the integrals in y, (..., size), by name."""
        return dict(zip(self.sums, np.moveaxis(y, -1, 0)[2 * self.n :], strict=True))

    def gaps(self, y: FloatArray) -> NDArray[np.void]:
        """Return every contact's gap (K,), records of ``GAP_RECORD``."""
        gaps = np.zeros(len(self._joints), types.GAP_RECORD)
        self._kernel.gaps(self._parameters, self._contacts, 0.0, types.Motion(self.n, y, gaps))
        return gaps

    def phases(self) -> FloatArray:
        """Return every contact's phase and a/v0, (2K,)."""
        return np.column_stack([self._contacts["phase"], self._contacts["memory"]]).ravel()

    def set_phases(self, phases: FloatArray) -> None:
        """Set every contact's phase and a/v0, (2K,)."""
        self._contacts["phase"], self._contacts["memory"] = phases[::2], phases[1::2]

    def flying(self, contact: int) -> bool:
        """Return whether a contact is in flight."""
        return bool(self._contacts["phase"][contact] == types.FLIGHT)

    def alarm(self, contact: int, kind: int, y: FloatArray) -> float:
        """Return a number positive past an event: of kind 0, touch or release, or 1, clip or resume."""
        gap, phase = self.gaps(y)[contact], self._contacts["phase"][contact]
        if kind == 0:
            return float(gap["g"] if phase == types.FLIGHT else -gap["g"])
        return (
            -1.0 if phase == types.FLIGHT else float(-gap["push"] if phase == types.CONTACT else gap["push"])
        )

    def switch(self, contact: int, kind: int, y: FloatArray) -> None:
        """Change a contact's phase at an event, where a touch stores its a/v0."""
        phase = self._contacts["phase"]
        if kind == 1:
            phase[contact] = types.CLIPPED if phase[contact] == types.CONTACT else types.CONTACT
        elif self.flying(contact):
            self._contacts["memory"][contact] = self._memory(contact, self.gaps(y)["rate"][contact])
            phase[contact] = types.CONTACT
        else:
            phase[contact] = types.FLIGHT

    def sense(self, y: FloatArray, memory: FloatArray) -> None:
        """Set every phase by the signs of penetration and force at y.

        ``memory`` (K,) has the contacts' a/v0; where that is NaN the present speed stands for v0.
        """
        gaps, contacts = self.gaps(y), self._contacts
        for k in range(len(memory)):
            contacts["phase"][k] = types.CONTACT if gaps["g"][k] > 0 else types.FLIGHT
            if gaps["g"][k] > 0:
                new = self._memory(k, abs(gaps["rate"][k]))
                contacts["memory"][k] = new if np.isnan(memory[k]) else memory[k]
        clipped = (
            (contacts["phase"] == types.CONTACT) & (contacts["clipped"] > 0) & (self.gaps(y)["push"] < 0)
        )
        contacts["phase"][clipped] = types.CLIPPED

    def remember(self, y: FloatArray, memory: FloatArray) -> FloatArray:
        """Return the memory after a step that ended at y: a/v0 of contacts begun in it, NaN in flight."""
        self.sense(y, memory)
        return np.where(self._contacts["phase"] == types.FLIGHT, np.nan, self._contacts["memory"])

    def _memory(self, contact: int, speed_m_s: float) -> float:
        law = self._joints[contact].compliance
        return law.damping_factor / max(speed_m_s, law.minimum_impact_speed_m_s)
