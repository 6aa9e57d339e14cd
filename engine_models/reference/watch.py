"""What is gathered of a member of a sweep, and its scene, which is as long as that takes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from engine_models.mechanics.assembly import start_state
from engine_models.scene.data import SceneError
from engine_models.scene.parts import AnyScene
from engine_models.scene.scene import Scene

T = TypeVar("T", bound=AnyScene)

SPEED = "start.crank_speed_rad_s"
#: Of what fields of the start tell speeds.
SPEEDS = ("speed", "velocity")


@dataclass(frozen=True)
class Watch:
    """What is gathered of a member: over ``revolutions`` after a ``transient``.

    Both are in turns of the scene's turning body at its start's speed. Where it has none, or one that stands
    still at the start, a turn is as long as the scene.
    """

    transient: float = 0.0
    revolutions: float = 2.0
    exponent: bool = False  # the finite-time exponent, by a second start 1e-7 of the clearance beside

    @property
    def turns(self) -> float:
        """Turns in a run."""
        return self.transient + self.revolutions

    def member(self, scene: T, values: Mapping[str, float]) -> T:
        """Return the scene with these values in its fields, by their paths, as long as is watched.

        Raises:
            SceneError: with them it is none.
        """
        if isinstance(scene, Scene) and scene.is_plain:  # checked once, as there are millions of them
            speed = values.get(SPEED, scene.start.crank_speed_rad_s)
        else:
            scene = scene.replace(values)
            speed = turning_speed_rad_s(scene)
        if speed:
            return scene.replace({**values, "end_time_s": self.turns * 2 * math.pi / abs(speed)})
        for path in values:
            if path.startswith("start.") and any(word in path for word in SPEEDS):
                raise SceneError(
                    f"{path}: expected a number other than 0, by which turns are measured, got 0"
                )
        return scene.replace({**values, "end_time_s": self.turns * scene.end_time_s})


def turning_speed_rad_s(scene: AnyScene) -> float:
    """Return the speed of the turning body at the start; 0 without one."""
    if isinstance(scene, Scene) and scene.is_plain:
        return scene.start.crank_speed_rad_s
    body = scene.turning_body
    return 0.0 if body is None else float(start_state(scene)[1][body, 2])
