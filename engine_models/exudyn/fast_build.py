"""Which of Exudyn's two builds a process uses: the plain one, or the fast one without range checks.

A process loads one of them, at the first import of ``exudyn``, and keeps it.
"""

import contextlib
import importlib
import signal
import sys
import threading
from collections.abc import Iterator

from engine_models.engine import ProcessTaken, UnsupportedScene

_FAST = "exudyn.exudynCPPfast"


def require_build(fast: bool) -> None:
    """Check that Exudyn is not there already in the other build; nothing is imported.

    Raises:
        ProcessTaken: the other build is loaded.
    """
    if "exudyn" in sys.modules and (_FAST in sys.modules) != fast:
        loaded = "without" if _FAST in sys.modules else "with"
        raise ProcessTaken(
            f"exudyn is loaded in this process in the build {loaded} range checks: "
            f"run fast = {str(fast).lower()} in a process of its own"
        )


def load_build(fast: bool) -> None:
    """Import Exudyn in the build asked for; every import after this one gets it.

    Raises:
        ProcessTaken: the other build is loaded.
        UnsupportedScene: this machine has no build without range checks.
    """
    require_build(fast)
    if "exudyn" in sys.modules:
        return
    sys.exudynFast = fast  # type: ignore[attr-defined]  # read by Exudyn; it wins over the environment
    # It announces the fast build, and takes an interrupt for a module that is missing.
    with contextlib.redirect_stdout(None), _interrupts_later():
        importlib.import_module("exudyn")
    if (_FAST in sys.modules) != fast:
        raise UnsupportedScene("exudyn has no build without range checks for this processor (it needs AVX2)")


@contextlib.contextmanager
def _interrupts_later() -> Iterator[None]:
    """Hold back an interrupt from the keyboard until the end; other threads than the main one get none."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        signal.raise_signal(signal.SIGINT)
