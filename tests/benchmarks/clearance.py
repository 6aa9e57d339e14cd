"""The driven crank-slider with clearance in joint B, run by the kernel and by the hand-written C loop."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.scene import Scene
from reference_solver.solver import ErrorControl, Solver, StepChoice
from tests.benchmarks.c_loop import ClearanceCLoop
from tests.helpers.crank_sliders import start

FloatArray = NDArray[np.float64]

#: How far rounding may part two runs, relative: more than a step's own, since contacts enlarge it.
ROUND_OFF = 1e-10


@dataclass(frozen=True)
class Run:
    """The state at the end of a run, the sums, the times and kinds of events, steps, and the time taken."""

    q: FloatArray
    v: FloatArray
    sums: FloatArray
    events_s: FloatArray
    what: FloatArray
    steps: int
    seconds: float


def run_by_kernel(scene: Scene, choice: StepChoice | ErrorControl) -> Run:
    """Run a scene with the generated kernel and the loop that suits, with samples at both ends alone."""
    q, v = start(scene)
    solver = Solver(mechanism_of(scene), q, choice, "projection")
    run = solver.run(q, v, scene.end_time_s, 1)
    sums, events = np.array([values[-1] for values in run.sums.values()]), run.events
    return Run(run.q[-1], run.v[-1], sums, events["time_s"], events["what"], run.steps, run.solve_time_s)


class ByC:
    """Runs a scene with the C loop."""

    def __init__(self, scene: Scene, choice: StepChoice, folder: Path) -> None:
        self._end_s, self._start = scene.end_time_s, start(scene)
        self._loop = ClearanceCLoop(mechanism_of(scene), self._start[0], choice, folder)

    def run(self) -> Run:
        """Run from the start to the end."""
        q, v = (x.copy() for x in self._start)
        begin = time.perf_counter()
        self._loop.run(q, v, self._end_s)
        seconds, events = time.perf_counter() - begin, self._loop.events.copy()
        return Run(q, v, self._loop.sums.copy(), events["time_s"], events["what"], self._loop.steps, seconds)


def difference(one: Run, other: Run) -> str | None:
    """Return what tells two runs apart but for round-off, None if nothing does.

    Their numbers of steps may differ by one at every event, where rounding decides what is past it.
    """
    if not np.array_equal(one.what, other.what):
        return f"events: {len(one.what)} and {len(other.what)}"
    if abs(one.steps - other.steps) > len(one.what):
        return f"steps: {one.steps:,} and {other.steps:,}"
    for name in ("q", "v", "sums", "events_s"):
        a, b = getattr(one, name), getattr(other, name)
        apart = np.abs(a - b).max(initial=0) / np.abs(b).max(initial=0)
        if not apart <= ROUND_OFF:
            return f"{name} by {apart:.1e}"
    return None
