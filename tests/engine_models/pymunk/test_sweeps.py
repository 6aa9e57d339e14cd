"""A scene gets as many sweeps as its joints need, light or heavy: enough to stay together, and few."""

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed
from engine_models.pymunk.engine import PymunkEngine
from engine_models.pymunk.sweeps import needed_sweeps
from engine_models.scene.library import SCENES, ideal_driven, ideal_free
from engine_models.scene.scene import Scene
from studies.judges.ideal_truth import exact

SAMPLES = 24
#: The part of the error that the rule's sweeps may add to that of a thousand: measured 0.03 and less.
ADDED = 0.1


def weighed(scene: Scene, rod: float, slider: float) -> Scene:
    """Return the scene with rod and slider so many times as heavy."""
    _, link, block = scene.crank_slider()
    heavier = {"mass_kg": rod * link.mass_kg, "inertia_kg_m2": rod * link.inertia_kg_m2}
    bodies = {
        "rod": link.model_copy(update=heavier),
        "slider": block.model_copy(update={"mass_kg": slider * block.mass_kg}),
    }
    return scene.model_copy(update={"end_time_s": 0.024, **bodies})


def error_m(scene: Scene, iterations: int | None, steps: int) -> float:
    engine = PymunkEngine(iterations=iterations)
    run = engine.simulate(scene, RunSettings(scene.end_time_s / steps, SAMPLES))
    return float(np.abs(run.position[:, -1, 0] - exact(scene, SAMPLES).position[:, -1, 0]).max())


@pytest.mark.parametrize("steps", [480, 4800])
@pytest.mark.parametrize("scene", [ideal_free(), ideal_driven()], ids=lambda scene: scene.name)
@pytest.mark.parametrize(("rod", "slider"), [(1, 1), (1, 0.1), (1, 10), (1, 100), (10, 1), (100, 1)])
def test_no_error_is_left_that_more_sweeps_would_take(
    scene: Scene, rod: float, slider: float, steps: int
) -> None:
    scene = weighed(scene, rod, slider)
    assert error_m(scene, None, steps) < (1 + ADDED) * error_m(scene, 1000, steps)


@pytest.mark.parametrize(("rod", "slider"), [(1, 1), (1, 10), (1, 100), (100, 1)])
def test_a_third_of_them_is_too_few(rod: float, slider: float) -> None:
    scene = weighed(ideal_driven() if max(rod, slider) > 10 else ideal_free(), rod, slider)
    with pytest.raises(SimulationFailed, match="constraints lost"):
        error_m(scene.model_copy(update={"end_time_s": 0.3}), needed_sweeps(scene) // 3, 48000)


@pytest.mark.parametrize("name", ["clearance-free-0.5mm", "clearance-driven-A"])
def test_contacts_leave_no_error_that_more_sweeps_would_take(name: str) -> None:
    scene = SCENES[name]().model_copy(update={"end_time_s": 0.01 if "free" in name else 0.003})
    needed, many, true = (
        PymunkEngine(iterations=iterations).simulate(scene, RunSettings(scene.end_time_s / steps, SAMPLES))
        for iterations, steps in ((None, 4000), (1000, 4000), (1000, 64000))
    )
    apart, error = (
        np.abs(one.position - other.position).max() for one, other in ((needed, many), (many, true))
    )
    assert apart < 2 * ADDED * error, (apart, error)


def test_joints_that_share_no_body_need_the_fewest() -> None:
    assert {needed_sweeps(SCENES[name]()) for name in ("clearance-free-OAB", "clearance-driven-0.5mm")} == {4}
    assert needed_sweeps(ideal_free()) > 8


def test_hopeless_ratios_of_masses_get_the_most() -> None:
    assert needed_sweeps(weighed(ideal_free(), 1.0, 1e12)) == 1000
