"""How the execution of cases ends when the engine neither answers nor refuses."""

from abc import abstractmethod
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

from studies.running.failures import Failed

P = ParamSpec("P")
T = TypeVar("T")

CRASHED, TIMED_OUT, OUT_OF_MEMORY = "crashed", "timed out", "out of memory"
#: Not the doing of what ran, and so no result.
KILLED, NOT_BEGUN = "killed from outside", "not begun"
NO_RESULT = (KILLED, NOT_BEGUN)


@dataclass(frozen=True)
class Limits:
    """What a run may take before it is ended; whatever it does then is a row and not the end of the study.

    ``time_limit_s`` is wall time from the call of ``measure`` to its return, so kernels that it compiles
    and truths that it computes count. ``memory_limit_bytes`` is what the run may allocate beyond what its
    process held before; only Linux enforces it.
    """

    time_limit_s: float
    memory_limit_bytes: int


#: What a case may take that has no limits of its own. The longest of the full sets take a minute and 2 GB on
#: two cores with the work of eight: what takes thirty times as long, or four times as much, will never end.
ROOMY = Limits(time_limit_s=1800.0, memory_limit_bytes=8 * 2**30)


class CaseEnded(Exception):
    """The process that ran one case died or was killed: a row of this ``status``, for this ``reason``."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(status, reason)
        self.status, self.reason = status, reason

    def __str__(self) -> str:
        """Return the reason."""
        return self.reason


class RunBroken(Failed):
    """No case can go on; the message says why. What was finished is kept."""


class LimitedExecutor(Executor):
    """An executor that ends calls at their limits; their futures then have the exception CaseEnded."""

    def submit(self, call: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> "Future[T]":
        """Run a call without limits."""
        return self.submit_within(None, call, *args, **kwargs)

    @abstractmethod
    def submit_within(
        self, limits: Limits | None, call: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> "Future[T]":
        """Run a call that is ended, and its process with it, when it exceeds the limits."""
