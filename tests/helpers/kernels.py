"""Small mechanisms without contacts, and what their kernels are written for."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from engine_models.reference.run import mechanism_of
from engine_models.scene.library import IDEAL_SCENES
from engine_models.scene.short import assembled
from reference_solver.mechanism.data import GROUND, Guide
from reference_solver.mechanism.data import Point as Place
from reference_solver.mechanism.mechanism import Mechanism

FloatArray = NDArray[np.float64]
#: A mechanism, coordinates and velocities to start from, and a step in s.
Start = tuple[Mechanism, FloatArray, FloatArray, float]


def straight_guide(body: int, point: Place, angle_rad: float) -> tuple[Guide]:
    """Return what keeps a body's centre on a fixed line through a point, and the body's angle."""
    return (Guide(GROUND, point, body, (0.0, 0.0), angle_rad),)


def scene_case(name: str) -> Start:
    scene = IDEAL_SCENES[name]()
    q, v = assembled(
        scene.short, scene.short.start.crank_angle_rad + 0.7, scene.short.start.crank_speed_rad_s + 10
    )
    driven = mechanism_of(
        scene.model_copy(
            update={"start": scene.short.start.model_copy(update={"crank_speed_rad_s": float(v[0, 2])})}
        )
    )
    return driven, q.ravel(), v.ravel(), 1e-4


CASES: dict[str, Callable[[], Start]] = {name: partial(scene_case, name) for name in IDEAL_SCENES}
