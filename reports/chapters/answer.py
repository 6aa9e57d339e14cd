"""The first screen: for every need the setting to use, and how engines stand beside the paper's method."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from shlex import quote
from typing import Any

import pandas as pd

from reports.analysis.equal_error import (
    ALONE,
    SLIDER,
    ByScene,
    Candidate,
    Ratio,
    candidates,
    ratio,
    settings_by_scene,
)
from reports.chapters.cost import IDEAL, LOOSE, RIGID, cost_panel, prepared
from reports.chapters.cost import STUDY as COST
from reports.chapters.energy import KEPT, UNACCOUNTED, EnergyPart, at_middle, energy_parts
from reports.chapters.energy import prepared as prepared_energy
from reports.chapters.predictability import horizon_turns
from reports.parts import Figure, Finding, Number, Studies, Table
from reports.plots.panels import draw
from reports.quantities import FORCE, PEAK
from reports.results import Results
from reports.run.command import command
from reports.style import legend_place
from reports.tables import ABSENT, setting, span

TITLE = "Recommended solver and setting"
READING = (
    "The fastest setting that reaches the error on all scenes of its kind, or on most; (2x): twice the run "
    "time of the one to use. Times are without start-up and compiling. " + ALONE
)
COMPARED = "The engines beside the reference's RK4"
BESIDE = (
    "The setting with the smallest error among those that take at most ten times as long as the reference's "
    "RK4 takes to be within 1 µm, or else the fastest; least and largest over the scenes. Peak force: the "
    "largest error of an impact's peak, in percent of that peak. Run time: of this RK4 within 1 µm is 1. "
    + ALONE
)
BESIDE_HEAD = (
    "configuration",
    "setting",
    "slider position error [µm]",
    "peak force error [%]",
    "energy-balance error [% of the energy in play]",
    "run time",
    "run time within 1 µm",
)
#: The findings that are limits of all that is said.
LIMITS = ("horizon", "model", "timing")
HEAD = ("you need", "use", "command", "time for 1 s of motion", "next best")
#: What a user needs: in words, the class of scenes, the column of errors, and the largest error.
NEEDS = (
    ("motion within 1 µm", IDEAL, SLIDER, 1e-6),
    ("motion within 1 µm", LOOSE, SLIDER, 1e-6),
    ("peak force of every impact within 1 %", LOOSE, PEAK, 1.0),
    ("forces within 1 N at all times", LOOSE, FORCE, 1.0),
    ("motion within 1 µm", RIGID, SLIDER, 1e-6),
)
#: The paper's RK4 by the class of scenes: its run time within the error is the one that others are told in.
PAPERS = {IDEAL: "reference (projection)", LOOSE: "reference (located)"}
#: How many times as long as that a setting may take to be compared, and the error that the time is for.
BUDGET, TARGET_M = 10.0, 1e-6
#: How many scenes the figure has.
SCENES = 2


@dataclass(frozen=True)
class Advice:
    """What is recommended for one need: the cells of the table by its ``HEAD``, and the same as a finding."""

    cells: tuple[str, ...]
    finding: Finding

    @classmethod
    def of(cls, name: str, cells: Sequence[str], **numbers: Number) -> "Advice":
        """Return the advice of these cells; ``numbers`` are those of its sentence."""
        need, use, _, time, next_best = cells
        text = f"For {need}: {use}; {time} for 1 s of motion; next best: {next_best}."
        return cls(tuple(cells), Finding(name, "{text}", text=text, **numbers))


def advice(studies: Studies) -> list[Advice]:
    """Return what is recommended for every need that the studies at hand tell of."""
    found: list[Advice] = []
    if COST in studies:
        rows = prepared(studies)
        for what, joints, column, target in NEEDS:
            of_class = rows[rows["joints"] == joints]
            if ran := settings_by_scene(of_class, column):
                found.append(_need(f"{what}, {joints}", of_class, ran, column, target))
    if "energy" in studies:
        found += _energy(studies)
    return found


def _need(need: str, rows: pd.DataFrame, ran: ByScene, column: str, target: float) -> Advice:
    """Return the advice for an error on a class of scenes."""
    found, name = candidates(ran, target), f"{column}-{need.rpartition(', ')[2].replace(' ', '-')}"
    if not found:
        return Advice.of(name, (need, "no setting that was run", *[ABSENT] * 3))
    best, *others = found
    level = [other for other in others if _is_level(other, best)]
    others = [other for other in others if other not in level]
    ms = [1e3 * seconds for seconds in _seconds(best, ran)]
    cells = (
        need,
        " or ".join(_named(each, len(ran)) for each in (best, *level)),
        _typed(rows, best),
        f"{span(ms)} ms{best.runs[0].mark(column)}",
        "; ".join([*_next_best(others[:1], best, column, ran), *_faster(others[1:], best, column, ran)])
        or "no other engine",
    )
    behind = max(_behind(others[0], best), key=lambda of: of.times, default=None) if others else None
    slower = {"slower": Number(behind.times, "times", behind.low, behind.high)} if behind else {}
    return Advice.of(name, cells, time=Number(max(ms), "ms"), **slower)


def _named(each: Candidate, scenes: int) -> str:
    on = "" if len(each.scenes) == scenes else f" ({len(each.scenes)} of {scenes} scenes)"
    return f"{each.label}, {each.setting}{on}"


def _seconds(each: Candidate, ran: ByScene) -> list[float]:
    """Return the run time for one second of motion on each scene."""
    pairs = zip(each.scenes, each.runs, strict=True)
    return [run.time_s / float(ran[scene][0]["end_time_s"].iloc[0]) for scene, run in pairs]


def _behind(other: Candidate, best: Candidate) -> list[Ratio]:
    """Return the ratios of run times on the scenes that both reach."""
    own = dict(zip(best.scenes, best.runs, strict=True))
    pairs = [(run, own[scene]) for scene, run in zip(other.scenes, other.runs, strict=True) if scene in own]
    return [ratio(run, base) for run, base in pairs]


def _is_level(other: Candidate, best: Candidate) -> bool:
    """Return whether two settings reach the error on as many scenes in times that are not resolved."""
    ratios = _behind(other, best)
    return len(other.scenes) == len(best.scenes) and bool(ratios) and not any(of.decided for of in ratios)


def _next_best(others: Sequence[Candidate], best: Candidate, column: str, ran: ByScene) -> Iterator[str]:
    """Yield other settings with their run times in times of those of the best one."""
    for other in others:
        times = span(of.times for of in _behind(other, best))
        yield f"{_named(other, len(ran))} ({times}x){other.runs[0].mark(column)}"


def _faster(others: Sequence[Candidate], best: Candidate, column: str, ran: ByScene) -> Iterator[str]:
    """Yield the settings that are faster than the best one on some scene."""
    faster = [each for each in others if any(of.decided and of.times < 1 for of in _behind(each, best))]
    yield from (f"faster where it runs: {text}" for text in _next_best(faster, best, column, ran))


def _typed(rows: pd.DataFrame, best: Candidate) -> str:
    """Return the command that makes the recommended run on the first scene."""
    row = rows.loc[best.runs[0].row]
    return command(row, f"{quote(row['scene'])} --end {row['end_time_s']:.6g}")


def _energy(studies: Studies) -> Iterator[Advice]:
    """Yield the advice for energy over long runs: of configurations that keep it the fastest one."""
    ran = at_middle(prepared_energy(studies["energy"].rows))
    keep = [each for each in energy_parts(ran) if each.part <= KEPT]
    if not keep:
        return
    timed = settings_by_scene(prepared(studies), SLIDER) if COST in studies else {}
    longest = {each.label: ran[ran["label"] == each.label].sort_values("turns").iloc[-1] for each in keep}
    times = {label: _seconds_of(timed, row) for label, row in longest.items()}
    most = [each.label for each in keep if each.scenes == max(each.scenes for each in keep)]
    timed_on = [set(times[label]) for label in most if times[label]]
    common = set.intersection(*timed_on) if timed_on else set[str]()

    def place(each: EnergyPart) -> tuple[int, float]:
        return -each.scenes, max(
            (times[each.label].get(scene, math.inf) for scene in common), default=math.inf
        )

    best, *others = sorted(keep, key=place)
    row, others = longest[best.label], [each for each in others if each.engine != best.engine]
    turns = span([best.fewest_turns, best.most_turns], ".0f")
    ms = [1e3 * each for each in times[best.label].values()]
    cells = (
        f"energy balance within {100 * KEPT:g} % over {turns} revolutions",
        _kept_by(best),
        command(row, f"{quote(row['scene'])} --end {row['end_time_s']:.6g}"),
        f"{span(ms)} ms" if ms else "not timed",
        _kept_by(others[0]) if others else "no other engine",
    )
    yield Advice.of("energy", cells, part=Number(100 * best.part, "%"))


def _kept_by(each: EnergyPart) -> str:
    on = "" if each.scenes == each.of_scenes else f" ({each.scenes} of {each.of_scenes} scenes)"
    return f"{each.label}, {each.setting}{on}"


def _seconds_of(by_scene: ByScene, like: pd.Series) -> dict[str, float]:
    """Return by scene the run time of a row's configuration for 1 s of motion, at no coarser a setting."""
    at = like["step_s"] if math.isnan(like["tolerance"]) else like["tolerance"]
    times: dict[str, float] = {}
    for scene, (ran, _) in by_scene.items():
        own = ran[(ran["label"] == like["label"]) & (ran["value"] <= at * (1 + 1e-9))]
        if len(own):
            times[scene] = float((own["time_s"] / own["end_time_s"]).iloc[0])
    return times


#: An engine's settings beside the paper's method, one a scene, by the names of what is told of them.
Picks = list[dict[str, Any]]


def beside(studies: Studies) -> dict[str, list[Picks]]:
    """Return by class of scenes the paper's method and every engine beside it.

    Of an engine it is the setting with the smallest error among those that take at most ``BUDGET`` times as
    long as the paper's method takes to be within ``TARGET_M``; if all take longer, the fastest.
    """
    if COST not in studies:
        return {}
    rows, found = prepared(studies), {}
    for joints, papers in PAPERS.items():
        picks: dict[str, Picks] = {papers: []}
        for ran, _ in settings_by_scene(rows[rows["joints"] == joints], SLIDER).values():
            base = ran[(ran["label"] == papers) & (ran["kept"] <= TARGET_M)].sort_values("time_s").head(1)
            for time_s in base["time_s"]:
                picks[papers].append(_pick(base, time_s, rows))
                for engine, own in ran[ran["label"] != papers].groupby("engine"):
                    picks.setdefault(str(engine), []).append(_pick(own, time_s, rows))
        if picks[papers]:
            found[joints] = [
                picks.pop(papers),
                *(picks[name] for name in sorted(picks, key=lambda name: legend_place(name, ""))),
            ]
    return found


def compared(studies: Studies) -> Iterator[Table]:
    """Yield for each class of scenes the table of engines beside the paper's method."""
    for joints, lines in beside(studies).items():
        name, cells = f"compared-{joints.replace(' ', '-')}", tuple(map(_cells, lines))
        yield Table(name, f"{COMPARED}, {joints}", BESIDE, COST, BESIDE_HEAD, cells).on_page()


def sentences(studies: Studies) -> Iterator[Finding]:
    """Yield the same in a sentence for each engine."""
    for joints, (_, *others) in beside(studies).items():
        for picks in others:
            label, settings, position, peak, energy, times, reached = _cells(picks)
            peaks = "" if peak == ABSENT else f"impacts' peak forces off by {peak} %, "
            text = (
                f"Beside {PAPERS[joints]}, {joints}: {label}, {settings}: slider off by {position} µm, "
                f"{peaks}energy by {energy} % of that in play, run time {times}x; within 1 µm: {reached}."
            )
            names = ("position", "energy", "times")
            largest = {name: Number(max(pick[name] for pick in picks)) for name in names}
            yield Finding(f"beside-{label}-{joints}".replace(" ", "-"), "{text}", text=text, **largest)


def within(studies: Studies) -> Iterator[Finding]:
    """Yield the run time of each engine's cheapest setting within the target, scene by scene."""
    parts = []
    for joints, lines in beside(studies).items():
        told = (
            f"{' or '.join(dict.fromkeys(pick['by'] for pick in picks))} {_cells(picks)[-1]}"
            for picks in lines[1:]
        )
        parts.append(f"{joints}: {', '.join(told)} (1: {PAPERS[joints]})")
    if parts:
        text = (
            "Run time of each engine's cheapest setting that has the slider within 1 µm, scene by scene, in "
            f"multiples of that of the reference's RK4: {'; '.join(parts)}."
        )
        yield Finding("within", "{text}", text=text)


def _pick(ran: pd.DataFrame, papers_s: float, rows: pd.DataFrame) -> dict[str, Any]:
    """Return an engine's setting on a scene, with its errors, its run time as a multiple of the paper's."""
    within = ran[ran["time_s"] <= BUDGET * papers_s]
    best = (within.sort_values("kept") if len(within) else ran.sort_values("time_s")).iloc[0]
    reached = ran[ran["kept"] <= TARGET_M].sort_values("time_s").head(1)
    row = rows.loc[best.name]
    return {
        "label": best["label"],
        "setting": setting(best["knob"], best["value"]),
        "position": 1e6 * best["error"],
        "peak": row[PEAK],
        "energy": 100 * row[UNACCOUNTED],
        "times": best["time_s"] / papers_s,
        "reached": reached["time_s"].min() / papers_s,
        "by": next(iter(reached["label"]), best["label"]),
    }


def _cells(picks: Picks) -> tuple[str, ...]:
    """Return the cells of an engine by ``BESIDE_HEAD``: the least and the largest over scenes."""
    reached = [pick["reached"] for pick in picks]
    on = "" if not any(map(math.isnan, reached)) else " (not on all scenes)"
    return (
        " or ".join(dict.fromkeys(pick["label"] for pick in picks)),
        "; ".join(dict.fromkeys(pick["setting"] for pick in picks)),
        *(span(pick[name] for pick in picks) for name in ("position", "peak", "energy", "times")),
        "not reached" if all(map(math.isnan, reached)) else span(reached) + on,
    )


def table(found: Sequence[Advice]) -> Table | None:
    """Return the table of what is recommended."""
    if not found:
        return None
    return Table("answer", TITLE, READING, COST, HEAD, tuple(each.cells for each in found)).on_page()


def figure(studies: Studies) -> Figure | None:
    """Return each engine's error over run time on two scenes, the fastest within the target ringed."""
    if COST not in studies:
        return None
    rows, target = prepared(studies), 1e-6
    by_joints = [
        settings_by_scene(rows[rows["joints"] == joints], SLIDER) for joints in (LOOSE, IDEAL, RIGID)
    ]
    ran = next((of_class for of_class in by_joints if of_class), None)
    if ran is None:
        return None
    reached = {scene: of["engine"][of["kept"] <= target].nunique() for scene, (of, _) in ran.items()}
    shown = sorted(ran, key=lambda scene: (-reached[scene], scene))[:SCENES]
    panels = []
    for scene in shown:
        of, known = ran[scene]
        best = of[of["kept"] <= target].sort_values("time_s").head(1)
        rings = tuple(zip(best["time_s"], best["kept"], strict=True))
        panels.append(cost_panel(scene, of, known, SLIDER, rings=rings))
    title = "Which engine reaches which error in what run time, with clearance?"
    reading = (
        "A line is an engine at its best settings; points without a line are not ranked. Dashed: the error "
        "asked for; ring: the fastest; grey: uncertainty of the reference solution."
    )
    return Figure("answer", title, reading, COST, draw(panels, 2.1))


def findings(studies: Studies, found: Sequence[Advice]) -> Iterator[Finding]:
    """Yield all that the first screen says, the limits of it last."""
    yield from (each.finding for each in found)
    yield from sentences(studies)
    yield from within(studies)
    yield from limits(studies)


def limits(studies: Studies) -> Iterator[Finding]:
    """Yield the limits of all that is said: the horizon, what is not modelled, what timings rest on."""
    if "predictability" in studies and (turns := horizon_turns(studies["predictability"].rows)):
        scene, least = min(turns.items(), key=lambda item: item[1])
        text = (
            "Predictability: on {scene} a {moved} change of the initial crank angle grows to 100 µm in "
            "{turns} revolutions (median); beyond that compare statistics only."
        )
        changes = studies["predictability"].rows["perturbation_rad"].dropna()
        moved = Number(float(changes.iloc[0]), "rad")
        yield Finding("horizon", text, scene=scene, moved=moved, turns=Number(least))
    text = (
        "Model: reference solutions solve each engine's own model; flexibility, lubrication and wear are "
        "outside the scope."
    )
    yield Finding("model", text)
    if COST in studies:
        text = (
            "Timing: one processor, {machine}; ratios carry over to other machines better than milliseconds."
        )
        yield Finding("timing", text, machine=machine(studies[COST]))


def machine(results: Results) -> str:
    """Return the processor that a study was run on."""
    return str(results.facts.get("machine", {}).get("processor") or "not on record")
