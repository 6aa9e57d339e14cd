"""Kernel calls short enough to interrupt, and what happens when a kernel stops early."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reference_solver.errors import NonFiniteState
from reference_solver.readable import ReadableStepper

FloatArray = NDArray[np.float64]

#: A kernel's (q, v, first, count) -> (steps done, drivers' work): it steps in place until it meets a fault.
Kernel = Callable[[FloatArray, FloatArray, int, int], tuple[int, float]]

#: Takes the time in s that a run has reached.
Tell = Callable[[float], None]

#: Steps times bodies per call of a kernel: a fraction of a second, so that an interrupt is answered.
CHUNK = 1_000_000


def nobody(_: float) -> None:
    """Tell nobody how far a run has come."""


def longest_chunk(q: FloatArray) -> int:
    """Return the steps per call of a kernel for so many coordinates."""
    return max(1, 3 * CHUNK // len(q))


def advance_in_chunks(
    kernel: Kernel,
    readable: ReadableStepper,
    q: FloatArray,
    v: FloatArray,
    h: float,
    first: int,
    count: int,
) -> float:
    """Take steps of size h, number first to first + count - 1 in place; return the drivers' work.

    Where the kernel stops early, the readable face takes the step: it finds the same fault and says what it
    is, or passes it.

    Raises:
        SingularConfiguration: the constraint matrix loses full row rank.
        NonFiniteState: the state overflows.
    """
    work, last, longest = 0.0, first + count, longest_chunk(q)
    while first < last:
        chunk = min(longest, last - first)
        done, added = kernel(q, v, first, chunk)
        first, work = first + done, work + added
        if done < chunk:
            work += readable.advance(q, v, first, 1)
            first += 1
    if not (np.isfinite(q).all() and np.isfinite(v).all()):
        raise NonFiniteState(last * h, h)
    return work
