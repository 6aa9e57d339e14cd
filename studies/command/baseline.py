"""Baselines: numbers of configurations are compared with tables, or written to them."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.progress import Progress

from studies.conformance.baselines.accept import Numbers, accepted, measure_all
from studies.conformance.baselines.measured import Key, NotMeasured
from studies.conformance.baselines.subjects import Subject
from studies.conformance.baselines.table import Baseline, DamagedTable, read_tables, write_tables
from studies.conformance.baselines.verdicts import verdicts
from studies.running.failures import BadInput, Failed, note, progress_console, writing
from studies.running.whole_file import require_folder


@dataclass(frozen=True)
class Gate:
    """Configurations, and the folder of the tables with which they are compared."""

    subjects: Sequence[Subject]
    folder: Path

    def require_place(self, accept: bool) -> None:
        """Raise BadInput if there is no table to compare with, or if ``accept`` cannot write one."""
        if accept:
            with writing("--baselines", self.folder):
                require_folder(self.folder)
        elif not any(self.folder.glob("*.csv")):
            todo = '--accept --why "..." writes them'
            raise BadInput(f"--baselines: expected a folder with tables, got '{self.folder}': {todo}")

    def hold_or_accept(self, why: str | None) -> None:
        """Compare measured numbers with the tables, or write them there with the reason ``why``, if given.

        Raises:
            BadInput: a table is damaged.
            Failed: a run did not finish; a number left its band, has none, or is missing.
        """
        if why:
            self._accept(why)
        else:
            self._hold()

    def _hold(self) -> None:
        """Measure all configurations, and print the numbers that left their bands."""
        baselines = self._read()
        lines = verdicts(_measured(self.subjects, {}), baselines)
        if lines:
            print("\n".join(lines))
            raise Failed(f"{len(lines)} numbers differ from their baselines")
        note(f"{len(baselines)} numbers are within their bands")

    def _accept(self, why: str) -> None:
        """Measure all configurations; write new baselines for numbers that left their bands or had none."""
        before = self._read()
        after = accepted(_measured(self.subjects, {}), before, self.subjects, why, _measured)
        with writing("baselines", self.folder):
            write_tables(after, self.folder)
        changed = sum(after.get(key) != before.get(key) for key in after.keys() | before.keys())
        note(f"{changed} of {len(after)} baselines in {self.folder} are new")

    def _read(self) -> dict[Key, Baseline]:
        try:
            return read_tables(self.folder)
        except DamagedTable as reason:
            raise BadInput(str(reason)) from None


def require_reason(accept: bool, why: str | None) -> None:
    """Raise BadInput if there is acceptance without a reason, or a reason without acceptance."""
    if accept != bool(why and why.strip()):
        came = "none" if accept else "one without --accept"
        raise BadInput(f"--why: expected a reason with --accept, got {came}")


def _measured(some: Sequence[Subject], processor: Mapping[str, str]) -> Numbers:
    """Return the numbers of configurations as computed for one kind of processor, and show progress."""
    with Progress(console=progress_console(), transient=True) as progress:
        task = progress.add_task(
            f"on {processor['NUMBA_CPU_NAME']}" if processor else "here", total=len(some)
        )
        try:
            return measure_all(some, os.cpu_count() or 1, lambda: progress.advance(task), processor)
        except NotMeasured as reason:
            raise Failed(str(reason)) from None
