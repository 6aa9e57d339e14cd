"""The source of a compiled kernel: the equations of one topology on tapes, in functions for Numba.

What the mechanism does not contain does not occur in the text: no zero entry, no absent load, no arm of a pin
at a centre of mass. Its numbers are inputs p[...], so that one compilation serves every mechanism of the same
topology; ``parameters(r)`` makes them from the raw ones (see ``Topology.parameters``).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import count
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from reference_solver.contact import gap, gap_acceleration
from reference_solver.equations import Answer, Baumgarte, Equations
from reference_solver.lifting import lifted
from reference_solver.mechanism import Mechanism
from reference_solver.methods import RK4, Method, increments, quadrature, stages
from reference_solver.points import State
from reference_solver.rigid_friction import RK4_DAMPER_LIMIT, FollowingEquations
from reference_solver.rigid_joint import RigidJoint
from reference_solver.tape import Array, Parameters, Scalar, Tape, Value, Writer, array, both, named

FloatArray = NDArray[np.float64]

HEADER = '''"""Generated from a mechanism's topology by reference_solver.kernel."""

from math import copysign, cos, sin, sqrt, tanh

from reference_solver.kernel_store import njit

OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}}
INNER = {**OPTIONS, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
ENTRY = {**OPTIONS, "cache": True}
'''
#: The header's options of what Python calls, kept on disk, and of what only compiled functions call.
ENTRY, INNER, INLINE = "**ENTRY", "**INNER", "**INNER, forceinline=True"


@dataclass(frozen=True)
class Topology:
    """What a kernel is written for: a mechanism, its stabilisation, and the rigid joints that follow.

    The numbers in it are a mechanism's own, or marks (see ``marked``).
    """

    mechanism: Mechanism
    baumgarte: Baumgarte | None = None
    projected: bool = False
    joints: tuple[RigidJoint, ...] = ()
    following: tuple[int, ...] = ()
    method: Method = RK4

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return 3 * len(self.mechanism.bodies)

    @property
    def _data(self) -> tuple[Mechanism, Baumgarte | None, tuple[RigidJoint, ...]]:
        return self.mechanism, self.baumgarte, self.joints

    def marked(self) -> Topology:
        """Return the topology with a mark for every number: equal for all mechanisms of one topology."""
        data = lifted(self._data, lambda _: 2.0)
        return Topology(data[0], data[1], self.projected, data[2], self.following, self.method)

    def parameters(self, kernel: ModuleType, q_start: FloatArray) -> FloatArray:
        """Return p of a kernel for the mechanism's numbers and its start, in the order of ``equations``."""
        numbers: list[float] = []
        lifted(self._data, numbers.append)
        with np.errstate(all="ignore"):  # a singular mechanism is found in the run
            return np.array(kernel.parameters(np.array([*numbers, *q_start])), dtype=float)

    def equations(self, tape: Tape) -> Equations:
        """Return the equations on a tape, with the raw numbers as inputs r[...]."""
        places = count()

        def number(_: float) -> Scalar:
            return tape.input(f"r[{next(places)}]", known=True)

        mechanism, baumgarte, joints = lifted(self._data, number)
        q_start = np.array([number(0.0) for _ in range(self.n)], dtype=object)
        if joints:
            return FollowingEquations(mechanism, joints, self.following, q_start)
        equations = Equations(mechanism, q_start, baumgarte)
        fields = [f"contacts[{k}].{of}" for k in range(len(mechanism.contacts)) for of in ("phase", "memory")]
        equations.phases = np.array([tape.input(field) for field in fields], dtype=object)
        return equations


class Kernel:
    """Functions of one topology under construction."""

    def __init__(self, topology: Topology) -> None:
        self.topology, self.n, self.known_as = topology, topology.n, Parameters()
        self.functions: list[str] = []
        self._answers: list[Scalar] = []
        self.equations = topology.equations(Tape())
        self.m = len(self.equations.C)
        self.powers = self.equations.power_names
        self.state = [f"{letter}{c}" for letter in "qv" for c in range(self.n)]
        #: What comes first in every call: parameters, and phases where there are contacts.
        self.inputs = ["p", "contacts"] if topology.mechanism.contacts else ["p"]

    def source(self) -> str:
        """Return the module's text."""
        texts = "".join(f"        {text},\n" for text in self.known_as.texts)
        made = f"def parameters(r):\n    return [\n{texts}    ]"
        return "\n\n".join([HEADER, made, *self.functions]) + "\n"

    def begin(self) -> tuple[Tape, Equations, Array, Array]:
        """Return a new tape with the equations, q and v on it."""
        tape = Tape()
        return tape, self.topology.equations(tape), tape.inputs("q", self.n), tape.inputs("v", self.n)

    def add(
        self,
        name: str,
        arguments: Sequence[str],
        tape: Tape,
        results: Sequence[Scalar] = (),
        stores: Iterable[tuple[str, Scalar]] = (),
        options: str = ENTRY,
        before: Sequence[str] | None = None,
    ) -> None:
        """Write a function that stores values in arrays and returns results.

        It begins with lines ``before`` all else, by default those that unpack q and v.
        """
        stores = list(stores)
        writer = Writer(self.known_as, [*arguments, *self.state])
        texts = writer.write(tape, [*(value for _, value in stores), *results])
        lines = [*(self.unpack() if before is None else before), *writer.lines]
        lines += [f"{place} = {text}" for (place, _), text in zip(stores, texts, strict=False)]
        lines.append(f"return {', '.join(texts[len(stores) :])}")
        self.define(name, arguments, lines, options)

    def define(self, name: str, arguments: Sequence[str], lines: list[str], options: str = ENTRY) -> None:
        """Write a function of these lines."""
        self.functions.append(
            "\n    ".join([f"@njit({options})\ndef {name}({', '.join(arguments)}):", *lines])
        )

    def unpack(self, of: str = "") -> list[str]:
        """Return lines that name the coordinates and velocities, of a state with a point behind its name."""
        return [f"{letter}{c} = {of}{letter}[{c}]" for letter in "qv" for c in range(self.n)]

    # ------------------------------------------------------------ the equations as functions

    def answer(self) -> None:
        """Write ``answer``: {q''}, {lambda}, powers, what Baumgarte's feedback removes, success."""
        tape, equations, q, v = self.begin()
        found = equations.answer(tape.input("t"), q, v)
        results = [*found.accelerations, *found.multipliers, *found.powers.values()]
        results += [found.removed_W, found.damper_per_s, found.ok]
        self._answers = results
        self.add("answer", [*self.inputs, "t", *self.state], tape, results, options=INLINE, before=())

    def call_answer(self, tape: Tape, t: Scalar, q: Array, v: Array) -> Answer:
        """Return on a tape what ``answer`` does; what it has as a number, it is here too."""
        sizes = {"a": self.n, "lambda": self.m}
        names = [f"{name}{k}" for name, size in sizes.items() for k in range(size)]
        found = tape.call(
            "answer", [*self.inputs, t, *q, *v], [*names, *self.powers, "removed", "damper", "ok"]
        )
        found = [new if isinstance(x, Value) else x for new, x in zip(found, self._answers, strict=True)]
        a, lambda_, rest = found[: self.n], found[self.n : self.n + self.m], found[self.n + self.m :]
        powers = dict(zip(self.powers, rest[:-3], strict=True))
        return Answer(array(a), array(lambda_), powers, *rest[-3:])

    def projections(self) -> None:
        """Write ``project_q`` and ``project_v``: their results are new q or v, energy removed, success."""
        for of, state in (("q", self.state[: self.n]), ("v", self.state)):
            tape, equations, q, v = self.begin()
            t = tape.input("t")
            new, removed, ok = equations.project_q(t, q) if of == "q" else equations.project_v(t, q, v)
            arguments = [*self.inputs, "t", *state]
            self.add(f"project_{of}", arguments, tape, [*new, removed, ok], options=INLINE, before=())

    def _projected(self, tape: Tape, t: Scalar, q: Array, v: Array) -> tuple[Array, Array, Scalar, Scalar]:
        """Return on a tape q and v projected, the energy removed, and success."""
        names = [f"new{c}" for c in range(self.n)]
        *new_q, removed_q, ok_q = tape.call("project_q", [*self.inputs, t, *q], [*names, "removed", "ok"])
        *new_v, removed_v, ok_v = tape.call(
            "project_v", [*self.inputs, t, *new_q, *v], [*names, "removed", "ok"]
        )
        return array(new_q), array(new_v), removed_q + removed_v, both(ok_q, ok_v)

    def step(self, tape: Tape, t: Scalar, q: Array, v: Array, h: Scalar, lost: Array | None = None) -> Step:
        """Return on a tape one step of (11)-(13), projected where the topology asks for it.

        ``lost`` (2n,) is what rounding has taken from q and v, carried on to this step (Kahan 1965).
        """
        method = self.topology.method
        found = stages(method, lambda t, q, v: self.call_answer(tape, t, q, v), t, q, v, h)
        changes = np.concatenate(increments(method, h, found))
        old = np.concatenate([q, v])
        if lost is not None:
            changes = named("change", changes + lost)
        new = named("next", old + changes, "(13)")
        lost = changes - (new - old)
        powers = [stage.answer.powers for stage in found]
        sums = {name: quadrature(method, h, [power[name] for power in powers]) for name in self.powers}
        ok: Scalar = True
        for stage in found:
            ok = both(ok, stage.answer.ok)
            if isinstance(self.equations, FollowingEquations) and self.equations.rubbing:
                ok = both(ok, h * stage.answer.damper_per_s < RK4_DAMPER_LIMIT)
        new_q, new_v, removed = new[: self.n], new[self.n :], h * found[0].answer.removed_W
        if self.topology.projected:
            new_q, new_v, removed, held = self._projected(tape, t + h, new_q, new_v)
            ok = both(ok, held)
        return Step(new_q, new_v, lost, sums, removed, ok)

    def multipliers(self) -> None:
        """Write ``multipliers(p, t, q, v, out)``: {lambda} into ``out``; returns whether it could."""
        tape, _, q, v = self.begin()
        found = self.call_answer(tape, tape.input("t"), q, v)
        stores = [(f"out[{r}]", x) for r, x in enumerate(found.multipliers)]
        self.add("multipliers", [*self.inputs, "t", "q", "v", "out"], tape, [found.ok], stores)


@dataclass(frozen=True)
class Step:
    """A step on a tape: the new state, what rounding took from it, sums of powers by name, and success."""

    q: Array
    v: Array
    lost: Array
    sums: dict[str, Scalar]
    removed: Scalar
    ok: Scalar


def ideal_source(topology: Topology) -> str:
    """Return a module with ``advance`` and ``multipliers`` for a mechanism without contacts."""
    kernel = Kernel(topology)
    kernel.answer()
    if topology.projected:
        kernel.projections()
    _advance(kernel)
    kernel.multipliers()
    return kernel.source()


def _advance(kernel: Kernel) -> None:
    """Write ``advance(p, q, v, h, first, count)``: steps number first to first + count - 1, in place.

    It returns the number of steps done, the drivers' work over them and the energy that a stabilisation has
    removed; fewer than ``count`` steps mean that the step begun from the state left in q and v met a singular
    configuration or overflowed.
    """
    tape, _, q, v = kernel.begin()
    lost = tape.inputs("lost", 2 * kernel.n)
    step = kernel.step(tape, tape.input("t"), q, v, tape.input("h"), lost)
    carried = [*step.q, *step.v, *named("less", step.lost)]
    arguments, own = ["p", "q", "v", "h", "first", "count"], [f"lost{c}" for c in range(2 * kernel.n)]
    writer = Writer(kernel.known_as, [*arguments, *kernel.state, *own, "t", "done", "work", "removed"])
    ok, work, removed, *texts = writer.write(tape, [step.ok, step.sums["drivers"], step.removed, *carried])
    inside = ["t = (first + done)*h", *writer.lines, f"if not ({ok}):", "    break"]
    inside += [f"{name} += {text}" for name, text in (("work", work), ("removed", removed)) if text != "0.0"]
    inside += [f"{name} = {text}" for name, text in zip([*kernel.state, *own], texts, strict=True)]
    lines = [*kernel.unpack(), *(f"{name} = 0.0" for name in own), "done, work, removed = 0, 0.0, 0.0"]
    lines += ["while done < count:", *(f"    {line}" for line in [*inside, "done += 1"])]
    lines += [f"{letter}[{c}] = {letter}{c}" for letter in "qv" for c in range(kernel.n)]
    kernel.define("advance", arguments, [*lines, "return done, work, removed"])


def contact_source(topology: Topology) -> str:
    """Return a module with ``step``, ``slopes``, ``gaps`` and ``gap_accelerations`` for ``contact_loop``."""
    kernel = Kernel(topology)
    kernel.answer()
    if topology.projected:
        kernel.projections()
    write_gaps(kernel)
    _contact_step(kernel)
    _slopes(kernel)
    tape, equations, q, v = kernel.begin()
    found = kernel.call_answer(tape, tape.input("t"), q, v)
    joints, state = equations.mechanism.contacts, State(q, v)
    linear = [gap_acceleration(joint, state, found.accelerations) for joint in joints]
    stores = [(f"out[{k}]", value) for k, value in enumerate(linear)]
    arguments = ["p", "contacts", "t", "motion", "out"]
    kernel.add("gap_accelerations", arguments, tape, [found.ok], stores, before=kernel.unpack("motion."))
    return kernel.source()


def write_gaps(kernel: Kernel) -> None:
    """Write ``gaps(p, contacts, motion)``, which sets the gaps of a state (see ``contact.gap``)."""
    tape, equations, q, v = kernel.begin()
    arguments, stores = ["p", "contacts", "motion"], _gaps(equations, State(q, v), "motion")
    kernel.add("gaps", arguments, tape, [True], stores, before=kernel.unpack("motion."))


def _contact_step(kernel: Kernel) -> None:
    """Write ``step(p, contacts, t, h, old, new)``: a step, its sums, the new gaps; False on failure.

    The sums are those of ``Equations.power_names``, and with a stabilisation the energy it removes.
    """
    tape, equations, q, v = kernel.begin()
    step = kernel.step(tape, tape.input("t"), q, v, tape.input("h"))
    sums = [*step.sums.values(), *([step.removed] if stabilised(kernel.topology) else [])]
    parts = (("q", step.q), ("v", step.v), ("sums", sums))
    stores = [(f"new.{name}[{c}]", x) for name, values in parts for c, x in enumerate(values)]
    stores += _gaps(equations, State(step.q, step.v), "new")
    arguments = ["p", "contacts", "t", "h", "old", "new"]
    kernel.add("step", arguments, tape, [step.ok], stores, before=kernel.unpack("old."))


def _gaps(equations: Equations, state: State, motion: str) -> list[tuple[str, Scalar]]:
    """Return the fields of the contacts' gaps at a state, with their places in a motion."""
    phases, stores = equations.phases.reshape(-1, 2), []
    for k, joint in enumerate(equations.mechanism.contacts):
        fields = gap(joint, phases[k, 0], phases[k, 1], state)
        stores += [(f"{motion}.gaps[{k}].{field}", value) for field, value in fields.items()]
    return stores


def stabilised(topology: Topology) -> bool:
    """Return whether a stabilisation removes energy."""
    return topology.projected or topology.baumgarte is not None


def _slopes(kernel: Kernel) -> None:
    """Write ``slopes(p, contacts, t, motion, rates)``: the rates at a state; False on failure.

    A projection acts between steps: the rate of what it removes is zero.
    """
    tape, _, q, v = kernel.begin()
    found = kernel.call_answer(tape, tape.input("t"), q, v)
    powers = [*found.powers.values(), *([found.removed_W] if stabilised(kernel.topology) else [])]
    parts = (("a", found.accelerations), ("powers", powers), ("multipliers", found.multipliers))
    stores = [(f"rates.{name}[{c}]", x) for name, values in parts for c, x in enumerate(values)]
    arguments = ["p", "contacts", "t", "motion", "rates"]
    kernel.add("slopes", arguments, tape, [found.ok], stores, before=kernel.unpack("motion."))
