"""What there is to know of a mechanism before it is run: rows and freedoms, start, singular positions."""

from dataclasses import replace

import numpy as np

from engine_models.engine import ImpossibleStart, RunSettings
from engine_models.mechanics.start_check import checked_start
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.scene import Scene
from reference_solver.mechanism.assembly import Joints, Rank, dependence

#: Samples of the run at which the rows are looked at, and its tolerance.
SAMPLES, TOLERANCE = 200, 1e-8
#: Below this the smallest singular value says that a position is singular, or nearly so.
SINGULAR = 1e-4


def inspect(scene: Scene) -> list[str]:
    """Return lines on a scene's mechanism, its start, and how near its run comes to a singular position.

    Raises:
        ImpossibleStart: there is no such start, or rows of its joints depend on each other.
        SimulationFailed: the run failed.
    """
    position, _ = checked_start(scene)
    of, q = scene.mechanism, position.ravel()
    rank, own = Joints(of).rank(q), Joints(replace(of, pins=of.ideal)).rank(q)
    if own.rank < own.rows:
        raise ImpossibleStart(f"start: {dependence(own)}")
    return [_size(scene, rank), *_start(scene), *_singular(scene)]


def _size(scene: Scene, rank: Rank) -> str:
    of = scene.mechanism
    counts = {
        "body": len(of.bodies),
        "joint": len(of.pins),
        "guide": len(of.guides),
        "spring": len(of.springs),
    }
    parts = ", ".join(_counted(count, name) for name, count in counts.items() if count)
    loose = f" (with {', '.join(scene.joints_with_clearance)} taken as ideal)" if of.loose else ""
    rows = f"{rank.rows} rows of rank {rank.rank}{loose}"
    return f"{scene.name}: {parts}; {rows}, {_counted(rank.freedoms, 'degree')} of freedom"


def _counted(count: int, noun: str) -> str:
    plural = {"body": "bodies"}.get(noun, f"{noun}s")
    return f"{count} {noun if count == 1 else plural}"


def _start(scene: Scene) -> list[str]:
    """Return how the start was put together, of a plain crank-slider nothing: closed formulas give it."""
    if scene.start.states:
        return ["start: as the file gives it, the state of every body"]
    if scene.placed.moved is None:
        return ["start: by the closed formulas of a crank-slider or a pendulum"]
    return [f"start: put together, {scene.placed.moved} from what the file tells"]


def _singular(scene: Scene) -> list[str]:
    """Return the smallest singular value of the rows over a run, when, and of which joint."""
    engine = ReferenceEngine(method="dop853", step_tolerance=TOLERANCE)
    run = engine.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
    of = scene.mechanism
    joints = Joints(replace(of, pins=of.ideal), driven=of.drive.prescribes)
    ranks = [joints.rank(position.ravel()) for position in run.position]
    if not ranks[0].rows:
        return ["no rows: nothing can become singular"]
    least = int(np.argmin([rank.singular_values[-1] for rank in ranks]))
    value, when = ranks[least].singular_values[-1], run.time_s[least]
    near = ": a singular position, or nearly so" if value < SINGULAR else ""
    return [
        f"smallest singular value over {SAMPLES} samples of the run: {value:.3g} at t = {when:.6g} s "
        f"(row of {ranks[least].nearest}){near}"
    ]
