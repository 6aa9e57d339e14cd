"""The two faces of the algorithm: kernels compiled for a topology, or the equations as they stand.

Both advance a run (see ``contact.types.Run``), and change it in place.
"""

import math
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any

import numpy as np

from reference_solver.compiled.crossing import crossed
from reference_solver.compiled.kernel import Topology, forces_of, slopes_of, source_of
from reference_solver.compiled.store import callback, callee, compiled, load_kernel
from reference_solver.contact import loop as contact_loop
from reference_solver.contact.force import gap
from reference_solver.contact.types import DONE, FAILED, SPENT, Motion, Run
from reference_solver.equations import Equations
from reference_solver.failures import FrictionTooStiff
from reference_solver.mechanism.points import State
from reference_solver.methods import Step, step, tableau
from reference_solver.rigid import settling
from reference_solver.rigid.loop import bounce, bounce_type
from reference_solver.rigid.settling import Settling
from reference_solver.rigid.walls import Walls, walls_at
from reference_solver.tape import FloatArray, RecordArray


class CompiledFace:
    """The ``kernel`` of a topology with its ``parameters``, and the loop that calls it.

    The loop gets of the kernel the ``functions`` that it calls, and the method's ``tableau``. ``rows`` is the
    number of slopes that a run needs (see ``contact.types.new_run``).
    """

    #: Evaluations of {A} times coordinates per call: a fraction of a second, to answer an interrupt.
    chunk = 8_000_000

    def __init__(self, topology: Topology, q_start: FloatArray) -> None:
        self.kernel = load_kernel(source_of(topology.marked()))
        self.parameters = topology.parameters(self.kernel, q_start)
        self._advance: Callable[[Run], int] = from_sample_to_sample
        self.functions: Any = self.kernel
        loop = self._loop = loop_of(topology)
        self.rows: int = loop.ROWS
        self.tableau = tableau(topology.method)
        if topology.method.embedded or topology.by_events:
            functions = zip(loop.Kernel._fields, loop.KERNEL, strict=True)
            self.functions = loop.Kernel(
                *(callee(getattr(self.kernel, name), kind) for name, kind in functions)
            )
            self._advance = compiled(loop.advance, loop.ADVANCE)

    def advance(self, run: Run) -> int:
        """Advance a run that is bound; without contacts and control, from sample to sample."""
        return int(self._advance(run))

    def bound(self, run: Run) -> Run:
        """Return a run, its memory the same, that calls this kernel."""
        return run._replace(kernel=self.functions, p=self.parameters, method=self.tableau)

    def look(self) -> Any:
        """Return what sets rigid walls at a state (see ``rigid.walls``); no pin follows in this kernel."""
        return callee(self.kernel.walls, settling.LOOK)

    def settle(self, run: Run, s: Settling) -> int:
        """Settle an event on rigid walls."""
        return int(compiled(settling.settle, settling.SETTLE)(run.contacts, run.clock, run.old, s))

    @cached_property
    def bounce(self) -> Callable[[Run, Settling], int]:
        """What advances a run that is bound, and settles its events on rigid walls (see ``rigid.loop``)."""
        advance, settle = self._loop.advance, settling.settle
        called = callback(advance, self._loop.ADVANCE), callback(settle, settling.SETTLE)
        return partial(compiled(bounce, bounce_type(self._loop.ADVANCE)), *called)


def from_sample_to_sample(run: Run) -> int:
    """Advance a run without contacts; its steps have one length, of which samples are multiples."""
    motion, kernel, samples, (now,) = run.old, run.kernel, run.records.samples, run.clock
    h, steps, taken, most = (now[name].item() for name in ("longest", "steps", "taken", "budget"))
    worst, times, size = now["condition"].item(), run.records.time.tolist(), len(motion.y)
    status = DONE
    while taken < len(times) and status == DONE:
        due = round(times[taken] / h) - steps
        count = min(due, most - steps)
        done, condition = kernel.advance(run.p, motion.y, h, float(steps), count)
        steps, worst = steps + done, max(worst, condition)
        now["steps"], now["time"], now["tried"] = steps, steps * h, h
        if done < count:
            together = crossed(with_fields(run), h)
            steps, taken, status = steps + together, now["taken"].item(), DONE if together else FAILED
        elif done < due:
            status = SPENT
        else:
            condition = kernel.forces(run.p, run.contacts, times[taken], motion.y, taken, samples)
            samples[taken, :size] = motion.y
            now["least"] = min(now["least"], condition)
            taken, status = taken + 1, DONE if condition < np.inf else FAILED
        now["taken"] = taken
    now["steps"], now["time"], now["condition"] = steps, steps * h, worst
    return status


class ReadableFace:
    """The equations of a topology in numbers: slow, to be read, and to say what is wrong with a step.

    It is its own kernel, whose functions take no parameters.
    """

    #: Evaluations of {A} times coordinates per call: some seconds.
    chunk = 80_000

    def __init__(self, topology: Topology, q_start: FloatArray) -> None:
        self._loop, self.rows = loop_of(topology), loop_of(topology).ROWS
        self._topology, self.kernel, self.parameters = topology, self, None
        mechanism = topology.mechanism
        self.equations = Equations(mechanism, q_start, topology.baumgarte, topology.following)

    def advance(self, run: Run) -> int:
        """Advance a run that is bound, by the loop that suits, which runs as it stands."""
        with np.errstate(all="ignore"):
            return int(self._loop.advance(run))

    def bound(self, run: Run) -> Run:
        """Return a run, its memory the same, that calls these functions."""
        kernel = self._loop.Kernel(*(getattr(self, name) for name in self._loop.Kernel._fields))
        own: Run = with_fields(run._replace(kernel=kernel, method=tableau(self._topology.method)))
        return own

    def look(self) -> Any:
        """Return what sets rigid walls at a state."""
        return self.walls

    def settle(self, run: Run, s: Settling) -> int:
        """Settle an event on rigid walls."""
        with np.errstate(all="ignore"):
            return int(settling.settle(*map(with_fields, (run.contacts, run.clock, run.old, s))))

    def bounce(self, run: Run, s: Settling) -> int:
        """Advance a run that is bound, and settle its events on rigid walls."""
        with np.errstate(all="ignore"):
            return int(bounce(self._loop.advance, settling.settle, run, with_fields(s)))

    def step(self, _: object, contacts: RecordArray, t: float, h: float, old: Motion, new: Motion) -> float:
        """Set ``new`` to the state after a step, with the sums of the step alone; return its condition.

        That is infinite where the step is not to be taken.

        Raises:
            SingularConfiguration, PainleveParadox: as ``Equations.required`` does.
        """
        try:
            after = self.stepped(contacts, t, h, old)
        except FrictionTooStiff:  # for a step so long
            return math.inf
        new.y[:] = [*after.q, *after.v, *after.sums.values(), after.removed]
        finite = bool(np.isfinite(new.q).all() and np.isfinite(new.v).all())
        if finite:
            self.gaps(None, contacts, t + h, new)
        return float(after.condition) if finite and after.ok else math.inf

    def stepped(self, contacts: RecordArray, t: float, h: float, old: Motion) -> Step:
        """Return a step from a motion.

        Raises:
            SingularConfiguration, PainleveParadox, FrictionTooStiff: as ``Equations.required`` does.
        """
        equations, phases, method = self.equations, phases_of(contacts), self._topology.method

        def answer(t: float, q: FloatArray, v: FloatArray) -> object:
            return equations.required(t, q, v, phases, h, method)

        def project(t: float, q: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, float, bool]:
            *result, ok = equations.project(t, q, v, phases)
            if not ok and np.isfinite(q).all():
                equations.refuse_singular(t, q)
            return (*result, ok)

        return step(method, answer, project if self._topology.projected else None, t, old.q, old.v, h)

    def slopes(
        self,
        _: object,
        contacts: RecordArray,
        t: float,
        row: int,
        rate: float,
        y: FloatArray,
        slopes: FloatArray,
    ) -> float:
        """Set a row of slopes at coordinates and velocities y (see ``slopes_of``); return the condition."""
        n = self.equations.n
        answer = self.equations.answer(t, y[:n], y[n : 2 * n], phases_of(contacts))
        slopes[row, : len(y)] = slopes_of(answer, y[n : 2 * n], rate)
        return float(answer.condition)

    def forces(
        self, _: object, contacts: RecordArray, t: float, y: FloatArray, row: int, samples: FloatArray
    ) -> float:
        """Set the forces of a row of samples at coordinates and velocities in y; return the condition."""
        n, size = self.equations.n, len(y)
        answer = self.equations.answer(t, y[:n], y[n : 2 * n], phases_of(contacts))
        forces = forces_of(answer, self.equations.own_rows)
        samples[row, size : size + len(forces)] = forces
        return float(answer.condition)

    def arrive(
        self, _: object, contacts: RecordArray, t: float, row: int, motion: Motion, slopes: FloatArray
    ) -> float:
        """Move a motion onto the constraints, and set a row of slopes there; return the condition.

        What the move removes is added to its last sum.
        """
        if self._topology.projected:
            motion.q[:], motion.v[:], removed, ok = self.equations.project(
                t, motion.q, motion.v, phases_of(contacts)
            )
            if not ok:
                return math.inf
            motion.sums[-1] += removed
        return self.slopes(None, contacts, t, row, 1.0, motion.y, slopes)

    def gaps(self, _: object, contacts: RecordArray, t: float, motion: Motion) -> bool:
        """Set the contacts' gaps of a motion at t; return whether it could."""
        phases, state, powers = phases_of(contacts), State(motion.q, motion.v), dict[str, float]()
        if self._topology.following:
            answer = self.equations.answer(t, motion.q, motion.v, phases)
            if not answer.ok:
                return False
            powers = answer.powers
        for k, joint in enumerate(self._topology.mechanism.contacts):
            phase, memory = phases[k]
            fields = gap(joint, phase, memory, state, powers.get(f"normal{k}", 0.0))
            motion.gaps[k] = tuple(fields.values())
        return True

    def walls(self, _: object, contacts: RecordArray, t: float, y: FloatArray, walls: Walls) -> float:
        """Set rigid walls at coordinates and velocities y; return the condition."""
        q, v = y[: self.equations.n], y[self.equations.n : 2 * self.equations.n]
        answer = self.equations.answer(t, q, v, phases_of(contacts))
        fields, arrays = walls_at(self.equations, answer, t, q, v)
        for joint, values in zip(walls.joints, fields, strict=True):
            for name, value in values.items():
                joint[name] = value
        for name, values in arrays.items():
            getattr(walls, name)[:] = values
        return float(answer.condition)

    def mobilities(self, _: object, y: FloatArray, row: int, out: FloatArray) -> bool:
        """Set a row of ``out`` to those of ``Equations.mobilities``."""
        mobilities = self.equations.mobilities(y[: self.equations.n])
        out[row, : len(mobilities)] = mobilities
        return True


def loop_of(topology: Topology) -> Any:
    """Return the module of the loop for a topology."""
    if not topology.method.embedded:
        return contact_loop
    from reference_solver.contact import adaptive_loop, smooth_loop

    return adaptive_loop if topology.mechanism.contacts else smooth_loop


def with_fields(part: Any) -> Any:
    """Return an array of records, or a tuple with some in it, with fields as attributes, as compiled."""
    if isinstance(part, tuple):
        return type(part)(*map(with_fields, part))
    return part.view(np.recarray) if isinstance(part, np.ndarray) and part.dtype.names else part


def phases_of(contacts: RecordArray) -> FloatArray:
    """Return phase and memory of every contact, (K, 2)."""
    return np.column_stack([contacts["phase"], contacts["memory"]])
