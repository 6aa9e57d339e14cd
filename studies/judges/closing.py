"""Where bodies would be if no joint had clearance: the positions nearest to given ones that close all joints.

Gauss-Newton in the norm of [M]: q - M^-1 B^T (B M^-1 B^T)^-1 g closes the rows g of joints and guides, whose
rates are B q', to first order.
"""

from dataclasses import replace

import numpy as np

from engine_models.engine import FloatArray
from engine_models.minimal.model import Numbers, damping_of
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import ConstantSpeed, DriveData

#: Steps at the most, and turns in a step. Steps end where the next one would be no longer than this, in m and
#: rad: they fall as their squares do. So many positions are closed together, in memory that is near.
MOST_STEPS, TURN_RAD, SHORT, TOGETHER = 12, 0.5, 1e-9, 500
#: Rows with a least singular value below this, of the largest, may depend on each other once joints with
#: clearance are closed. Singular values below its tenth are then 0.
DEPENDENT = 1e-2


def closed(scene: Scene, position: FloatArray, turning: int | None) -> FloatArray:
    """Return the positions (n, bodies, 3) nearest to given ones with all joints closed; NaN where none is.

    They are the nearest to first order in the distance. A ``turning`` body keeps its angle. A body in a guide
    keeps the angle that it has there in the first one.
    """
    pins = tuple(replace(pin, clearance=None, bearing_on_j=False) for pin in scene.mechanism.pins)
    drive = DriveData(0) if turning is None else DriveData(turning, law=ConstantSpeed(0.0))
    of, begun = replace(scene.mechanism, pins=pins, drive=drive), position.reshape(len(position), -1)
    numbers, closed = Numbers(of, begun[0].copy(), damping_of), begun.copy()
    weights = 1 / numbers.masses.ravel()
    first = numbers.look(0.0, begun[0])[0] * np.sqrt(weights)
    values = np.linalg.svd(first / np.linalg.norm(first, axis=1, keepdims=True), compute_uv=False)
    dependent = bool(values[-1] < DEPENDENT * values[0])
    for k in range(0, len(begun), TOGETHER):
        at, last = closed[k : k + TOGETHER], 1e-100
        for _ in range(MOST_STEPS):
            B, open_by, *_ = numbers.look(0.0, at)
            if turning is not None:  # its row, the last, is from the angle in the first position
                open_by[:, -1] -= begun[k : k + TOGETHER, 3 * turning + 2] - begun[0, 3 * turning + 2]
            if not dependent and B.shape[1] == B.shape[2]:  # one position alone closes all
                move = np.linalg.solve(B, open_by[:, :, None])
            else:
                weighted = weights * B @ B.swapaxes(1, 2)
                if dependent:
                    inverse = np.linalg.pinv(weighted, (DEPENDENT / 10) ** 2, hermitian=True)
                    force = inverse @ open_by[:, :, None]
                else:
                    force = np.linalg.solve(weighted, open_by[:, :, None])
                move = weights[:, None] * B.swapaxes(1, 2) @ force
            size = np.abs(move[:, :, 0])
            step, turn = size.max(axis=1), size[:, 2::3].max(axis=1)
            at -= move[:, :, 0] * np.minimum(1.0, TURN_RAD / np.maximum(turn, TURN_RAD))[:, None]
            left, last = step * (step / last) ** 2, step
            if not (left > SHORT).any():
                break
        at[~(left <= SHORT)] = np.nan
    return np.asarray(closed.reshape(position.shape))
