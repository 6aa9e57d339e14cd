"""Calls in processes of this machine; the death of a process, or its time limit, is the affair of one call.

Not ``concurrent.futures.ProcessPoolExecutor``, which breaks for every call when one process dies. Here every
process has a pipe of its own. None imports the script that calls for it.
"""

import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from queue import LifoQueue
from tempfile import TemporaryFile
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
#: What a process begins with: before it imports anything it has our path, so that no file in the current
#: folder, such as ``array.py``, takes the place of a module of Python's.
BEGIN = (
    "import sys; sys.path[:] = sys.argv[3:]; from studies.running.workers import serve; serve(*sys.argv[1:3])"
)


class Ended(SimulationFailed):
    """A call's process died, or was killed at its limit; ``status`` is what its row says."""

    def __init__(self, reason: str, status: str = CRASHED) -> None:
        super().__init__(reason)
        self.status = status


class Worker:
    """One process after another, each started when a call first needs it; one call at a time."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    def run(self, call: Callable[..., T], *args: object, limit_s: float) -> T:
        """Return what a call returns in the process, or raise what it raises.

        A call whose process has run others is run again in a new one, so that none answers for the damage
        that another did. ``Ended`` says that it died of the call, exceeded the limit, or was killed.
        """
        used = self._process is not None
        try:
            return self._run(call, args, limit_s)
        except Ended as end:
            if not used or end.status in (TIMED_OUT, KILLED):
                raise
        return self._run(call, args, limit_s)

    def _run(self, call: Callable[..., T], args: tuple[object, ...], limit_s: float) -> T:
        process, answers = self._process or self._begin(), list[Any]()
        if self._closed:
            process.kill()
        try:
            self._pipe.send((call, args))
            for limit in (BEGINNING_S, limit_s):
                if not self._pipe.poll(limit):
                    self.close()
                    raise Ended(f"not finished within the limit of {limit:g} s", TIMED_OUT)
                answers.append(self._pipe.recv())
        except (EOFError, OSError):
            raise self._death(process, begun=bool(answers)) from None
        value, error = answers[-1]
        if error is not None:
            raise error
        return value  # type: ignore[no-any-return]

    def _begin(self) -> "subprocess.Popen[bytes]":
        """Start a process, with a pipe for calls and answers and a file for what it says."""
        self._pipe, theirs = Pipe()
        self._words = TemporaryFile("a+b")  # noqa: SIM115  it lives as long as the process
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", BEGIN, str(theirs.fileno()), str(os.getpid()), *sys.path],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # of native code too
                stderr=self._words,
                pass_fds=[theirs.fileno()],
            )
        return self._process

    def _death(self, process: "subprocess.Popen[bytes]", begun: bool) -> Exception:
        """Return how a process ended that has closed its pipe."""
        with suppress(subprocess.TimeoutExpired):
            process.wait(DYING_S)
        process.kill()
        code = process.wait()
        self._words.seek(0)
        said = self._words.read().decode("utf-8", "replace").strip().splitlines()
        self.close()
        name = signal.Signals(-code).name if code < 0 else ""
        reason = f"killed by {name}" if name else f"ended with exit code {code}"
        if said:
            reason += f": {said[-1][:200]}"
        if name in FROM_OUTSIDE:
            return Ended(reason, KILLED)
        return Ended(reason) if begun else Failed(f"no process can begin: {reason}")

    def kill(self) -> None:
        """End the process, whatever it does, and every other one that a call begins."""
        self._closed = True
        if (process := self._process) is not None:
            process.kill()

    def close(self) -> None:
        """End the process, if there is one, and let go of its files."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._pipe.close()
            self._words.close()
            self._process = None


class Pool:
    """Up to ``jobs`` workers; a call goes to whichever is free. Leaving the block ends them all."""

    def __init__(self, jobs: int) -> None:
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
            worker.close()

    def run(self, call: Callable[..., T], *args: object, limit_s: float) -> T:
        """Return what one call returns (see ``Worker.run``)."""
        worker = self._free.get()
        try:
            return worker.run(call, *args, limit_s=limit_s)
        finally:
            self._free.put(worker)

    def results(self, call: Callable[[Any], T], items: Iterable[Any]) -> Iterator[tuple[Any, T | Ended]]:
        """Yield every item, which has a ``limit_s``, and what its call gave or ``Ended``, as it ends."""
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


def serve(pipe: str, parent: str) -> None:
    """Answer calls with ``(value, None)`` or ``(None, error)`` until the parent is no more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":  # even while native code hangs with the interpreter's lock; else after a call
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() != int(parent):
            return
    calls = Connection(int(pipe))
    while True:
        os.ftruncate(2, 0)
        try:
            call, args = calls.recv()
        except EOFError:
            return
        calls.send(True)  # it begins
        try:
            answer: Any = call(*args), None
        except (BadInput, Failed, SimulationFailed, UnsupportedScene) as error:
            answer = None, error
        except Exception as error:  # which may be none that can be sent
            answer = None, Failed(bug(error))
        calls.send(answer)
