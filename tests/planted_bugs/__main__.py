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
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from queue import SimpleQueue
from random import Random, randrange
from tempfile import TemporaryDirectory

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

ROOT = Path(__file__).parents[2]
PYTEST = (sys.executable, "-m", "pytest", "-q", "-rfE", "-n", "0", "-p", "no:cacheprovider")
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


def copy_project(place: Path) -> Path:
    """Copy what Git tracks, as it is now, into a new folder."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True)
    for name in listed.stdout.split("\0"):
        if (ROOT / name).is_file():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, place / name)
    return place


def find_failures(folder: Path, arguments: Sequence[str]) -> dict[str, str]:
    """Return what tests that fail in a copy say by their names; what else goes wrong has no name."""
    # Python tells its compiled files by the second in which a source was written: a bug may come sooner.
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {"COLUMNS": "300"}  # of a summary, which is cut to that
    call = [*PYTEST, "-m", "not accuracy", *arguments]
    try:
        done = subprocess.run(
            call, cwd=folder, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return {"": f"no end within {LIMIT_S:g} s"}
    if done.returncode not in (0, 1):
        return {"": f"no test ran: {done.stdout[-300:]}"}
    failed = re.findall(r"^(?:FAILED|ERROR) (.*?)(?: - (.*))?$", done.stdout, re.MULTILINE)
    return {name: said[:100] for name, said in failed}


def plant(bug: Bug, tests: Sequence[str], folder: Path) -> tuple[str, str]:
    """Plant a bug in a copy, and return the name of the test that catches it, or "", and what it says."""
    file = folder / bug.file
    content = file.read_bytes()
    try:
        file.write_bytes(bug.plant(content))
        return next(iter(find_failures(folder, ["-x", *tests]).items()), ("", "all passed"))
    finally:
        file.write_bytes(content)


def plant_all(bugs: Sequence[Bug], tests: Sequence[str], jobs: int) -> list[str]:
    """Plant bugs in so many copies at once, and return in a line each what is wrong."""
    wrong, catching, folders = list[str](), set[str](), SimpleQueue[Path]()

    def catch(bug: Bug) -> None:
        folder = folders.get()
        caught_by, said = plant(bug, tests or bug.tests, folder)
        folders.put(folder)
        print(f"{bug.name}: {caught_by or 'NOBODY'}: {said}", flush=True)
        if caught_by:
            catching.add(caught_by)
        else:
            wrong.append(f"{bug.name}: caught by nobody ({said})")

    with TemporaryDirectory(prefix="planted-") as place, ThreadPoolExecutor(jobs) as pool:
        for number in range(jobs):
            folders.put(copy_project(Path(place) / str(number)))
        list(pool.map(catch, bugs))
        folder = folders.get()
        for _, names in groupby(sorted(catching), lambda test: test.partition("::")[0]):
            failures = find_failures(folder, list(names))
            wrong += [f"fails without a bug: {name or said}" for name, said in failures.items()]
    return wrong


def main() -> int:
    """Plant the bugs that are named, and return how that ended."""
    parser = argparse.ArgumentParser(prog="python -m tests.planted_bugs", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="bugs, or beginnings of their files; all")
    parser.add_argument("--jobs", type=int, default=2, help="how many copies are worked in at once")
    parser.add_argument("--sample", type=int, metavar="K", help="so many, drawn at random")
    parser.add_argument("--seed", type=int, default=randrange(10**6), help="what decides the draw")
    parser.add_argument("--tests", nargs="+", default=[], metavar="PATH", help="in place of the bugs' own")
    options = parser.parse_args()
    folders = tuple(name for name in options.names if "/" in name) or ("" if not options.names else ())
    bugs = [bug for bug in read_bugs() if bug.name in options.names or bug.file.startswith(folders)]
    if not bugs:
        parser.error(f"NAME: expected bugs' names or files, got {', '.join(options.names)}")
    if options.sample is not None:
        print(f"seed {options.seed}", flush=True)
        bugs = Random(options.seed).sample(bugs, min(options.sample, len(bugs)))
    wrong = plant_all(bugs, options.tests, options.jobs)
    print("\n".join([*wrong, f"{len(bugs)} bugs planted, {len(wrong)} failures"]))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
