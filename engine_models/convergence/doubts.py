"""What a run is warned of: doubtful quality, motion that half the step changes, settings without effect.

And what its scene is: splines that leave the values of their tables.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.mechanics.quality import quality_of
from engine_models.mechanics.states import lever_m, observed_in_words, observed_m
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import Course, Motor, Table, Torque
from reference_solver.mechanism.motions import curve_of

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

#: A spline is warned of where it leaves its table's values by more than this part of their range.
OVERSHOOT = 0.03
#: A slider is in doubt where it may be off by more than this part of the smallest clearance, or the crank.
DOUBTFUL_PART = 0.01


@dataclass(frozen=True)
class Overshoot:
    """A curve's own range, ``low`` to ``high``, and where it is furthest outside of its table's values.

    There it is outside by a ``part`` of their range.
    """

    low: float
    high: float
    at: float
    part: float


def overshoot(of: "PPoly", y: Sequence[float]) -> Overshoot | None:
    """Return how a curve leaves its table's values, None up to ``OVERSHOOT`` of their range."""
    with np.errstate(all="ignore"):
        at = of.derivative().roots(extrapolate=False)
        values = of(at := at[np.isfinite(at)])
    low, high = min(y), max(y)
    beyond = np.maximum(values - high, low - values)
    if not len(at) or beyond.max() <= OVERSHOOT * (high - low):
        return None
    k, least, most = int(beyond.argmax()), min(low, values.min()), max(high, values.max())
    part = beyond[k] / (high - low) if high > low else math.inf
    return Overshoot(float(least), float(most), float(at[k]), float(part))


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
    lines = []
    splines = (entry for entry in tables if entry[1].interpolation == "spline")
    for name, table, unit, by, advice in splines:
        spline, values = curve_of(table), table.y
        if (beyond := overshoot(spline, values)) is not None:
            spans = f"from {beyond.low:.6g} to {beyond.high:.6g} {unit}"
            most = f"{100 * beyond.part:.3g} % of that range beyond at {beyond.at:.4g} {by}"
            own = f"the table's values from {min(values):.6g} to {max(values):.6g} {unit}, {most}"
            lines.append(
                f"{name}: the spline goes {spans}, {own} ({100 * OVERSHOOT:g} % goes unsaid): {advice}"
            )
    return lines


def doubts(engine: Engine, scene: Scene, run: Trajectory, settings: RunSettings | None) -> list[str]:
    """Return a line for each doubt about a run.

    With the settings with which it has run, it is run once more at half the step, and with a tenth of the
    engine's own tolerance, if it has one.

    Raises:
        SimulationFailed: the run is none.
    """
    quality = quality_of(scene, run)
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
