"""Reads what studies wrote: ``rows.jsonl``, ``curves/CASE.npz`` and ``sidecar.json`` per study."""

import hashlib
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
#: How a case ended of which nothing is known.
NO_RESULT = ("killed from outside", "not begun")


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
    """The results of one study, in an order that does not depend on when which case finished.

    ``notes`` are what a reader should know of the files.
    """

    folder: Path
    runs: tuple[Run, ...]
    sidecar: dict[str, Any] | None
    notes: tuple[str, ...] = ()

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
    *lines, _ = path.read_bytes().split(b"\n")  # a last line that a kill cut short is no row
    rows: dict[str, dict[str, Any]] = {}
    for n, line in enumerate(lines, 1):
        row = _row(line, f"{path}:{n}")
        if rows.setdefault(row["case"], row)["checksum"] != row["checksum"]:
            raise BrokenResults(f"{path}:{n}: expected one row of each case, got another of {row['case']}")
    runs = [_run(row) for row in rows.values() if row["status"] not in NO_RESULT]
    if not runs:
        raise NoResults(f"no results: {path} has no rows; run `crankslider run`")
    if len({run.fingerprint for run in runs}) > 1:
        raise BrokenResults(f"{path}: rows made by different code; run `crankslider run` to renew them")
    runs.sort(key=lambda run: (run.scene, run.engine, run.arm, -run.step_s, run.case))
    counts = {
        "rows are there twice and count once": len(lines) - len(rows),
        "cases were killed from outside and are left out; run `crankslider run`": len(rows) - len(runs),
    }
    notes = tuple(f"{path}: {count} {what}" for what, count in counts.items() if count)
    return Results(folder, tuple(runs), _sidecar(folder / "sidecar.json", runs[0].fingerprint), notes)


def _row(line: bytes, where: str) -> dict[str, Any]:
    """Return the row in a line if it is as the study wrote it."""
    shown = line[:60].decode(errors="replace").strip() + "..."
    try:
        row: dict[str, Any] = json.loads(line.decode())
        rest = {name: value for name, value in row.items() if name != "checksum"}
        right = hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()[:16]
    except (ValueError, AttributeError, RecursionError):
        raise BrokenResults(f"{where}: expected a row of results, got {shown}") from None
    for column, kind in HEAD.items():
        if not isinstance(row.get(column), kind):
            raise BrokenResults(f"{where}: expected a row with a column {column}, got {shown}")
    if row.get("checksum") != right:
        came = "one that was edited or damaged" if "checksum" in row else "one of an earlier version"
        todo = "move the file away and run `crankslider run`"
        raise BrokenResults(f"{where}: expected a row that fits its checksum, got {came}: {todo}")
    return row


def _run(row: dict[str, Any]) -> Run:
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
