"""What an engine states of itself, its order and its accuracy, held to the truth of smooth motion."""

import numpy as np

from engine_models.engine import Engine, RunSettings, UnsupportedScene
from engine_models.mechanics.states import observed_m
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.conformance.claims import SAMPLES, Finding
from studies.judges.converged_truth import converged
from studies.judges.convergence import observed_order

#: Smooth motion on which orders are measured, and until when in s.
SMOOTH, END_S = "ideal-free", 0.1
#: The longest step in s, and how often it is halved.
LONGEST_S, HALVINGS = 2e-4, 6
#: To what the truth is known in m. It is as much as roundings of 0.2 m add up to by chance in the finest run:
#: the root of its 32 000 steps times 4e-17 m.
KNOWN_TO_M = 1e-14
#: How far the order may be from what is stated.
ORDER = 0.1
#: Sharpened so often, an engine's error falls by so much at least: its tolerance does by 1000.
SHARPENINGS, GAIN = 3, 100.0
#: An error in m that need not fall any further with a tolerance.
SHARP_M = 2e-12


def states_its_order(engine: Engine) -> Finding:
    """The slider's error falls with the step by the order that the engine states, or with its tolerance."""
    scene = _smooth()
    if refused := _refused(engine, scene):
        return refused
    if engine.order is None:
        return _falls_with_tolerance(engine, scene)
    return _falls_with_step(engine, scene, engine.order)


def states_its_accuracy(engine: Engine) -> Finding:
    """The slider's error on smooth motion is no more than the engine states, if it does."""
    scene = _smooth()
    if refused := _refused(engine, scene):
        return refused
    stated = engine.accuracy_m
    if stated is None:
        return Finding(True, "no accuracy_m is stated")
    off, step_s = _error(engine, scene, LONGEST_S)
    return Finding(off <= stated, f"{off:.1e} m at a step of {step_s:.1e} s, and {stated:.1e} m is stated")


def _smooth() -> Scene:
    return SCENES[SMOOTH]().model_copy(update={"end_time_s": END_S})


def _refused(engine: Engine, scene: Scene) -> Finding | None:
    """Return that nothing is measured where an engine has no model of smooth motion, else None."""
    try:
        engine.check(scene)
    except UnsupportedScene as reason:
        return Finding(True, f"not measured, since {SMOOTH} is refused: {reason}")
    return None


def _falls_with_step(engine: Engine, scene: Scene, stated: float) -> Finding:
    errors, steps = zip(*(_error(engine, scene, LONGEST_S / 2**k) for k in range(HALVINGS + 1)), strict=True)
    order = observed_order(steps, errors, KNOWN_TO_M)
    if order.slope is None:
        ends = " and ".join(f"{errors[at]:.1e} m at a step of {steps[at]:.1e} s" for at in (0, -1))
        told = f"order {stated:g} is stated, and none can be measured ({order}): the error is {ends}"
        return Finding(False, told)
    told = f"{order}, and {stated:g} is stated, to be kept within {ORDER:g}"
    return Finding(abs(order.slope - stated) <= ORDER, told)


def _falls_with_tolerance(engine: Engine, scene: Scene) -> Finding:
    first, _ = _error(engine, scene, scene.end_time_s)
    for _ in range(SHARPENINGS):
        engine = engine.sharper()
    last, _ = _error(engine, scene, scene.end_time_s)
    bound = max(first / GAIN, SHARP_M)
    told = f"from {first:.1e} to {last:.1e} m, {SHARPENINGS} times sharper, at most {bound:.1e} m"
    return Finding(last <= bound, f"{told}: a tolerance a thousandth has to bring a hundredth")


def _error(engine: Engine, scene: Scene, step_s: float) -> tuple[float, float]:
    """Return the largest error of the slider's position in m, and the step that was taken in s."""
    run = engine.simulate(scene, RunSettings(step_s, SAMPLES))
    truth, _ = converged(scene, SAMPLES)
    return float(np.abs(observed_m(scene, run) - observed_m(scene, truth)).max()), run.step_s
