"""The compiled functions of a mechanism: the equations of its topology on tapes, as machine code.

What the mechanism does not contain does not occur: no zero entry, no absent load, no arm of a pin at a centre
of mass. Its numbers are inputs, so that one compilation serves every mechanism of the same topology. All
functions have one form (see ``machine_code``). A state y has q, q' and sums, gaps of the contacts
(``run.Gap``), and for a step its length h and what rounding has taken from q and q'.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache, cached_property, partial
from itertools import count
from typing import Any

import numpy as np

from reference_solver.equations import Answer, Baumgarte, Equations
from reference_solver.impacts import resolver
from reference_solver.machine_code import HEAD, Function, FunctionText, compile_text, parameters_text
from reference_solver.mechanism.contacts import FRICTION_LAWS, WRITTEN_OUT, gap, separation
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.motions import PiecewiseCubic, PlacedTable
from reference_solver.mechanism.points import State
from reference_solver.methods import RK4, Method, step
from reference_solver.run import CONTACT_RECORD, GAP_FIELDS, Run
from reference_solver.tape import Array, FloatArray, Node, Scalar, Tape, array, both, choose


def lifted(
    data: Any,
    number: Callable[[float], Any],
    placed: Callable[[PiecewiseCubic], PlacedTable] = PiecewiseCubic.placed,
    written_out: tuple[float, ...] = (),
) -> Any:
    """Return dataclasses and tuples with every number replaced, in order; zeros and ``written_out`` stay.

    What equals zero is structure: a point at the centre of mass, a law without damping. Of a table, of which
    a kernel has no input for each number, those of its place are replaced, as ``placed`` gives it. Fields
    that do not count where two are compared, such as names, are left as they are.
    """
    new = data
    if isinstance(data, float):
        new = 0.0 if data == 0 else data if data in written_out else number(data)
    elif isinstance(data, tuple):
        new = tuple(lifted(part, number, placed, written_out) for part in data)
    elif isinstance(data, PiecewiseCubic):
        new = lifted(placed(data), number)
    elif is_dataclass(data):
        new = copy.copy(data)
        for field in fields(data):
            if field.compare:
                kept = field.metadata.get(WRITTEN_OUT, ())
                value = lifted(getattr(data, field.name), number, placed, kept)
                object.__setattr__(new, field.name, value)  # the copy of frozen data
    return new


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
        """Return the mechanism's numbers in the order of ``given_on``, and those of its tables."""
        numbers, of_tables = list[float](), list[float]()

        def place(table: PiecewiseCubic) -> PlacedTable:
            placed = table.placed(len(of_tables))
            of_tables[:0] = table.rows
            return placed

        lifted((self.mechanism, self.baumgarte), numbers.append, place)
        return numbers, of_tables


@dataclass(frozen=True)
class Given:
    """What a function of a kernel is given: a topology's equations and a state, in numbers or on a tape.

    ``phases`` (K, 2) are phase and memory of every contact; ``h``, ``lost`` (2n,) and
    ``sums`` (s,) are of a step.
    """

    topology: Topology
    equations: Equations
    t: Scalar
    q: Array
    v: Array
    phases: Array
    h: Scalar = 0.0
    lost: Array | None = None
    sums: Array | None = None

    @cached_property
    def answer(self) -> Answer:
        """The equations' answer."""
        return self.equations.answer(self.t, self.q, self.v, self.phases)


def rates(given: Given) -> list[Scalar]:
    """Rates of q, q' and the sums (2n + s,).

    A projection acts between steps: the rate of what it removes is zero.
    """
    answer = given.answer
    return [*given.v, *answer.accelerations, *answer.powers.values(), answer.removed_W, answer.condition]


def forces(given: Given) -> list[Scalar]:
    """{lambda} of the mechanism's own rows, then normal force and friction of every contact."""
    answer = given.answer
    normal = [answer.powers[f"normal{k}"] for k in range(len(answer.friction_N))]
    of_contacts = [force for pair in zip(normal, answer.friction_N, strict=True) for force in pair]
    return [*answer.multipliers[: given.equations.own_rows], *of_contacts, answer.condition]


def project(given: Given) -> list[Scalar]:
    """q and q' on the constraints, and the energy removed; as they are without a projection."""
    if not given.topology.projected:
        return [*given.q, *given.v, 0.0, 1.0]
    q, v, removed, ok = given.equations.project(given.t, given.q, given.v, given.phases)
    return [*q, *v, removed, choose(ok, 1.0, math.inf)]


def gaps(given: Given) -> list[Scalar]:
    """The fields of every contact's gap.

    Whether pins that follow rigid walls are pressed against them takes an answer.
    """
    powers, condition = dict[str, Scalar](), 1.0
    if given.topology.following:
        powers, condition = given.answer.powers, given.answer.condition
    fields: list[Scalar] = []
    for k, joint in enumerate(given.equations.mechanism.contacts):
        phase, memory = given.phases[k]
        pressing = powers.get(f"normal{k}", 0.0)
        fields += gap(joint, phase, memory, State(given.q, given.v), pressing)
    return [*fields, condition]


def mobilities(given: Given) -> list[Scalar]:
    """Three mobilities in 1/kg of every contact, (3K,): a speed per unit of its own impulse.

    They are along the normal, of sliding (0 without friction), and of the pin's centre along its wall. A row
    N of a speed has N x, with x the answer of (2) and (4) to a force N^T alone.
    """
    state, B = State(given.q, np.zeros(len(given.q))), given.equations.system(0.0, given.q).B
    factors, mobilities = given.equations.factors(B), list[Scalar]()
    for joint in given.equations.mechanism.contacts:
        at = separation(joint, state)
        for row in (at.normal, None if joint.friction is None else at.tangent, at.across):
            mobilities.append(0.0 if row is None else row @ factors.solve(row, np.zeros(len(B)))[0])
    return [*mobilities, 1.0]


def walls(given: Given) -> list[Scalar]:
    """How pins of R joints with rigid walls answer to impulses and forces, no pin following.

    Of every joint there are distance and round-off (see ``Separation``), the mobility along the normal that
    free bodies would have, in 1/kg, friction as a part of the normal force, and the inward acceleration. They
    push along S rows D of {q'}: of every joint the inward normal speed, then of those with friction the
    tangential one. There are the speeds (S,), W (S, S), which are speeds per unit of each impulse, {q'} per
    unit of each (S, n), and the work of the drivers (S,).
    """
    equations, answer, v = given.equations, given.answer, given.v
    state, system = State(given.q, v), equations.system(given.t, given.q, v)
    joints = [joint for joint in equations.mechanism.contacts if joint.rigid]
    at = [separation(joint, state) for joint in joints]
    tangents = [each.tangent for each, joint in zip(at, joints, strict=True) if joint.friction is not None]
    D = array([*(-each.normal for each in at), *tangents])
    motion, reactions = equations.factors(system.B).solve(D.T, np.zeros((len(system.C), len(D))))
    W, numbers = D @ motion, list[list[Scalar]]()
    for each, joint, row in zip(at, joints, D, strict=False):
        bare, law = (row * row) @ equations.inverse_mass, joint.friction
        sliding = each.tangent @ v
        share = 0.0 if law is None else law.coefficient * FRICTION_LAWS[law.law](law, sliding)
        pull = row @ answer.accelerations - each.turning
        numbers.append([each.distance, each.noise, each.rate_noise, bare, share, pull])
    speeds = array([*(-each.rate for each in at), *(tangent @ v for tangent in tangents)])
    parts = array(numbers), speeds, 0.5 * (W + W.T), motion.T, reactions.T @ system.C
    return [*(x for part in parts for x in np.asarray(part).ravel()), answer.condition]


def stepped(given: Given) -> list[Scalar]:
    """y after a step of h, the gaps, 0 for h, and what rounding has taken."""
    answer = partial(given.equations.answer, phases=given.phases)
    projected = partial(given.equations.project, phases=given.phases) if given.topology.projected else None
    after = step(given.topology.method, answer, projected, given.t, given.q, given.v, given.h, given.lost)
    end = replace(given, t=given.t + given.h, q=after.q, v=after.v)
    *fields, condition = gaps(end)
    y = [*after.q, *after.v, *(given.sums + array([*after.sums.values(), after.removed]))]
    ok = both(both(after.ok, condition < math.inf), abs(sum(y)) < math.inf)
    return [*y, *fields, 0.0, *after.lost, choose(ok, after.condition, math.inf)]


#: The functions of a kernel by their names.
FUNCTIONS = {f.__name__: f for f in (rates, forces, project, gaps, mobilities, walls, stepped)}


@cache
def program_of(topology: Topology) -> tuple[str, dict[str, Function], int]:
    """Return the text of a marked topology's functions, these, and how many numbers p has.

    There is ``stepped`` if the method has no steps of its own. The numbers are known nodes that are loaded.
    """
    texts, parameters = list[str](), dict[Node, int]()
    names = [*FUNCTIONS]
    if topology.method.estimates:
        names.remove("stepped")
    if topology.following or not any(joint.rigid for joint in topology.mechanism.contacts):
        names.remove("walls")
    for name in names:
        given = given_on(tape := Tape(), topology)
        texts.append(FunctionText(name, tape, FUNCTIONS[name](given), parameters).text)
    text = HEAD + "".join([*texts, parameters_text(parameters)])
    return text, compile_text(text, [*names, "parameters"]), len(parameters)


def given_on(tape: Tape, topology: Topology) -> Given:
    """Return a topology's equations and a state on a tape; raw numbers are inputs known before a run."""
    places = count()

    def number(_: float) -> Scalar:
        return tape.input("raw", next(places), known=True)

    n, contacts, fields = topology.n, topology.mechanism.contacts, CONTACT_RECORD.itemsize // 8
    of_contacts = (tape.inputs("contacts", fields * k, 2) for k in range(len(contacts)))  # the first fields
    phases = [[0.0, 0.0] if joint.rigid else of for joint, of in zip(contacts, of_contacts, strict=True)]
    mechanism, baumgarte = lifted((topology.mechanism, topology.baumgarte), number)
    q_start = np.array([number(0.0) for _ in range(n)], dtype=object)
    equations = Equations(mechanism, q_start, baumgarte, topology.following)
    sums = len(equations.power_names) + 1
    h = 2 * n + sums + GAP_FIELDS * len(contacts)
    q, v, of_y = tape.inputs("y", 0, n), tape.inputs("y", n, n), tape.inputs("y", 2 * n, sums)
    lost = tape.inputs("y", h + 1, 2 * n)
    return Given(topology, equations, tape.input("t"), q, v, array(phases), tape.input("y", h), lost, of_y)


class Kernel:
    """The functions of a topology, compiled, with p of a mechanism and its start ``q_start`` (n,).

    ``p`` is an address, that of its numbers; ``functions`` are by their names.
    """

    def __init__(self, topology: Topology, q_start: FloatArray) -> None:
        _, self.functions, size = program_of(topology.marked())
        own, of_tables = topology.numbers()
        self._numbers = np.array([*of_tables, *np.zeros(size)])
        self.p = self._numbers.ctypes.data + 8 * len(of_tables)
        raw = np.array([*own, *q_start])  # of a singular mechanism infinite numbers come, found in the run
        self.functions["parameters"](0, 0, 0.0, raw, self._numbers[len(of_tables) :])

    def bind(self, run: Run) -> None:
        """Have a run call these functions."""
        run.state["p"] = self.p
        if "walls" in self.functions:
            run.state["walls_p"], run.state["resolve"] = self.p, resolver().address
        for name in FUNCTIONS.keys() & self.functions.keys():
            run.state[name] = self.functions[name].address
