"""What an RK4 step costs beside hand-written C, as a ratio: ``python -m tests.benchmarks.kernel``.

All contenders take turns in one process, in a new order every round. A ratio is the median over rounds of the
quotient within a round, in which slow spells of the machine cancel; its spread is the middle half.
"""

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reference_solver.equations import PIVOT_TOLERANCE_PER_ROW
from reference_solver.mechanism.mechanism import Mechanism, PrescribedSpeed, RevoluteJoint
from reference_solver.solver import Solver, Stabilisation, StepChoice
from tests.helpers.kernels import scene_case

FloatArray = NDArray[np.float64]
#: Takes so many steps from q and v in place, and returns the driver's work.
Advance = Callable[[FloatArray, FloatArray, int], float]

#: Rows of the constraints.
ROWS = 9
FLAGS = ["-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC"]
#: A round has so many steps: long against the clock's resolution and a call from Python.
ROUNDS, STEPS, STEP_S = 25, 20_000, 1e-6
#: Steps for which C must follow the kernel, and how far rounding may part them, relative.
CHECKED_STEPS, ROUND_OFF = 1000, 1e-12
C, KERNEL = "C by hand, gcc -O3", "generated kernel"


def compiler() -> str | None:
    """Return the C compiler, if there is one."""
    return shutil.which("gcc") or shutil.which("cc")


def c_loop(mechanism: Mechanism, folder: Path) -> Advance:
    """Return RK4 on the ideal driven crank-slider without stabilisation, compiled into a folder."""
    library, gcc = folder / "crank_slider.so", compiler()
    assert gcc is not None, "no C compiler"
    source = str(Path(__file__).with_name("crank_slider.c"))
    subprocess.run([gcc, *FLAGS, source, "-o", str(library), "-lm"], check=True)
    loop = ctypes.CDLL(str(library)).advance
    loop.restype = ctypes.c_long
    O, A, B, *_, drive = mechanism.constraints  # noqa: E741  the joint's name in the field
    assert isinstance(O, RevoluteJoint)
    assert isinstance(A, RevoluteJoint)
    assert isinstance(B, RevoluteJoint)
    assert isinstance(drive, PrescribedSpeed)
    masses = [body.mass_kg for body in mechanism.bodies]
    lengths = [O.point_j[0], A.point_i[0], A.point_j[0], B.point_i[0]]
    others = [mechanism.bodies[1].inertia_kg_m2, mechanism.gravity_m_s2, drive.speed_rad_s]
    parameters = np.array([*lengths, *masses, *others, ROWS * PIVOT_TOLERANCE_PER_ROW])

    def advance(q: FloatArray, v: FloatArray, count: int) -> float:
        work = ctypes.c_double()
        state = [ctypes.c_void_p(array.ctypes.data) for array in (parameters, q, v)]
        done = loop(*state, ctypes.c_double(STEP_S), ctypes.c_long(count), ctypes.byref(work))
        assert done == count, f"the C loop stopped after {done} of {count} steps"
        return work.value

    return advance


def kernel(mechanism: Mechanism, q: FloatArray, stabilisation: Stabilisation = "none") -> Advance:
    """Return the reference solver with equal steps."""
    solver = Solver(mechanism, q, StepChoice(STEP_S), stabilisation)

    def advance(q: FloatArray, v: FloatArray, count: int) -> float:
        run = solver.run(q, v, count * STEP_S, 1)
        q[:], v[:] = run.q[-1], run.v[-1]
        return float(run.sums["drivers"][-1])

    return advance


def contenders(folder: Path) -> tuple[dict[str, Advance], FloatArray, FloatArray]:
    """Return who steps the ideal driven crank-slider, by name, and where it starts."""
    mechanism, q, v, _ = scene_case("ideal-driven")
    steppers = {C: c_loop(mechanism, folder), KERNEL: kernel(mechanism, q)}
    return {**steppers, f"{KERNEL}, projected": kernel(mechanism, q, "projection")}, q, v


def part(one: Advance, other: Advance, q: FloatArray, v: FloatArray) -> float:
    """Return how far two are apart in state and work after some steps, in parts of the largest."""
    ends = []
    for advance in (one, other):
        end_q, end_v = q.copy(), v.copy()
        work = advance(end_q, end_v, CHECKED_STEPS)
        ends.append((end_q, end_v, np.array([work])))
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in zip(*ends, strict=True))


def main() -> None:
    """Measure and print the time of a step and its ratio to that of C."""
    with tempfile.TemporaryDirectory() as folder:
        steppers, q, v = contenders(Path(folder))
        assert part(steppers[C], steppers[KERNEL], q, v) < ROUND_OFF, "they do not do the same"
        times: dict[str, list[float]] = {name: [] for name in steppers}
        random = np.random.default_rng(0)
        for _ in range(ROUNDS):
            for name in random.permutation([*steppers]).tolist():
                end_q, end_v, began = q.copy(), v.copy(), time.perf_counter()
                steppers[name](end_q, end_v, STEPS)
                times[name].append(1e9 * (time.perf_counter() - began) / STEPS)
    print(f"One RK4 step of the ideal driven crank-slider; median (middle half) of {ROUNDS} rounds\n")
    for name, step_ns in times.items():
        low, middle, high = np.percentile(np.divide(step_ns, times[C]), [25, 50, 75])
        print(
            f"{name:30}{np.median(step_ns):6.0f} ns, {middle:.2f} ({low:.2f} to {high:.2f}) times that of C"
        )


if __name__ == "__main__":
    main()
