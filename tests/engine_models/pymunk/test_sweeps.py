"""A scene gets as many sweeps as its joints need, light or heavy: enough to stay together, and few."""

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed
from engine_models.pymunk.engine import PymunkEngine
from engine_models.pymunk.joints.plan import plan_of
from engine_models.pymunk.joints.sweeps import LEFT_OVER, convergence_of, path_of
from engine_models.scene.library import SCENES, ideal_driven, ideal_free
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene
from tests.engines import mechanism_texts
from tests.engines.mechanism_texts import TEXTS
from tests.studies.truth.closed_forms.crank_slider import exact

SAMPLES = 24
#: The part of the error that the rule's sweeps may add to that of a thousand: measured 0.03 and less.
ADDED = 0.1
#: Balanced masses change the constant of the error by so much at most: measured 0.2.
BALANCED = 0.35


def weighed(scene: Scene, rod: float, slider: float) -> Scene:
    """Return the scene with rod and slider so many times as heavy."""
    _, link, block = scene.crank_slider()
    heavier = {"mass_kg": rod * link.mass_kg, "inertia_kg_m2": rod * link.inertia_kg_m2}
    bodies = {
        "rod": link.model_copy(update=heavier),
        "slider": block.model_copy(update={"mass_kg": slider * block.mass_kg}),
    }
    return scene.model_copy(update={"end_time_s": 0.024, **bodies})


def error_m(scene: Scene, iterations: int | None, steps: int, joints: str = "fewest") -> float:
    engine = PymunkEngine(iterations=iterations, joints=joints)  # type: ignore[arg-type]
    run = engine.simulate(scene, RunSettings(scene.end_time_s / steps, SAMPLES))
    return float(np.abs(run.position[:, -1, 0] - exact(scene, SAMPLES).position[:, -1, 0]).max())


def sweeps_of(scene: AnyScene, engine: PymunkEngine | None = None) -> int:
    model = (engine or PymunkEngine())._model(scene, RunSettings(1e-6, 1))
    return int(model.space.iterations)


@pytest.mark.parametrize("steps", [480, 4800])
@pytest.mark.parametrize("scene", [ideal_free(), ideal_driven()], ids=lambda scene: scene.name)
@pytest.mark.parametrize(("rod", "slider"), [(1, 1), (1, 0.1), (1, 10), (1, 100), (10, 1), (100, 1)])
def test_no_error_is_left_that_more_sweeps_would_take(
    scene: Scene, rod: float, slider: float, steps: int
) -> None:
    scene = weighed(scene, rod, slider)
    assert error_m(scene, None, steps) < (1 + ADDED) * error_m(scene, 1000, steps)


@pytest.mark.parametrize(("rod", "slider"), [(1, 1), (1, 0.1), (1, 10), (1, 100), (10, 1)])
def test_balanced_masses_take_fewer_sweeps_for_the_same_motion(rod: float, slider: float) -> None:
    scene = weighed(ideal_free(), rod, slider)
    assert sweeps_of(scene) < 0.7 * sweeps_of(scene, PymunkEngine(joints="all"))
    own, other = (error_m(scene, None, 4800, joints) for joints in ("fewest", "all"))
    assert own < (1 + BALANCED) * other, (own, other)


@pytest.mark.parametrize("name", ["andrews", "quick-return"])
def test_mechanisms_that_took_a_hundred_sweeps_take_fewer(name: str) -> None:
    scene = mechanism_texts.scene(TEXTS[name])
    assert sweeps_of(scene) < {"andrews": 12, "quick-return": 70}[name]
    assert sweeps_of(scene, PymunkEngine(joints="all")) > 80


@pytest.mark.parametrize(("left", "closes"), [(0.4, True), (0.6, False)])
def test_an_open_joint_closes_where_less_than_half_is_left(left: float, closes: bool) -> None:
    scene = ideal_free().model_copy(update={"end_time_s": 0.3})
    engine = PymunkEngine(joints="all")
    sweeps = convergence_of(plan_of(scene.mechanism, fewest=False), path_of(scene)).sweeps(left)
    engine = PymunkEngine(joints="all", iterations=sweeps)
    settings = RunSettings(scene.end_time_s / 48000, SAMPLES)
    if closes:
        assert np.isfinite(engine.simulate(scene, settings).position).all()
    else:
        with pytest.raises(SimulationFailed, match="constraints lost"):
            engine.simulate(scene, settings)


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


def test_joints_that_share_no_body_are_closed_by_one_sweep() -> None:
    alone = ("clearance-free-OAB", "clearance-driven-0.5mm", "clearance-free-0.5mm", "clearance-pendulum")
    assert {sweeps_of(SCENES[name]()) for name in alone} == {1}
    assert sweeps_of(ideal_free()) > 1


def test_hopeless_ratios_of_masses_get_the_most() -> None:
    assert sweeps_of(weighed(ideal_free(), 1.0, 1e12), PymunkEngine(joints="all")) == 1000


def test_what_is_left_by_default_is_below_what_a_joint_closes_at() -> None:
    assert LEFT_OVER < 0.5
