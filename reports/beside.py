"""How the engines stand beside the paper's RK4: slider, forces, energy and run time, by class of scenes."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from reports.energy import UNACCOUNTED, at_middle
from reports.equal_error import ALONE, settings_by_scene
from reports.look import legend_place, span
from reports.page import MOST, Claim, Table
from reports.results import FORCE, IDEAL, LOOSE, PEAK, RIGID, SLIDER, finished

#: The paper's RK4 by the class of scenes: its run time within the error is the one that others are told in.
PAPERS = {IDEAL: "reference (projection)", LOOSE: "reference (located)"}
#: How many times as long as that a setting may take to be compared, and the error that the time is for.
BUDGET, TARGET_M = 10.0, 1e-6
#: The numbers of an engine beside the paper's method, by the headings of their columns.
POSITION, ENERGY = "slider position error [µm]", "energy drift [% of the energy in play]"
RUN_TIME, REACHED = "run time", "run time within 1 µm"
FORCES = {IDEAL: ("joint force error [N]", FORCE), LOOSE: ("peak contact force error [%]", PEAK)}


def comparison(rows: pd.DataFrame, energy: pd.DataFrame | None) -> Iterator[Claim | Table]:
    """Yield for each class of scenes the engines beside the paper's method, and all in a sentence.

    ``energy`` are the rows of the study of long runs.
    """
    told = []
    for joints, papers in PAPERS.items():
        if picks := beside(rows, joints):
            yield _table(joints, picks, None if energy is None else _long_runs(energy, joints))
            engines = [_reached(of) for name, of in picks.items() if name != papers]
            told.append(f"{joints}: {', '.join(engines)} (1: {papers})")
    text = (
        "Run time of each engine's cheapest setting that has the slider within 1 µm, scene by scene, in "
        f"multiples of that of the reference's RK4: {'; '.join(told)}."
    )
    yield Claim("within", text)


def _long_runs(energy: pd.DataFrame, joints: str) -> pd.DataFrame:
    """Return the finished long runs of a class of scenes at the middle setting."""
    ran = finished(at_middle(energy))
    kind = np.select([~ran["contact"], ran["compliant_contact"].isin([True])], [IDEAL, LOOSE], RIGID)
    return ran[kind == joints]


def beside(rows: pd.DataFrame, joints: str) -> dict[str, pd.DataFrame]:
    """Return the paper's method and every engine beside it on the scenes of a class, a row a scene.

    Of an engine it is the setting with the smallest error among those that take at most ``BUDGET`` times as
    long as the paper's method takes to be within ``TARGET_M``; if all take longer, the fastest.
    """
    papers, picks = PAPERS[joints], dict[str, list[dict[str, Any]]]()
    for ran, _ in settings_by_scene(rows[rows["joints"] == joints], SLIDER).values():
        base = ran[(ran["label"] == papers) & (ran["kept"] <= TARGET_M)].sort_values("time_s").head(1)
        for time_s in base["time_s"]:
            picks.setdefault(papers, []).append(_pick(base, time_s, rows))
            for engine, own in ran[ran["label"] != papers].groupby("engine"):
                picks.setdefault(str(engine), []).append(_pick(own, time_s, rows))
    others = sorted(picks.keys() - {papers}, key=lambda name: legend_place(name, ""))
    return {name: pd.DataFrame(picks[name]) for name in (papers, *others) if name in picks}


def _pick(ran: pd.DataFrame, papers_s: float, rows: pd.DataFrame) -> dict[str, Any]:
    """Return an engine's setting on a scene, with its errors, its run time as a multiple of the paper's."""
    within = ran[ran["time_s"] <= BUDGET * papers_s]
    best = (within.sort_values("kept") if len(within) else ran.sort_values("time_s")).iloc[0]
    reached = ran[ran["kept"] <= TARGET_M].sort_values("time_s").head(1)
    row = rows.loc[best.name]
    return {
        "configuration": best["label"],
        "setting": best["setting"],
        POSITION: 1e6 * best["error"],
        **{heading: row[column] for heading, column in FORCES.values()},
        RUN_TIME: best["time_s"] / papers_s,
        REACHED: reached["time_s"].min() / papers_s,
        "by": next(iter(reached["label"]), best["label"]),
    }


def _table(joints: str, picks: dict[str, pd.DataFrame], long_runs: pd.DataFrame | None) -> Table:
    """Return the table of engines beside the paper's method: the least and the largest over the scenes."""
    lines: list[dict[str, Any]] = []
    for of in picks.values():
        words = {name: "; ".join(dict.fromkeys(of[name])) for name in ("configuration", "setting")}
        lines.append(words)
        numbers = {name: of[name] for name in (POSITION, FORCES[joints][0])}
        if long_runs is not None:
            numbers[ENERGY] = 100 * long_runs[UNACCOUNTED][long_runs["label"].isin(of["configuration"])]
        numbers |= {name: of[name] for name in (RUN_TIME, REACHED)}
        for name, values in numbers.items():
            words |= {name: values.min(), f"{name}{MOST}": values.max()}
        words["on scenes"] = f"{of[REACHED].notna().sum()} of {len(of)}"
    title = f"The engines beside the reference's RK4, {joints}"
    caption = (
        "The setting with the smallest error among those that take at most ten times as long as the "
        "reference's RK4 takes to be within 1 µm, or else the fastest; least and largest over the scenes. "
        "Run times are multiples of that of this RK4 within 1 µm; the last columns are those of each "
        f"engine's cheapest setting within 1 µm, and on how many scenes there is one. {ALONE}"
    )
    if long_runs is not None and len(long_runs):
        turns = span([long_runs["turns"].min(), long_runs["turns"].max()], ".0f")
        caption += f" Energy drift: the largest of the study of long runs, {turns} revolutions."
    return Table(f"compared-{joints.replace(' ', '-')}", title, caption, "cost", pd.DataFrame(lines))


def _reached(picks: pd.DataFrame) -> str:
    by, reached = " or ".join(dict.fromkeys(picks["by"])), picks[REACHED]
    if reached.isna().all():
        return f"{by} not reached"
    return f"{by} {span(reached)}{' (not on all scenes)' if reached.isna().any() else ''}"
