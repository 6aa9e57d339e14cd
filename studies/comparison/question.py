"""What a comparison on one scene is judged by: a signal, the error wanted, and until when it is known."""

from dataclasses import dataclass

import numpy as np

from engine_models.engine import Trajectory, UnsupportedScene
from engine_models.mechanics.states import lever_m
from engine_models.scene.parts import AnyScene
from studies.judges.converged_truth import GRID, converged, followed
from studies.judges.metrics import signals, with_suffix

#: A hundredth of the clearance is a line's width in a picture of the pin's path, a millionth of a crank, or
#: of the longest lever, what a workshop measures. Where the crank is prescribed so is the ideal slider, and a
#: torque sensor is good to a thousandth.
CLEARANCE_PART, CRANK_PART, TORQUE_PART = 1e-2, 1e-6, 1e-3


@dataclass(frozen=True)
class Question:
    """The column of errors by which engines are judged, the error wanted in its unit, and until when.

    ``compared_until_s`` is the last sample before the scene's horizon, its end if it has none.
    """

    column: str
    wanted: float
    compared_until_s: float


def asked(scene: AnyScene) -> Question:
    """Return the question for a scene, for which its truth is found.

    Raises:
        UnsupportedScene, SimulationFailed: there is no truth, or it is not known beyond the start.
    """
    truth, _ = converged(scene, GRID)
    samples = followed(scene, GRID)
    if samples < 2:
        raise UnsupportedScene("starts a hair apart part at once: nobody can know its motion")
    return Question(*_judged(scene, truth), float(truth.time_s[samples - 1]))


def _effort(scene: AnyScene) -> str:
    return "driver_torque_error_N_m" if scene.mechanism.drive.guide is None else "driver_force_error_N"


def _judged(scene: AnyScene, truth: Trajectory) -> tuple[str, float]:
    rooms = scene.clearances.values()
    if not rooms and scene.speed_is_prescribed:
        assert truth.driver_torque_N_m is not None
        if peak_N_m := float(np.abs(truth.driver_torque_N_m).max()):
            return _effort(scene), TORQUE_PART * peak_N_m
    wanted_m = CRANK_PART * lever_m(scene)
    if rooms:
        wanted_m = CLEARANCE_PART * min(room.radial_clearance_m for room in rooms)
    name, _ = next(signals(scene, truth))
    return with_suffix(name, "error"), wanted_m / (lever_m(scene) if name.endswith("_rad") else 1.0)
