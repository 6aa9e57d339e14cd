"""The inside of a worker process: it answers calls, keeps quiet, limits memory and ends with its parent.

Nothing of the project is imported here: a process listens first, and answers what a call cannot import.
"""

import os
import pickle
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import parent_process
from multiprocessing.connection import Connection, wait
from pathlib import Path
from threading import Thread

#: Said before every answer: the call has arrived, whatever it needs is imported, and it begins.
BEGUN = b"begun"
#: Whether a process can be refused memory; elsewhere only the time limit holds.
LIMITS_MEMORY = sys.platform == "linux"


def serve(calls: Connection, words: Connection) -> None:
    """Answer calls with ``(value, None)`` or ``(None, error)`` until the parent closes the connection.

    What the calls print is dropped, but for stderr: it goes to ``words``, so that the parent can say what
    a process said when it died.
    """
    _end_with_parent()
    _keep_quiet(words)
    while True:
        try:
            message = calls.recv_bytes()
        except EOFError:
            return
        try:
            call, memory_limit_bytes = pickle.loads(message)
            calls.send_bytes(BEGUN)
            with _memory_limited(memory_limit_bytes):
                value = call()
            answer = pickle.dumps((value, None))
        except Exception as error:
            answer = pickle.dumps((None, error))
        calls.send_bytes(answer)


@contextmanager
def _memory_limited(limit_bytes: int | None) -> Iterator[None]:
    """Refuse allocations in this block that exceed what the process holds now by more than the limit."""
    if limit_bytes is None or not LIMITS_MEMORY:
        yield
        return
    import resource

    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    set_before = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
    # Not the address space: libraries and kernels reserve of it what they never use.
    least = min([pages * resource.getpagesize() + limit_bytes, *set_before])
    resource.setrlimit(resource.RLIMIT_DATA, (least, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def _keep_quiet(words: Connection) -> None:
    # File descriptors, not sys.stdout: native code prints too.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(words.fileno() if os.name == "posix" else nowhere, 2)


def _end_with_parent() -> None:
    """End this process as soon as its parent is no more, even if that was killed."""
    parent = parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        # The kernel ends us when the parent's end of this pipe closes; a thread could not do so while
        # native code holds the interpreter's lock, for ever if it hangs.
        import fcntl

        signal.signal(signal.SIGIO, signal.SIG_DFL)
        fcntl.fcntl(parent.sentinel, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(parent.sentinel, fcntl.F_SETFL, os.O_ASYNC)
        if wait([parent.sentinel], timeout=0):
            os._exit(1)
    else:
        Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()
