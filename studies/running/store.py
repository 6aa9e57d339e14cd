"""Rows of studies in one SQLite file of a folder: a row is there whole or not at all, and one run writes.

SQLite's locks, and so this file, are not to be trusted on network folders.
"""

import io
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from studies.case import Curves, Row
from studies.failures import BadInput
from studies.running.workers import KILLED

#: The file of a results folder, and beside it the one that a run locks.
FILE, LOCK = "results.sqlite", "results.lock"
#: The form of the tables, which a file of another one does not have.
FORM = 1
SCHEMA = f"""
begin immediate;
create table if not exists row (
    key text primary key, study text not null, engine text not null, code text not null, status text not null,
    content text not null, curves blob);
create table if not exists study (name text primary key, facts text not null);
pragma user_version = {FORM};
commit;
"""


class Store:
    """The file of a folder: any number of readers, one writer (see ``held``). Others are refused."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.path, self._lock = folder / FILE, folder / LOCK
        with self._reading():
            self._db = sqlite3.connect(self.path, isolation_level=None, timeout=60)
            ((form,),) = self._db.execute("pragma user_version")
            if form != FORM and list(self._db.execute("select name from sqlite_master")):
                raise sqlite3.DatabaseError(f"tables of another form, {form}")
            self._db.execute("pragma journal_mode = wal")
            self._db.execute("pragma synchronous = normal")  # a power cut may cost the last rows, a kill none
            self._db.executescript(SCHEMA)

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the folder for one run, by a lock of the operating system that dies with the process."""
        with closing(sqlite3.connect(self._lock, isolation_level=None, timeout=0)) as lock:
            try:
                lock.execute("begin exclusive")
            except sqlite3.OperationalError:
                got = f"{self.path.parent}: wait for it, or name another folder"
                raise BadInput(f"out: expected a folder that no other run holds, got {got}") from None
            yield

    def statuses(self) -> dict[str, str]:
        """Return how every case that is there has ended, by its key."""
        return dict(self._ask("select key, status from row"))

    def keep(self, key: str, code: str, row: Row, curves: Curves) -> None:
        """Keep a finished case for good, in place of an earlier row of it."""
        np.savez_compressed(file := io.BytesIO(), **curves)  # type: ignore[arg-type]
        blob = file.getvalue() if curves else None
        values = (key, row["study"], row["engine"], code, row["status"], json.dumps(row), blob)
        self._ask("insert or replace into row values (?, ?, ?, ?, ?, ?, ?)", *values)

    def describe(self, study: str, facts: Mapping[str, Any]) -> None:
        """Keep where a study's rows come from."""
        self._ask("insert or replace into study values (?, ?)", study, json.dumps(facts))

    def results(self, study: str) -> tuple[list[Row], dict[str, Any]]:
        """Return a study's rows by the code of its last run, and where they come from.

        They are in the order of their keys, which are in the column ``case``. Rows of other code stay in the
        file, and count again with that code. Cases of which nothing is known have no row.
        """
        facts: dict[str, Any] = json.loads(dict(self._ask("select * from study")).get(study, "{}"))
        query = "select key, engine, code, content from row where study = ? and status != ? order by key"
        codes, rows = facts.get("engines", {}), self._ask(query, study, KILLED)
        return [
            {"case": key, **json.loads(row)} for key, engine, code, row in rows if codes.get(engine) == code
        ], facts

    def curves(self, key: str) -> Curves:
        """Return the curves of a case; none where it has none."""
        ((blob,),) = self._ask("select curves from row where key = ?", key) or [(None,)]
        if blob is None:
            return {}
        with np.load(io.BytesIO(blob)) as file:
            return dict(file)

    def _ask(self, query: str, *values: Any) -> list[Any]:
        with self._reading():
            return self._db.execute(query, values).fetchall()

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """Turn what SQLite says of a damaged or foreign file, or a full disk, into one line."""
        try:
            yield
        except sqlite3.OperationalError as error:
            raise OSError(0, str(error), str(self.path)) from None
        except sqlite3.DatabaseError as error:
            todo = "move the file away"
            raise BadInput(f"results: expected rows of a run in {self.path}, got '{error}': {todo}") from None
