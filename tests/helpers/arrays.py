"""Trajectories compared bit by bit."""

from typing import Any

import numpy as np


def arrays(record: Any) -> dict[str, bytes]:
    """Return all numbers of a trajectory or a contact, bit by bit."""
    numbers: dict[str, bytes] = {}
    for name, value in vars(record).items():
        if isinstance(value, np.ndarray):
            numbers[name] = value.tobytes()
        elif name == "impacts":
            numbers |= arrays(value)
        elif name == "contacts":
            numbers |= {f"{joint} {key}": x for joint, c in value.items() for key, x in arrays(c).items()}
    return numbers
