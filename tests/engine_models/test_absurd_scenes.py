"""Scenes that are valid and absurd run, or fail as simulations do: nothing else comes out of an engine."""

import random
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.engines import make_engine
from engine_models.pace import Pace
from engine_models.pymunk.engine import PymunkEngine
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from tests.helpers.engines import supporting

#: Library scenes, so that no kernel is compiled for them alone, and what each engine is to be quick with.
NAMES = ("ideal-free", "ideal-driven", "clearance-driven-0.1mm", "rigid-driven-0.1mm", "rigid-pendulum")
BOUNDS: dict[str, dict[str, object]] = {
    "reference": {"max_steps": 300_000},
    "scipy": {"max_evaluations": 3_000},
    "exudyn": {"timeout_s": 0.5},
}
#: Factors on numbers of the scene; a clearance may also be the least there is.
DECADES, LEAST = 9, 5e-324


def distorted(value: Any, chance: random.Random, key: str = "") -> Any:
    """Return a part of a scene with some of its numbers larger or smaller by orders of magnitude."""
    if isinstance(value, dict):
        return {name: distorted(part, chance, name) for name, part in value.items()}
    if not isinstance(value, float) or chance.random() < 0.6 or key in ("restitution", "poisson_ratio"):
        return value
    if key == "radial_clearance_m" and chance.random() < 0.5:
        return LEAST
    return value * 10 ** chance.uniform(-DECADES, DECADES)


def absurd_scenes(count: int, seed: int) -> list[tuple[Scene, RunSettings]]:
    """Return so many scenes that pass validation, each with a run of few steps."""
    chance, runs = random.Random(seed), list[tuple[Scene, RunSettings]]()
    while len(runs) < count:
        data = distorted(SCENES[chance.choice(NAMES)]().model_dump(exclude_none=True), chance)
        samples, steps = chance.choice((1, 2, 10)), chance.choice((1, 3, 30))
        try:
            scene = Scene.model_validate(data)
        except ValidationError:
            continue
        runs.append((scene, RunSettings(scene.end_time_s / (samples * steps), samples)))
    return runs


@pytest.mark.parametrize("engine", supporting(SCENES["ideal-free"]()))
def test_an_absurd_scene_runs_or_fails_as_a_simulation(engine: str) -> None:
    ends = []
    for scene, settings in absurd_scenes(25, seed=11):
        try:
            with np.errstate(all="ignore"):
                make_engine(engine, **BOUNDS.get(engine, {})).simulate(scene, settings)
            ends.append("ran")
        except (UnsupportedScene, SimulationFailed) as reason:
            ends.append(type(reason).__name__)
    assert {"ran", "SimulationFailed"} <= set(ends), f"too tame a selection: {ends}"


def test_a_failure_in_a_scene_without_ideal_joints_is_told_with_its_time() -> None:
    """With no ideal joint there is no gap to tell: an IndexError."""
    scene = SCENES["clearance-pendulum"]()
    start = scene.start.model_copy(update={"crank_speed_rad_s": 1e9})
    with pytest.raises(SimulationFailed, match="at t = "):
        PymunkEngine().simulate(scene.model_copy(update={"start": start}), RunSettings(1e-4, 10))


def test_the_pace_is_that_of_the_steps_since_it_was_judged_last() -> None:
    """At a thousand steps in all, ten may take no less than 10 ms of a second."""
    pace = Pace(SCENES["ideal-free"]().replace("end_time_s", 1.0), outlasting=10, most_steps=1000)
    pace.judge(0.5, 10)
    pace.judge(0.5, 19)  # too few to be judged
    pace.judge(0.511, 20)
    with pytest.raises(SimulationFailed, match=r"steps of 0.0009 s at t = 0.52 s"):
        pace.judge(0.52, 30)
