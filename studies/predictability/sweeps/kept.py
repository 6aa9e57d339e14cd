"""The finished chunks of a sweep: where it resumes, how they become one file, and that nothing is trusted.

While a sweep runs, the folder ``FILE.parts`` beside its file holds ``sweep.json``, which says of what sweep
the parts are, and a Parquet file for each chunk. Parts and the file have the sweep's identity and a digest of
all their rows in their metadata: what is not as it was written, or is another sweep's, counts as missing.
"""

import hashlib
import json
import os
import shutil
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import pyarrow as pa
from pyarrow import parquet

from studies.running.failures import BadInput, note
from studies.running.folder_lock import FolderHeld, held
from studies.running.whole_file import UNFINISHED, write_whole

#: Where the metadata of a file have the sweep's identity and the digest of what is in the file.
IDENTITY, DIGEST = "sweep", "digest"
#: Rows that are looked at together.
BATCH = 10_000


class Kept:
    """The finished chunks of one sweep of ``count`` members, whose rows have this schema; see ``opened``."""

    def __init__(self, folder: Path, identity: str, count: int, schema: pa.Schema) -> None:
        self._folder, self._identity, self._count, self._schema = folder, identity, count, schema
        #: The parts by the first of their members and the one after the last, in their order.
        self._parts: dict[tuple[int, int], Path] = {}
        found = {part: _members(part, identity, schema) for part in folder.glob("*.parquet")}
        end = 0
        for part, members in sorted(found.items()):
            if members and part == self._part(*members) and members[0] >= end and members[1] <= count:
                self._parts[members] = part
                end = members[1]
        self.unfit = len(found) - len(self._parts)

    def missing(self) -> list[tuple[int, int]]:
        """Return the stretches of members that are not there yet: the first of each and the one after it."""
        ends = [(0, 0), *sorted(self._parts), (self._count, self._count)]
        return [(end, begin) for (_, end), (begin, _) in pairwise(ends) if end < begin]

    def keep(self, first: int, table: pa.Table) -> None:
        """Keep a chunk, the first of whose members has this number."""
        sink, end = pa.BufferOutputStream(), first + len(table)
        made = {**_texts(table.schema.metadata), IDENTITY: self._identity}
        made[DIGEST] = _digest(made, table.to_batches())
        parquet.write_table(table.replace_schema_metadata(made), sink)
        write_whole(self._part(first, end), sink.getvalue().to_pybytes())
        self._parts[first, end] = self._part(first, end)

    def schema_before(self, first: int) -> pa.Schema:
        """Return the schema of the chunk that ends before a member."""
        (part,) = (part for (_, end), part in self._parts.items() if end == first)
        return parquet.read_schema(part)

    def merge(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Write all chunks into one file, in the order of members, one at a time."""
        parts = [part for _, part in sorted(self._parts.items())]
        made = {**metadata, IDENTITY: self._identity}
        made[DIGEST] = _digest(made, chain.from_iterable(map(_batches, parts)))
        new = self._folder / f"rows{UNFINISHED}"
        with new.open("wb") as file:
            with parquet.ParquetWriter(file, self._schema.with_metadata(made)) as writer:
                for part in parts:
                    writer.write_table(parquet.read_table(part).replace_schema_metadata(made))
            os.fsync(file.fileno())
        new.replace(path)

    def _part(self, first: int, end: int) -> Path:
        return self._folder / f"{first:09}-{end - 1:09}.parquet"


@contextmanager
def opened(path: Path, identity: str, count: int, schema: pa.Schema) -> Iterator[Kept]:
    """Hold the parts of the sweep that is to become the file ``path``, and let go of those that it has.

    Raises:
        BadInput: the parts there are of another sweep, or another run holds them.
        OSError: nothing can be written there.
    """
    folder = path.with_name(f"{path.name}.parts")
    folder.mkdir(exist_ok=True)
    try:
        with held(folder):
            for file in folder.glob(f"*{UNFINISHED}"):
                file.unlink()
            of_this = _is_of(folder, identity)
            kept = Kept(folder, identity, count, schema)
            if of_this is False or (of_this is None and kept.unfit and kept.missing() == [(0, count)]):
                expected = f"a file without parts of another sweep, or of other code, in {folder}"
                raise BadInput(f"--out: expected {expected}, got some: remove them, or name another file")
            if not of_this:
                write_whole(folder / "sweep.json", json.dumps({IDENTITY: identity}).encode() + b"\n")
            if kept.unfit:
                note(f"{folder}: {kept.unfit} parts are not as they were written: they are made again")
            yield kept
            done = not kept.missing()
    except FolderHeld as reason:
        raise BadInput(f"--out: expected {reason}") from None
    if done:
        shutil.rmtree(folder)


def is_whole(path: Path, identity: str, count: int, schema: pa.Schema) -> bool:
    """Return whether a file has all members of this sweep, as they were written."""
    return _members(path, identity, schema) == (0, count)


def _members(path: Path, identity: str, schema: pa.Schema) -> tuple[int, int] | None:
    """Return the first member in a file and the one after the last, None if it is not as it was written."""
    try:
        with parquet.ParquetFile(path) as file:
            found, rows = file.schema_arrow, file.metadata.num_rows
            first = next(file.iter_batches(1, columns=["member"]))["member"][0].as_py()
            made = _texts(found.metadata)
            right = made.pop(DIGEST) == _digest(made, file.iter_batches(BATCH)) and made[IDENTITY] == identity
    except Exception:  # whatever a damaged file makes of its reader
        return None
    return (first, first + rows) if right and found.equals(schema) else None


def _batches(path: Path) -> Iterator[pa.RecordBatch]:
    with parquet.ParquetFile(path) as file:
        yield from file.iter_batches(BATCH)


def _digest(metadata: Mapping[str, str], rows: Iterable[pa.RecordBatch]) -> str:
    """Return a hash of metadata and of all numbers and texts in rows, however they are cut into batches."""
    columns = defaultdict[tuple[str, ...], Any](hashlib.sha256)
    for batch in rows:
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if pa.types.is_list(column.type):
                columns[name, "lengths"].update(_bytes(column.value_lengths().fill_null(-1)))
                column = column.flatten()
            columns[name,].update(_bytes(column))
    found = [(*key, column.hexdigest()) for key, column in columns.items()]
    return hashlib.sha256(json.dumps([sorted(metadata.items()), found]).encode()).hexdigest()


def _bytes(column: pa.Array) -> bytes:
    if pa.types.is_string(column.type):
        return "".join(f"{text}\0" for text in column.to_pylist()).encode()
    return bytes(column.to_numpy(zero_copy_only=False).data)


def _texts(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    return {name.decode(): text.decode() for name, text in (metadata or {}).items()}


def _is_of(folder: Path, identity: str) -> bool | None:
    """Return whether the parts in a folder are those of a sweep, None where nothing says so."""
    try:
        return bool(json.loads((folder / "sweep.json").read_bytes())[IDENTITY] == identity)
    except (FileNotFoundError, ValueError, KeyError, TypeError, RecursionError):
        return None
