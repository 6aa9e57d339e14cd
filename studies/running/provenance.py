"""Where results come from: versions, machine, commit, and a fingerprint of the code that decides a number."""

import ast
import hashlib
import platform
import subprocess
import sys
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: The folders whose code decides numbers; the reports only show them.
NUMERICAL_CODE = ("reference_solver", "engine_models", "studies")
LIBRARIES = ("numpy", "scipy", "numba", "exudyn", "pymunk", "pydantic")

#: What is known of a file of code without reading it.
Stamp = tuple[int, int, int]


def _stamps() -> dict[str, Stamp]:
    """Return all files of numerical code by their path from the root, in its order."""
    found = {}
    for folder in NUMERICAL_CODE:
        for path in (ROOT / folder).rglob("*.py"):
            with suppress(FileNotFoundError):  # an editor replaces it
                stat = path.stat()
                found[path.relative_to(ROOT).as_posix()] = (stat.st_mtime_ns, stat.st_size, stat.st_ino)
    return dict(sorted(found.items()))


#: The code as it was when this process imported it.
_STAMPS = _stamps()
_SOURCES = {path: (ROOT / path).read_bytes() for path in _STAMPS}


@cache
def fingerprint() -> str:
    """Return a hash of the numerical code as imported and the libraries' versions.

    Comments and layout do not count.
    """
    digest = hashlib.sha256()
    for path, source in _SOURCES.items():
        digest.update(path.encode() + _meaning(source))
    digest.update(repr(versions()).encode())
    return digest.hexdigest()[:16]


def code_digest() -> str:
    """Return a hash of the numerical code as imported and as it is written, whatever Python's version."""
    digest = hashlib.sha256()
    for path, source in _SOURCES.items():
        digest.update(path.encode() + source)
    return digest.hexdigest()[:16]


def changed_code() -> list[str]:
    """Return the files of numerical code that by now mean something else than what was imported."""
    now = _stamps()
    touched = [path for path in {**_STAMPS, **now} if now.get(path) != _STAMPS.get(path)]
    return [path for path in touched if _differs(path)]


def _differs(path: str) -> bool:
    try:
        return _meaning((ROOT / path).read_bytes()) != _meaning(_SOURCES[path])
    except (OSError, KeyError, SyntaxError, ValueError):  # gone, new, or half written
        return True


def _meaning(source: bytes) -> bytes:
    return ast.dump(ast.parse(source)).encode()


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that take part in a number."""
    return {"python": platform.python_version(), **{name: version(name) for name in LIBRARIES}}


def sidecar(study: str, full: bool) -> dict[str, object]:
    """Return what is saved beside a study's rows."""
    return {
        "study": study,
        "set": "full" if full else "quick",
        "fingerprint": fingerprint(),
        "code": code_digest(),
        "commit": _commit(),
        "versions": versions(),
        "machine": {"system": platform.system(), "processor": _processor()},
    }


@cache
def _commit() -> str:
    """Return the commit first seen, with ``+changes`` if the work tree differed, or ``unknown``."""
    try:
        commands = (["git", "rev-parse", "HEAD"], ["git", "status", "--porcelain", "-uno"])
        commit, changes = (
            subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
            for command in commands
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit + ("+changes" if changes else "")


def _processor() -> str:
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
