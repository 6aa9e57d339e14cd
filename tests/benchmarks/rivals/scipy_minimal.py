"""SciPy on its own: minimal coordinates, ``odeint`` and ``solve_ivp``, right-hand sides by Numba."""

import math
import time
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import odeint, solve_ivp

from tests.benchmarks.rivals import problem
from tests.benchmarks.rivals.problem import CLEARANCE_M, CRANK_M, ROD_M, STIFFNESS, Answer, FloatArray

_ideal: Any = njit(problem.ideal_acceleration(math))
_open: Any = njit(problem.open_accelerations(math))
#: Longer steps would pass over a touch and the release after it.
LONGEST_S = 2e-4
#: Damping of Lankarani and Nikravesh's law, over the speed at touch.
DAMPING = 0.75 * (1 - problem.RESTITUTION**2)


def _free(y: FloatArray, _: float) -> tuple[float, float]:
    return y[1], _ideal(y[0], y[1])


def _gap(y: FloatArray) -> tuple[float, float, float, float]:
    """Return how far the pin is past its bearing, how fast, and the direction from the rod to the slider."""
    x = y[2] - CRANK_M * math.cos(y[0]) - ROD_M * math.cos(y[1])
    z = -CRANK_M * math.sin(y[0]) - ROD_M * math.sin(y[1])
    rate_x = y[5] + CRANK_M * math.sin(y[0]) * y[3] + ROD_M * math.sin(y[1]) * y[4]
    rate_z = -CRANK_M * math.cos(y[0]) * y[3] - ROD_M * math.cos(y[1]) * y[4]
    distance = math.sqrt(x * x + z * z) + 1e-300
    return distance - CLEARANCE_M, (x * rate_x + z * rate_z) / distance, x / distance, z / distance


gap_of: Any = njit(_gap)


def _loose(_: float, y: FloatArray, touched_at: float) -> FloatArray:
    """Return the rates of both angles and the slider; ``touched_at`` is the speed at touch, 0 in flight."""
    depth, rate, x, z = gap_of(y)
    force = 0.0
    if touched_at > 0.0 and depth > 0.0:
        force = STIFFNESS * depth**1.5 * (1.0 + DAMPING * rate / touched_at)
    rates = np.empty(6)
    rates[:3] = y[3:]
    rates[3], rates[4], rates[5] = _open(y[0], y[1], y[3], y[4], force * x, force * z)
    return rates


free_rates: Any = njit(_free)
loose_rates: Any = njit(_loose)


def ideal_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position by LSODA, all of whose steps are in compiled code."""
    times = np.linspace(0.0, problem.FREE_END_S, samples + 1)
    began = time.perf_counter()
    angle, told = odeint(
        free_rates,
        [0.0, problem.FREE_SPEED],
        times,
        rtol=tolerance,
        atol=tolerance,
        mxstep=10**6,
        full_output=True,
    )
    seconds = time.perf_counter() - began
    return Answer(seconds, int(told["nst"][-1]), problem.slider_at(angle[:, 0]))


def clearance_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position by DOP853, from touch to release and to touch."""

    def wall(_: float, y: FloatArray, __: float) -> float:
        return float(gap_of(y)[0])

    wall.terminal = True  # type: ignore[attr-defined]  # how solve_ivp is told
    times, t, touched_at = np.linspace(0.0, problem.CLEARANCE_END_S, samples + 1), 0.0, 0.0
    turn = -problem.FREE_SPEED * CRANK_M / ROD_M
    y = np.array([0.0, 0.0, CRANK_M + ROD_M, problem.FREE_SPEED, turn, 0.0])
    values, steps, began = [y[2]], 0, time.perf_counter()
    while t < problem.CLEARANCE_END_S:
        wall.direction = -1.0 if touched_at else 1.0  # type: ignore[attr-defined]
        due = times[times > t]
        run = solve_ivp(
            loose_rates,
            (t, problem.CLEARANCE_END_S),
            y,
            "DOP853",
            due,
            events=wall,
            args=(touched_at,),
            rtol=tolerance,
            atol=tolerance,
            max_step=LONGEST_S,
        )
        values.extend(run.y[2] if len(run.t) else [])
        steps += run.nfev // 12
        if run.status == 0:
            break
        t, y = float(run.t_events[0][0]), run.y_events[0][0]
        touched_at = 0.0 if touched_at else float(gap_of(y)[1])
    return Answer(time.perf_counter() - began, steps, np.array(values))
