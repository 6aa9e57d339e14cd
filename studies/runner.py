"""Runs the cases of studies on all cores, keeps every finished one at once, and resumes where it stopped.

A study's folder holds ``rows.jsonl`` (a line per finished case), ``curves/KEY.npz`` and ``sidecar.json``.
"""

import json
import os
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, as_completed
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module
from pathlib import Path
from typing import cast

import numpy as np
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

from engine_models.engine import ProcessTaken, SimulationFailed, UnsupportedScene
from studies.case import Case, Curves, Row, Study
from studies.execution import OUT_OF_MEMORY, CaseEnded, RunBroken
from studies.execution_processes import Processes
from studies.execution_worker import LIMITS_MEMORY
from studies.provenance import fingerprint, sidecar

#: Makes an executor for as long as it is needed; or lends one that lives longer.
Executors = Callable[[], AbstractContextManager[Executor]]

#: The studies by name. A new study is a new file and a line here.
STUDIES = {
    "agreement": "studies.agreement",
    "clearance": "studies.clearance",
    "work-precision": "studies.work_precision",
    "energy": "studies.energy",
    "predictability": "studies.predictability",
    "stability": "studies.stability",
    "extremes": "studies.extremes",
}


def run_studies(
    names: list[str], full: bool, jobs: int, out: Path, executor: Executors | None = None
) -> None:
    """Run the named studies into ``out/NAME``, skipping every case that is there already.

    Cases run in ``jobs`` processes of this machine, the same for all studies since each takes two seconds to
    import what it needs, or on what ``executor`` makes.

    Raises:
        RunBroken: the cases cannot go on, or the rows kept are no rows.
    """
    with Processes(jobs) as pool:
        here: Executors = lambda: nullcontext(pool)  # noqa: E731
        for name in names:
            run_study(name, _study(name).cases(full), out / name, executor or here, here)
            facts = {**sidecar(name, full), "memory_limits_enforced": LIMITS_MEMORY}
            _replace_text(out / name / "sidecar.json", json.dumps(facts, indent=2) + "\n")


def run_study(
    name: str,
    cases: list[Case],
    folder: Path,
    executor: Executors,
    processes: Executors = lambda: Processes(1),
) -> None:
    """Run the cases that ``folder`` lacks, with a progress bar and at the end a line that counts failures.

    Ordinary cases run on any ``concurrent.futures`` executor; then those with limits in ``processes`` of this
    machine; then the timed ones in a process of their own, one at a time and with nothing beside them.

    Raises:
        RunBroken: as ``run_studies``.
    """
    (folder / "curves").mkdir(parents=True, exist_ok=True)
    rows = folder / "rows.jsonl"
    wanted = {case.key(fingerprint()): case for case in cases}
    statuses = {key: status for key, status in _finished(rows).items() if key in wanted}
    pending = {key: case for key, case in wanted.items() if key not in statuses}
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    progress = Progress(*columns, console=Console(stderr=True), disable=not pending)
    with progress, rows.open("a", encoding="utf-8") as file:
        bar = progress.add_task(name, total=len(wanted), completed=len(statuses))

        def keep(key: str, row: Row, curves: Curves) -> None:
            if curves:
                np.savez_compressed(folder / "curves" / f"{key}.npz", **curves)  # type: ignore[arg-type]
            file.write(json.dumps({"case": key, "fingerprint": fingerprint(), **row}) + "\n")
            file.flush()
            os.fsync(file.fileno())
            statuses[key] = str(row["status"])
            progress.advance(bar)

        for some, make in _phases(pending, executor, processes):
            _run(some, make, keep)
    failures = Counter(status for status in statuses.values() if status != "ok")
    counts = [f"{len(wanted)} cases", *(f"{n} {status}" for status, n in failures.most_common())]
    progress.console.print(f"{name}: {', '.join(counts)}", highlight=False)


def _phases(
    cases: dict[str, Case], executor: Executors, processes: Executors
) -> Iterator[tuple[dict[str, Case], Executors]]:
    """Split cases into those that may run beside each other, and where.

    Of those, one of every scene, engine and arm comes first, in the order of their keys, which is as good as
    random: cases that start together and share a kernel would both compile it.
    """
    timed = {key: case for key, case in cases.items() if case.timed}
    groups: list[dict[str, Case]] = [{}, {}, timed]
    alike: Counter[tuple[str, str, str]] = Counter()
    turns = {}
    for key in sorted(cases.keys() - timed.keys()):
        kind = cases[key].scene.name, cases[key].engine, cases[key].arm
        turns[key] = alike[kind]
        alike[kind] += 1
    for key in sorted(turns, key=lambda key: turns[key]):
        groups[1 if cases[key].limits else 0][key] = cases[key]
    makers: tuple[Executors, ...] = (executor, processes, lambda: Processes(1))
    return ((group, make) for group, make in zip(groups, makers, strict=True) if group)


def _run(cases: dict[str, Case], make: Executors, keep: Callable[[str, Row, Curves], None]) -> None:
    """Run cases and keep each as soon as it is finished; whatever stops that stops those at work."""
    with make() as pool:
        try:
            futures = {_submitted(pool, case): key for key, case in cases.items()}
            for future in as_completed(futures):
                key = futures.pop(future)
                try:
                    row, curves = future.result()
                except CaseEnded as end:
                    row, curves = {**cases[key].head(), "status": end.status, "reason": end.reason}, {}
                except ProcessTaken as refusal:
                    row, curves = {**cases[key].head(), "status": "unsupported", "reason": str(refusal)}, {}
                keep(key, row, curves)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _submitted(pool: Executor, case: Case) -> "Future[tuple[Row, Curves]]":
    if isinstance(pool, Processes):
        return pool.submit_within(case.limits, run_case, case)
    return pool.submit(run_case, case)


def run_case(case: Case) -> tuple[Row, Curves]:
    """Run one case; what the engine refuses or fails at becomes a row with ``status`` and ``reason``.

    Raises:
        ProcessTaken: another process could run it.
        RunBroken: there is a bug in the study or an engine's model.
    """
    try:
        measured, curves = _study(case.study).measure(case)
    except ProcessTaken:
        raise  # no answer yet: executors try it in another process
    except UnsupportedScene as refusal:
        return {**case.head(), "status": "unsupported", "reason": str(refusal)}, {}
    except SimulationFailed as failure:
        return {**case.head(), "status": "failed", "reason": str(failure)}, {}
    except MemoryError as error:
        limit = f" (limit {case.limits.memory_limit_bytes} bytes)" if case.limits else ""
        return {**case.head(), "status": OUT_OF_MEMORY, "reason": f"{error or 'no memory left'}{limit}"}, {}
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        bug = f"bug at {Path(place.filename).name}:{place.lineno}: {type(error).__name__}: {error}"
        raise RunBroken(f"{case.engine} ({case.arm}) on {case.scene.name}: {bug}") from error
    return {**case.head(), "status": "ok", "reason": "", **measured}, curves


def _study(name: str) -> Study:
    """Return a study by its name here, or by the import path of its module."""
    return cast(Study, import_module(STUDIES.get(name, name)))


def _finished(rows: Path) -> dict[str, str]:
    """Return key and status of the rows made by the present code; others move to ``rows.previous.jsonl``.

    A last line that a kill cut short is dropped.
    """
    if not rows.exists():
        return {}
    try:
        text = rows.read_text(encoding="utf-8")
        lines = [line for line in text.splitlines(keepends=True) if line.endswith("\n")]
        kept = [line for line in lines if json.loads(line)["fingerprint"] == fingerprint()]
    except (ValueError, KeyError, TypeError):
        message = f"{rows}: expected a row of results in every line, got something else: move the file away"
        raise RunBroken(message) from None
    if len(kept) < len(lines):
        rows.replace(rows.with_name("rows.previous.jsonl"))
    _replace_text(rows, "".join(kept))
    return {row["case"]: row["status"] for row in map(json.loads, kept)}


def _replace_text(path: Path, text: str) -> None:
    new = path.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)
