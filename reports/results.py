"""Reads what studies wrote: ``rows.jsonl``, ``curves/CASE.npz`` and ``sidecar.json`` per study.

What is published of them (see ``reports.publication``) is read as well: ``rows.jsonl.xz`` in place of
``rows.jsonl``, times in ``times.csv``, no curves.
"""

import csv
import hashlib
import json
import lzma
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reports.style import in_legend_order, legend_place

FloatArray = NDArray[np.float64]

#: The columns every row has, and the type of each.
HEAD: dict[str, type | tuple[type, ...]] = {
    "case": str,
    "fingerprint": str,
    "scene": str,
    "engine": str,
    "arm": str,
    "label": str,
    "step_s": (int, float),
    "status": str,
    "reason": str,
}
#: The files of published rows, and of their times, by the row's number from 0 on.
PUBLISHED_ROWS, PUBLISHED_TIMES, NUMBER = "rows.jsonl.xz", "times.csv", "row"
#: The column of a hash of a row's curves, where it has any.
CURVES = "curves_checksum"
#: How a case ended of which nothing is known.
NO_RESULT = ("killed from outside", "not begun")


class NoResults(Exception):
    """There is nothing to report; the message says what was missing where, and what to run."""


class BrokenResults(Exception):
    """The results cannot be read; the message names the file and what is wrong."""


@dataclass(frozen=True)
class Results:
    """The results of one study: ``rows`` as ``frame`` has them, a row per run.

    ``notes`` are what a reader should know of the files.
    """

    folder: Path
    rows: pd.DataFrame
    sidecar: dict[str, Any] | None
    notes: tuple[str, ...] = ()

    @property
    def has_curves(self) -> bool:
        """Whether the study's curves are there; published rows come without, and without figures of them."""
        return (self.folder / "curves").is_dir()

    def curve(self, case: str, column: str) -> FloatArray:
        """Return a curve of a finished run, (n,).

        Raises:
            BrokenResults: the run's file is missing or damaged, or lacks the curve.
        """
        path = self.folder / "curves" / f"{case}.npz"
        try:
            content = path.read_bytes()
            if self._curves.get(case, right := _hash(content)) != right:
                raise ValueError("others than its row had: run `crankslider run`")
            with np.load(BytesIO(content), allow_pickle=False) as file:
                return np.asarray(file[column], dtype=float)
        except Exception as error:  # whatever a damaged file makes of its reader
            raise BrokenResults(f"{path}: expected the curves of a finished run, got {error}") from error

    @cached_property
    def _curves(self) -> dict[str, str]:
        """The hashes of curves, by the cases whose rows have them."""
        known = with_columns(self.rows, CURVES).dropna(subset=[CURVES])
        return dict(zip(known["case"], known[CURVES], strict=True))


def read_results(folder: Path) -> pd.DataFrame:
    """Return the rows of a study's folder, a run each, with every column (see ``frame``).

    Raises:
        NoResults, BrokenResults: as ``read_study``.
    """
    return read_study(folder).rows


def read_study(folder: Path) -> Results:
    """Read a study's folder.

    Raises:
        NoResults: there are no rows.
        BrokenResults: a line is not a row, or one engine's rows were made by different code.
    """
    path = folder / "rows.jsonl"
    if not path.exists() and (folder / PUBLISHED_ROWS).exists():
        return Results(folder, frame(published_rows(folder)), _sidecar(folder / "sidecar.json"))
    if not path.exists():
        raise NoResults(f"no results: {path} is missing; run `crankslider run`")
    by_case = rows_by_case(path)
    ended = [row for row in by_case.values() if row["status"] not in NO_RESULT]
    if not ended:
        raise NoResults(f"no results: {path} has no rows; run `crankslider run`")
    rows = frame(ended)
    codes = rows[["engine", "fingerprint"]].drop_duplicates()
    if codes["engine"].duplicated().any():
        raise BrokenResults(f"{path}: rows made by different code; run `crankslider run` to renew them")
    counts = {
        "rows are there twice and count once": path.read_bytes().count(b"\n") - len(by_case),
        "cases were killed from outside and are left out; run `crankslider run`": len(by_case) - len(ended),
    }
    notes = [f"{path}: {count} {what}" for what, count in counts.items() if count]
    sidecar = _sidecar(folder / "sidecar.json")
    digest = _hash(" ".join(sorted(row["checksum"] for row in by_case.values())).encode())
    if sidecar and sidecar.pop("rows", digest) != digest:
        notes.append(f"{path}: rows are not those that the last finished run left; run `crankslider run`")
        sidecar = None
    codes_of = dict(zip(codes["engine"], codes["fingerprint"], strict=True))
    if sidecar and not codes_of.items() <= sidecar["fingerprints"].items():  # it is of other rows
        sidecar = None
    return Results(folder, rows, sidecar, tuple(notes))


def rows_by_case(path: Path) -> dict[str, dict[str, Any]]:
    """Return the rows of a file as a run wrote them, by their cases.

    Raises:
        BrokenResults: a line is not a row, or there are two rows of a case.
    """
    *lines, _ = path.read_bytes().split(b"\n")  # a last line that a kill cut short is no row
    by_case: dict[str, dict[str, Any]] = {}
    for n, line in enumerate(lines, 1):
        row = _row(line, f"{path}:{n}")
        if by_case.setdefault(row["case"], row)["checksum"] != row["checksum"]:
            raise BrokenResults(f"{path}:{n}: expected one row of each case, got another of {row['case']}")
    return by_case


def published_rows(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of a study that are published in a folder, with their times.

    Raises:
        BrokenResults: they are no rows.
    """
    path = folder / PUBLISHED_ROWS
    try:
        with lzma.open(path, "rt", encoding="utf-8") as lines:
            rows: list[dict[str, Any]] = [json.loads(line) for line in lines]
        if (folder / PUBLISHED_TIMES).exists():
            with (folder / PUBLISHED_TIMES).open(encoding="utf-8", newline="") as file:
                for times in csv.DictReader(file):
                    row = rows[int(times.pop(NUMBER))]
                    row |= {name: float(value) for name, value in times.items() if value}
        known = {"study": folder.name, "fingerprint": ""}
        rows = [{"case": f"{folder.name}-{n}", **known, **row} for n, row in enumerate(rows)]
        if rows and all(isinstance(row[column], kind) for row in rows for column, kind in HEAD.items()):
            return rows
        reason = "others"
    except (OSError, EOFError, lzma.LZMAError, ValueError, KeyError, IndexError, TypeError) as error:
        reason = f"'{error}'"
    raise BrokenResults(f"{path}: expected published rows and their times, got {reason}")


def head_of(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns that say what was run, whatever code and machine ran it."""
    told = dict(takewhile(lambda item: item[0] != "status", row.items()))
    return {name: value for name, value in told.items() if name not in ("case", "fingerprint", "study")}


def frame(rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return rows as a data frame, in an order that does not depend on when which case finished.

    They go by scene, by label in the order of legends, which is also that of the categories of ``label``, and
    from long steps to short ones. Numbers are float64, NaN where a row has none or one that is not finite;
    settings, text and flags are objects as they were written. Without a mean step of its own a run has its
    step in ``mean_step_s``.
    """
    table = pd.DataFrame(sorted(rows, key=_place), dtype=object)
    measured = {
        name: pd.to_numeric(table[name], errors="coerce").astype(float).replace([np.inf, -np.inf], np.nan)
        for name in table
        if not name.startswith("setting_") and table[name].map(_may_be_number).all()
    }
    measured["mean_step_s"] = measured.get("mean_step_s", measured["step_s"]).fillna(measured["step_s"])
    columns = {**dict(table.items()), **measured, "label": in_legend_order(table)}
    return pd.DataFrame(columns)  # in one piece, which is quicker to select from


def with_columns(rows: pd.DataFrame, *names: str) -> pd.DataFrame:
    """Return the rows with these columns, NaN throughout where no row has one."""
    return rows.reindex(columns=[*rows, *(name for name in names if name not in rows)])


def _place(row: Mapping[str, Any]) -> tuple[Any, ...]:
    place = row["scene"], legend_place(row["engine"], row["arm"]), -row["step_s"]
    return *place, json.dumps(head_of(row), sort_keys=True)


def _may_be_number(value: object) -> bool:
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool))


def _checksum(values: Mapping[str, Any]) -> str:
    """Return the hash of all values but the checksum among them."""
    rest = {name: value for name, value in values.items() if name != "checksum"}
    return _hash(json.dumps(rest, sort_keys=True).encode())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _row(line: bytes, where: str) -> dict[str, Any]:
    """Return the row in a line if it is as the study wrote it."""
    shown = line[:60].decode(errors="replace").strip() + "..."
    try:
        row: dict[str, Any] = json.loads(line.decode())
        right = _checksum(row)
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


def _sidecar(path: Path) -> dict[str, Any] | None:
    """Return what a run that came to its end wrote of its rows, None if none has."""
    if not path.exists():
        return None
    try:
        sidecar: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        right = sidecar.pop("checksum", None) in (None, _checksum(sidecar))  # earlier ones have none
        if right and isinstance(sidecar["fingerprints"], dict):
            return sidecar
        reason = "one that was edited or damaged"
    except (ValueError, AttributeError, KeyError, TypeError, RecursionError) as error:
        reason = f"'{error}'"
    raise BrokenResults(f"{path}: expected what a run wrote, got {reason}; run `crankslider run` to renew it")
