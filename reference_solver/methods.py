"""Runge-Kutta methods as data, and the step, on numbers as on a tape's values."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, reduce
from runpy import run_path
from typing import Any

import numpy as np
import scipy

from reference_solver.tape import Array, Scalar, both, larger, smaller

Row = tuple[float, ...]

#: The most by which conditions of a step's stages may differ. Near a singular position they go with the
#: distance to the power -2: beyond this a stage is nearer than a tenth, or a twentieth, of the step's length.
#: Where a condition is large all the time, as of light links, it does not differ.
MOST_APART = 100.0


@dataclass(frozen=True)
class Embedded:
    """What a method tells of a step beside its end: error estimates and dense output, as weights of slopes.

    ``estimates`` (2, s) are Hairer, Norsett and Wanner's (1993, II.10) of orders 5 and 3. Dense output takes
    slopes at ``nodes`` by ``matrix``, behind those of the stages and of the end, and ``dense`` are weights of
    all of them.
    """

    estimates: tuple[Row, ...]
    nodes: Row
    matrix: tuple[Row, ...]
    dense: tuple[Row, ...]

    @property
    def slopes(self) -> int:
        """Number of slopes that dense output takes in all."""
        return len(self.estimates[0]) + 1 + len(self.nodes)


@dataclass(frozen=True)
class Method:
    """An explicit Runge-Kutta method by its Butcher tableau: nodes (s,), matrix (s rows), weights (s,).

    It is stable up to ``damper_limit``, a step times a damper's rate, on the negative real axis. One that is
    ``embedded`` can have its steps chosen by their error.
    """

    order: int
    damper_limit: float
    nodes: Row
    matrix: tuple[Row, ...]
    weights: Row
    embedded: Embedded | None = None


#: The classical method (Kutta 1901), the paper's (13).
RK4 = Method(
    order=4,
    damper_limit=2.785,
    nodes=(0.0, 0.5, 0.5, 1.0),
    matrix=((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    weights=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
)


@cache
def dop853() -> Method:
    """Return Dormand and Prince's method of order 8 (Hairer, Norsett and Wanner 1993, II.5).

    Its table is SciPy's, read from the file that has nothing else: to import what is around it takes longer
    than to load everything else that a run needs.
    """
    table = run_path(f"{scipy.__path__[0]}/integrate/_ivp/dop853_coefficients.py")
    nodes, matrix = table["C"].tolist(), table["A"].tolist()
    stages, end = len(table["B"]), len(table["B"]) + 1
    estimates = tuple(tuple(table[name][:stages].tolist()) for name in ("E5", "E3"))
    return Method(
        order=8,
        damper_limit=6.39,
        nodes=tuple(nodes[:stages]),
        matrix=tuple(tuple(row[:i]) for i, row in enumerate(matrix[:stages])),
        weights=tuple(table["B"].tolist()),
        embedded=Embedded(
            estimates,
            nodes=tuple(nodes[end:]),
            matrix=tuple(tuple(row) for row in matrix[end:]),
            dense=tuple(tuple(row) for row in table["D"].tolist()),
        ),
    )


@cache
def dopri5() -> Method:
    """Return Dormand and Prince's method of order 5 (Hairer, Norsett and Wanner 1993, II.5 and II.6).

    Its last stage is at the step's end.
    """
    from scipy.integrate import RK45 as Table

    weights = (*Table.B.tolist(), 0.0)
    rows = (*(tuple(row[:i].tolist()) for i, row in enumerate(Table.A)), tuple(Table.B.tolist()))
    dense = (
        *(-12715105075 / 11282082432, 0.0, 87487479700 / 32700410799, -10690763975 / 1880347072),
        *(701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423, 0.0),
    )
    estimates = (tuple(Table.E.tolist()), (0.0,) * len(weights))
    nodes = (*Table.C.tolist(), 1.0)
    return Method(5, 3.30, nodes, rows, weights, Embedded(estimates, (), (), (dense,)))


@dataclass(frozen=True)
class Stage:
    """One stage: its velocities {Z2}, and what the right-hand side answered there."""

    v: Array
    answer: Any


def stages(
    method: Method, rates: Callable[[Scalar, Array, Array], Any], t: Scalar, q: Array, v: Array, h: Scalar
) -> list[Stage]:
    """Return the stages of a step from q and v at t.

    ``rates(t, q, v)`` answers with ``accelerations`` (n,): (11) and (12), {Z1'} = {Z2}, {Z2'} = {A}.
    """
    taken: list[Stage] = []
    for node, row in zip(method.nodes, method.matrix, strict=True):
        at_q, at_v = q, v
        for weight, stage in zip(row, taken, strict=True):
            if weight:
                at_q = at_q + (h * weight) * stage.v
                at_v = at_v + (h * weight) * stage.answer.accelerations
        taken.append(Stage(at_v, rates(t + h * node if node else t, at_q, at_v)))
    return taken


def quadrature(method: Method, h: Scalar, values: list[Any]) -> Any:
    """Return the method's integral over the step of what has these values at its stages."""
    total = 0.0
    for weight, value in zip(method.weights, values, strict=True):
        if weight:
            total = total + (h * weight) * value
    return total


@dataclass(frozen=True)
class Step:
    """A step: the new state, what rounding has taken from it, integrals by name, and success.

    ``removed`` is the energy in J that the stabilisation takes, ``condition`` the stages' worst (see
    ``Answer``). Success includes that the stages' conditions are no more than ``MOST_APART``.
    """

    q: Array
    v: Array
    lost: Array
    sums: dict[str, Scalar]
    removed: Scalar
    condition: Scalar
    ok: Scalar


def step(
    method: Method,
    answer: Callable[[Scalar, Array, Array], Any],
    project: Callable[[Scalar, Array, Array], tuple[Array, Array, Scalar, Scalar]] | None,
    t: Scalar,
    q: Array,
    v: Array,
    h: Scalar,
    lost: Array | None = None,
) -> Step:
    """Return the step (11)-(13) of h from q and v (n,) at t, moved onto the constraints by ``project``.

    ``answer(t, q, v)`` is that of ``Equations``. ``lost`` (2n,) is what rounding has taken from q and v,
    carried on to this step (Kahan 1965). What Baumgarte's feedback removes is its power at the start of the
    step times h: within a step the stages violate the constraints by more than the solution does.
    """
    taken, n = stages(method, answer, t, q, v, h), len(q)
    change_q = quadrature(method, h, [stage.v for stage in taken])
    change_v = quadrature(method, h, [stage.answer.accelerations for stage in taken])
    changes, old = np.concatenate([change_q, change_v]), np.concatenate([q, v])
    if lost is not None:
        changes = changes + lost
    new = old + changes  # (13)
    powers = [stage.answer.powers for stage in taken]
    sums = {name: quadrature(method, h, [power[name] for power in powers]) for name in powers[0]}
    conditions = [stage.answer.condition for stage in taken]
    worst = reduce(larger, conditions)
    ok = worst < MOST_APART * reduce(smaller, conditions)
    for stage in taken:
        if not isinstance(stage.answer.damper_per_s, float):
            ok = both(ok, h * stage.answer.damper_per_s < method.damper_limit)
    new_q, new_v, removed = new[:n], new[n:], h * taken[0].answer.removed_W
    if project is not None:
        new_q, new_v, removed, held = project(t + h, new_q, new_v)
        ok = both(ok, held)
    return Step(new_q, new_v, changes - (new - old), sums, removed, worst, ok)
