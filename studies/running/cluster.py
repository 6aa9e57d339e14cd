"""Runs calls on a Dask cluster whose workers have the same code and libraries as we."""

import asyncio
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from concurrent.futures import wait as wait_for
from contextlib import contextmanager
from functools import cache, partial
from importlib import import_module
from multiprocessing import current_process
from threading import Lock
from typing import Any, ParamSpec, TypeVar

from studies.running.execution import LimitedExecutor, Limits, RunBroken
from studies.running.failures import BadInput
from studies.running.processes import Processes
from studies.running.provenance import overall_fingerprint

P = ParamSpec("P")
T = TypeVar("T")

#: How long a scheduler may take to answer.
CONNECT_S = 5.0
#: Held by the thread that looks for a worker's processes, lest two make them.
_FIRST = Lock()


@contextmanager
def cluster(address: str) -> Iterator[Callable[[], LimitedExecutor]]:
    """Connect to the Dask scheduler at ``address`` and give a function that makes executors on its workers.

    Raises:
        BadInput: Dask is not installed here, no scheduler answers there, or its workers run other code.
    """
    try:
        distributed: Any = import_module("distributed")  # optional, and without types
    except ImportError:
        raise _refusal("the package distributed to be installed", "none (try crankslider[cluster])") from None
    try:
        # Asked before there is a client: one that cannot connect complains once more at its end.
        server = asyncio.run(asyncio.wait_for(_identity(distributed, address), 1.2 * CONNECT_S))["type"]
    except Exception as error:  # whatever a server that is no Dask makes of us
        raise _refusal("the address of a Dask scheduler", f"{address} ({error or 'no answer'})") from None
    if server != "Scheduler":
        raise _refusal("the address of a Dask scheduler", f"that of a {server}")
    # What they tell with tracebacks, we tell in a line.
    for logger in ("distributed", "distributed.client", "tornado.application"):
        logging.getLogger(logger).setLevel(logging.CRITICAL + 1)
    with distributed.Client(address, timeout=CONNECT_S, set_as_default=False) as client:
        _require_same_code(distributed, client)
        yield lambda: ClusterExecutor(distributed, client)


async def _identity(distributed: Any, address: str) -> Any:
    async with distributed.rpc(address, timeout=CONNECT_S) as server:
        return await server.identity()


def _require_same_code(distributed: Any, client: Any) -> None:
    try:
        client.wait_for_workers(1, timeout=CONNECT_S)
    except distributed.TimeoutError:
        raise _refusal("a Dask cluster with workers", "none") from None
    try:
        codes = set(client.run(overall_fingerprint).values())
    except Exception as error:
        raise _refusal("workers that have crankslider installed", f'"{error}"') from None
    ours = overall_fingerprint()
    if others := codes - {ours}:
        raise _refusal(f"workers with our code and libraries (fingerprint {ours})", ", ".join(sorted(others)))


def _refusal(expected: str, came: str) -> BadInput:
    return BadInput(f"--scheduler: expected {expected}, got {came}")


class ClusterExecutor(LimitedExecutor):
    """Submits calls to the workers of a Dask client, which run them in processes of their own.

    So a call that hangs or crashes is the affair of nobody else, and a worker answers its scheduler whatever
    a solver does to its process. Not the client's own executor: some of its futures are never done if
    the scheduler goes. And Dask blames the death of a worker on every call that waited there too, so
    the blamed run again in a process here.
    """

    def __init__(self, distributed: Any, client: Any) -> None:
        self._client, self._worker_died = client, distributed.KilledWorker
        self._calls: dict[Future[Any], Any] = {}
        self._local = Processes(1)

    def submit_within(
        self, limits: Limits | None, call: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> "Future[T]":
        """Run a call in a process of a worker, which is ended when it exceeds the limits."""
        future: Future[T] = Future()
        future.set_running_or_notify_cancel()
        bound = partial(call, *args, **kwargs)
        self._calls[future] = remote = self._client.submit(_contained, limits, bound, pure=False)
        self._client.loop.add_callback(self._pass_on, future, remote, limits, bound)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Wait for the calls; ``cancel_futures`` drops those that do not run yet and waits for none."""
        if cancel_futures:
            self._client.cancel(list(self._calls.values()))
            self._calls.clear()
        if wait:
            wait_for(list(self._calls))
        self._local.shutdown(wait, cancel_futures=cancel_futures)

    async def _pass_on(
        self, future: "Future[T]", remote: Any, limits: Limits | None, call: Callable[[], T]
    ) -> None:
        try:
            future.set_result(await self._answer(remote, limits, call))
        except BaseException as error:
            future.set_exception(error)
        self._calls.pop(future, None)

    async def _answer(self, remote: Any, limits: Limits | None, call: Callable[[], T]) -> T:
        try:
            value: T = await remote
        except (CancelledError, OSError) as error:
            raise RunBroken(f"the scheduler of the cluster is gone: {error}") from None
        except self._worker_died:
            return await asyncio.wrap_future(self._local.submit_within(limits, call))
        return value


def _contained(limits: Limits | None, call: Callable[[], T]) -> T:
    """Run a call on a worker, in a process of its own."""
    with _FIRST:
        processes = _processes()
    return processes.submit_within(limits, call).result()


@cache
def _processes() -> Processes:
    """Return the processes of this worker, as many as it has threads."""
    # A nanny makes its workers daemons, which may have no children lest these outlive them; ours do not.
    current_process().daemon = False
    return Processes(import_module("distributed").get_worker().state.nthreads)
