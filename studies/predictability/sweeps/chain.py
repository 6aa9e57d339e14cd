"""Chains: members one after another, each of which goes on from where the one before it ended.

A chain up and a chain down stay each in the motion that they have come from, and where they differ there is
hysteresis. From member to member pins keep their places as parts of their clearances, so that one at the wall
is at the wall where the clearance shrinks, and their speeds as parts of clearance times crank speed. One that
is in its wall is put just before it: the law's damping depends on how fast a pin touches.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from engine_models.engine import FloatArray, SimulationFailed
from engine_models.mechanics.assembly import assembled_apart, start_state
from engine_models.mechanics.joints import joint_gap
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.members import End, Members, Row, failed, supports
from engine_models.scene.data import SceneError
from engine_models.scene.scene import BodyState, Scene
from studies.predictability.sweeps.gathered import followed
from studies.predictability.sweeps.task import Task

#: Where pins are in their clearances, and how fast, by joint: four numbers, as parts.
Places = Mapping[str, Sequence[float]]
#: As far out as a pin may be at a start, as a part of its clearance.
FARTHEST = 1 - 1e-6
#: Returns the row of a member with these values, and where it ended.
Follow = Callable[[Mapping[str, float]], tuple[Row, End | None]]


def run_chain(
    task: Task, members: Sequence[Mapping[str, float]], places: Places | None
) -> tuple[list[Row], Places]:
    """Return the rows of members by their values, in order, and where the last one's pins have ended.

    The first one begins with its pins in their ``places``, or without any as the scene does. After one that
    failed the next one begins where that one did.
    """
    base = task.scene
    assert isinstance(base, Scene), "assembled_apart puts crank-sliders together"
    if places is None:
        places = _places(base, start_state(base)) if base.start.states else {}
    follow, rows = _follower(task, base, [*members[0]]), list[Row]()
    for values in members:
        try:
            scene = task.watch.member(base, values)
            row, end = follow({**values, **_start(scene, places)})
            places = places if end is None else _places(scene, end)
        except (SceneError, SimulationFailed) as failure:
            row = failed(str(failure))
        rows.append(row)
    return rows, places


def _follower(task: Task, scene: Scene, fields: Sequence[str]) -> Follow:
    engine = task.engine
    if isinstance(engine, ReferenceEngine) and supports(engine, scene, fields):
        return Members(engine, scene, {}, task.watch, task.step_s).followed
    return lambda values: followed(task, values)


def _start(scene: Scene, places: Places) -> dict[str, float]:
    """Return the fields of a start at the scene's crank angle with pins in their places, by their paths."""
    start = scene.start
    gaps = {
        joint: np.reshape(places[joint], (2, 2)) * _units(room.radial_clearance_m, scene)
        for joint, room in scene.clearances.items()
        if joint in places
    }
    state = assembled_apart(scene, start.crank_angle_rad, start.crank_speed_rad_s, gaps)
    return {
        f"start.{body}.{name}": value
        for body, numbers in zip(scene.mechanism.names, np.hstack(state).tolist(), strict=True)
        for name, value in zip(BodyState.model_fields, numbers, strict=True)
    }


def _places(scene: Scene, end: End) -> dict[str, list[float]]:
    position, velocity = (part[None] for part in end)
    found = {}
    for joint, room in scene.clearances.items():
        gap = joint_gap(scene, joint, position, velocity)
        parts = np.concatenate([gap.gap_m, gap.rate_m_s]) / _units(room.radial_clearance_m, scene)
        parts[0] *= min(1.0, FARTHEST / np.hypot(*parts[0])) if parts[0].any() else 1.0
        found[joint] = parts.ravel().tolist()
    return found


def _units(clearance_m: float, scene: Scene) -> FloatArray:
    """Return the units, (2, 1), of a pin's place and of its rate."""
    return clearance_m * np.array([[1.0], [abs(scene.start.crank_speed_rad_s)]])
