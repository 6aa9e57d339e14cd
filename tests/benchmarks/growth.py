"""How first runs and steps grow with the mechanism: ``python -m tests.benchmarks.growth``.

N parallelograms in a row, 2N + 1 bodies (see ``helpers.singular.parallelograms``), projected. A first run has
its kernel and its loop compiled, in CPU time; steps are those of the fastest of some runs.
"""

import time

import numpy as np

from reference_solver.compiled.store import compiled_anew
from reference_solver.solver import ErrorControl, Solver, StepChoice
from tests.helpers.singular import Passing, parallelograms

LOOPS, RUNS, END_S = (1, 4, 8, 12, 20, 40), 5, 20.0
#: Steps, and the end in s of the runs that are timed: RK4's steps are as long as any others.
CHOICES: dict[str, tuple[StepChoice | ErrorControl, float]] = {
    "RK4": (StepChoice(1e-4), 0.5),
    "DOP853": (ErrorControl(1e-8), END_S),
}


def measure(passing: Passing, choice: StepChoice | ErrorControl, end_time_s: float) -> tuple[float, ...]:
    """Return the first run's CPU time in s, the time of a step in us, and steps and error in m of a run.

    The error is that of the first crank's end, against the motion as one pendulum.
    """
    with compiled_anew():
        begin = time.process_time()
        runner = Solver(passing.mechanism, passing.q, choice)
        run = runner.run(passing.q, passing.v, end_time_s, 10)
        first_s = time.process_time() - begin
        runs = [run, *(runner.run(passing.q, passing.v, end_time_s, 10) for _ in range(RUNS))]
    step_s = min(run.solve_time_s / run.steps for run in runs)
    error_m = np.abs(2.0 * np.sin((run.q[:, 2] - passing.angle(run.time_s)) / 2.0)).max()
    return first_s, 1e6 * step_s, run.steps, float(error_m)


def main() -> None:
    """Measure and print."""
    print("bodies  method    first run, s  a step, us  a body, us   steps   error, m")
    for loops in LOOPS:
        for name, (choice, end_time_s) in CHOICES.items():
            bodies, passing = 2 * loops + 1, parallelograms(loops, end_time_s)
            first_s, step_us, steps, error_m = measure(passing, choice, end_time_s)
            text = f"{bodies:<8}{name:8}{first_s:14.2f}{step_us:12.2f}{step_us / bodies:12.3f}"
            print(f"{text}{steps:8.0f}{error_m:11.1e}", flush=True)


if __name__ == "__main__":
    main()
