"""What a run is warned of: doubtful quality, motion that half the step changes, settings without effect.

And what its scene is: splines that leave the values of their tables.
"""

import math
from dataclasses import replace

import numpy as np

from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.mechanics.quality import Quality
from engine_models.mechanics.states import lever_m, observed_in_words, observed_m
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import Course, Motor, Table, Torque
from reference_solver.mechanism.motions import curve_of

#: A spline is warned of where it leaves its table's values by more than this part of their range.
OVERSHOOT = 0.03
#: A slider is in doubt where it may be off by more than this part of the smallest clearance, or the crank.
DOUBTFUL_PART = 0.01


def _overshoot(table: Table, unit: str, by: str) -> str:
    """Return in words how a spline leaves its table's values, "" up to ``OVERSHOOT`` of their range."""
    of, low, high = curve_of(table), min(table.y), max(table.y)
    with np.errstate(all="ignore"):
        at = of.derivative().roots(extrapolate=False)
        values = of(at := at[np.isfinite(at)])
    beyond = np.maximum(values - high, low - values)
    if not len(at) or beyond.max() <= OVERSHOOT * (high - low):
        return ""
    k, least, most = int(beyond.argmax()), min(low, values.min()), max(high, values.max())
    part = beyond[k] / (high - low) if high > low else math.inf
    spans = f"the spline goes from {least:.6g} to {most:.6g} {unit}"
    furthest = f"{100 * part:.3g} % of that range beyond at {at[k]:.4g} {by}"
    own = f"the table's values from {low:.6g} to {high:.6g} {unit}, {furthest}"
    return f"{spans}, {own} ({100 * OVERSHOOT:g} % goes unsaid)"


def doubts_of_tables(scene: Scene) -> list[str]:
    """Return a line for each table of a scene whose spline leaves the range of its values."""
    of, tables = scene.mechanism, list[tuple[str, Table, str, str, str]]()
    keeps = 'interpolation = "linear" keeps to them'
    for load in of.loads:
        path = f"load.{of.bodies[load.body].name}"
        if load.gas is not None:
            tables.append((f"{path}.gas", load.gas.table, "N", "rad", keeps))
        for by_time, unit in ((load.force_by_time, "N"), (load.torque_by_time, "N m")):
            if by_time is not None:
                tables.append((f"{path}.by_time", by_time, unit, "s", keeps))
    match of.drive.law:
        case Course(table):
            advice = 'more points keep nearer to them (interpolation = "linear" takes a constant speed alone)'
            tables.append(("drive", table, "rad" if of.drive.guide is None else "m", "s", advice))
        case Torque(Table() as table):
            tables.append(("drive", table, "N m", "s", keeps))
        case Motor(table=Table() as table):
            tables.append(("drive", table, "N m", "rad/s", keeps))
    splines = [entry for entry in tables if entry[1].interpolation == "spline"]
    told = [(name, _overshoot(table, unit, by), advice) for name, table, unit, by, advice in splines]
    return [f"{name}: {beyond}: {advice}" for name, beyond, advice in told if beyond]


def doubts(
    engine: Engine, scene: Scene, run: Trajectory, quality: Quality, settings: RunSettings | None
) -> list[str]:
    """Return a line for each doubt about a run of some quality.

    With the settings with which it has run, it is run once more at half the step, and with a tenth of the
    engine's own tolerance, if it has one.

    Raises:
        SimulationFailed: the run is none.
    """
    if (failure := quality.failure()) is not None:
        raise SimulationFailed(failure)
    lines = [*doubts_of_tables(scene), *quality.warnings()]
    lines += [f"{name} changes nothing with {by}" for name, by in engine.idle().items()]
    return lines if settings is None else lines + _doubts_of_steps(engine, scene, run, settings)


def _doubts_of_steps(engine: Engine, scene: Scene, run: Trajectory, settings: RunSettings) -> list[str]:
    """Return a line if what is observed may be off by ``DOUBTFUL_PART``: half of it moves in the other run.

    For an error of order 1 halves with the step, those of higher orders fall by more.
    """
    try:
        finer = engine.sharper().simulate(scene, replace(settings, step_s=settings.step_s / 2))
    except (SimulationFailed, UnsupportedScene) as reason:
        return [f"not checked by a run at half the step: {reason}"]
    radial = [clearance.radial_clearance_m for clearance in scene.clearances.values()]
    measure_m = min(radial, default=lever_m(scene))  # of a crank-slider its crank
    far = np.abs(observed_m(scene, run) - observed_m(scene, finer)) > DOUBTFUL_PART * measure_m / 2
    if not far.any():
        return []
    measure = "smallest clearance" if radial else "crank" if scene.is_short else "longest lever"
    share = f"{100 * DOUBTFUL_PART:g} % of the {measure} or more"
    when = f"from t = {run.time_s[np.argmax(far)]:.6g} s on, by a run at half the step"
    return [f"{observed_in_words(scene)} in doubt by {share} {when}: use --tolerance, or end the run before"]
