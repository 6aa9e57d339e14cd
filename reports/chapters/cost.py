"""Cost: error against run time, and every engine's fastest setting at equal error."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from reports.analysis.equal_error import (
    ALONE,
    ALONE_MARK,
    SLIDER,
    UNRESOLVED,
    ByScene,
    Choice,
    front,
    is_force,
    ratio,
    reaching,
    saturated,
    settings_by_scene,
)
from reports.parts import Chapter, Figure, Finding, Number, Studies, Table
from reports.plots.panels import Line, Panel, draw
from reports.quantities import FORCE, PEAK, finished, has_clearance, recorded, value, with_forces
from reports.results import with_columns
from reports.shared_tables import head, reliability, runs_tables, signal
from reports.style import axis_label, legend_place, variant, words
from reports.tables import ABSENT, plain, setting, span

STUDY, REFERENCE = "work-precision", "reference"
#: The errors by which run times are compared, and the largest error asked for, in the column's unit.
TARGETS = {SLIDER: 1e-6, FORCE: 1.0, PEAK: 1.0}
#: The classes of scenes, by their joints.
IDEAL, LOOSE, RIGID = CLASSES = ("ideal joints", "clearance", "rigid contact")
#: Columns that not every run has.
OPTIONAL = ("solve_time_s", "build_time_s", "compile_time_s")
INTRODUCTION = (
    "Every configuration is run at a series of settings, from coarse to fine. Run times are of the native "
    "solve alone, the least of the rounds. A setting counts by the largest error of its own and all finer "
    "ones."
)


def prepared(studies: Studies) -> pd.DataFrame:
    """Return the study's rows with all columns that are compared, and each scene's class in ``joints``."""
    rows = with_forces(with_columns(studies[STUDY].rows, *OPTIONAL, SLIDER))
    loose = has_clearance(rows)
    compliant = value(rows, PEAK).notna().groupby(rows["scene"]).transform("any")
    return rows.assign(joints=np.select([loose & compliant, loose], [LOOSE, RIGID], IDEAL))


def by_class(rows: pd.DataFrame, column: str) -> dict[str, ByScene]:
    """Return the settings that have errors of a column, by scene, of each class of scenes that has any."""
    found = {joints: settings_by_scene(rows[rows["joints"] == joints], column) for joints in CLASSES}
    return {joints: of_class for joints, of_class in found.items() if of_class}


def asked(column: str) -> str:
    """Return in words what is asked for of a column: slider position within 1 µm."""
    target, unit = TARGETS[column], words(column)[1]
    return f"{signal(column)} within {Number(target, unit)}"


def findings(studies: Studies) -> Iterator[Finding]:
    """Yield how many runs are not ranked, and how many finished."""
    rows = prepared(studies)
    ran = recorded(finished(rows))
    lost = saturated(ran).sum()
    if lost:
        text = "In {lost} of {runs} runs the slider is off by a tenth of the clearance; these are not ranked."
        yield Finding("saturated", text, lost=Number(float(lost)), runs=Number(float(len(ran))))
    yield reliability(recorded(rows))


def figures(studies: Studies) -> Iterator[Figure | None]:
    """Yield errors against run time, a figure for each error and a panel for each scene."""
    rows = prepared(studies)
    reading = (
        "A line is an engine with its best settings: down and to the left is better. Dashed: the error asked "
        f"for; grey: the uncertainty of the reference solution; without a line: not ranked. {ALONE}"
    )
    for column in TARGETS:
        panels = [
            cost_panel(scene, ran, known, column)
            for of_class in by_class(rows, column).values()
            for scene, (ran, known) in of_class.items()
            if len(set(ran["engine"])) > 1
        ]
        if panels:
            title = f"What error in {signal(column)} does each engine reach in what run time?"
            name = column.partition("_error_")[0].replace("_", "-")
            yield Figure(f"cost-{name}", title, reading, STUDY, draw(panels, 3.0))


def cost_panel(
    scene: str, ran: pd.DataFrame, known: float, column: str, rings: Sequence[tuple[float, float]] = ()
) -> Panel:
    """Return the panel of a scene: each engine's best settings by run time, and the error asked for."""
    lines = []
    for engine, of_engine in sorted(ran.groupby("engine"), key=lambda each: legend_place(each[0], "")):
        best, style = front(of_engine), variant(engine, 0)
        if best.empty:  # of errors that rank nobody the points are shown, without a line
            best, style = of_engine.assign(kept=of_engine["error"]), {**style, "linestyle": ""}
        least, most = (best["times_s"].map(end) for end in (np.nanmin, np.nanmax))
        spread = [best["time_s"] - least, most - best["time_s"]]
        mark = ALONE_MARK if is_force(column) and best["motion_alone"].any() else ""
        settings = zip(best["label"], best["knob"], best["value"], strict=True)
        notes = [f"{label}, {setting(knob, value)}" for label, knob, value in settings]
        lines.append(Line(f"{engine}{mark}", best["time_s"], best["kept"], style, notes, spread))
    level = TARGETS[column]
    return Panel(scene, "run time [s]", axis_label(column), lines, floor=known, level=level, rings=rings)


def tables(studies: Studies) -> Iterator[Table | None]:
    """Yield ratios of run times at the targets by class and scene, and times of building and compiling."""
    rows = prepared(studies)
    classes = {column: by_class(rows, column) for column in TARGETS}
    yield _by_class(classes)
    yield _by_scene(classes)
    yield _building(rows)
    yield _compiling(rows)
    yield from runs_tables(recorded(rows), STUDY)


#: The run times by which all others are told as ratios: one configuration, whoever else is installed.
BASE = f"{REFERENCE} (DOP853)"


def base_of(ran: pd.DataFrame, error: float) -> Choice | None:
    """Return the fastest setting of ``BASE`` that keeps an error, None if none does."""
    return next(iter(reaching(ran[ran["label"] == BASE], error)), None)


def _by_class(classes: Mapping[str, Mapping[str, ByScene]]) -> Table | None:
    lines = []
    for column, of_column in classes.items():
        for joints, of_class in of_column.items():
            scenes = [ran for ran, _ in of_class.values()]
            engines = sorted({*pd.concat(scenes)["engine"]}, key=lambda engine: legend_place(engine, ""))
            cells = {engine: _ratios(scenes, engine, column) for engine in engines}
            base = [base_of(ran, TARGETS[column]) for ran in scenes]
            per_second = [
                1e3 * each.time_s / ran["end_time_s"].iloc[0]
                for each, ran in zip(base, scenes, strict=True)
                if each
            ]
            first = {"needed": asked(column), "joints": joints, "scenes": str(len(scenes))}
            lines.append({**first, f"{BASE} [ms for 1 s of motion]": span(per_second), **cells})
    if not lines:
        return None
    reading = (
        f"Run time of each engine's fastest setting that reaches the error, as a multiple of that of {BASE}: "
        f"least and largest over the scenes, and on how many it reaches it ({ABSENT}: no run). {ALONE}"
    )
    columns = pd.DataFrame(lines).fillna(ABSENT)
    return Table.of("cost-ratios", "Run times at equal error", reading, STUDY, columns).on_page()


def _ratios(scenes: Sequence[pd.DataFrame], engine: str, column: str) -> str:
    ratios, there, alone = [], 0, ""
    for ran in scenes:
        own = next(iter(reaching(ran[ran["engine"] == engine], TARGETS[column])), None)
        base = base_of(ran, TARGETS[column])
        there += own is not None
        alone = alone or (own.mark(column) if own else "")
        if own and base:
            ratios.append(ratio(own, base).times)
    return f"{span(ratios)}{alone} ({there} of {len(scenes)})" if there else f"{ABSENT} (0 of {len(scenes)})"


def _by_scene(classes: Mapping[str, Mapping[str, ByScene]]) -> Table | None:
    lines = []
    for column, of_column in classes.items():
        for joints, of_class in of_column.items():
            for scene, (ran, _) in of_class.items():
                base = base_of(ran, TARGETS[column])
                for each in reaching(ran, TARGETS[column]):
                    times = ratio(each, base) if base else None
                    time = each.shown_ms(column)
                    ends = (
                        [plain(times.times), plain(times.low), plain(times.high)] if times else [ABSENT] * 3
                    )
                    lines.append((asked(column), joints, scene, each.label, each.setting, time, *ends))
    head_of = ("needed", "joints", "scene", "configuration", "setting", "run time [ms]")
    ratios = (f"ratio to {BASE}", "low", "high")
    reading = f"Least of the rounds; low and high: by the next fastest round of either. {UNRESOLVED} {ALONE}"
    return Table(
        "cost-at-targets", "Fastest settings by scene", reading, STUDY, (*head_of, *ratios), tuple(lines)
    )


def _building(rows: pd.DataFrame) -> Table:
    """Return what building the model and reading out take, by configuration, over the timed runs."""
    rows = rows.dropna(subset="build_time_s")
    rows = rows.assign(build=1e3 * rows["build_time_s"], run=rows["build_time_s"] + rows["solve_time_s"])
    rows = rows.assign(part=100 * rows["build_time_s"] / rows["run"])
    by_label = rows.groupby("label", observed=True)[["build", "part"]].agg(["median", "min", "max"])
    first = rows.drop_duplicates("label").set_index("label").loc[by_label.index]
    columns = {
        f"{what} [{unit}]": by_label[of, name].map(plain)
        for of, unit in (("build", "ms"), ("part", "%"))
        for name, what in (("median", "median"), ("min", "least"), ("max", "most"))
    }
    reading = "Wall time of a timed run besides the native solve, in ms and in percent of both together."
    title = "Building the model and reading out"
    return Table.of("cost-building", title, reading, STUDY, {**head(first, "engine", "arm"), **columns})


def _compiling(rows: pd.DataFrame) -> Table | None:
    """Return what compiling takes by scene and engine; None if nothing is compiled."""
    compiled = finished(rows).dropna(subset="compile_time_s").sort_values(["scene", "engine"])
    if compiled.empty:
        return None
    reading = (
        "Wall time of compiling a scene's code on a machine that has none. The reference keeps it on disk."
    )
    columns = {**head(compiled, "scene", "engine"), "time [s]": compiled["compile_time_s"].map(plain)}
    return Table.of("cost-compiling", "Compiling", reading, STUDY, columns)


CHAPTER = Chapter("cost", "Cost", (STUDY,), INTRODUCTION, findings, figures, tables)
