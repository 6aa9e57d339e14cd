"""Trajectories as plain arrays, and compared bit by bit."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.trajectory import Reactions


def arrays(record: Any) -> dict[str, bytes]:
    """Return all numbers of a trajectory or a contact, bit by bit."""
    numbers: dict[str, bytes] = {}
    for name, value in vars(record).items():
        if isinstance(value, np.ndarray):
            numbers[name] = value.tobytes()
        elif name == "impacts":
            numbers |= arrays(value)
        elif isinstance(value, Mapping):
            for key, part in value.items():
                own = {"": part.tobytes()} if isinstance(part, np.ndarray) else arrays(part)
                numbers |= {f"{name} {key} {of}": x for of, x in own.items()}
    return numbers


def joint_forces(of: Trajectory | Reactions) -> FloatArray:
    """Return the forces of all joints in one array, (n, joints, 2), in the order of the scene's joints."""
    return np.stack(list(of.joint_force_N.values()), axis=1)
