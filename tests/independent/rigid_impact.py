"""The jump of {w'} when a pin hits its wall, from the mass matrix of ``independent_rigid_kinematics``."""

from itertools import product

import numpy as np

from tests.independent.rigid_kinematics import FloatArray, Pins

#: Of speeds, as a part of the largest in them.
ROUND_OFF = 1e-14
State = tuple[FloatArray, FloatArray]


class Paradox(Exception):
    """No forces or impulses of rigid walls with friction fit, or several do (Painleve)."""


def impact(
    pins: Pins, state: State, name: str, following: tuple[str, ...], restitution: float
) -> tuple[State, float]:
    """Return the state after a pin has hit while others follow, by Newton's and Coulomb's laws.

    Beside it, the impulse in N m s that a prescribed speed takes of its driver, 0 without one.

    Every pin that touches gets no impulse, or one that leaves it Newton's speed, and sticks or slides one
    way: the first case whose signs and limits hold is it.
    """
    w, rate = state
    motion, touching = pins.dynamics(w, rate), (name, *following)
    inverse = np.zeros_like(motion.M)
    inverse[np.ix_(pins.free, pins.free)] = np.linalg.inv(motion.M[np.ix_(pins.free, pins.free)])
    rows = [(-pins.normal(k, w), pins.sliding(k, w, motion)) for k in touching]
    friction = [law.coefficient if (law := pins.clearance(k).friction) is not None else 0.0 for k in touching]
    D = np.array([row for pair in rows for row in pair])
    W, u = D @ inverse @ D.T, D @ rate
    u[2::2] = 0.0  # they follow
    slack = 1e-12 * abs(u[0]) + ROUND_OFF * float(np.max(np.abs(D) @ np.abs(rate)))
    newton = np.zeros(len(touching))
    newton[0] = -restitution * u[0]
    choices = [("none", "stick", "up", "down") if mu else ("none", "up") for mu in friction]
    for case in product(*choices):
        A, a = np.eye(len(u)), np.zeros(len(u))
        for k, kind in enumerate(case):
            n, s = 2 * k, 2 * k + 1
            if kind != "none":
                A[n], a[n] = W[n], newton[k] - u[n]
            if kind == "stick":
                A[s], a[s] = W[s], -u[s]
            elif kind != "none":
                A[s, n] = friction[k] if kind == "up" else -friction[k]
        impulse = np.linalg.solve(A, a)
        after = u + W @ impulse
        if all(
            impulse[2 * k] >= 0
            and after[2 * k] >= newton[k] - slack
            and abs(impulse[2 * k + 1]) <= friction[k] * impulse[2 * k] + 1e-12 * np.abs(impulse).max()
            and (kind in ("none", "stick") or not friction[k] or after[2 * k + 1] * impulse[2 * k + 1] <= 0)
            for k, kind in enumerate(case)
        ):
            if impulse @ (u + after) > slack * np.abs(impulse).sum():
                raise Paradox(f"the impulses of {touching} would add energy")
            jump = inverse @ D.T @ impulse
            driver = 0.0 if pins.motion is None else float(motion.M[0] @ jump - D[:, 0] @ impulse)
            return (w, rate + jump), driver
    raise Paradox(f"no impulses of {touching} fit")
