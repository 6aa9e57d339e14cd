"""A scene's equations of motion as heyoka's integrators: one for every combination of its contacts' phases.

In flight the independent variable is the time. Where pins touch, K delta^n has no Taylor series at delta = 0,
at touch and release, unless n is whole. So there the roots w = sqrt(delta) of the penetrations are variables,
too, and the independent variable is s with dt = (the product of all w) ds (after Sundman 1912). Then
delta^n = w^(2n), and

    dw/ds = delta'/2 times the product of the other w

are analytic from touch, w = 0, to release, w = 0 again. The time is a variable.
"""

import time
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import numpy as np

from engine_models.engine import FloatArray
from engine_models.heyoka.expressions import Translation
from engine_models.mechanics.minimal.tree import Posture, Tree
from engine_models.reference.model import mechanism_of
from engine_models.scene.scene import Scene
from reference_solver.contact.types import CONTACT, FLIGHT
from reference_solver.equations import Equations
from reference_solver.mechanism.contact_laws import FRICTION_LAWS
from reference_solver.mechanism.loads import pair
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.points import State, ends_of
from reference_solver.tape import Scalar, Tape, array

#: Parameters of every contact: its a/v0, and how far past the wall it touches, in m.
OF_CONTACT = ("memory", "past")
#: The phases of all contacts.
Phases = tuple[float, ...]
#: A contact and the kind of its event: 0 of touch or release, 1 of clip or resume.
Event = tuple[int, int]


@dataclass(frozen=True)
class System:
    """An integrator: its state is z, z', then with contacts the w of ``touching``, and the time.

    Its parameters are the end of the run in s, which is the last of its terminal events where the time is a
    variable, and all contacts' of each of ``OF_CONTACT``, as far as they occur. The other terminal events are
    ``events``.
    """

    integrator: Any
    touching: tuple[int, ...]
    events: tuple[Event, ...]

    def clock(self, series: Any, own: FloatArray) -> FloatArray:
        """Return the times in s of values of the independent variable, (n,) each."""
        return np.array(series(own))[:, -1] if self.touching else own


class Systems:
    """The integrators of a scene at a tolerance, made when they are first asked for.

    ``compiled_s`` is how long that has taken so far.
    """

    def __init__(self, scene: Scene, tolerance: float) -> None:
        self._mechanism, self._tolerance = mechanism_of(scene), tolerance
        self._driven, self._made = scene.speed_is_prescribed, dict[Phases, System]()
        self.compiled_s = 0.0

    def of(self, phases: Phases) -> System:
        """Return the integrator of contacts in these phases."""
        if phases not in self._made:
            began = time.perf_counter()
            self._made[phases] = self._make(phases)
            self.compiled_s += time.perf_counter() - began
        return self._made[phases]

    def _make(self, phases: Phases) -> System:
        draft = _Draft(self._mechanism, phases)
        flow, events = draft.flow(0.0 if self._driven else None), draft.events()
        inputs = dict(zip(draft.names, hy.make_vars(*draft.names), strict=True))
        names = [f"{name}{k}" for name in OF_CONTACT for k in range(len(phases))]
        expression = Translation({**inputs, **{name: hy.par[k] for k, name in enumerate(names, 1)}})
        terminal = [_event(expression(value), sign) for value, sign in events.values()]
        if draft.touching:
            terminal.append(_event(inputs["time"] - hy.par[0], 1.0))
        integrator = hy.taylor_adaptive(
            [(inputs[name], expression(rate)) for name, rate in flow.items()],
            [0.0] * len(flow),
            tol=self._tolerance,
            t_events=terminal,
        )
        return System(integrator, draft.touching, tuple(events))


def _event(value: hy.expression, sign: float) -> Any:
    """Return the event that a value passes zero, upwards or downwards."""
    way = hy.event_direction.positive if sign > 0 else hy.event_direction.negative
    return hy.t_event(value, direction=way)


class _Draft:
    """The equations of one system on a tape."""

    def __init__(self, mechanism: Mechanism, phases: Phases) -> None:
        self._phases, self._joints, tape = phases, mechanism.contacts, Tape()
        tree = Tree(mechanism)
        n = len(tree.coordinates)
        self._z, self._u = tape.inputs("z", n), tape.inputs("u", n)
        self.touching = tuple(k for k, phase in enumerate(phases) if phase != FLIGHT)
        self._w = {k: tape.input(f"w{k}") for k in self.touching}
        numbers = range(len(phases))
        self._memory, self._past = ([tape.input(f"{name}{k}") for k in numbers] for name in OF_CONTACT)
        self._posture = Posture(tree, self._z, self._u)
        q, v = array(self._posture.q), array(self._posture.v)
        self._state = State(q, v)
        self._applied = Equations(mechanism, np.zeros(len(q))).applied_force(q, v)
        self.names = [f"{letter}{k}" for letter in "zu" for k in range(n)]
        self.names += [f"w{k}" for k in self.touching] + ["time"] * bool(self.touching)

    def flow(self, driven: float | None) -> dict[str, Scalar]:
        """Return the rates of all variables by their names."""
        F = [*self._applied]
        for k in self.touching:
            if self._phases[k] == CONTACT:
                for body, force in self._force(k).items():
                    for axis in range(3 * (body >= 0)):
                        F[3 * body + axis] = F[3 * body + axis] + force[axis]
        accelerations, _ = self._posture.accelerations(array(F), driven)
        slow: Scalar = 1.0
        for w in self._w.values():
            slow = slow * w
        rates = [slow * rate for rate in [*self._u, *accelerations]]
        for k in self.touching:
            others: Scalar = 0.5
            for j in self.touching:
                others = others * (1.0 if j == k else self._w[j])
            rates.append(others * self._rate(k))
        return dict(zip(self.names, [*rates, slow], strict=False))

    def events(self) -> dict[Event, tuple[Scalar, float]]:
        """Return values that pass zero at events, and the signs of their rates there."""
        events: dict[Event, tuple[Scalar, float]] = {}
        for k, (joint, phase) in enumerate(zip(self._joints, self._phases, strict=True)):
            if phase == FLIGHT:
                d, reach = self._gap(k)[0], joint.radial_clearance_m + self._past[k]
                events[k, 0] = d @ d - reach * reach, 1.0
                continue
            events[k, 0] = self._w[k], -1.0
            if joint.compliance.clipped:
                push = 1.0 + self._memory[k] * self._rate(k)
                events[k, 1] = push, -1.0 if phase == CONTACT else 1.0
        return events

    def _gap(self, k: int) -> tuple[Scalar, Scalar]:
        bearing, pin = ends_of(self._joints[k], self._state)
        return pin.place - bearing.place, pin.rate - bearing.rate

    def _normal(self, k: int) -> Scalar:
        """Return n of a contact, whose penetration is w^2."""
        distance = self._joints[k].radial_clearance_m + self._w[k] * self._w[k]
        d, _ = self._gap(k)
        return array([d[0] / distance, d[1] / distance])

    def _rate(self, k: int) -> Scalar:
        return self._normal(k) @ self._gap(k)[1]

    def _force(self, k: int) -> dict[int, Scalar]:
        """Return the generalised forces of a contact (see ``contact.force``)."""
        joint, w, n, rate = self._joints[k], self._w[k], self._normal(k), self._rate(k)
        law, (bearing, pin), (_, d_dot) = joint.compliance, ends_of(joint, self._state), self._gap(k)
        elastic: Scalar = law.stiffness
        for _ in range(round(2 * law.exponent)):
            elastic = elastic * w
        share = 1.0 + self._memory[k] * rate if law.damping_factor else 1.0
        normal = elastic * share + law.damping_N_s_m * rate
        force = -normal * n
        if joint.friction is None:
            return pair(bearing, pin, force)
        arm_i = joint.bearing_radius_m + 0.5 * w * w
        arm_j = joint.bearing_radius_m - joint.radial_clearance_m - 0.5 * w * w
        sliding = n[0] * d_dot[1] - n[1] * d_dot[0] + pin.spin * arm_j - bearing.spin * arm_i
        share = FRICTION_LAWS[joint.friction.kind](joint.friction, sliding)
        tangential = -(joint.friction.coefficient * normal * share)
        force = force + tangential * array([-n[1], n[0]])
        return pair(bearing, pin, force, -arm_i * tangential, arm_j * tangential)
