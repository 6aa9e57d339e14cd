"""A mechanism's own length and rate, by which errors in positions, angles and velocities are weighed."""

from dataclasses import dataclass

import numpy as np

from reference_solver.mechanism.constraints import Driver, PrescribedMotion
from reference_solver.mechanism.data import GROUND, Ends
from reference_solver.mechanism.loads import ByAngle, ByTime, Constant, Force, Torque
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.motions import ROW, fastest
from reference_solver.tape import FloatArray


@dataclass(frozen=True)
class Scales:
    """A length in m and a rate in 1/s. Units of length, time or mass change them and nothing else."""

    length_m: float
    rate_s: float


def scales_of(
    mechanism: Mechanism, q: FloatArray, v: FloatArray, acceleration: FloatArray, end_time_s: float
) -> Scales:
    """Return the scales at a start with q, v and {q''}, each (n,).

    The length is that of the longest lever from a body to a joint, of the largest bearing without one, or
    what else has a length. The rate is the largest by which bodies turn, move, gather speed, are driven later
    or swing under gravity or a load's largest force, which are all that there is at an equilibrium, or one
    over the end time.
    """
    bearing = max((joint.bearing_radius_m for joint in mechanism.contacts), default=0.0)
    length = _longest_arm(mechanism) or bearing or float(np.abs(q.reshape(-1, 3)[:, :2]).max()) or 1.0
    swing = np.sqrt(np.hypot(mechanism.gravity_m_s2, mechanism.gravity_x_m_s2) / length)
    swing = max([swing, *(_push(load, mechanism, length, end_time_s) for load in mechanism.forces)])
    drivers = (c for c in mechanism.constraints if isinstance(c, Driver))
    lengths = ((c, 1.0 if isinstance(c, PrescribedMotion) else length) for c in drivers)
    driven = max((fastest(c.motion) / size for c, size in lengths), default=0.0)
    rate = max(rate_of(v, length), np.sqrt(rate_of(acceleration, length)), swing, driven)
    if not (np.isfinite(rate) and rate > 0):
        rate = 1.0 / end_time_s if end_time_s > 0 else 1.0
    return Scales(length, float(rate))


def _longest_arm(mechanism: Mechanism) -> float:
    parts = (*mechanism.constraints, *mechanism.loads, *mechanism.contacts)
    ends = ((p, s) for p in parts if isinstance(p, Ends) for s in "ij" if getattr(p, f"body_{s}") != GROUND)
    return max((float(np.hypot(*getattr(part, f"point_{s}"))) for part, s in ends), default=0.0)


def _push(load: Force | Torque, mechanism: Mechanism, length: float, end_time_s: float) -> float:
    """Return the rate in 1/s at which a load's largest force, or torque by the time, moves a body alone."""
    match load.law:
        case Constant(size) if isinstance(load, Force):
            largest = abs(size)
        case ByTime(table):  # where pieces begin, and at the end, which may be within one
            largest = max(np.abs(table.rows[1::ROW]).max(), abs(table.at(end_time_s)[0]))
        case ByAngle(table):
            largest = np.abs(table.rows[1::ROW]).max()
        case _:
            return 0.0
    if isinstance(load, Torque):
        return float(np.sqrt(largest / mechanism.bodies[load.body].inertia_kg_m2))
    masses = [mechanism.bodies[k].mass_kg for k in (load.body_i, load.body_j) if k != GROUND]
    return float(np.sqrt(largest / min(masses, default=np.inf) / length))


def rate_of(change: FloatArray, length_m: float) -> FloatArray:
    """Return the largest of angles' changes, and of positions' in lengths, of changes (..., n) (...,)."""
    x, y, angle = np.moveaxis(np.abs(change.reshape(*change.shape[:-1], -1, 3)).max(axis=-2), -1, 0)
    return np.asarray(np.maximum(np.hypot(x, y) / length_m, angle))
