"""Machine code of functions on a tape: its operations as text of LLVM, compiled by llvmlite.

A tape has each operation once, in order: LLVM's own form. Every function is

    condition = f(p, contacts, t, y, out)

on arrays of doubles: ``p`` are numbers made once of a mechanism's data, the rows of its tables before them;
``contacts`` are records; y is the state. Object code is kept on disk, named by a hash of the text, the
processor and the version of LLVM.
"""

import ctypes
import ctypes.util
import hashlib
import platform
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite.binding as llvm
import numba
import numpy as np
from llvmlite import ir
from numba import float64, int64
from numba.extending import intrinsic
from numpy.typing import NDArray

from reference_solver.kept_files import FolderRefused, alone, private_folder, read_kept, write_kept
from reference_solver.tape import FloatArray, Node, Scalar, Scope, Tape, Value, needs_of

F = TypeVar("F", bound=Callable[..., Any])

#: How Numba compiles what calls such functions.
OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}, "_nrt": False}
ARGUMENTS = "ptr noalias readonly %p, ptr noalias readonly %contacts, double %t, ptr noalias readonly %y"
BINARY = {"+": "fadd contract", "-": "fsub contract", "*": "fmul contract", "/": "fdiv contract"}
COMPARED = {">": "ogt", "==": "oeq"}
#: Functions of one number and of two, by their names on tapes.
OF_ONE = {"cos": "cos", "sin": "sin", "tanh": "tanh", "sqrt": "llvm.sqrt.f64", "abs": "llvm.fabs.f64"}
OF_TWO = {"pow": "pow", "copysign": "llvm.copysign.f64"}
#: Those of the system's library.
LIBRARY = ("cos", "sin", "tanh", "pow")
#: ``tables.piece``: the row of a table that x is in by halving; out gets x from its begin on, and the row.
PIECE = """
declare double @llvm.floor.f64(double)

define internal double @piece(ptr %p, double %place, double %pieces, double %period, double %of, ptr %out) {
entry:
  %first = fptosi double %place to i64
  %last = fptosi double %pieces to i64
  %table = getelementptr double, ptr %p, i64 %first
  %begin = load double, ptr %table
  %repeats = fcmp ogt double %period, 0.0
  %since = fsub double %of, %begin
  %periods = fdiv double %since, %period
  %whole = call double @llvm.floor.f64(double %periods)
  %gone = fmul double %period, %whole
  %reduced = fsub double %of, %gone
  %x = select i1 %repeats, double %reduced, double %of
  br label %search
search:
  %low = phi i64 [ 0, %entry ], [ %new_low, %halve ]
  %high = phi i64 [ %last, %entry ], [ %new_high, %halve ]
  %apart = sub i64 %high, %low
  %more = icmp sgt i64 %apart, 1
  br i1 %more, label %halve, label %found
halve:
  %sum = add i64 %low, %high
  %middle = sdiv i64 %sum, 2
  %middle_place = mul i64 %middle, 5
  %middle_at = getelementptr double, ptr %table, i64 %middle_place
  %middle_begin = load double, ptr %middle_at
  %below = fcmp olt double %x, %middle_begin
  %new_low = select i1 %below, i64 %low, i64 %middle
  %new_high = select i1 %below, i64 %middle, i64 %high
  br label %search
found:
  %row_place = mul i64 %low, 5
  %row = getelementptr double, ptr %table, i64 %row_place
  %row_begin = load double, ptr %row
  %s = fsub double %x, %row_begin
  store double %s, ptr %out
  %coefficients = getelementptr double, ptr %row, i64 1
  %rest = getelementptr double, ptr %out, i64 1
  call void @llvm.memcpy.p0.p0.i64(ptr %rest, ptr %coefficients, i64 32, i1 false)
  ret double 0.0
}
declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)
"""
HEAD = "".join(f"declare double @{name}(double)\n" for name in OF_ONE.values())
HEAD += "".join(f"declare double @{name}(double, double)\n" for name in OF_TWO.values()) + PIECE
#: Operations on known numbers.
OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "pow": np.power,
    "cos": np.cos,
    "sin": np.sin,
    "tanh": np.tanh,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "copysign": np.copysign,
    "max": max,
    "min": min,
}


def number(x: float) -> str:
    """Return a number in LLVM's text by its bits, so that nothing is rounded."""
    return f"0x{int(np.float64(x).view(np.uint64)):016X}"


class FunctionText:
    """The text of a function that stores results of a tape in ``out`` and returns the last of them.

    ``places`` are array and place of every input but t; ``parameters`` gets the places in p of known nodes.
    """

    def __init__(
        self,
        name: str,
        tape: Tape,
        results: list[Scalar],
        places: Callable[[str], tuple[str, int]],
        parameters: dict[Node, int],
    ) -> None:
        self._lines, self._reserved, self._block = list[str](), list[str](), "entry"
        self._places, self._parameters, self._new = places, parameters, count()
        #: The texts of nodes, and the memory of what calls return.
        self._texts, self._memory = dict[Node, str](), dict[Node, str]()
        self._needed = needed(tape, results)
        self._write(tape.scopes[0])
        *stored, condition = results
        for place, value in enumerate(stored):
            self._store(value, "%out", place)
        self._lines.append(f"ret double {self._text(condition)}")
        lines = "\n  ".join([*self._reserved, *self._lines])
        self.text = f"define double @{name}({ARGUMENTS}, ptr noalias %out) {{\nentry:\n  {lines}\n}}\n"

    def _line(self, text: str) -> str:
        """Write what a new name stands for; return the name."""
        name = f"%x{next(self._new)}"
        self._lines.append(f"{name} = {text}")
        return name

    def _load(self, array: str, place: int) -> str:
        return self._line(f"load double, ptr {self._at(array, place)}")

    def _store(self, value: Scalar, array: str, place: int) -> None:
        text = self._text(value)
        self._lines.append(f"store double {text}, ptr {self._at(array, place)}")

    def _at(self, array: str, place: int) -> str:
        return self._line(f"getelementptr double, ptr {array}, i64 {place}") if place else array

    def _reserve(self, size: int) -> str:
        """Return the name of memory for so many numbers on the stack."""
        name = f"%x{next(self._new)}"
        self._reserved.append(f"{name} = alloca double, i64 {size}")
        return name

    def _text(self, operand: Scalar) -> str:
        """Return the text of a value, a number or a condition."""
        if isinstance(operand, bool):
            return "true" if operand else "false"
        if not isinstance(operand, Value):
            return number(operand)
        node = operand.node
        if node not in self._texts:
            self._texts[node] = self._of(node)
        return self._line(f"fneg double {self._texts[node]}") if operand.minus else self._texts[node]

    def _of(self, node: Node) -> str:
        """Write a node; return its text."""
        kind, operands = node.operation, node.operands
        if node.known:
            return self._load("%p", self._parameters.setdefault(node, len(self._parameters)))
        if kind == "input":
            name = operands[0]
            if name == "t":
                return "%t"
            array, place = self._places(name)
            return self._load(f"%{array}", place)
        if kind == "result":  # of a call: branches have theirs behind them
            call, k = operands
            return self._load(self._memory[call], k)
        texts = [self._text(operand) for operand in operands]
        if kind in BINARY:
            return self._line(f"{BINARY[kind]} double {texts[0]}, {texts[1]}")
        if kind in COMPARED:
            return self._line(f"fcmp {COMPARED[kind]} double {texts[0]}, {texts[1]}")
        if kind == "&":
            return self._line(f"and i1 {texts[0]}, {texts[1]}")
        if kind == "if":
            return self._line(f"select i1 {texts[1]}, double {texts[0]}, double {texts[2]}")
        if kind in ("max", "min"):
            test = self._line(f"fcmp {'ogt' if kind == 'max' else 'olt'} double {texts[1]}, {texts[0]}")
            return self._line(f"select i1 {test}, double {texts[1]}, double {texts[0]}")
        name = (OF_ONE | OF_TWO)[kind]
        return self._line(f"call double @{name}({', '.join(f'double {text}' for text in texts)})")

    def _write(self, scope: Scope) -> None:
        """Write what is needed of a scope in the order in which it arose."""
        for node in scope.nodes:
            if node not in self._needed or node.known or node.operation in ("input", "result"):
                continue
            if node.operation == "branch":
                self._branch(node)
            elif node.operation == "call":
                self._call(node)
            elif node not in self._texts:
                self._texts[node] = self._of(node)

    def _call(self, node: Node) -> None:
        """Write a call: of ``piece`` with numbers, of another function with t and y in memory."""
        name, results, *operands = node.operands
        if name == "piece":
            arguments = [f"double {self._text(operand)}" for operand in operands]
        else:
            memory = self._reserve(len(operands) - 1)
            for place, operand in enumerate(operands[1:]):
                self._store(operand, memory, place)
            arguments = ["ptr %contacts", f"double {self._text(operands[0])}", f"ptr {memory}"]
        self._memory[node] = out = self._reserve(results)
        condition = self._line(f"call double @{name}(ptr %p, {', '.join(arguments)}, ptr {out})")
        if name != "piece":  # its last result is what it returns
            self._lines.append(f"store double {condition}, ptr {self._at(out, results - 1)}")

    def _branch(self, node: Node) -> None:
        """Write a branch; its results are 0 behind it where it was not taken."""
        condition, outputs, inside = node.operands
        test, before, place = self._text(condition), self._block, next(self._new)
        self._lines += [f"br i1 {test}, label %taken{place}, label %after{place}", f"taken{place}:"]
        self._block, outside = f"taken{place}", dict(self._texts)
        self._write(inside)
        used = [n for n in self._needed if n.operation == "result" and n.operands[0] is node]
        texts = {n: self._text(outputs[n.operands[1]]) for n in used}
        self._lines += [f"br label %after{place}", f"after{place}:"]
        end, self._block, self._texts = self._block, f"after{place}", outside
        for n, text in texts.items():
            self._texts[n] = self._line(f"phi double [ {text}, %{end} ], [ {number(0.0)}, %{before} ]")


def needed(tape: Tape, results: Iterable[Scalar]) -> dict[Node, None]:
    """Return the nodes of a tape that results need, those that are known without what they need in turn."""
    found = {result.node: None for result in results if isinstance(result, Value)}
    for node in reversed(tape.nodes):
        if node in found and not node.known:
            for operand in needs_of(node):
                inner = operand.node if isinstance(operand, Value) else operand
                if isinstance(inner, Node):
                    found[inner] = None
    return found


def known_numbers(nodes: Iterable[Node], raw: Mapping[str, float]) -> list[float]:
    """Return the numbers that known nodes are, by those of their inputs."""
    numbers = dict[Node, Any]()

    def at(node: Node) -> Any:
        if node not in numbers:
            if node.operation == "input":
                numbers[node] = np.float64(raw[node.operands[0]])
            else:
                numbers[node] = OPERATIONS[node.operation](*map(of, node.operands))
        return numbers[node]

    def of(operand: Scalar) -> Any:
        if not isinstance(operand, Value):
            return np.float64(operand)
        return -at(operand.node) if operand.minus else at(operand.node)

    return [float(at(node)) for node in nodes]


@cache
def prepare() -> None:
    """Set LLVM up for this processor, with the system's library."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL("ucrtbase" if platform.system() == "Windows" else ctypes.util.find_library("m"))
    for name in LIBRARY:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)


def target_machine() -> Any:
    """Return LLVM's compiler for this processor: an engine takes it over."""
    prepare()
    features = llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=3, jit=True)


class Function:
    """A function of machine code at an address, which Python can call."""

    def __init__(self, address: int, engine: Any) -> None:
        self.address, self._engine = address, engine  # whose memory the code is in
        pointer = ctypes.c_void_p
        kinds = pointer, pointer, ctypes.c_double, pointer, pointer
        self._call = ctypes.CFUNCTYPE(ctypes.c_double, *kinds)(address)

    def __call__(self, p: int, contacts: int, t: float, y: FloatArray, out: NDArray[Any]) -> float:
        """Return the condition; ``p`` and ``contacts`` are addresses, y and out contiguous arrays."""
        return float(self._call(p, contacts, t, y.ctypes.data, out.ctypes.data))


@intrinsic
def call(_: Any, function: Any, p: Any, contacts: Any, t: Any, y: Any, out: Any) -> Any:  # noqa: ARG001
    """Return what a function at an address returns, called by functions that Numba compiles."""

    def emit(_: Any, builder: Any, __: Any, values: Any) -> Any:
        address, *given = values
        kind = ir.FunctionType(ir.DoubleType(), [value.type for value in given])
        return builder.call(builder.inttoptr(address, kind.as_pointer()), given)

    return float64(int64, int64, int64, float64, int64, int64), emit


def compile_text(text: str, names: Iterable[str]) -> dict[str, Function]:
    """Return functions of a text by their names; their object code is compiled now, or was before.

    Raises:
        FolderRefused: others could have written what was before.
    """
    machine = target_machine()
    what = repr((text, llvm.llvm_version_info, machine.triple, llvm.get_host_cpu_name()))
    name = f"kernel-{hashlib.sha256(what.encode()).hexdigest()[:32]}.o"
    code = read_kept(name)
    if code is None:
        code = machine.emit_object(llvm.parse_assembly(text))
        write_kept(name, code)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return {name: Function(engine.get_function_address(name), engine) for name in names}


# --------------------------------------------------------------------- functions that Numba compiles


def compiled(kinds: str | None = None, **options: Any) -> Callable[[F], F]:
    """Return what has Numba compile a function, its machine code kept: now if its arguments' kinds are given,
    otherwise when it is first called."""

    def decorate(function: F) -> F:
        with code_folder(function) as kept, alone():
            return cast(F, numba.njit(kinds, **options, cache=kept)(function))

    return decorate


@contextmanager
def code_folder(function: Callable[..., Any]) -> Iterator[bool]:
    """Have Numba keep machine code of a function that it is told of in this block; yield whether it can.

    Its own cache knows nothing of other modules' functions in it: so its folder is named by the sources of
    the function's package and this one.
    """
    package = sys.modules[function.__module__.partition(".")[0]]
    usual = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    try:
        folder = private_folder() / f"numba-{digest_of(Path(str(package.__file__)).parent)}"
    except (FolderRefused, OSError):
        yield False
        return
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    try:
        yield True
    finally:
        numba.config.CACHE_DIR = usual  # type: ignore[attr-defined]


@cache
def digest_of(folder: Path) -> str:
    """Return a hash of the sources of a package and this one."""
    sources = sorted({*folder.rglob("*.py"), *Path(__file__).parent.rglob("*.py")})
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
