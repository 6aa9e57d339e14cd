"""A copy of the project in which one bug at a time is planted, and what the tests that could see it say."""

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from tests.planted_bugs.catalogue import ROOT, Bug

#: Longer than any of the tests takes; a bug that makes one hang has not been told of.
LIMIT_S = 600
#: How pytest ends where tests have failed.
FAILED = 1
#: Characters of what a test says.
MOST = 100


@dataclass(frozen=True)
class Outcome:
    """Who caught a bug, by pytest's name, and what that said; nobody if the name is empty."""

    bug: Bug
    caught_by: str
    said: str
    took_s: float


@contextmanager
def copy(folder: Path) -> Iterator[Path]:
    """Copy what Git tracks, as it is now, into a folder that goes afterwards."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True)
    try:
        for name in filter(None, listed.stdout.split("\0")):
            if (ROOT / name).exists():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, folder / name)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def outcome(bug: Bug, place: Path) -> Outcome:
    """Plant a bug in a copy, run the tests that could see it up to the first that does, and take it out.

    Raises:
        Inapplicable: it does not fit its file.
    """
    file, began = place / bug.file, time.monotonic()
    right = file.read_bytes()
    file.write_bytes(bug.planted(right.decode("utf-8")).encode("utf-8"))
    try:
        failures, said = _failures(bug.tests, place, "-x")
    finally:
        file.write_bytes(right)
    (name, message), *_ = [*failures.items(), ("", said)]
    return Outcome(bug, name, message, time.monotonic() - began)


def failing(tests: Sequence[str], place: Path) -> list[str]:
    """Return which of some tests fail without any bug."""
    failures, said = _failures(tests, place)
    return [*failures, *([said] if said else [])]


def _failures(tests: Sequence[str], place: Path, *options: str) -> tuple[dict[str, str], str]:
    """Return what the tests that fail say by their names, and what else went wrong, if anything."""
    report = place / "junit.xml"
    report.unlink(missing_ok=True)
    quiet = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", f"--junit-xml={report}")
    # Python's own files are told apart by the second in which they were written: a bug may come sooner.
    environment = {**os.environ, "PYTHONPATH": str(place), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", *quiet, *options, *tests]
    try:
        run = subprocess.run(
            command, cwd=place, env=environment, capture_output=True, text=True, timeout=LIMIT_S
        )
    except subprocess.TimeoutExpired:
        return {}, f"no end within {LIMIT_S} s"
    if run.returncode == 0:
        return {}, ""
    if run.returncode != FAILED:
        return {}, f"the tests did not run: {(run.stdout + run.stderr)[-300:]}"
    return dict(_told(ElementTree.parse(report))), ""


def _told(report: "ElementTree.ElementTree[ElementTree.Element]") -> Iterator[tuple[str, str]]:
    """Yield names and messages of the tests in a report that failed."""
    for case in report.iter("testcase"):
        for failure in (*case.findall("failure"), *case.findall("error")):
            module = case.get("classname", "").replace(".", "/")
            yield f"{module}.py::{case.get('name')}", shortened(failure.get("message", ""))


def shortened(message: str) -> str:
    """Return what a failed test says in a short line."""
    line = " ".join(re.sub(r"^(AssertionError|assert)\b:?", "", message.strip()).split())
    return line if len(line) <= MOST else f"{line[:MOST]}..."
