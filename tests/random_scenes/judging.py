"""Random scenes run by an engine, to a tolerance or as they are, and held against their truths."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from engine_models.convergence.doubts import doubts
from engine_models.convergence.own_uncertainty import simulate_with_uncertainty
from engine_models.convergence.step_halving import simulate_to_tolerance
from engine_models.engine import RunSettings, SimulationFailed, Trajectory, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.scene import Scene
from studies.command.options import DEFAULT_STEP_S, read_engine
from tests.random_scenes.truths import DEFAULT, SAMPLES, Truth, smallest_clearance_m

#: The name of verdicts on a plain run's own uncertainty: what it promises is its bound on the slider's error.
BOUND = "bound"
#: What becomes of a run: a promise, to be within the tolerance, or, without one and without a warning, within
#: this part of the smallest clearance, is held or broken; or there is no promise, with a reason.
HELD, BROKEN, WARNED, REFUSED = "held", "broken", "warned", "refused"
PROMISED_PART = 0.01


@dataclass(frozen=True)
class Verdict:
    """What became of a scene at a tolerance in m, ``DEFAULT`` or ``BOUND``, its error, and what was said."""

    seed: int
    tolerance: float | str
    outcome: str
    error_m: float
    reason: str


def is_judged(truth: Truth, engine: str) -> bool:
    """Return whether an engine solves the scene itself: not where its contacts have laws of their own."""
    try:
        return make_engine(engine).twin(truth.scene) == truth.scene
    except UnsupportedScene:
        return False


def verdicts(truth: Truth, engine: str) -> Iterator[Verdict]:
    """Yield a judged scene's verdicts at tolerances for which its truth is certain enough, and on bounds.

    Of plain runs the reference alone makes a promise: what 10 us are to other engines is not known here.
    """
    judgements = dict(truth.judgements)
    if DEFAULT in judgements:
        judgements[BOUND] = judgements[DEFAULT]
        if engine != "reference":
            del judgements[DEFAULT]
    for tolerance, judgement in judgements.items():
        scene, error = truth.judged_scene(DEFAULT if tolerance == BOUND else tolerance), np.nan
        try:
            run, allowed, warnings = _run(engine, scene, tolerance)
        except (SimulationFailed, UnsupportedScene) as refusal:
            yield Verdict(truth.seed, tolerance, REFUSED, error, str(refusal))
            continue
        error = float(np.abs(run.position[:, -1, 0] - judgement.slider_position_m).max())
        held = error <= allowed + judgement.uncertainty_m
        outcome = HELD if held else WARNED if warnings else BROKEN
        yield Verdict(truth.seed, tolerance, outcome, error, "; ".join(warnings))


def _run(engine: str, scene: Scene, tolerance: float | str) -> tuple[Trajectory, float, list[str]]:
    """Return a run as ``crankslider simulate`` does it, what it may be off by in m, and its warnings."""
    with np.errstate(all="ignore"):
        if isinstance(tolerance, float):
            to_it = read_engine(engine, {}, to_tolerance=True)
            return simulate_to_tolerance(to_it, scene, tolerance, SAMPLES), tolerance, []
        plain, settings = make_engine(engine), RunSettings(min(DEFAULT_STEP_S, scene.end_time_s), SAMPLES)
        if tolerance == BOUND:
            run, bounds = simulate_with_uncertainty(plain, scene, settings)
            return run, float(bounds["slider_position_m"]), []
        run = plain.simulate(scene, settings)
        allowed = PROMISED_PART * smallest_clearance_m(scene)
        return run, allowed, doubts(plain, scene, run, to_tolerance=False)
