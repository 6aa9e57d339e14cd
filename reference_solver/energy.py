"""The energy ledger of a run, from its samples alone."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from reference_solver.mechanism.contact_laws import stored_J
from reference_solver.mechanism.mechanism import (
    GROUND,
    AlongLine,
    ConstantForce,
    LineSpring,
    Mechanism,
    Point,
    SpringDamper,
    Torque,
)
from reference_solver.solution import Solution
from reference_solver.tape import FloatArray


def kinetic_J(mechanism: Mechanism, v: FloatArray) -> FloatArray:
    """Return the kinetic energy (s,) at velocities (s, n)."""
    masses = [m for body in mechanism.bodies for m in (body.mass_kg, body.mass_kg, body.inertia_kg_m2)]
    return np.asarray(v**2 @ np.array(masses) / 2)


def potentials_J(run: Solution) -> FloatArray:
    """Return the potential energies at a run's samples, of gravity, loads and contacts, each a row (s,)."""
    mechanism, q = run.mechanism, run.q
    heights = q[:, 1::3] @ np.array([body.mass_kg for body in mechanism.bodies])
    rows = [mechanism.gravity_m_s2 * heights]
    if mechanism.gravity_x_m_s2:
        ways = q[:, 0::3] @ np.array([body.mass_kg for body in mechanism.bodies])
        rows.append(-mechanism.gravity_x_m_s2 * ways)
    rows += [POTENTIALS[type(load)](load, q) for load in mechanism.loads if type(load) in POTENTIALS]
    for k, joint in enumerate(mechanism.contacts):
        if not joint.rigid:
            law, depth = joint.compliance, distance_m(joint, q) - joint.radial_clearance_m
            rows.append(run.closed[:, k] * stored_J(law.stiffness, law.exponent, depth))
    return np.array(rows)


def distance_m(ends: Any, q: FloatArray) -> FloatArray:
    """Return the distance (s,) of a part's ends at coordinates (s, n)."""
    d = place_m(q, ends.body_j, ends.point_j) - place_m(q, ends.body_i, ends.point_i)
    return np.asarray(np.hypot(*d.T))


def place_m(q: FloatArray, body: int, point: Point) -> FloatArray:
    """Return where a point of a body is, (s, 2), at coordinates (s, n)."""
    if body == GROUND:
        return np.tile(point, (len(q), 1))
    x, y, angle = q[:, 3 * body : 3 * body + 3].T
    cos, sin = np.cos(angle), np.sin(angle)
    return np.column_stack([x + cos * point[0] - sin * point[1], y + sin * point[0] + cos * point[1]])


def along_m(load: AlongLine, q: FloatArray) -> FloatArray:
    """Return s (s,) of a load along a line."""
    x, y = (place_m(q, load.body_j, load.point_j) - place_m(q, load.body_i, load.point_i)).T
    angle = load.angle_rad + (0.0 if load.body_i == GROUND else q[:, 3 * load.body_i + 2])
    return np.asarray(np.cos(angle) * x + np.sin(angle) * y)


#: The potential energy (s,) of loads that have one, at coordinates (s, n): the integral of ``loads.LOADS``.
POTENTIALS: Mapping[type, Callable[[Any, FloatArray], FloatArray]] = MappingProxyType(
    {
        Torque: lambda load, q: -load.torque_N_m * q[:, 3 * load.body + 2],
        ConstantForce: lambda load, q: -load.force_N * along_m(load, q),
        LineSpring: lambda load, q: load.stiffness_N_m * (along_m(load, q) - load.free_position_m) ** 2 / 2,
        SpringDamper: lambda load, q: (
            load.stiffness_N_m * (distance_m(load, q) - load.free_length_m) ** 2 / 2
        ),
    }
)


def ledger_J(run: Solution) -> FloatArray:
    """Return the ledger of a run (r, s): kinetic and potential energies gained, works taken, and losses.

    Its sum over the rows is zero, but for the run's error.
    """
    works = [value for name, value in run.sums.items() if name == "drivers" or name.startswith("load")]
    stored = [kinetic_J(run.mechanism, run.v), *potentials_J(run)]
    lines = [line - line[0] for line in stored] + [-work for work in works]
    return np.array([*lines, run.losses_J(), run.stabilisation_loss_J])


def created_J(run: Solution) -> FloatArray:
    """Return the size of the ledger's sum (s,)."""
    return np.asarray(np.abs(ledger_J(run).sum(axis=0)))


def in_play_J(run: Solution) -> float:
    """Return the largest line of a run's ledger, or its largest kinetic energy."""
    return float(max(np.abs(ledger_J(run)).max(), kinetic_J(run.mechanism, run.v).max()))
