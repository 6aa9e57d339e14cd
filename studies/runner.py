"""Runs the cases of studies on all cores, keeps every finished one at once, and resumes where it stopped.

A study's folder holds ``rows.jsonl`` (a line per finished case), ``curves/KEY.npz`` and ``sidecar.json``.
"""

import json
import os
import signal
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import cast

import numpy as np
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

from engine_models.engine import SimulationFailed, UnsupportedScene
from studies.case import Case, Curves, Row, Study
from studies.provenance import fingerprint, sidecar

#: The studies by name. A new study is a new file and a line here.
STUDIES = {"agreement": "studies.agreement"}


class RunBroken(Exception):
    """A worker process died, or the rows kept are no rows; what was finished is kept."""


def run_studies(names: list[str], full: bool, jobs: int, out: Path) -> None:
    """Run the named studies into ``out/NAME``, skipping every case that is there already.

    Raises:
        RunBroken: a worker process died.
    """
    for name in names:
        study = cast(Study, import_module(STUDIES[name]))
        run_study(name, study.cases(full), out / name, lambda: _processes(jobs))
        (out / name / "sidecar.json").write_text(json.dumps(sidecar(name, full), indent=2) + "\n")


def _processes(jobs: int) -> Executor:
    # A fresh process per worker; Ctrl-C ends workers silently, the parent reports it.
    return ProcessPoolExecutor(
        jobs, get_context("spawn"), initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_DFL)
    )


def run_study(name: str, cases: list[Case], folder: Path, executor: Callable[[], Executor]) -> None:
    """Run the cases that ``folder`` lacks on any ``concurrent.futures`` executor, with a progress bar."""
    (folder / "curves").mkdir(parents=True, exist_ok=True)
    rows = folder / "rows.jsonl"
    done = _finished(rows)
    pending = {key: case for case in cases if (key := case.key(fingerprint())) not in done}
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    progress = Progress(*columns, console=Console(stderr=True))
    if not pending:
        progress.console.print(f"{name}: all {len(cases)} cases are there")
        return
    with progress, executor() as pool, rows.open("a", encoding="utf-8") as file:
        bar = progress.add_task(name, total=len(cases), completed=len(cases) - len(pending))
        futures = {pool.submit(run_case, case): key for key, case in pending.items()}
        try:
            for future in as_completed(futures):
                row, curves = future.result()
                key = futures[future]
                if curves:
                    np.savez_compressed(folder / "curves" / f"{key}.npz", **curves)  # type: ignore[arg-type]
                file.write(json.dumps({"case": key, "fingerprint": fingerprint(), **row}) + "\n")
                file.flush()
                os.fsync(file.fileno())
                progress.advance(bar)
        except BrokenProcessPool:
            message = f"{name}: a worker process died; finished cases are kept, run again to resume"
            raise RunBroken(message) from None
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def run_case(case: Case) -> tuple[Row, Curves]:
    """Run one case; a refusal or failure of the engine becomes a row with ``status`` and ``reason``."""
    study = cast(Study, import_module(STUDIES[case.study]))
    try:
        measured, curves = study.measure(case)
    except UnsupportedScene as refusal:
        return {**case.head(), "status": "unsupported", "reason": str(refusal)}, {}
    except SimulationFailed as failure:
        return {**case.head(), "status": "failed", "reason": str(failure)}, {}
    return {**case.head(), "status": "ok", "reason": "", **measured}, curves


def _finished(rows: Path) -> set[str]:
    """Return the keys of the rows made by the present code; others move to ``rows.previous.jsonl``.

    A last line that a kill cut short is dropped.
    """
    if not rows.exists():
        return set()
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
    return {json.loads(line)["case"] for line in kept}


def _replace_text(path: Path, text: str) -> None:
    new = path.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)
