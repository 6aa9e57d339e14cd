"""What becomes of a pin that has come to its rigid wall: Newton's restitution.

A flight that would be too short or too low is none: its pin would follow the wall, which is not here, nor is
friction on a wall that does not give.
"""

import numpy as np

from engine_models.engine import AdapterCannot, FloatArray
from engine_models.minimal import equations as eq
from engine_models.minimal.model import Model

#: The shortest flight in s, and the lowest in units in the last place of a coordinate.
SHORTEST_FLIGHT_S, LOWEST = 2e-9, 100.0
#: The push in N that a wall is tried with, beside which weights and loads are not lost.
PUSH_N = 2.0**40
#: The part of the time within which a pin hits at the same instant as another.
AT_ONCE = 1e-13


def settle(model: Model, t: float, y: FloatArray, k: int) -> tuple[FloatArray, tuple[float, float, float]]:
    """Return the state after a hit of pin k, and its approach speed, impulse in N s and lost energy.

    With N the row of the distance from the bearing, e the restitution and p the impulse,
    M dv = B^T l - p N^T and N dv = -(1 + e) N v.

    Raises:
        AdapterCannot: this is not followed here.
    """
    wall, name, size, mass = model.contacts[k], model.of.loose[k].name, model.size, model.masses.ravel()
    if wall[eq.MU] > 0.0:
        raise AdapterCannot(f"joint {name} touches a rigid wall that rubs at t = {t:.6g} s")
    model(t, y)
    speed, v = float(model.contacts_told[k, eq.RATE]), model.told[:size].copy()
    for other in np.flatnonzero(model.contacts[:, eq.K] == 0.0).tolist():
        room, rate = model.contacts_told[other, [eq.ROOM, eq.RATE]]
        if other != k and -room < rate * AT_ONCE * t:
            raise AdapterCannot(f"two pins hit their walls at one instant, t = {t:.6g} s")
    N = _normal(model, t, y[:size], v, k)
    B, _, c, _ = model.look(t, y[:size], y[size : 2 * size])
    dependent, free = model.order[: len(B)].astype(int), model.order[len(B) :].astype(int)
    T = np.zeros((size, len(free)))
    T[free] = np.eye(len(free))
    T[dependent] = -np.linalg.solve(B[:, dependent], B[:, free])
    response = np.linalg.solve(T.T @ (mass[:, None] * T), T.T @ N)
    e = float(wall[eq.E]) if speed >= wall[eq.SLOWEST] else 0.0
    impulse = float((1 + e) * speed / (N @ T @ response))
    after, jump, lost = y.copy(), -impulse * (T @ response), impulse * speed * (1 - e) / 2
    after[size : 2 * size] = v + jump
    if model.of.drive.prescribes:
        multipliers = np.linalg.solve(B[:, dependent].T, (mass * jump + impulse * N)[dependent])
        after[-1] += multipliers[-1] * c[-1]
    ahead = after + SHORTEST_FLIGHT_S * model(t, after)
    leaving = -float(model.contacts_told[k, eq.RATE])
    model(t + SHORTEST_FLIGHT_S, ahead)
    back = float(model.contacts_told[k, eq.RATE]) + leaving
    height = LOWEST * np.spacing(model.lever_m) * back / SHORTEST_FLIGHT_S
    short = 2 * leaving < back or leaving * abs(leaving) < 2 * height
    if e == 0.0 or short:
        raise AdapterCannot(
            f"bounces accumulate at t = {t:.6g} s: pin {name} follows its rigid wall from there on, and the "
            f"model in minimal coordinates has none that does (clearance.{name}.law = 'rigid')"
        )
    after[2 * size + eq.OF_SUMS * k :][:2] += impulse, lost
    return after, (speed, impulse, lost)


def _normal(model: Model, t: float, q: FloatArray, v: FloatArray, k: int) -> FloatArray:
    """Return the row (3b,) of the distance of pin k from its bearing: what a push of 1 N on its wall does."""
    before, F = model.phases.copy(), np.empty((2, model.size))
    told, powers = np.empty(len(model.told)), np.empty(len(model.sums) + 1)
    for row, phase in zip(F, (before[k], (eq.GIVEN, PUSH_N, 0.0)), strict=True):
        model.phases[k] = phase
        eq.forces(model.p, t, q, v, row, told, powers)
    model.phases[:] = before
    return np.asarray((F[0] - F[1]) / PUSH_N)
