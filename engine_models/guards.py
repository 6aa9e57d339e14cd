"""Guards: checks of ours that end a run with which its engine would go on, and a way to do without them.

Engines take any start, and answer what they are asked: with joints that came apart, or with numbers that are
not finite. Guards say so in their place. What an engine does by itself is seen in ``unguarded``.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_GUARDED = ContextVar("guarded", default=True)


def guarded() -> bool:
    """Return whether guards are to speak."""
    return _GUARDED.get()


@contextmanager
def unguarded() -> Iterator[None]:
    """Let engines run in this context as they do by themselves."""
    before = _GUARDED.set(False)
    try:
        yield
    finally:
        _GUARDED.reset(before)
