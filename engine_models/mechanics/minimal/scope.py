"""The scenes that minimal coordinates can express, and the reasons why they cannot express others."""

import math

from engine_models.engine import UnsupportedScene
from engine_models.scene.scene import Scene


def require_coordinates(engine: str, scene: Scene) -> None:
    """Raise UnsupportedScene where there is no ODE in minimal coordinates, or its coordinate would fail."""
    if scene.joints_with_clearance:
        return
    if scene.speed_is_prescribed:
        reason = "the motion is prescribed: there is no ODE to integrate"
        raise UnsupportedScene(
            f"{engine} on minimal coordinates: {reason} (drive.kind = '{scene.drive.kind}')"
        )
    if scene.rod is None:
        return
    if scene.rod.length_m <= scene.crank.length_m:
        reason = "the crank's angle does not tell where the rod is (rod.length_m <= crank.length_m)"
        raise UnsupportedScene(f"{engine} on minimal coordinates: {reason}")
    if scene.start.rod is not None and math.cos(scene.start.rod.angle_rad) <= 0:
        reason = "the rod starts on the other side (start.rod.angle_rad)"
        raise UnsupportedScene(f"{engine} on minimal coordinates: {reason}")
