"""How ``--tolerance`` is kept by any engine: the step is halved until the slider is where it has to be.

Where that is, the reference knows, by two methods that have to agree on it to a part of the tolerance (see
``reference.two_methods``). An engine whose contacts follow a law of its own is held to the solution of what
it solves, its twin. An engine with a tolerance has it tightened with the step, or, where that is all that
decides, in place of the step.
"""

from collections.abc import Iterator

import numpy as np

from engine_models.engine import Engine, RunSettings, SimulationFailed, Trajectory
from engine_models.mechanics.quality import require_quality
from engine_models.mechanics.states import observed_in_words, observed_m
from engine_models.mechanics.trajectory import selected
from engine_models.reference.two_methods import agreed_solution
from engine_models.scene.scene import Scene

#: Runs are compared at no fewer samples than this: at a few times they may agree by chance.
FEWEST_SAMPLES = 100
#: The part of the tolerance to which the two methods have to agree, and which a run is then short of.
PART_OF_JUDGE = 0.5
#: The finest run tried has no more steps than this.
MOST_STEPS = 2_000_000
#: Halvings without a new smallest error: more of them will not help. Few tolerances are worth a try each.
STALLED_HALVINGS = 4


def simulate_to_tolerance(engine: Engine, scene: Scene, tolerance_m: float, samples: int) -> Trajectory:
    """Return the run at the longest step tried whose slider position is within the tolerance at all samples.

    A run that fails at a coarse step counts as one that is not.

    Raises:
        UnsupportedScene: the engine cannot express the scene.
        SimulationFailed: the tolerance is out of reach, or no step gives a run.
    """
    twin, every, what = engine.twin(scene), -(-FEWEST_SAMPLES // samples), observed_in_words(scene)
    compared, errors, trouble = samples * every, list[float](), "no step gives a run"
    to_agree_m = PART_OF_JUDGE * tolerance_m or tolerance_m  # half of the least number is none
    try:
        solution = agreed_solution(twin, to_agree_m, compared)
    except SimulationFailed as failure:
        raise SimulationFailed(f"{what} not known to {tolerance_m:g} m: {failure}") from None
    for present, step in _ever_sharper(engine, scene, compared):
        try:
            run = require_quality(scene, present.simulate(scene, RunSettings(step, compared)))
        except SimulationFailed as failure:
            trouble = str(failure)
            continue
        off_m = np.abs(observed_m(scene, run) - observed_m(twin, solution.run))
        errors.append(float(off_m.max()))
        if errors[-1] + solution.apart_m[-1] <= tolerance_m:
            return selected(run, slice(None, None, every))
        shorter, old = step < scene.end_time_s, errors[:-STALLED_HALVINGS]
        sharpening = f"a step of {run.step_s:.3g} s" if shorter else "a tenth of the engine's tolerance"
        trouble = f"{sharpening} leaves an error of {errors[-1]:.3g} m"
        if shorter and old and min(old) <= min(errors[-STALLED_HALVINGS:]):
            break
    raise SimulationFailed(f"{what} not converged to {tolerance_m:g} m: {trouble}")


def _ever_sharper(engine: Engine, scene: Scene, compared: int) -> Iterator[tuple[Engine, float]]:
    """Return the engine at ever shorter steps, or with ever smaller tolerances in steps that it chooses."""
    if engine.controls_error:
        while True:
            yield engine, scene.end_time_s
            if engine.sharper() == engine:
                return
            engine = engine.sharper()
    steps = compared
    while steps <= MOST_STEPS:
        yield engine, scene.end_time_s / steps
        steps, engine = 2 * steps, engine.sharper()
