"""What becomes of a pin that has come to its rigid wall: Newton's restitution.

A flight that would be too short or too low is none: its pin would follow the wall, which is not here, nor is
friction on a wall that does not give.
"""

import numpy as np
from numpy.typing import NDArray

from engine_models.engine import AdapterCannot
from engine_models.minimal import equations as eq
from engine_models.minimal.equations import FLIGHT, HIT
from engine_models.minimal.model import Model

FloatArray = NDArray[np.float64]
#: The shortest flight in s, and the lowest in units in the last place of a coordinate.
SHORTEST_FLIGHT_S, LOWEST = 2e-9, 100.0
#: The part of the time within which a pin hits at the same instant as another.
AT_ONCE = 1e-13


def settle(model: Model, t: float, y: FloatArray, k: int) -> tuple[FloatArray, tuple[float, float, float]]:
    """Return the state after a hit of pin k, and its approach speed, impulse in N s and lost energy.

    Raises:
        AdapterCannot: this is not followed here.
    """
    wall, name = model.contacts[k], model.of.loose[k].name
    if wall[eq.MU] > 0.0:
        raise AdapterCannot(f"joint {name} touches a rigid wall that rubs at t = {t:.6g} s")
    speed = _outward_m_s(model, t, y, k)
    e = float(wall[eq.E]) if speed >= wall[eq.SLOWEST] else 0.0
    after, impulse = _hit(model, t, y, k, (1 + e) * speed)
    lost = impulse * speed * (1 - e) / 2
    leaving, pushed = -_outward_m_s(model, t, after, k), _outward_m_s2(model, t, after, k)
    height = LOWEST * np.spacing(model.lever_m)
    short = 2 * leaving < SHORTEST_FLIGHT_S * pushed or leaving * abs(leaving) < 2 * height * pushed
    if e == 0.0 or short:
        raise AdapterCannot(
            f"bounces accumulate at t = {t:.6g} s: pin {name} follows its rigid wall from there on, and the "
            f"model in minimal coordinates has none that does (clearance.{name}.law = 'rigid')"
        )
    first = 2 * model.size + eq.OF_SUMS * k
    after[first : first + 2] += impulse, lost
    return after, (speed, impulse, lost)


def _outward_m_s(model: Model, t: float, y: FloatArray, k: int) -> float:
    """Return the speed of pin k towards its wall."""
    model(t, y)
    return float(model.contacts_told[k, eq.RATE])


def _wall_row(model: Model, t: float, y: FloatArray, k: int) -> tuple[FloatArray, float]:
    """Return the row (3b,) of the distance of pin k from its bearing, and its part of B a = gamma."""
    model(t, y)
    model.phases[k, 0] = HIT
    B, _, _, gamma = model.look(t, y[: model.size], model.told[: model.size].copy())
    model.phases[k, 0] = FLIGHT
    return B[-1], float(gamma[-1])


def _outward_m_s2(model: Model, t: float, y: FloatArray, k: int) -> float:
    """Return the acceleration of the distance of pin k from its bearing."""
    row, gamma = _wall_row(model, t, y, k)
    model(t, y)
    return float(row @ model.told[model.size : 2 * model.size]) - gamma


def _hit(model: Model, t: float, y: FloatArray, k: int, change: float) -> tuple[FloatArray, float]:
    """Return the state after a hit that changes the speed of pin k to its wall so, and its impulse.

    With N the row of the distance and p the impulse, M dv = B^T l - p N^T and N dv = -change.
    """
    size = model.size
    model(t, y)
    for other in set(np.flatnonzero(model.contacts[:, eq.K] == 0.0).tolist()) - {k}:
        room, rate = model.contacts_told[other, [eq.ROOM, eq.RATE]]
        if -room < rate * AT_ONCE * t:
            raise AdapterCannot(f"two pins hit their walls at one instant, t = {t:.6g} s")
    N, _ = _wall_row(model, t, y, k)
    B, _, c, _ = model.look(t, y[:size], y[size : 2 * size])
    mass = model.masses.ravel()
    dependent, free = model.order[: len(B)].astype(int), model.order[len(B) :].astype(int)
    T = np.zeros((size, len(free)))
    T[free] = np.eye(len(free))
    T[dependent] = -np.linalg.solve(B[:, dependent], B[:, free])
    answer = np.linalg.solve(T.T @ (mass[:, None] * T), T.T @ N)
    impulse = change / float(N @ T @ answer)
    after, jump = y.copy(), -impulse * (T @ answer)
    after[size : 2 * size] = model.told[:size] + jump
    if model.of.drive.prescribes:
        multipliers = np.linalg.solve(B[:, dependent].T, (mass * jump + impulse * N)[dependent])
        after[-1] += multipliers[-1] * c[-1]
    return after, impulse
