"""Reads what studies wrote: ``rows.jsonl``, ``curves/CASE.npz`` and ``sidecar.json`` per study."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: The columns every row has, and the type of each.
HEAD: dict[str, type | tuple[type, ...]] = {
    "case": str,
    "fingerprint": str,
    "scene": str,
    "engine": str,
    "arm": str,
    "step_s": (int, float),
    "status": str,
    "reason": str,
}


class NoResults(Exception):
    """There is nothing to report; the message says what was missing where, and what to run."""


class BrokenResults(Exception):
    """The results cannot be read; the message names the file and what is wrong."""


@dataclass(frozen=True)
class Run:
    """One row: what was run, how it ended, and the measured numbers by column name.

    ``values`` holds every finite number of the row but the settings, ``settings`` those without
    their prefix.
    """

    case: str
    fingerprint: str
    scene: str
    engine: str
    arm: str
    step_s: float
    status: str
    reason: str
    values: dict[str, float]
    settings: dict[str, Any]

    @property
    def ok(self) -> bool:
        """Whether the engine finished the run."""
        return self.status == "ok"

    @property
    def mean_step_s(self) -> float:
        """The mean step where the engine chooses its own, else the step."""
        return self.values.get("mean_step_s", self.step_s)

    @property
    def name(self) -> tuple[str, str]:
        """Engine and arm."""
        return self.engine, self.arm


@dataclass(frozen=True)
class Results:
    """The results of one study, in an order that does not depend on when which case finished."""

    folder: Path
    runs: tuple[Run, ...]
    sidecar: dict[str, Any] | None

    def curve(self, run: Run, column: str) -> FloatArray | None:
        """Return a curve of a finished run, (n,), or None if it has no such curve.

        Raises:
            BrokenResults: the run's file is missing or damaged.
        """
        path = self.folder / "curves" / f"{run.case}.npz"
        try:
            with np.load(path, allow_pickle=False) as file:
                return np.asarray(file[column], dtype=float) if column in file else None
        except (OSError, ValueError, EOFError) as error:
            raise BrokenResults(f"{path}: expected the curves of a finished run, got {error}") from error


def read_results(folder: Path) -> Results:
    """Read a study's folder.

    Raises:
        NoResults: there are no rows.
        BrokenResults: a line is not a row, or the rows were made by different code.
    """
    path = folder / "rows.jsonl"
    if not path.exists():
        raise NoResults(f"no results: {path} is missing; run `crankslider run`")
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
    # A last line that a kill cut short is no row, as for the runner.
    runs = [_run(line, f"{path}:{n}") for n, line in enumerate(lines, 1) if line.endswith("\n")]
    if not runs:
        raise NoResults(f"no results: {path} has no rows; run `crankslider run`")
    if len({run.fingerprint for run in runs}) > 1:
        raise BrokenResults(f"{path}: rows made by different code; run `crankslider run` to renew them")
    runs.sort(key=lambda run: (run.scene, run.engine, run.arm, -run.step_s, run.case))
    return Results(folder, tuple(runs), _sidecar(folder / "sidecar.json", runs[0].fingerprint))


def _run(line: str, where: str) -> Run:
    try:
        row = json.loads(line)
    except json.JSONDecodeError as error:
        raise BrokenResults(f"{where}: expected a JSON object, got {error}") from error
    for column, kind in HEAD.items():
        if not isinstance(row, dict) or not isinstance(row.get(column), kind):
            raise BrokenResults(f"{where}: expected a row with a column {column}, got {line[:60].strip()}...")
    numbers = {
        name: float(value)
        for name, value in row.items()
        if not name.startswith("setting_")
        and isinstance(value, int | float)
        and not isinstance(value, bool)
        and math.isfinite(value)
    }
    settings = {
        name.removeprefix("setting_"): row[name] for name in sorted(row) if name.startswith("setting_")
    }
    return Run(**{column: row[column] for column in HEAD}, values=numbers, settings=settings)


def _sidecar(path: Path, fingerprint: str) -> dict[str, Any] | None:
    """Return where the rows come from, or None if the run was not finished: then it is of other rows."""
    if not path.exists():
        return None
    try:
        sidecar = json.loads(path.read_text(encoding="utf-8", errors="replace"))
    except json.JSONDecodeError as error:
        raise BrokenResults(f"{path}: expected JSON, got {error}") from error
    if not isinstance(sidecar, dict):
        raise BrokenResults(f"{path}: expected a JSON object")
    return sidecar if sidecar.get("fingerprint") == fingerprint else None
