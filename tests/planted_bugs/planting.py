"""A copy of the project in which one bug at a time is planted, and what the tests that could see it say."""

import json
import lzma
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from queue import Queue
from tempfile import TemporaryDirectory
from typing import TypeVar
from xml.etree import ElementTree

from tests.planted_bugs.catalogue import ROOT, Bug, Inapplicable

#: What is done in a copy, and what comes of it.
Asked = TypeVar("Asked")
Found = TypeVar("Found")
#: Longer than any of the tests takes; a bug that makes one hang has not been told of.
LIMIT_S = 300.0
#: How pytest ends where tests have failed.
FAILED = 1
#: Characters of what a test says, and how folders begin there that are another ones each time.
MOST, PASSING = 100, re.compile(r"/\S*?/(planted-\w+|pytest-of-\w+/pytest-\d+)/")


def as_text(content: bytes, file: Path) -> str:
    """Return what is written in a file, which may be compressed."""
    return (lzma.decompress(content) if file.suffix == ".xz" else content).decode()


def as_content(text: str, file: Path) -> bytes:
    """Return a text as a file has it."""
    return lzma.compress(text.encode()) if file.suffix == ".xz" else text.encode()


@dataclass(frozen=True)
class Outcome:
    """Who caught a bug, by pytest's name, and what that said; nobody if the name is empty."""

    bug: Bug
    caught_by: str
    said: str
    took_s: float


@dataclass(frozen=True)
class Copy:
    """A copy of the project, and a process that runs tests in it (see ``forked``)."""

    folder: Path
    tests: "subprocess.Popen[str]"

    def outcome(self, bug: Bug) -> Outcome:
        """Plant a bug, run the tests that could see it up to the first that does, and take it out.

        One that does not fit its file any more is caught by nobody.
        """
        file, began = self.folder / bug.file, time.monotonic()
        right = file.read_bytes()
        try:
            file.write_bytes(as_content(bug.planted(as_text(right, file)), file))
            failures, said = self._failures(bug.tests, "-x")
        except Inapplicable as reason:
            failures, said = {}, str(reason)
        finally:
            file.write_bytes(right)
        (name, message), *_ = [*failures.items(), ("", said)]
        return Outcome(bug, name, message, time.monotonic() - began)

    def failing(self, tests: Sequence[str]) -> list[str]:
        """Return which of some tests fail without any bug."""
        failures, said = self._failures(tests)
        return [*failures, *([said] if said else [])]

    def _failures(self, tests: Sequence[str], *options: str) -> tuple[dict[str, str], str]:
        """Return what the tests that fail say by their names, and what else went wrong, if anything."""
        assert tests, "without a name pytest runs whatever there is"
        report = self.folder / "junit.xml"
        report.unlink(missing_ok=True)
        # Plugins of pytest that a library has imported before it are none whose assertions matter.
        ignored = ("-W", "ignore::pytest.PytestAssertRewriteWarning")
        quiet = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not accuracy")
        asked = [*ignored, *quiet, f"--junit-xml={report}", *options, *tests]
        assert self.tests.stdin is not None
        assert self.tests.stdout is not None
        print(json.dumps((str(self.folder), asked, LIMIT_S)), file=self.tests.stdin, flush=True)
        code = int(self.tests.stdout.readline())
        if code == 0:
            return {}, ""
        if code != FAILED or not report.exists():
            output = (self.folder / "output.txt").read_text(encoding="utf-8", errors="replace")
            return {}, f"no end within {LIMIT_S:g} s" if code == -1 else f"no test ran: {output[-300:]}"
        return dict(_told(ElementTree.parse(report))), ""


@dataclass(frozen=True)
class Copies:
    """Copies that are ``free``, and threads that work in as many at once."""

    free: "Queue[Copy]"
    threads: ThreadPoolExecutor

    def outcomes(self, bugs: Sequence[Bug]) -> Iterator[Outcome]:
        """Yield the outcome of each bug as soon as it is known."""
        return self._each(Copy.outcome, bugs)

    def failing(self, tests: Iterable[str]) -> list[str]:
        """Return which of some tests fail without any bug, each file of tests in a run of its own."""
        files = [list(of) for _, of in groupby(sorted(tests), key=lambda test: test.partition("::")[0])]
        return [name for names in self._each(Copy.failing, files) for name in names]

    def _each(self, run: Callable[[Copy, Asked], Found], asked: Sequence[Asked]) -> Iterator[Found]:
        def in_some(one: Asked) -> Found:
            place = self.free.get()
            try:
                return run(place, one)
            finally:
                self.free.put(place)

        for done in as_completed([self.threads.submit(in_some, one) for one in asked]):
            yield done.result()


@contextmanager
def copies(jobs: int) -> Iterator[Copies]:
    """Make so many copies."""
    with ExitStack() as stack:
        free: Queue[Copy] = Queue()
        for _ in range(jobs):
            free.put(stack.enter_context(copied()))
        threads = stack.enter_context(ThreadPoolExecutor(jobs))
        stack.callback(threads.shutdown, wait=True, cancel_futures=True)
        yield Copies(free, threads)


@contextmanager
def copied() -> Iterator[Copy]:
    """Copy what Git tracks, as it is now, into a folder that goes afterwards."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True)
    with TemporaryDirectory(prefix="planted-") as folder:
        for name in filter(None, listed.stdout.split("\0")):
            if (ROOT / name).exists():
                (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, Path(folder) / name)
        # Python tells its compiled files by the second in which a source was written: a bug may come sooner.
        environment = {**os.environ, "PYTHONPATH": folder, "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, str(Path(__file__).with_name("forked.py"))]
        with subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as tests:
            try:
                yield Copy(Path(folder), tests)
            finally:
                tests.terminate()


def _told(report: "ElementTree.ElementTree[ElementTree.Element]") -> Iterator[tuple[str, str]]:
    """Yield names and messages of the tests in a report that failed."""
    for case in report.iter("testcase"):
        for failure in (*case.findall("failure"), *case.findall("error")):
            module = case.get("classname", "").replace(".", "/")
            yield f"{module}.py::{case.get('name')}", shortened(failure.get("message", ""))


def shortened(message: str) -> str:
    """Return what a failed test says in a short line."""
    line = " ".join(re.sub(r"^(AssertionError|assert)\b:?", "", PASSING.sub("", message).strip()).split())
    return line if len(line) <= MOST else f"{line[:MOST]}..."
