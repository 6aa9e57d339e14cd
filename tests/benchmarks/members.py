"""What members of a sweep cost beside the kernel's own time, and how sweeps use two cores and two workers.

``python -m tests.benchmarks.members``, on a machine with nothing else to do.
"""

import gc
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from distributed import LocalCluster
from numpy.typing import NDArray

from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.members import BATCH, Members
from engine_models.reference.watch import Watch
from engine_models.scene.library import SCENES

FloatArray = NDArray[np.float64]

SCENE, TOLERANCE = "clearance-driven-0.5mm", 1e-6
CLEARANCE, SPEED, ANGLE = "clearance.B.radial_clearance_m", "start.crank_speed_rad_s", "start.crank_angle_rad"
#: Ends of what varies, and what varies together in one thread.
ENDS = {CLEARANCE: (1e-4, 1e-3), SPEED: (300.0, 700.0), ANGLE: (-3.0, 3.0)}
VARIED = ((ANGLE,), (CLEARANCE,), (CLEARANCE, SPEED))
#: Members in one thread, and rounds; members of a whole sweep, and rounds.
FEW, ROUNDS = 2 * BATCH, 15
MANY, SWEEPS = 10_000, 3


def one_thread(paths: Sequence[str], tolerance: float) -> FloatArray:
    """Return for each round the time of members together, over the kernel's own of the same, one by one."""
    changes = {path: np.linspace(*ENDS[path], FEW).tolist() for path in paths}
    engine = ReferenceEngine(method="dop853", step_tolerance=tolerance)
    task = Members(engine, SCENES[SCENE](), changes, Watch(), None)
    ratios = []
    for _ in range(ROUNDS + 1):
        together = own = 0.0
        for first in range(0, FEW, BATCH):
            # As in a sweep no member is built twice, and the parts of another round are not there.
            task = Members(engine, task.scene, changes, task.watch, None, groups=task.groups)
            gc.collect()
            begin = time.perf_counter()
            task.rows(range(first, first + BATCH))
            together += time.perf_counter() - begin
            for number in range(first, first + BATCH):
                scene = task.member(number)
                own += engine.simulate(scene, task.settings(scene)).solve_time_s
        ratios.append(together / own)
    return np.array(ratios[1:])  # the first one has compiled


def sweep_s(folder: Path, name: str, options: Sequence[str]) -> float:
    """Run a sweep as a user does; return the wall time in s."""
    low, high = ENDS[CLEARANCE]
    vary = f"{CLEARANCE}={low}:{high}:log:{MANY}"
    call = "from studies.command.main import main; main()"
    command = [sys.executable, "-c", call, "sweep", SCENE, "--vary", vary, "--quiet"]
    begin = time.perf_counter()
    run([*command, *options, "--out", str(folder / f"{name}.parquet")], check=True, capture_output=True)
    return time.perf_counter() - begin


def whole_sweeps(folder: Path) -> dict[str, float]:
    """Return the median wall times in s of a sweep on one and two cores, and on two workers of Dask."""
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:  # type: ignore[no-untyped-call]
        ways = {
            "1 process": ["--jobs", "1"],
            "2 processes": ["--jobs", "2"],
            "2 workers of Dask": ["--scheduler", cluster.scheduler_address],
        }
        times = [
            [sweep_s(folder, f"{way} {k}", options) for way, options in ways.items()] for k in range(SWEEPS)
        ]
    one, *others = (pd.read_parquet(folder / f"{way} 0.parquet") for way in ways)
    for other in others:
        pd.testing.assert_frame_equal(one, other, check_exact=True)
    return dict(zip(ways, np.median(times, axis=0).tolist(), strict=True))


def main() -> None:
    """Measure and print."""
    print(f"{SCENE}, two turns: the time of members over the kernel's own, one thread, {ROUNDS} rounds\n")
    for tolerance in (TOLERANCE, 1e-9):
        for paths in VARIED:
            low, middle, high = np.percentile(one_thread(paths, tolerance), [25, 50, 75])
            print(f"{tolerance:g}  {' and '.join(paths):60}{middle:.3f}  ({low:.3f} to {high:.3f})")
    print(f"\n{MANY} members of two turns at {TOLERANCE:g} in one command, rows alike; median of {SWEEPS}\n")
    with TemporaryDirectory() as folder:
        times = whole_sweeps(Path(folder))
    for way, seconds in times.items():
        print(f"{way:20}{seconds:8.1f} s  {times['1 process'] / seconds:.2f} times as fast as one process")


if __name__ == "__main__":
    main()
