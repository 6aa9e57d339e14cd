"""Machine code of straight-line functions, in a quarter of the time that Numba takes for it.

What a kernel does between reading its arguments and storing its results is a long list of sums and products.
Numba finds out the type of each, which takes longer than everything else. Here all are float64 or conditions,
and go from the text to LLVM, as they stand, within a function that Numba compiles.
"""

import ast
import builtins
import inspect
import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, config, types
from numba.core.typing.templates import signature
from numba.extending import intrinsic

from reference_solver.contact.linked import InnerCompiler

FLOAT, CONDITION, INDEX = types.float64, types.boolean, types.intp
NUMBERS = types.CPointer(FLOAT)
ARITHMETIC = {ast.Add: "fadd", ast.Sub: "fsub", ast.Mult: "fmul", ast.Div: "fdiv"}
COMPARISONS = {ast.Gt: ">", ast.Eq: "=="}


def straight_line(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that functions of Numba call, and that is put in their place.

    Its text has assignments, to names, tuples of names and places in arrays and records, branches by ``if``
    that change names assigned before, and one ``return`` at its end: of what ``tape.Writer`` writes. It calls
    others of the kind, and what Numba knows or has compiled that returns a number or a tuple of them.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    text = cache(partial(Text, function))  # read when it is to be compiled: mostly that has been done

    def definition(_: Any, *arguments: Any) -> Any:
        kinds = text().results

        def emit(context: Any, builder: Any, own: Any, values: Sequence[Any]) -> Any:
            results = Emitter(context, builder, text(), list(zip(own.args, values, strict=True))).run()
            return results[0] if len(kinds) == 1 else context.make_tuple(builder, own.return_type, results)

        return signature(kinds[0] if len(kinds) == 1 else types.Tuple(kinds), *arguments), emit

    definition.__name__ = function.__name__
    arguments = [inspect.Parameter("context", inspect.Parameter.POSITIONAL_OR_KEYWORD)]
    arguments += inspect.signature(function).parameters.values()
    definition.__signature__ = inspect.Signature(arguments)  # type: ignore[attr-defined]
    made: Any = intrinsic(definition)
    made.text = text
    return made  # type: ignore[no-any-return]


def called(**options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return what makes a function that functions of ``straight_line`` call, outside of branches.

    Compiled with these options, it is in the code of all who call it, once in each. It takes p, an array, and
    numbers, and returns several numbers and conditions: all but p through memory on the stack.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        if config.DISABLE_JIT:  # type: ignore[attr-defined]
            return function
        text = cache(partial(Text, function))

        def definition(_: Any, p: Any, numbers: Any) -> Any:
            def emit(context: Any, builder: Any, own: Any, values: Sequence[Any]) -> Any:
                array, memory = values
                places = places_in(builder, memory, len(text().arguments) - 1 + len(text().results))
                given = [(FLOAT, builder.load(places.pop(0))) for _ in text().arguments[1:]]
                results = Emitter(context, builder, text(), [(own.args[0], array), *given]).run()
                for kind, result, at in zip(text().results, results, places, strict=True):
                    builder.store(context.cast(builder, result, kind, FLOAT), at)
                return context.get_dummy_value()

            return signature(types.none, p, numbers), emit

        body: Any = intrinsic(definition)

        def whole(p: Any, numbers: Any) -> Any:
            return body(p, numbers)

        # What is kept on disk of several processes finds it by its name in machine code, which has these two.
        whole.__module__, whole.__qualname__ = function.__module__, function.__qualname__
        made: Any = numba.njit(**options, pipeline_class=InnerCompiler)(whole)
        made.through_memory = text
        return made  # type: ignore[no-any-return]

    return decorate


def zeros_on_stack(_: Any, size: Any) -> Any:
    """Return so many zeros, a literal number, in memory on the stack."""

    def emit(_: Any, builder: Any, *__: Any) -> Any:
        memory = numbers_on_stack(builder, size.literal_value)
        cgutils.memset(builder, memory, ir.Constant(ir.IntType(64), 8 * size.literal_value), 0)
        return memory

    return (NUMBERS(size), emit) if isinstance(size, types.IntegerLiteral) else None


zeros: Any = np.zeros if config.DISABLE_JIT else intrinsic(zeros_on_stack)  # type: ignore[attr-defined]


def numbers_on_stack(builder: Any, size: int) -> Any:
    """Return the address of so many numbers on the stack."""
    return cgutils.alloca_once(builder, ir.DoubleType(), size)


def places_in(builder: Any, memory: Any, count: int) -> list[Any]:
    """Return the addresses of so many numbers in memory."""
    return [cgutils.gep_inbounds(builder, memory, k) for k in range(count)]


class Text:
    """A function's statements, the names of its arguments, and the types of its ``results``.

    ``functions`` are those of its module by their names.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        definition: Any = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        self.arguments = [argument.arg for argument in definition.args.args]
        *self.statements, last = definition.body
        self.returned = last.value.elts if isinstance(last.value, ast.Tuple) else [last.value]
        self.functions = function.__globals__
        self._kinds: dict[str, types.Type] = {}
        for statement in self.statements:
            if isinstance(statement, ast.Assign):
                self._note(statement.targets[0], statement.value)
        self.results = [self._kind(value) for value in self.returned]

    def results_of(self, call: Any, count: int) -> list[types.Type]:
        """Return the types of so many results of a call; those of a function of Numba are numbers."""
        function = self.functions[call.func.id]
        text = getattr(function, "text", None) or getattr(function, "through_memory", None)
        return [FLOAT] * count if text is None else text().results

    def _note(self, target: Any, value: Any) -> None:
        if isinstance(target, ast.Tuple):
            kinds = self.results_of(value, len(target.elts))
            self._kinds.update({name.id: kind for name, kind in zip(target.elts, kinds, strict=True)})  # type: ignore[attr-defined]
        elif isinstance(target, ast.Name):
            self._kinds[target.id] = self._kind(value)

    def _kind(self, value: Any) -> types.Type:
        if isinstance(value, ast.Name):
            return self._kinds.get(value.id, FLOAT)
        if isinstance(value, ast.IfExp):
            return self._kind(value.body)
        is_bool = isinstance(value, ast.Constant) and isinstance(value.value, bool)
        is_condition = isinstance(value, ast.Compare) or (
            isinstance(value, ast.BinOp) and isinstance(value.op, ast.BitAnd)
        )
        return CONDITION if is_bool or is_condition else FLOAT


@dataclass(frozen=True)
class InMemory:
    """A number that is read where it is used: LLVM would read it at once, and save it over calls."""

    address: Any


class Emitter:
    """Writes a function's text for LLVM where a builder stands; ``named`` are types and values by names."""

    def __init__(self, context: Any, builder: Any, text: Text, arguments: list[tuple[Any, Any]]) -> None:
        self.context, self.builder, self.text = context, builder, text
        self.named: dict[str, tuple[Any, Any]] = dict(zip(text.arguments, arguments, strict=True))

    def run(self) -> list[Any]:
        """Return the results."""
        self._run(self.text.statements)
        return [self._value(value) for value in self.text.returned]

    def _run(self, statements: list[Any]) -> None:
        for statement in statements:
            if isinstance(statement, ast.If):
                self._branch(statement)
                continue
            target, value = statement.targets[0], statement.value
            if isinstance(target, ast.Tuple):
                kinds, values = self.text.results_of(value, len(target.elts)), self._call(value)
                for name, *result in zip(target.elts, kinds, values, strict=True):
                    self.named[name.id] = tuple(result)  # type: ignore[attr-defined]
            elif isinstance(target, ast.Name):
                self.named[target.id] = self._typed(value)
            else:
                kind, place = self._place(target)
                own, number = self._typed(value)
                self.context.pack_value(
                    self.builder, kind, self.context.cast(self.builder, number, own, kind), place
                )

    def _branch(self, statement: ast.If) -> None:
        """Write a branch; what it changes has the new values behind it if it was taken."""
        before, start = dict(self.named), self.builder.basic_block
        with self.builder.if_then(self._value(statement.test)):
            self._run(statement.body)
            end, inside = self.builder.basic_block, self.named
        self.named = before
        for name, (kind, old) in before.items():
            if inside[name][1] is not old:
                value = self.builder.phi(old.type)
                value.add_incoming(old, start)
                value.add_incoming(inside[name][1], end)
                self.named[name] = kind, value

    def _value(self, node: Any) -> Any:
        """Return an expression's value."""
        builder = self.builder
        match node:
            case ast.Constant(value=bool(value)):
                return ir.Constant(ir.IntType(1), int(value))
            case ast.Constant(value=float(value)):
                return ir.Constant(ir.DoubleType(), value)
            case ast.Name(id="inf"):
                return ir.Constant(ir.DoubleType(), math.inf)
            case ast.UnaryOp(operand=operand):
                return builder.fneg(self._value(operand))
            case ast.BinOp(left=left, op=ast.BitAnd(), right=right):
                return builder.and_(self._value(left), self._value(right))
            case ast.BinOp(left=left, op=op, right=right):
                return getattr(builder, ARITHMETIC[type(op)])(self._value(left), self._value(right))
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return builder.fcmp_ordered(COMPARISONS[type(op)], self._value(left), self._value(right))
            case ast.IfExp(test=test, body=body, orelse=other):
                return builder.select(self._value(test), self._value(body), self._value(other))
            case ast.Call():
                (value,) = self._call(node)
                return value
        return self._got(node)

    def _typed(self, node: Any) -> tuple[Any, Any]:
        """Return an expression's type and value."""
        value = self._value(node)
        return (CONDITION if value.type == ir.IntType(1) else FLOAT), value

    def _call(self, node: Any) -> list[Any]:
        """Return what a call returns."""
        name, builder, context = node.func.id, self.builder, self.context
        if name in ("max", "min"):
            first, second = map(self._value, node.args)
            sign = ">" if name == "max" else "<"
            return [builder.select(builder.fcmp_ordered(sign, second, first), second, first)]
        function = self.text.functions.get(name) or getattr(builtins, name)
        if hasattr(function, "through_memory"):
            return self._called(function, node)
        arguments = [self._argument(argument) for argument in node.args]
        kinds, values = zip(*arguments, strict=True)
        if hasattr(function, "text"):
            return Emitter(context, builder, function.text(), arguments).run()
        kind, result = self._compiled(function, kinds, values)
        return list(cgutils.unpack_tuple(builder, result)) if isinstance(kind, types.BaseTuple) else [result]

    def _called(self, function: Any, call: ast.Call) -> list[Any]:
        """Return what a function returns that is ``called``, and keep names that it is given, in memory."""
        builder, results = self.builder, function.through_memory().results
        (kind, p), *numbers = [self._argument(node) for node in call.args]
        size = len(numbers) + len(results)
        memory = numbers_on_stack(builder, size)
        places = places_in(builder, memory, size)
        for (_, number), at in zip(numbers, places, strict=False):
            builder.store(number, at)
        self._compiled(function, (kind, NUMBERS), (p, memory))
        for node, at in zip(call.args[1:], places, strict=False):
            if isinstance(node, ast.Name):
                self.named[node.id] = FLOAT, InMemory(at)
        zero = ir.Constant(ir.DoubleType(), 0.0)
        return [
            builder.fcmp_ordered("!=", builder.load(at), zero) if own == CONDITION else InMemory(at)
            for own, at in zip(results, places[len(numbers) :], strict=True)
        ]

    def _compiled(self, function: Any, kinds: Sequence[Any], values: Sequence[Any]) -> tuple[Any, Any]:
        """Return type and value of what a function returns that Numba compiles."""
        context = self.context
        callee = context.typing_context.resolve_value_type(function)
        own = context.typing_context.resolve_function_type(callee, kinds, {})
        implementation = context.get_function(callee, own)
        context.add_linking_libs(getattr(implementation, "libs", ()))
        return own.return_type, implementation(self.builder, values)

    def _argument(self, node: Any) -> tuple[Any, Any]:
        """Return type and value of an argument, which may be an array."""
        if isinstance(node, ast.Name) and node.id in self.named:
            return self._named(node.id)
        return self._typed(node)

    def _named(self, name: str) -> tuple[Any, Any]:
        """Return type and value of a name."""
        kind, value = self.named[name]
        return kind, self.builder.load(value.address) if isinstance(value, InMemory) else value

    def _got(self, node: Any) -> Any:
        """Return the number or condition that a name or a place holds."""
        kind, value = self._place(node)
        if not isinstance(node, ast.Name):
            value = self.context.unpack_value(self.builder, kind, value)
        return value if kind == CONDITION else self.context.cast(self.builder, value, kind, FLOAT)

    def _place(self, node: Any) -> tuple[Any, Any]:
        """Return type and value of a name, or type and address of a place in an array or a record."""
        context, builder = self.context, self.builder
        match node:
            case ast.Name(id=name):
                return self._named(name)
            case ast.Attribute(value=of, attr=field):
                kind, value = self._place(of)
                if isinstance(kind, types.Record):
                    member = kind.typeof(field)
                    data = context.get_data_type(member)
                    return member, cgutils.get_record_member(builder, value, kind.offset(field), data)
                number = kind.fields.index(field)
                return kind.types[number], builder.extract_value(value, number)
            case ast.Subscript(value=of, slice=where):
                kind, value = self._place(of)
                at = [self._index(index) for index in getattr(where, "elts", [where])]
                if kind == NUMBERS:
                    return FLOAT, builder.gep(value, at)
                array = context.make_array(kind)(context, builder, value)
                return kind.dtype, cgutils.get_item_pointer(context, builder, kind, array, at, True)
        raise AssertionError(f"no place: {ast.unparse(node)}")

    def _index(self, node: Any) -> Any:
        if isinstance(node, ast.Constant):
            return self.context.get_constant(INDEX, node.value)
        kind, value = self.named[node.id]
        return self.context.cast(self.builder, value, kind, INDEX)
