"""Runs the cases of studies on all cores or a cluster, keeps every row at once, and resumes."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.progress import Progress

from studies.case import Case, Curves, Row, code_of, ended, provenance, run_case
from studies.failures import Failed, progress_console
from studies.running.store import Store
from studies.running.workers import KILLED, Ended, Pool


def run_cases(
    studies: Mapping[str, Sequence[Case]],
    folder: Path,
    workers: Any,
    full: bool = False,
    engines: Sequence[str] = (),
    retry_failed: bool = False,
) -> None:
    """Run the cases of studies that a folder lacks, of some engines only if any are named, by ``workers``.

    There is a progress bar a study, and a line that counts its failures. Timed cases run in a process of this
    machine with nothing beside it, after all others. So is one run again whose process was killed from
    outside. ``retry_failed`` runs again what neither finished nor was refused.
    """
    with Store(folder) as store, store.held():
        there, wanted, again = store.statuses(), dict[str, dict[str, Case]](), list[str]()
        for name, cases in studies.items():
            store.describe(name, provenance(full, cases))
            wanted[name] = {case.key: case for case in cases if not engines or case.engine in engines}
        every = {key: case for asked in wanted.values() for key, case in asked.items()}
        lacking = {key: every[key] for key in every if lacks(there.get(key), retry_failed)}
        with Progress(console=progress_console(), disable=not lacking) as progress:
            bars = {
                name: progress.add_task(name, total=len(asked), completed=len(asked.keys() - lacking))
                for name, asked in wanted.items()
            }

            def run(keys: Iterable[str], where: Any, last: bool) -> None:
                for call, result in where.results(Call.answer, [Call(key, lacking[key]) for key in keys]):
                    died = isinstance(result, Ended)
                    row, curves = (ended(call.case, result.status, result), {}) if died else result
                    if row["status"] == KILLED and not last:
                        again.append(call.key)
                    else:
                        store.keep(call.key, call.code, row, curves)
                        progress.advance(bars[call.case.study])

            timed = [key for key in lacking if lacking[key].timed]
            run(sorted(lacking.keys() - timed), workers, False)  # as good as random
            with Pool(1) as alone:
                run([*again, *timed], alone, True)
        there = store.statuses()
        for name, asked in wanted.items():
            failures = Counter(there[key] for key in asked if there[key] != "ok")
            counts = [f"{len(asked)} cases", *(f"{n} {status}" for status, n in failures.most_common())]
            progress.console.print(f"{name}: {', '.join(counts)}", highlight=False)


class Call:
    """A case to be run elsewhere by the code that this process has."""

    def __init__(self, key: str, case: Case) -> None:
        self.key, self.case, self.limit_s, self.code = key, case, case.limit_s, code_of(case.engine)

    def answer(self) -> tuple[Row, Curves]:
        """Return the row and the curves of the case."""
        if (other := code_of(self.case.engine)) != self.code:
            differ = f"a process has other code or libraries ({other}) than the run ({self.code})"
            raise Failed(f"{differ}: what was finished is kept, run it again")
        return run_case(self.case)


def lacks(status: str | None, retry_failed: bool) -> bool:
    """Return whether a run that resumes has to make a case that ended so, None if it is not there."""
    return status in (None, KILLED) or (retry_failed and status not in ("ok", "unsupported"))
