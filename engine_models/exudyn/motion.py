"""The motion between the steps that an Exudyn solver took, from what it recorded at them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray
from engine_models.exudyn.kinematic_tree import Link, States, tree_states

#: In shorter steps differences of coordinates are round-off to their rates: these are taken as linear.
SHORTEST_FOR_DIFFERENCES_S = 1e-8
#: Gauss's points and weights on (0, 1): of order 6, above the order of the motion between the steps.
POINTS = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18

#: Columns of a contact's history.
GAP, SLIDING_SPEED, APPROACH_SPEED = range(3)


@dataclass(frozen=True)
class Part:
    """A node with the links whose coordinates it has, (c,) at the start.

    ``sensors`` measure coordinates, rates and, where they are asked for, accelerations.
    """

    node: Any
    links: tuple[Link, ...]
    start: FloatArray
    sensors: tuple[int, ...]


def place_bodies(
    states: FloatArray, part: Part, q: FloatArray, v: FloatArray, a: FloatArray | None = None
) -> None:
    """Write a part's bodies into positions, velocities and accelerations, (3, n, bodies, 3).

    Its coordinates, with their rates and accelerations, are (n, c); accelerations may be unknown.
    """
    a = np.zeros_like(q) if a is None else a
    for body, moving in tree_states(part.links, part.start + q, v, a):
        states[:, :, body] = moving


@dataclass(frozen=True)
class Record:
    """Coordinates, rates and accelerations of a part at the steps, each (k, c); the last may be unknown."""

    part: Part
    coordinates: FloatArray
    rates: FloatArray
    accelerations: FloatArray | None = None


@dataclass(frozen=True)
class Motion:
    """All parts' records at the times of k steps (k,), and the contacts' histories (k, 4) by joint.

    ``switched`` (k,) tells the start and the steps at whose end a contact changed to another branch of its
    law: the acceleration recorded there is not the one with which the next step begins.
    """

    time_s: FloatArray
    bodies: int
    records: tuple[Record, ...]
    histories: Mapping[str, FloatArray]
    switched: NDArray[np.bool_]

    def at(self, time_s: FloatArray) -> States:
        """Return positions, velocities and accelerations, each (n, bodies, 3), at any times (n,).

        Within a step the coordinates are the polynomial that meets coordinates, rates and accelerations at
        both ends: of degree 5, less by one for every acceleration that is unknown.
        """
        step = np.clip(np.searchsorted(self.time_s, time_s, "right") - 1, 0, len(self.time_s) - 2)
        out = np.zeros((3, len(time_s), self.bodies, 3))
        for record in self.records:
            place_bodies(out, record.part, *self._coordinates(record, time_s, step))
        return out[0], out[1], out[2]

    def _coordinates(self, record: Record, time_s: FloatArray, step: NDArray[np.int64]) -> States:
        h = (self.time_s[step + 1] - self.time_s[step])[:, None]
        s = (time_s - self.time_s[step])[:, None] / h
        q0, q1 = record.coordinates[step], record.coordinates[step + 1]
        v0, v1 = record.rates[step], record.rates[step + 1]
        d, d0, d1 = q1 - q0, v0 * h, v1 * h
        # Hermite's cubic, then what makes its second derivative right at s = 0 and s = 1: the polynomials
        # s^2 (1-s)^2 and s^3 (1-s)^2 have the second derivatives 2, 2 and 0, 2 there.
        bow0, bow1 = 6 * d - 4 * d0 - 2 * d1, -6 * d + 2 * d0 + 4 * d1
        c = [q0, d0, bow0 / 2, (bow1 - bow0) / 6, np.zeros_like(d), np.zeros_like(d)]
        a0, a1 = bow0 / h**2, bow1 / h**2
        if record.accelerations is not None:
            a1 = record.accelerations[step + 1]
            known = ~self.switched[step][:, None]
            a0 = np.where(known, record.accelerations[step], a1)
            missing = (a1 * h**2 - bow1) / 2
            alpha = np.where(known, (a0 * h**2 - bow0) / 2, missing)
            beta = missing - alpha
            c[2], c[3] = c[2] + alpha, c[3] - 2 * alpha + beta
            c[4], c[5] = alpha - 2 * beta, beta
        q = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
        v = (c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * 5 * c[5])))) / h
        a = (2 * c[2] + s * (6 * c[3] + s * (12 * c[4] + s * 20 * c[5]))) / h**2
        short = h < SHORTEST_FOR_DIFFERENCES_S
        return q, np.where(short, v0 + s * (v1 - v0), v), np.where(short, a0 + s * (a1 - a0), a)


def integral(grid: FloatArray, integrands: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the integrals of functions (m, n) of time (n,) from a grid's start to its times (g,), (m, g)."""
    width = np.diff(grid)
    values = integrands((grid[:-1, None] + width[:, None] * POINTS).ravel())
    pieces = values.reshape(len(values), -1, len(POINTS)) @ WEIGHTS * width
    return np.concatenate([np.zeros((len(values), 1)), np.cumsum(pieces, axis=1)], axis=1)
