"""Where results come from: versions, machine, commit, and fingerprints of what decided a number.

What decides one is what the study's module and the engine's are made of (see ``closure``), and what makes a
row of the two.
"""

import hashlib
import platform
import subprocess
import sys
from collections.abc import Collection, Iterable
from datetime import datetime, timezone
from functools import cache, reduce
from importlib.metadata import version
from operator import or_
from pathlib import Path

from engine_models.engines import ENGINES, engine_module
from studies.running.closure import ROOT, Closure, changed, closure, meaning
from studies.running.registry import STUDIES, study_module

#: What makes rows of what a study measures, and ends cases at their limits.
ROW_MAKERS = ("studies.running.outcome", "studies.running.processes")


@cache
def fingerprint(study: str, engine: str) -> str:
    """Return a hash of all that decides a number of a study with an engine, as this process first read it.

    Versions of Python and of the distributions that are imported count, comments and docstrings do not.
    """
    return _hash([study, engine], _made_of(study, [engine]), with_versions=True)


@cache
def engine_fingerprint(module: str) -> str:
    """Return a hash of all that decides a number of an engine, by its module's import path."""
    return _hash([], closure(module), with_versions=True)


def overall_fingerprint() -> str:
    """Return a hash of all that decides a number of any study with any engine."""
    parts = [fingerprint(study, engine) for study in STUDIES for engine in ENGINES]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def code_digest(study: str, engines: Iterable[str]) -> str:
    """Return a hash of what the code of a study and its engines means, whatever versions it runs with."""
    return _hash([study], _made_of(study, engines), with_versions=False)


def code_of(made_by: Iterable[tuple[str, str]]) -> frozenset[Path]:
    """Return the files of studies and engines."""
    return frozenset(path for each in made_by for path in _made_of(each[0], each[1:]).files.values())


def changed_code(known: Iterable[Path]) -> list[str]:
    """Return the files of some that by now mean something else than what was imported."""
    files = {path for path in known if changed(path)}
    return sorted(path.relative_to(ROOT).as_posix() if ROOT in path.parents else str(path) for path in files)


def _made_of(study: str, engines: Iterable[str]) -> Closure:
    # Others only the study knows. An engine from outside has joined this process, or the one that began it.
    own = [engine_module(name) for name in engines if name in ENGINES or ":" in name]
    return reduce(or_, map(closure, (study_module(study), *ROW_MAKERS, *own)))


def _hash(names: list[str], made_of: Closure, with_versions: bool) -> str:
    parts: list[object] = [names, {name: meaning(path) for name, path in made_of.files.items()}]
    if with_versions:
        parts.append(versions(made_of.distributions))
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def versions(distributions: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python and of distributions, in the order of their names."""
    return {"python": platform.python_version(), **{name: version(name) for name in sorted(distributions)}}


def sidecar(study: str, full: bool, engines: Collection[str]) -> dict[str, object]:
    """Return what is saved beside the rows of a study with these engines."""
    return {
        "study": study,
        "set": "full" if full else "quick",
        "fingerprints": {engine: fingerprint(study, engine) for engine in engines},
        "code": code_digest(study, engines),
        "commit": _commit(),
        "date": datetime.now(timezone.utc).date().isoformat(),
        "versions": versions(_made_of(study, engines).distributions),
        "machine": {"system": platform.system(), "processor": _processor()},
    }


@cache
def _commit() -> str:
    """Return the commit first seen, with ``+changes`` if the work tree differed, or ``unknown``."""
    command = ["git", "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty=+changes"]
    try:
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _processor() -> str:
    if sys.platform == "linux":
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
