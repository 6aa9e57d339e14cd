"""Runs the members of a sweep in chunks, here or on a cluster; what it takes is known before."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import numpy as np
import pyarrow as pa
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from engine_models.engine import FloatArray
from engine_models.engines import engine_module
from engine_models.memory import free_bytes
from studies.predictability.sweeps.chunk import Chunk, Direction, Trial, failed_chunk, run_chunk, try_out
from studies.predictability.sweeps.kept import IDENTITY, Kept, is_whole, opened
from studies.predictability.sweeps.task import Task
from studies.running.execution import NO_RESULT, ROOMY, CaseEnded, LimitedExecutor, RunBroken
from studies.running.failures import BadInput, note, progress_console
from studies.running.processes import Processes
from studies.running.provenance import engine_fingerprint

#: Members that are tried before a sweep of more than so many, and how long a chunk shall take, in s.
TRIED, FEW, CHUNK_S = 4, 32, 5.0
#: Members of a chunk at most: what a kill loses, whatever a trial said; the last are so much smaller.
MOST_IN_CHUNK, PARTS_IN_THE_END = 5000, 16

Executors = Callable[[], AbstractContextManager[LimitedExecutor]]


@dataclass(frozen=True)
class Sweep:
    """A task, and the values (n,) of the fields that change, by path; ``varied`` are those to look at.

    With ``directions`` they are run that way, or both, as chains (see ``chain``).
    """

    task: Task
    changes: Mapping[str, FloatArray]
    varied: tuple[str, ...]
    directions: tuple[Direction, ...] = ()

    @property
    def members(self) -> list[Chunk]:
        """All members: each chain by itself."""
        if not self.directions:
            return [Chunk(0, self.changes)]
        down = {field: values[::-1] for field, values in self.changes.items()}
        ways = {"up": self.changes, "down": down}
        count = len(next(iter(down.values())))
        return [Chunk(k * count, ways[way], way) for k, way in enumerate(self.directions)]

    def __len__(self) -> int:
        return sum(map(len, self.members))

    def metadata(self, made_by: Mapping[str, object]) -> dict[str, str]:
        """Return what goes into the file beside the rows."""
        made = {
            name: value if isinstance(value, str) else json.dumps(value) for name, value in made_by.items()
        }
        return {**made, "varied": json.dumps(self.varied), IDENTITY: self.identity()}

    def identity(self) -> str:
        """Return a hash of all that decides a row, code included."""
        task = self.task
        code = [
            engine_fingerprint(name)
            for name in (engine_module(task.engine_name), "studies.predictability.sweeps.chunk")
        ]
        values = {field: hashlib.sha256(of.tobytes()).hexdigest() for field, of in self.changes.items()}
        settings = {name: repr(value) for name, value in task.settings.items()}
        parts = [
            code,
            values,
            settings,
            task.engine_name,
            task.step_s,
            repr(task.watch),
            self.varied,
            self.directions,
        ]
        text = json.dumps([*parts, task.scene.model_dump()], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def run_sweep(
    sweep: Sweep,
    path: Path,
    made_by: Mapping[str, object],
    jobs: int,
    cluster: Executors | None,
    hours: float,
    begun: LimitedExecutor | None = None,
) -> None:
    """Run the members that ``path`` and its parts lack, and write the file once it has all.

    They run in ``jobs`` processes here, which may have ``begun``, or on a ``cluster``, and may take ``hours``
    of processor time.

    Raises:
        BadInput: the sweep would take too much, or the parts are another sweep's.
        RunBroken: no member can go on.
        OSError: nothing can be written there.
    """
    count, path = len(sweep), Path(os.path.realpath(path))
    identity = sweep.identity()
    if path.exists():
        if is_whole(path, identity, count):
            note(f"{path} has all {count} members already")
            return
        note(f"{path} has not all {count} members as this sweep wrote them: it is made again")
    at_once = min(jobs, len(sweep.directions) or jobs)
    with cluster() if cluster else begun or Processes(at_once) as pool:
        try:
            # Every process here tries them: so all begin, and load what they need, while the code is hashed.
            tried = range((1 if cluster else at_once) if count > FEW else 0)
            trials = [pool.submit_within(ROOMY, try_out, sweep.task, _spread(sweep.changes)) for _ in tried]
            with opened(path, identity, count) as kept:
                left = sum(end - begin for begin, end in kept.missing())
                size = MOST_IN_CHUNK
                if left > FEW:
                    trial = trials[0].result()
                    _announce(trial, left, at_once, path, cluster is not None, hours)
                    size = int(np.clip(CHUNK_S / trial.member_s, 1, MOST_IN_CHUNK))
                rows = [_rows(members, kept, size, at_once) for members in sweep.members]
                _run(sweep.task, [row for each in rows for row in each], pool, kept, count - left)
                kept.merge(path, sweep.metadata(made_by))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _spread(changes: Mapping[str, FloatArray]) -> Chunk:
    """Return a few members from all over."""
    count = len(next(iter(changes.values())))
    places = np.linspace(0, count - 1, TRIED).round().astype(int)
    return Chunk(0, {field: values[places] for field, values in changes.items()})


def _rows(members: Chunk, kept: Kept, size: int, at_once: int) -> list[list[Chunk]]:
    """Return what is missing of some members in chunks, those in a row to be run one after another."""
    end = members.first + len(members)
    stretches = [(max(begin, members.first), min(last, end)) for begin, last in kept.missing()]
    left = sum(max(0, last - begin) for begin, last in stretches)
    sizes = repeat(size) if members.direction else _shrinking(left, size, at_once)
    chunks = []
    for begin, last in stretches:
        while begin < last:
            next_begin = min(begin + next(sizes), last)
            chunks.append(members.part(begin - members.first, next_begin - members.first))
            begin = next_begin
    if members.direction is None:
        return [[chunk] for chunk in chunks]
    if chunks and chunks[0].first > members.first:
        chunks[0] = chunks[0].after(kept.schema_before(chunks[0].first))
    return [chunks] if chunks else []


def _shrinking(left: int, most: int, at_once: int) -> Iterator[int]:
    """Yield sizes of chunks that shrink as less is left, so that in the end no process waits for another."""
    least = max(1, min(left, most) // PARTS_IN_THE_END)
    while True:
        size = max(least, min(most, left // (2 * at_once)))
        yield size
        left -= size


def _announce(trial: Trial, left: int, jobs: int, path: Path, elsewhere: bool, hours: float) -> None:
    """Say what a sweep will take, or refuse it."""
    seconds, disk = left * trial.member_s, 2 * left * trial.row_bytes  # in parts, then in one file
    where = "on the cluster" if elsewhere else f"on {jobs} cores: about {_duration(seconds / jobs)}"
    memory = 0 if elsewhere else jobs * trial.process_bytes
    note(
        f"{left} members of {1e3 * trial.member_s:.3g} ms each, {_duration(seconds)} of processor time "
        f"{where}; up to {disk / 1e6:.3g} MB of disk, {memory / 1e9:.2g} GB of memory"
    )
    if seconds > 3600 * hours:
        needed = f"at least {seconds / 3600:.3g} for {left} members of {trial.member_s:.3g} s"
        raise BadInput(f"--hours: expected {needed}, got {hours:g}")
    if disk > (free := shutil.disk_usage(path.parent).free):
        raise BadInput(f"--out: expected {disk / 1e9:.3g} GB free on the disk, got {free / 1e9:.3g} GB")
    if (more := memory - trial.process_bytes) > (free := free_bytes()):
        raise BadInput(f"--jobs: expected {more / 1e9:.3g} GB of free memory, got {free / 1e9:.3g} GB")


def _duration(seconds: float) -> str:
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds:.3g} s"


def _run(task: Task, rows: list[list[Chunk]], pool: LimitedExecutor, kept: Kept, done: int) -> None:
    """Run rows of chunks, each of them one after another, and keep each chunk as soon as it is finished."""
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    left = sum(len(chunk) for row in rows for chunk in row)
    with Progress(*columns, console=progress_console(), disable=not rows) as progress:
        bar = progress.add_task("members", total=done + left, completed=done)
        futures = {_submitted(pool, task, row[0]): row for row in rows}
        while futures:
            finished, _ = wait(futures, return_when=FIRST_COMPLETED)
            for future in sorted(finished, key=lambda each: futures[each][0].first):
                first, *others = futures.pop(future)
                table = _table(task, first, future)
                if table is None:
                    others = [first.part(place, place + 1) for place in range(len(first))] + others
                else:
                    kept.keep(first.first, table)
                    progress.advance(bar, len(first))
                    if others and first.direction:
                        others[0] = others[0].after(kept.schema_before(others[0].first))
                if others:
                    futures[_submitted(pool, task, others[0])] = others


def _submitted(pool: LimitedExecutor, task: Task, chunk: Chunk) -> "Future[pa.Table]":
    return pool.submit_within(ROOMY, run_chunk, task, chunk)


def _table(task: Task, chunk: Chunk, future: "Future[pa.Table]") -> pa.Table | None:
    """Return the rows of a chunk that is done; None of one whose process died: its members run alone."""
    try:
        return future.result()
    except CaseEnded as end:
        if end.status in NO_RESULT:
            raise RunBroken(f"{end}: what was finished is kept, run it again") from None
        return failed_chunk(task, chunk, str(end)) if len(chunk) == 1 else None
