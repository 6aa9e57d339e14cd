"""Machine code of functions on a tape: its operations as text of LLVM, compiled by llvmlite.

A tape has each operation once, in order: LLVM's own form. Every function is

    condition = f(p, contacts, t, y, out)

on arrays of doubles: ``p`` are numbers made once of a mechanism's data, the rows of its tables before them;
``contacts`` are records; y is the state. Object code is kept on disk, named by a hash of the text, the
processor and the version of LLVM.
"""

import ctypes
import hashlib
import math
import platform
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from functools import cache, partial, wraps
from importlib.metadata import version
from itertools import count
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

from reference_solver.kept_files import FolderRefused, alone, private_folder, read_kept, write_kept
from reference_solver.tape import FloatArray, Node, Scalar, Scope, Tape, Value

F = TypeVar("F", bound=Callable[..., Any])

#: How Numba compiles what calls such functions.
OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}}
ARGUMENTS = "ptr noalias readonly %p, ptr noalias readonly %contacts, double %t, ptr noalias readonly %y"
BINARY = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv"}
#: Functions of one number and of two, by their names on tapes.
OF_ONE = {"cos": "cos", "sin": "sin", "tanh": "tanh", "sqrt": "llvm.sqrt.f64", "abs": "llvm.fabs.f64"}
OF_TWO = {"pow": "pow", "copysign": "llvm.copysign.f64"}
#: What compiles each of the functions of a module that are compiled together, and what Numba is to be told.
_TOGETHER, _UNTOLD = defaultdict[str, list[Callable[[], Any]]](list), list[Callable[[], Any]]()
#: What Numba's text calls to tell Python of an exception, and what ends the process in its place.
TELLS = re.compile(r"^declare (.*@(?:numba_|NRT_|Py)\w+\(.*\))(?: \w+)*(?: #\d+)?$", re.MULTILINE)
TRAP = "declare void @llvm.trap()\n"
#: Texts from so many characters on, as of chains of 35 bodies, are compiled without optimisation: those of 41
#: in 4 s in place of 24, for steps that take twice as long.
LONG = 8_000_000
#: What texts begin with: the functions that they may call. Where sine and cosine of one angle are known to
#: touch no memory, LLVM calls one function for both.
HEAD = "".join(f"declare double @{name}(double) memory(none)\n" for name in OF_ONE.values())
HEAD += "".join(f"declare double @{name}(double, double)\n" for name in OF_TWO.values())
HEAD += "declare double @piece(ptr, double, double, double, double, ptr)\n"


def number(x: float) -> str:
    """Return a number in LLVM's text by its bits, so that nothing is rounded."""
    return f"0x{int(np.float64(x).view(np.uint64)):016X}"


class FunctionText:
    """The text of a function that stores results of a tape in ``out`` and returns the last of them.

    ``parameters`` gets the places in p of known nodes. Without it these are computed, with no sum and product
    rounded as one, and y has the raw numbers.
    """

    def __init__(
        self, name: str, tape: Tape, results: list[Scalar], parameters: dict[Node, int] | None
    ) -> None:
        self._lines, self._reserved, self._block = list[str](), list[str](), "entry"
        self._parameters, self._new = parameters, count()
        #: The texts of nodes, and the memory of what calls return.
        self._texts, self._memory = dict[Node, str](), dict[Node, str]()
        self._needed = needed(tape, results)
        self._write(tape.scopes[0])
        *stored, condition = results
        for place, value in enumerate(stored):
            text = self._text(value)
            self._lines.append(f"store double {text}, ptr {self._at('%out', place)}")
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

    def _at(self, array: str, place: int) -> str:
        return self._line(f"getelementptr double, ptr {array}, i64 {place}") if place else array

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
        known = self._parameters
        if node.known and known is not None:
            return self._load("%p", known.setdefault(node, len(known)))
        if kind == "input":
            array, place = operands
            return "%t" if array == "t" else self._load("%y" if node.known else f"%{array}", place)
        if kind == "result":  # of a call: branches have theirs behind them
            call, k = operands
            return self._load(self._memory[call], k)
        texts = [self._text(operand) for operand in operands]
        if kind in BINARY:
            flag = "" if known is None else "contract "
            return self._line(f"{BINARY[kind]} {flag}double {texts[0]}, {texts[1]}")
        if kind == ">":
            return self._line(f"fcmp ogt double {texts[0]}, {texts[1]}")
        if kind == "&":
            return self._line(f"and i1 {texts[0]}, {texts[1]}")
        if kind == "if":
            return self._line(f"select i1 {texts[0]}, double {texts[1]}, double {texts[2]}")
        if kind in ("max", "min"):
            test = self._line(f"fcmp {'ogt' if kind == 'max' else 'olt'} double {texts[1]}, {texts[0]}")
            return self._line(f"select i1 {test}, double {texts[1]}, double {texts[0]}")
        name = (OF_ONE | OF_TWO)[kind]
        return self._line(f"call double @{name}({', '.join(f'double {text}' for text in texts)})")

    def _write(self, scope: Scope) -> None:
        """Write what is needed of a scope in the order in which it arose."""
        for node in scope.values():
            if node not in self._needed or node.known or node.operation in ("input", "result"):
                continue
            if node.operation == "branch":
                self._branch(node)
            elif node.operation == "call":
                self._call(node)
            elif node not in self._texts:
                self._texts[node] = self._of(node)

    def _call(self, node: Node) -> None:
        """Write a call with numbers of a function that stores its results."""
        name, results, *operands = node.operands
        self._memory[node] = out = f"%x{next(self._new)}"
        self._reserved.append(f"{out} = alloca double, i64 {results}")  # on the stack
        arguments = "".join(f"double {self._text(operand)}, " for operand in operands)
        self._line(f"call double @{name}(ptr %p, {arguments}ptr {out})")

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


def parameters_text(parameters: Iterable[Node]) -> str:
    """Return the text of a function of this name that stores what known nodes are, by raw numbers as y."""
    tape = Tape()
    results = [Value(tape, node) for node in parameters]
    return FunctionText("parameters", tape, [*results, 1.0], None).text


def needed(tape: Tape, results: Iterable[Scalar]) -> dict[Node, None]:
    """Return the nodes of a tape that results need, those that are known without what they need in turn."""
    found = {result.node: None for result in results if isinstance(result, Value)}
    for node in reversed(tape.nodes):
        if node not in found or node.known:
            continue
        operands = node.operands
        if node.operation == "branch":
            operands = operands[:1]
        elif node.operation == "result" and operands[0].operation == "branch":  # of its outputs this alone
            operands = operands[0], operands[0].operands[1][operands[1]]
        for operand in operands:
            inner = operand.node if isinstance(operand, Value) else operand
            if isinstance(inner, Node):
                found[inner] = None
    return found


@cache
def prepare() -> None:
    """Set LLVM up for this processor, with the system's library."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL("ucrtbase" if platform.system() == "Windows" else None)
    for name in {*OF_ONE, *OF_TWO} & {*OF_ONE.values(), *OF_TWO.values()}:
        llvm.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)


class Function:
    """A function of machine code at an address, which Python can call; ``engine`` has it in memory."""

    def __init__(self, address: int, engine: Any) -> None:
        self.address, self._engine = address, engine
        pointer = ctypes.c_void_p
        kinds = pointer, pointer, ctypes.c_double, pointer, pointer
        self._call = ctypes.CFUNCTYPE(ctypes.c_double, *kinds)(address)

    def __call__(self, p: int, contacts: int, t: float, y: FloatArray, out: NDArray[Any]) -> float:
        """Return the condition; ``p`` and ``contacts`` are addresses, y and out contiguous arrays."""
        return float(self._call(p, contacts, t, y.ctypes.data, out.ctypes.data))


def compile_text(
    text: str, names: Iterable[str], made: Callable[[], str] | None = None
) -> dict[str, Function]:
    """Return functions of a text by their names; their object code is compiled now, or was before.

    A text that takes long is ``made`` only if it was not; what stands for it tells it from others.

    Raises:
        FolderRefused: others could have written what was before.
    """
    prepare()
    names = list(names)
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    opt = 3 if len(text) < LONG else 0
    machine = llvm.Target.from_default_triple().create_target_machine(cpu, features, opt=opt, jit=True)
    what = repr((text, llvm.llvm_version_info, machine.triple, cpu))
    name = f"kernel-{hashlib.sha256(what.encode()).hexdigest()[:32]}.o"
    code = read_kept(name)
    if code is None:
        module = llvm.parse_assembly(made() if made else text)
        if made:
            join(module, names, machine)
        code = machine.emit_object(module)
        write_kept(name, code)
    if "call double @piece(" in text:
        llvm.add_symbol("piece", piece().address)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return {name: Function(engine.get_function_address(name), engine) for name in names}


def join(module: Any, names: list[str], machine: Any) -> None:
    """Make what Numba's functions call a part of those with names: a quarter of an RK4 step's time."""
    for function in module.functions:
        if function.name not in names and not function.is_declaration:
            function.linkage = "internal"
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    passes.getModulePassManager().run(module, passes)


def inner(function: F) -> F:
    """Have Numba compile a function into those that call it."""

    def register() -> None:
        from numba.extending import register_jitable

        register_jitable(**OPTIONS)(function)

    _UNTOLD.append(register)
    return function


def call(function: Any, p: Any, contacts: Any, t: Any, y: Any, out: Any) -> Any:
    """Return what a function at an address returns, called by functions that Numba compiles."""


def _register_call() -> None:
    from numba import float64, int64
    from numba.extending import intrinsic, overload

    @intrinsic
    def called(_: Any, function: Any, p: Any, contacts: Any, t: Any, y: Any, out: Any) -> Any:  # noqa: ARG001
        def emit(_: Any, builder: Any, __: Any, values: Any) -> Any:
            address, *given = values
            kind = ir.FunctionType(ir.DoubleType(), [value.type for value in given])
            return builder.call(builder.inttoptr(address, kind.as_pointer()), given)

        return float64(int64, int64, int64, float64, int64, int64), emit

    @overload(call, jit_options=cast(Any, OPTIONS))
    def _(function, p, contacts, t, y, out):  # type: ignore[no-untyped-def]  # noqa: ARG001
        return lambda function, p, contacts, t, y, out: called(function, p, contacts, t, y, out)  # type: ignore[call-arg]


_UNTOLD.append(_register_call)


def entry(name: str, made: Callable[[], tuple[Any, Callable[..., Any]]]) -> Function:
    """Return a function that Numba compiles now, or did before.

    ``made`` returns its signature and itself. It allocates nothing and raises nothing: where Numba has it do
    so the process ends.
    """

    def text() -> str:
        import numba

        while _UNTOLD:
            _UNTOLD.pop()()
        kind, function = made()
        compiled = numba.cfunc(kind, error_model="numpy")(function)
        text = compiled.inspect_llvm().replace(compiled.native_name, name)
        return TELLS.sub(r"define \1 {\n  call void @llvm.trap()\n  unreachable\n}", text) + TRAP

    with alone(name):
        what = f"{name} {version('numba')} {digest_of(Path(__file__).parent)}"
        return compile_text(what, [name], text)[name]


def compiled(kinds: str = "", **options: Any) -> Callable[[F], F]:
    """Return what has Numba compile a function, its machine code kept if it can be.

    With its arguments' kinds that is done when Python first calls one of its module, for all of these, by one
    process at a time: what they call in common is compiled once. Numba's own cache knows nothing of other
    modules' functions in it: so its folder is named by the sources of the function's package and this one.
    """

    def made(function: F) -> F:
        from unittest.mock import patch

        import numba

        package = Path(str(sys.modules[function.__module__.partition(".")[0]].__file__)).parent
        jit = partial(cast(Any, numba.njit), *([kinds] if kinds else []), **options)
        try:
            folder = private_folder() / f"numba-{digest_of(package)}"
        except (FolderRefused, OSError):
            return cast(F, jit()(function))
        with patch.object(numba.config, "CACHE_DIR", str(folder)):
            return cast(F, jit(cache=True)(function))

    def later(function: F) -> F:
        module, compile_once = function.__module__, cache(partial(made, function))
        _TOGETHER[module].append(compile_once)

        @cache
        def first_made() -> Any:
            with alone(module):
                for compile_each in _TOGETHER[module]:
                    compile_each()
            return compile_once()

        @wraps(function)
        def called(*arguments: Any) -> Any:
            return first_made()(*arguments)

        called.compiled = first_made  # type: ignore[attr-defined]  # for who calls often
        return cast(F, called)

    return later if kinds else made


@cache
def digest_of(folder: Path) -> str:
    """Return a hash of the sources of a package and this one."""
    sources = sorted({*folder.rglob("*.py"), *Path(__file__).parent.rglob("*.py")})
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]


@cache
def piece() -> Function:
    """Return the function that looks a table up, for the tapes' calls of this name."""

    def look_up(p, place, pieces, period, x, out):  # type: ignore[no-untyped-def]
        """Store in ``out`` x from the begin of its piece on, and the row that the piece has at p + place."""
        first, low, high = int(place), 0, int(pieces)
        if period > 0.0:
            x -= period * math.floor((x - p[first]) / period)
        while high - low > 1:
            middle = (low + high) // 2
            if x < p[first + 5 * middle]:
                high = middle
            else:
                low = middle
        row = first + 5 * low
        out[0] = x - p[row]
        for k in range(1, 5):
            out[k] = p[row + k]
        return 0.0

    def made() -> tuple[Any, Callable[..., Any]]:
        from numba import float64, types

        array = types.CPointer(float64)
        return float64(array, *[float64] * 4, array), look_up

    return entry("piece", made)
