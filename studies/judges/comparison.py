"""A run held against the truth of the scene that it solves, where something happens."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import ROUNDING, Engine, RunSettings, Trajectory
from engine_models.mechanics.trajectory import selected
from engine_models.scene.scene import Scene
from studies.case import Curves, Row
from studies.judges import metrics
from studies.judges.converged_truth import Solved, followed, solved, times_between_s

#: Samples on which runs of ideal joints are judged, at the most, and the part of a force's largest value
#: that the judged samples have to see.
FINE, SEEN = 4800, 0.99
#: Equal steps of a run that is not made twice: who reads every step may round otherwise, by some last places.
TWICE = 5_000


@dataclass(frozen=True)
class Judged:
    """A recorded run of an engine, and the true motion at the same times of the scene ``own`` that it solves.

    ``plain`` is the run at the equally spaced samples that were asked for: they are those of ``run`` that
    ``equal`` (n,) tells. ``peaks`` are the largest sizes of the truth's signals, wherever they are seen, up
    to ``compared_until_s``.
    """

    own: Scene
    run: Trajectory
    plain: Trajectory
    solved: Solved
    equal: NDArray[np.bool_]
    peaks: Mapping[str, float]
    compared_until_s: float


def judged(engine: Engine, scene: Scene, asked: RunSettings) -> Judged:
    """Run a scene by an engine, with samples where something happens, and find its truth.

    Steps are those of the run that is asked for. With clearance ``times_between_s`` are sampled; of ideal
    joints as many of the steps, or equal times where an engine chooses its steps, as make ``FINE`` samples.
    An engine that leaves times out is judged at those that it has.

    Raises:
        UnsupportedScene, SimulationFailed: as the engine does, or there is no truth.
    """
    own = engine.twin(scene)
    return _with_clearance(engine, scene, own, asked) if own.clearances else _ideal(engine, own, asked)


def _with_clearance(engine: Engine, scene: Scene, own: Scene, asked: RunSettings) -> Judged:
    run = engine.simulate(scene, replace(asked, at_s=times_between_s(own, asked.samples)))
    found = solved(own, asked.samples)
    until_s = scene.end_time_s * (followed(own, asked.samples, judged=True) - 1) / asked.samples
    peaks = _peaks(own, selected(found.truth, found.truth.time_s <= until_s * (1 + ROUNDING)))
    equal = asked.are_equal(found.truth.time_s, scene.end_time_s)
    if len(run.time_s) < len(equal):
        found, equal = found.selected(equal), equal[equal]
    plain = selected(run, equal)
    return Judged(own, run, plain, found, equal, peaks, until_s)


def _ideal(engine: Engine, scene: Scene, asked: RunSettings) -> Judged:
    finer = _finer(engine, scene, asked)
    run, found = engine.simulate(scene, finer), solved(scene, finer.samples)
    equal = asked.are_equal(found.truth.time_s, scene.end_time_s)
    long = _steps_are_equal(engine) and asked.samples * asked.steps_per_sample(scene.end_time_s) > TWICE
    plain = selected(run, equal) if long else engine.simulate(scene, asked)
    peaks = _peaks(scene, solved(scene, FINE).truth)
    return Judged(scene, run, plain, found, equal, peaks, scene.end_time_s)


def _steps_are_equal(engine: Engine) -> bool:
    """Return whether an engine's steps are those of the run that is asked for, by its order."""
    return getattr(engine, "order", 0) is not None


def _finer(engine: Engine, scene: Scene, asked: RunSettings) -> RunSettings:
    """Return the settings with more samples, up to ``FINE``, that leave the steps as they are."""
    most, steps = max(1, FINE // asked.samples), asked.steps_per_sample(scene.end_time_s)
    if _steps_are_equal(engine):
        most = max(times for times in range(1, most + 1) if steps % times == 0)
    return replace(asked, samples=most * asked.samples)


def _peaks(own: Scene, truth: Trajectory) -> dict[str, float]:
    """Return the largest sizes of the truth's signals."""
    return {name: float(size.max()) for name, size in metrics.sizes(own, truth).items()}


def _unseen(seen: Mapping[str, float], peaks: Mapping[str, float]) -> dict[str, str]:
    """Return of what too little is seen, of a force, or nothing is there, with that in words."""
    return {
        name: f"{100 * size / peaks[name]:.0f} % of its peak is seen" if size else "zero"
        for name, size in seen.items()
        if not size or (metrics.is_force(name) and size < SEEN * peaks[name])
    }


def compared(found: Judged) -> tuple[Row, Curves]:
    """Return the largest error of every signal with the truth's uncertainty and scale, and errors as curves.

    All signals are judged at the same instants, ``judged_instants`` of them: all that the run has up to
    ``compared_until_s``. Curves have the equally spaced ones. A force of whose largest value the instants see
    less than ``SEEN``, and a signal that is zero, are not judged, and the row says so.
    ``largest_kinetic_energy_J`` is the truth's.
    """
    own, until = found.own, found.solved.truth.time_s <= found.compared_until_s * (1 + ROUNDING)
    truth, repeats, by = found.solved.selected(until)
    off = metrics.errors(own, selected(found.run, until), truth)
    row: Row = {
        "truth": by,
        "compared_until_s": found.compared_until_s,
        "judged_instants": len(truth.time_s),
        "largest_kinetic_energy_J": float(metrics.kinetic_energy_J(own, truth).max()),
        **{name: float(error.max()) for name, error in off.items()},
        **metrics.uncertainties(own, truth, list(repeats)),
        **metrics.scales(own, truth),
    }
    reasons = _unseen(_peaks(own, truth), found.peaks)
    for name in reasons:
        del row[metrics.with_suffix(name, "error")]
    plain = selected(found.plain, until[found.equal])
    curves = metrics.errors(own, plain, selected(truth, found.equal[until]))
    return row | {"not_judged": "; ".join(map(": ".join, reasons.items()))}, curves
