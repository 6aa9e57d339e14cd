"""The step halved until the slider's position has converged: how ``--tolerance`` is kept by any engine.

Two runs at the steps h and h/2 differ by d. From an order p on, the finer run is off by d/(2^p - 1), so by
no more than its last difference once differences at least halve from one run to the next. That is asked for
here, whatever the order. An engine with a tolerance has it tightened with the step, or, where that is all
that decides, in place of the step.
"""

from collections.abc import Iterator

import numpy as np

from engine_models.engine import Engine, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.mechanics.samples import selected
from engine_models.scene.scene import Scene

#: Runs are compared at no fewer samples than this: at a few times they may agree by chance.
FEWEST_SAMPLES = 100
#: The finest run tried has no more steps than this.
MOST_STEPS = 2_000_000
#: A run whose crank turns further in a step than this part of a turn has not seen the motion.
LARGEST_TURN_RAD = 2 * np.pi / 16
#: Differences that fall by this factor or more are those of a method of order 1 at least, given 10 % of room.
FALLING = 1.8
#: What the last difference is multiplied with to bound the error: falling differences, all others.
MARGIN, MARGIN_NOT_FALLING = 1.25, 2.0
#: Halvings without a new smallest difference, once it is this small part of the crank: round-off is reached.
STALLED_HALVINGS, STALLED_PART = 3, 1e-3


def simulate_to_tolerance(engine: Engine, scene: Scene, tolerance_m: float, samples: int) -> Trajectory:
    """Return the run at the longest step tried whose slider position is within the tolerance at all samples.

    A run that fails at a coarse step counts as one that has not converged.

    Raises:
        UnsupportedScene: the engine cannot express the scene.
        SimulationFailed: the tolerance is out of reach, or no step gives a run.
    """
    every = -(-FEWEST_SAMPLES // samples)
    compared = samples * every
    coarser: FloatArray | None = None
    differences: list[float] = []
    trouble = "no step was short enough to follow the crank"
    for present, step in _ever_sharper(engine, scene, compared):
        try:
            run = present.simulate(scene, RunSettings(step, compared))
            sharpening = "a tenth of the engine's tolerance"
            if step < scene.end_time_s:
                sharpening = f"halving the step to {run.step_s:.3g} s"
                _require_followed(run)
        except SimulationFailed as failure:
            trouble, coarser, differences = str(failure), None, []
            continue
        if coarser is not None:
            differences.append(float(np.abs(run.slider_position_m - coarser).max()))
            trouble = f"{sharpening} still moved it by {differences[-1]:.3g} m"
        if _error_bound(differences) <= tolerance_m:
            return selected(run, slice(None, None, every))
        if _stalled(differences, scene.crank.length_m):
            trouble = f"{sharpening} stopped helping at differences of {min(differences):.3g} m"
            break
        coarser = run.slider_position_m
    raise SimulationFailed(f"slider position not converged to {tolerance_m:g} m: {trouble}")


def _ever_sharper(engine: Engine, scene: Scene, compared: int) -> Iterator[tuple[Engine, float]]:
    """Return the engine at ever shorter steps, or with ever smaller tolerances in steps that it chooses."""
    if getattr(engine, "controls_error", False):
        while True:
            yield engine, scene.end_time_s
            if engine.sharper() == engine:
                return
            engine = engine.sharper()
    steps = compared
    while steps <= MOST_STEPS:
        yield engine, scene.end_time_s / steps
        steps, engine = 2 * steps, engine.sharper()


def _require_followed(run: Trajectory) -> None:
    """Raise SimulationFailed if a run's step is too long for the speed of its crank."""
    fastest = np.abs(run.velocity[:, 0, 2])
    if fastest.max() * run.step_s > LARGEST_TURN_RAD:
        when = run.time_s[int(np.argmax(fastest))]
        raise SimulationFailed(f"the crank outruns the step of {run.step_s:.3g} s at t = {when:.6g} s")


def _error_bound(differences: list[float]) -> float:
    """Return a bound on the error of the finest run from the last two differences, infinite without them."""
    if len(differences) < 2:
        return np.inf
    before, last = differences[-2:]
    return MARGIN * last if before >= FALLING * last else MARGIN_NOT_FALLING * max(before, last)


def _stalled(differences: list[float], crank_length_m: float) -> bool:
    """Return whether the differences are down at the round-off of this engine."""
    old, new = differences[:-STALLED_HALVINGS], differences[-STALLED_HALVINGS:]
    return bool(old) and min(old) <= min(new) and min(old) < STALLED_PART * crank_length_m
