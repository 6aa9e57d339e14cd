"""One scene of the user's, every engine that can run it, at a few of its best settings.

What is measured is what the studies measure: errors of recorded runs, and times of bare ones.
"""

from collections.abc import Collection

import numpy as np

from engine_models import arms
from engine_models.engine import RunSettings, Trajectory, UnsupportedScene
from engine_models.mechanics.states import lever_m
from engine_models.scene.plain_words import unknown
from engine_models.scene.scene import Scene
from studies import accuracy, cost
from studies.case import Case, Curves, Row
from studies.failures import BadInput
from studies.judges.converged_truth import GRID, converged, followed
from studies.judges.metrics import signals, with_suffix
from studies.settings import Rung, configurations, ladder

NAME = "compare"
#: A hundredth of the clearance is a line's width in a picture of the pin's path, a millionth of a crank, or
#: of the longest lever, what a workshop measures. Where the crank is prescribed so is the ideal slider, and a
#: torque sensor is good to a thousandth.
CLEARANCE_PART, CRANK_PART, TORQUE_PART = 1e-2, 1e-6, 1e-3
#: No step is longer than the time between two samples, but impacts are told between them.
SAMPLES = 60
#: Settings of a configuration, those in the middle of its series: around what people ask for.
SETTINGS = 3
AS_THEY_COME = (arms.EXUDYN, arms.SCIPY)
#: A run that takes longer would not be recommended. A kernel's compilation counts.
LIMIT_S = 120.0
#: What the reference solution may take, which is found before any run is made.
TRUTH_LIMIT_S = 300.0


def ask(scene: Scene, error: float | None = None, signal: str | None = None) -> tuple[str, float]:
    """Return the column of errors by which engines are judged, and the error wanted in its unit.

    The scene's reference solution is found for it: there may be none, or none beyond the start.
    """
    truth, _ = converged(scene, GRID)
    if followed(scene, GRID) < 2:
        raise UnsupportedScene("starts a hair apart part at once: nobody can know its motion")
    column, wanted = _judged(scene, truth)
    if signal is not None:
        columns = {name: with_suffix(name, "error") for name, _ in signals(scene, truth)}
        if truth.driver_torque_N_m is not None:
            columns[_effort(scene).replace("_error", "")] = _effort(scene)
        named = columns | {name.rpartition("_")[0]: error for name, error in columns.items()}
        if signal not in named:
            raise BadInput(unknown("signal", signal, columns))
        if named[signal] != column and error is None:
            raise BadInput(f"error: expected the error asked for beside signal {signal}, got nothing")
        column = named[signal]
    return column, wanted if error is None else error


def _effort(scene: Scene) -> str:
    return "driver_torque_error_N_m" if scene.mechanism.drive.guide is None else "driver_force_error_N"


def _judged(scene: Scene, truth: Trajectory) -> tuple[str, float]:
    clearances = scene.clearances.values()
    if not clearances and scene.mechanism.drive.prescribes:
        assert truth.driver_torque_N_m is not None
        if peak_N_m := float(np.abs(truth.driver_torque_N_m).max()):
            return _effort(scene), TORQUE_PART * peak_N_m
    wanted_m = CRANK_PART * lever_m(scene)
    if clearances:
        wanted_m = CLEARANCE_PART * min(each.radial_clearance_m for each in clearances)
    name, _ = next(signals(scene, truth))
    return with_suffix(name, "error"), wanted_m / (lever_m(scene) if name.endswith("_rad") else 1.0)


def cases(scene: Scene, column: str, wanted: float, engines: Collection[str]) -> list[Case]:
    """Return of every setting of the engines named, or of all, the recorded run, then two bare ones."""
    judged: Row = {"judged_by": column, "wanted_error": wanted}
    rungs = [rung for rung in _rungs(scene) if not engines or rung.arm.engine in engines]
    out = []
    for samples, timed in ((SAMPLES, {}), (1, {"round": 0}), (1, {"round": 1})):
        for rung in rungs:
            run = RunSettings(RunSettings(rung.step_s, SAMPLES).step_used_s(scene.end_time_s), samples)
            columns = {**judged, "motion_alone": arms.gives_motion_alone(rung.arm), **timed}
            out.append(Case(NAME, scene, rung.arm, run, rung.added, bool(timed), LIMIT_S, columns))
    return list({str(one.head()): one for one in out}.values())  # two rungs may be one step


def _rungs(scene: Scene) -> list[Rung]:
    """Return settings of the quick set's configurations; an engine without one says once why."""
    series: dict[str, list[Rung]] = {arm.label: [] for arm in configurations(scene)}
    for rung in ladder(scene, full=True):
        if rung.arm.label in series:
            series[rung.arm.label].append(rung)
    rungs = []
    for several in series.values():
        chosen = np.linspace(0, len(several) - 1, min(SETTINGS + 2, len(several))).round().astype(int)
        rungs += [several[k] for k in (chosen[1:-1] if len(several) > SETTINGS else chosen)]
    there = {rung.arm.engine for rung in rungs}
    return rungs + [Rung(arm, scene.end_time_s) for arm in AS_THEY_COME if arm.engine not in there]


def measure(case: Case) -> tuple[Row, Curves]:
    """Return a recorded run's errors and what needs no truth, with curves; or the times of a bare one."""
    return (cost.times(case, SAMPLES), {}) if case.timed else accuracy.measure(case)
