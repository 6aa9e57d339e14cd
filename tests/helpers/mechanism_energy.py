"""The energy ledger of a solution, from its mechanism and its states alone: nothing of the solver's."""

import numpy as np
from numpy.typing import NDArray

from reference_solver.mechanism.data import GROUND, Point, Spring
from reference_solver.mechanism.loads import Constant, Torque
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Solution

FloatArray = NDArray[np.float64]


def kinetic_energy_J(mechanism: Mechanism, v: FloatArray) -> FloatArray:
    """Return the kinetic energy at velocities (s, n)."""
    inertia = np.ravel([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in mechanism.bodies])
    return np.asarray(v**2 @ inertia / 2)


def potential_energy_J(mechanism: Mechanism, q: FloatArray) -> FloatArray:
    """Return the potential energy of gravity, constant torques and springs at coordinates (s, n)."""
    masses = np.array([body.mass_kg for body in mechanism.bodies])
    energy = mechanism.gravity_m_s2 * q[:, 1::3] @ masses
    for load in mechanism.loads:
        if isinstance(load, Torque) and isinstance(load.law, Constant):
            energy = energy - load.law.size * q[:, 3 * load.body + 2]
        if isinstance(load, Spring):
            ends = place(q, load.body_j, load.point_j) - place(q, load.body_i, load.point_i)
            stretch = np.hypot(*ends.T) - load.free_length_m
            energy = energy + load.stiffness_N_m * stretch**2 / 2
    return np.asarray(energy)


def place(q: FloatArray, body: int, point: Point) -> FloatArray:
    """Return where a point of a body is, (s, 2), at coordinates (s, n)."""
    if body == GROUND:
        return np.tile(point, (len(q), 1))
    x, y, angle = q[:, 3 * body : 3 * body + 3].T
    cos, sin = np.cos(angle), np.sin(angle)
    return np.column_stack([x + cos * point[0] - sin * point[1], y + sin * point[0] + cos * point[1]])


def energy_residual_J(run: Solution) -> FloatArray:
    """Return what the ledger leaves over, (s,), without dampers and compliant contacts.

    It is the energy gained, less the drivers' work, plus what the contacts have dissipated.
    """
    energy = kinetic_energy_J(run.mechanism, run.v) + potential_energy_J(run.mechanism, run.q)
    return np.asarray(energy - energy[0] - run.sums["drivers"] + run.losses_J())
