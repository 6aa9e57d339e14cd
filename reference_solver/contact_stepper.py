"""Runs a mechanism with compliant contacts: the compiled driver of ``contact_loop``, events, energies."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from reference_solver.chunks import Tell, nobody
from reference_solver.compiled import load_kernel
from reference_solver.contact import ContactState, contact_state
from reference_solver.contact_driver import load_driver
from reference_solver.contact_kernel_source import all_rates, contact_kernel_source
from reference_solver.contact_log import EVENT, impacts_of
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
#: No samples asked for.
NONE = np.empty(0)


@dataclass(frozen=True)
class ContactSolution:
    """The sampled motion, s times and K contacts, with what the contacts did.

    ``joints`` (K,) are the contacts, ``phases`` (s, 2K) the phase and a/v0 of each. ``sums`` holds integrals
    since t = 0 at the samples, (s,) each, by RK4's own quadrature: normalk, the normal impulse of contact k
    in N s, and the energies dissipated in J: lossk by its normal force, clipk where that was clipped, slidek
    by friction. ``events`` (E, 5) are (time, contact, what, rate of g, penetration) with what = 1 for touch,
    -1 release, 2 force clipped, 3 force back. ``impacts[k]`` (I, 5) are the contacts k that have ended: time
    of touch, duration, approach speed, normal impulse, energy lost. ``steps`` counts all steps taken.
    """

    motion: Solution
    joints: tuple[ClearanceJoint, ...]
    phases: FloatArray
    sums: dict[str, FloatArray]
    events: FloatArray
    impacts: list[FloatArray]
    steps: int

    @cached_property
    def contacts(self) -> list[list[ContactState]]:
        """Of every contact k the list of its s states, read out of the motion when first asked for."""
        states = list(zip(self.motion.q, self.motion.v, strict=True))
        return [
            [
                contact_state(joint, phase, damping, q, v)
                for (q, v), (phase, damping) in zip(states, self.phases[:, 2 * k : 2 * k + 2], strict=True)
            ]
            for k, joint in enumerate(self.joints)
        ]

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
        kernel = self._kernel
        self._advance = partial(load_driver().advance, kernel.step, kernel.gap_accelerations, kernel.slopes)
        self._parameters = np.array(writer.parameters)
        self._equations = Equations(mechanism, q_start, baumgarte)
        self.mechanism, self.choice = mechanism, choice
        self.rate_names = tuple(all_rates(writer))
        self._laws = np.array([_constants(joint) for joint in mechanism.contacts]).reshape(-1, 8)
        self._touch, self._gap = np.zeros((len(self._laws), 3)), np.zeros((len(self._laws), 4))
        self._control = np.array([choice.longest_s, choice.steps_per_contact, float(choice.locate_events)])
        #: Phase and a/v0 of every contact, (2K,); drivers' work, the rates' sums and, with a stabilisation,
        #: the energy removed by it; events; steps.
        self.phases = np.zeros(2 * len(self._laws))
        self.totals = np.zeros(1 + len(self.rate_names) + (stabilisation != "none"))
        self.events: list[FloatArray] = []
        self.steps = 0
        self._log = np.zeros((LOG_ROWS, EVENT + len(self.totals)))
        #: Columns of a sample: q, q', totals, phases, {lambda}.
        self.columns = np.cumsum([2 * writer.n, len(self.totals), len(self.phases), writer.m])
        self.columns = np.insert(self.columns, 0, writer.n)
        q = q_start.copy()
        self.advance(q, np.zeros_like(q), 0.0, 0.0)  # compiled or loaded here, out of any timing

    def advance(
        self,
        q: FloatArray,
        v: FloatArray,
        t: float,
        end: float,
        times: FloatArray = NONE,
        tell: Tell = nobody,
    ) -> FloatArray:
        """Advance q and v in place from t to ``end``; return a row (see ``columns``) for each of the times.

        The ``times`` (s,) ascend from t to ``end``. A step lands on ``end``; on the others only where events
        are not located. ``tell`` is called with the time reached after every call of the kernel.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            NonFiniteState: the state overflows.
            Stalled: steps have become too short to move time on.
        """
        samples, taken, status = np.empty((len(times), self.columns[-1])), 0, 1
        self._kernel.gaps(self._parameters, q, v, self._gap)
        while status:
            begin = t
            t, events, added, steps, status = self._advance(
                self._parameters,
                self.phases,
                self._laws,
                self._touch,
                q,
                v,
                self._gap,
                self.totals,
                t,
                end,
                self._control,
                self._log,
                times[taken:],
                samples[taken:],
                CHUNK,
            )
            taken += added
            self.steps += steps
            tell(t)
            if t == begin and status == 1:
                raise Stalled(t, steps)
            self.events.extend(self._log[:events].copy())
            if status == 3:
                self._equations.phases = self.phases
                self._equations.accelerations(t, q, v)  # says what is wrong, if it is at this very state
                raise NonFiniteState(t, self._control[0])
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise NonFiniteState(end, self._control[0])
        return samples

    def multipliers(self, t: float, q: FloatArray, v: FloatArray) -> FloatArray:
        """Return {lambda} (m,) at a state in the present phases."""
        a, rate, out = np.empty_like(q), np.empty_like(self.totals), np.empty(len(self._equations.C))
        self._kernel.slopes(self._parameters, self.phases, t, q, v, a, rate, out)
        return out


def _constants(joint: ClearanceJoint) -> tuple[float, ...]:
    """Return a contact's row of ``laws`` in ``contact_loop``."""
    law, friction = joint.law, joint.friction
    slope = 0.0 if friction is None else friction.coefficient / friction.regularisation_speed_m_s
    if friction is not None and friction.kind == "ambrosio":
        slope = friction.coefficient / (friction.regularisation_speed_m_s - friction.dead_band_speed_m_s)
    speed = law.minimum_impact_speed_m_s
    first = (law.stiffness, law.exponent, law.damping_factor, speed)
    return *first, joint.radial_clearance_m, slope, law.damping_N_s_m, float(law.clipped)


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
    stepper: ContactStepper,
    q: FloatArray,
    v: FloatArray,
    end_time_s: float,
    samples: int,
    tell: Tell = nobody,
) -> ContactSolution:
    """Run a stepper from q and v, which it overwrites, and return ``samples + 1`` states.

    Where events are located, steps are the run's own, whatever the samples: those within a step are
    interpolated, at the order of the step (see ``contact_samples``). The plain algorithm, whose steps all
    have one length, which is to fit into the samples' interval, lands on every sample.
    """
    time = np.linspace(0.0, end_time_s, samples + 1)
    rows = stepper.advance(q, v, 0.0, end_time_s, time, tell)
    qs, vs, totals, phases, multipliers = np.split(rows, stepper.columns[:-1], axis=1)
    names = stepper.rate_names
    events = np.array(stepper.events).reshape(-1, EVENT + totals.shape[1])
    removed = totals[:, -1] if totals.shape[1] > 1 + len(names) else np.zeros(len(time))
    return ContactSolution(
        motion=Solution(time, qs, vs, multipliers, totals[:, 0], removed),
        joints=stepper.mechanism.contacts,
        phases=phases,
        sums=dict(zip(names, totals[:, 1 : 1 + len(names)].T, strict=True)),
        events=events[:, :EVENT],
        impacts=[impacts_of(k, events, names) for k in range(len(stepper.mechanism.contacts))],
        steps=stepper.steps,
    )
