"""Bodies by the coordinates of links, and what forces on bodies put on these: compiled.

A frame is (x, y, angle) with two derivatives. Along a link's axis u by s, on a frame that turns at w,
r = s u, r' = s' u + w z x r, r'' = s'' u + 2 w s' z x u + w' z x r - w^2 r. By virtual power a force F at
the frame's origin, and a torque T about it, put F u on a link that slides and T on one that turns.
"""

import math
from collections.abc import Sequence

import numpy as np

from engine_models.engine import FloatArray
from engine_models.exudyn.tree import AXES, Branch
from engine_models.kernels import compiled
from engine_models.minimal import equations as eq

entry = compiled(error_model="numpy")
#: Columns of a link; its body is -1 without one.
PARENT, AXIS, X, Y, ANGLE, BODY, CENTRE_X, CENTRE_Y, TURNED = range(9)
TURN = AXES.index("turn")


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


@eq.jit
def carry(f: FloatArray, x: float, y: float, rate_x: float, rate_y: float, ax: float, ay: float) -> None:
    """Move a frame to a place in itself, which moves there."""
    c, s, w = math.cos(f[2]), math.sin(f[2]), f[5]
    rx, ry = c * x - s * y, s * x + c * y
    vx, vy = c * rate_x - s * rate_y, s * rate_x + c * rate_y
    f[0] += rx
    f[1] += ry
    f[3] += vx - w * ry
    f[4] += vy + w * rx
    f[6] += c * ax - s * ay - 2.0 * w * vy - f[8] * ry - w * w * rx
    f[7] += s * ax + c * ay + 2.0 * w * vx + f[8] * rx - w * w * ry


@eq.jit
def place_bodies(
    links: FloatArray, s: FloatArray, r: FloatArray, u: FloatArray, frames: FloatArray, out: FloatArray
) -> None:
    """Fill the links' frames (links, 9) and the bodies' states (3, 3b) from coordinates and derivatives."""
    for k in range(len(links)):
        e, f = links[k], frames[k]
        f[:] = 0.0
        if e[PARENT] >= 0.0:
            f[:] = frames[int(e[PARENT])]
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
                out[i, b : b + 3] = centre[3 * i : 3 * i + 3]


@entry
def states(links: FloatArray, s: FloatArray, r: FloatArray, u: FloatArray, out: FloatArray) -> None:
    """Fill the bodies' positions, velocities and accelerations (n, 3, 3b) from links' (n, links) each."""
    frames = np.empty((len(links), 9))
    for n in range(len(s)):
        place_bodies(links, s[n], r[n], u[n], frames, out[n])


@entry
def generalised(
    p: FloatArray, links: FloatArray, t: float, s: FloatArray, r: FloatArray, at: FloatArray, out: FloatArray
) -> None:
    """Fill what the loads of p put on every link, out (links,); ``at`` (3, 3b) has bodies without a link."""
    frames, F = np.empty((len(links), 9)), np.zeros(at.shape[1])
    told, powers = np.empty(p.size), np.empty(p.size)
    place_bodies(links, s, r, np.zeros(len(links)), frames, at)
    eq.forces(p, t, at[0], at[1], F, told, powers)
    wrench = np.zeros((len(links), 3))
    for k in range(len(links) - 1, -1, -1):
        e, f, w = links[k], frames[k], wrench[k]
        if e[BODY] >= 0.0:
            b = 3 * int(e[BODY])
            w[0], w[1] = w[0] + F[b], w[1] + F[b + 1]
            w[2] += F[b + 2] + (at[0, b] - f[0]) * F[b + 1] - (at[0, b + 1] - f[1]) * F[b]
        c, d = math.cos(f[2]), math.sin(f[2])
        out[k] = w[2]
        if e[AXIS] == 0.0:
            out[k] = c * w[0] + d * w[1]
        elif e[AXIS] == 1.0:
            out[k] = c * w[1] - d * w[0]
        if e[PARENT] >= 0.0:
            above, carrier = wrench[int(e[PARENT])], frames[int(e[PARENT])]
            above[0], above[1] = above[0] + w[0], above[1] + w[1]
            above[2] += w[2] + (f[0] - carrier[0]) * w[1] - (f[1] - carrier[1]) * w[0]
