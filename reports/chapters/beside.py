"""How the engines stand beside the paper's RK4: slider, forces, energy and run time, by class of scenes."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from reports.chapters.energy import UNACCOUNTED, at_middle
from reports.equal_error import ALONE, reaching
from reports.look import legend_place, span
from reports.page import MOST, Claim, Table
from reports.results import FORCE, IDEAL, LOOSE, PEAK, RIGID, SLIDER, finished

#: The paper's RK4 by the class of scenes: its run time within the error is the one that others are told in.
PAPERS = {IDEAL: "reference (projection)", LOOSE: "reference (located)"}
#: How many times as long as that a setting may take to be compared.
BUDGET = 10.0
#: Headings of columns: those of errors with the column that is shown, by class.
FORCES = {IDEAL: ("joint force error [N]", FORCE), LOOSE: ("peak contact force error [%]", PEAK)}


def comparison(ran: pd.DataFrame, energy: pd.DataFrame | None) -> Iterator[Claim | Table]:
    """Yield for each class of scenes the engines beside the paper's method, and all in a sentence.

    ``ran`` are settings (see ``cost.by_target``), ``energy`` the rows of the study of long runs.
    """
    told = []
    for joints, papers in PAPERS.items():
        picks = beside(ran[(ran["column"] == SLIDER) & (ran["joints"] == joints)], papers)
        if len(picks):
            yield _table(joints, picks, None if energy is None else _long_runs(energy, joints))
            engines = [_reached(of) for name, of in picks.groupby("solver", sort=False) if name != papers]
            told.append(f"{joints}: {', '.join(engines)} (1: {papers})")
    text = (
        "Run time of each engine's cheapest setting that has the slider within 1 µm, scene by scene, in "
        f"multiples of that of the reference's RK4: {'; '.join(told)}."
    )
    yield Claim("within", text)


def beside(ran: pd.DataFrame, papers: str) -> pd.DataFrame:
    """Return the setting of the paper's method and of every engine beside it (``solver``) on each scene.

    Of the paper's method it is the fastest within the error. Of an engine it is the one with the smallest
    error among those that take at most ``BUDGET`` times as long, or if all take longer, the fastest.
    ``times`` is its run time in multiples of the paper's, ``within`` that of the engine's fastest within the
    error, ``by`` some configuration.
    """
    base = reaching(ran[ran["label"] == papers])
    is_papers = ran["label"] == papers
    times = ran["time_s"] / ran["scene"].map(base.set_index("scene")["time_s"])
    rank = ran["kept"].where(times <= BUDGET, times)
    ran = ran.assign(
        solver=ran["engine"].mask(is_papers, papers), times=times, over=times > BUDGET, rank=rank
    )
    ran = ran[times.notna() & (~is_papers | ran.index.isin(base.index))]
    fastest = ran[ran["reached"]].sort_values("times").drop_duplicates(["solver", "scene"])
    within = fastest.set_index(["solver", "scene"])[["times", "label"]].set_axis(["within", "by"], axis=1)
    picks = ran.sort_values(["scene", "over", "rank"]).drop_duplicates(["solver", "scene"])
    place = picks["solver"].map(lambda name: (name != papers, legend_place(name, "")))
    picks = picks.assign(place=place).sort_values("place", kind="stable").join(within, on=["solver", "scene"])
    return picks.assign(by=picks["by"].astype(object).fillna(picks["label"].astype(object)))


def _long_runs(energy: pd.DataFrame, joints: str) -> pd.DataFrame:
    """Return the finished long runs of a class of scenes at the middle setting."""
    ran = finished(at_middle(energy))
    kind = np.select([~ran["contact"], ran["compliant_contact"].isin([True])], [IDEAL, LOOSE], RIGID)
    return ran[kind == joints]


def _table(joints: str, picks: pd.DataFrame, long_runs: pd.DataFrame | None) -> Table:
    """Return the table of engines beside the paper's method: the least and the largest over the scenes."""
    lines: list[dict[str, Any]] = []
    force, column = FORCES[joints]
    for _, of in picks.groupby("solver", sort=False):
        numbers = {"slider position error [µm]": 1e6 * of["error"], force: of[column]}
        if long_runs is not None:
            drift = long_runs[UNACCOUNTED][long_runs["label"].isin(of["label"])]
            numbers["energy drift [% of the energy in play]"] = 100 * drift
        numbers |= {"run time": of["times"], "run time within 1 µm": of["within"]}
        line: dict[str, Any] = {"configuration": of["label"], "setting": of["setting"]}
        line = {name: "; ".join(dict.fromkeys(texts)) for name, texts in line.items()}
        for name, values in numbers.items():
            line |= {name: values.min(), f"{name}{MOST}": values.max()}
        lines.append(line | {"on scenes": f"{of['within'].count()} of {len(of)}"})
    title = f"The engines beside the reference's RK4, {joints}"
    caption = (
        "Of each engine the most accurate setting in ten times the reference's RK4 time to 1 µm, which is "
        "the unit of run times, or else the fastest; least and largest over the scenes. The last columns "
        f"are of the cheapest setting within 1 µm. {ALONE}"
        if joints == IDEAL
        else "As with ideal joints. An impact that a run does not have counts as 100 %."
    )
    if long_runs is not None and len(long_runs):
        turns = span([long_runs["turns"].min(), long_runs["turns"].max()], ".0f")
        caption += f" Energy drift: the largest over {turns} revolutions, of the runs of the energy study."
    return Table(f"compared-{joints.replace(' ', '-')}", title, caption, "cost", pd.DataFrame(lines))


def _reached(picks: pd.DataFrame) -> str:
    by, within = " or ".join(dict.fromkeys(picks["by"])), picks["within"]
    if within.isna().all():
        return f"{by} not reached"
    return f"{by} {span(within)}{' (not on all scenes)' if within.isna().any() else ''}"
