"""What an RK4 step costs: ``python -m tests.benchmarks.kernel``. The ratios are what counts.

All contenders take turns in one process, in a new order every round. A ratio is the median over rounds of the
quotient within a round, in which slow spells of the machine cancel; its spread is the middle half.
"""

import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine_models.scene.library import clearance_driven_05, ideal_driven
from reference_solver.mechanism.mechanism import Mechanism
from reference_solver.solver import ErrorControl, Solver, Stabilisation, StepChoice
from tests.benchmarks.c_loop import CLoop, compiler
from tests.benchmarks.clearance import ByC, Run, difference, run_by_kernel
from tests.helpers.kernels import scene_case

FloatArray = NDArray[np.float64]
#: Takes a turn as long as the number given, in units of its own; returns its seconds and its steps.
Contender = Callable[[int], tuple[float, int]]

#: Rounds, and how long a turn lasts: long against the clock's resolution and a call from Python.
ROUNDS, TURN_S = 25, 0.02
STEP_S = 1e-6
#: Steps for which the C loop must follow the kernel, and how far rounding may part them, relative.
CHECKED_STEPS, ROUND_OFF = 1000, 1e-12
#: The stretch of the clearance scene, eight contacts long, and its steps: the engine's own at 1e-6 s.
CLEARANCE_END_S, CHOICE = 0.003, StepChoice(STEP_S, 1000)
C, KERNEL = "C by hand, gcc -O3", "generated kernel"
#: Steps of DOP853 are few and long: twelve evaluations each.
CONTROLLED, CONTROL = "the same by DOP853, a step", ErrorControl(1e-10)
#: The most that a step may take, of C's time.
IDEAL_TARGET, CLEARANCE_TARGET = 1.1, 1.5


class Kernel:
    """The reference solver with equal steps, on an ideal mechanism."""

    def __init__(self, mechanism: Mechanism, q: FloatArray, stabilisation: Stabilisation = "none") -> None:
        self._solver = Solver(mechanism, q, StepChoice(STEP_S), stabilisation)

    def advance(self, q: FloatArray, v: FloatArray, first: float, count: int) -> float:  # noqa: ARG002
        """Take steps in place, from the start; return the driver's work."""
        run = self._solver.run(q, v, count * STEP_S, 1)
        q[:], v[:] = run.q[-1], run.v[-1]
        return float(run.sums["drivers"][-1])


Stepper = CLoop | Kernel


def crank_slider(folder: Path) -> dict[str, Contender]:
    """Return who steps the ideal driven crank-slider, by name."""
    mechanism, q, v, _ = scene_case("ideal-driven")
    steppers: dict[str, Stepper] = {}
    if compiler():
        steppers[C] = CLoop(mechanism, STEP_S, folder)
    else:
        print(f"no gcc or cc here: {C} is left out, and ratios are to the {KERNEL}\n")
    steppers |= {
        KERNEL: Kernel(mechanism, q),
        f"{KERNEL}, projected": Kernel(mechanism, q, "projection"),
    }
    if C in steppers:
        check(steppers[C], steppers[KERNEL], q, v)
    scene = ideal_driven()
    controlled = running(partial(run_by_kernel, scene, CONTROL))
    return {**{name: stepping(stepper, q, v) for name, stepper in steppers.items()}, CONTROLLED: controlled}


def check(one: Stepper, other: Stepper, q: FloatArray, v: FloatArray) -> None:
    """Stop unless two steppers give the same trajectory and the same work to round-off."""
    ends = []
    for stepper in (one, other):
        end_q, end_v = q.copy(), v.copy()
        work = stepper.advance(end_q, end_v, 0, CHECKED_STEPS)
        ends.append((end_q, end_v, np.array([work])))
    for name, a, b in zip(("q", "v", "work"), *ends, strict=True):
        difference = np.abs(a - b).max() / np.abs(b).max()
        if not difference <= ROUND_OFF:
            raise SystemExit(f"{C} and the {KERNEL} differ in {name} by {difference:.1e}: nothing was timed")


def clearance_crank_slider(folder: Path) -> dict[str, Contender]:
    """Return who runs the driven crank-slider with clearance, by name."""
    scene = clearance_driven_05().model_copy(update={"end_time_s": CLEARANCE_END_S})
    by_kernel = partial(run_by_kernel, scene, CHOICE)
    by_tolerance = partial(run_by_kernel, scene, CONTROL)
    contenders = {KERNEL: running(by_kernel), CONTROLLED: running(by_tolerance)}
    if compiler():
        by_c = ByC(scene, CHOICE, folder).run
        if apart := difference(by_c(), by_kernel()):
            raise SystemExit(f"{C} and the {KERNEL} with clearance differ in {apart}: nothing was timed")
        contenders = {C: running(by_c), **contenders}
    return contenders


def stepping(stepper: Stepper, q: FloatArray, v: FloatArray) -> Contender:
    """Return the contender whose turn is a number of steps from the start."""

    def turn(steps: int) -> tuple[float, int]:
        end_q, end_v = q.copy(), v.copy()
        start = time.perf_counter()
        stepper.advance(end_q, end_v, 0, steps)
        return time.perf_counter() - start, steps

    return turn


def running(run: Callable[[], Run]) -> Contender:
    """Return the contender whose turn is a number of runs."""

    def turn(runs: int) -> tuple[float, int]:
        done = [run() for _ in range(runs)]
        return sum(one.seconds for one in done), sum(one.steps for one in done)

    return turn


def measure(contenders: dict[str, Contender]) -> dict[str, FloatArray]:
    """Return each contender's ns per step, round by round."""
    lengths = {}
    for name, turn in contenders.items():
        length = 1
        while (took := turn(length)[0]) < TURN_S / 10:
            length *= 2
        lengths[name] = max(1, round(length * TURN_S / took))
    step_ns: dict[str, list[float]] = {name: [] for name in contenders}
    order, random = list(contenders), np.random.default_rng(0)
    for _ in range(ROUNDS):
        random.shuffle(order)
        for name in order:
            seconds, steps = contenders[name](lengths[name])
            step_ns[name].append(1e9 * seconds / steps)
    return {name: np.array(times) for name, times in step_ns.items()}


def spread(values: FloatArray, form: str) -> str:
    """Return the median and the middle half."""
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{middle:{form}}  ({low:{form}} to {high:{form}})"


def show(title: str, times: dict[str, FloatArray], target: float) -> None:
    """Print a table of a crank-slider's contenders, and how the kernel stands beside C."""
    base = C if C in times else KERNEL
    print(f"{title}; median (middle half) of {ROUNDS} rounds\n")
    print(f"{'':30}{'ns per step':34}ratio to {base}")
    for name, own_ns in times.items():
        print(f"{name:30}{spread(own_ns, ',.0f'):34}{spread(own_ns / times[base], '.2f')}")
    if C in times:
        ratio = float(np.median(times[KERNEL] / times[C]))
        print(f"\nThe {KERNEL} takes {ratio:.2f} of the time of C; the target is at most {target}.")


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        ideal, clearance = crank_slider(Path(folder)), clearance_crank_slider(Path(folder))
        show("One RK4 step of the ideal driven crank-slider", measure(ideal), IDEAL_TARGET)
        print()
        title = "One step of the driven crank-slider with clearance, projected, its events located"
        show(title, measure(clearance), CLEARANCE_TARGET)


if __name__ == "__main__":
    main()
