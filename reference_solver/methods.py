"""Runge-Kutta methods as data, and their step, on numbers as on a tape's values."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from reference_solver.tape import Array, Scalar


@dataclass(frozen=True)
class Method:
    """An explicit Runge-Kutta method by its Butcher tableau: nodes (s,), matrix (s rows), weights (s,)."""

    order: int
    nodes: tuple[float, ...]
    matrix: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]


#: The classical method (Kutta 1901), the paper's (13).
RK4 = Method(
    order=4,
    nodes=(0.0, 0.5, 0.5, 1.0),
    matrix=((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    weights=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
)


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
    found: list[Stage] = []
    for node, row in zip(method.nodes, method.matrix, strict=True):
        at_q, at_v = q, v
        for weight, stage in zip(row, found, strict=True):
            if weight:
                at_q = at_q + (h * weight) * stage.v
                at_v = at_v + (h * weight) * stage.answer.accelerations
        found.append(Stage(at_v, rates(t + h * node if node else t, at_q, at_v)))
    return found


def quadrature(method: Method, h: Scalar, values: list[Any]) -> Any:
    """Return the method's integral over the step of what has these values at its stages."""
    total = 0.0
    for weight, value in zip(method.weights, values, strict=True):
        if weight:
            total = total + (h * weight) * value
    return total


def increments(method: Method, h: Scalar, found: list[Stage]) -> tuple[Array, Array]:
    """Return what q and v change by in a step with these stages, (13)."""
    return (
        quadrature(method, h, [stage.v for stage in found]),
        quadrature(method, h, [stage.answer.accelerations for stage in found]),
    )
