"""Runs of the study of mischief in a process of their own, to be killed and looked at."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import ParamSpec, TypeVar

from studies.running.closure import NUMERICAL_CODE, ROOT
from studies.running.execution import LimitedExecutor, Limits
from tests.helpers.mischief import NAME

#: ``crankslider`` knowing the study of the tests alone; workers find it by its import path.
CODE = (
    f"from studies.running import registry; registry.STUDIES = {{'{NAME}': '{NAME}'}};"
    "from studies.command.main import main; main()"
)
#: What to say first, so that Ctrl-C is heard even if a shell has us and our children ignore it; or is not.
HEAR = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
IGNORE = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN);"


@contextmanager
def started(
    out: Path, first: str = HEAR, cwd: Path | None = None, **environment: str
) -> Iterator["subprocess.Popen[str]"]:
    """Start a run of the study into ``out`` with a statement before all others; it ends here at last."""
    command = [sys.executable, "-c", first + CODE, "run", "--full", "--jobs", "2", "--out", str(out)]
    environment = {**os.environ, **environment}
    with subprocess.Popen(
        command, cwd=cwd, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as run:
        try:
            yield run
        finally:
            run.kill()


def copied(folder: Path) -> Path:
    """Copy the code that decides numbers and the tests' into a folder, to be edited and run there."""
    for package in (*NUMERICAL_CODE, "tests"):
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def add_line(file: Path, line: str) -> None:
    """Append a line to a file."""
    file.write_text(file.read_text(encoding="utf-8") + line + "\n", encoding="utf-8")


def until(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def lines(out: Path) -> list[str]:
    """Return the lines of rows that a run has written so far."""
    file = out / NAME / "rows.jsonl"
    return file.read_text().splitlines(keepends=True) if file.exists() else []


def gone(pid: int) -> bool:
    """Return whether a process has ended; Linux."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except FileNotFoundError:
        return True


P = ParamSpec("P")
T = TypeVar("T")


class Here(LimitedExecutor):
    """Runs calls when they are submitted; ``calls`` tells how many, and before each ``first`` is called."""

    def __init__(self, first: Callable[[int], None] = lambda _: None) -> None:
        self.calls, self._first = 0, first

    def submit_within(
        self, limits: Limits | None, call: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> "Future[T]":
        """Run a call within the limits; the future has what it returns or raises."""
        assert limits is not None
        future: Future[T] = Future()
        try:
            self.calls += 1
            self._first(self.calls)
            future.set_result(call(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future
