"""Machine code that neither allocates nor counts references, which would cost more than the arithmetic."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

njit: Any = numba.njit
F = TypeVar("F", bound=Callable[..., Any])


def bare(function: F) -> F:
    """Compile a function when it is first called."""
    return cast(F, njit(error_model="numpy", _nrt=False)(function))


def within(function: F) -> F:
    """Compile a function as a part of those that call it: its arguments are many."""
    return cast(F, njit(error_model="numpy", _nrt=False, forceinline=True)(function))


def allocating(function: F) -> F:
    """Compile a function that allocates."""
    return cast(F, njit(error_model="numpy")(function))


def interpreted(function: F) -> F:
    """Return a compiled function as Python runs it, without compiling it for a call or two."""
    found: F = getattr(function, "py_func", function)
    return found
