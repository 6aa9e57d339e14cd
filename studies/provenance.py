"""Where results come from: versions, machine, commit, and a fingerprint of the code that decides a number."""

import ast
import hashlib
import platform
import subprocess
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parent.parent
#: The folders whose code decides numbers; the reports only show them.
NUMERICAL_CODE = ("reference_solver", "engine_models", "studies")
LIBRARIES = ("numpy", "scipy", "numba", "exudyn", "pymunk", "pydantic")


@cache
def fingerprint() -> str:
    """Return a hash of the numerical code and the libraries' versions; comments and layout do not count."""
    digest = hashlib.sha256()
    for folder in NUMERICAL_CODE:
        for path in sorted((ROOT / folder).glob("*.py")):
            digest.update(ast.dump(ast.parse(path.read_text(encoding="utf-8"))).encode())
    digest.update(repr(versions()).encode())
    return digest.hexdigest()[:16]


def code_digest() -> str:
    """Return a hash of the numerical code as it is written, the same for every version of Python."""
    digest = hashlib.sha256()
    for folder in NUMERICAL_CODE:
        for path in sorted((ROOT / folder).glob("*.py")):
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


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


def _commit() -> str:
    """Return the commit checked out, with ``+changes`` if the work tree differs, or ``unknown``."""
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
