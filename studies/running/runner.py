"""Runs the cases of studies on all cores, keeps every finished one at once, and resumes where it stopped.

A study's folder holds what ``studies.running.finished_cases`` keeps there, and ``sidecar.json``.
"""

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import AbstractContextManager, ExitStack, nullcontext
from itertools import cycle
from pathlib import Path
from typing import ParamSpec, TypeVar, cast

from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

from engine_models import engines
from studies.running.case import Case, Curves, Row
from studies.running.execution import NO_RESULT, NOT_BEGUN, ROOMY, LimitedExecutor, Limits, RunBroken
from studies.running.failures import progress_console
from studies.running.finished_cases import Rows, checksum, opened
from studies.running.outcome import load_study, outcome, run_case
from studies.running.processes import Processes
from studies.running.provenance import changed_code, code_of, fingerprint, sidecar
from studies.running.whole_file import write_whole
from studies.running.worker import LIMITS_MEMORY

#: Makes an executor for as long as it is needed; or lends one that lives longer.
Executors = Callable[[], AbstractContextManager[Executor]]
Result = Future[tuple[Row, Curves]]


P = ParamSpec("P")
T = TypeVar("T")

#: How often a run looks whether its code has changed, in s; and how many cases in succession whose process
#: cannot begin break it.
LOOK_S, HOPELESS = 1.0, 3
#: Of the files that changed, how many are named.
SHOWN_FILES = 3


class Lanes(LimitedExecutor):
    """Processes in two lanes: of studies that follow each other one runs in each, in its own half of them.

    So what one compiles for long, or cannot share with others in a process, does not stop the next one. The
    last two, or three, use both, so that none is idle at the end.
    """

    def __init__(self, jobs: int, studies: Sequence[str]) -> None:
        sizes = (jobs - jobs // 2, jobs // 2) if jobs > 1 and len(studies) > 1 else (jobs,)
        self._pools = [Processes(size) for size in sizes]
        paired = studies[: max(0, len(studies) - 2) // 2 * 2]
        own = {study: [self._pools[place % len(sizes)]] for place, study in enumerate(paired)}
        self._turns = {study: cycle(own.get(study, self._pools)) for study in studies}

    def submit_within(
        self, limits: Limits | None, call: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> "Future[T]":
        """Run a call on a case, its last argument, in a lane of its study."""
        pool = next(self._turns[cast(Case, args[-1]).study])
        return pool.submit_within(limits, call, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls, as ``Processes.shutdown`` does."""
        for pool in self._pools:
            pool.shutdown(wait, cancel_futures=cancel_futures)


def lent(pool: Executor) -> Executors:
    """Return what lends an executor that lives longer."""
    return lambda: nullcontext(pool)


def run_studies(
    names: list[str],
    full: bool,
    jobs: int,
    out: Path,
    executor: Executors | None = None,
    retry_failed: bool = False,
    only: Collection[str] = (),
) -> None:
    """Run the named studies into ``out/NAME``, skipping every case that is there already.

    Cases run in ``jobs`` processes of this machine, the same for all studies since each takes two seconds to
    import what it needs (see ``Lanes``), or on what ``executor`` makes. All folders are held before any work
    is done. If engines are named, ``only`` theirs are run.

    Raises:
        FolderHeld: another run holds one of the folders.
        DamagedRows: the rows kept are no rows.
        RunBroken: the cases cannot go on.
        OSError: a folder cannot be written.
    """
    with ExitStack() as stack:
        cases = {name: load_study(name).cases(full) for name in names}
        folders = {name: stack.enter_context(_rows(name, cases[name], out / name)) for name in names}
        facts = {name: sidecar(name, full, _engines(cases[name])) for name in names}
        local = lent(stack.enter_context(Lanes(jobs, names)))
        asked = {name: [case for case in of if not only or case.engine in only] for name, of in cases.items()}

        def finish(name: str) -> None:
            digest = folders[name].digest()
            content = {**facts[name], "memory_limits_enforced": LIMITS_MEMORY, "rows": digest}
            content["checksum"] = checksum(content)
            write_whole(out / name / "sidecar.json", json.dumps(content, indent=2).encode() + b"\n")

        _run_all(asked, folders, executor or local, local, retry_failed, finish)


def run_study(
    name: str,
    cases: list[Case],
    folder: Path,
    executor: Executors,
    processes: Executors = lambda: Processes(1),
    retry_failed: bool = False,
) -> None:
    """Run the cases that ``folder`` lacks, with a progress bar and at the end a line that counts failures.

    Ordinary cases run on any ``concurrent.futures`` executor; then those with limits of their own in
    ``processes`` of this machine; then the timed ones in a process of their own, one at a time and with
    nothing beside them. So is one run again whose process was killed from outside. ``retry_failed`` runs
    again what is there but neither finished nor was refused.

    Raises:
        FolderHeld, DamagedRows, RunBroken, OSError: as ``run_studies``.
    """
    with _rows(name, cases, folder) as rows:
        _run_all({name: cases}, {name: rows}, executor, processes, retry_failed)


def _rows(name: str, cases: list[Case], folder: Path) -> AbstractContextManager[Rows]:
    """Open the rows of a study's folder: those of all engines, not only of these cases."""
    codes = {engine: fingerprint(name, engine) for engine in (*engines.ENGINES, *_engines(cases))}
    return opened(folder, codes)


def _engines(cases: list[Case]) -> list[str]:
    """Return the engines of cases, each once."""
    return list(dict.fromkeys(case.engine for case in cases))


def _run_all(
    cases: Mapping[str, list[Case]],
    folders: Mapping[str, Rows],
    executor: Executors,
    processes: Executors,
    retry_failed: bool,
    finish: Callable[[str], None] = lambda _: None,
) -> None:
    """Run the cases of studies that their folders lack: those of all that may run beside each other first.

    ``finish`` is called with a study's name as soon as it lacks none.
    """
    wanted = {name: {case.key(_fingerprint(case)): case for case in of} for name, of in cases.items()}
    lacking = {
        name: {key: case for key, case in of.items() if folders[name].lacks(key, retry_failed)}
        for name, of in wanted.items()
    }
    study_of = {key: name for name, of in lacking.items() for key in of}
    pending = {key: case for of in lacking.values() for key, case in of.items()}
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    progress = Progress(*columns, console=progress_console(), disable=not pending)
    with progress:
        bars = {
            name: progress.add_task(name, total=len(of), completed=len(of) - len(lacking[name]))
            for name, of in wanted.items()
        }

        left = {name: len(of) for name, of in lacking.items()}

        def keep(key: str, row: Row, curves: Curves) -> None:
            name = study_of[key]
            folders[name].keep(key, row, curves)
            progress.advance(bars[name])
            left[name] -= 1
            if not left[name]:
                finish(name)

        for name in (name for name, count in left.items() if not count):
            finish(name)

        for some, make in _phases(pending, executor, processes):
            if again := _run(some, make, keep):
                _run(again, lambda: Processes(1), keep, last=True)
    for name, of in wanted.items():
        ended = folders[name].statuses()
        failures = Counter(ended[key] for key in of if ended[key] != "ok")
        counts = [f"{len(of)} cases", *(f"{n} {status}" for status, n in failures.most_common())]
        progress.console.print(f"{name}: {', '.join(counts)}", highlight=False)


def _phases(
    cases: dict[str, Case], executor: Executors, processes: Executors
) -> Iterator[tuple[dict[str, Case], Executors]]:
    """Split cases into those that may run beside each other, and where.

    Of those of a study, one of every scene, engine and arm comes first, in the order of their keys, which is
    as good as random: of cases that start together and share a kernel one would wait for the other.
    """
    timed = {key: case for key, case in cases.items() if case.timed}
    alike: Counter[tuple[str, str, str]] = Counter()
    turns = {}
    for key in sorted(cases.keys() - timed.keys()):
        kind = cases[key].scene.name, cases[key].engine, cases[key].arm.name
        turns[key] = alike[kind]
        alike[kind] += 1
    place = {study: place for place, study in enumerate(dict.fromkeys(case.study for case in cases.values()))}
    order = sorted(turns, key=lambda key: (place[cases[key].study], bool(cases[key].limits), turns[key]))
    beside = {key: cases[key] for key in order}
    here = {key: case for key, case in beside.items() if case.limits or executor is processes}
    others = {key: case for key, case in beside.items() if key not in here}
    phases = ((others, executor), (here, processes), (timed, lambda: Processes(1)))
    return ((group, make) for group, make in phases if group)


def _run(
    cases: dict[str, Case], make: Executors, keep: Callable[[str, Row, Curves], None], last: bool = False
) -> dict[str, Case]:
    """Run cases, keep each as soon as it is finished, and return those that ended without a result.

    The ``last`` time these are kept too. Whatever stops the run stops the cases at work.

    Raises:
        RunBroken: no process can begin, or the code is no longer what was imported.
    """
    again: dict[str, Case] = {}
    begun, unbegun = False, 0
    with make() as pool:
        try:
            futures = {key: _submitted(pool, case) for key, case in cases.items()}
            for key, future in _as_done(cases, futures):
                row, curves = outcome(cases[key], future)
                begun = begun or row["status"] != NOT_BEGUN
                unbegun += not begun
                if unbegun == HOPELESS:
                    raise RunBroken(f"no process can begin: {row['reason']}")
                if row["status"] in NO_RESULT and not last:
                    again[key] = cases[key]
                else:
                    keep(key, row, curves)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return again


def _submitted(pool: Executor, case: Case) -> Result:
    if isinstance(pool, LimitedExecutor):
        return pool.submit_within(case.limits or ROOMY, _run_case_by, _fingerprint(case), case)
    return pool.submit(_run_case_by, _fingerprint(case), case)


def _as_done(cases: dict[str, Case], futures: dict[str, Result]) -> Iterator[tuple[str, Result]]:
    """Yield the futures of cases when they are done, as long as the code is what was imported."""
    code, looked = code_of({(case.study, case.engine) for case in cases.values()}), -math.inf
    while futures:
        done, _ = wait(futures.values(), LOOK_S, FIRST_COMPLETED)
        files = []
        if time.monotonic() >= looked + LOOK_S or any(map(_broken, done)):
            files, looked = changed_code(code), time.monotonic()
        if files:
            shown = ", ".join(files[:SHOWN_FILES]) + ", ..." * (len(files) > SHOWN_FILES)
            raise RunBroken(
                f"the code changed under the run ({shown}): what was finished is kept, run it again"
            )
        for key in [key for key, future in futures.items() if future in done]:
            yield key, futures.pop(key)


def _broken(future: Result) -> bool:
    """Return whether a process refused a case, which it does where its code is other than the run's."""
    return not future.cancelled() and isinstance(future.exception(), RunBroken)


def _run_case_by(code: str, case: Case) -> tuple[Row, Curves]:
    """Run a case if this process has imported that code."""
    if (other := _fingerprint(case)) != code:
        raise RunBroken(f"a process has other code or libraries ({other}) than the run ({code})")
    return run_case(case)


def _fingerprint(case: Case) -> str:
    return fingerprint(case.study, case.engine)
