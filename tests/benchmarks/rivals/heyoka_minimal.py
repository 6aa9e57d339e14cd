"""heyoka on its own: minimal coordinates, Taylor's method, walls by terminal events, and nothing else."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import heyoka as hy
import numpy as np

from tests.benchmarks.rivals import problem
from tests.benchmarks.rivals.problem import CLEARANCE_M, CRANK_M, ROD_M, STIFFNESS, Answer

DAMPING = 0.75 * (1 - problem.RESTITUTION**2)
#: A pin touches so far past the wall, in m, where a flight from the wall has surely begun on this side of it.
PAST_M = 1e-15
#: The end of an independent variable whose end is an event's.
NEVER = 1e300


@cache
def _free(tolerance: float) -> Any:
    angle, speed = hy.make_vars("angle", "speed")
    rates = [(angle, speed), (speed, problem.ideal_acceleration(hy)(angle, speed))]
    return hy.taylor_adaptive(rates, [0.0, problem.FREE_SPEED], tol=tolerance, fast_math=True)


def ideal_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position."""
    ta, times = _free(tolerance), np.linspace(0.0, problem.FREE_END_S, samples + 1)
    ta.time, ta.state[:] = 0.0, [0.0, problem.FREE_SPEED]
    began = time.perf_counter()
    (_, _, _, steps, _, states) = ta.propagate_grid(times)
    return Answer(time.perf_counter() - began, steps, problem.slider_at(states[:, 0]))


@dataclass(frozen=True)
class _Loose:
    """The motion with clearance at the slider, free or driven: variables, and their rates in flight.

    ``rates`` takes the components of a force on the rod. ``pin`` is the distance's square less that of the
    wall, past which it touches, the gap's rate, and the direction from the rod to the slider; ``mass`` that
    with which both meet.
    """

    names: tuple[str, ...]
    start: tuple[float, ...]
    rates: Callable[[Any, Any], list[Any]]
    pin: tuple[Any, Any, Any, Any]
    mass: Any

    @property
    def y(self) -> list[Any]:
        """The variables; the last one is the time."""
        return list(hy.make_vars(*self.names))


def _pin(angle: Any, turn: Any, rod: Any, rod_turn: Any, x: Any, rate: Any) -> tuple[Any, Any, Any, Any]:
    s, c, rod_s, rod_c = hy.sin(angle), hy.cos(angle), hy.sin(rod), hy.cos(rod)
    across, up = x - CRANK_M * c - ROD_M * rod_c, -CRANK_M * s - ROD_M * rod_s
    rate_x = rate + CRANK_M * s * turn + ROD_M * rod_s * rod_turn
    rate_y = -CRANK_M * c * turn - ROD_M * rod_c * rod_turn
    distance = hy.sqrt(across * across + up * up)
    n = across / distance, up / distance
    wall = CLEARANCE_M + PAST_M
    return across * across + up * up - wall * wall, n[0] * rate_x + n[1] * rate_y, *n


@cache
def _loose(driven: bool) -> _Loose:
    zero = hy.expression(0.0)
    names: tuple[str, ...]
    start: tuple[float, ...]
    if driven:
        rod, x, rod_turn, rate, t = hy.make_vars("rod", "x", "rod_turn", "rate", "t")
        angle, turn = problem.DRIVEN_SPEED * t, problem.DRIVEN_SPEED
        of: Any = problem.driven_accelerations(hy)
        names, speed = ("rod", "x", "rod_turn", "rate", "t"), problem.DRIVEN_SPEED
        start = (0.0, CRANK_M + ROD_M, -speed * CRANK_M / ROD_M, 0.0, 0.0)

        def rates(fx: Any, fy: Any) -> list[Any]:
            return [rod_turn, rate, *of(angle, rod, fx, fy), hy.expression(1.0)]

    else:
        angle, rod, x, turn, rod_turn, rate, t = hy.make_vars(
            "angle", "rod", "x", "turn", "rod_turn", "rate", "t"
        )
        at: Any = problem.open_accelerations(hy)
        names, speed = ("angle", "rod", "x", "turn", "rod_turn", "rate", "t"), problem.FREE_SPEED
        start = (0.0, 0.0, CRANK_M + ROD_M, speed, -speed * CRANK_M / ROD_M, 0.0, 0.0)

        def rates(fx: Any, fy: Any) -> list[Any]:
            return [turn, rod_turn, rate, *at(angle, rod, turn, rod_turn, fx, fy), hy.expression(1.0)]

    pin = _pin(angle, turn, rod, rod_turn, x, rate)
    y = dict(zip(names, hy.make_vars(*names), strict=True))
    pulled, free = rates(pin[2], pin[3]), rates(zero, zero)
    answer = [a - b for a, b in zip(pulled, free, strict=True)]
    mobility = -hy.sum([hy.diff(pin[1], y[name]) * part for name, part in zip(names, answer, strict=True)])
    return _Loose(names, start, rates, pin, 1.0 / mobility)


def _integrator(names: list[Any], rates: list[Any], tolerance: float, events: list[Any]) -> Any:
    up = hy.event_direction.positive
    terminal = [hy.t_event(event, direction=up) for event in [*events, names[-1] - hy.par[0]]]
    pairs = list(zip(names, rates, strict=True))
    start = [0.0] * len(names)
    return hy.taylor_adaptive(pairs, start, tol=tolerance, t_events=terminal, fast_math=True)


@cache
def _compliant(driven: bool, tolerance: float) -> tuple[Any, Any, Any]:
    """Return who integrates flight and contact, and what makes the one's state the other's at a touch.

    In contact the root w of the penetration is a variable, and the independent one s with dt = w ds.
    """
    one, (w, speed) = _loose(driven), hy.make_vars("w", "speed")
    y, zero = one.y, hy.expression(0.0)
    gap, rate, nx, ny = one.pin
    flight = _integrator(y, one.rates(zero, zero), tolerance, [gap])
    force = STIFFNESS * (w * w * w) * (1.0 + DAMPING * rate / speed)
    rates = [w * part for part in one.rates(force * nx, force * ny)]
    contact = _integrator([w, speed, *y], [0.5 * rate, zero, *rates], tolerance, [-w])
    return flight, contact, hy.cfunc([hy.expression(PAST_M**0.5), rate, *y], vars=y)


def _solved(driven: bool, tolerance: float, end_s: float, samples: int) -> Answer:
    """Return the slider's position, from touch to release and to touch."""
    (flight, contact, touch), one = _compliant(driven, tolerance), _loose(driven)
    values, steps, x = [CRANK_M + ROD_M], 0, one.names.index("x")
    flight.state[:] = one.start
    flying, held = flight.state, contact.state
    now, flight.pars[0], due = flight, end_s, list(np.linspace(0.0, end_s, samples + 1)[1:])
    contact.pars[0] = flight.pars[0] = due[0]
    flight.reset_cooldowns()
    began = time.perf_counter()
    while True:
        ended, _, _, taken, *_ = now.propagate_until(NEVER)
        steps += taken
        if int(ended) == -2:
            values.append((flying if now is flight else held[2:])[x])
            del due[0]
            if not due:
                return Answer(time.perf_counter() - began, steps, np.array(values))
            contact.pars[0] = flight.pars[0] = due[0]
        elif now is flight:
            held[:] = touch(flying)
            now = contact
        else:
            flying[:] = held[2:]
            now = flight
        now.time = 0.0
        now.reset_cooldowns()


def clearance_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position."""
    return _solved(False, tolerance, problem.CLEARANCE_END_S, samples)


def clearance_driven(tolerance: float, samples: int) -> Answer:
    """Return the slider's position."""
    return _solved(True, tolerance, problem.CLEARANCE_DRIVEN_END_S, samples)
