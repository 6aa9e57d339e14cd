"""The reference with something wrong in its runs, for those that are to see it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from engine_models.engine import Engine, RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.scene.scene import Scene


@dataclass(frozen=True)
class Altered(Engine):
    """The reference, by DOP853 where it is to be sharp, with its runs altered."""

    change: Callable[[Trajectory], Trajectory]
    sharp: bool = False
    order: ClassVar[int | None] = 4

    def check(self, scene: Scene) -> None:
        """It runs all scenes."""

    def simulate(self, scene: Scene, settings: RunSettings) -> Trajectory:
        """Run the reference and alter what it returns."""
        sharp = {"method": "dop853", "step_tolerance": 1e-12} if self.sharp else {}
        return self.change(make_engine("reference", **sharp).simulate(scene, settings))
