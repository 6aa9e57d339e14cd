"""A mechanism's own scales, a run's energy ledger from its samples, and what it is held to at its end.

Nothing in a run may be wrong by more than order and step explain.
"""

from dataclasses import dataclass

import numpy as np

from reference_solver.equations import Equations
from reference_solver.failures import DriftAmplified, EnergyNotConserved
from reference_solver.mechanism import loads
from reference_solver.mechanism.constraints import Driver, PrescribedMotion
from reference_solver.mechanism.data import GROUND, Ends, Spring
from reference_solver.mechanism.loads import Force, Load, Torque, distance_m, potential_J
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.mechanism.motions import ROW, fastest
from reference_solver.methods import RK4
from reference_solver.run import Solution
from reference_solver.tape import FloatArray

#: The energy that may be in error, of that in play: for each radian turned this many times a step's error,
#: and beside it round-off; with contacts no less than a tenth. Ideal mechanisms with samples in every radian
#: stay below 2 of the first, those with so few that their quickest moments are between them below 60.
MARGIN, ROUND_OFF, WITH_CONTACTS = 500.0, 1e-8, 0.1
#: How far a violation of the constraints may move bodies near a singular position, as a part of the
#: mechanism's length and of a radian; and how many samples are looked at.
MOVED, LOOKED_AT = 0.03, 100
#: What a refusal names: a spring this short, of its free length, and a position of this condition.
NO_LENGTH, FLAT = 1e-2, 1e6


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
    parts = (*mechanism.constraints, *mechanism.loads, *mechanism.contacts)
    ends = ((p, s) for p in parts if isinstance(p, Ends) for s in "ij" if getattr(p, f"body_{s}") != GROUND)
    lever = max((float(np.hypot(*getattr(part, f"point_{s}"))) for part, s in ends), default=0.0)
    bearing = max((joint.bearing_radius_m for joint in mechanism.contacts), default=0.0)
    length = lever or bearing or float(np.abs(q.reshape(-1, 3)[:, :2]).max()) or 1.0
    swing = np.sqrt(np.hypot(mechanism.gravity_m_s2, mechanism.gravity_x_m_s2) / length)
    swing = max([swing, *(_push(load, mechanism, length, end_time_s) for load in mechanism.forces)])
    drivers = (c for c in mechanism.constraints if isinstance(c, Driver))
    lengths = ((c, 1.0 if isinstance(c, PrescribedMotion) else length) for c in drivers)
    driven = max((fastest(c.motion) / size for c, size in lengths), default=0.0)
    rate = max(rate_of(v, length), np.sqrt(rate_of(acceleration, length)), swing, driven)
    if not (np.isfinite(rate) and rate > 0):
        rate = 1.0 / end_time_s if end_time_s > 0 else 1.0
    return Scales(length, float(rate))


def _push(load: Force | Torque, mechanism: Mechanism, length: float, end_time_s: float) -> float:
    """Return the rate in 1/s at which a load's largest force, or torque by the time, moves a body alone."""
    match load.law:
        case loads.Constant(size) if isinstance(load, Force):
            largest = abs(size)
        case loads.ByTime(table):  # where pieces begin, and at the end, which may be within one
            largest = max(np.abs(table.rows[1::ROW]).max(), abs(table.at(end_time_s)[0]))
        case loads.ByAngle(table):
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


def kinetic_J(mechanism: Mechanism, v: FloatArray) -> FloatArray:
    """Return the kinetic energy (s,) at velocities (s, n)."""
    return np.asarray(v**2 @ mechanism.masses / 2)


def ledger_J(run: Solution) -> FloatArray:
    """Return the ledger of a run (r, s): kinetic and potential energies gained, works taken, and losses.

    Its sum over the rows is zero, but for the run's error. It counts from the first sample on.
    """
    works = [value for name, value in run.sums.items() if name == "drivers" or name.startswith("load")]
    mechanism, q = run.mechanism, run.q
    kinetic, masses = kinetic_J(mechanism, run.v), mechanism.masses[::3]
    falls = mechanism.gravity_m_s2 * (q[:, 1::3] @ masses), -mechanism.gravity_x_m_s2 * (q[:, ::3] @ masses)
    stored = [potential for load in mechanism.loads if (potential := potential_J(load, q)) is not None]
    for k, joint in enumerate(mechanism.contacts):
        if not joint.rigid:
            law, depth = joint.law, distance_m(joint, q) - joint.radial_clearance_m
            stored.append(run.closed[:, k] * loads.stored_J(law.stiffness, law.exponent, depth))
    lost = run.losses_J(), run.sums["removed"]
    lines = np.array([kinetic, *falls, *stored, *(-work for work in works), *lost])
    return np.asarray(lines - lines[:, :1])


def explained(run: Solution, scales: Scales, step_s: float, tolerance: float) -> tuple[float, FloatArray]:
    """Return the error to be expected of a step, but for a factor, and the angle (s,) turned up to samples.

    The error is the tolerance, or (rate h)^4 of RK4 without one. Motions and loads with knots are at least
    cut into sixteen steps from one to the next. The rate is the fastest of the start, of bodies, of springs
    and dampers.
    """
    mechanism = run.mechanism
    least = max([scales.rate_s, *(swing_s(load, mechanism) for load in mechanism.loads)])
    rates = np.maximum(rate_of(run.v, scales.length_m), least)
    turns = np.maximum(rates[1:], rates[:-1]) * np.diff(run.time_s)
    turn = max(float(rates.max() * step_s), 1 / 16 if mechanism.knots_s() else 0.0)
    return tolerance or turn**RK4.order, np.concatenate([[0.0], np.cumsum(turns)])


def check_energy(run: Solution, scales: Scales, step_s: float, tolerance: float = 0.0) -> None:
    """Hold a run to its ledger.

    Raises:
        EnergyNotConserved: it is off by more than the steps explain.
    """
    error, turned = explained(run, scales, step_s, tolerance)
    part, ledger = MARGIN * error * (1.0 + turned) + ROUND_OFF, ledger_J(run)
    if run.mechanism.contacts:
        part = np.maximum(part, WITH_CONTACTS)
    # To the round-off of the energy of mass, length and rate a mechanism is at rest.
    own_J = run.mechanism.masses[::3].sum() * (scales.length_m * scales.rate_s) ** 2
    in_play_J = max(np.abs(ledger).max(), kinetic_J(run.mechanism, run.v).max())
    created, allowed = np.abs(ledger.sum(axis=0)), part * in_play_J + ROUND_OFF * own_J
    for k in np.flatnonzero(~(created <= allowed))[:1]:
        springs = [load for load in run.mechanism.loads if isinstance(load, Spring) and load.free_length_m]
        parts = {spring.name: distance_m(spring, run.q) / spring.free_length_m for spring in springs}
        short = {name: run.time_s[part.argmin()] for name, part in parts.items() if part.min() < NO_LENGTH}
        no_length = "spring {} has next to no length near t = {:.6g} s, where its force turns about"
        causes = [no_length.format(*each) for each in short.items()]
        if run.condition > FLAT:
            causes.append(f"a step came close to a flat position (condition {run.condition:.1e})")
        sharper = "sharpen the tolerance" if tolerance else "shorten the step"
        helps = f"{', '.join(causes)}: end the run before" if causes else sharper
        advice = helps if tolerance else f"{helps}, or take a --tolerance"
        numbers = {"time_s": run.time_s[k], "created_J": created[k], "allowed_J": allowed[k]}
        raise EnergyNotConserved(**numbers, advice=advice)


def check_drift(
    run: Solution, scales: Scales, step_s: float, tolerance: float, equations: Equations, least: float
) -> None:
    """Hold a run without projection to its constraints; ``least`` is its best condition at a sample.

    At a distance d from a singular position a violation g moves bodies by g/d, and the condition goes with
    1/d^2. The steps explain no more than a length, however fast what has gone astray turns.

    Raises:
        DriftAmplified: that is more than the steps explain.
    """
    error, turned = explained(run, scales, step_s, tolerance)
    allowed = MOVED + np.minimum(error * (1.0 + turned) ** 2, 1.0)
    near = np.sqrt(run.condition / least) / scales.length_m
    for k in np.unique(np.linspace(0, len(run.q) - 1, LOOKED_AT).astype(int)):
        moved = near * np.abs(equations.system(float(run.time_s[k]), run.q[k]).g).max(initial=0.0)
        if not moved <= allowed[k]:
            raise DriftAmplified(time_s=run.time_s[k], moved=moved, condition=run.condition)


def swing_s(load: Load, mechanism: Mechanism) -> float:
    """Return the rate in 1/s at which a spring's bodies swing, or a damper slows them; 0 of other loads.

    A line's lever is no longer than that of its point.
    """
    if isinstance(load, Torque):
        turned = [body for body in (load.body, load.against) if body != GROUND]
        mobility = sum(1 / mechanism.bodies[body].inertia_kg_m2 for body in turned)
    else:
        ends = [(load.body_i, load.point_i), (load.body_j, load.point_j)]
        bodies = [(mechanism.bodies[body], point) for body, point in ends if body != GROUND]
        mobility = sum(1 / body.mass_kg + (x * x + y * y) / body.inertia_kg_m2 for body, (x, y) in bodies)
    match load:
        case Spring(stiffness_N_m=stiffness, damping_N_s_m=damping):
            return float(max(np.sqrt(stiffness * mobility), damping * mobility))
        case Torque(law=loads.Damping(damping)) | Force(law=loads.Damping(damping)):
            return float(damping * mobility)
        case Torque(law=loads.Restoring(stiffness)) | Force(law=loads.Restoring(stiffness)):
            return float(np.sqrt(stiffness * mobility))
    return 0.0
