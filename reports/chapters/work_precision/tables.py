"""The tables of the work-precision study, and its sentences on the reference's place."""

from collections.abc import Sequence

import numpy as np

from reports.equal_error import Rung, duel, levels, rungs, time_at
from reports.parts import Table
from reports.quantities import Quantity
from reports.results import Run
from reports.style import ordered, words
from reports.tables import ABSENT, in_text, number

REFERENCE = "reference"
#: At equal error the reference should need at most this part of the best rival's time on clearance scenes.
AIM = 0.1


def cheapest(kind: str, runs: Sequence[Run], scenes: Sequence[str], quantity: Quantity) -> Table:
    """Return the run time of every engine's best arm at equal errors, and the ratio of the two cheapest."""
    name, unit = words(quantity.name)
    engines = list(dict.fromkeys(engine for engine, _ in ordered(run.name for run in runs)))
    rows = []
    for scene in scenes:
        floor = quantity.floor(runs, scene)
        found = rungs(runs, scene, quantity, floor)
        of = {engine: [rung for rung in found if rung.name[0] == engine] for engine in engines}
        for level in levels(found, floor):
            rows.append((scene, number(level), *_times(of, level), *_ratio(of, level)))
    return Table(
        f"work-precision-{kind}-{quantity.name.rpartition('_error')[0].replace('_', '-')}",
        f"Run time at equal {name}",
        f"Run time in ms of each engine's cheapest arm at an error in {unit}, interpolated between the rungs "
        "of its ladder; a dash where it does not get there. The ratio is the second cheapest engine's time "
        "in times the cheapest's: median over the rounds, and their range. In brackets where the rounds do "
        "not agree who is cheaper.",
        ("scene", f"error [{unit}]", *engines, "cheapest", "second", "ratio"),
        tuple(rows),
    )


def _times(of: dict[str, list[Rung]], level: float) -> list[str]:
    times = [time_at(found, level) if found else None for found in of.values()]
    return [ABSENT if time is None else f"{1e3 * time:.2g}" for time in times]


def _ranked(of: dict[str, list[Rung]], level: float) -> list[str]:
    """Return the engines that reach an error, cheapest first."""
    times = {engine: time_at(found, level) for engine, found in of.items() if found}
    reached = {engine: time for engine, time in times.items() if time is not None}
    return sorted(reached, key=lambda engine: reached[engine])


def _ratio(of: dict[str, list[Rung]], level: float) -> tuple[str, str, str]:
    engines = _ranked(of, level)
    if len(engines) < 2:
        return engines[0] if engines else ABSENT, ABSENT, ABSENT
    first, second = engines[:2]
    found = duel(of[second], of[first], level)
    if found is None:
        return first, second, ABSENT
    text = f"{found.median:.2g} ({found.least:.2g} to {found.most:.2g})"
    return first, second, text if found.decided else f"[{text}]"


def reference_against_rivals(runs: Sequence[Run], scene: str, quantity: Quantity) -> str | None:
    """Return the reference's place on a scene in a sentence; None without a rival."""
    floor = quantity.floor(runs, scene)
    found = rungs(runs, scene, quantity, floor)
    engines = {rung.name[0] for rung in found}
    of = {engine: [rung for rung in found if rung.name[0] == engine] for engine in engines}
    shares: list[tuple[float, float, str]] = []
    for level in levels(found, floor):
        rivals = [engine for engine in _ranked(of, level) if engine != REFERENCE]
        fought = duel(of[REFERENCE], of[rivals[0]], level) if rivals and REFERENCE in of else None
        if fought is not None:
            shares.append((level, fought.median, rivals[0]))
    if not shares:
        return None
    level, worst, rival = max(shares, key=lambda share: share[1])
    best_level, best, best_rival = min(shares, key=lambda share: share[1])
    name, unit = words(quantity.name)
    wins = worst < 1
    met = sum(share <= AIM for _, share, _ in shares)
    return (
        f"{scene}: at equal {name} the reference needs between {best:.2g} (at {in_text(best_level)} {unit}, "
        f"against {best_rival}) and {worst:.2g} (at {in_text(level)} {unit}, against {rival}) of the best "
        f"rival's run time, at most a tenth at {met} of {len(shares)} errors"
        + (
            "."
            if wins
            else f"; it is not the cheapest at {sum(share >= 1 for _, share, _ in shares)} of them."
        )
    )


def building(runs: Sequence[Run]) -> Table:
    """Return what building the model and reading out take, by engine and arm, over the timed runs."""
    rows = []
    timed = [run for run in runs if "build_time_s" in run.values]
    for name in ordered(run.name for run in timed):
        times = 1e3 * np.array([run.values["build_time_s"] for run in timed if run.name == name])
        rows.append((*name, f"{np.median(times):.2g}", f"{times.min():.2g}", f"{times.max():.2g}"))
    return Table(
        "work-precision-building",
        "Building and reading out",
        "Wall time of a bare run besides the native solve, in ms, over all scenes and rungs.",
        ("engine", "arm", "median [ms]", "least [ms]", "most [ms]"),
        tuple(rows),
    )


def compiling(runs: Sequence[Run]) -> Table | None:
    """Return what compiling takes, by scene and engine; None if nothing was compiled anew."""
    timed = [run for run in runs if run.ok and "compile_time_s" in run.values]
    rows = sorted((run.scene, run.engine, f"{run.values['compile_time_s']:.2g}") for run in timed)
    if not rows:
        return None
    return Table(
        "work-precision-compiling",
        "Compiling",
        "Wall time in s of compiling a scene's kernels on a machine that has none; they are kept from then "
        "on. Engines that are not here bring their code compiled.",
        ("scene", "engine", "time [s]"),
        tuple(rows),
    )


def failures(runs: Sequence[Run]) -> Table | None:
    """Return the recorded runs that did not finish, with the reason; None if all did."""
    failed = [run for run in runs if not run.ok and not run.values.keys() & {"round", "compiled_anew"}]
    if not failed:
        return None
    rows = tuple((run.scene, *run.name, number(run.step_s), run.status, run.reason) for run in failed)
    return Table(
        "work-precision-failures",
        "Runs that did not finish",
        "Recorded runs of a rung that ended early, and why.",
        ("scene", "engine", "arm", "step [s]", "status", "reason"),
        rows,
    )
