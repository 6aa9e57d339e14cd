"""The finished chunks of a sweep: where it resumes, how they become one file, and that nothing is trusted.

While a sweep runs, the folder ``FILE.parts`` beside its file holds ``sweep.json``, which says of what sweep
the parts are, and a Parquet file for each chunk, named by its first and last member. Parts and the file have
the sweep's identity and a hash of all their bytes in their metadata: what is not as it was written, or is
another sweep's, counts as missing.
"""

import hashlib
import json
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from mmap import ACCESS_READ, mmap
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from studies.running.failures import BadInput, note
from studies.running.folder_lock import FolderHeld, held
from studies.running.whole_file import UNFINISHED, write_whole

#: Where the metadata of a file have the sweep's identity.
IDENTITY = "sweep"
#: Where they have the hash of all bytes, which is taken with zeros in its own place, behind the mark.
SEAL, MARK, ZEROS = "seal", b"sha256:", b"0" * 64


class Kept:
    """The finished chunks of one sweep of ``count`` members; see ``opened``."""

    def __init__(self, folder: Path, identity: str, count: int) -> None:
        self._folder, self._identity, self._count = folder, identity, count
        #: The parts by the first of their members and the one after the last, in their order.
        self._parts: dict[tuple[int, int], Path] = {}
        found, end = sorted(folder.glob("*.parquet")), 0
        for part in found:
            members = _members(part, identity)
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
        members = first, first + len(table)
        self._write(self._part(*members), table.schema, [table])
        self._parts[members] = self._part(*members)

    def schema_before(self, first: int) -> pa.Schema:
        """Return the schema of the chunk that ends before a member."""
        (part,) = (part for (_, end), part in self._parts.items() if end == first)
        return parquet.read_schema(part)

    def merge(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Write all chunks into one file, in the order of members, one at a time."""
        parts = [part for _, part in sorted(self._parts.items())]
        schema = parquet.read_schema(parts[0]).with_metadata(dict(metadata))
        self._write(path, schema, map(parquet.read_table, parts))

    def _part(self, first: int, end: int) -> Path:
        return self._folder / f"{first:09}-{end - 1:09}.parquet"

    def _write(self, path: Path, schema: pa.Schema, tables: Iterable[pa.Table]) -> None:
        """Write tables, under the schema's metadata, into a file that is sealed and then takes its place."""
        made = {**(schema.metadata or {}), IDENTITY: self._identity, SEAL: MARK + ZEROS}
        new = self._folder / f"rows{UNFINISHED}"
        with new.open("w+b") as file:
            with parquet.ParquetWriter(file, schema.with_metadata(made)) as writer:
                for table in tables:
                    writer.write_table(table.replace_schema_metadata(made))
            file.flush()
            with mmap(file.fileno(), 0, access=ACCESS_READ) as content:
                place, _, right = _seal(content)
            file.seek(place)
            file.write(right)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)


@contextmanager
def opened(path: Path, identity: str, count: int) -> Iterator[Kept]:
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
            of_this, kept = _is_of(folder, identity), Kept(folder, identity, count)
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


def is_whole(path: Path, identity: str, count: int) -> bool:
    """Return whether a file has all members of this sweep, as they were written."""
    return _members(path, identity) == (0, count)


def _members(path: Path, identity: str) -> tuple[int, int] | None:
    """Return the first member in a file and the one after the last, None if it is not as it was written."""
    try:
        with path.open("rb") as opened, mmap(opened.fileno(), 0, access=ACCESS_READ) as content:
            _, there, right = _seal(content)
        if there != right:
            return None
        with parquet.ParquetFile(path) as file:
            if file.schema_arrow.metadata[IDENTITY.encode()] != identity.encode():
                return None
            first = next(file.iter_batches(1, columns=["member"]))["member"][0].as_py()
            return first, first + file.metadata.num_rows
    except (OSError, ValueError, KeyError):
        return None


def _seal(content: mmap) -> tuple[int, bytes, bytes]:
    """Return where the hash of a file's bytes has its place in them, what is there, and what should be."""
    place = content.rfind(MARK) + len(MARK)
    with memoryview(content) as view, view[:place] as before, view[place + len(ZEROS) :] as behind:
        found = hashlib.sha256(before)
        found.update(ZEROS)
        found.update(behind)
    return place, content[place : place + len(ZEROS)], found.hexdigest().encode()


def _is_of(folder: Path, identity: str) -> bool | None:
    """Return whether the parts in a folder are those of a sweep, None where nothing says so."""
    try:
        return bool(json.loads((folder / "sweep.json").read_bytes())[IDENTITY] == identity)
    except (FileNotFoundError, ValueError, KeyError, TypeError, RecursionError):
        return None
