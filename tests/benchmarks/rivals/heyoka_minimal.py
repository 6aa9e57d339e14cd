"""heyoka on its own: minimal coordinates, Taylor's method, contacts by terminal events."""

import math
import time
from functools import cache
from typing import Any

import heyoka as hy
import numpy as np

from tests.benchmarks.rivals import problem
from tests.benchmarks.rivals.problem import CLEARANCE_M, CRANK_M, ROD_M, STIFFNESS, Answer, FloatArray

DAMPING = 0.75 * (1 - problem.RESTITUTION**2)
#: A contact is begun by its first terms after this part of its duration: delta^1.5 has no Taylor series at 0.
BEGUN = 1e-3


@cache
def _free(tolerance: float) -> Any:
    angle, speed = hy.make_vars("angle", "speed")
    rates = [(angle, speed), (speed, problem.ideal_acceleration(hy)(angle, speed))]
    return hy.taylor_adaptive(rates, [0.0, problem.FREE_SPEED], tol=tolerance)


def ideal_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position."""
    ta, times = _free(tolerance), np.linspace(0.0, problem.FREE_END_S, samples + 1)
    ta.time, ta.state[:] = 0.0, [0.0, problem.FREE_SPEED]
    began = time.perf_counter()
    (_, _, _, steps, _, states) = ta.propagate_grid(times)
    return Answer(time.perf_counter() - began, steps, problem.slider_at(states[:, 0]))


@cache
def _loose(tolerance: float) -> tuple[Any, Any]:
    """Return who integrates flight and contact; the latter by the speed at touch and where it ends."""
    names = ("angle", "rod_angle", "slider", "speed", "rod_speed", "slider_speed")
    y = hy.make_vars(*names)
    gap, rate, x, z = _gap(y, hy)
    force = STIFFNESS * gap**1.5 * (1.0 + DAMPING * rate / hy.par[0])
    accelerations: Any = problem.open_accelerations(hy)
    flight = [*y[3:], *accelerations(*y[:2], *y[3:5], 0.0 * y[0], 0.0 * y[0])]
    contact = [*y[3:], *accelerations(*y[:2], *y[3:5], force * x, force * z)]
    towards, away = hy.event_direction.positive, hy.event_direction.negative
    ends = hy.t_event(gap, direction=towards), hy.t_event(gap - hy.par[1], direction=away)
    both = zip((flight, contact), ends, strict=True)
    one, other = (
        hy.taylor_adaptive(list(zip(y, rates, strict=True)), [0.0] * 6, tol=tolerance, t_events=[end])
        for rates, end in both
    )
    return one, other


def _gap(y: Any, m: Any) -> Any:
    """Return how far the pin is past its bearing, how fast, and the direction from the rod to the slider."""
    s, c, rod_s, rod_c = m.sin(y[0]), m.cos(y[0]), m.sin(y[1]), m.cos(y[1])
    x, z = y[2] - CRANK_M * c - ROD_M * rod_c, -CRANK_M * s - ROD_M * rod_s
    rate_x = y[5] + CRANK_M * s * y[3] + ROD_M * rod_s * y[4]
    rate_z = -CRANK_M * c * y[3] - ROD_M * rod_c * y[4]
    distance = m.sqrt(x * x + z * z)
    return distance - CLEARANCE_M, (x * rate_x + z * rate_z) / distance, x / distance, z / distance


def _pulled(y: FloatArray, impulse: float) -> FloatArray:
    """Return what an impulse between rod and slider changes the speeds by."""
    _, _, x, z = _gap(y, math)
    of, at = problem.open_accelerations(math), (y[0], y[1], y[3], y[4])
    changes = np.subtract(of(*at, impulse * x, impulse * z), of(*at, 0.0, 0.0))  # type: ignore[call-overload]
    return np.asarray(changes)


def _mass(y: FloatArray) -> float:
    """Return the mass with which rod and slider meet."""
    _, _, x, z = _gap(y, math)
    of_crank, of_rod, of_slider = _pulled(y, 1.0)
    across = of_crank * CRANK_M * (z * math.cos(y[0]) - x * math.sin(y[0]))
    across += of_rod * ROD_M * (z * math.cos(y[1]) - x * math.sin(y[1]))
    return float(1.0 / (across - x * of_slider))


def _across_the_edge(y: FloatArray, lasting: float, speed: float, damped: float, share: float) -> None:
    """Add in place what the contact's force does while it is small, after touch or up to release."""
    slope = STIFFNESS * speed**1.5 * damped
    y[:3] += _pulled(y, slope * lasting**3.5 / share)
    y[3:] += _pulled(y, slope * lasting**2.5 / 2.5)


def clearance_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position."""
    flight, contact = _loose(tolerance)
    due, values, steps = list(np.linspace(0.0, problem.CLEARANCE_END_S, samples + 1)), list[float](), 0
    turn = -problem.FREE_SPEED * CRANK_M / ROD_M
    flight.time, flight.state[:] = 0.0, [0.0, 0.0, CRANK_M + ROD_M, problem.FREE_SPEED, turn, 0.0]
    flight.reset_cooldowns()
    now, began = flight, time.perf_counter()
    while due:
        while due and due[0] <= now.time:
            values.append(now.state[2] - now.state[5] * (now.time - due.pop(0)))
        if not due:
            break
        outcome, _, _, taken, *_ = now.propagate_until(due[0])
        steps += taken
        if outcome == hy.taylor_outcome.time_limit:
            continue
        _, rate, _, _ = _gap(now.state, math)
        if now is flight:
            depth = (1.25 * _mass(now.state) * rate * rate / STIFFNESS) ** 0.4
            lasting = BEGUN * 2.94 * depth / rate
            now.propagate_for(lasting)
            contact.state[:], contact.time = now.state, now.time
            _across_the_edge(contact.state, lasting, rate, 1.0 + DAMPING, 8.75)
            contact.pars[:] = [rate, BEGUN * depth]
            contact.reset_cooldowns()
            now = contact
        else:
            lasting, touched_at = now.pars[1] / -rate, now.pars[0]
            _across_the_edge(now.state, lasting, -rate, 1.0 + DAMPING * rate / touched_at, 3.5)
            flight.state[:], flight.time = now.state, now.time
            flight.reset_cooldowns()
            flight.propagate_for(lasting)
            now = flight
    return Answer(time.perf_counter() - began, steps, np.array(values))
