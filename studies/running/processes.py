"""Runs calls in processes of this machine; the death of a process is the affair of the one call it ran.

Not ``concurrent.futures.ProcessPoolExecutor``, which breaks for every call when one process dies, nor
``pebble.ProcessPool``, whose processes share a pipe: of one that dies just after it took a call, it
cannot always tell which call that was. Here every process has its own pipe.
"""

import os
import pickle
import signal
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import current_process, get_context, parent_process, resource_tracker
from multiprocessing.connection import wait
from queue import LifoQueue
from threading import Lock
from typing import Any, ParamSpec, TypeVar

from engine_models.engine import ProcessTaken
from studies.running.execution import (
    CRASHED,
    KILLED,
    NOT_BEGUN,
    OUT_OF_MEMORY,
    TIMED_OUT,
    CaseEnded,
    LimitedExecutor,
    Limits,
)
from studies.running.failures import Failed
from studies.running.worker import BEGUN, serve

P = ParamSpec("P")
T = TypeVar("T")

#: How much of what a process said on stderr is kept, in bytes, and of its last line shown, in characters.
KEPT_WORDS, SHOWN_WORDS = 10_000, 200
#: A process that has closed its pipe is dead within this time, or it never will be by itself.
DYING_S = 5.0
#: A process that has not imported what a call needs within this time never will.
BEGINNING_S = 600.0
#: The exit code of a process that imports a script which calls for processes itself.
NO_MAIN_GUARD = 113
#: Signals that no solver sends to itself: the kernel short of memory does, and people do.
FROM_OUTSIDE = ("SIGKILL", "SIGTERM", "SIGHUP", "SIGINT", "SIGQUIT")
#: Starting a child reaps others: two threads at once would take each other's exit codes.
_CHILDREN = Lock()
#: What keeps the current folder out of the path of a Python that starts, from 3.11 on.
SAFE_PATH = "PYTHONSAFEPATH"


@contextmanager
def starting() -> Iterator[None]:
    """Start processes in the block, in no other thread meanwhile, without the current folder in their path.

    A file of the user's there, ``array.py``, would take the place of Python's own module. What this process
    has in its path they have too, once they have begun.
    """
    with _CHILDREN:
        before = os.environ.get(SAFE_PATH)
        os.environ[SAFE_PATH] = "1"
        try:
            yield
        finally:
            if before is None:
                del os.environ[SAFE_PATH]
            else:
                os.environ[SAFE_PATH] = before


class Processes(LimitedExecutor):
    """An executor of up to ``jobs`` long-lived processes, each started when a call first needs it.

    The future of a call whose process dies has the exception CaseEnded; the next call gets a new process.
    Calls begin in the order they are submitted.
    """

    def __init__(self, jobs: int) -> None:
        if current_process().name != "MainProcess" and parent_process() is None:  # one that is only beginning
            sys.exit(NO_MAIN_GUARD)
        with starting():
            resource_tracker.ensure_running()  # later it would lift a thread's block of SIGINT as it starts
        self._slots = [_Slot() for _ in range(jobs)]
        self._idle: LifoQueue[_Slot] = LifoQueue()
        for slot in self._slots:
            self._idle.put(slot)
        self._threads = ThreadPoolExecutor(jobs, initializer=_keep_ctrl_c_from_children)

    def submit_within(
        self, limits: Limits | None, call: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> "Future[T]":
        """Run a call that is ended, and its process with it, when it exceeds the limits."""
        bound: Callable[[], T] = partial(call, *args, **kwargs)
        return self._threads.submit(self._run, bound, limits)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; ``cancel_futures`` drops those that wait and kills those that run."""
        self._threads.shutdown(wait=False, cancel_futures=cancel_futures)
        if cancel_futures:
            for slot in self._slots:
                slot.kill()
        if wait:
            self._threads.shutdown()
            for slot in self._slots:
                slot.close()

    def _run(self, call: Callable[[], T], limits: Limits | None) -> T:
        slot = self._idle.get_nowait()  # there is one for each thread
        try:
            return slot.run(call, limits)
        finally:
            self._idle.put(slot)


def _keep_ctrl_c_from_children() -> None:
    """Block SIGINT in this thread and the processes that it starts: Ctrl-C is their parent's affair."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


class _Slot:
    """One process after another."""

    def __init__(self) -> None:
        self._process: _WorkerProcess | None = None
        self._killed = False
        self._lock = Lock()

    def run(self, call: Callable[[], T], limits: Limits | None) -> T:
        """Run a call; one that ends a process which ran others before is run again in a new one.

        So no call answers for the damage that another did, nor for what another loaded. Neither does one for
        a process that died before it began.
        """
        used = self._process is not None
        try:
            return self._run(call, limits)
        except ProcessTaken:
            if not used:
                raise
        except CaseEnded as end:
            if end.status in (TIMED_OUT, KILLED) or (not used and end.status != NOT_BEGUN):
                raise
        return self._run(call, limits)

    def _run(self, call: Callable[[], T], limits: Limits | None) -> T:
        with self._lock:
            if self._killed:
                raise CancelledError
            process = self._process = self._process or _WorkerProcess()
        try:
            return process.run(call, limits)
        except (CaseEnded, ProcessTaken):
            self.close()
            raise

    def kill(self) -> None:
        """End the process, and start no other."""
        with self._lock:
            self._killed = True
            if self._process is not None:
                self._process.kill()

    def close(self) -> None:
        with self._lock:
            process, self._process = self._process, None
        if process is not None:
            process.close()


class _WorkerProcess:
    """A process started anew, which imports what its calls need and keeps it until it is closed.

    It runs one call at a time, and when it dies says how.
    """

    def __init__(self) -> None:
        context = get_context("spawn")
        self._calls, calls = context.Pipe()
        self._stderr, stderr = context.Pipe(duplex=False)
        self._process = context.Process(target=serve, args=(calls, stderr), daemon=True)
        with starting():
            self._process.start()
        calls.close()
        stderr.close()
        self._words = b""

    def run(self, call: Callable[[], T], limits: Limits | None) -> T:
        """Return what the call returns there, or raise what it raises.

        Raises:
            CaseEnded: the process died of the call or was killed, exceeded the limits, or could not begin.
        """
        begun = False
        memory_limit = None if limits is None else limits.memory_limit_bytes
        try:
            self._calls.send_bytes(pickle.dumps((call, memory_limit)))
            message = self._answer(BEGINNING_S)
            if begun := message == BEGUN:
                message = self._answer(None if limits is None else limits.time_limit_s)
        except TimeoutError as silence:
            raise CaseEnded(TIMED_OUT if begun else NOT_BEGUN, str(silence)) from None
        except (EOFError, OSError):
            status, reason = self._death(limits)
            raise CaseEnded(status if begun else NOT_BEGUN, reason) from None
        value: T
        value, error = pickle.loads(message)
        if not begun:
            raise CaseEnded(NOT_BEGUN, f"{type(error).__name__}: {error}")
        if error is not None:
            raise error
        return value

    def kill(self) -> None:
        """End the process at once, whatever it does; ``run`` in another thread then ends too."""
        self._process.kill()

    def close(self) -> None:
        """End the process and let go of its pipes; nothing can be asked of it any more."""
        self.kill()
        self._exit_code()
        self._process.close()
        self._calls.close()
        self._stderr.close()

    def _answer(self, time_limit_s: float | None) -> bytes:
        """Wait for a message, listening to stderr so that the process never waits for us to read it."""
        deadline = None if time_limit_s is None else time.monotonic() + time_limit_s
        self._words = b""
        watched: list[Any] = [self._calls, self._stderr]
        while True:
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            ready = wait(watched, left)
            if self._calls in ready:
                return self._calls.recv_bytes()
            if not ready:
                raise TimeoutError(f"not finished within the limit of {time_limit_s:g} s")
            if not self._listen():
                watched.remove(self._stderr)

    def _listen(self) -> bool:
        """Keep the end of what the process says on stderr; return whether it may say more."""
        said = os.read(self._stderr.fileno(), 1 << 16)
        self._words = (self._words + said)[-KEPT_WORDS:]
        return bool(said)

    def _death(self, limits: Limits | None) -> tuple[str, str]:
        """Return status and reason of a process that has closed its pipe."""
        code = self._exit_code()
        while os.name == "posix" and self._stderr.poll(0) and self._listen():
            pass
        if code == NO_MAIN_GUARD:
            guard = 'if __name__ == "__main__":'
            reason = f"script: expected this call under {guard}, since every process imports the script"
            raise Failed(reason) from None
        last = (self._words.decode(errors="replace").strip().splitlines() or [""])[-1].strip()
        signals = {number.value: number.name for number in signal.Signals}
        name = signals.get(-code, f"signal {-code}")
        how = f"killed by {name}" if code < 0 else f"ended with exit code {code}"
        reason = f"{how}: {last[:SHOWN_WORDS]}" if last else how
        if code < 0 and name in FROM_OUTSIDE:
            return KILLED, reason
        if limits is not None and b"bad_alloc" in self._words:  # how C++ dies for want of memory
            return OUT_OF_MEMORY, f"{reason} (limit {limits.memory_limit_bytes:g} bytes)"
        return CRASHED, reason

    def _exit_code(self) -> int:
        with _CHILDREN:
            self._process.join(DYING_S)
            if self._process.exitcode is None:
                self._process.kill()
                self._process.join()
        return self._process.exitcode or 0
