"""Runs of the study of mischief in a process of their own, to be killed and looked at."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from studies.case import Case, Row
from studies.running.runner import run_cases
from studies.running.store import FILE, Store
from tests.helpers.mischief import NAME

#: ``crankslider`` knowing the study of the tests alone; workers find it by its import path.
CODE = f"from studies import case; case.STUDIES = ['{NAME}'];from crankslider.command import main; main()"
#: What to say first, so that Ctrl-C is heard even if a shell has us and our children ignore it.
HEAR = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"


@contextmanager
def started(out: Path, **environment: str) -> Iterator["subprocess.Popen[str]"]:
    """Start a run of the study into ``out``; it ends here at last."""
    command = [sys.executable, "-c", HEAR + CODE, "run", "--full", "--jobs", "4", "--out", str(out)]
    environment = {**os.environ, **environment}
    with subprocess.Popen(
        command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as run:
        try:
            yield run
        finally:
            run.kill()


def until(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def rows_in(out: Path) -> list[Row]:
    """Return the rows that a run of the study of mischief has written so far."""
    if not (out / FILE).exists():
        return []
    with Store(out) as store:
        return store.results(NAME)[0]


def gone(pid: int) -> bool:
    """Return whether a process has ended; Linux."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


class Here:
    """Runs calls one after the other in this process, in place of a pool of others."""

    def __enter__(self) -> "Here":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def results(self, call: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[tuple[Any, Any]]:
        """Yield every item and what its call gave."""
        for item in items:
            yield item, call(item)


def run_in(folder: Path, cases: Sequence[Case], workers: Any = None, retry: bool = False) -> list[Row]:
    """Run cases of one study into a folder, in this process or by workers, and return all rows there."""
    name = cases[0].study
    run_cases({name: cases}, folder, workers or Here(), retry_failed=retry)
    with Store(folder) as store:
        return store.results(name)[0]
