"""The two faces of the algorithm: kernels compiled for a topology, or the equations as they stand.

Both take arrays of contacts, a motion, a clock and records (see ``contact_types``), and change them in place.
"""

import numpy as np
from numpy.typing import NDArray

from reference_solver import contact_loop
from reference_solver.contact import gap
from reference_solver.contact_types import DONE, FAILED, SPENT, Motion, Rates, Records
from reference_solver.equations import Equations
from reference_solver.kernel import Topology, source_of
from reference_solver.kernel_store import compiled, load_kernel
from reference_solver.methods import step
from reference_solver.points import State

FloatArray = NDArray[np.float64]
RecordArray = NDArray[np.void]


class CompiledFace:
    """The kernel of a topology, and the loop that calls it."""

    #: Steps times coordinates per call: a fraction of a second, so that an interrupt is answered.
    chunk = 2_000_000

    def __init__(self, topology: Topology, q_start: FloatArray) -> None:
        self._kernel = load_kernel(source_of(topology.marked()))
        self._parameters = topology.parameters(self._kernel, q_start)
        self._located = bool(topology.mechanism.contacts)

    def gaps(self, contacts: RecordArray, t: float, motion: Motion) -> None:
        """Set the contacts' gaps of a motion at t."""
        if self._located:
            self._kernel.gaps(self._parameters, contacts, t, motion)

    def advance(self, contacts: RecordArray, motion: Motion, clock: RecordArray, records: Records) -> int:
        """Advance a motion as ``contact_loop.advance`` does; without contacts, from sample to sample."""
        kernel, p = self._kernel, self._parameters
        if self._located:
            loop = compiled(contact_loop.advance, contact_loop.ADVANCE)
            functions = kernel.step, kernel.slopes, kernel.mobilities
            return int(loop(*functions, p, contacts, motion, clock, records))
        return self._from_sample_to_sample(contacts, motion, clock, records)

    def _from_sample_to_sample(
        self, contacts: RecordArray, motion: Motion, clock: RecordArray, records: Records
    ) -> int:
        """Advance a motion without contacts; its steps have one length, of which samples are multiples."""
        kernel, p, rates = self._kernel, self._parameters, contact_loop.empty_rates(motion, records)
        (now,) = clock
        h, steps, taken, most = (now[name].item() for name in ("longest", "steps", "taken", "budget"))
        status, times = DONE, records.time.tolist()
        for time in times[taken:]:
            due = round(time / h) - steps
            count = min(due, most - steps)
            done = kernel.advance(p, motion.q, motion.v, motion.sums, h, steps, count)
            steps += done
            held = done == due and kernel.slopes(p, contacts, time, motion, rates)
            if not held:
                status = SPENT if done == count < due else FAILED
                break
            records.q[taken], records.v[taken], records.sums[taken] = motion.q, motion.v, motion.sums
            records.multipliers[taken] = rates.multipliers
            taken += 1
        now["steps"], now["taken"], now["time"], now["tried"] = steps, taken, steps * h, h
        return status


class ReadableFace:
    """The equations of a topology in numbers: slow, to be read, and to say what is wrong with a step."""

    #: Steps times coordinates per call: some seconds.
    chunk = 20_000

    def __init__(self, topology: Topology, q_start: FloatArray) -> None:
        self._topology = topology
        mechanism = topology.mechanism
        self.equations = Equations(mechanism, q_start, topology.baumgarte, topology.following)

    def advance(self, contacts: RecordArray, motion: Motion, clock: RecordArray, records: Records) -> int:
        """Advance a motion by ``contact_loop.advance``, run as it stands."""
        contacts, gaps, clock, events = (
            table.view(np.recarray) for table in (contacts, motion.gaps, clock, records.events)
        )
        at, rows = motion._replace(gaps=gaps), records._replace(events=events)
        functions = self.step, self.slopes, self.mobilities
        with np.errstate(all="ignore"):
            return int(contact_loop.advance(*functions, None, contacts, at, clock, rows))

    def step(self, _: object, contacts: RecordArray, t: float, h: float, old: Motion, new: Motion) -> bool:
        """Set ``new`` to the state after a step, with the sums of the step alone.

        Raises:
            SingularConfiguration, PainleveParadox, FrictionTooStiff: as ``Equations.required`` does.
        """
        equations, phases, method = self.equations, phases_of(contacts), self._topology.method

        def answer(t: float, q: FloatArray, v: FloatArray) -> object:
            return equations.required(t, q, v, phases, h, method)

        def project(t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, float, bool]:
            *found, ok = equations.project(t, q, v, phases)
            if not ok and np.isfinite(q).all():
                equations.refuse_singular(t, q)
            return (*found, ok)

        found = step(method, answer, project if self._topology.projected else None, t, old.q, old.v, h)
        new.q[:], new.v[:], new.sums[:] = found.q, found.v, [*found.sums.values(), found.removed]
        finite = bool(np.isfinite(new.q).all() and np.isfinite(new.v).all())
        if finite:
            self.gaps(contacts, t + h, new)
        return finite

    def gaps(self, contacts: RecordArray, t: float, motion: Motion) -> None:
        """Set the contacts' gaps of a motion at t."""
        phases, state, powers = phases_of(contacts), State(motion.q, motion.v), dict[str, float]()
        if self._topology.following:
            powers = self.equations.required(t, motion.q, motion.v, phases).powers
        for k, joint in enumerate(self._topology.mechanism.contacts):
            phase, memory = phases[k]
            fields = gap(joint, phase, memory, state, powers.get(f"normal{k}", 0.0))
            motion.gaps[k] = tuple(fields.values())

    def slopes(self, _: object, contacts: RecordArray, t: float, motion: Motion, rates: Rates) -> bool:
        """Set the rates at a state."""
        found = self.equations.required(t, motion.q, motion.v, phases_of(contacts))
        rates.a[:], rates.powers[:] = found.accelerations, [*found.powers.values(), found.removed_W]
        rates.multipliers[:] = found.multipliers[: self.equations.own_rows]
        rates.forces[::2] = [found.powers[f"normal{k}"] for k in range(len(contacts))]
        rates.forces[1::2] = found.friction_N
        return True

    def mobilities(self, _: object, motion: Motion, out: FloatArray) -> bool:
        """Set ``out`` (K,) to the contacts' mobilities."""
        out[:] = self.equations.mobilities(motion.q)
        return True


def phases_of(contacts: RecordArray) -> FloatArray:
    """Return phase and memory of every contact, (K, 2)."""
    return np.column_stack([contacts["phase"], contacts["memory"]])
