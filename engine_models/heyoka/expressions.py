"""A tape's values as heyoka's expressions."""

from collections.abc import Callable, Mapping
from typing import Any

import heyoka as hy

from reference_solver.tape import Node, Scalar, Value

#: Operations by their names on the tape. Conditions have no Taylor series: only plain functions have them.
OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "+": lambda x, y: x + y,
    "-": lambda x, y: x - y,
    "*": lambda x, y: x * y,
    "/": lambda x, y: x / y,
    "pow": lambda x, y: x**y,
    "cos": hy.cos,
    "sin": hy.sin,
    "sqrt": hy.sqrt,
    "tanh": hy.tanh,
    ">": hy.gt,
    "max": lambda x, y: hy.select(hy.gt(x, y), x, y),
    "if": lambda x, condition, y: hy.select(condition, x, y),
}


class Translation:
    """Translates values of one tape, whose inputs are named in ``inputs``."""

    def __init__(self, inputs: Mapping[str, hy.expression]) -> None:
        self._inputs = inputs
        self._done: dict[Node, hy.expression] = {}

    def __call__(self, value: Scalar) -> hy.expression:
        """Return the expression of a value or a number."""
        if not isinstance(value, Value):
            return hy.expression(float(value))
        expression = self._of_node(value.node)
        return -expression if value.minus else expression

    def _of_node(self, node: Node) -> hy.expression:
        if node.operation == "input":
            return self._inputs[node.operands[0]]
        if node not in self._done:
            self._done[node] = OPERATIONS[node.operation](*map(self, node.operands))
        return self._done[node]
