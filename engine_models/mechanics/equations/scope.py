"""The scenes that minimal coordinates can express, and the reason why they cannot express others."""

import numpy as np

from engine_models.engine import UnsupportedScene
from engine_models.mechanics.equations.mechanism import mechanism_of
from engine_models.mechanics.equations.structure import structure_of
from engine_models.scene.parts import AnyScene


def require_coordinates(engine: str, scene: AnyScene) -> None:
    """Raise UnsupportedScene where a prescribed motion leaves no ODE."""
    if scene.joints_with_clearance or not scene.speed_is_prescribed:
        return
    mechanism = mechanism_of(scene)
    if structure_of(mechanism, np.zeros(3 * len(mechanism.bodies))).freedoms == 0:
        reason = "the motion is prescribed: there is no ODE to integrate"
        raise UnsupportedScene(
            f"{engine} on minimal coordinates: {reason} (drive.kind = '{scene.driven_by.kind}')"
        )
