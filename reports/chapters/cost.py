"""Cost: error against run time, and every engine's fastest setting at equal error."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from reports.equal_error import (
    ALONE,
    UNRESOLVED,
    front,
    is_resolved,
    judged,
    mark,
    reaching,
    saturated,
    settings,
)
from reports.lines import Line, Panel, figure_of
from reports.look import ABSENT, axis_label, in_legend_order, legend_place, quantity, variant, words
from reports.page import MOST, Chapter, Claim, Figure, Part, Table
from reports.results import CLASSES, FORCE, PEAK, SLIDER, Studies, accuracy, finished

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
    """Return every setting that was recorded, with its run times; ``joints`` is the class of its scene."""
    ran = accuracy(studies)
    both = pd.concat([ran, studies["cost"].rows], ignore_index=True)
    both = settings(both.assign(label=in_legend_order(both)))
    return both.assign(joints=pd.Categorical(both["joints"], CLASSES))


def by_target(ran: pd.DataFrame) -> pd.DataFrame:
    """Return every setting's errors and run times beside each of the ``TARGETS``."""
    every = pd.concat([judged(ran, *each) for each in TARGETS.items()], ignore_index=True)
    return every.assign(column=pd.Categorical(every["column"], [*TARGETS]))


def parts(studies: Studies) -> Iterator[Part | None]:
    """Yield errors against run time, ratios of run times at the targets, and the settings behind them."""
    recorded = prepared(studies)
    if lost := int(saturated(finished(recorded)).sum()):
        text = "In {lost} of {runs} runs the slider is off by a tenth of the clearance; these are not ranked."
        yield Claim("saturated", text, {"lost": (lost, ""), "runs": (len(finished(recorded)), "")})
    yield from _inside(studies["cost"].rows)
    ran = by_target(recorded)
    caption = (
        "A line is an engine with its best settings: down and to the left is better. Dashed: the error asked "
        f"for; grey: the uncertainty of the reference solution; without a line: not ranked. {ALONE}"
    )
    for column, of in ran.groupby("column", observed=True):
        yield _figure(str(column), of, caption)
        caption = "Lines and marks as above."
    best = beside_base(ran)
    yield _ratios(ran, best)
    yield _by_scene(best)


def _inside(rows: pd.DataFrame) -> Iterator[Claim]:
    """Yield which part of the run time each engine that tells it spends in its own calls."""
    if "engine_time_s" not in rows:
        return
    parts = (100 * rows["engine_time_s"] / rows["solve_time_s"]).dropna()
    for engine, of in parts.groupby(rows["engine"]):
        text = f"Of its run time {engine} spends {{least}} to {{most}} inside its own calls, not in the loop."
        yield Claim(f"inside {engine}", text, {"least": (of.min(), "%"), "most": (of.max(), "%")})


def _figure(column: str, ran: pd.DataFrame, caption: str) -> Figure | None:
    scenes = [of for _, of in ran.groupby(["joints", "scene"], observed=True)]
    panels = [cost_panel(of) for of in scenes if len({*of["engine"]}) > 1]
    what = words(column)[0].replace(" error", "")
    title = f"What error in {what} does each engine reach in what run time?"
    name = f"cost-{what.replace(' ', '-')}"
    return figure_of(name, title, caption, "cost", panels, 2.4)


def cost_panel(ran: pd.DataFrame, rings: Sequence[tuple[float, float]] = ()) -> Panel:
    """Return the panel of a scene: each engine's best settings by run time, and the error asked for."""
    lines, first = [], ran.iloc[0]
    for engine, of_engine in sorted(ran.groupby("engine"), key=lambda each: legend_place(each[0], "")):
        best, style = front(of_engine), variant(engine, 0)
        if best.empty:  # of errors that rank nobody the points are shown, without a line
            best, style = of_engine.assign(kept=of_engine["error"]), {**style, "linestyle": ""}
        marked = mark(best.sort_values("motion_alone").iloc[-1], first["column"])
        spread = np.array([0 * best["time_s"], best["last_s"] - best["time_s"]])
        notes = [*(best["label"].astype(str) + ", " + best["setting"])]
        lines.append(Line(f"{engine}{marked}", best["time_s"], best["kept"], style, notes, spread))
    axes = ("run time [s]", axis_label(first["column"]))
    return Panel(first["scene"], *axes, lines, floor=first["floor"], level=first["target"], rings=rings)


def beside_base(ran: pd.DataFrame) -> pd.DataFrame:
    """Return each engine's fastest setting within each target on each scene, with its ratio to the base."""
    base = reaching(ran[ran["label"] == BASE]).set_index(["column", "scene"])[["time_s", "next_s"]]
    best = reaching(ran).join(base.add_suffix("_base"), on=["column", "scene"])
    return best.assign(
        times=best["time_s"] / best["time_s_base"],
        low=best["time_s"] / best["next_s_base"],
        high=best["next_s"] / best["time_s_base"],
        base_ms=1e3 * best["time_s_base"] / best["end_time_s"],
    )


def _needed(column: str) -> str:
    """Return in words what is asked for of a column: slider position within 1 µm."""
    what, unit = words(column)
    return f"{what.replace(' error', '')} within {quantity(TARGETS[column], unit)}"


def _ratios(ran: pd.DataFrame, every: pd.DataFrame) -> Table:
    """Return of each engine the least and largest ratio to the base by target and class of scenes."""
    lines = []
    for (column, joints), of in ran.groupby(["column", "joints"], observed=True):
        best, scenes = every[(every["column"] == column) & (every["joints"] == joints)], of["scene"].nunique()
        line: dict[str, Any] = {"needed": _needed(column), "joints": joints, "scenes": scenes}
        name = f"{BASE} [ms for 1 s of motion]"
        line |= {name: best["base_ms"].min(), f"{name}{MOST}": best["base_ms"].max()}
        for engine in sorted({*of["engine"]}, key=lambda engine: legend_place(engine, "")):
            times = best["times"][best["engine"] == engine]
            line |= {engine: times.min(), f"{engine}{MOST}": times.max()}
            line[f"{engine} on"] = f"{times.count()} of {scenes}"
        lines.append(line)
    caption = (
        f"Run time of each engine's fastest setting that reaches the error, as a multiple of that of {BASE}: "
        f"least and largest over the scenes, and on how many it reaches it ({ABSENT}: on none). Forces of "
        "exudyn (DOPRI5) and scipy are computed after the timed run."
    )
    return Table("cost-ratios", "Run times at equal error", caption, "cost", pd.DataFrame(lines))


def _by_scene(best: pd.DataFrame) -> Table:
    best = best.sort_values(["column", "joints", "scene", "time_s"])
    table = pd.DataFrame(
        {
            "needed": best["column"].map(_needed),
            "joints": best["joints"],
            "scene": best["scene"],
            "configuration": best["label"],
            "setting": best["setting"],
            "run time [ms]": 1e3 * best["time_s"],
            "resolved": is_resolved(best),
            f"ratio to {BASE}": best["times"],
            "low": best["low"],
            "high": best["high"],
        }
    )
    caption = f"Least of the rounds; low and high: by the next fastest round of either. {UNRESOLVED}"
    return Table("cost-at-targets", "Fastest settings by scene", caption, "cost", table, shown=False)


CHAPTER = Chapter("cost", "Cost", ("accuracy", "cost"), INTRODUCTION, parts)
