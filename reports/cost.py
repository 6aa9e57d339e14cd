"""Cost: error against run time, and every engine's fastest setting at equal error."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from reports.equal_error import (
    ALONE,
    ALONE_MARK,
    UNRESOLVED,
    ByScene,
    front,
    is_force,
    ratio,
    reaching,
    saturated,
    settings_by_scene,
)
from reports.lines import Line, Panel, draw, points
from reports.look import ABSENT, axis_label, in_legend_order, legend_place, quantity, setting, variant, words
from reports.page import MOST, Chapter, Claim, Figure, Table
from reports.results import CLASSES, FORCE, PEAK, SLIDER, Studies, accuracy, finished, with_columns

#: The errors by which run times are compared, and the largest error asked for, in the column's unit.
TARGETS = {SLIDER: 1e-6, FORCE: 1.0, PEAK: 1.0}
#: The configuration in whose run times all others are told: the paper's equations with error control.
BASE = "reference (DOP853)"


def prepared(studies: Studies) -> pd.DataFrame:
    """Return recorded and timed runs, with all columns that are compared; ``joints`` is a scene's class."""
    ran = accuracy(studies)
    timed = studies["cost"].rows
    timed = timed.assign(joints=timed["scene"].map(dict(zip(ran["scene"], ran["joints"], strict=True))))
    both = pd.concat([ran, timed], ignore_index=True)
    return both.assign(label=in_legend_order(both))


def parts(studies: Studies) -> Iterator[Claim | Figure | Table | None]:
    """Yield ratios of run times at the targets, errors against run time, and times of building."""
    rows = prepared(studies)
    by_class = {
        (column, joints): of_class
        for column in TARGETS
        for joints in CLASSES
        if (of_class := settings_by_scene(rows[rows["joints"] == joints], column))
    }
    ran = finished(rows[rows["round"].isna()])
    if lost := int(saturated(ran).sum()):
        text = "In {lost} of {runs} runs the slider is off by a tenth of the clearance; these are not ranked."
        yield Claim("saturated", text, {"lost": (lost, ""), "runs": (len(ran), "")})
    for column in TARGETS:
        yield _figure(column, [of for (each, _), of in by_class.items() if each == column])
    yield _ratios(by_class)
    yield _by_scene(by_class)
    yield _building(with_columns(rows, "build_time_s", "solve_time_s").dropna(subset="build_time_s"))


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
    name = f"cost-{column.partition('_error_')[0].replace('_', '-')}"
    return Figure(name, title, caption, "cost", draw(panels, 2.6), points(panels))


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


def _needed(column: str) -> str:
    """Return in words what is asked for of a column: slider position within 1 µm."""
    what, unit = words(column)
    return f"{what.replace(' error', '')} within {quantity(TARGETS[column], unit)}"


def _ratios(by_class: dict[tuple[str, str], ByScene]) -> Table:
    """Return of each engine the least and largest ratio to the base by target and class of scenes."""
    lines = []
    for (column, joints), of_class in by_class.items():
        scenes = [ran for ran, _ in of_class.values()]
        line: dict[str, Any] = {"needed": _needed(column), "joints": joints, "scenes": len(scenes)}
        found: dict[str, list[float]] = {}
        for ran in scenes:
            best = {each.engine: each for each in reaching(ran, TARGETS[column])}
            base = next(iter(reaching(ran[ran["label"] == BASE], TARGETS[column])), None)
            per_s = 1e3 * base.time_s / ran["end_time_s"].iloc[0] if base else np.nan
            found.setdefault(f"{BASE} [ms for 1 s of motion]", []).append(per_s)
            for engine in sorted({*ran["engine"]}, key=lambda engine: legend_place(engine, "")):
                own = best.get(engine)
                found.setdefault(engine, []).append(ratio(own, base).times if own and base else np.nan)
        for name, numbers in found.items():
            known = [number for number in numbers if np.isfinite(number)]
            line |= {name: min(known, default=np.nan), f"{name}{MOST}": max(known, default=np.nan)}
            line |= {f"{name} on": f"{len(known)} of {len(scenes)}"} if " [" not in name else {}
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
            base = next(iter(reaching(ran[ran["label"] == BASE], TARGETS[column])), None)
            for each in reaching(ran, TARGETS[column]):
                line: dict[str, Any] = {"needed": _needed(column), "joints": joints, "scene": scene}
                line |= {"configuration": each.label, "setting": each.setting}
                line |= {
                    "run time [ms]": 1e3 * each.time_s,
                    "resolved": not each.shown_ms("").startswith("~"),
                }
                times = ratio(each, base) if base else None
                line |= vars(times) if times else {}
                lines.append(line)
    table = pd.DataFrame(lines).rename(columns={"times": f"ratio to {BASE}"})
    caption = f"Least of the rounds; low and high: by the next fastest round of either. {UNRESOLVED}"
    return Table("cost-at-targets", "Fastest settings by scene", caption, "cost", table, shown=False)


def _building(rows: pd.DataFrame) -> Table:
    """Return what building the model and reading out take, by configuration, over the timed runs."""
    ms, part = (
        1e3 * rows["build_time_s"],
        100 * rows["build_time_s"] / (rows["build_time_s"] + rows["solve_time_s"]),
    )
    numbers = rows.assign(ms=ms, part=part).groupby("label", observed=True)[["ms", "part"]]
    table = numbers.agg(["median", "min", "max"]).set_axis(
        ["median [ms]", "least [ms]", "most [ms]", "median [%]", "least [%]", "most [%]"], axis=1
    )
    caption = "Wall time of a timed run besides the native solve, in ms and in percent of both together."
    title = "Building the model and reading out"
    return Table(
        "cost-building", title, caption, "cost", table.rename_axis("configuration").reset_index(), shown=False
    )


INTRODUCTION = (
    "Every configuration is run at a series of settings, from coarse to fine. Run times are of the native "
    "solve alone, the least of the rounds. A setting counts by the largest error of its own and all finer "
    "ones."
)
CHAPTER = Chapter("cost", "Cost", ("accuracy", "cost"), INTRODUCTION, parts)
