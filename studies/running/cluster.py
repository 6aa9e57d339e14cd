"""The pool of ``workers`` on a Dask cluster: each call in a process of its own beside a Dask worker."""

import asyncio
import logging
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from threading import local
from typing import Any

from studies.case import code_of
from studies.failures import BadInput, Failed
from studies.running.workers import KILLED, Ended, Worker

#: How long a scheduler may take to answer, in s.
CONNECT_S = 5.0
_OWN = local()


class Cluster:
    """What answers at the address of a Dask scheduler, whose workers have our code and libraries."""

    def __init__(self, address: str) -> None:
        try:
            self._distributed: Any = import_module("distributed")  # optional, and without types
        except ImportError:
            expected = "the package distributed to be installed, got none (try crankslider[cluster])"
            raise BadInput(f"scheduler: expected {expected}") from None
        for logger in ("distributed", "distributed.client", "distributed.core", "tornado.application"):
            logging.getLogger(logger).setLevel(logging.CRITICAL + 1)  # we tell it in a line
        code = code_of("reference")
        try:
            # Without this a server that says nothing would keep a client for ever.
            asyncio.run(asyncio.wait_for(self._identity(address), CONNECT_S))
            self._client = self._distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
            self._client.wait_for_workers(1, timeout=CONNECT_S)
            codes = {*self._client.run(code_of, "reference").values()}
        except Exception as error:  # whatever a server that is no Dask makes of us
            codes = {str(error) or "no answer"}
        if codes != {code}:
            expected = f"a Dask scheduler whose workers have our code and libraries ({code})"
            raise BadInput(f"scheduler: expected {expected}, got {address}: {', '.join(codes)}")

    async def _identity(self, address: str) -> Any:
        async with self._distributed.rpc(address, timeout=CONNECT_S) as server:
            return await server.identity()

    def results(self, call: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[tuple[Any, Any]]:
        """Yield every item and what its call gave, as it ends."""
        futures = {self._client.submit(_contained, call, item, pure=False): item for item in items}
        try:
            for future in self._distributed.as_completed([*futures], loop=self._client.loop):
                try:
                    result = future.result()
                except self._distributed.KilledWorker as reason:  # with it died all that waited there
                    result = Ended(str(reason), KILLED)
                except (self._distributed.CancelledError, OSError) as error:
                    raise Failed(f"the scheduler of the cluster is gone: {error}") from None
                yield futures.pop(future), result
        finally:
            self._client.cancel([*futures])

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()


def _contained(call: Callable[[Any], Any], item: Any) -> Any:
    """Run a call on a Dask worker's thread, in a process of its own."""
    if not hasattr(_OWN, "worker"):
        _OWN.worker = Worker()
    try:
        return _OWN.worker.run(call, item, limit_s=item.limit_s)
    except Ended as end:
        return end
