"""Calls in processes of this machine; the death of a process, or its time limit, is the affair of one call.

Not ``concurrent.futures.ProcessPoolExecutor``, which breaks for every call when one process dies. Here every
process has a pipe of its own.
"""

import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from multiprocessing import current_process, get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from queue import LifoQueue
from tempfile import NamedTemporaryFile
from threading import Lock, Thread
from typing import Any, TypeVar

from engine_models.engine import SimulationFailed, UnsupportedScene
from studies.failures import BadInput, Failed, bug

T = TypeVar("T")
#: How a call ended whose process did: by its own doing, at its limit, or by somebody else's.
CRASHED, TIMED_OUT, KILLED = "crashed", "timed out", "killed from outside"
#: Signals that no solver sends to itself: the kernel short of memory does, and people do.
FROM_OUTSIDE = ("SIGTERM", "SIGINT", "SIGKILL", "SIGHUP", "SIGQUIT")
#: A process that has not imported what a call needs within this time never will; one that has closed its pipe
#: is dead within that time, in s.
BEGINNING_S, DYING_S = 600.0, 5.0
#: The exit code of a process that imports a script which calls for processes itself.
NO_MAIN_GUARD = 113
#: What keeps the current folder out of the path of a Python that starts, from 3.11 on.
SAFE_PATH = "PYTHONSAFEPATH"
#: Of the last line that a process said, so many characters are told.
SHOWN_WORDS = 200
#: Held while a child begins or ends: two threads at once would take each other's exit codes.
_CHILDREN = Lock()


class Ended(Exception):
    """A call's process died, or was killed at its limit; ``status`` is what its row says."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(status, reason)
        self.status = status

    def __str__(self) -> str:
        return str(self.args[1])


class Worker:
    """One process after another, each started when a call first needs it; one call at a time."""

    def __init__(self) -> None:
        self._process: Any = None
        self._closed = False

    def run(self, call: Callable[..., T], *args: object, limit_s: float) -> T:
        """Return what a call returns in the process, or raise what it raises.

        A call whose process has run others is run again in a new one, so that none answers for the damage
        that another did.

        Raises:
            Ended: the process died of the call, exceeded the limit, or was killed.
            Failed: no process can begin.
        """
        used = self._process is not None
        try:
            return self._run(call, args, limit_s)
        except Ended as end:
            if not used or end.status in (TIMED_OUT, KILLED):
                raise
        return self._run(call, args, limit_s)

    def kill(self) -> None:
        """End the process, whatever it does, and start no other."""
        with _CHILDREN:
            self._closed = True
            if self._process is not None:
                self._process.kill()

    def _run(self, call: Callable[..., T], args: tuple[object, ...], limit_s: float) -> T:
        if self._process is None:
            self._begin()
        begun, answer = False, b""
        try:
            self._pipe.send_bytes(pickle.dumps((call, args)))
            while not answer:  # of no bytes it says that the call begins
                limit = limit_s if begun else BEGINNING_S
                if not self._pipe.poll(limit):
                    self.end()
                    raise Ended(TIMED_OUT, f"not finished within the limit of {limit:g} s")
                answer, begun = self._pipe.recv_bytes(), True
        except (EOFError, OSError):
            raise self._death(begun) from None
        value: T
        value, error = pickle.loads(answer)
        if error is not None:
            raise error
        return value

    def _begin(self) -> None:
        context = get_context("spawn")
        with _starting():
            if self._closed:
                raise Ended(KILLED, "the run has ended")
            self._pipe, theirs = context.Pipe()
            self._words = NamedTemporaryFile(prefix="crankslider-")  # noqa: SIM115  as long as the process
            process = context.Process(target=_serve, args=(theirs, self._words.name), daemon=True)
            process.start()
            self._process = process
        theirs.close()

    def end(self) -> int | None:
        """End the process, if there is one, and return its exit code."""
        process, self._process = self._process, None
        if process is None:
            return None
        with _CHILDREN:
            process.kill()
            process.join()
        self._pipe.close()
        self._words.close()
        return int(process.exitcode)

    def _death(self, begun: bool) -> Exception:
        """Return how a process ended that has closed its pipe."""
        self._process.join(DYING_S)
        said = Path(self._words.name).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        code = self.end() or 0
        if code == NO_MAIN_GUARD:
            guard = 'if __name__ == "__main__":'
            return Failed(f"script: expected this call under {guard}, since every process imports the script")
        name = signal.Signals(-code).name if code < 0 else ""
        reason = f"killed by {name}" if name else f"ended with exit code {code}"
        if said:
            reason += f": {said[-1][:SHOWN_WORDS]}"
        if name in FROM_OUTSIDE:
            return Ended(KILLED, reason)
        return Ended(CRASHED, reason) if begun else Failed(f"no process can begin: {reason}")


class Pool:
    """Up to ``jobs`` workers; a call goes to whichever is free. Leaving the block ends them all."""

    def __init__(self, jobs: int) -> None:
        if current_process().name != "MainProcess" and parent_process() is None:  # one that is only beginning
            sys.exit(NO_MAIN_GUARD)
        with _starting():
            resource_tracker.ensure_running()  # later it would lift a thread's block of SIGINT as it starts
        self._threads, self._free = ThreadPoolExecutor(jobs), LifoQueue[Worker]()
        self._workers = [Worker() for _ in range(jobs)]
        for worker in self._workers:
            self._free.put(worker)

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.kill()
        self._threads.shutdown()
        for worker in self._workers:
            worker.end()

    def run(self, call: Callable[..., T], *args: object, limit_s: float) -> T:
        """Return what one call returns (see ``Worker.run``)."""
        worker = self._free.get()
        try:
            return worker.run(call, *args, limit_s=limit_s)
        finally:
            self._free.put(worker)

    def results(self, call: Callable[[Any], T], items: Iterable[Any]) -> Iterator[tuple[Any, T | Ended]]:
        """Yield every item, which has a ``limit_s``, and what its call gave, as it ends.

        Raises:
            Exception: what a call raised other than ``Ended``.
        """
        submit = self._threads.submit
        futures = {submit(self.run, call, item, limit_s=item.limit_s): item for item in items}
        try:
            for future in as_completed([*futures]):
                error = future.exception()
                if error is not None and not isinstance(error, Ended):
                    raise error
                yield futures.pop(future), error or future.result()
        finally:
            for future in futures:
                future.cancel()


@contextmanager
def _starting() -> Iterator[None]:
    """Start a process in the block that Ctrl-C does not reach, and without the current folder in its path.

    A file of the user's there, ``array.py``, would take the place of Python's own module. What this process
    has in its path it has too, once it has begun.
    """
    with ExitStack() as stack:
        stack.enter_context(_CHILDREN)
        if SAFE_PATH not in os.environ:
            os.environ[SAFE_PATH] = "1"
            stack.callback(os.environ.pop, SAFE_PATH)
        if os.name == "posix":
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            stack.callback(signal.pthread_sigmask, signal.SIG_SETMASK, mask)
        yield


def _serve(calls: Connection, words: str) -> None:
    """Answer calls with ``(value, None)`` or ``(None, error)`` until the parent closes the connection.

    What they print is dropped; of what they say on stderr the last line is told where the process dies.
    """
    _end_with_parent()
    # File descriptors, not sys.stdout: native code prints too.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(words, os.O_WRONLY | os.O_APPEND), 2)
    while True:
        try:
            message = calls.recv_bytes()
        except EOFError:
            return
        os.ftruncate(2, 0)
        call, args = pickle.loads(message)
        calls.send_bytes(b"")
        answer: tuple[Any, Exception | None]
        try:
            answer = call(*args), None
        except (BadInput, Failed, SimulationFailed, UnsupportedScene) as error:
            answer = None, error
        except Exception as error:  # which may be none that can be sent
            answer = None, Failed(bug(error))
        calls.send_bytes(pickle.dumps(answer))


def _end_with_parent() -> None:
    """End this process as soon as its parent is no more, even if that was killed."""
    parent = parent_process()
    if sys.platform == "linux" and parent is not None:
        # The kernel ends us when the parent's end of this pipe closes; a thread could not do so while
        # native code holds the interpreter's lock, for ever if it hangs.
        import fcntl

        signal.signal(signal.SIGIO, signal.SIG_DFL)
        fcntl.fcntl(parent.sentinel, fcntl.F_SETOWN, os.getpid())
        fcntl.fcntl(parent.sentinel, fcntl.F_SETFL, os.O_ASYNC)
        if wait([parent.sentinel], timeout=0):
            os._exit(1)
    elif parent is not None:
        Thread(target=lambda: (wait([parent.sentinel]), os._exit(1)), daemon=True).start()
