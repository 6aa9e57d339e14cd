"""The source of a compiled kernel: the equations of one topology on tapes, in functions for Numba.

What the mechanism does not contain does not occur in the text: no zero entry, no absent load, no arm of a pin
at a centre of mass. Its numbers are inputs p[...], so that one compilation serves every mechanism of the same
topology; ``parameters(r)`` makes them from the raw ones (see ``Topology.parameters``).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from inspect import getsource
from itertools import count, pairwise
from types import ModuleType

import numpy as np

from reference_solver.contact.force import gap
from reference_solver.equations import Answer, Baumgarte, Equations
from reference_solver.mechanism.lifting import lifted, tables_in
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.points import State
from reference_solver.mechanism.tables import piece
from reference_solver.methods import RK4, Method, Step, step
from reference_solver.rigid.walls import rigid_joints, stores_of, walls_at
from reference_solver.tape import (
    Array,
    FloatArray,
    Parameters,
    Scalar,
    Tape,
    Value,
    Writer,
    array,
    both,
    choose,
    named,
)

HEADER = '''"""Generated from a mechanism's topology by reference_solver.compiled.kernel."""

from math import copysign, cos, inf, sin, sqrt, tanh

from reference_solver.compiled import straight_line as straight_lines
from reference_solver.compiled.store import njit
from reference_solver.compiled.straight_line import straight_line

OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}
INNER = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
ENTRY = {**OPTIONS, "cache": True}
COMPILED_WITH = (straight_lines,)
'''
#: How what Python calls is compiled, and kept on disk, and what only compiled functions call.
ENTRY, INNER, CALLED = "njit(**ENTRY)", "njit(**INNER)", "called(**INNER)"
#: Bodies beyond which ``answer`` and ``project`` are called, and the state stays in memory. Put in the place
#: of calls they take twice as long to compile for 17 bodies, thrice for 41; steps are a tenth faster.
LARGEST_INLINE = 16
#: What a kernel has at its head beyond that.
HEADER_OF_CALLS = HEADER.replace("import straight_line\n", "import called, straight_line, zeros\n")
#: The text of the look-up in a table, without types, which Numba infers.
LOOK_UP = re.sub(r"def piece.*:", "def piece(p, place, pieces, period, x):", getsource(piece)).strip()


@dataclass(frozen=True)
class Topology:
    """What a kernel is written for: a mechanism, its stabilisation, and the pins that follow rigid walls.

    The numbers in it are a mechanism's own, or marks (see ``marked``).
    """

    mechanism: Mechanism
    baumgarte: Baumgarte | None = None
    projected: bool = False
    following: tuple[int, ...] = ()
    method: Method = RK4

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return 3 * len(self.mechanism.bodies)

    def marked(self) -> Topology:
        """Return the topology with a mark for every number: equal for all mechanisms of one topology."""
        mechanism, baumgarte = lifted((self.mechanism, self.baumgarte), lambda _: 2.0)
        return replace(self, mechanism=mechanism, baumgarte=baumgarte)

    def numbers(self) -> tuple[list[float], list[float]]:
        """Return the mechanism's numbers in the order of ``equations``, and those of its tables."""
        tables, numbers = tables_in(self.mechanism), list[float]()
        sizes = [len(table.rows) for table in tables]
        places = (table.placed(sum(sizes[k + 1 :])) for k, table in enumerate(tables))
        lifted((self.mechanism, self.baumgarte), numbers.append, placed=lambda _: next(places))
        return numbers, [number for table in tables for number in table.rows]

    def parameters(self, kernel: ModuleType, q_start: FloatArray) -> FloatArray:
        """Return p of a kernel for the mechanism's numbers and its start; tables stand behind the others."""
        own, of_tables = self.numbers()
        with np.errstate(all="ignore"):  # a singular mechanism is found in the run
            return np.array([*kernel.parameters(np.array([*own, *q_start])), *of_tables], dtype=float)

    @property
    def by_events(self) -> bool:
        """Whether the loop that lands on events runs it: of contacts, or knots of motions and loads."""
        return self.mechanism.has_knots or bool(self.mechanism.contacts or self.mechanism.gas)

    def equations(self, tape: Tape) -> Equations:
        """Return the equations on a tape, with the raw numbers as inputs r[...]."""
        places = count()

        def number(_: float) -> Scalar:
            return tape.input(f"r[{next(places)}]", known=True)

        mechanism, baumgarte = lifted((self.mechanism, self.baumgarte), number)
        q_start = np.array([number(0.0) for _ in range(self.n)], dtype=object)
        return Equations(mechanism, q_start, baumgarte, self.following)


@dataclass(frozen=True)
class Draft:
    """A function under construction: a tape, the equations and the contacts' phases on it, and a state."""

    tape: Tape
    equations: Equations
    phases: Array
    t: Scalar
    q: Array
    v: Array


class Kernel:
    """Functions of one topology under construction.

    Those that Python and the loops call take arrays: ``p``, the parameters, ``contacts``, records (see
    ``contact.types``), and states. Those that they call themselves, and that are put in their place, take
    scalars: an array handed on would have its references counted. Of a large mechanism they are called.
    """

    def __init__(self, topology: Topology) -> None:
        self.topology, self.n, self._parameters = topology, topology.n, Parameters()
        self.is_large = len(topology.mechanism.bodies) > LARGEST_INLINE
        #: The function that answers where nobody asks for {lambda}: put in place of a call, it loses that.
        self.of_motion = "accelerations" if self.is_large else "answer"
        self._functions: list[str] = []
        self._reads: dict[str, list[str]] = {}
        self._answers: dict[str, list[Scalar]] = {}
        self._reads["piece"] = ["p"]
        self.equations = topology.equations(Tape())
        self.powers = self.equations.power_names
        self._state = [f"{letter}{c}" for letter in "qv" for c in range(self.n)]
        #: Phases and memories by the names that the functions know them by.
        self._phases = {
            f"{of}{k}": f"contacts[{k}].{of}"
            for k, joint in enumerate(topology.mechanism.contacts)
            for of in ("phase", "memory")
            if not joint.rigid
        }

    def source(self) -> str:
        """Return the module's text."""
        texts = "".join(f"        {text},\n" for text in self._parameters.texts)
        parameters = f"def parameters(r):\n    return [\n{texts}    ]"
        looked_up = any("piece(" in function for function in self._functions)
        tables = [f"@{INNER}\n{LOOK_UP}"] * looked_up
        header = HEADER_OF_CALLS if self.is_large else HEADER
        return "\n\n".join([header, parameters, *tables, *self._functions]) + "\n"

    def begin(self) -> Draft:
        """Return a new function."""
        tape, contacts = Tape(), self.topology.mechanism.contacts
        phases = [
            [0.0 if joint.rigid else tape.input(f"{of}{k}") for of in ("phase", "memory")]
            for k, joint in enumerate(contacts)
        ]
        q, v = tape.inputs("q", self.n), tape.inputs("v", self.n)
        return Draft(tape, self.topology.equations(tape), array(phases), tape.input("t"), q, v)

    def inner(self, name: str, draft: Draft, results: Sequence[Scalar], more: Sequence[str] = ()) -> str:
        """Write a function that others call, of a state and more inputs; return the text of a call."""
        writer = self._writer(more)
        texts = writer.write(draft.tape, [*results])
        reads, lines = self._all_reads(writer), writer.lines
        kind = "straight_line"
        if self.is_large:
            reads, lines, kind = ["p"], [*self._reading(reads, ()), *lines], CALLED
        self._reads[name] = reads
        arguments = [*reads, *self._phases, "t", *self._state, *more]
        self._define(kind, name, arguments, [*lines, f"return {', '.join(texts)}"])
        return f"{name}({', '.join(arguments)})"

    def call(self, name: str, draft: Draft, t: Scalar, q: Array, v: Array, results: list[str]) -> list[Value]:
        """Return on a tape the results, by their names, of an inner function at a state."""
        return draft.tape.call(name, [*self._reads[name], *self._phases, t, *q, *v], results)

    def entry(
        self,
        name: str,
        arguments: Sequence[str],
        draft: Draft,
        result: Scalar,
        stores: Iterable[tuple[str, Scalar]],
        state: str,
    ) -> None:
        """Write a function that stores values in arrays, by their places, and returns its result.

        It begins with the coordinates and velocities of a state, an array of this name.
        """
        stores, writer = [*stores], self._writer(arguments)
        *texts, returned = writer.write(draft.tape, [*(value for _, value in stores), result])
        lines = [*self._reading(self._all_reads(writer), arguments), *self.unpack(state), *writer.lines]
        lines += [f"{place} = {text}" for (place, _), text in zip(stores, texts, strict=True)]
        self._straight(f"{name}_", arguments, [*lines, f"return {returned}"])
        self._define(ENTRY, name, arguments, [f"return {name}_({', '.join(arguments)})"])

    def unpack(self, state: str) -> list[str]:
        """Return lines that name the coordinates and velocities in a state, an array of this name."""
        return [f"{name} = {state}[{c}]" for c, name in enumerate(self._state)]

    def _writer(self, names: Iterable[str] = ()) -> Writer:
        return Writer(self._parameters, [*names, "t", *self._phases, *self._state])

    def _reading(self, reads: Sequence[str], arguments: Sequence[str]) -> list[str]:
        """Return the lines that read parameters and phases from their arrays, if these are given."""
        lines = [f"{name} = p[{name[1:]}]" for name in reads if name != "p"]
        phases = self._phases.items() if "contacts" in arguments else ()
        return lines + [f"{name} = {place}" for name, place in phases]

    def _all_reads(self, writer: Writer) -> list[str]:
        """Return what a function reads of the parameters, and those that it calls: "p" for tables in them."""
        reads = [*writer.reads, *(name for inner in writer.calls for name in self._reads[inner])]
        return list(dict.fromkeys(reads))

    def _straight(self, name: str, arguments: Sequence[str], lines: list[str]) -> None:
        self._define("straight_line", name, arguments, lines)

    def _define(self, compiled: str, name: str, arguments: Sequence[str], lines: list[str]) -> None:
        head = f"@{compiled}\ndef {name}({', '.join(arguments)}):"
        self._functions.append("\n    ".join([head, *lines]))

    # ------------------------------------------------------------ the equations as functions

    def answer(self) -> None:
        """Write ``answer``: {q''}, {lambda}, powers, friction, what feedback removes, damper, condition."""
        draft = self.begin()
        answer = draft.equations.answer(draft.t, draft.q, draft.v, draft.phases)
        results = [*answer.accelerations, *answer.multipliers, *answer.powers.values(), *answer.friction_N]
        results += [answer.removed_W, answer.damper_per_s, answer.condition]
        self._answers["answer"] = results
        self.inner("answer", draft, results)
        if self.is_large:
            rows = range(self.n, self.n + len(answer.multipliers))
            results = [0.0 if k in rows else x for k, x in enumerate(results)]
            self._answers[self.of_motion] = results
            self.inner(self.of_motion, draft, results)

    def call_answer(self, draft: Draft, t: Scalar, q: Array, v: Array, name: str = "answer") -> Answer:
        """Return on a tape what ``answer`` does; what it has as a number, it is here too."""
        answers = self._answers[name]
        sizes = (self.n, len(self.equations.C), len(self.powers), len(self.topology.mechanism.contacts))
        ends = np.cumsum(sizes)
        letters = zip(("a", "lambda", "power", "friction"), sizes, strict=True)
        names = [f"{letter}{k}" for letter, size in letters for k in range(size)]
        results = self.call(name, draft, t, q, v, [*names, "removed", "damper", "condition"])
        results = [new if isinstance(x, Value) else x for new, x in zip(results, answers, strict=True)]
        a, lambda_, powers, friction, rest = (results[i:j] for i, j in pairwise([0, *ends, len(results)]))
        by_name = dict(zip(self.powers, powers, strict=True))
        return Answer(array(a), array(lambda_), by_name, friction, *rest)

    def projection(self) -> None:
        """Write ``project``: q and q' on the constraints, the energy removed, success."""
        draft = self.begin()
        q, v, removed, ok = draft.equations.project(draft.t, draft.q, draft.v, draft.phases)
        self.inner("project", draft, [*q, *v, removed, ok])

    def call_project(
        self, draft: Draft, t: Scalar, q: Array, v: Array
    ) -> tuple[Array, Array, Scalar, Scalar]:
        """Return on a tape what ``project`` does."""
        names = [f"new{c}" for c in range(2 * self.n)]
        *new, removed, ok = self.call("project", draft, t, q, v, [*names, "removed", "ok"])
        return array(new[: self.n]), array(new[self.n :]), removed, ok

    def step(self, draft: Draft, h: Scalar, lost: Array | None = None) -> Step:
        """Return a step on a tape (see ``methods.step``)."""

        def project(t: Scalar, q: Array, v: Array) -> tuple[Array, Array, Scalar, Scalar]:
            return self.call_project(draft, t, q, v)

        def answer(t: Scalar, q: Array, v: Array) -> Answer:
            return self.call_answer(draft, t, q, v, self.of_motion)

        projected = project if self.topology.projected else None
        return step(self.topology.method, answer, projected, draft.t, draft.q, draft.v, h, lost)

    def slopes(self) -> None:
        """Write ``slopes(p, contacts, t, row, rate, y, slopes)``, which returns the condition.

        That is infinite on failure. The row of slopes gets those of ``slopes_of`` at coordinates and
        velocities y.
        """
        draft = self.begin()
        answer = self.call_answer(draft, draft.t, draft.q, draft.v, self.of_motion)
        values = slopes_of(answer, draft.v, draft.tape.input("rate"))
        arguments = ["p", "contacts", "t", "row", "rate", "y", "slopes"]
        self.entry("slopes", arguments, draft, answer.condition, places("slopes[row, {}]", values), "y")

    def forces(self) -> None:
        """Write ``forces(p, contacts, t, y, row, samples)``, which returns the condition.

        That is infinite on failure. A row of samples gets those of ``forces_of``, behind y.
        """
        draft = self.begin()
        answer = self.call_answer(draft, draft.t, draft.q, draft.v)
        first = 2 * self.n + len(self.powers) + 1
        stores = places("samples[row, {}]", forces_of(answer, self.equations.own_rows), first)
        arguments = ["p", "contacts", "t", "y", "row", "samples"]
        self.entry("forces", arguments, draft, answer.condition, stores, "y")

    def arrive(self) -> None:
        """Write ``arrive(p, contacts, t, row, motion, slopes)``: a motion onto the constraints, its slopes.

        It returns the condition there, infinite on failure. What the move removes is added to the last of
        the sums.
        """
        draft, stores, ok = self.begin(), list[tuple[str, Scalar]](), True
        q, v = draft.q, draft.v
        if self.topology.projected:
            q, v, removed, ok = self.call_project(draft, draft.t, q, v)
            last = f"motion.y[{2 * self.n + len(self.powers)}]"
            stores = [*places("motion.y[{}]", [*q, *v]), (last, draft.tape.input(last) + removed)]
        answer = self.call_answer(draft, draft.t, q, v, self.of_motion)
        stores += places("slopes[row, {}]", slopes_of(answer, v, 1.0))
        arguments = ["p", "contacts", "t", "row", "motion", "slopes"]
        condition = choose(ok, answer.condition, math.inf) if isinstance(ok, Value) else answer.condition
        self.entry("arrive", arguments, draft, condition, stores, "motion.y")

    def gaps(self) -> None:
        """Write ``gaps(p, contacts, t, motion)``, which sets the gaps of a state; False on failure."""
        draft = self.begin()
        stores, ok = self._gaps(draft, draft.t, draft.q, draft.v, "motion")
        self.entry("gaps", ["p", "contacts", "t", "motion"], draft, ok, stores, "motion.y")

    def _gaps(
        self, draft: Draft, t: Scalar, q: Array, v: Array, motion: str
    ) -> tuple[list[tuple[str, Scalar]], Scalar]:
        """Return the fields of the contacts' gaps at a state, with their places in a motion, and success.

        Whether pins that follow rigid walls are pressed against them takes an answer.
        """
        stores, powers, ok = [], dict[str, Scalar](), True
        if self.topology.following:
            answer = self.call_answer(draft, t, q, v)
            powers, ok = answer.powers, answer.ok
        state = State(q, v)
        for k, joint in enumerate(draft.equations.mechanism.contacts):
            phase, memory = draft.phases[k]
            fields = gap(joint, phase, memory, state, powers.get(f"normal{k}", 0.0))
            stores += [(f"{motion}.gaps[{k}].{field}", value) for field, value in fields.items()]
        return stores, ok

    def walls(self) -> None:
        """Write ``walls(p, contacts, t, y, walls)``, which sets rigid walls (see ``rigid.walls``).

        It returns the condition, infinite on failure.
        """
        draft = self.begin()
        answer = self.call_answer(draft, draft.t, draft.q, draft.v)
        stores = stores_of(*walls_at(draft.equations, answer, draft.t, draft.q, draft.v))
        self.entry("walls", ["p", "contacts", "t", "y", "walls"], draft, answer.condition, stores, "y")

    def contact_step(self) -> None:
        """Write ``step(p, contacts, t, h, old, new)``: a step, its sums, the new gaps.

        It returns the worst condition of the stages, infinite on failure. The sums are those of
        ``Equations.power_names``, and the energy that a stabilisation removes.
        """
        draft = self.begin()
        h = draft.tape.input("h")
        after = self.step(draft, h)
        stores, ok = self._gaps(draft, draft.t + h, after.q, after.v, "new")
        stores += places("new.y[{}]", [*after.q, *after.v, *after.sums.values(), after.removed])
        arguments = ["p", "contacts", "t", "h", "old", "new"]
        condition = choose(both(after.ok, ok), after.condition, math.inf)
        self.entry("step", arguments, draft, condition, stores, "old.y")

    def mobilities(self) -> None:
        """Write ``mobilities(p, y, row, out)``: a row of those of ``Equations.mobilities``."""
        draft = self.begin()
        stores = places("out[row, {}]", draft.equations.mobilities(draft.q))
        self.entry("mobilities", ["p", "y", "row", "out"], draft, True, stores, "y")

    def advance(self) -> None:
        """Write ``advance(p, y, h, first, count)``: steps first to first + count - 1 of a state, in place.

        It returns the number of steps done and their worst condition, and adds to the sums; fewer than
        ``count`` steps mean that the step begun from the state left in y met a singular configuration, came
        too near to one (see ``methods.Step``) or overflowed. ``first`` is a float: steps may have any phase.
        """
        draft = self.begin()
        own = [f"lost{c}" for c in range(2 * self.n)]
        after = self.step(draft, draft.tape.input("h"), draft.tape.inputs("lost", 2 * self.n))
        sums = [*after.sums.values(), after.removed]
        changed = [after.ok, after.condition, *after.q, *after.v, *named("less", after.lost), *sums]
        stepped = self.inner("stepped", draft, changed, ["h", *own])
        added, carried = [f"added{k}" for k in range(len(sums))], [*self._state, *own]
        new = [f"new_{name}" for name in [*carried, *added]]
        arguments = ["p", "y", "h", "first", "count"]
        lines = [
            *self._reading(self._reads["stepped"], arguments),
            *self.unpack("y"),
            *(f"{name} = 0.0" for name in [*own, *added]),
            "done, worst = 0, 1.0",
            "while done < count:",
            "    t = (first + done)*h",
            f"    ok, condition, {', '.join(new)} = {stepped}",
            "    if not ok:",
            "        break",
            *(f"    {name} = new_{name}" for name in carried),
            *(f"    {name} += new_{name}" for name in added),
            "    worst = max(worst, condition)",
            "    done += 1",
            *(f"{place} = {name}" for place, name in places("y[{}]", self._state)),
            *(f"y[{2 * self.n + k}] += {name}" for k, name in enumerate(added)),
        ]
        self._define(ENTRY, "advance", arguments, [*lines, "return done, worst"])

    def advance_in_memory(self) -> None:
        """Write ``advance`` of a large mechanism: for Numba its state has no parts, but stays in y."""
        draft, size = self.begin(), 2 * self.n
        lost = array([draft.tape.input(f"lost[{c}]") for c in range(size)])
        after = self.step(draft, draft.tape.input("h"), lost)
        new = places("y[{}]", [*after.q, *after.v]) + places("lost[{}]", named("less", after.lost))
        sums = places("y[{}]", [*after.sums.values(), after.removed], size)
        new += [(at, draft.tape.input(at) + added) for at, added in sums if isinstance(added, Value)]
        writer, results = self._writer(["h"]), [after.ok, after.condition, *(value for _, value in new)]
        ok, condition, *texts = writer.write(draft.tape, results)
        lines = [*self._reading(self._all_reads(writer), ()), *self.unpack("y"), *writer.lines, f"ok = {ok}"]
        lines += ["if ok:", *(f"    {at} = {text}" for (at, _), text in zip(new, texts, strict=True))]
        lines += [f"return {condition} if ok else inf"]
        self._straight("stepped", ["p", "y", "t", "h", "lost"], lines)
        lines = [
            f"lost = zeros({size})",
            "done, worst = 0, 1.0",
            "while done < count:",
            "    condition = stepped(p, y, (first + done)*h, h, lost)",
            "    if not condition < inf:",
            "        break",
            "    worst = max(worst, condition)",
            "    done += 1",
            "return done, worst",
        ]
        self._define(ENTRY, "advance", ["p", "y", "h", "first", "count"], lines)


def slopes_of(answer: Answer, v: Array, rate: Scalar) -> list[Scalar]:
    """Return a row of slopes: rates of q, q' and sums, times ``rate``.

    A projection acts between steps: the rate of what it removes is zero.
    """
    return [
        rate * change for change in (*v, *answer.accelerations, *answer.powers.values(), answer.removed_W)
    ]


def forces_of(answer: Answer, own_rows: int) -> list[Scalar]:
    """Return {lambda} of the mechanism's own rows, then normal force and friction of every contact."""
    normal = [answer.powers[f"normal{k}"] for k in range(len(answer.friction_N))]
    forces = [force for pair in zip(normal, answer.friction_N, strict=True) for force in pair]
    return [*answer.multipliers[:own_rows], *forces]


def places(pattern: str, values: Iterable[Scalar], first: int = 0) -> list[tuple[str, Scalar]]:
    """Return values with the places where they go: their number, from the first's on, in a pattern."""
    return [(pattern.format(number), value) for number, value in enumerate(values, first)]


@cache
def source_of(topology: Topology) -> str:
    """Return the module of a marked topology: ``slopes``, and what the loop that is to run calls.

    Of RK4 that is ``advance``, or, where it lands on events, ``step``, ``gaps`` and ``mobilities``; with
    error control ``arrive``, and of contacts these two as well; of rigid walls ``walls``.
    """
    kernel, controlled = Kernel(topology), topology.method.embedded is not None
    kernel.answer()
    if topology.projected:
        kernel.projection()
    kernel.slopes()
    kernel.forces()
    if controlled:
        kernel.arrive()
    elif topology.by_events:
        kernel.contact_step()
    elif kernel.is_large:
        kernel.advance_in_memory()
    else:
        kernel.advance()
    if topology.mechanism.contacts or (topology.by_events and not controlled):
        kernel.gaps()
        kernel.mobilities()
    if rigid_joints(topology.mechanism) and not topology.following:
        kernel.walls()
    return kernel.source()
