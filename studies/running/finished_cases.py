"""The rows of a study's folder: where a run resumes. Every finished case is kept, and nothing is trusted.

The folder holds ``rows.jsonl`` (a line per case finished by the present code of the study and of the case's
engine), ``rows.FINGERPRINT.jsonl`` for rows that were set aside, by their code, and ``curves/KEY.npz``. Set
aside are rows of other code.
"""

import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from studies.running.case import Curves, Row
from studies.running.execution import NO_RESULT
from studies.running.failures import note
from studies.running.folder_lock import held
from studies.running.whole_file import UNFINISHED, write_through, write_whole

#: The columns that every row has, beside those of its study.
HEAD = ("case", "fingerprint", "status", "checksum")
#: The column of a hash of a row's curves, where it has any.
CURVES = "curves_checksum"


class DamagedRows(Exception):
    """A line is not what a run wrote there; the message names file and line and says what to do."""


class Rows:
    """The finished cases of a folder, by their keys; see ``opened``."""

    def __init__(self, folder: Path, fingerprints: Mapping[str, str]) -> None:
        self._folder, self._fingerprints = folder, fingerprints
        self._path = folder / "rows.jsonl"
        self._rows = _sorted_out(folder, frozenset(fingerprints.values()))
        self._bare = {key for key, row in self._rows.items() if not self._has_its_curves(key, row)}
        if self._bare:
            note(f"{folder}: {len(self._bare)} cases have not the curves that they had: they are run again")

    def statuses(self) -> dict[str, str]:
        """Return how each case ended."""
        return {key: str(row["status"]) for key, row in self._rows.items()}

    def lacks(self, key: str, retry_failed: bool) -> bool:
        """Return whether a run that resumes has to make a case; ``retry_failed`` asks for failures, too."""
        if key in self._bare:
            return True
        status = self._rows[key]["status"] if key in self._rows else None
        return status in (None, *NO_RESULT) or (retry_failed and status not in ("ok", "unsupported"))

    def digest(self) -> str:
        """Return a hash of all rows, in whatever order they are."""
        return _hash(" ".join(sorted(str(row["checksum"]) for row in self._rows.values())).encode())

    def keep(self, key: str, row: Row, curves: Curves) -> None:
        """Keep a finished case, its curves first, in place of an earlier row of it.

        Raises:
            OSError: it could not be written; the rows are as before.
        """
        new: Row = {"case": key, "fingerprint": self._fingerprints[str(row["engine"])], **row}
        if curves:
            file = io.BytesIO()
            np.savez_compressed(file, **curves)  # type: ignore[arg-type]
            write_whole(self._curves(key), file.getvalue())
            new[CURVES] = _hash(file.getvalue())
        new["checksum"] = checksum(new)
        if key in self._rows:
            _write(self._path, {**self._rows, key: new})
        else:
            _append(self._path, _line(new))
        self._rows[key] = new
        self._bare.discard(key)

    def _has_its_curves(self, key: str, row: Row) -> bool:
        try:
            return CURVES not in row or _hash(self._curves(key).read_bytes()) == row[CURVES]
        except OSError:
            return False

    def _curves(self, key: str) -> Path:
        return self._folder / "curves" / f"{key}.npz"


@contextmanager
def opened(folder: Path, fingerprints: Mapping[str, str]) -> Iterator[Rows]:
    """Hold a folder and give the rows that the present code made there: its fingerprints, by engine.

    Rows of other code are set aside, and what was set aside and is wanted is taken up again.

    Raises:
        FolderHeld: another run holds the folder.
        DamagedRows: a line is no row.
        OSError: the folder cannot be written.
    """
    (folder / "curves").mkdir(parents=True, exist_ok=True)
    with held(folder):
        for file in folder.rglob(f"*{UNFINISHED}"):
            file.unlink()
        yield Rows(folder, fingerprints)


def checksum(row: Mapping[str, object]) -> str:
    """Return the hash of a row's other columns."""
    rest = {name: value for name, value in row.items() if name != "checksum"}
    return _hash(json.dumps(rest, sort_keys=True).encode())


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]


def _sorted_out(folder: Path, present: frozenset[str]) -> dict[str, Row]:
    """Return the rows of the present code and leave them alone in ``rows.jsonl``, each once.

    Whatever is interrupted here, no row is lost: it is in the new file before it leaves the old one.
    """
    path = folder / "rows.jsonl"
    rows, clean = _read(path)
    asides = [_aside(folder, code) for code in sorted(present)]
    own = {key: row for key, row in rows.items() if row["fingerprint"] in present}
    leaving: dict[str, dict[str, Row]] = {}
    for key, row in rows.items():
        if key not in own:
            leaving.setdefault(str(row["fingerprint"]), {})[key] = row
    returning = {key: row for aside in asides for key, row in _read(aside)[0].items()}
    for code, others in leaving.items():
        _write(_aside(folder, code), {**_read(_aside(folder, code))[0], **others})
    here = returning | own
    if leaving or returning or not clean:
        _write(path, here)
    for aside in asides:
        aside.unlink(missing_ok=True)
    return here


def _aside(folder: Path, code: str) -> Path:
    return folder / f"rows.{code}.jsonl"


def _read(path: Path) -> tuple[dict[str, Row], bool]:
    """Return the rows of a file by case, and whether it is clean: each there once, the last one whole.

    A last line that a kill cut short is dropped.
    """
    if not path.exists():
        return {}, True
    *lines, torn = path.read_bytes().split(b"\n")
    rows: dict[str, Row] = {}
    for n, line in enumerate(lines, 1):
        row = _row(line, f"{path}:{n}")
        if rows.setdefault(str(row["case"]), row)["checksum"] != row["checksum"]:
            raise _damaged(f"{path}:{n}", "another result of a case that is there already")
    if doubles := len(lines) - len(rows):
        note(f"{path}: {doubles} rows are there twice and count once")
    return rows, not (torn or doubles)


def _row(line: bytes, where: str) -> Row:
    try:
        row: Row = json.loads(line.decode())
        right = isinstance(row, dict) and checksum(row)
    except (ValueError, RecursionError):
        raise _damaged(where, "something else") from None
    if not right or any(not isinstance(row.get(name), str) for name in HEAD[:-1]):
        raise _damaged(where, "something else")
    if "checksum" not in row:
        raise _damaged(where, "one without a checksum, as earlier versions wrote them")
    if row["checksum"] != right or not re.fullmatch("[0-9a-f]{16}", str(row["fingerprint"])):
        raise _damaged(where, "one that does not fit its checksum")
    return row


def _damaged(where: str, came: str) -> DamagedRows:
    return DamagedRows(f"a row of results at {where}, got {came}: remove the line or move the file away")


def _line(row: Row) -> bytes:
    return json.dumps(row).encode() + b"\n"


def _write(path: Path, rows: Mapping[str, Row]) -> None:
    write_whole(path, b"".join(map(_line, rows.values())))


def _append(path: Path, line: bytes) -> None:
    """Append a line for good, or nothing of it where the disk fails: a line after a torn one is lost.

    An interruption ends the run, and leaves what a kill would: a whole line, or one that the next run drops.
    """
    with path.open("ab", buffering=0) as file:
        end = file.seek(0, os.SEEK_END)
        try:
            write_through(file, line)
        except OSError:
            file.truncate(end)
            raise
