"""The energy study on the page: hidden power, the ledger of every run, drift of the constraints."""

from collections.abc import Iterable, Sequence

from reports.chapters.agreement.tables import failures_table
from reports.chapters.energy import figures, findings, tables
from reports.chapters.energy.runs import middle_rungs
from reports.chapters.energy.work_figure import driver_work
from reports.parts import Section
from reports.results import Results, Run

TITLE = "Energy over long runs"
INTRODUCTION = (
    "A method that makes or takes energy has a driver or a brake that no scene has. Every engine runs "
    "scenes for many turns, and what its bodies and contacts store, what its driver gives and what its "
    "contacts dissipate are added up from its own trajectory. What does not add up is the method's own: "
    "energy gained if positive, lost if negative. Its rate is called hidden power: the slope over time, "
    "the median over all pairs of block means (Theil and Sen), with Student's interval over five parts of "
    "the run. It holds what stabilisation of the constraints removes, which is no physics either and which "
    "only some engines tell."
)


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    runs = results.runs
    rungs = middle_rungs(runs)
    return [
        _power(results, runs, rungs),
        _ledger(results, runs, rungs),
        _drift(results, runs, rungs),
        _failed(runs),
    ]


def _power(results: Results, runs: Sequence[Run], rungs: dict[str, float]) -> Section:
    text = [findings.hidden_power(runs, scene, rung) for scene, rung in rungs.items()]
    return Section(
        "hidden-power",
        "Hidden power",
        _said([*text, findings.lost_as_it_comes(runs, "ideal-free")]),
        (*figures.gain_over_time(results, runs, rungs), *figures.by_step(runs)),
        (tables.power_table(runs, rungs),),
    )


def _ledger(results: Results, runs: Sequence[Run], rungs: dict[str, float]) -> Section:
    drawn = [f for scene, rung in rungs.items() for f in driver_work(results, runs, scene, rung)]
    shown = [tables.ledger_table(runs, scene, rung) for scene, rung in rungs.items()]
    return Section(
        "ledger",
        "Where energy goes",
        _said([findings.ledger_closes(runs, rungs)]),
        tuple(drawn),
        tuple(shown),
    )


def _drift(results: Results, runs: Sequence[Run], rungs: dict[str, float]) -> Section:
    return Section(
        "drift",
        "Drift of the constraints",
        _said(findings.drift(runs)),
        tuple(figures.growth(results, runs, rungs)),
        (tables.drift_table(runs, rungs),),
    )


def _failed(runs: Sequence[Run]) -> Section:
    table = failures_table(runs, "energy")
    count = sum(not run.ok for run in runs)
    text = f"{count} of {len(runs)} runs did not finish." if table else f"All {len(runs)} runs finished."
    return Section("failures", "Runs that did not finish", (text,), (), (table,) if table else ())


def _said(sentences: Iterable[str | None]) -> tuple[str, ...]:
    return tuple(sentence for sentence in sentences if sentence)
