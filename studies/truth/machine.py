"""Machine code that neither allocates nor counts references, which would cost more than the arithmetic."""

from collections.abc import Callable
from typing import Any, TypeVar

from reference_solver.compiled.store import njit

F = TypeVar("F", bound=Callable[..., Any])

#: Of what is a part of other machine code no calls by Python or C are compiled.
PART = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def bare(function: F) -> F:
    """Compile a function when other machine code first calls it."""
    return njit(error_model="numpy", _nrt=False, **PART)(function)


def within(function: F) -> F:
    """Compile a function as a part of those that call it: its arguments are many."""
    return njit(error_model="numpy", _nrt=False, forceinline=True, **PART)(function)


def allocating(function: F) -> F:
    """Compile a function that allocates."""
    return njit(error_model="numpy")(function)


def interpreted(function: F) -> F:
    """Return a compiled function as Python runs it, without compiling it for a call or two."""
    found: F = getattr(function, "py_func", function)
    return found
