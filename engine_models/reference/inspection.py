"""What there is to know of a mechanism before it is run: rows and freedoms, start, singular positions."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from engine_models.engine import FloatArray, ImpossibleStart, RunSettings, Trajectory
from engine_models.mechanics.start import checked_start
from engine_models.mechanics.states import point_motion
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.scene import Scene
from reference_solver.mechanism.assembly import Joints, Rank, dependence
from reference_solver.mechanism.data import GROUND

#: Samples of the run at which the rows are looked at, its tolerance, and its most steps: half a minute.
SAMPLES, TOLERANCE, MOST_STEPS = 200, 1e-8, 1e7
#: Below this the smallest singular value says that a position is singular, or nearly so.
SINGULAR = 1e-4
#: Below this part of the largest rate a point is at rest, and its motion has no direction.
AT_REST = 1e-9


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
    engine = ReferenceEngine(method="dop853", step_tolerance=TOLERANCE, max_steps=MOST_STEPS)
    run = engine.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
    start = "by the closed formulas of a crank-slider or a pendulum"
    if scene.start.states:
        start = "as the file gives it, the state of every body"
    elif scene.placed.moved is not None:
        start = f"put together, {scene.placed.moved} from what the file tells"
    lines = [_size(scene, rank), f"start: {start}", *_singular(scene, run)]
    return lines + (_turning_points(scene, run) if rank.freedoms == 1 else [])


def _size(scene: Scene, rank: Rank) -> str:
    of = scene.mechanism
    springs = of.springs + of.torsions
    counts = {"body": len(of.bodies), "joint": len(of.pins), "guide": len(of.guides), "spring": len(springs)}
    parts = ", ".join(_counted(count, name) for name, count in counts.items() if count)
    loose = f" (with {', '.join(scene.clearances)} taken as ideal)" if of.loose else ""
    rows = f"{rank.rows} rows of rank {rank.rank}{loose}"
    return f"{scene.name}: {parts}; {rows}, {_counted(rank.freedoms, 'degree')} of freedom"


def _counted(count: int, noun: str) -> str:
    plural = {"body": "bodies"}.get(noun, f"{noun}s")
    return f"{count} {noun if count == 1 else plural}"


def _singular(scene: Scene, run: Trajectory) -> list[str]:
    """Return the smallest singular value of the rows over a run, when, and of which joint."""
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


def _turning_points(scene: Scene, run: Trajectory) -> list[str]:
    """Return dead centres, limit positions and the least transmission angle of a mechanism of one freedom.

    The rows [B] leave one direction w of motion, [B] w = 0. Where a guided point, or a body that turns about
    the ground, has no part in w it turns back: that is its dead centre. Where the turning body has no part in
    w it can turn no further: that is its limit position.
    """
    of, joints, turning = scene.mechanism, Joints(scene.mechanism), scene.turning_body
    if turning is None:
        return []
    place = CubicHermiteSpline(run.time_s, run.position, run.velocity)

    def direction(time_s: float) -> FloatArray:
        return np.asarray(np.linalg.svd(joints.matrix(place(time_s).ravel()))[2][-1])

    rows = {f"dead centre of {guide.name}": k for k, guide in enumerate(of.guides)}
    pinned = {pin.body_j for pin in of.pins if pin.body_i == GROUND} - {turning}
    spins = {f"dead centre of {of.bodies[body].name}": body for body in sorted(pinned)}
    spins[f"limit position of {of.bodies[turning].name}"] = turning

    def parts(w: FloatArray, q: FloatArray) -> dict[str, float]:
        ways = joints.told_rows(q, of.guides) @ w
        return {name: ways[k] for name, k in rows.items()} | {name: w[3 * k + 2] for name, k in spins.items()}

    lines = []
    sampled = [direction(time_s) for time_s in run.time_s]
    for before, after in pairwise(sampled):
        after *= np.sign(after @ before) or 1.0
    values = [parts(w, q.ravel()) for w, q in zip(sampled, run.position, strict=True)]
    for name in values[0]:
        sizes = np.array([value[name] for value in values])
        angles_deg = set[int]()
        for k in np.flatnonzero(sizes[:-1] * sizes[1:] < 0).tolist():

            def part(time_s: float, name: str = name, w: FloatArray = sampled[k]) -> float:
                there = direction(time_s)
                return parts(there * np.sign(there @ w), place(time_s).ravel())[name]

            zero_s = brentq(part, run.time_s[k], run.time_s[k + 1])
            angles_deg.add(round(10 * np.degrees(place(zero_s)[turning, 2])) % 3600)
        if angles_deg:
            at = ", ".join(f"{angle / 10:g}" for angle in sorted(angles_deg) if angle - 1 not in angles_deg)
            lines.append(f"{name} in the run: {of.bodies[turning].name} at {at} deg")
    return lines + _transmission(scene, run, sampled)


def _transmission(scene: Scene, run: Trajectory, directions: list[FloatArray]) -> list[str]:
    """Return the least transmission angle of each coupler, a body of two pins between moving bodies.

    It is 90 deg less the angle between the line of its pins and the motion of the pin that it drives.
    """
    of, velocity, lines = scene.mechanism, np.reshape(directions, run.position.shape), []
    for body, data in enumerate(of.bodies):
        own = [pin for pin in of.pins if body in (pin.body_i, pin.body_j)]
        guided = any(body in (guide.body_i, guide.body_j) for guide in of.guides)
        driving = [pin for pin in own if scene.turning_body in (pin.body_i, pin.body_j)]
        if guided or len(own) != 2 or len(driving) != 1 or body == scene.turning_body:
            continue
        points = {pin: pin.point_i if pin.body_i == body else pin.point_j for pin in own}
        driven = points.pop(driving[0])
        first, last = (point_motion(body, at, run.position, velocity) for at in (driven, *points.values()))
        line, motion = last.place_m - first.place_m, last.rate_m_s
        speed, along = np.hypot(*motion.T), np.abs(np.sum(line * motion, axis=1))
        moves = speed > AT_REST * np.abs(velocity).max(axis=(1, 2))
        sine = np.divide(along, speed * np.hypot(*line.T), out=np.ones(len(speed)), where=moves)
        angle_deg = np.degrees(np.arcsin(np.minimum(1.0, sine)))
        least = int(np.argmin(angle_deg))
        lines.append(
            f"least transmission angle of {data.name}: {angle_deg[least]:.3g} deg "
            f"at t = {run.time_s[least]:.6g} s"
        )
    return lines
