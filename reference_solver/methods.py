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
class Method:
    """An explicit Runge-Kutta method by its Butcher tableau: nodes, rows of the matrix, and s weights.

    It is stable up to ``damper_limit``, a step times a damper's rate, on the negative real axis. One that has
    ``estimates`` (2, s), Hairer, Norsett and Wanner's (1993, II.10) of orders 5 and 3, can have its steps
    chosen by their error. Its nodes and rows go on behind those of the s stages: with the step's end, and
    with what dense output takes; ``dense`` are weights of all of these slopes.
    """

    order: int
    damper_limit: float
    nodes: Row
    matrix: tuple[Row, ...]
    weights: Row
    estimates: tuple[Row, ...] = ()
    dense: tuple[Row, ...] = ()


#: The classical method (Kutta 1901), the paper's (13).
_MATRIX = (), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)
RK4 = Method(4, 2.785, nodes=(0.0, 0.5, 0.5, 1.0), matrix=_MATRIX, weights=(1 / 6, 1 / 3, 1 / 3, 1 / 6))


@cache
def dop853() -> Method:
    """Return Dormand and Prince's method of order 8 (Hairer, Norsett and Wanner 1993, II.5).

    Its table is SciPy's, read from the file that has nothing else: to import what is around it takes longer
    than to load everything else that a run needs.
    """
    table = run_path(f"{scipy.__path__[0]}/integrate/_ivp/dop853_coefficients.py")
    stages = len(table["B"])
    return Method(
        order=8,
        damper_limit=6.39,
        nodes=tuple(table["C"].tolist()),
        matrix=tuple(tuple(row[:i]) for i, row in enumerate(table["A"].tolist())),
        weights=tuple(table["B"].tolist()),
        estimates=tuple(tuple(table[name][:stages].tolist()) for name in ("E5", "E3")),
        dense=tuple(tuple(row) for row in table["D"].tolist()),
    )


@cache
def dopri5() -> Method:
    """Return Dormand and Prince's method of order 5 (Hairer, Norsett and Wanner 1993, II.5 and II.6).

    Its last stage is at the step's end.
    """
    from scipy.integrate import RK45 as Table

    weights = (*Table.B.tolist(), 0.0)
    rows = (*(tuple(row[:i].tolist()) for i, row in enumerate(Table.A)), tuple(Table.B.tolist()), weights)
    dense = (
        *(-12715105075 / 11282082432, 0.0, 87487479700 / 32700410799, -10690763975 / 1880347072),
        *(701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423, 0.0),
    )
    estimates = (tuple(Table.E.tolist()), (0.0,) * len(weights))
    return Method(5, 3.30, (*Table.C.tolist(), 1.0, 1.0), rows, weights, estimates, (dense,))


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
    velocities, answers, n = list[Array](), list[Any](), len(q)

    def advance(start: Any, rates: list[Any], weights: Row) -> Any:
        """Return what has these rates at the stages, from its start on."""
        for weight, rate in zip(weights, rates, strict=True):
            if weight:
                start = start + (h * weight) * rate
        return start

    for node, row in zip(method.nodes, method.matrix, strict=True):  # (11), (12): {Z1'} = {Z2}, {Z2'} = {A}
        at_q, at_v = advance(q, velocities, row), advance(v, [x.accelerations for x in answers], row)
        velocities.append(at_v)
        answers.append(answer(t + h * node if node else t, at_q, at_v))
    change_q = advance(0.0, velocities, method.weights)
    change_v = advance(0.0, [x.accelerations for x in answers], method.weights)
    changes, old = np.concatenate([change_q, change_v]), np.concatenate([q, v])
    if lost is not None:
        changes = changes + lost
    new = old + changes  # (13)
    powers = [x.powers for x in answers]
    sums = {name: advance(0.0, [power[name] for power in powers], method.weights) for name in powers[0]}
    conditions = [x.condition for x in answers]
    worst = reduce(larger, conditions)
    ok = worst < MOST_APART * reduce(smaller, conditions)
    for x in answers:
        if not isinstance(x.damper_per_s, float):
            ok = both(ok, h * x.damper_per_s < method.damper_limit)
    new_q, new_v, removed = new[:n], new[n:], h * answers[0].removed_W
    if project is not None:
        new_q, new_v, removed, held = project(t + h, new_q, new_v)
        ok = both(ok, held)
    return Step(new_q, new_v, changes - (new - old), sums, removed, worst, ok)
