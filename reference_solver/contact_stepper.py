"""Runs a mechanism with compliant contacts: the compiled driver of ``contact_loop``, events, energies."""

from dataclasses import dataclass
from functools import cache, cached_property, partial

import numpy as np
from numpy.typing import NDArray

from reference_solver.chunks import Tell, nobody
from reference_solver.contact import ContactState, contact_state
from reference_solver.contact_driver import load_driver
from reference_solver.contact_laws import steepest
from reference_solver.contact_types import (
    CLOCK_RECORD,
    CONTACT_RECORD,
    EVENT_RECORD,
    FLIGHT,
    Records,
    new_motion,
)
from reference_solver.equations import Baumgarte, Equations
from reference_solver.errors import NonFiniteState, Stalled
from reference_solver.kernel import Topology, contact_source, stabilised
from reference_solver.kernel_store import load_kernel
from reference_solver.mechanism import ClearanceJoint, Mechanism
from reference_solver.solver import Solution, Stabilisation, StepChoice, check_start

FloatArray = NDArray[np.float64]

#: Steps per call of the kernel: a fraction of a second, so that an interrupt is answered.
CHUNK = 200_000
#: Events per call of the kernel.
LOG_ROWS = 256
#: What a contact dissipates by: its normal force, where that is clipped, and friction.
LOSSES = ("loss", "clip", "slide")
#: How the loop ends (see ``contact_loop``).
DONE, SPENT, FULL, FAILED = 0, 1, 2, 3


@dataclass(frozen=True)
class ContactSolution:
    """The sampled motion, s times and K contacts, with what the contacts did.

    ``joints`` (K,) are the contacts, ``phases`` (s, 2K) the phase and a/v0 of each. ``sums`` holds integrals
    since t = 0 at the samples, (s,) each, by RK4's own quadrature: normalk, the normal impulse of contact k
    in N s, and the energies dissipated in J: lossk by its normal force, clipk where that was clipped, slidek
    by friction. ``events`` (E,) are records (see ``contact_types.EVENT_RECORD``). ``impacts[k]`` (I, 5) are
    the contacts k that have ended: time of touch, duration, approach speed, normal impulse, energy lost.
    ``steps`` counts all steps taken.
    """

    motion: Solution
    joints: tuple[ClearanceJoint, ...]
    phases: FloatArray
    sums: dict[str, FloatArray]
    events: NDArray[np.void]
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


contact_source_of = cache(contact_source)


class ContactStepper:
    """Advances a state event by event with the kernel of the mechanism's topology."""

    def __init__(
        self, mechanism: Mechanism, q_start: FloatArray, choice: StepChoice, stabilisation: Stabilisation
    ) -> None:
        baumgarte = stabilisation if isinstance(stabilisation, Baumgarte) else None
        topology = Topology(mechanism, baumgarte, stabilisation == "projection")
        self._kernel = kernel = load_kernel(contact_source_of(topology.marked()))
        self._advance = partial(load_driver().advance, kernel.step, kernel.slopes, kernel.gap_accelerations)
        self._parameters = topology.parameters(kernel, q_start)
        self._equations = Equations(mechanism, q_start, baumgarte)
        self.mechanism, self.choice = mechanism, choice
        self.rate_names = tuple(self._equations.power_names[1:])
        #: The contacts, in flight to begin with; q and v, their gaps, and the sums of the drivers' work, of
        #: the rates and, with a stabilisation, of the energy removed by it; events; steps.
        self.contacts = np.array([contact_record(joint) for joint in mechanism.contacts], CONTACT_RECORD)
        sums = 1 + len(self.rate_names) + stabilised(topology)
        self.motion = new_motion(len(q_start), sums, len(mechanism.contacts))
        self.events, self.event_sums = [np.zeros(0, EVENT_RECORD)], [np.zeros((0, sums))]
        self.steps = 0
        self.run(q_start, np.zeros_like(q_start), 0.0, np.zeros(0))  # compiled or loaded, out of any timing

    def run(
        self, q: FloatArray, v: FloatArray, end_time_s: float, times: FloatArray, tell: Tell = nobody
    ) -> Records:
        """Run from q and v at t = 0 to the end; return the records, with a sample for each of the times.

        The ``times`` (s,) ascend from 0 to the end. A step lands on the end; on the others only where events
        are not located. ``tell`` is called with the time reached after every call of the kernel.

        Raises:
            SingularConfiguration: the constraint matrix loses full row rank.
            NonFiniteState: the state overflows.
            Stalled: steps have become too short to move time on.
        """
        self.motion.q[:], self.motion.v[:] = q, v
        clock = np.zeros(1, CLOCK_RECORD)
        clock["longest"], clock["per_contact"] = self.choice.longest_s, self.choice.steps_per_contact
        clock["located"], clock["end"] = self.choice.locate_events, end_time_s
        rows, sizes = len(times), (len(q), len(q), len(self.motion.sums), 2 * len(self.contacts))
        records = Records(
            np.zeros(LOG_ROWS, EVENT_RECORD),
            np.zeros((LOG_ROWS, len(self.motion.sums))),
            times,
            *(np.empty((rows, size)) for size in (*sizes, len(self._equations.C))),
        )
        self._kernel.gaps(self._parameters, self.contacts, self.motion)
        status = SPENT
        while status != DONE:
            begin, (now,) = float(clock["time"][0]), clock
            now["events"], now["budget"] = 0, now["steps"] + CHUNK
            status = self._advance(self._parameters, self.contacts, self.motion, clock, records)
            self.steps = int(now["steps"])
            tell(float(now["time"]))
            if now["time"] == begin and status == SPENT:
                raise Stalled(begin, CHUNK)
            self.events.append(records.events[: now["events"]].copy())
            self.event_sums.append(records.event_sums[: now["events"]].copy())
            if status == FAILED:
                self._equations.phases = np.column_stack(
                    [self.contacts["phase"], self.contacts["memory"]]
                ).ravel()
                # Says what is wrong, if it is at this very state.
                self._equations.accelerations(float(now["time"]), self.motion.q, self.motion.v)
                raise NonFiniteState(float(now["time"]), self.choice.longest_s)
        if not (np.isfinite(self.motion.q).all() and np.isfinite(self.motion.v).all()):
            raise NonFiniteState(end_time_s, self.choice.longest_s)
        return records


def contact_record(joint: ClearanceJoint) -> tuple[float, ...]:
    """Return a contact in flight as ``CONTACT_RECORD`` has it."""
    law, friction = joint.law, joint.friction
    slope = 0.0 if friction is None else friction.coefficient * steepest(friction)
    first = (FLIGHT, 0.0, 0.0, 0.0, 0.0, joint.radial_clearance_m, law.stiffness, law.exponent)
    return *first, law.damping_factor, law.minimum_impact_speed_m_s, slope, float(law.clipped)


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
    """Run a stepper from q and v and return ``samples + 1`` states.

    Where events are located, steps are the run's own, whatever the samples: those within a step are
    interpolated, at the order of the step (see ``contact_samples``). The plain algorithm, whose steps all
    have one length, which is to fit into the samples' interval, lands on every sample.
    """
    time = np.linspace(0.0, end_time_s, samples + 1)
    run, names = stepper.run(q, v, end_time_s, time, tell), stepper.rate_names
    events, sums = np.concatenate(stepper.events), np.concatenate(stepper.event_sums)
    removed = run.sums[:, -1] if run.sums.shape[1] > 1 + len(names) else np.zeros(len(time))
    return ContactSolution(
        motion=Solution(time, run.q, run.v, run.multipliers, run.sums[:, 0], removed),
        joints=stepper.mechanism.contacts,
        phases=run.phases,
        sums=dict(zip(names, run.sums[:, 1:].T, strict=False)),
        events=events,
        impacts=[impacts_of(k, events, sums[:, 1:], names) for k in range(len(stepper.contacts))],
        steps=stepper.steps,
    )


def impacts_of(
    contact: int, events: NDArray[np.void], sums: FloatArray, names: tuple[str, ...]
) -> FloatArray:
    """Return a contact's ends: time, duration, approach speed, normal impulse and energy lost, (I, 5).

    ``events`` (E,) is the log, ``sums`` (E, len(names)) what had been added up by then.
    """
    ends = np.flatnonzero((events["contact"] == contact) & (np.abs(events["what"]) == 1))
    touches, releases = ends[: len(ends) // 2 * 2].reshape(-1, 2).T
    change, began = sums[releases] - sums[touches], events["time_s"][touches]
    impulse = change[:, names.index(f"normal{contact}")]
    lost = sum(change[:, names.index(f"{of}{contact}")] for of in LOSSES if f"{of}{contact}" in names)
    duration = events["time_s"][releases] - began
    return np.column_stack([began, duration, events["rate"][touches], impulse, lost])
