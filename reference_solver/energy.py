"""The energy ledger of a run, from its samples alone."""

import numpy as np

from reference_solver.mechanism.contacts import stored_J
from reference_solver.mechanism.loads import distance_m, potential_J
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.solution import Solution
from reference_solver.tape import FloatArray


def kinetic_J(mechanism: Mechanism, v: FloatArray) -> FloatArray:
    """Return the kinetic energy (s,) at velocities (s, n)."""
    return np.asarray(v**2 @ mechanism.masses / 2)


def potentials_J(run: Solution) -> FloatArray:
    """Return the potential energies at a run's samples, of gravity, loads and contacts, each a row (s,)."""
    mechanism, q = run.mechanism, run.q
    heights = q[:, 1::3] @ np.array([body.mass_kg for body in mechanism.bodies])
    rows = [mechanism.gravity_m_s2 * heights]
    if mechanism.gravity_x_m_s2:
        ways = q[:, 0::3] @ np.array([body.mass_kg for body in mechanism.bodies])
        rows.append(-mechanism.gravity_x_m_s2 * ways)
    rows += [row for load in mechanism.loads if (row := potential_J(load, q)) is not None]
    for k, joint in enumerate(mechanism.contacts):
        if not joint.rigid:
            law, depth = joint.law, distance_m(joint, q) - joint.radial_clearance_m
            rows.append(run.closed[:, k] * stored_J(law.stiffness, law.exponent, depth))
    return np.array(rows)


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
