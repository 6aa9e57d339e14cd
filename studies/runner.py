"""Runs the cases of studies on all cores or a cluster, keeps every row at once, and resumes."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

from studies.case import Case, Curves, Row, code_of, ended, load_study, provenance, run_case
from studies.failures import Failed, progress_console
from studies.store import Store
from studies.workers import KILLED, Ended, Pool


class Workers(Protocol):
    """What runs calls on items, each within its ``limit_s``: ``Pool``, or ``cluster.Cluster``."""

    def results(self, call: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[tuple[Any, Any]]:
        """Yield every item and what its call gave, or ``Ended``, as it ends."""
        ...


def run_studies(
    names: Sequence[str],
    full: bool,
    out: Path,
    workers: Workers,
    retry_failed: bool = False,
    only: Collection[str] = (),
) -> None:
    """Run the named studies, of some engines only if any are named, into the store in ``out``."""
    cases = {name: load_study(name).cases(full) for name in names}
    with Store(out) as store, store.held():
        for name in names:
            store.describe(name, provenance(full, cases[name]))
        asked = {name: [case for case in of if not only or case.engine in only] for name, of in cases.items()}
        run_cases(asked, store, workers, retry_failed)


def run_cases(
    cases: Mapping[str, Sequence[Case]],
    store: Store,
    workers: Workers,
    retry_failed: bool = False,
) -> None:
    """Run the cases that a store lacks, with a progress bar a study, and a line that counts its failures.

    Timed cases run in a process of this machine with nothing beside it, after all others. So is one run again
    whose process was killed from outside. ``retry_failed`` runs again what neither finished nor was refused.

    Raises:
        Failed: the cases cannot go on; what was finished is kept.
    """
    there = store.statuses()
    wanted = {name: {case.key: case for case in of} for name, of in cases.items()}
    lacking = {
        key: case for of in wanted.values() for key, case in of.items() if lacks(there.get(key), retry_failed)
    }
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    progress = Progress(*columns, console=progress_console(), disable=not lacking)
    bars = {
        name: progress.add_task(name, total=len(of), completed=len(of.keys() - lacking.keys()))
        for name, of in wanted.items()
    }
    again: list[Case] = []
    with progress:

        def run(some: Sequence[Case], where: Workers, last: bool) -> None:
            for call, result in where.results(Call.answer, [Call(case) for case in some]):
                case, died = call.case, isinstance(result, Ended)
                row, curves = (ended(case, result.status, result), {}) if died else result
                if row["status"] == KILLED and not last:
                    again.append(case)
                else:
                    store.keep(case.key, call.code, row, curves)
                    progress.advance(bars[case.study])

        beside = [lacking[key] for key in sorted(lacking) if not lacking[key].timed]  # as good as random
        run(beside, workers, last=False)
        with Pool(1) as alone:
            run([*again, *(case for case in lacking.values() if case.timed)], alone, last=True)
    ended_as = store.statuses()
    for name, of in wanted.items():
        failures = Counter(ended_as[key] for key in of if ended_as[key] != "ok")
        counts = [f"{len(of)} cases", *(f"{n} {status}" for status, n in failures.most_common())]
        progress.console.print(f"{name}: {', '.join(counts)}", highlight=False)


class Call:
    """A case to be run elsewhere by the code that this process has."""

    def __init__(self, case: Case) -> None:
        self.case, self.limit_s, self.code = case, case.limit_s, code_of(case.engine)

    def answer(self) -> tuple[Row, Curves]:
        """Return the row and the curves of the case."""
        if (other := code_of(self.case.engine)) != self.code:
            todo = "what was finished is kept, run it again"
            raise Failed(
                f"a process has other code or libraries ({other}) than the run ({self.code}): {todo}"
            )
        return run_case(self.case)


def lacks(status: str | None, retry_failed: bool) -> bool:
    """Return whether a run that resumes has to make a case that ended so, None if it is not there."""
    return status in (None, KILLED) or (retry_failed and status not in ("ok", "unsupported"))
