"""Generated kernels as modules, and their machine code kept on disk between processes.

Not in Numba's own cache, which believes whatever its files say, mixes up what processes write beside each
other, and never heals. Here every compiled function is one file: its name is a hash of all that decides the
code (see ``checked_files``).
"""

import hashlib
import inspect
import linecache
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import cache
from types import ModuleType
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.core.typing.templates import _OverloadFunctionTemplate

from reference_solver.compiled.checked_files import made_once, read_checked, write_checked
from reference_solver.compiled.folder import FolderRefused, KernelsRefused, kernel_folder, temporary_folder

__all__ = ["FolderRefused", "compiled_anew", "kernel_folder", "load_kernel", "njit"]

F = TypeVar("F", bound=Callable[..., Any])

#: What decides machine code beside its source, its types and the processor.
VERSIONS = (numba.__version__, sys.implementation.cache_tag)


def njit(*signature: object, cache: bool = False, **options: Any) -> Callable[[F], F]:
    """Return Numba's decorator of this name; with ``cache`` the machine code is kept in ``kernel_folder()``.

    Calling what it makes, or its signature here, raises FolderRefused where others could have written there.
    """

    def decorate(function: F) -> F:
        compiled: Any = numba.njit(**options)(function)
        if compiled is function:  # NUMBA_DISABLE_JIT is set
            return function
        kept = KeptCode(function, options) if cache else None
        if kept:
            compiled._cache = kept
        if signature:
            with made_once(kept.name_of(signature)) if kept else nullcontext():
                compiled.compile(*signature)
            compiled.disable_compile()
        return cast(F, compiled)

    return decorate


class KeptCode(_Cache):
    """The machine code of a function by Numba's options, as Numba asks for it, a file for each signature."""

    def __init__(self, function: Callable[..., Any], options: Mapping[str, Any]) -> None:
        self._allocates = options.get("_nrt", True)  # whether the code is linked to Numba's own runtime
        modules = [sys.modules[function.__module__]]
        self._name = f"{modules[0].__name__}.{function.__qualname__}"
        modules += getattr(modules[0], "COMPILED_WITH", ())
        if "pipeline_class" in options:
            modules.append(sys.modules[options["pipeline_class"].__module__])
        self._what = (*VERSIONS, *map(inspect.getsource, modules), self._name, sorted(options.items()))

    @property
    def cache_path(self) -> str:
        """Where files are."""
        return str(kernel_folder())

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return the code for a signature, None if there is none that can be trusted."""
        if self._allocates:  # other code needs nothing of what takes a third of a second here
            target_context.refresh()
        code = read_checked(self._file(sig, target_context.codegen()))
        return None if code is None else CompileResult._rebuild(target_context, *pickle.loads(code))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature."""
        if not data.library.has_dynamic_globals:  # addresses of this process
            write_checked(self._file(sig, data.codegen), dumps(data._reduce()))

    def name_of(self, signature: object) -> str:
        """Return a name of the code for a signature, whatever the processor."""
        what = hashlib.sha256(repr((*self._what, signature)).encode())
        return f"{self._name}-{what.hexdigest()[:16]}"

    def _file(self, sig: Any, codegen: Any) -> str:
        what = hashlib.sha256(repr((*self._what, sig, codegen.magic_tuple())).encode())
        return f"{self._name}-{what.hexdigest()[:16]}.nbc"

    def enable(self) -> None:
        """Do nothing: it always is."""

    def disable(self) -> None:
        """Do nothing."""

    def flush(self) -> None:
        """Do nothing: whatever is there is right."""


@cache
def load_kernel(source: str) -> ModuleType:
    """Return the module with this source."""
    name = f"kernel_{hashlib.sha256(source.encode()).hexdigest()[:16]}"
    module = ModuleType(name)
    module.__file__ = f"<{name}>"
    sys.modules[name] = module  # where Numba looks its functions up when it loads their machine code
    linecache.cache[module.__file__] = (len(source), None, source.splitlines(keepends=True), module.__file__)
    exec(compile(source, module.__file__, "exec"), module.__dict__)
    return module


@cache
def compiled(function: Callable[..., Any], signature: object) -> Callable[..., Any]:
    """Return a function compiled for a signature with its module's ``OPTIONS``, its machine code kept.

    It takes arguments of these types and does not look: to find out what they are would take Numba 30 us.
    """
    dispatcher = _dispatcher(function, signature)
    (overload,) = dispatcher.overloads.values()
    return cast(Callable[..., Any], overload.entry_point)


def _dispatcher(function: Callable[..., Any], signature: object) -> Any:
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        variable = "environment variable NUMBA_DISABLE_JIT"
        raise KernelsRefused(
            f"{variable}: expected nothing or 0, since contacts are compiled, got another value"
        )
    return njit(signature, cache=True, **function.__globals__["OPTIONS"])(function)


class Callee(numba.types.WrapperAddressProtocol):
    """A compiled function as an argument of others; to pass it as it is would take Numba 50 us."""

    def __init__(self, function: Any, signature: Any) -> None:
        self._signature, result = signature, function.get_compile_result(signature)
        self._address = result.library.get_pointer_to_function(result.fndesc.llvm_cfunc_wrapper_name)
        self._function = function  # whose machine code lives as long

    def __wrapper_address__(self) -> int:
        """Return where the machine code is."""
        return int(self._address)

    def signature(self) -> Any:
        """Return its signature."""
        return self._signature


@cache
def callback(function: Callable[..., Any], signature: object) -> Callee:
    """Return a function compiled as ``compiled`` does it, with an address at which C can call it."""
    return Callee(_dispatcher(function, signature), signature)


def callee(function: Any, kind: Any) -> Any:
    """Return a kernel's function as an argument of a Numba function type."""
    return Callee(function, kind.signature) if hasattr(function, "get_compile_result") else function


@contextmanager
def compiled_anew() -> Iterator[None]:
    """Have kernels compiled as on a machine that has none, in a folder that is gone afterwards.

    Numba itself has been set to work before that, which takes a second the first time.
    """
    with temporary_folder():
        _forget()
        try:
            load_kernel("from numba import njit\n\nready = njit(lambda x: x + 1.0)\n").ready(1.0)
            yield
        finally:
            _forget()


def _forget() -> None:
    """Have everything compiled again, also what Numba keeps of what compiled functions call."""
    for kept in (load_kernel, compiled, callback):
        kept.cache_clear()
    template: Any
    for template in _OverloadFunctionTemplate.__subclasses__():
        template._impl_cache.clear()
        callback.cache_clear()
