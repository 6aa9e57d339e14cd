"""The agreement study on the page: every engine on every ideal scene against the independent truth."""

import re
from collections.abc import Iterable, Sequence

from reports.chapters.agreement import figures, findings, tables
from reports.chapters.agreement.figures import ENERGY, POSITION, VIOLATION
from reports.parts import Section
from reports.quantities import largest_joint_force_error
from reports.results import Results, Run
from reports.style import ordered

TITLE = "Agreement on ideal joints"
INTRODUCTION = (
    "Every engine runs every scene without clearance at a ladder of steps and is judged by a truth that "
    "shares no code with any of them: the mechanism in one coordinate, integrated to near round-off, with "
    "an uncertainty of its own. Errors are the largest over all samples; what dies away between two samples "
    "is not seen. At equal steps the engines do unequal work: this study is about what an engine gets right, "
    "not about what it costs."
)

#: The name of an arm that is one value of a setting: 20 iterations.
_SWEPT = re.compile(r"\d+ (\w+)")


def sections(results: Results) -> list[Section]:
    """Return the sections of the study."""
    ladder = [run for run in results.runs if not swept_setting(run)]
    swept = [run for run in results.runs if swept_setting(run)]
    steps = common_steps(ladder)
    out = [_convergence(ladder), _one_step(results, ladder, steps), _conservation(results, ladder, steps)]
    for setting in sorted({name for run in swept if (name := swept_setting(run))}):
        out.append(_sweep([run for run in swept if swept_setting(run) == setting], setting))
    return [*out, _failures(results.runs)]


def swept_setting(run: Run) -> str | None:
    """Return the setting that a run's arm is one value of, None for a run of the ladder of steps."""
    found = _SWEPT.fullmatch(run.arm)
    return found[1] if found and found[1] in run.settings else None


def common_steps(runs: Sequence[Run]) -> dict[str, float]:
    """Return for each scene the middle one of the steps that every engine was run at."""
    out = {}
    for scene in _scenes(runs):
        by_engine: dict[str, set[float]] = {}
        for run in runs:
            if run.scene == scene:
                by_engine.setdefault(run.engine, set()).add(run.step_s)
        common = sorted(set.intersection(*by_engine.values()))
        if common:
            out[scene] = common[len(common) // 2]
    return out


def _convergence(runs: Sequence[Run]) -> Section:
    quantities = (POSITION, largest_joint_force_error(runs))
    names = ordered(run.name for run in runs if run.ok)
    text = [findings.orders_found(runs, name, quantities) for name in names]
    return Section(
        "convergence",
        "Convergence",
        _said([findings.pymunk_arms(runs, POSITION), *text]),
        tuple(figures.convergence(runs)),
        (tables.settings_table(runs), tables.orders_table(runs), tables.smallest_table(runs)),
    )


def _one_step(results: Results, runs: Sequence[Run], steps: dict[str, float]) -> Section:
    text = [findings.best_at_step(runs, scene, step) for scene, step in steps.items()]
    return Section(
        "one-step",
        "Errors at one step",
        _said(text),
        tuple(figures.position_over_time(results, runs, steps)),
        (tables.errors_table(runs, steps),),
    )


def _conservation(results: Results, runs: Sequence[Run], steps: dict[str, float]) -> Section:
    text = [
        f"Compared at a step of {figures.at_steps(steps)}." if steps else None,
        findings.smallest_first(runs, steps, ENERGY, "largest_kinetic_energy_J"),
        findings.smallest_first(runs, steps, VIOLATION),
    ]
    shown = tuple(figures.conservation(results, runs, steps))
    table = tables.conservation_table(runs, steps, (ENERGY, VIOLATION))
    return Section("conservation", "Energy and constraints", _said(text), shown, (table,))


def _sweep(runs: Sequence[Run], setting: str) -> Section:
    quantities = [POSITION, largest_joint_force_error(runs), VIOLATION]
    return Section(
        setting,
        f"{runs[0].engine.capitalize()}'s {setting}",
        _said(findings.enough(runs, scene, setting, POSITION) for scene in _scenes(runs)),
        tuple(figures.sweep(runs, setting, quantities)),
        (tables.sweep_table(runs, setting, quantities),),
    )


def _failures(runs: Sequence[Run]) -> Section:
    table = tables.failures_table(runs)
    count = sum(not run.ok for run in runs)
    text = f"{count} of {len(runs)} runs did not finish." if table else f"All {len(runs)} runs finished."
    return Section("failures", "Runs that did not finish", (text,), (), (table,) if table else ())


def _scenes(runs: Sequence[Run]) -> list[str]:
    return sorted({run.scene for run in runs})


def _said(sentences: Iterable[str | None]) -> tuple[str, ...]:
    return tuple(sentence for sentence in sentences if sentence)
