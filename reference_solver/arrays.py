"""A mechanism as arrays: what stays constant in [B], {C}, {g}, {F}, and where the rest goes.

Every constraint row is  B(q) q' = C  at velocity level and  g = E q + d - C t + (revolute arms) = 0  at
position level. Only a revolute joint's entries under the two bodies' angles vary, and all of a massless
link's, whose g is half its squared length plus the constant d; all else in [B] is the constant E. The frame
is kept as one more body, at rest, behind the real ones, whose columns are dropped.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reference_solver.mechanism import (
    Constraint,
    MasslessLink,
    Mechanism,
    PrescribedSpeed,
    RevoluteJoint,
    StraightGuide,
    Torque,
)

FloatArray = NDArray[np.float64]


def row_slices(mechanism: Mechanism) -> list[slice]:
    """Return the rows of [B], and so the multipliers, of each constraint in order."""
    single = (PrescribedSpeed, MasslessLink)
    ends = np.cumsum([0] + [1 if isinstance(c, single) else 2 for c in mechanism.constraints])
    return [slice(int(a), int(b)) for a, b in pairwise(ends)]


class MechanismArrays:
    """Constant arrays of a mechanism with b bodies, m constraint rows and r revolute joints.

    ``inverse_mass`` (3b,), ``E`` (m, 3b+3), ``C`` (m,), ``d`` (m,), ``F`` (3b,) of gravity and torques;
    ``row`` (r,) is each revolute joint's first row, ``phi_i`` and ``phi_j`` (r,) its bodies' angle columns,
    ``point_i`` and ``point_j`` (2, r) its points in the bodies' frames. Of l massless links
    ``link_row`` (l,), ``link_i`` and ``link_j`` (3, l), all columns of their bodies, and ``link_point_i`` and
    ``link_point_j`` (2, l).
    """

    def __init__(self, mechanism: Mechanism, q_start: FloatArray) -> None:
        bodies, self._q_start = mechanism.bodies, q_start
        slices = row_slices(mechanism)
        m, n = slices[-1].stop if slices else 0, 3 * len(bodies)
        self.inverse_mass = np.array([1 / a for b in bodies for a in (b.mass_kg, b.mass_kg, b.inertia_kg_m2)])
        self.F = np.zeros(n)
        self.F[1::3] = [-mechanism.gravity_m_s2 * body.mass_kg for body in bodies]
        for load in mechanism.loads:
            if isinstance(load, Torque):
                self.F[3 * load.body + 2] += load.torque_N_m
        self.E, self.C, self.d = np.zeros((m, n + 3)), np.zeros(m), np.zeros(m)
        for rows, constraint in zip(slices, mechanism.constraints, strict=True):
            self._fill(rows.start, constraint)
        joints = [
            (rows.start, c)
            for rows, c in zip(slices, mechanism.constraints, strict=True)
            if isinstance(c, RevoluteJoint)
        ]
        # Python's index -1, GROUND, finds the frame's columns at the end.
        self.row = np.array([row for row, _ in joints], dtype=int)
        self.phi_i = np.array([self.columns(c.body_i)[2] for _, c in joints], dtype=int)
        self.phi_j = np.array([self.columns(c.body_j)[2] for _, c in joints], dtype=int)
        self.point_i = np.array([c.point_i for _, c in joints], dtype=float).reshape(-1, 2).T
        self.point_j = np.array([c.point_j for _, c in joints], dtype=float).reshape(-1, 2).T
        links = [
            (rows.start, c)
            for rows, c in zip(slices, mechanism.constraints, strict=True)
            if isinstance(c, MasslessLink)
        ]
        self.link_row = np.array([row for row, _ in links], dtype=int)
        self.link_i = np.array([self.columns(c.body_i) for _, c in links], dtype=int).reshape(-1, 3).T
        self.link_j = np.array([self.columns(c.body_j) for _, c in links], dtype=int).reshape(-1, 3).T
        self.link_point_i = np.array([c.point_i for _, c in links], dtype=float).reshape(-1, 2).T
        self.link_point_j = np.array([c.point_j for _, c in links], dtype=float).reshape(-1, 2).T

    def columns(self, body: int) -> range:
        """Return the columns of (x, y, phi) of a body; GROUND has the last three."""
        start = 3 * body if body >= 0 else self.E.shape[1] - 3
        return range(start, start + 3)

    def _fill(self, row: int, constraint: Constraint) -> None:
        """Write the constant entries of one constraint into E, C and d."""
        if isinstance(constraint, RevoluteJoint):
            for body, sign in ((constraint.body_i, -1.0), (constraint.body_j, 1.0)):
                x, y, _ = self.columns(body)
                self.E[row, x] = self.E[row + 1, y] = sign
            return
        if isinstance(constraint, MasslessLink):
            self.d[row] = -(constraint.length_m**2) / 2
            return
        x, y, phi = self.columns(constraint.body)
        if isinstance(constraint, StraightGuide):
            normal = np.array([-np.sin(constraint.angle_rad), np.cos(constraint.angle_rad)])
            self.E[row, [x, y]] = normal
            self.d[row] = -normal @ np.array(constraint.point)
            row += 1
        else:
            self.C[row] = constraint.speed_rad_s
        self.E[row, phi] = 1
        self.d[row] = -self._q_start[phi]
