"""The stored truths are enough, certain as they say, and found again; the recipe has not lost its range."""

import numpy as np
import pytest

from tests.random_scenes.make import INTEGRATIONS
from tests.random_scenes.recipe import COMPLIANT
from tests.random_scenes.truths import DEFAULT, SAMPLES, TOLERANCES_M, Kind, certain_to_m, truths

#: Scenes of each kind, and how many of them at least are judged at the sharpest tolerance.
WANTED: dict[Kind, tuple[int, int]] = {"compliant": (200, 190), "rigid": (100, 90)}
KINDS = list(WANTED)


@pytest.mark.parametrize("kind", KINDS)
def test_there_are_enough_and_each_is_certain_to_a_hundredth(kind: Kind) -> None:
    found, (scenes, sharp) = truths(kind), WANTED[kind]
    assert len(found) >= scenes
    assert sum(TOLERANCES_M[-1] in truth.judgements for truth in found) >= sharp
    for truth in found:
        scene = truth.scene
        for at, judgement in truth.judgements.items():
            assert judgement.uncertainty_m <= certain_to_m(scene, at) * 1.05  # it is rounded
            assert 0 < judgement.end_time_s <= scene.end_time_s * (1 + 1e-15)
            assert judgement.slider_position_m.shape == (SAMPLES + 1,)
        missing = [at for at in (*TOLERANCES_M, DEFAULT) if at not in truth.judgements]
        assert truth.stopped or not missing, f"seed {truth.seed} says not why it has no {missing}"


def test_every_law_and_drive_occurs() -> None:
    scenes = [truth.scene for truth in truths("compliant")]
    joints = [joint for scene in scenes for _, joint in scene.clearance if joint is not None]
    assert {joint.law for joint in joints} == set(COMPLIANT)
    frictions = {joint.friction.law for joint in joints if joint.friction is not None}
    assert frictions == {"saturated-linear", "ambrosio", "tanh"}
    assert {scene.drive.kind for scene in scenes} == {"free", "torque", "constant-speed"}
    assert {np.sign(scene.start.crank_speed_rad_s) for scene in scenes} == {-1.0, 1.0}
    assert {len(scene.joints_with_clearance) for scene in scenes} == {1, 2, 3}
    assert min(body.mass_kg for scene in scenes for body in scene.bodies) < 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_a_truth_is_found_again_by_another_method(kind: Kind) -> None:
    """By the last of a scene's integrations; the positions stored are those of the first."""
    for truth in truths(kind)[2:6]:
        integration = INTEGRATIONS[kind](truth.scene)[-1]()
        judgement = truth.judgements[TOLERANCES_M[-1]]
        times = np.linspace(0.0, judgement.end_time_s, SAMPLES + 1)[1:]
        for t, expected in zip(times.tolist(), judgement.slider_position_m[1:], strict=True):
            if not integration.to(t):
                break
            assert abs(integration.slider_m - expected) < certain_to_m(truth.scene, TOLERANCES_M[-1])
        assert t > times[0]
