"""Chains and rings of many bodies."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reference_solver.mechanism.mechanism import (
    GROUND,
    Body,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    SpringDamper,
)
from tests.helpers import kernels
from tests.helpers.kernels import Start

FloatArray = NDArray[np.float64]


def chain(links: int) -> Mechanism:
    """A chain of rods of 0.1 m, hung from the frame."""
    length = 0.1
    first = RevoluteJoint(GROUND, (0.0, 0.0), 0, (-length / 2, 0.0))
    joints = [RevoluteJoint(k, (length / 2, 0.0), k + 1, (-length / 2, 0.0)) for k in range(links - 1)]
    return Mechanism((Body(0.1, 1e-4),) * links, (first, *joints), gravity_m_s2=9.81)


def chain_start(angles: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q and v of a chain from its rods' angles and their rates."""
    halves = 0.05 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    turning = rates[:, None] * np.stack([-halves[:, 1], halves[:, 0]], axis=1)
    q, v = (2 * np.cumsum(vectors, axis=0) - vectors for vectors in (halves, turning))
    return np.column_stack([q, angles]).ravel(), np.column_stack([v, rates]).ravel()


def curled_chain_case() -> Start:
    """Return a chain of 40 links in a curl, every link turning at its own rate."""
    links = np.arange(40.0)
    return chain(40), *chain_start(0.3 * links + np.sin(links), 2 * np.cos(3 * links)), 1e-3


def ring_case() -> Start:
    """Return five rods in a ring, whose elimination fills in: thrown up, turning, driven, with a spring."""
    sides, speed = 5, 3.0
    turns = 2 * np.pi * np.arange(sides) / sides
    inner, half = 0.1, 0.1 * np.tan(np.pi / sides)
    joints = [RevoluteJoint(k, (half, 0.0), (k + 1) % sides, (-half, 0.0)) for k in range(sides)]
    mechanism = Mechanism(
        tuple(Body(0.1 + 0.05 * k, 1e-4 * (k + 1)) for k in range(sides)),
        (*joints, PrescribedSpeed(2, speed)),
        (SpringDamper(0, (0.01, 0.02), 3, (0.0, 0.01), 50.0, 0.2, 0.05),),
        gravity_m_s2=9.81,
    )
    centres = inner * np.column_stack([np.cos(turns), np.sin(turns)])
    rates = speed * np.column_stack([-centres[:, 1], centres[:, 0]]) + [0.3, 2.0]
    q = np.column_stack([centres, turns + np.pi / 2])
    return mechanism, q.ravel(), np.column_stack([rates, np.full(sides, speed)]).ravel(), 1e-3


#: All mechanisms without contacts, the small ones too.
CASES: dict[str, Callable[[], Start]] = {
    **kernels.CASES,
    "chain of 40": curled_chain_case,
    "ring": ring_case,
}
