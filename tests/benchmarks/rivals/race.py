"""The study's settings beside scripts of engines alone: ``python -m tests.benchmarks.rivals.race``.

All take turns in one process, in a new order every round; the least time of each counts. A script stands
beside the study's fastest setting of the same engine whose error is no larger. heyoka is no engine of the
study but its limit of speed: beside it stands the reference, both by their cheapest within one target.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from random import Random

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from reports.results import SLIDER
from studies.accuracy import SAMPLES, case_of
from studies.case import Case, run_case
from studies.judges.converged_truth import converged
from studies.settings import END_S, ladder
from tests.benchmarks.rivals.problem import Answer, FloatArray

ROUNDS = 10
#: How often a script runs in a turn; the study times its own as often.
REPEATS = 3
#: A configuration that takes more than so many times of a script's is beaten.
BEATEN = 1.25
TORQUE = "driver_torque_error_N_m"
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

    def solve(self, setting: float, samples: int) -> Answer:
        """Run the script."""
        module = import_module(f"tests.benchmarks.rivals.{self.module}")
        run: Callable[[float, int], Answer] = getattr(module, self.scene.partition("-0")[0].replace("-", "_"))
        return run(setting, samples)

    def error(self, setting: float) -> float:
        """Return the largest error at a setting over the samples."""
        return float(np.abs(self.solve(setting, SAMPLES).signal - true(self.scene, self.column)).max())


IDEAL, DRIVEN = "ideal-free", "ideal-driven"
LOOSE, LOOSE_DRIVEN = "clearance-free-0.5mm", "clearance-driven-0.5mm"
TOLERANCES, LOOSE_TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12), (1e-8, 1e-10, 1e-12)
LIMIT_TOLERANCES = tuple(10.0**-k for k in range(4, 13))
RIVALS = (
    Rival("exudyn_alone", IDEAL, SLIDER, (24 * 42, 24 * 168)),
    Rival("exudyn_alone", DRIVEN, TORQUE, (24 * 20, 24 * 80)),
    Rival("exudyn_alone", LOOSE, SLIDER, (1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)),
    Rival("pymunk_alone", IDEAL, SLIDER, (24 * 168, 24 * 672)),
    Rival("pymunk_alone", DRIVEN, SLIDER, (24 * 10, 24 * 40)),
    Rival("scipy_minimal", IDEAL, SLIDER, TOLERANCES),
    Rival("scipy_minimal", LOOSE, SLIDER, LOOSE_TOLERANCES),
    *(Rival("heyoka_minimal", scene, SLIDER, LIMIT_TOLERANCES) for scene in (IDEAL, LOOSE, LOOSE_DRIVEN)),
)


@cache
def physics(scene: str) -> Scene:
    """Return a scene, cut to the time for which it is followed."""
    made = SCENES[scene]()
    return made.model_copy(update={"end_time_s": END_S.get(scene, made.end_time_s)})


@cache
def true(scene: str, column: str) -> FloatArray:
    """Return the true values at the samples of what a column has the errors of."""
    truth, _ = converged(physics(scene), SAMPLES)
    values = truth.position[:, -1, 0] if column == SLIDER else truth.driver_torque_N_m
    assert values is not None
    return values


@dataclass
class Entry:
    """A script or a configuration of the study at a setting: its error, and the least time of its turns."""

    name: str
    error: float
    turn: Callable[[], float]
    time_s: float = np.inf


def scripts(rival: Rival) -> Iterator[Entry]:
    """Yield a script at each setting."""
    for setting in rival.settings:

        def turn(setting: float = setting) -> float:
            return min(rival.solve(setting, 1).seconds for _ in range(REPEATS))

        yield Entry(f"{rival.module}, {setting:g}", rival.error(setting), turn)


@cache
def of_study(scene: str, engine: str, column: str) -> list[Entry]:
    """Return the study's settings of an engine that finish on a scene."""
    entries = []
    for setting in ladder(physics(scene), full=True):
        if setting.arm.engine == engine:
            row, _ = run_case(case_of("accuracy", physics(scene), setting, SAMPLES))
            timed = case_of("accuracy", physics(scene), setting, 1, timed=True)

            def turn(timed: Case = timed) -> float:
                return float(str(run_case(timed)[0].get("solve_time_s", np.inf)))

            if row["status"] == "ok":
                name = f"{setting.arm.label}, {setting.step_s:.3g} s, {dict(setting.added)}"
                entries.append(Entry(name, float(str(row.get(column, np.inf))), turn))
    return entries


def cheapest(entries: list[Entry], error: float) -> Entry:
    """Return the fastest entry whose error is no larger, or one that takes forever."""
    within = (entry for entry in entries if entry.error <= error)
    return min(within, key=lambda entry: entry.time_s, default=Entry("error not reached", np.nan, float))


def main() -> None:
    """Measure and print; heyoka's scripts where it is installed."""
    sys.exudynFast = True  # type: ignore[attr-defined]  # its build without range checks
    pairs = []
    for rival in (rival for rival in RIVALS if rival.engine != LIMIT or find_spec(LIMIT)):
        engine = REFERENCE if rival.engine == LIMIT else rival.engine
        pairs.append((rival, list(scripts(rival)), of_study(rival.scene, engine, rival.column)))
    entries = list({id(entry): entry for _, *both in pairs for each in both for entry in each}.values())
    for k in track(range(ROUNDS), "rounds"):
        for entry in Random(k).sample(entries, len(entries)):
            entry.time_s = min(entry.time_s, entry.turn())
    table = Table("scene", "script", "error", "ms", "study", "error", "ms", "ratio", "")
    for rival, theirs, ours in pairs:
        limit = rival.engine == LIMIT
        for script in [cheapest(theirs, TARGET_M)] if limit else theirs:
            best = cheapest(ours, TARGET_M if limit else script.error)
            ratio = best.time_s / script.time_s
            cells = [f"{x:.3g}" for x in (script.error, 1e3 * script.time_s, best.error, 1e3 * best.time_s)]
            beaten = "BEATEN" if not limit and BEATEN < ratio < np.inf else ""
            table.add_row(rival.scene, script.name, *cells[:2], best.name, *cells[2:], f"{ratio:.2f}", beaten)
    Console(width=160).print(table)
    if not find_spec(LIMIT):
        print(f"{LIMIT} is not installed: pip install {LIMIT}")


if __name__ == "__main__":
    main()
