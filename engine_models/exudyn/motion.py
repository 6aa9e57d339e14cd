"""The motion of bodies by the coordinates of links, and what forces on bodies put on these.

A frame is (x, y, angle) with two derivatives. Along a link's axis u by s, on a frame that turns at w,
r = s u, r' = s' u + w z x r, r'' = s'' u + 2 w s' z x u + w' z x r - w^2 r. Forces F on bodies put on a link
their power F v at its unit rate.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import FloatArray
from engine_models.exudyn.tree import AXES, Branch

#: Columns of a link; its body is -1 without one.
PARENT, AXIS, X, Y, ANGLE, BODY, CENTRE_X, CENTRE_Y, TURNED = range(9)
TURN = AXES.index("turn")
#: In shorter steps differences of coordinates are round-off to their rates: these are taken as linear.
SHORTEST_FOR_DIFFERENCES_S = 1e-8
#: Gauss's points and weights on (0, 1): of order 6, above the order of the motion between the steps.
POINTS = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18
#: So many parts of an integral's grid are evaluated at a time, which bounds the memory that it takes.
AT_ONCE = 10_000

#: Columns of a contact's history.
GAP, SLIDING_SPEED, APPROACH_SPEED = range(3)


def link_rows(branches: Sequence[Branch]) -> FloatArray:
    """Return the links of branches, one after the other, as rows."""
    rows = list[list[float]]()
    for branch in branches:
        first = len(rows)
        for link in branch.links:
            parent = link.parent + first if link.parent >= 0 else -1
            body = -1 if link.body is None else link.body
            place = *link.offset_m, link.angle_rad
            rows.append([parent, AXES.index(link.axis), *place, body, *link.centre_m, link.turned_rad])
    return np.array(rows)


def carry(f: FloatArray, x: Any, y: Any, rate_x: Any, rate_y: Any, ax: Any, ay: Any) -> None:
    """Move a frame (9,), or (9, n), to a place in itself, which moves there."""
    c, s, w = np.cos(f[2]), np.sin(f[2]), f[5]
    rx, ry = c * x - s * y, s * x + c * y
    vx, vy = c * rate_x - s * rate_y, s * rate_x + c * rate_y
    f[0] += rx
    f[1] += ry
    f[3] += vx - w * ry
    f[4] += vy + w * rx
    f[6] += c * ax - s * ay - 2.0 * w * vy - f[8] * ry - w * w * rx
    f[7] += s * ax + c * ay + 2.0 * w * vx + f[8] * rx - w * w * ry


def place_bodies(
    links: FloatArray, s: FloatArray, r: FloatArray, u: FloatArray, frames: FloatArray, out: FloatArray
) -> None:
    """Fill the links' frames (links, 9) and the bodies' states (3, 3b) from coordinates and derivatives.

    Those of n times, (links, n), fill (links, 9, n) and (3, 3b, n).
    """
    for k in range(len(links)):
        e, f = links[k], frames[k]
        for i in range(9):
            f[i] = frames[int(e[PARENT]), i] if e[PARENT] >= 0.0 else 0.0
        carry(f, e[X], e[Y], 0.0, 0.0, 0.0, 0.0)
        f[2] += e[ANGLE]
        if e[AXIS] == TURN:
            f[2], f[5], f[8] = f[2] + s[k], f[5] + r[k], f[8] + u[k]
        elif e[AXIS] == 0.0:
            carry(f, s[k], 0.0, r[k], 0.0, u[k], 0.0)
        else:
            carry(f, 0.0, s[k], 0.0, r[k], 0.0, u[k])
        if e[BODY] >= 0.0:
            b, centre = 3 * int(e[BODY]), f.copy()
            carry(centre, e[CENTRE_X], e[CENTRE_Y], 0.0, 0.0, 0.0, 0.0)
            centre[2] += e[TURNED]
            for i in range(3):
                for j in range(3):
                    out[i, b + j] = centre[3 * i + j]


def bodies_at(
    links: FloatArray, bodies: int, s: FloatArray, r: FloatArray, u: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions, velocities and accelerations of bodies, (n, bodies, 3), from links' (links, n)."""
    out = np.zeros((3, 3 * bodies, s.shape[1]))
    place_bodies(links, s, r, u, np.empty((len(links), 9, s.shape[1])), out)
    position, velocity, acceleration = (each.T.reshape(-1, bodies, 3) for each in out)
    return position, velocity, acceleration


@dataclass(frozen=True)
class Motion:
    """What was recorded at the times of k steps (k,): of links and of contacts.

    ``coordinates``, ``rates`` and ``accelerations`` are (k, links), ``histories`` (k, 4) by joint.
    ``switched`` (k,) tells the start and the steps at whose end a contact changed to another branch of its
    law: the acceleration recorded there is not the one with which the next step begins.
    """

    time_s: FloatArray
    links: FloatArray
    bodies: int
    coordinates: FloatArray
    rates: FloatArray
    accelerations: FloatArray
    histories: Mapping[str, FloatArray]
    switched: NDArray[np.bool_]
    implicit: bool

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations, each (n, bodies, 3), at any times (n,).

        Within a step the coordinates are the polynomial of degree 5 that meets coordinates, rates and
        accelerations at both ends; of degree 4 where the acceleration at its begin is unknown. Accelerations
        of ``implicit`` solvers, which are not the derivatives of rates to more than their order, are linear.
        """
        step = np.clip(np.searchsorted(self.time_s, time_s, "right") - 1, 0, len(self.time_s) - 2)
        h = (self.time_s[step + 1] - self.time_s[step])[:, None]
        s = (time_s - self.time_s[step])[:, None] / h
        q0, q1 = self.coordinates[step], self.coordinates[step + 1]
        v0, v1 = self.rates[step], self.rates[step + 1]
        d, d0, d1 = q1 - q0, v0 * h, v1 * h
        # Hermite's cubic, then what makes its second derivative right at s = 0 and s = 1: the polynomials
        # s^2 (1-s)^2 and s^3 (1-s)^2 have the second derivatives 2, 2 and 0, 2 there.
        bow0, bow1 = 6 * d - 4 * d0 - 2 * d1, -6 * d + 2 * d0 + 4 * d1
        known, a1 = ~self.switched[step][:, None], self.accelerations[step + 1]
        a0 = np.where(known, self.accelerations[step], a1)
        missing = (a1 * h**2 - bow1) / 2
        alpha = np.where(known, (a0 * h**2 - bow0) / 2, missing)
        beta = missing - alpha
        c2, c3 = bow0 / 2 + alpha, (bow1 - bow0) / 6 - 2 * alpha + beta
        c4, c5 = alpha - 2 * beta, beta
        q = q0 + s * (d0 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
        v = (d0 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h
        a = (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / h**2
        short = h < SHORTEST_FOR_DIFFERENCES_S
        v = np.where(short, v0 + s * (v1 - v0), v)
        a = np.where(short | self.implicit, a0 + s * (a1 - a0), a)
        return bodies_at(self.links, self.bodies, q.T, v.T, a.T)

    def approach_m_s(self, joint: str, time_s: FloatArray) -> FloatArray:
        """Return the speeds of a joint's latest touches at times (n,), stored as the step ends."""
        end = np.clip(np.searchsorted(self.time_s, time_s, "left"), 0, len(self.time_s) - 1)
        return np.asarray(self.histories[joint][end, APPROACH_SPEED])


def integral(grid: FloatArray, integrands: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the integrals of functions (m, n) of time (n,) from a grid's start to its times (g,), (m, g)."""
    pieces = list[FloatArray]()
    for first in range(0, len(grid) - 1, AT_ONCE):
        part = grid[first : first + AT_ONCE + 1]
        width = np.diff(part)
        values = integrands((part[:-1, None] + width[:, None] * POINTS).ravel())
        pieces.append(values.reshape(len(values), -1, len(POINTS)) @ WEIGHTS * width)
    return np.pad(np.cumsum(np.concatenate(pieces, axis=1), axis=1), ((0, 0), (1, 0)))


def trapezoids(grid: FloatArray, values: FloatArray) -> FloatArray:
    """Return the same by the trapezoidal rule, from values (m, g) at the grid's times."""
    return np.pad(np.cumsum(np.diff(grid) * (values[:, 1:] + values[:, :-1]) / 2, axis=1), ((0, 0), (1, 0)))
