"""The command ``baseline``: what engines and arms come to now, held against the tables or written there."""

import os
from collections.abc import Mapping, Sequence

from rich.progress import Progress

from studies.conformance.baselines.accept import Numbers, accepted, measure_all
from studies.conformance.baselines.measured import Key, NotMeasured
from studies.conformance.baselines.subjects import Subject, subjects, without_wheel
from studies.conformance.baselines.table import FOLDER, Baseline, DamagedTable, read_tables, write_tables
from studies.conformance.baselines.verdicts import verdicts
from studies.running.failures import BadInput, Failed, note, progress_console, writing

Baselines = dict[Key, Baseline]


def held_or_accepted(accept: bool, why: str | None) -> None:
    """Hold what is measured to the tables, or write it there with the reason ``why``.

    Raises:
        BadInput: a reason is missing, or there is nothing to give one for; a table is damaged.
        Failed: a run came to no end; a number left its band, or has none, or is gone.
    """
    if accept != bool(why and why.strip()):
        came = "none" if accept else "one without --accept"
        raise BadInput(f"--why: expected a reason with --accept, got {came}")
    if why:
        _accept(why)
    else:
        _hold()


def _hold() -> None:
    """Measure all subjects, and print what left its band."""
    baselines, _ = _read()
    lines = verdicts(_measured(subjects(), {}), baselines)
    if lines:
        print("\n".join(lines))
        raise Failed(f"{len(lines)} numbers are not what their baselines say")
    note(f"{len(baselines)} numbers are within their bands")


def _accept(why: str) -> None:
    """Measure all subjects, and give a new baseline to what left its band, or had none."""
    (before, absent), every = _read(), subjects()
    after = accepted(_measured(every, {}), before, every, why, _measured)
    with writing("baselines", FOLDER):
        write_tables(after | absent)
    changed = sum(after.get(key) != before.get(key) for key in after.keys() | before.keys())
    note(f"{changed} of {len(after)} baselines are new, in {FOLDER}")


def _read() -> tuple[Baselines, Baselines]:
    """Return the baselines of what this platform can run, and those of what it cannot, which is said."""
    try:
        every = read_tables()
    except DamagedTable as reason:
        raise BadInput(str(reason)) from None
    for label, why in without_wheel().items():
        note(f"{label} is left out: {why}")
    absent = {key: baseline for key, baseline in every.items() if key.arm in without_wheel()}
    return {key: every[key] for key in every.keys() - absent.keys()}, absent


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
