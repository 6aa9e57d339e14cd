"""Claims that fail, and none beside them, for an engine whose run is off in one respect by little."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.conformance.claims import CLAIMS, Trial

Change = Callable[[Trajectory], Trajectory]


@dataclass(frozen=True)
class Altered:
    """The reference, with its run altered."""

    change: Change
    order = 4

    def check(self, scene: Scene) -> None:
        """It runs all scenes."""

    def twin(self, scene: Scene) -> Scene:
        return scene

    def sharper(self) -> "Altered":
        return self

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        return self.change(make_engine("reference").simulate(scene, settings))


def faster(run: Trajectory) -> Trajectory:
    """Ever faster, by 3 in a thousand at the end: twice as much energy from nowhere, and hardly a force."""
    return replace(run, velocity=run.velocity * np.linspace(1.0, 1.003, len(run.time_s))[:, None, None])


def stronger(run: Trajectory) -> Trajectory:
    """All joint forces a tenth larger."""
    return replace(run, joint_force_N=1.1 * run.joint_force_N)


def elsewhere(run: Trajectory) -> Trajectory:
    """The slider, and what hangs on it, a tenth of a millimetre off, at the end alone."""
    position = run.position.copy()
    position[-1, -1, 0] += 1e-4
    return replace(run, position=position)


def late(run: Trajectory) -> Trajectory:
    """It begins a thousandth of a radian later."""
    position = run.position.copy()
    position[0, 0, 2] += 1e-3
    return replace(run, position=position)


@pytest.mark.parametrize(
    ("change", "broken"),
    [
        (lambda run: run, set()),
        (faster, {"No energy comes or goes that work and losses do not explain"}),
        (stronger, {"Forces are those that the accelerations need"}),
        (
            elsewhere,
            {
                "Ideal joints and the guide stay closed",
                "The slider is where the converged solution of the engine's own law has it",
            },
        ),
        (late, {"The run begins in the scene's own state", "Ideal joints and the guide stay closed"}),
    ],
    ids=["nothing", "faster", "stronger", "elsewhere", "late"],
)
def test_a_claim_fails_of_what_it_is_about(change: Change, broken: set[str]) -> None:
    trial = Trial(Altered(change), SCENES["ideal-free"]())
    assert {sentence for sentence, claim in CLAIMS.items() if not claim(trial).holds} == broken
