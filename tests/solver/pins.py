"""A body with a pin in a fixed bearing, and runs of any mechanism from plain numbers."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import lambertw

from reference_solver.mechanism.contacts import ClearanceJoint, ContactLaw, RigidWall
from reference_solver.mechanism.data import GROUND, Body, FrictionLaw, Point
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.run import Solution
from reference_solver.solver import ErrorControl, Solver, StepChoice, check_start
from reference_solver.tape import FloatArray

GRAVITY, MASS, INERTIA, CLEARANCE, RADIUS = 9.81, 0.1, 1e-4, 5e-4, 0.01


def bearing(
    law: ContactLaw | RigidWall,
    friction: FrictionLaw | None = None,
    *,
    clearance: float = CLEARANCE,
    radius: float = RADIUS,
    centre: Point = (0.0, 0.0),
    point: Point = (0.0, 0.0),
) -> ClearanceJoint:
    """Return the joint of a pin of body 0, at its centre of mass, in a bearing about the origin."""
    return ClearanceJoint(GROUND, centre, 0, point, clearance, radius, law, friction)


def disc(*joints: ClearanceJoint, gravity: float = 0.0, inertia: float = INERTIA) -> Mechanism:
    """Return a body that is free but for its pins."""
    return Mechanism((Body(MASS, inertia),), (), (), gravity, joints)


def run(
    mechanism: Mechanism,
    q: ArrayLike,
    v: ArrayLike,
    end_s: float,
    step: int | StepChoice | ErrorControl,
    samples: int = 10,
) -> Solution:
    """Return a run; an integer is a number of steps."""
    choice = StepChoice(end_s / step) if isinstance(step, int) else step
    start = np.array(q, dtype=float), np.array(v, dtype=float)
    check_start(mechanism, *start)
    return Solver(mechanism, start[0], choice).run(*start, end_s, samples)


def lambert(a: float) -> float:
    """Return the restitution that F = K delta^n (1 + a delta'/v0) really gives at any K, m, v0, n."""
    return float((1 + np.real(lambertw(-(1 + a) * np.exp(-(1 + a))))) / a)


def joint_force_N(run: Solution) -> FloatArray:
    """Return the bearing's force on the pin, (s, K, 2): -normal n + friction t with n along d."""
    d = run.gap_m
    n = d / np.where(run.closed, np.hypot(d[..., 0], d[..., 1]), 1.0)[..., None]
    t = np.stack([-n[..., 1], n[..., 0]], axis=-1)
    return np.asarray(run.friction_force_N[..., None] * t - run.normal_force_N[..., None] * n)
