"""What an RK4 step costs: ``python -m tests.benchmarks.kernel``. The ratios are what counts.

All contenders take turns in one process, in a new order every round. A ratio is the median over rounds of the
quotient within a round, in which slow spells of the machine cancel; its spread is the middle half.
"""

import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reference_solver.solver import Stepper, make_stepper
from tests.benchmarks.c_loop import CLoop, compiler
from tests.test_reference_chains import chain, chain_start
from tests.test_reference_kernel import scene_case

FloatArray = NDArray[np.float64]
Contender = tuple[Stepper | CLoop, FloatArray, FloatArray]

#: Rounds, and how long a turn lasts: long against the clock's resolution and a call from Python.
ROUNDS, TURN_S = 25, 0.02
STEP_S = 1e-6
LINKS = (2, 4, 8)
#: Steps for which the C loop must follow the kernel, and how far rounding may part them, relative.
CHECKED_STEPS, ROUND_OFF = 1000, 1e-12
C, KERNEL = "C by hand, gcc -O3", "generated kernel"
TARGET = 1.5


def crank_slider(folder: Path) -> dict[str, Contender]:
    """Return who steps the ideal driven crank-slider, by name."""
    mechanism, q, v, _ = scene_case("ideal-driven")
    steppers: dict[str, Stepper | CLoop] = {}
    if compiler():
        steppers[C] = CLoop(mechanism, STEP_S, folder)
    else:
        print(f"no gcc or cc here: {C} is left out, and ratios are to the {KERNEL}\n")
    steppers |= {
        KERNEL: make_stepper(mechanism, q, STEP_S, "none", compiled=True),
        f"{KERNEL}, projected": make_stepper(mechanism, q, STEP_S, "projection", compiled=True),
        "readable NumPy": make_stepper(mechanism, q, STEP_S, "none", compiled=False),
    }
    if C in steppers:
        check(steppers[C], steppers[KERNEL], q, v)
    return {name: (stepper, q, v) for name, stepper in steppers.items()}


def check(one: Stepper | CLoop, other: Stepper | CLoop, q: FloatArray, v: FloatArray) -> None:
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


def chains() -> dict[str, Contender]:
    """Return the generated kernel on chains that fall from the horizontal, by name."""
    contenders: dict[str, Contender] = {}
    for links in LINKS:
        q, v = chain_start(np.zeros(links), np.zeros(links))
        contenders[f"{links} links"] = make_stepper(chain(links), q, STEP_S, "none", compiled=True), q, v
    return contenders


def seconds(contender: Contender, steps: int) -> float:
    """Return how long a number of steps from the start took."""
    stepper, q, v = contender
    q, v = q.copy(), v.copy()
    start = time.perf_counter()
    stepper.advance(q, v, 0, steps)
    return time.perf_counter() - start


def measure(contenders: dict[str, Contender]) -> dict[str, FloatArray]:
    """Return each contender's ns per step, round by round."""
    steps = {}
    for name, contender in contenders.items():
        count = 1
        while (took := seconds(contender, count)) < TURN_S / 10:
            count *= 2
        steps[name] = max(1, round(count * TURN_S / took))
    found: dict[str, list[float]] = {name: [] for name in contenders}
    order, random = list(contenders), np.random.default_rng(0)
    for _ in range(ROUNDS):
        random.shuffle(order)
        for name in order:
            found[name].append(1e9 * seconds(contenders[name], steps[name]) / steps[name])
    return {name: np.array(times) for name, times in found.items()}


def spread(values: FloatArray, form: str) -> str:
    """Return the median and the middle half."""
    low, middle, high = np.percentile(values, [25, 50, 75])
    return f"{middle:{form}}  ({low:{form}} to {high:{form}})"


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        times = measure(crank_slider(Path(folder)) | chains())
    base = C if C in times else KERNEL
    print(f"One RK4 step of the ideal driven crank-slider; median (middle half) of {ROUNDS} rounds\n")
    print(f"{'':30}{'ns per step':34}ratio to {base}")
    for name in (name for name in times if "links" not in name):
        print(f"{name:30}{spread(times[name], ',.0f'):34}{spread(times[name] / times[base], '.2f')}")
    print("\nThe generated kernel on a chain\n")
    print(f"{'':30}{'ns per step':34}ns per step and link")
    for links in LINKS:
        found = times[f"{links} links"]
        print(f"{f'{links} links':30}{spread(found, ',.0f'):34}{spread(found / links, '.0f')}")
    if C in times:
        ratio = float(np.median(times[KERNEL] / times[C]))
        print(f"\nThe {KERNEL} takes {ratio:.2f} of the time of C; the target is at most {TARGET}.")


if __name__ == "__main__":
    main()
