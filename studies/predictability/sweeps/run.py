"""Runs the members of a sweep in chunks, here or on a cluster; what it takes is known before."""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from engine_models.engine import FloatArray
from engine_models.engines import engine_module
from engine_models.memory import free_bytes
from studies.predictability.sweeps.chunk import Chunk, Trial, failed_chunk, run_chunk, try_out
from studies.predictability.sweeps.kept import IDENTITY, Kept, is_whole, opened
from studies.predictability.sweeps.task import Task
from studies.running.case import ROOMY
from studies.running.execution import NO_RESULT, CaseEnded, LimitedExecutor, RunBroken
from studies.running.failures import BadInput, note, progress_console
from studies.running.processes import Processes
from studies.running.provenance import engine_fingerprint

#: Members that are tried before a sweep of more than so many, and how long a chunk shall take, in s.
TRIED, FEW, CHUNK_S = 4, 32, 5.0
#: Members of a chunk at most: what a kill loses, whatever a trial said.
MOST_IN_CHUNK = 5000

Executors = Callable[[], AbstractContextManager[LimitedExecutor]]


@dataclass(frozen=True)
class Sweep:
    """A task, and the values (n,) of the fields that change, by path; ``varied`` are those to look at."""

    task: Task
    changes: Mapping[str, FloatArray]
    varied: tuple[str, ...]

    @property
    def members(self) -> Chunk:
        """All members."""
        return Chunk(0, self.changes)

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
        parts = [code, values, settings, task.engine_name, task.step_s, repr(task.watch), self.varied]
        text = json.dumps([*parts, task.scene.model_dump()], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def run_sweep(
    sweep: Sweep,
    path: Path,
    made_by: Mapping[str, object],
    jobs: int,
    cluster: Executors | None,
    hours: float,
) -> None:
    """Run the members that ``path`` and its parts lack, and write the file once it has all.

    They run in ``jobs`` processes here, or on a ``cluster``, and may take ``hours`` of processor time.

    Raises:
        BadInput: the sweep would take too much, or the parts are another sweep's.
        RunBroken: no member can go on.
        OSError: nothing can be written there.
    """
    identity, members = sweep.identity(), sweep.members
    if is_whole(path, identity):
        note(f"{path} has all {len(members)} members already")
        return
    with opened(path, identity, len(members)) as kept, (cluster or (lambda: Processes(jobs)))() as pool:
        try:
            missing = kept.missing()
            left = sum(end - begin for begin, end in missing)
            size = MOST_IN_CHUNK
            if left > FEW:
                trial = pool.submit_within(ROOMY, try_out, sweep.task, _spread(members)).result()
                _announce(trial, left, jobs, path, cluster is not None, hours)
                size = int(np.clip(CHUNK_S / trial.member_s, 1, MOST_IN_CHUNK))
            chunks = list(_chunks(members, missing, min(size, max(1, -(-left // jobs)))))
            _run(sweep.task, chunks, pool, kept, len(members) - left)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        kept.merge(path, sweep.metadata(made_by))


def _spread(members: Chunk) -> Chunk:
    """Return a few members from all over."""
    places = np.linspace(0, len(members) - 1, TRIED).round().astype(int)
    return Chunk(0, {field: values[places] for field, values in members.changes.items()})


def _chunks(members: Chunk, missing: list[tuple[int, int]], size: int) -> Iterator[Chunk]:
    for begin, end in missing:
        for first in range(begin, end, size):
            yield members.part(first, min(first + size, end))


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


def _run(task: Task, chunks: list[Chunk], pool: LimitedExecutor, kept: Kept, done: int) -> None:
    """Run chunks and keep each as soon as it is finished."""
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=progress_console(), disable=not chunks) as progress:
        bar = progress.add_task("members", total=done + sum(map(len, chunks)), completed=done)
        futures = {_submitted(pool, task, chunk): chunk for chunk in chunks}
        while futures:
            finished, _ = wait(futures, return_when=FIRST_COMPLETED)
            for future in sorted(finished, key=lambda each: futures[each].first):
                chunk = futures.pop(future)
                kept.keep(chunk.first, _rows(pool, task, chunk, future))
                progress.advance(bar, len(chunk))


def _submitted(pool: LimitedExecutor, task: Task, chunk: Chunk) -> "Future[pa.Table]":
    return pool.submit_within(ROOMY, run_chunk, task, chunk)


def _rows(pool: LimitedExecutor, task: Task, chunk: Chunk, future: "Future[pa.Table]") -> pa.Table:
    """Return the rows of a chunk that is done; of one whose process died, every member runs by itself."""
    try:
        return future.result()
    except CaseEnded as end:
        if end.status in NO_RESULT:
            raise RunBroken(f"{end}: what was finished is kept, run it again") from None
        if len(chunk) == 1:
            return failed_chunk(chunk, str(end))
    alone = [chunk.part(place, place + 1) for place in range(len(chunk))]
    futures = [_submitted(pool, task, one) for one in alone]
    return pa.concat_tables(
        [_rows(pool, task, one, its) for one, its in zip(alone, futures, strict=True)]
    ).combine_chunks()
