"""The finished chunks of a sweep: where it resumes, and how they become one file.

While a sweep runs, the folder ``FILE.parts`` beside its file holds ``sweep.json``, which says of what sweep
the parts are, and a Parquet file for each chunk, named by its first and last member.
"""

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from studies.running.failures import BadInput
from studies.running.folder_lock import FolderHeld, held
from studies.running.whole_file import UNFINISHED, whole_file, write_whole

#: Where the metadata of the file has the sweep's identity.
IDENTITY = "sweep"


class Kept:
    """The finished chunks of one sweep of ``count`` members; see ``opened``."""

    def __init__(self, folder: Path, count: int) -> None:
        self._folder, self._count = folder, count

    def missing(self) -> list[tuple[int, int]]:
        """Return the stretches of members that are not there yet: the first of each and the one after it."""
        ends = [(-1, -1), *self._ends(), (self._count, self._count)]
        gaps = [(last + 1, first) for (_, last), (first, _) in pairwise(ends)]
        return [(begin, end) for begin, end in gaps if begin < end]

    def keep(self, first: int, table: pa.Table) -> None:
        """Keep a chunk, the first of whose members has this number."""
        sink = pa.BufferOutputStream()
        parquet.write_table(table, sink)
        name = f"{first:09}-{first + len(table) - 1:09}.parquet"
        write_whole(self._folder / name, sink.getvalue().to_pybytes())

    def schema_before(self, first: int) -> pa.Schema | None:
        """Return the schema of the chunk that ends before a member, None if there is none."""
        for part in self._folder.glob(f"*-{first - 1:09}.parquet"):
            return parquet.read_schema(part)
        return None

    def merge(self, path: Path, metadata: Mapping[str, str]) -> None:
        """Write all chunks into one file, in the order of members, one at a time."""
        parts = sorted(self._folder.glob("*.parquet"))
        schema = parquet.read_schema(parts[0]).with_metadata(dict(metadata))
        with whole_file(path) as file, parquet.ParquetWriter(file.buffer, schema) as writer:
            for part in parts:
                writer.write_table(parquet.read_table(part).replace_schema_metadata(dict(metadata)))

    def _ends(self) -> list[tuple[int, int]]:
        """Return the first and the last member of each chunk that is there, in their order."""
        names = sorted(part.stem for part in self._folder.glob("*.parquet"))
        return [(int(first), int(last)) for first, last in (name.split("-") for name in names)]


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
            _require_same(folder, identity)
            for file in folder.glob(f"*{UNFINISHED}"):
                file.unlink()
            kept = Kept(folder, count)
            yield kept
            done = not kept.missing()
    except FolderHeld as reason:
        raise BadInput(f"--out: expected {reason}") from None
    if done:
        shutil.rmtree(folder)


def is_whole(path: Path, identity: str) -> bool:
    """Return whether a file is there and has all members of this sweep."""
    try:
        metadata = parquet.read_schema(path).metadata or {}
    except (OSError, pa.ArrowInvalid):
        return False
    return bool(metadata.get(IDENTITY.encode()) == identity.encode())


def _require_same(folder: Path, identity: str) -> None:
    """Note of what sweep the parts are, or refuse those of another."""
    note = folder / "sweep.json"
    if not note.exists():
        write_whole(note, json.dumps({IDENTITY: identity}).encode() + b"\n")
    elif json.loads(note.read_bytes())[IDENTITY] != identity:
        expected = f"a file without parts of another sweep, or of other code, in {folder}"
        raise BadInput(f"--out: expected {expected}, got some: remove them, or name another file")
