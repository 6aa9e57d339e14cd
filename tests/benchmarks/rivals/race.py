"""The study's settings beside scripts of engines alone: ``python -m tests.benchmarks.rivals.race``.

All take turns in one process, in a new order every round. A ratio is the run time of the study's fastest
setting over the script's, at the error of the script. heyoka is no engine of the study but its limit of
speed: beside its scripts stand the reference's settings, and the cheapest of either within one target are
compared, by the least time of the rounds.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from random import Random

import numpy as np
import pandas as pd
from rich.console import Console
from rich.progress import track
from rich.table import Table

from engine_models.arms import Arm
from engine_models.exudyn.fast_build import load_build
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from reports.analysis.equal_error import SLIDER, choice_at, fastest, ratio, settings_by_scene
from reports.results import with_columns
from studies import clearance
from studies.judges.converged_truth import converged
from studies.ladders import ladder
from studies.running.case import Case, Row
from studies.running.outcome import run_case
from studies.work_precision.study import NAME, SAMPLES, case_of
from tests.benchmarks.rivals import problem
from tests.benchmarks.rivals.problem import Answer, FloatArray

ROUNDS = 10
#: How often a script runs in a turn; the least counts, as of short runs.
REPEATS = 3
#: A configuration that surely takes more than so many times of a script's is beaten.
BEATEN = 1.25
TORQUE = "driver_torque_error_N_m"
#: How the names of the scripts' configurations begin.
SCRIPT = "script"
#: The limit of speed, who is compared with it, and the error of the slider that both keep, in m.
LIMIT, REFERENCE, TARGET_M = "heyoka", "reference", 1e-6


@dataclass(frozen=True)
class Rival:
    """A script on a scene, judged by the errors of a column, at tolerances or at numbers of steps."""

    module: str
    scene: str
    column: str
    settings: tuple[float, ...]

    @property
    def engine(self) -> str:
        """The engine's name."""
        return self.module.partition("_")[0]

    @property
    def of_study(self) -> str:
        """The engine of the study whose settings stand beside it."""
        return REFERENCE if self.engine == LIMIT else self.engine

    @property
    def arm(self) -> Arm:
        """What it is called beside the study's configurations."""
        return Arm(self.engine, f"{SCRIPT} {self.module}")

    def solve(self, setting: float, samples: int) -> Answer:
        """Run the script."""
        module = import_module(f"tests.benchmarks.rivals.{self.module}")
        run: Callable[[float, int], Answer] = getattr(module, self.scene.partition("-0")[0].replace("-", "_"))
        return run(setting, samples)

    def error(self, setting: float) -> float:
        """Return the largest error at a setting over the samples."""
        return float(np.abs(self.solve(setting, SAMPLES).signal - true(self.scene, self.column)).max())


IDEAL, DRIVEN, LOOSE = "ideal-free", "ideal-driven", "clearance-free-0.5mm"
LOOSE_DRIVEN, RIGID = "clearance-driven-0.5mm", ("rigid-free-0.5mm", "rigid-driven-0.5mm")
TOLERANCES, LOOSE_TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12), (1e-8, 1e-10, 1e-12)
LIMIT_TOLERANCES = tuple(10.0**-k for k in range(4, 13))
#: How long scenes are followed that the study does not follow as long, in s.
END_S = dict(zip(RIGID, (problem.RIGID_END_S, problem.RIGID_DRIVEN_END_S), strict=True))
RIVALS = (
    Rival("exudyn_alone", IDEAL, SLIDER, (24 * 42, 24 * 168)),
    Rival("exudyn_alone", DRIVEN, TORQUE, (24 * 20, 24 * 80)),
    Rival("exudyn_alone", LOOSE, SLIDER, (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)),
    Rival("exudyn_wide", LOOSE, SLIDER, (1e-5, 1e-7, 1e-8)),
    Rival("pymunk_alone", IDEAL, SLIDER, (24 * 168, 24 * 672)),
    Rival("pymunk_alone", DRIVEN, SLIDER, (24 * 10, 24 * 40)),
    Rival("scipy_minimal", IDEAL, SLIDER, TOLERANCES),
    Rival("scipy_ode", IDEAL, SLIDER, TOLERANCES),
    Rival("scipy_minimal", LOOSE, SLIDER, LOOSE_TOLERANCES),
    *(
        Rival("heyoka_minimal", scene, SLIDER, LIMIT_TOLERANCES)
        for scene in (IDEAL, LOOSE, LOOSE_DRIVEN, *RIGID)
    ),
)


@cache
def physics(scene: str) -> Scene:
    """Return a scene, cut to the time for which it is followed."""
    made = SCENES[scene]()
    ends = clearance.END_S | END_S
    return made.model_copy(update={"end_time_s": ends.get(scene, made.end_time_s)})


@cache
def true(scene: str, column: str) -> FloatArray:
    """Return the true values at the samples of what a column has the errors of."""
    truth, _ = converged(physics(scene), SAMPLES)
    values = truth.position[:, -1, 0] if column == SLIDER else truth.driver_torque_N_m
    assert values is not None
    return values


Turn = Callable[[], Row]


def scripts(rival: Rival) -> Iterator[tuple[Row, Turn]]:
    """Yield the recorded row of a script at each setting, and what times it there."""
    for setting in rival.settings:
        row: Row = {
            "scene": rival.scene,
            "engine": rival.engine,
            "arm": rival.arm.name,
            "label": rival.arm.label,
            "status": "ok",
            "step_s": physics(rival.scene).end_time_s / max(setting, 1.0),
            "setting_step_tolerance": min(setting, 1.0),
        }

        def turn(row: Row = row, setting: float = setting) -> Row:
            times = [rival.solve(setting, 1).seconds for _ in range(REPEATS)]
            return {**row, "solve_time_s": min(times)}

        yield {**row, rival.column: rival.error(setting)}, turn


def of_study(rival: Rival) -> Iterator[tuple[Row, Turn]]:
    """Yield the recorded row of each setting that the study has beside a script, and what times it."""
    scene = physics(rival.scene)
    for rung in ladder(scene, full=True):
        if rung.arm.engine == rival.of_study:
            row, _ = run_case(case_of(NAME, scene, rung, SAMPLES))
            timed = case_of(NAME, scene, rung, 1, timed=True)

            def turn(timed: Case = timed) -> Row:
                row, _ = run_case(timed)
                return {**row, "solve_time_s": row.get("solve_time_s", np.nan)}

            if row["status"] == "ok":
                yield row, turn


def raced(rivals: Sequence[Rival], rounds: int) -> pd.DataFrame:
    """Return the recorded rows of scripts and of the study's settings, and those of the timed rounds."""
    entries = [(rival, *entry) for rival in rivals for entry in (*scripts(rival), *of_study(rival))]
    rows = [row for _, row, _ in entries]
    for k in track(range(rounds), "rounds"):
        rows += [{**turn(), "round": k} for _, _, turn in Random(k).sample(entries, len(entries))]
    return pd.DataFrame(rows)


def verdicts(rival: Rival, rows: pd.DataFrame) -> Iterator[tuple[str, ...]]:
    """Yield for each setting of a script its error, the study's fastest choice, and the ratio of times."""
    own = rows[(rows["scene"] == rival.scene) & (rows["engine"] == rival.engine)]
    for ran, _ in settings_by_scene(with_columns(own, "compiled_anew"), rival.column).values():
        studied = ran[~ran["label"].astype(str).str.startswith(f"{rival.engine} ({SCRIPT} ")]
        for script in ran[ran["label"] == rival.arm.label].itertuples():
            ours, theirs = fastest(studied, script.error), choice_at(script)
            share = ratio(ours, theirs) if ours else None
            way = f"{ours.label}, {ours.setting}" if ours else "error not reached"
            beaten = "BEATEN" if share and share.low > BEATEN else ""
            yield rival.scene, theirs.label, f"{script.error:.1e}", way, str(share or ""), beaten


def against_limit(scene: str, rows: pd.DataFrame) -> tuple[str, ...]:
    """Return setting, error and least time of the cheapest of both within the target, and the ratio."""
    own = rows[(rows["scene"] == scene) & rows["engine"].isin([LIMIT, REFERENCE])]
    ran, _ = settings_by_scene(with_columns(own, "compiled_anew"), SLIDER)[scene]
    within = ran[ran["kept"] <= TARGET_M]
    least = within.assign(time_s=within["times_s"].map(np.nanmin)).sort_values("time_s")
    cells, times_s = [scene], dict[str, float]()
    for engine in (LIMIT, REFERENCE):
        best = least[least["engine"] == engine].iloc[0]
        times_s[engine] = best["time_s"]
        way = f"{best['label']}, {best['knob']} {best['value']:.3g}"
        cells += [f"{way}: {best['kept']:.1e} m", f"{1e3 * best['time_s']:.3f} ms"]
    return *cells, f"{times_s[REFERENCE] / times_s[LIMIT]:.2f}"


def main() -> None:
    """Measure and print; heyoka's scripts where it is installed."""
    load_build(fast=True)
    rivals = [rival for rival in RIVALS if rival.engine != LIMIT or find_spec(LIMIT)]
    rows = raced(rivals, ROUNDS)
    table = Table("scene", "script", "error", "study", "its time over the script's", "")
    limit = Table("scene", LIMIT, "", REFERENCE, "", f"ratio within {TARGET_M:g} m")
    for rival in rivals:
        if rival.engine == LIMIT:
            limit.add_row(*against_limit(rival.scene, rows))
            continue
        for line in verdicts(rival, rows):
            table.add_row(*line)
    console = Console(width=160)
    console.print(table)
    console.print(limit if find_spec(LIMIT) else f"{LIMIT} is not installed: pip install {LIMIT}")


if __name__ == "__main__":
    main()
