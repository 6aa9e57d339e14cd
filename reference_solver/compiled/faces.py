"""The two faces of the algorithm: kernels compiled for a topology, or the equations as they stand.

Both take a state, arrays of contacts, a motion, a clock, records, what a loop works on, and error control if
there is any (see ``contact.types``), and change it in place.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference_solver.compiled.kernel import Topology, source_of
from reference_solver.compiled.store import callee, compiled, load_kernel
from reference_solver.contact import loop as contact_loop
from reference_solver.contact.force import gap
from reference_solver.contact.types import DONE, FAILED, SPENT, Motion, Rates, Records, Work
from reference_solver.equations import Equations
from reference_solver.mechanism.points import State
from reference_solver.methods import step

FloatArray = NDArray[np.float64]
RecordArray = NDArray[np.void]


class CompiledFace:
    """The ``kernel`` of a topology with its ``parameters``, and the loop that calls it."""

    #: Evaluations of {A} times coordinates per call: a fraction of a second, to answer an interrupt.
    chunk = 8_000_000

    def __init__(self, topology: Topology, q_start: FloatArray) -> None:
        self.kernel = load_kernel(source_of(topology.marked()))
        self.parameters = topology.parameters(self.kernel, q_start)
        self._advance: Callable[..., int] = self._from_sample_to_sample
        if topology.method.embedded or topology.mechanism.contacts:
            loop = loop_of(topology)
            functions = zip(loop.Kernel._fields, loop.KERNEL, strict=True)
            of = loop.Kernel(*(callee(getattr(self.kernel, name), kind) for name, kind in functions))
            self._advance = partial(compiled(loop.advance, loop.ADVANCE), of, self.parameters)

    def advance(self, *state: Any) -> int:
        """Advance a motion by the loop that suits; without contacts and control, from sample to sample."""
        return int(self._advance(*state))

    def _from_sample_to_sample(
        self, contacts: RecordArray, motion: Motion, clock: RecordArray, records: Records, work: Work
    ) -> int:
        """Advance a motion without contacts; its steps have one length, of which samples are multiples."""
        kernel, p, rates = self.kernel, self.parameters, work.rates
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
    """The equations of a topology in numbers: slow, to be read, and to say what is wrong with a step.

    It is its own kernel, whose functions take no parameters.
    """

    #: Evaluations of {A} times coordinates per call: some seconds.
    chunk = 80_000

    def __init__(self, topology: Topology, q_start: FloatArray) -> None:
        self._topology, self.kernel, self.parameters = topology, self, None
        mechanism = topology.mechanism
        self.equations = Equations(mechanism, q_start, topology.baumgarte, topology.following)

    def advance(self, *state: Any) -> int:
        """Advance a motion by the loop that suits, run as it stands."""
        loop = loop_of(self._topology)
        of = loop.Kernel(*(getattr(self, name) for name in loop.Kernel._fields))
        with np.errstate(all="ignore"):
            return int(loop.advance(of, None, *(with_fields(part) for part in state)))

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
            self.gaps(None, contacts, t + h, new)
        return finite

    def right_hand_side(
        self,
        _: object,
        contacts: RecordArray,
        t: float,
        row: int,
        rate: float,
        y: FloatArray,
        K: FloatArray,
    ) -> bool:
        """Set a row of K to the rates of coordinates and velocities y, and the powers, times a rate."""
        n = self.equations.n
        found = self.equations.answer(t, y[:n], y[n : 2 * n], phases_of(contacts))
        K[row] = rate * np.array(
            [*y[n : 2 * n], *found.accelerations, *found.powers.values(), found.removed_W]
        )
        return bool(found.ok)

    def move(self, _: object, contacts: RecordArray, t: float, motion: Motion) -> bool:
        """Move a motion onto the constraints; what that removes is added to its last sum."""
        if not self._topology.projected:
            return True
        motion.q[:], motion.v[:], removed, ok = self.equations.project(
            t, motion.q, motion.v, phases_of(contacts)
        )
        motion.sums[-1] += removed
        return bool(ok)

    def gaps(self, _: object, contacts: RecordArray, t: float, motion: Motion) -> bool:
        """Set the contacts' gaps of a motion at t; return whether it could."""
        phases, state, powers = phases_of(contacts), State(motion.q, motion.v), dict[str, float]()
        if self._topology.following:
            found = self.equations.answer(t, motion.q, motion.v, phases)
            if not found.ok:
                return False
            powers = found.powers
        for k, joint in enumerate(self._topology.mechanism.contacts):
            phase, memory = phases[k]
            fields = gap(joint, phase, memory, state, powers.get(f"normal{k}", 0.0))
            motion.gaps[k] = tuple(fields.values())
        return True

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


def loop_of(topology: Topology) -> Any:
    """Return the module of the loop for a topology."""
    if not topology.method.embedded:
        return contact_loop
    from reference_solver.contact import adaptive_loop

    return adaptive_loop


def with_fields(part: Any) -> Any:
    """Return an array of records, or a tuple with some in it, with fields as attributes, as compiled."""
    if isinstance(part, tuple):
        return type(part)(*map(with_fields, part))
    return part.view(np.recarray) if part.dtype.names else part


def phases_of(contacts: RecordArray) -> FloatArray:
    """Return phase and memory of every contact, (K, 2)."""
    return np.column_stack([contacts["phase"], contacts["memory"]])
