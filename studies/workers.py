"""Calls in processes of this machine; the death of a process, or its time limit, is the affair of one call.

Not ``concurrent.futures.ProcessPoolExecutor``, which breaks for every call when one process dies. Here every
process has a pipe of its own.
"""

import os
import pickle
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import current_process, get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from queue import SimpleQueue
from tempfile import NamedTemporaryFile
from threading import Lock, Thread
from typing import Any, TypeVar

from studies.failures import Failed

T = TypeVar("T")
#: How a call ended whose process did: by its own doing, at its limit, or by somebody else's.
CRASHED, TIMED_OUT, KILLED = "crashed", "timed out", "killed from outside"
#: Signals that no solver sends to itself: the kernel short of memory does, and people do.
FROM_OUTSIDE = {
    signal.SIGTERM,
    signal.SIGINT,
    *(getattr(signal, f"SIG{n}", 0) for n in ("KILL", "HUP", "QUIT")),
}
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
    """One process after another, each started when a call first needs it."""

    def __init__(self) -> None:
        self._process: Any = None
        self._closed, self._busy = False, Lock()

    def run(self, call: Callable[..., T], *args: object, limit_s: float) -> T:
        """Return what a call returns in the process, or raise what it raises.

        A call whose process has run others is run again in a new one, so that none answers for the damage
        that another did.

        Raises:
            Ended: the process died of the call, exceeded the limit, or was killed.
            Failed: no process can begin.
        """
        with self._busy:
            used = self._process is not None
            try:
                return self._run(call, args, limit_s)
            except Ended as end:
                if self._closed or not used or end.status in (TIMED_OUT, KILLED):
                    raise
            return self._run(call, args, limit_s)

    def close(self) -> None:
        """End the process, whatever it does, and start no other."""
        self._closed = True
        if (process := self._process) is not None:
            process.kill()
        with self._busy:
            if self._process is not None:
                self._end()

    def _run(self, call: Callable[..., T], args: tuple[object, ...], limit_s: float) -> T:
        if self._closed:
            raise Ended(KILLED, "the run has ended")
        if self._process is None:
            self._begin()
        begun, answer = False, b""
        try:
            self._pipe.send_bytes(pickle.dumps((call, args)))
            while not answer:  # of no bytes it says that the call begins
                limit = limit_s if begun else BEGINNING_S
                if not self._pipe.poll(limit):
                    self._end()
                    raise Ended(TIMED_OUT, f"not finished within the limit of {limit:g} s")
                answer, begun = self._pipe.recv_bytes(), True
        except (EOFError, OSError):
            end = self._death()
            if not begun and end.status != KILLED:
                raise Failed(f"no process can begin: {end}") from None
            raise end from None
        value: T
        value, error = pickle.loads(answer)
        if error is not None:
            raise error
        return value

    def _begin(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._words = NamedTemporaryFile(prefix="crankslider-")  # noqa: SIM115  it lives as long as the process
        process = context.Process(target=_serve, args=(theirs, self._words.name), daemon=True)
        with _starting():
            process.start()
        theirs.close()
        self._process = process

    def _end(self) -> int:
        """End the process and return its exit code."""
        process, self._process = self._process, None
        with _CHILDREN:
            process.join(0)
            if process.exitcode is None:
                process.kill()
                process.join()
        self._pipe.close()
        self._words.close()
        return int(process.exitcode)

    def _death(self) -> Ended:
        """Return how a process ended that has closed its pipe."""
        self._process.join(DYING_S)
        said = Path(self._words.name).read_text(encoding="utf-8", errors="replace").strip().splitlines()
        code = self._end()
        if code == NO_MAIN_GUARD:
            guard = 'if __name__ == "__main__":'
            reason = f"script: expected this call under {guard}, since every process imports the script"
            raise Failed(reason) from None
        how = f"ended with exit code {code}" if code >= 0 else f"killed by {signal.Signals(-code).name}"
        reason = f"{how}: {said[-1][:SHOWN_WORDS]}" if said else how
        return Ended(KILLED if -code in FROM_OUTSIDE else CRASHED, reason)


class Pool:
    """Up to ``jobs`` workers; a call goes to whichever is free. Leaving the block ends them all."""

    def __init__(self, jobs: int) -> None:
        if current_process().name != "MainProcess" and parent_process() is None:  # one that is only beginning
            sys.exit(NO_MAIN_GUARD)
        with _starting():
            resource_tracker.ensure_running()  # later it would lift a thread's block of SIGINT as it starts
        self._workers = [Worker() for _ in range(jobs)]

    def __enter__(self) -> "Pool":
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            worker.close()

    def run(self, call: Callable[..., T], *args: object, limit_s: float) -> T:
        """Return what one call returns (see ``Worker.run``)."""
        return self._workers[0].run(call, *args, limit_s=limit_s)

    def results(self, call: Callable[[Any], T], items: Iterable[Any]) -> Iterator[tuple[Any, T | Ended]]:
        """Yield every item, which has a ``limit_s``, and what its call gave, as it ends.

        Raises:
            Exception: what a call raised other than ``Ended``.
        """
        waiting, done = deque(items), SimpleQueue[tuple[Any, Any]]()
        count = len(waiting)

        def work(worker: Worker) -> None:
            with suppress(IndexError):  # none is left
                while True:
                    item = waiting.popleft()
                    try:
                        result: Any = worker.run(call, item, limit_s=item.limit_s)
                    except BaseException as error:
                        result = error
                    done.put((item, result))

        for worker in self._workers[:count]:
            Thread(target=work, args=(worker,), daemon=True).start()
        try:
            for _ in range(count):
                item, result = done.get()
                if isinstance(result, BaseException) and not isinstance(result, Ended):
                    raise result
                yield item, result
        finally:
            waiting.clear()


@contextmanager
def _starting() -> Iterator[None]:
    """Start a process in the block that Ctrl-C does not reach, and without the current folder in its path.

    A file of the user's there, ``array.py``, would take the place of Python's own module. What this process
    has in its path it has too, once it has begun.
    """
    with _CHILDREN:
        before = os.environ.get(SAFE_PATH)
        os.environ[SAFE_PATH] = "1"
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if os.name == "posix" else ()
        try:
            yield
        finally:
            if os.name == "posix":
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            os.environ.pop(SAFE_PATH)
            if before is not None:
                os.environ[SAFE_PATH] = before


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
        try:
            call, args = pickle.loads(message)
            calls.send_bytes(b"")
            answer = pickle.dumps((call(*args), None))
        except Exception as error:
            answer = _pickled(error)
        calls.send_bytes(answer)


def _pickled(error: Exception) -> bytes:
    """Return an exception as bytes, one that cannot be so by its name and message."""
    try:
        content = pickle.dumps((None, error))
        pickle.loads(content)
    except Exception:
        content = pickle.dumps((None, Failed(f"{type(error).__name__}: {error}")))
    return content


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
