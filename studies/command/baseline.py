"""What commands hold to baselines: numbers of engines and arms, held to tables or written there."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.progress import Progress

from studies.conformance.baselines.accept import Numbers, accepted, measure_all
from studies.conformance.baselines.measured import Key, NotMeasured
from studies.conformance.baselines.subjects import Subject, without_wheel
from studies.conformance.baselines.table import Baseline, DamagedTable, read_tables, write_tables
from studies.conformance.baselines.verdicts import verdicts
from studies.running.failures import BadInput, Failed, note, progress_console, writing
from studies.running.whole_file import require_folder

Baselines = dict[Key, Baseline]


@dataclass(frozen=True)
class Gate:
    """Subjects and the folder of the tables that they are held to."""

    subjects: Sequence[Subject]
    folder: Path

    def require_place(self, accept: bool) -> None:
        """Raise BadInput where there is no table to be held to, or none can be written to ``accept``."""
        if accept:
            with writing("--baselines", self.folder):
                require_folder(self.folder)
        elif not any(self.folder.glob("*.csv")):
            todo = '--accept --why "..." writes them'
            raise BadInput(f"--baselines: expected a folder with tables, got '{self.folder}': {todo}")

    def hold_or_accept(self, why: str | None) -> None:
        """Hold what is measured to the tables, or write it there with the reason ``why`` if one is given.

        Raises:
            BadInput: a table is damaged.
            Failed: a run came to no end; a number left its band, or has none, or is gone.
        """
        if why:
            self._accept(why)
        else:
            self._hold()

    def _hold(self) -> None:
        """Measure all subjects, and print what left its band."""
        baselines, _ = self._read()
        lines = verdicts(_measured(self.subjects, {}), baselines)
        if lines:
            print("\n".join(lines))
            raise Failed(f"{len(lines)} numbers are not what their baselines say")
        note(f"{len(baselines)} numbers are within their bands")

    def _accept(self, why: str) -> None:
        """Measure all subjects, and give a new baseline to what left its band, or had none."""
        before, absent = self._read()
        after = accepted(_measured(self.subjects, {}), before, self.subjects, why, _measured)
        with writing("baselines", self.folder):
            write_tables(after | absent, self.folder)
        changed = sum(after.get(key) != before.get(key) for key in after.keys() | before.keys())
        note(f"{changed} of {len(after)} baselines are new, in {self.folder}")

    def _read(self) -> tuple[Baselines, Baselines]:
        """Return the baselines of what this platform can run, and those of what it cannot, which is said."""
        try:
            every = read_tables(self.folder)
        except DamagedTable as reason:
            raise BadInput(str(reason)) from None
        missing = without_wheel()
        absent = {key: baseline for key, baseline in every.items() if key.arm in missing}
        for label in sorted({key.arm for key in absent}):
            note(f"{label} is left out: {missing[label]}")
        return {key: every[key] for key in every.keys() - absent.keys()}, absent


def require_reason(accept: bool, why: str | None) -> None:
    """Raise BadInput where acceptance and its reason do not come together."""
    if accept != bool(why and why.strip()):
        came = "none" if accept else "one without --accept"
        raise BadInput(f"--why: expected a reason with --accept, got {came}")


def _measured(some: Sequence[Subject], processor: Mapping[str, str]) -> Numbers:
    """Return the numbers of subjects, as a processor of a kind would find them, and show how far it is."""
    with Progress(console=progress_console(), transient=True) as progress:
        task = progress.add_task(
            f"on {processor['NUMBA_CPU_NAME']}" if processor else "here", total=len(some)
        )
        try:
            return measure_all(some, os.cpu_count() or 1, lambda: progress.advance(task), processor)
        except NotMeasured as reason:
            raise Failed(str(reason)) from None
