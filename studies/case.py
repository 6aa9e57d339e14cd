"""A case of a study, the row that comes of it, and what decides its numbers."""

import hashlib
import json
import platform
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from functools import cache
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from engine_models.arms import MEANINGS, Arm, Setting
from engine_models.engine import FloatArray, RunSettings, SimulationFailed, UnsupportedScene
from engine_models.engines import engine_module
from engine_models.scene.scene import Scene
from studies.failures import Failed, bug

Value = str | int | float | bool | None
#: One flat row of results: units are in the column names, failures have ``status`` and ``reason``.
Row = dict[str, Value]
Curves = dict[str, FloatArray]

ROOT = Path(__file__).parents[1]
#: The studies, modules of this folder that are imported when asked for. Sweeps and comparisons have commands.
STUDIES = ("accuracy", "energy", "predictability", "cost", "stability", "extremes")
#: The folders whose files decide numbers, and the distributions whose versions do.
CODE = ("reference_solver", "engine_models", "studies")
LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "exudyn", "pymunk")
#: The wall time in s of a case that has no limit of its own: thirty times what the longest takes.
LIMIT_S = 1800.0


@dataclass(frozen=True)
class Case:
    """A configuration's run on a scene, with ``added`` settings beyond the configuration's own.

    A ``timed`` case runs on this machine with nothing beside it, after all others and in the order given.
    ``columns`` are the study's own in the row's head, where they tell cases apart.
    """

    study: str
    scene: Scene
    arm: Arm
    run: RunSettings
    added: Mapping[str, Setting] = field(default_factory=dict)
    timed: bool = False
    limit_s: float = LIMIT_S
    columns: Mapping[str, Value] = field(default_factory=dict)

    @property
    def engine(self) -> str:
        """The engine's name."""
        return self.arm.engine

    @property
    def settings(self) -> dict[str, Setting]:
        """The engine's settings, the configuration's and the added ones."""
        return {**self.arm.settings, **self.added}

    @property
    def key(self) -> str:
        """What identifies the case together with the code and the libraries that it is run by."""
        parts = [code_of(self.engine), self.head(), self.scene.to_toml(), asdict(self.run)]
        return _hash(json.dumps(parts, sort_keys=True))

    def head(self) -> Row:
        """Return the columns that say what was run."""
        return {
            "study": self.study,
            "scene": self.scene.name,
            "engine": self.engine,
            "arm": self.arm.name,
            "label": self.arm.label,
            "end_time_s": self.scene.end_time_s,
            "samples": self.run.samples,
            "step_s": self.run.step_used_s(self.scene.end_time_s),
            **({"timed": True} if self.timed else {}),
            **({"time_limit_s": self.limit_s} if self.limit_s != LIMIT_S else {}),
            **{f"setting_{name}": value for name, value in self.settings.items()},
            **self.columns,
        }


def load_study(name: str) -> Any:
    """Return a study's module by its name here, or by its import path.

    ``cases(full)`` are its list of cases; the full set contains the quick one. ``measure(case)`` runs a case
    and returns its measured columns and its curves over time, ``tuple[Row, Curves]``.
    """
    return import_module(name if "." in name else f"studies.{name}")


def run_case(case: Case) -> tuple[Row, Curves]:
    """Run a case; where there is no run the row has what ``ended`` gives."""
    try:
        measured, curves = load_study(case.study).measure(case)
    except UnsupportedScene as reason:
        return ended(case, "unsupported", reason), {}
    except (SimulationFailed, MemoryError) as reason:
        status = "out of memory" if isinstance(reason, MemoryError) else "failed"
        return ended(case, status, reason), {}
    except Exception as error:
        raise Failed(f"{case.arm.label} on {case.scene.name}: {bug(error)}") from error
    return {**case.head(), "status": "ok", "reason": "", **measured}, curves


def ended(case: Case, status: str, failure: Exception) -> Row:
    """Return the row of a case without a run: how it ended, the reason, and the exception's class."""
    end = {"status": status, "reason": str(failure), "exception": type(failure).__name__}
    return {**case.head(), **end}


@cache
def code_of(engine: str) -> str:
    """Return a hash of what decides numbers: code, that of an engine from outside too, and versions beneath.

    It is the code as this process first read it.
    """
    try:
        module = engine_module(engine)
    except ValueError:  # of a study alone
        module = "studies"
    files = [] if module.partition(".")[0] in CODE else [Path(str(getattr(find_spec(module), "origin", "")))]
    return _hash([project_code(), versions(), [path.read_bytes() for path in files]])


@cache
def project_code(folders: tuple[str, ...] = CODE) -> str:
    """Return a hash of the names and bytes of all files of Python and data in folders of the project."""
    paths = (path for name in folders for path in sorted((ROOT / name).rglob("*.*")))
    files = [path for path in paths if path.suffix in (".py", ".toml")]
    return _hash([(path.relative_to(ROOT).as_posix(), path.read_bytes()) for path in files])


def _hash(content: object) -> str:
    return hashlib.sha256(repr(content).encode()).hexdigest()[:16]


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python and of the distributions that decide numbers."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}


def provenance(full: bool, cases: Sequence[Case]) -> dict[str, Any]:
    """Return where the rows of a study come from: set, code, commit, day, versions and machine."""
    git = ["git", "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty=+changes"]
    try:
        commit = subprocess.run(git, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        commit = "unknown"
    told = Path("/proc/cpuinfo").read_text(encoding="utf-8") if sys.platform == "linux" else ""
    name = re.search(r"^model name\s*: (.*)", told, re.MULTILINE)
    return {
        "set": "full" if full else "quick",
        "cases": len(cases),
        "configurations": {case.arm.label: MEANINGS.get(case.arm.label, "") for case in cases},
        "engines": {engine: code_of(engine) for engine in dict.fromkeys(case.engine for case in cases)},
        "code": project_code(),
        "commit": commit,
        "date": datetime.now(timezone.utc).date().isoformat(),
        "versions": versions(),
        "machine": {"system": platform.system(), "processor": name[1] if name else platform.processor()},
    }
