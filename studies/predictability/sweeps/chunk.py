"""Runs some members of a sweep in one process, and makes a table of their rows."""

import json
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import pandas as pd
import pyarrow as pa

from engine_models.engine import FloatArray
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.members import LISTS, failed, numbers_of, run_members, supports
from engine_models.scene.scene import Scene
from studies.predictability.sweeps.chain import Places, run_chain
from studies.predictability.sweeps.gathered import row_of
from studies.predictability.sweeps.task import Task

Direction = Literal["up", "down"]
#: Where the metadata of a chunk's rows have where its last member has ended.
PLACES = b"places"


@dataclass(frozen=True)
class Chunk:
    """Members from number ``first`` on, and the values (n,) of every field that changes, by its path.

    Those of a chain have its ``direction``, and begin where the one before them ended (see ``chain``).
    """

    first: int
    changes: Mapping[str, FloatArray]
    direction: Direction | None = None
    places: Places | None = None

    def __len__(self) -> int:
        return len(next(iter(self.changes.values())))

    def part(self, begin: int, end: int) -> "Chunk":
        """Return the members from place ``begin`` to before ``end`` of this chunk."""
        changes = {field: values[begin:end] for field, values in self.changes.items()}
        return replace(self, first=self.first + begin, changes=changes)

    def after(self, before: pa.Schema) -> "Chunk":
        """Return this chunk of a chain as it goes on from the one before it, whose rows have this schema."""
        return replace(self, places=json.loads(before.metadata[PLACES]))


@dataclass(frozen=True)
class Trial:
    """What a member costs: processor time in s, bytes of its row; and bytes of a process that runs some."""

    member_s: float
    row_bytes: float
    process_bytes: int


def run_chunk(task: Task, chunk: Chunk) -> pa.Table:
    """Return the rows of a chunk, a member each; the reference runs them together where it can."""
    if chunk.direction:
        own, places = run_chain(task, [*_members(chunk)], chunk.places)
        return table_of(task, chunk, pd.DataFrame(own), places)
    engine, scene = task.engine, task.scene
    if (
        isinstance(engine, ReferenceEngine)
        and isinstance(scene, Scene)
        and supports(engine, scene, [*chunk.changes])
    ):
        rows = run_members(engine, scene, chunk.changes, task.watch, step_s=task.step_s)
    else:
        rows = pd.DataFrame([row_of(task, values) for values in _members(chunk)])
    return table_of(task, chunk, rows)


def failed_chunk(task: Task, chunk: Chunk, reason: str) -> pa.Table:
    """Return the rows of a chunk all of whose members failed, for one reason."""
    rows = [failed(reason, numbers_of(task.scene))] * len(chunk)
    return table_of(task, chunk, pd.DataFrame(rows), chunk.places)


def try_out(task: Task, chunk: Chunk) -> Trial:
    """Return what members like those of a chunk cost here."""
    run_chunk(task, chunk.part(0, 1))  # which compiles what the engine compiles
    began = time.process_time()
    table = run_chunk(task, chunk)
    elapsed = time.process_time() - began
    return Trial(elapsed / len(chunk), table.nbytes / len(chunk), _most_bytes())


def schema(task: Task, fields: Iterable[str], chained: bool = False) -> pa.Schema:
    """Return names and types of the columns of a sweep in which these fields change."""
    numbers, lists = pa.float64(), pa.list_(pa.float64())
    return pa.schema(
        [
            ("member", pa.int64()),
            *([("direction", pa.string())] if chained else []),
            *((field, numbers) for field in fields),
            ("status", pa.string()),
            ("reason", pa.string()),
            *((name, numbers) for name in numbers_of(task.scene)),
            *((name, lists) for name in LISTS),
        ]
    )


def table_of(task: Task, chunk: Chunk, rows: pd.DataFrame, places: Places | None = None) -> pa.Table:
    """Return the rows of a chunk with their numbers and values before them; a NaN is nothing."""
    head: dict[str, object] = {"member": range(chunk.first, chunk.first + len(chunk)), **chunk.changes}
    if chunk.direction is None:
        return pa.Table.from_pandas(rows.assign(**head), schema(task, chunk.changes), preserve_index=False)
    head["direction"] = chunk.direction
    columns = schema(task, chunk.changes, chained=True).with_metadata({PLACES: json.dumps(places)})
    return pa.Table.from_pandas(rows.assign(**head), columns, preserve_index=False)


def _members(chunk: Chunk) -> Iterator[dict[str, float]]:
    columns = (values.tolist() for values in chunk.changes.values())
    for values in zip(*columns, strict=True):
        yield dict(zip(chunk.changes, values, strict=True))


def _most_bytes() -> int:
    """Return the most memory that this process has had; 0 where the machine does not tell."""
    if sys.platform == "win32":
        return 0
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
