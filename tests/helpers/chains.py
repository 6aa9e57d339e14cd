"""Chains of many bodies."""

import numpy as np
from numpy.typing import NDArray

from reference_solver.mechanism.data import GROUND, Body, Pin
from reference_solver.mechanism.mechanism import Mechanism

FloatArray = NDArray[np.float64]


def chain(links: int) -> Mechanism:
    """A chain of rods of 0.1 m, hung from the frame."""
    length = 0.1
    first = Pin(GROUND, (0.0, 0.0), 0, (-length / 2, 0.0))
    joints = [Pin(k, (length / 2, 0.0), k + 1, (-length / 2, 0.0)) for k in range(links - 1)]
    return Mechanism((Body(0.1, 1e-4),) * links, (first, *joints), gravity_m_s2=9.81)


def chain_start(angles: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q and v of a chain from its rods' angles and their rates."""
    halves = 0.05 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    turning = rates[:, None] * np.stack([-halves[:, 1], halves[:, 0]], axis=1)
    q, v = (2 * np.cumsum(vectors, axis=0) - vectors for vectors in (halves, turning))
    return np.column_stack([q, angles]).ravel(), np.column_stack([v, rates]).ravel()
