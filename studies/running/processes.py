"""Runs calls in processes of this machine; the death of a process is the affair of the one call it ran.

Not ``concurrent.futures.ProcessPoolExecutor``, which breaks for every call when one process dies, nor
``pebble.ProcessPool``, whose processes share a pipe: of one that dies just after it took a call, it
cannot always tell which call that was. Here every process has its own pipe.
"""

import signal
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from functools import partial
from multiprocessing import resource_tracker
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import Any, ParamSpec, TypeVar

from engine_models.engine import ProcessTaken
from studies.running.case import Limits
from studies.running.execution import KILLED, NOT_BEGUN, TIMED_OUT, CaseEnded, LimitedExecutor
from studies.running.process import WorkerProcess

P = ParamSpec("P")
T = TypeVar("T")
Call = Callable[[], Any]


class Processes(LimitedExecutor):
    """An executor of up to ``jobs`` long-lived processes, each started when a call first needs it.

    The future of a call whose process dies has the exception CaseEnded; the next call gets a new process.
    Calls begin in the order they are submitted.
    """

    def __init__(self, jobs: int) -> None:
        self._waiting: SimpleQueue[tuple[Future[Any], Call, Limits | None] | None] = SimpleQueue()
        self._closed = False
        self._lock = Lock()
        resource_tracker.ensure_running()  # later it would lift a slot's block of SIGINT as it starts
        self._slots = [_Slot() for _ in range(jobs)]
        self._threads = [Thread(target=self._serve, args=[slot], daemon=True) for slot in self._slots]
        for thread in self._threads:
            thread.start()

    def submit(self, call: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> "Future[T]":
        """Run a call without limits."""
        return self.submit_within(None, call, *args, **kwargs)

    def submit_within(
        self, limits: Limits | None, call: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> "Future[T]":
        """Run a call that is ended, and its process with it, when it exceeds the limits."""
        future: Future[T] = Future()
        with self._lock:
            if self._closed:
                raise RuntimeError("cannot schedule new futures after shutdown")
            self._waiting.put((future, partial(call, *args, **kwargs), limits))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; ``cancel_futures`` drops those that wait and kills those that run."""
        with self._lock:
            self._closed = True
        if cancel_futures:
            self._drop_waiting()
            for slot in self._slots:
                slot.kill()
        for _ in self._threads:
            self._waiting.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def _drop_waiting(self) -> None:
        try:
            while True:
                if (item := self._waiting.get_nowait()) is not None:
                    item[0].cancel()
        except Empty:
            return

    def _serve(self, slot: "_Slot") -> None:
        if hasattr(signal, "pthread_sigmask"):  # its processes inherit it: Ctrl-C is their parent's affair
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        while (item := self._waiting.get()) is not None:
            future, call, limits = item
            if not future.set_running_or_notify_cancel():
                continue
            try:
                value = slot.run(call, limits)
            except BaseException as error:
                future.set_exception(error)
            else:
                future.set_result(value)
        slot.close()


class _Slot:
    """One process after another."""

    def __init__(self) -> None:
        self._process: WorkerProcess | None = None
        self._killed = False
        self._lock = Lock()

    def run(self, call: Call, limits: Limits | None) -> Any:
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

    def _run(self, call: Call, limits: Limits | None) -> Any:
        with self._lock:
            if self._killed:
                raise CancelledError
            process = self._process = self._process or WorkerProcess()
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
