"""The first screen: for every need the setting to use, and how engines stand beside the paper's method."""

import math
from collections.abc import Iterator
from shlex import quote
from typing import Any

import pandas as pd

from reports.beside import comparison
from reports.cost import cost_panel, prepared
from reports.energy import KEPT, at_middle, energy_parts
from reports.equal_error import ALONE, ByScene, Ratio, candidates, mark, ratio, settings_by_scene
from reports.lines import draw, points
from reports.look import command, span
from reports.page import MOST, Chapter, Claim, Figure, Part, Table, Text
from reports.predictability import horizon_turns
from reports.results import FORCE, IDEAL, LOOSE, PEAK, RIGID, SLIDER, Studies

#: What a user needs: in words, the class of scenes, the column of errors, and the largest error.
NEEDS = (
    ("motion within 1 µm", IDEAL, SLIDER, 1e-6),
    ("motion within 1 µm", LOOSE, SLIDER, 1e-6),
    ("peak force of every impact within 1 %", LOOSE, PEAK, 1.0),
    ("forces within 1 N at all times", LOOSE, FORCE, 1.0),
    ("motion within 1 µm", RIGID, SLIDER, 1e-6),
)
TIME = "time for 1 s of motion [ms]"
#: The error that the figure asks for, in m, and how many scenes it has.
TARGET_M, SCENES = 1e-6, 2


def parts(studies: Studies) -> Iterator[Part | None]:
    """Yield the recommendation, the comparison, a figure, and the limits of all that is said."""
    rows = prepared(studies)
    lines = [*_needs(rows), *(_energy(studies, rows) if "energy" in studies else ())]
    caption = (
        "The fastest setting that reaches the error on all scenes of its kind, or on most; (2x): twice the "
        f"run time of the one to use. Times are without start-up and compiling. {ALONE}"
    )
    yield Table("answer", "Recommended solver and setting", caption, "cost", pd.DataFrame(lines))
    yield from comparison(rows, studies["energy"].rows if "energy" in studies else None)
    link = '<a href="#table-configurations">What the names of configurations mean</a>'
    yield Text(f'<p class="source">{link}</p>')
    yield _figure(rows)
    yield from _limits(studies)


def _needs(rows: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield what to use for each error on each class of scenes that has rows, and what is next best."""
    for need, joints, column, target in NEEDS:
        ran = settings_by_scene(rows[rows["joints"] == joints], column)
        if not ran:
            continue
        line: dict[str, Any] = {"you need": f"{need}, {joints}", "use": "no setting that was run"}
        if ranked := candidates(ran, target):
            best, *others = ranked
            level = [other for other in others if _is_level(other, best)]
            others = [other for other in others if not _is_level(other, best)]
            ms, row = 1e3 * (best["time_s"] / best["end_time_s"]), rows.loc[best.index[0]]
            next_best = [_slower(other, best, column, ran) for other in others[:1]]
            faster = [
                each for each in others[1:] if any(of.decided and of.times < 1 for of in _behind(each, best))
            ]
            next_best += [f"faster where it runs: {_slower(each, best, column, ran)}" for each in faster]
            uses = [f"{_name(each, ran)}{mark(each.iloc[0], column)}" for each in (best, *level)]
            line |= {
                "use": " or ".join(uses),
                "command": _command(row),
                TIME: ms.min(),
                f"{TIME}{MOST}": ms.max(),
            }
            line |= {"next best": "; ".join(next_best) or "no other engine"}
        yield line


def _command(row: pd.Series) -> str:
    return command(row, f"{quote(row['scene'])} --end {row['end_time_s']:.6g}")


def _name(each: pd.DataFrame, ran: ByScene) -> str:
    on = "" if len(each) == len(ran) else f" ({len(each)} of {len(ran)} scenes)"
    return f"{each['label'].iloc[0]}, {each['setting'].iloc[0]}{on}"


def _behind(other: pd.DataFrame, best: pd.DataFrame) -> list[Ratio]:
    """Return the ratios of run times on the scenes that both reach."""
    own = {run.scene: run for run in best.itertuples()}
    return [ratio(run, own[run.scene]) for run in other.itertuples() if run.scene in own]


def _is_level(other: pd.DataFrame, best: pd.DataFrame) -> bool:
    """Return whether two settings reach the error on as many scenes in times that are not resolved."""
    ratios = _behind(other, best)
    return len(other) == len(best) and bool(ratios) and not any(of.decided for of in ratios)


def _slower(other: pd.DataFrame, best: pd.DataFrame, column: str, ran: ByScene) -> str:
    times = span(of.times for of in _behind(other, best))
    return f"{_name(other, ran)} ({times}x){mark(other.iloc[0], column)}"


def _energy(studies: Studies, rows: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Yield the line on energy over long runs: of configurations that keep it on most scenes the fastest."""
    ran = at_middle(studies["energy"].rows)
    keep = energy_parts(ran).query("part <= @KEPT").sort_values("scenes", ascending=False, kind="stable")
    if keep.empty:
        return
    timed = settings_by_scene(rows, SLIDER)
    longest = {label: ran[ran["label"] == label].sort_values("turns").iloc[-1] for label in keep.index}
    ms = {label: _ms_per_s(timed, row) for label, row in longest.items()}
    most = keep.index[keep["scenes"] == keep["scenes"].max()]
    common = set.intersection(*[{*ms[label]} for label in most if ms[label]] or [set[str]()])
    place = {label: max((ms[label].get(of, math.inf) for of in common), default=math.inf) for label in most}
    best = min(most, key=lambda label: place[label])
    others = keep[keep["solver"] != keep["solver"][best]]
    told = keep.index + ", " + keep["setting"] + keep["on"]
    turns = span(keep.loc[best, ["fewest_turns", "most_turns"]], ".0f")
    yield {
        "you need": f"energy balance within {100 * KEPT:g} % over {turns} revolutions",
        "use": told[best],
        "command": _command(longest[best]),
        TIME: min(ms[best].values(), default=math.nan),
        f"{TIME}{MOST}": max(ms[best].values(), default=math.nan),
        "next best": told[others.index[0]] if len(others) else "no other engine",
    }


def _ms_per_s(by_scene: ByScene, like: pd.Series) -> dict[str, float]:
    """Return by scene a configuration's run time for 1 s of motion in ms, at no coarser a setting."""
    times: dict[str, float] = {}
    for scene, (ran, _) in by_scene.items():
        own = ran[(ran["label"] == like["label"]) & (ran["value"] <= like["value"] * (1 + 1e-9))]
        if len(own):
            times[scene] = float((1e3 * own["time_s"] / own["end_time_s"]).iloc[0])
    return times


def _figure(rows: pd.DataFrame) -> Figure | None:
    """Return each engine's error over run time on two scenes, the fastest within the target ringed."""
    by_joints = [
        settings_by_scene(rows[rows["joints"] == joints], SLIDER) for joints in (LOOSE, IDEAL, RIGID)
    ]
    ran = next((of_class for of_class in by_joints if of_class), {})
    reached = {scene: of["engine"][of["kept"] <= TARGET_M].nunique() for scene, (of, _) in ran.items()}
    panels = []
    for scene in sorted(ran, key=lambda scene: (-reached[scene], scene))[:SCENES]:
        of, known = ran[scene]
        best = of[of["kept"] <= TARGET_M].sort_values("time_s").head(1)
        panels.append(cost_panel(scene, of, known, SLIDER, [*zip(best["time_s"], best["kept"], strict=True)]))
    title = "Which engine reaches which error in what run time, with clearance?"
    caption = (
        "A line is an engine at its best settings; points without a line are not ranked. Dashed: the error "
        "asked for; ring: the fastest; grey: uncertainty of the reference solution."
    )
    return Figure("answer", title, caption, "cost", draw(panels, 2.1), points(panels)) if panels else None


def _limits(studies: Studies) -> Iterator[Claim]:
    """Yield the limits of all that is said: the horizon, what is not modelled, what timings rest on."""
    if "predictability" in studies and (turns := horizon_turns(studies["predictability"].rows)):
        scene, least = next(iter(turns.items()))
        moved = float(studies["predictability"].rows["perturbation_rad"].dropna().iloc[0])
        text = (
            f"Predictability: on {scene} a {{moved}} change of the initial crank angle grows to 100 µm in "
            "{turns} revolutions (median); beyond that compare statistics only."
        )
        yield Claim("horizon", text, {"moved": (moved, "rad"), "turns": (least, "")})
    text = "reference solutions solve each engine's own model; flexibility, lubrication and wear are outside"
    yield Claim("model", f"Model: {text} the scope.")
    machine = studies["cost"].facts.get("machine", {}).get("processor") or "not on record"
    text = "ratios carry over to other machines better than milliseconds"
    yield Claim("timing", f"Timing: one processor, {machine}; {text}.")


CHAPTER = Chapter("answer", "Recommended solver and setting", ("accuracy", "cost"), "", parts)
