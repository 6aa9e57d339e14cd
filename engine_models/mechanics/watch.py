"""What is gathered of a member of a sweep, and its scene, which is as long as that takes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from engine_models.scene.data import SceneError
from engine_models.scene.scene import Scene

SPEED = "start.crank_speed_rad_s"


@dataclass(frozen=True)
class Watch:
    """What is gathered of a member: over ``revolutions`` after a ``transient``.

    Both are in turns of the crank at its start's speed.
    """

    transient: float = 0.0
    revolutions: float = 2.0
    exponent: bool = False  # the finite-time exponent, by a second start 1e-7 of the clearance beside

    @property
    def turns(self) -> float:
        """Turns of the crank in a run."""
        return self.transient + self.revolutions

    def member(self, scene: Scene, values: Mapping[str, float]) -> Scene:
        """Return the scene with these values in its fields, by their paths, as long as is watched.

        Raises:
            SceneError: with them it is none.
        """
        speed = values.get(SPEED, scene.start.crank_speed_rad_s)
        if speed == 0:
            raise SceneError(f"{SPEED}: expected a number other than 0, by which turns are measured, got 0")
        return scene.replace({**values, "end_time_s": self.turns * 2 * math.pi / abs(speed)})
