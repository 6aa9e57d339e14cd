"""Cost: error against run time, and every engine's fastest setting at equal error."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from reports.equal_error import (
    ALONE,
    UNRESOLVED,
    ByScene,
    front,
    is_resolved,
    mark,
    ratio,
    reaching,
    saturated,
    settings_by_scene,
)
from reports.lines import Line, Panel, draw, points
from reports.look import ABSENT, axis_label, in_legend_order, legend_place, quantity, variant, words
from reports.page import MOST, Chapter, Claim, Figure, Part, Table
from reports.results import CLASSES, FORCE, PEAK, SLIDER, Studies, accuracy, finished, with_columns

#: The errors by which run times are compared, and the largest error asked for, in the column's unit.
TARGETS = {SLIDER: 1e-6, FORCE: 1.0, PEAK: 1.0}
#: The configuration in whose run times all others are told: the paper's equations with error control.
BASE = "reference (DOP853)"
INTRODUCTION = (
    "Every configuration is run at a series of settings, from coarse to fine. Run times are of the native "
    "solve alone, the least of the rounds. A setting counts by the largest error of its own and all finer "
    "ones."
)


def prepared(studies: Studies) -> pd.DataFrame:
    """Return recorded and timed runs, with all columns that are compared; ``joints`` is a scene's class."""
    ran = accuracy(studies)
    timed = studies["cost"].rows
    timed = timed.assign(joints=timed["scene"].map(dict(zip(ran["scene"], ran["joints"], strict=True))))
    both = pd.concat([ran, timed], ignore_index=True)
    return both.assign(label=in_legend_order(both))


def parts(studies: Studies) -> Iterator[Part | None]:
    """Yield errors against run time, ratios of run times at the targets, and times of building."""
    rows = prepared(studies)
    ran = finished(rows[rows["round"].isna()])
    if lost := int(saturated(ran).sum()):
        text = "In {lost} of {runs} runs the slider is off by a tenth of the clearance; these are not ranked."
        yield Claim("saturated", text, {"lost": (lost, ""), "runs": (len(ran), "")})
    yield from _inside(with_columns(rows, "engine_time_s", "solve_time_s").dropna(subset="engine_time_s"))
    by_class: dict[tuple[str, str], ByScene] = {}
    for column in TARGETS:
        classes = {of: settings_by_scene(rows[rows["joints"] == of], column) for of in CLASSES}
        by_class |= {(column, joints): of_class for joints, of_class in classes.items() if of_class}
        yield _figure(column, [*classes.values()])
    yield _ratios(by_class)
    yield _by_scene(by_class)
    yield _building(with_columns(rows, "build_time_s", "solve_time_s").dropna(subset="build_time_s"))


def _inside(rows: pd.DataFrame) -> Iterator[Claim]:
    """Yield which part of the run time each engine that tells it spends in its own calls."""
    parts = 100 * rows["engine_time_s"] / rows["solve_time_s"]
    for engine, of in parts.groupby(rows["engine"]):
        text = f"Of its run time {engine} spends {{least}} to {{most}} inside its own calls, not in the loop."
        yield Claim(f"inside {engine}", text, {"least": (of.min(), "%"), "most": (of.max(), "%")})


def _figure(column: str, classes: Sequence[ByScene]) -> Figure | None:
    panels = [
        cost_panel(scene, ran, known, column)
        for of_class in classes
        for scene, (ran, known) in of_class.items()
        if len(set(ran["engine"])) > 1
    ]
    if not panels:
        return None
    what = words(column)[0].replace(" error", "")
    caption = (
        "A line is an engine with its best settings: down and to the left is better. Dashed: the error asked "
        f"for; grey: the uncertainty of the reference solution; without a line: not ranked. {ALONE}"
    )
    title = f"What error in {what} does each engine reach in what run time?"
    name = f"cost-{what.replace(' ', '-')}"
    return Figure(name, title, caption, "cost", draw(panels, 2.4), points(panels))


def cost_panel(
    scene: str, ran: pd.DataFrame, known: float, column: str, rings: Sequence[tuple[float, float]] = ()
) -> Panel:
    """Return the panel of a scene: each engine's best settings by run time, and the error asked for."""
    lines = []
    for engine, of_engine in sorted(ran.groupby("engine"), key=lambda each: legend_place(each[0], "")):
        best, style = front(of_engine), variant(engine, 0)
        if best.empty:  # of errors that rank nobody the points are shown, without a line
            best, style = of_engine.assign(kept=of_engine["error"]), {**style, "linestyle": ""}
        marks = {mark(run, column) for run in best.itertuples()}
        spread = [0 * best["time_s"], best["last_s"] - best["time_s"]]
        notes = [*(best["label"].astype(str) + ", " + best["setting"])]
        lines.append(Line(f"{engine}{max(marks)}", best["time_s"], best["kept"], style, notes, spread))
    level = TARGETS[column]
    return Panel(scene, "run time [s]", axis_label(column), lines, floor=known, level=level, rings=rings)


def _needed(column: str) -> str:
    """Return in words what is asked for of a column: slider position within 1 µm."""
    what, unit = words(column)
    return f"{what.replace(' error', '')} within {quantity(TARGETS[column], unit)}"


def _ratios(by_class: dict[tuple[str, str], ByScene]) -> Table:
    """Return of each engine the least and largest ratio to the base by target and class of scenes."""
    lines = []
    for (column, joints), of_class in by_class.items():
        line: dict[str, Any] = {"needed": _needed(column), "joints": joints, "scenes": len(of_class)}
        numbers: dict[str, list[float]] = {}
        for ran, _ in of_class.values():
            best = {each.engine: each for each in reaching(ran, TARGETS[column]).itertuples()}
            base = next(reaching(ran[ran["label"] == BASE], TARGETS[column]).itertuples(), None)
            per_s = 1e3 * base.time_s / base.end_time_s if base else np.nan
            numbers.setdefault(f"{BASE} [ms for 1 s of motion]", []).append(per_s)
            for engine in sorted({*ran["engine"]}, key=lambda engine: legend_place(engine, "")):
                times = ratio(best[engine], base).times if engine in best and base else np.nan
                numbers.setdefault(engine, []).append(times)
        for name, ratios in numbers.items():
            of = pd.Series(ratios)
            line |= {name: of.min(), f"{name}{MOST}": of.max()}
            line |= {f"{name} on": f"{of.count()} of {len(of_class)}"} if " [" not in name else {}
        lines.append(line)
    caption = (
        f"Run time of each engine's fastest setting that reaches the error, as a multiple of that of {BASE}: "
        f"least and largest over the scenes, and on how many it reaches it ({ABSENT}: on none). Forces of "
        "exudyn (DOPRI5) and scipy are computed after the timed run."
    )
    return Table("cost-ratios", "Run times at equal error", caption, "cost", pd.DataFrame(lines))


def _by_scene(by_class: dict[tuple[str, str], ByScene]) -> Table:
    lines = []
    for (column, joints), of_class in by_class.items():
        for scene, (ran, _) in of_class.items():
            base = next(reaching(ran[ran["label"] == BASE], TARGETS[column]).itertuples(), None)
            for each in reaching(ran, TARGETS[column]).itertuples():
                line: dict[str, Any] = {"needed": _needed(column), "joints": joints, "scene": scene}
                line |= {"configuration": each.label, "setting": each.setting}
                line |= {"run time [ms]": 1e3 * each.time_s, "resolved": is_resolved(each)}
                lines.append(line | (vars(ratio(each, base)) if base else {}))
    table = pd.DataFrame(lines).rename(columns={"times": f"ratio to {BASE}"})
    caption = f"Least of the rounds; low and high: by the next fastest round of either. {UNRESOLVED}"
    return Table("cost-at-targets", "Fastest settings by scene", caption, "cost", table, shown=False)


def _building(rows: pd.DataFrame) -> Table:
    """Return what building the model and reading out take, by configuration, over the timed runs."""
    ms = 1e3 * rows["build_time_s"]
    part = 100 * rows["build_time_s"] / (rows["build_time_s"] + rows["solve_time_s"])
    numbers = rows.assign(ms=ms, part=part).groupby("label", observed=True)[["ms", "part"]]
    table = numbers.agg(["median", "min", "max"]).set_axis(
        ["median [ms]", "least [ms]", "most [ms]", "median [%]", "least [%]", "most [%]"], axis=1
    )
    table = table.rename_axis("configuration").reset_index()
    title = "Building the model and reading out"
    caption = "Wall time of a timed run besides the native solve, in ms and in percent of both together."
    return Table("cost-building", title, caption, "cost", table, shown=False)


CHAPTER = Chapter("cost", "Cost", ("accuracy", "cost"), INTRODUCTION, parts)
