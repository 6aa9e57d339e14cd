"""Who is told how far a run has come: nobody, unless whoever started it asks.

Engines tell now and then, never more often than once for a sample or for some thousands of steps. One that
never tells is as good an engine.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: Takes the time in s that a run has reached. What it raises ends the run.
Listener = Callable[[float], None]

_LISTENER: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def told_to(listener: Listener) -> Iterator[None]:
    """Have the runs in this block tell a listener."""
    token = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(token)


def listener() -> Listener | None:
    """Return whom the present run is to tell, if anybody."""
    return _LISTENER.get()


def tell(time_s: float) -> None:
    """Tell the listener, if there is one."""
    listening = listener()
    if listening is not None:
        listening(time_s)
