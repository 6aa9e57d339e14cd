"""The first screen: for every need the setting to use, and how engines stand beside the paper's method."""

import math
from collections.abc import Iterator
from shlex import quote
from typing import Any

import pandas as pd

from reports.chapters.beside import comparison
from reports.chapters.cost import by_target, cost_panel, prepared
from reports.chapters.energy import KEPT, at_middle, energy_parts
from reports.chapters.predictability import horizon, horizons
from reports.equal_error import ALONE, Ratio, candidates, mark, ratio
from reports.lines import figure_of
from reports.look import command, span
from reports.page import MOST, Chapter, Claim, Figure, Part, Table, Text
from reports.results import FORCE, IDEAL, LOOSE, PEAK, RIGID, SLIDER, Studies

#: What a user needs: in words, the class of scenes, and the column of errors that is within its target.
NEEDS = (
    ("motion within 1 µm", IDEAL, SLIDER),
    ("motion within 1 µm", LOOSE, SLIDER),
    ("peak force of every impact within 1 %", LOOSE, PEAK),
    ("forces within 1 N at all times", LOOSE, FORCE),
    ("motion within 1 µm", RIGID, SLIDER),
)
TIME = "time for 1 s of motion [ms]"
#: The number of scenes in the figure.
SCENES = 2


def parts(studies: Studies) -> Iterator[Part | None]:
    """Yield the recommendation, the comparison, a figure, and the limits of all that is said."""
    ran = by_target(prepared(studies))
    energy = studies["energy"].rows if "energy" in studies else None
    lines = [
        _need(ran[(ran["joints"] == joints) & (ran["column"] == column)], need)
        for need, joints, column in NEEDS
    ]
    lines = [line for line in lines if line] + ([] if energy is None else [*_energy(energy, ran)])
    caption = (
        "The fastest setting that reaches the error on all scenes of its kind, or on most; (2x): twice the "
        f"run time of the one to use. Times are without start-up and compiling. {ALONE}"
    )
    yield Table("answer", "Recommended solver and setting", caption, "cost", pd.DataFrame(lines))
    yield from comparison(ran, energy)
    link = '<a href="#table-configurations">What the names of configurations mean</a>'
    yield Text(f'<p class="source">{link}</p>')
    yield _figure(ran[ran["column"] == SLIDER])
    yield from _limits(studies)


def _need(ran: pd.DataFrame, need: str) -> dict[str, Any]:
    """Return what to use for an error on a class of scenes, and what is next best; nothing without rows."""
    if ran.empty:
        return {}
    line: dict[str, Any] = {"you need": f"{need}, {ran['joints'].iloc[0]}", "use": "no setting that was run"}
    best, *others = candidates(ran) or [ran.head(0)]
    if best.empty:
        return line
    level = [other for other in others if _is_level(other, best)]
    others = [other for other in others if not _is_level(other, best)]
    faster = [each for each in others[1:] if any(of.decided and of.times < 1 for of in _behind(each, best))]
    next_best = [_slower(other, best, ran) for other in others[:1]]
    next_best += [f"faster where it runs: {_slower(each, best, ran)}" for each in faster]
    uses = [f"{_name(each, ran)}{_mark(each)}" for each in (best, *level)]
    ms = 1e3 * (best["time_s"] / best["end_time_s"])
    return line | {
        "use": " or ".join(uses),
        "command": _command(best.iloc[0]),
        TIME: ms.min(),
        f"{TIME}{MOST}": ms.max(),
        "next best": "; ".join(next_best) or "no other engine",
    }


def _command(row: pd.Series) -> str:
    return command(row, f"{quote(row['scene'])} --end {row['end_time_s']:.6g}")


def _mark(each: pd.DataFrame) -> str:
    return mark(each.iloc[0], each["column"].iloc[0])


def _name(each: pd.DataFrame, ran: pd.DataFrame) -> str:
    scenes = ran["scene"].nunique()
    on = "" if len(each) == scenes else f" ({len(each)} of {scenes} scenes)"
    return f"{each['label'].iloc[0]}, {each['setting'].iloc[0]}{on}"


def _behind(other: pd.DataFrame, best: pd.DataFrame) -> list[Ratio]:
    """Return the ratios of run times on the scenes that both reach."""
    times = ["scene", "time_s", "next_s"]
    own = {run.scene: run for run in best[times].itertuples()}
    return [ratio(run, own[run.scene]) for run in other[times].itertuples() if run.scene in own]


def _is_level(other: pd.DataFrame, best: pd.DataFrame) -> bool:
    """Return whether two settings reach the error on as many scenes in times that are not resolved."""
    ratios = _behind(other, best)
    return len(other) == len(best) and bool(ratios) and not any(of.decided for of in ratios)


def _slower(other: pd.DataFrame, best: pd.DataFrame, ran: pd.DataFrame) -> str:
    return f"{_name(other, ran)} ({span(of.times for of in _behind(other, best))}x){_mark(other)}"


def _energy(energy: pd.DataFrame, ran: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield the line on energy over long runs: of configurations that keep it on most scenes the fastest."""
    middle = at_middle(energy)
    keep = energy_parts(middle).query("part <= @KEPT").sort_values("scenes", ascending=False, kind="stable")
    if keep.empty:
        return
    longest = {label: middle[middle["label"] == label].sort_values("turns").iloc[-1] for label in keep.index}
    ms = pd.DataFrame({label: _ms_per_s(ran, row) for label, row in longest.items()})
    most = keep.index[keep["scenes"] == keep["scenes"].max()]
    best = ms[most].dropna(axis=1, how="all").dropna().max().reindex(most).fillna(math.inf).idxmin()
    others = keep[keep["solver"] != keep["solver"][best]]
    told = keep.index + ", " + keep["setting"] + keep["on"]
    turns = span(keep.loc[best, ["fewest_turns", "most_turns"]], ".0f")
    yield {
        "you need": f"energy balance within {100 * KEPT:g} % over {turns} revolutions",
        "use": told[best],
        "command": _command(longest[best]),
        TIME: ms[best].min(),
        f"{TIME}{MOST}": ms[best].max(),
        "next best": told[others.index[0]] if len(others) else "no other engine",
    }


def _ms_per_s(ran: pd.DataFrame, like: pd.Series) -> "pd.Series[float]":
    """Return by scene a configuration's run time for 1 s of motion in ms, at no coarser a setting."""
    at_least = ran["value"] <= like["value"] * (1 + 1e-9)
    own = ran[(ran["column"] == SLIDER) & (ran["label"] == like["label"]) & at_least].drop_duplicates("scene")
    return (1e3 * own["time_s"] / own["end_time_s"]).set_axis(own["scene"])


def _figure(ran: pd.DataFrame) -> Figure | None:
    """Return each engine's error over run time on two scenes, the fastest within the target ringed."""
    ran = next((ran[ran["joints"] == of] for of in (LOOSE, IDEAL, RIGID) if (ran["joints"] == of).any()), ran)
    reached = ran["engine"].where(ran["reached"]).groupby(ran["scene"]).nunique()
    panels = []
    for scene in reached.sort_values(ascending=False, kind="stable").index[:SCENES]:
        of = ran[ran["scene"] == scene]
        best = of[of["reached"]].sort_values("time_s").head(1)
        panels.append(cost_panel(of, [*zip(best["time_s"], best["kept"], strict=True)]))
    title = "Which engine reaches which error in what run time, with clearance?"
    caption = (
        "A line is an engine at its best settings; points without a line are not ranked. Dashed: the error "
        "asked for; ring: the fastest; grey: uncertainty of the reference solution."
    )
    return figure_of("answer", title, caption, "cost", panels, 2.1)


def _limits(studies: Studies) -> Iterator[Claim]:
    """Yield the limits of all that is said: the horizon, what is not modelled, what timings rest on."""
    if "predictability" in studies and len(horizons(studies["predictability"].rows)):
        yield horizon(studies["predictability"].rows)
    text = "reference solutions solve each engine's own model; flexibility, lubrication and wear are outside"
    yield Claim("model", f"Model: {text} the scope.")
    machine = studies["cost"].facts.get("machine", {}).get("processor") or "not on record"
    text = "ratios carry over to other machines better than milliseconds"
    yield Claim("timing", f"Timing: one processor, {machine}; {text}.")


CHAPTER = Chapter("answer", "Recommended solver and setting", ("accuracy", "cost"), "", parts)
