"""Plant bugs, and see which test catches each: ``python -m tests.planted_bugs [NAME ...] [--sample K]``.

Each is planted in a copy of the project, where the tests that could see it run up to the first that does. A
bug that nobody catches, one that no longer fits its file, and a test that fails without any bug are failures,
and the exit code is then 1.
"""

import argparse
import lzma
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from importlib import import_module
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path
from random import Random, randrange
from tempfile import TemporaryDirectory, mkdtemp
from xml.etree import ElementTree

import pytest

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

ROOT = Path(__file__).parents[2]
FORK = get_context("fork")
#: What takes longer to import than most bugs to catch: pytest runs in copies of a process that has it. Not
#: Exudyn, of which a process has the build that it loads first.
LIBRARIES = (
    *("numpy", "pandas", "numba", "matplotlib.figure", "matplotlib.backends.backend_agg", "scipy.integrate"),
    *("scipy.stats", "scipy.interpolate", "hypothesis", "jinja2", "pydantic", "pymunk", "rich.progress"),
    "typer",
)
#: Plugins of pytest that a library has imported before it are none whose assertions matter.
IGNORED = ("-W", "ignore::pytest.PytestAssertRewriteWarning")
QUIET = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not accuracy", "--junit-xml=junit.xml")
#: Longer than the tests of a bug take; one that makes a test hang has not been caught.
LIMIT_S = 300.0


@dataclass(frozen=True)
class Bug:
    """A change of the ``file``, a path from the root: ``old`` text, which is there once, becomes ``new``.

    A published file is another after each run, so that there a ``pattern`` may say what is changed, where it
    matches first; its groups may be in ``new``. ``tests`` are the paths, or pytest's names, of those who
    could see it, and ``why`` says how somebody could make it.
    """

    name: str
    file: str
    new: str
    why: str
    tests: list[str]
    old: str = ""
    pattern: str = ""

    def plant(self, content: bytes) -> bytes:
        """Return the file with the bug in it; raise ValueError where it does not fit."""
        packed = self.file.endswith(".xz")
        text = (lzma.decompress(content) if packed else content).decode()
        if self.old:
            changed, count = text.replace(self.old, self.new), text.count(self.old)
        else:
            changed, count = re.subn(self.pattern, self.new, text, count=1)
        if count != 1 or changed == text:
            expected = f"{self.old or self.pattern!r} once in {self.file}, and another text for it"
            raise ValueError(f"{self.name}: expected {expected}, got it {count} times")
        return lzma.compress(changed.encode(), preset=0) if packed else changed.encode()


def read_bugs() -> list[Bug]:
    """Return all bugs in their order."""
    text = Path(__file__).with_name("bugs.toml").read_text(encoding="utf-8")
    return [Bug(**entry) for entry in tomllib.loads(text)["bug"]]


def copy_project(folder: str) -> None:
    """Copy what Git tracks, as it is now, below a folder, and go there."""
    place, command = Path(mkdtemp(dir=folder)), ["git", "ls-files", "-z"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True, text=True)
    for name in listed.stdout.split("\0"):
        if (ROOT / name).is_file():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, place / name)
    os.chdir(place)


def run_pytest(arguments: Sequence[str]) -> None:
    """Run pytest on the copy and exit, in a process that has the libraries and nothing of the project."""
    os.setsid()
    for name in [name for name in sys.modules if name.split(".")[0] == "tests"]:
        del sys.modules[name]
    sys.path[0] = os.environ["PYTHONPATH"] = str(Path.cwd())
    # Python tells its compiled files by the second in which a source was written: a bug may come sooner.
    sys.dont_write_bytecode, os.environ["PYTHONDONTWRITEBYTECODE"] = True, "1"
    with Path("output.txt").open("w", encoding="utf-8") as output:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
    sys.exit(pytest.main([*IGNORED, *QUIET, *arguments]))


def find_failures(arguments: Sequence[str], limit_s: float = LIMIT_S) -> dict[str, str]:
    """Return what tests that fail say by their names; what else goes wrong has no name."""
    process = FORK.Process(target=run_pytest, args=(arguments,))
    process.start()
    try:
        process.join(limit_s)
        if process.exitcode is None:
            return {"": f"no end within {limit_s:g} s"}
    finally:
        if process.is_alive() and process.pid:
            os.killpg(process.pid, signal.SIGKILL)
    if process.exitcode not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        return {"": f"no test ran: {Path('output.txt').read_text(encoding='utf-8')[-300:]}"}
    failures = {}
    for case in ElementTree.parse("junit.xml").iter("testcase"):
        for failure in (*case.findall("failure"), *case.findall("error")):
            file = case.get("classname", "").replace(".", "/")
            failures[f"{file}.py::{case.get('name')}"] = " ".join(failure.get("message", "").split())[:100]
    return failures


def plant(bug: Bug, tests: Sequence[str], limit_s: float) -> tuple[str, str]:
    """Plant a bug in the copy, and return the name of the test that catches it, or "", and what it says."""
    file = Path(bug.file)
    content = file.read_bytes()
    try:
        file.write_bytes(bug.plant(content))
        return next(iter(find_failures(["-x", *tests], limit_s).items()), ("", "all passed"))
    except ValueError as reason:
        return "", str(reason)
    finally:
        file.write_bytes(content)


def plant_all(bugs: Sequence[Bug], tests: Sequence[str], jobs: int, limit_s: float) -> list[str]:
    """Plant bugs in so many copies at once, and return in a line each what is wrong."""
    wrong, catching = list[str](), set[str]()
    for library in LIBRARIES:
        import_module(library)
    with (
        TemporaryDirectory(prefix="planted-") as folder,
        ProcessPoolExecutor(jobs, FORK, copy_project, (folder,)) as pool,
    ):
        calls = {pool.submit(plant, bug, tests or bug.tests, limit_s): bug for bug in bugs}
        for number, call in enumerate(as_completed(calls), 1):
            (caught_by, said), name = call.result(), calls[call].name
            print(f"{number}/{len(bugs)} {name}: {caught_by or 'NOBODY'}: {said}", flush=True)
            if caught_by:
                catching.add(caught_by)
            else:
                wrong.append(f"{name}: caught by nobody ({said})")
        files = [list(names) for _, names in groupby(sorted(catching), lambda test: test.partition("::")[0])]
        for found in [pool.submit(find_failures, names) for names in files]:
            wrong += [f"fails without a bug: {name or said}" for name, said in found.result().items()]
    return wrong


def main() -> int:
    """Plant the bugs that are named, and return how that ended."""
    parser = argparse.ArgumentParser(prog="python -m tests.planted_bugs", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="bugs, or beginnings of their files; all")
    parser.add_argument("--jobs", type=int, default=2, help="how many copies are worked in at once")
    parser.add_argument("--sample", type=int, metavar="K", help="so many, drawn at random")
    parser.add_argument("--seed", type=int, default=randrange(10**6), help="what decides the draw")
    parser.add_argument("--tests", nargs="+", default=[], metavar="PATH", help="in place of the bugs' own")
    parser.add_argument("--limit", type=float, default=LIMIT_S, metavar="S", help="seconds for a bug's tests")
    options = parser.parse_args()
    folders = tuple(name for name in options.names if "/" in name) or ("" if not options.names else ())
    bugs = [bug for bug in read_bugs() if bug.name in options.names or bug.file.startswith(folders)]
    if not bugs:
        parser.error(f"NAME: expected bugs' names or files, got {', '.join(options.names)}")
    if options.sample is not None:
        print(f"seed {options.seed}", flush=True)
        bugs = Random(options.seed).sample(bugs, min(options.sample, len(bugs)))
    wrong = plant_all(bugs, options.tests, options.jobs, options.limit)
    print("\n".join([*wrong, f"{len(bugs)} bugs planted, {len(wrong)} failures"]))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
