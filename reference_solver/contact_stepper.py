"""Runs a mechanism with compliant contacts: the compiled driver of ``contact_loop``, events, energies."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_solver.compiled import load_kernel
from reference_solver.contact import ContactState, contact_state
from reference_solver.contact_kernel_source import all_rates, contact_kernel_source
from reference_solver.equations import Baumgarte, Equations
from reference_solver.errors import NonFiniteState, Stalled
from reference_solver.generator import EquationsWriter
from reference_solver.mechanism import ClearanceJoint, Mechanism
from reference_solver.solver import Solution, Stabilisation, StepChoice, check_start

FloatArray = NDArray[np.float64]

#: Steps per call of the kernel: a fraction of a second, so that an interrupt is answered.
CHUNK = 200_000
#: Events per call of the kernel.
LOG_ROWS = 256
#: Columns of an event in the log, ahead of the totals at that time.
EVENT = 5


@dataclass(frozen=True)
class ContactSolution:
    """The sampled motion, s times and K contacts, with what the contacts did.

    ``contacts[k]`` lists the s states of contact k. ``sums`` holds integrals since t = 0 at the samples,
    (s,) each, by RK4's own quadrature: normalk, the normal impulse of contact k in N s, and the energies
    dissipated in J: lossk by its normal force, clipk where that was clipped, slidek by friction. ``events``
    (E, 5) are (time, contact, what, rate of g, penetration) with what = 1 for touch, -1 release, 2 force
    clipped, 3 force back. ``impacts[k]`` (I, 5) are the contacts k that have ended: time of touch, duration,
    approach speed, normal impulse, energy lost. ``steps`` counts all steps taken.
    """

    motion: Solution
    contacts: list[list[ContactState]]
    sums: dict[str, FloatArray]
    events: FloatArray
    impacts: list[FloatArray]
    steps: int

    def losses_J(self) -> FloatArray:
        """Return the energy that all contacts have dissipated, (s,)."""
        return np.asarray(sum(value for name, value in self.sums.items() if not name.startswith("normal")))


class ContactStepper:
    """Advances a state event by event with the kernel of the mechanism's topology."""

    def __init__(
        self, mechanism: Mechanism, q_start: FloatArray, choice: StepChoice, stabilisation: Stabilisation
    ) -> None:
        baumgarte = stabilisation if isinstance(stabilisation, Baumgarte) else None
        writer = EquationsWriter(mechanism, q_start)
        self._kernel = load_kernel(contact_kernel_source(writer, baumgarte, stabilisation == "projection"))
        self._parameters = np.array(writer.parameters)
        self._equations = Equations(mechanism, q_start, baumgarte)
        self._mechanism, self._rows = mechanism, writer.m
        self.rate_names = tuple(all_rates(writer))
        self._laws = np.array([_constants(joint) for joint in mechanism.contacts]).reshape(-1, 8)
        self._touch = np.zeros((len(self._laws), 3))
        self._log = np.zeros((LOG_ROWS, EVENT + 1 + len(self.rate_names)))
        self._control = np.array([choice.longest_s, choice.steps_per_contact, float(choice.locate_events)])
        #: Phase and a/v0 of every contact, (2K,); drivers' work and the rates' sums; events; steps.
        self.phases = np.zeros(2 * len(self._laws))
        self.totals = np.zeros(1 + len(self.rate_names))
        self.events: list[FloatArray] = []
        self.steps = 0
        q = q_start.copy()
        self._call(q, np.zeros_like(q), 0.0, 0.0)  # compiled or loaded here, out of any timing

    def _call(self, q: FloatArray, v: FloatArray, t: float, end: float) -> tuple[float, int, int, int]:
        reached: tuple[float, int, int, int] = self._kernel.advance(
            self._parameters,
            self.phases,
            self._laws,
            self._touch,
            q,
            v,
            self.totals,
            t,
            end,
            self._control,
            self._log,
            CHUNK,
        )
        return reached

    def advance(self, q: FloatArray, v: FloatArray, t: float, end: float) -> None:
        """Advance q and v in place from t to ``end``.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            NonFiniteState: the state overflows.
            Stalled: steps have become too short to move time on.
        """
        while t < end:
            begin = t
            t, events, steps, status = self._call(q, v, t, end)
            if t == begin and status == 1:
                raise Stalled(t, steps)
            self.steps += steps
            self.events.extend(self._log[:events].copy())
            if status == 3:
                self._equations.phases = self.phases
                self._equations.accelerations(t, q, v)  # says what is wrong, if it is at this very state
                raise NonFiniteState(t, self._control[0])
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise NonFiniteState(end, self._control[0])

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda} (m,) at a state in the present phases."""
        out = np.empty(self._rows)
        self._kernel.multipliers(self._parameters, self.phases, t, q, v, out)
        return out

    def states(self, q: FloatArray, v: FloatArray) -> list[ContactState]:
        """Return every contact at a state in the present phases."""
        pairs = zip(self._mechanism.contacts, self.phases.reshape(-1, 2), strict=True)
        return [contact_state(joint, phase, damping, q, v) for joint, (phase, damping) in pairs]


def _constants(joint: ClearanceJoint) -> tuple[float, ...]:
    """Return a contact's row of ``laws`` in ``contact_loop``."""
    law, friction = joint.law, joint.friction
    slope = 0.0 if friction is None else friction.coefficient / friction.regularisation_speed_m_s
    if friction is not None and friction.kind == "ambrosio":
        slope = friction.coefficient / (friction.regularisation_speed_m_s - friction.dead_band_speed_m_s)
    speed = law.minimum_impact_speed_m_s
    first = (law.stiffness, law.exponent, law.damping_factor, speed)
    return *first, joint.radial_clearance_m, slope, law.damping_N_s_m, float(law.clipped)


def _impacts(contact: int, events: FloatArray, rate_names: tuple[str, ...]) -> FloatArray:
    """Return a contact's ends: time, duration, approach speed, normal impulse and energy lost, (I, 5)."""
    ends = events[(events[:, 1] == contact) & (np.abs(events[:, 2]) == 1)]
    ends = ends[int(len(ends) > 0 and ends[0, 2] < 0) :]  # it may have been closed at the start
    touches, releases = ends[: len(ends) // 2 * 2].reshape(-1, 2, events.shape[1]).swapaxes(0, 1)
    change = (releases - touches)[:, EVENT + 1 :]
    impulse = change[:, rate_names.index(f"normal{contact}")]
    mine = [k for k, name in enumerate(rate_names) if name.endswith(str(contact)) and "normal" not in name]
    lost = change[:, mine].sum(axis=1)
    return np.column_stack([touches[:, 0], releases[:, 0] - touches[:, 0], touches[:, 3], impulse, lost])


def solve_with_contacts(
    mechanism: Mechanism,
    q: FloatArray,
    v: FloatArray,
    *,
    end_time_s: float,
    samples: int,
    choice: StepChoice,
    stabilisation: Stabilisation = "projection",
) -> ContactSolution:
    """Integrate from q and v, each (3 x bodies,), in flight at every contact; record ``samples + 1`` states.

    Raises:
        InconsistentStart: q or v violate the constraints.
        SingularConfiguration: the constraint matrix loses full row rank.
        NonFiniteState: the state overflows.
    """
    q, v = np.array(q, dtype=float), np.array(v, dtype=float)
    check_start(Equations(mechanism, q), q, v)
    return record_contacts(ContactStepper(mechanism, q, choice, stabilisation), q, v, end_time_s, samples)


def record_contacts(
    stepper: ContactStepper, q: FloatArray, v: FloatArray, end_time_s: float, samples: int
) -> ContactSolution:
    """Run a stepper from q and v, which it overwrites, and return ``samples + 1`` states."""
    time = np.linspace(0.0, end_time_s, samples + 1)
    rows, states = [], []
    for k, t in enumerate(time):
        if k:
            stepper.advance(q, v, time[k - 1], t)
        rows.append((q.copy(), v.copy(), stepper.multipliers(t, q, v), stepper.totals.copy()))
        states.append(stepper.states(q, v))
    qs, vs, multipliers, totals = (np.array(column) for column in zip(*rows, strict=True))
    contacts = [list(one) for one in zip(*states, strict=True)]
    events = np.array(stepper.events).reshape(-1, EVENT + totals.shape[1])
    return ContactSolution(
        motion=Solution(time, qs, vs, multipliers, totals[:, 0]),
        contacts=contacts,
        sums=dict(zip(stepper.rate_names, totals[:, 1:].T, strict=True)),
        events=events[:, :EVENT],
        impacts=[_impacts(k, events, stepper.rate_names) for k in range(len(contacts))],
        steps=stepper.steps,
    )
