"""Scenes at the edge of what is valid, and beyond: absurd, at rest, at one instant; refusals in Python."""

import random
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from engine_models.engine import RunSettings, SimulationFailed, UnsupportedScene
from engine_models.engines import ENGINES, make_engine
from engine_models.mechanics.quality import quality_of
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from reference_solver.mechanism.mechanism import mechanism_of
from tests.helpers.crank_sliders import HELD

each = pytest.mark.parametrize("engine", ENGINES)
#: Library scenes, so that no kernel is compiled for them alone, and what each engine is to be quick with.
NAMES = ("ideal-free", "ideal-driven", "clearance-driven-0.1mm", "rigid-driven-0.1mm", "rigid-pendulum")
BOUNDS: dict[str, dict[str, object]] = {
    "reference": {"max_steps": 300_000},
    "scipy": {"max_evaluations": 3_000},
    "exudyn": {"timeout_s": 0.5},
}


def distorted(value: Any, chance: random.Random, key: str = "") -> Any:
    """Return a part of a scene with some of its numbers larger or smaller by orders of magnitude."""
    if isinstance(value, dict):
        return {name: distorted(part, chance, name) for name, part in value.items()}
    if not isinstance(value, float) or chance.random() < 0.6 or key in ("restitution", "poisson_ratio"):
        return value
    if key == "radial_clearance_m" and chance.random() < 0.5:
        return 5e-324  # the least there is
    return value * 10 ** chance.uniform(-9, 9)


def absurd_scenes(count: int, seed: int) -> list[tuple[Scene, RunSettings]]:
    """Return so many scenes that pass validation, each with a run of few steps."""
    chance, runs = random.Random(seed), list[tuple[Scene, RunSettings]]()
    while len(runs) < count:
        data = distorted(SCENES[chance.choice(NAMES)]().model_dump(exclude_none=True), chance)
        samples, steps = chance.choice((1, 2, 10)), chance.choice((1, 3, 30))
        try:
            of = Scene.model_validate(data)
        except ValidationError:
            continue
        runs.append((of, RunSettings(of.end_time_s / (samples * steps), samples)))
    return runs


@each
def test_an_absurd_scene_runs_or_fails_as_a_simulation(engine: str) -> None:
    ends = []
    for of, settings in absurd_scenes(25, seed=11):
        try:
            with np.errstate(all="ignore"):
                make_engine(engine, **BOUNDS.get(engine, {})).simulate(of, settings)
            ends.append("ran")
        except (UnsupportedScene, SimulationFailed) as reason:
            ends.append(type(reason).__name__)
    assert {"ran", "SimulationFailed"} <= set(ends), f"too tame a selection: {ends}"


@each
def test_a_crank_that_is_held_takes_the_loads_torque(engine: str) -> None:
    """Statics by hand: T = -F dx/dtheta, and the guide takes F tan(phi)."""
    run = make_engine(engine).simulate(HELD, RunSettings(1e-4, 10))
    phi = -np.arcsin(np.sin(np.pi / 3) / 2.5)
    torque = -400 * (np.sin(np.pi / 3) - np.cos(np.pi / 3) * np.tan(phi))
    assert run.driver_torque_N_m is not None
    assert (torque, -400 * np.tan(phi)) == pytest.approx((-420.26506, 147.70979), rel=1e-7)
    # Pymunk's joints come to their forces by sweeps: 1e-6 of them after ten steps.
    assert run.driver_torque_N_m[-1] == pytest.approx(torque, rel=1e-5)
    assert run.guide_force_N["guide"][-1] == pytest.approx(-400 * np.tan(phi), rel=1e-5)
    rounding = make_engine(engine).simulate(HELD, RunSettings(1e-5, 10))
    assert quality_of(HELD, rounding).parts()["unaccounted_energy_part"] < 1e-4, "it is no energy"


def test_a_law_by_a_function_of_its_own_is_named_in_a_scene_and_the_reference_alone_has_it() -> None:
    room = {"radial_clearance_m": 5e-4, "bearing_radius_m": 0.01, "stiffness": 1e10, "damping_N_s_m": 1e5}
    of = SCENES["clearance-driven-0.5mm"]().replace("clearance.B", {**room, "law": "kuwabara-kono"})
    law = mechanism_of(of.mechanism).contacts[0].law
    assert (law.kind, law.stiffness, law.damping_N_s_m) == ("kuwabara-kono", 1e10, 1e5)
    for engine in ("exudyn", "pymunk"):
        with pytest.raises(UnsupportedScene, match="law: expected a law of a stiffness"):
            make_engine(engine).simulate(of, RunSettings(1e-5, 5))
