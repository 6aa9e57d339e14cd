"""SciPy on its own: the crank's angle alone by ``ode``'s DOP853, whose loop over steps is compiled."""

import time

import numpy as np
from scipy.integrate import ode

from tests.benchmarks.rivals import problem
from tests.benchmarks.rivals.problem import Answer
from tests.benchmarks.rivals.scipy_minimal import free_rates

#: Evaluations in a step.
STAGES = 12


def ideal_free(tolerance: float, samples: int) -> Answer:
    """Return the slider's position, from sample to sample."""
    times, angles, calls = np.linspace(0.0, problem.FREE_END_S, samples + 1), [0.0], 0

    def rates(t: float, y: problem.FloatArray) -> tuple[float, float]:
        nonlocal calls
        calls += 1
        found: tuple[float, float] = free_rates(y, t)
        return found

    def bare(t: float, y: problem.FloatArray) -> tuple[float, float]:
        return free_rates(y, t)  # type: ignore[no-any-return]

    solver = ode(bare if samples == 1 else rates)
    solver.set_integrator("dop853", rtol=tolerance, atol=tolerance, nsteps=10**6)
    solver.set_initial_value([0.0, problem.FREE_SPEED], 0.0)
    began = time.perf_counter()
    for t in times[1:]:
        angles.append(float(solver.integrate(t)[0]))
    seconds = time.perf_counter() - began
    return Answer(seconds, calls // STAGES, problem.slider_at(np.array(angles)))
