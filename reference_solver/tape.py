"""A tape: what the functions of ``equations`` do with its values is kept, and written as straight-line code.

A ``Value`` stands for a number that is not known yet. Sums and products of values are values; zeros, ones and
minus ones fold away as they arise, equal operations are kept once, and only what the results need is written.
NumPy's arrays hold values as they hold any object, so that a function on arrays of numbers is one on arrays
of values too. What NumPy does not know of objects, ``cos``, ``larger``, ``choose``, ``when`` and the like, is
below, and takes numbers and values.

Values that depend on parameters alone are known before a run: they are computed once, from the raw numbers of
a mechanism, and are an array to the code (see ``machine_code``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: A number or a value; an array of either, of numbers, and of records.
Scalar = Any
Array = Any
FloatArray = NDArray[np.float64]
RecordArray = NDArray[np.void]

#: Operations that are conditions, or choose by one: no numbers that could be known before a run.
CONDITIONS = (">", "&", "if")


@dataclass(eq=False)
class Node:
    """An operation on operands, an input, a call or a branch, or one of the results of these two.

    ``operands`` are values, numbers and strings. A ``known`` node depends on parameters alone.
    """

    operation: str
    operands: tuple[Any, ...]
    known: bool = False


#: The lines of a function or of a branch: nodes in the order in which they arose, by what tells them apart.
Scope = dict[tuple[Any, ...], Node]


class Tape:
    """Keeps the operations of one function."""

    def __init__(self) -> None:
        self.scopes: list[Scope] = [{}]
        #: All nodes as they arose: whatever a node needs comes before it.
        self.nodes: list[Node] = []

    def input(self, of: str, place: int = 0, known: bool = False) -> Value:
        """Return a number that the function is given: the time "t", or the one at a place of an array."""
        return Value(self, self._node("input", (of, place), known))

    def inputs(self, of: str, first: int, count: int) -> Array:
        """Return so many numbers of an array from the first one on."""
        return array([self.input(of, first + k) for k in range(count)])

    def keep(self, operation: str, *operands: Scalar) -> Value:
        """Return the value of an operation; conditions are no numbers and so no parameters."""
        nodes = [operand.node for operand in operands if isinstance(operand, Value)]
        known = operation not in CONDITIONS and all(node.known for node in nodes)
        return Value(self, self._node(operation, operands, known))

    def call(self, function: str, arguments: Iterable[Scalar], results: int) -> list[Value]:
        """Return so many results of another function, of numbers."""
        node = self._node("call", (function, results, *arguments), False)
        return [Value(self, self._node("result", (node, k), False)) for k in range(results)]

    def branch(self, condition: Value, body: Callable[[], tuple[Scalar, ...]]) -> tuple[Scalar, ...]:
        """Return what ``body`` returns where the condition holds, zeros elsewhere."""
        self.scopes.append({})
        outputs = body()
        node = Node("branch", (condition, outputs, self.scopes.pop()))
        self.scopes[-1]["branch", id(node)] = node
        self.nodes.append(node)
        results = [Value(self, self._node("result", (node, k), False)) for k in range(len(outputs))]
        return tuple(0.0 if _is(x, 0.0) else result for x, result in zip(outputs, results, strict=True))

    def _node(self, operation: str, operands: tuple[Any, ...], known: bool) -> Node:
        marks = [_mark(operand) for operand in operands]
        key = (operation, *(sorted(marks) if operation in "+*" else marks))
        for scope in self.scopes:
            if key in scope:
                return scope[key]
        node = self.scopes[-1][key] = Node(operation, operands, known)
        self.nodes.append(node)
        return node


class Value:
    """A number that is not known yet: a node, or minus a node."""

    __slots__ = ("minus", "node", "tape")

    def __init__(self, tape: Tape, node: Node, minus: bool = False) -> None:
        self.tape, self.node, self.minus = tape, node, minus

    def __neg__(self) -> Value:
        return Value(self.tape, self.node, not self.minus)

    def __add__(self, other: Scalar) -> Scalar:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if _is(other, 0.0):
            return self
        minus, size = _parts(other)
        if self.minus == minus:
            total = self.tape.keep("+", _parts(self)[1], size)
            return -total if minus else total
        if isinstance(other, Value) and other.node is self.node:
            return 0.0
        return self.tape.keep("-", size, _parts(self)[1]) if self.minus else self.tape.keep("-", self, size)

    def __mul__(self, other: Scalar) -> Scalar:
        if isinstance(other, np.ndarray):
            return NotImplemented
        if _is(other, 0.0):
            return 0.0
        (minus, size), (other_minus, other_size) = _parts(self), _parts(other)
        product = size if _is(other_size, 1.0) else self.tape.keep("*", size, other_size)
        return -product if minus != other_minus else product

    def __sub__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else self + -other

    def __rsub__(self, other: Scalar) -> Scalar:
        return -self + other

    def __truediv__(self, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else _quotient(self.tape, self, other)

    def __rtruediv__(self, other: Scalar) -> Scalar:
        return _quotient(self.tape, other, self)

    def __pow__(self, power: Scalar) -> Scalar:
        return self * self if _is(power, 2.0) else self.tape.keep("pow", self, power)

    def __abs__(self) -> Value:
        return self.tape.keep("abs", self)

    def __gt__(self, other: Scalar) -> Value:
        return self.tape.keep(">", self, other)

    def __lt__(self, other: Scalar) -> Value:
        return self.tape.keep(">", other, self)

    __radd__, __rmul__ = __add__, __mul__


def _is(x: Scalar, number: float) -> bool:
    return not isinstance(x, Value) and bool(x == number)


def _parts(x: Scalar) -> tuple[bool, Scalar]:
    """Return whether a factor is negative, and its size."""
    if isinstance(x, Value):
        return x.minus, Value(x.tape, x.node)
    return x < 0, abs(x)


def _quotient(tape: Tape, above: Scalar, below: Scalar) -> Scalar:
    if _is(above, 0.0):
        return 0.0
    (minus, size), (other_minus, other_size) = _parts(above), _parts(below)
    quotient = size if _is(other_size, 1.0) else tape.keep("/", size, other_size)
    return -quotient if minus != other_minus else quotient


def _mark(operand: Any) -> str:
    """Return what tells an operand from others."""
    if isinstance(operand, Value):
        return f"{'-' if operand.minus else ''}{id(operand.node)}"
    return f"node {id(operand)}" if isinstance(operand, Node) else repr(operand)


def array(elements: Any) -> Array:
    """Return an array of numbers, or of objects where a value is among the elements."""
    try:
        return np.array(elements, dtype=float)
    except TypeError:
        return np.array(elements, dtype=object)


def _of_numbers_or_values(name: str, of_numbers: Callable[..., Any], doc: str) -> Callable[..., Scalar]:
    def function(*operands: Scalar) -> Scalar:
        tapes = [operand.tape for operand in operands if isinstance(operand, Value)]
        return tapes[0].keep(name, *operands) if tapes else of_numbers(*operands)

    function.__doc__ = doc
    return function


cos = _of_numbers_or_values("cos", np.cos, "Return the cosine.")
sin = _of_numbers_or_values("sin", np.sin, "Return the sine.")
sqrt = _of_numbers_or_values("sqrt", np.sqrt, "Return the square root.")
tanh = _of_numbers_or_values("tanh", np.tanh, "Return the hyperbolic tangent.")
larger = _of_numbers_or_values("max", max, "Return the larger of two.")
smaller = _of_numbers_or_values("min", min, "Return the smaller of two.")
signed = _of_numbers_or_values("copysign", np.copysign, "Return |x| with the sign of another.")
_both = _of_numbers_or_values("&", lambda x, y: bool(x) and bool(y), "Return whether both hold.")
choose = _of_numbers_or_values("if", lambda holds, x, y: x if holds else y, "Return x if it holds, else y.")


def both(x: Scalar, y: Scalar) -> Scalar:
    """Return whether both conditions hold."""
    if x is True or y is True:
        return y if x is True else x
    return _both(x, y)


def when(condition: Scalar, body: Callable[[], tuple[Scalar, ...]], outputs: int) -> tuple[Scalar, ...]:
    """Return what ``body`` returns where the condition holds, and so many zeros elsewhere."""
    if isinstance(condition, Value):
        return condition.tape.branch(condition, body)
    return body() if condition else (0.0,) * outputs
