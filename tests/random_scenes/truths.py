"""The stored truths of random scenes: where the slider is, to when that is certain, and how certain it is.

A line of JSON per scene, made by ``tests.random_scenes.make``. A scene is judged at a tolerance until a time
to which its truth is certain to a hundredth of that; a scene that is chaotic has a shorter one for a sharper
tolerance, or none. ``DEFAULT`` stands for runs without a tolerance: certain to 1e-4 of the smallest
clearance.
"""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from engine_models.scene.scene import Scene
from tests.random_scenes.recipe import random_scene

FloatArray = NDArray[np.float64]
Kind = Literal["compliant", "rigid"]
FOLDER = Path(__file__).parent
#: Tolerances of the slider's position in m at which scenes are judged, and the name of runs without one.
TOLERANCES_M = (1e-5, 1e-7, 1e-9)
DEFAULT = "default"
#: How certain a truth is: as a part of the tolerance, or of the smallest clearance in runs without one.
PART, DEFAULT_PART = 1e-2, 1e-4
#: Equal intervals between the times of a truth.
SAMPLES = 20


@dataclass(frozen=True)
class Judgement:
    """The slider's position (SAMPLES + 1,) at equal times from 0 to the end, known to the uncertainty.

    ``integrations`` is how many, each unlike the others, the uncertainty is from.
    """

    end_time_s: float
    slider_position_m: FloatArray
    uncertainty_m: float
    integrations: int


@dataclass(frozen=True)
class Truth:
    """A scene's judgements by tolerance in m or ``DEFAULT``; those are absent for which it is never certain.

    ``stopped`` says why it is not known to the scene's end, if that is so.
    """

    seed: int
    kind: Kind
    stopped: str
    judgements: dict[float | str, Judgement]

    @property
    def scene(self) -> Scene:
        """The scene of the seed; its end is that of no judgement."""
        return random_scene(self.seed, self.kind == "rigid")

    def judged_scene(self, tolerance: float | str) -> Scene:
        """Return the scene ended where its truth is certain enough for a tolerance."""
        return self.scene.model_copy(update={"end_time_s": self.judgements[tolerance].end_time_s})


def certain_to_m(scene: Scene, tolerance: float | str) -> float:
    """Return how well a truth must be known for a tolerance in m or ``DEFAULT``."""
    if isinstance(tolerance, float):
        return PART * tolerance
    return DEFAULT_PART * smallest_clearance_m(scene)


def smallest_clearance_m(scene: Scene) -> float:
    """Return the radial clearance of the joint that has least."""
    joints = (scene.clearance.O, scene.clearance.A, scene.clearance.B)
    return min(joint.radial_clearance_m for joint in joints if joint is not None)


def path_of(kind: Kind) -> Path:
    """Return the file of all truths of a kind."""
    return FOLDER / f"{kind}.jsonl"


def fingerprint(scene: Scene) -> str:
    """Return what tells whether a scene is still the one of its truth."""
    return hashlib.sha256(scene.to_toml().encode()).hexdigest()[:16]


def truths(kind: Kind) -> list[Truth]:
    """Return all truths of a kind in the order of their seeds.

    Raises:
        ValueError: the recipe makes another scene of a seed than when its truth was found.
    """
    found = []
    for line in path_of(kind).read_text(encoding="utf-8").splitlines():
        truth = truth_of(kind, json.loads(line))
        if fingerprint(truth.scene) != json.loads(line)["scene"]:
            raise ValueError(f"{kind} scene {truth.seed} has changed: python -m tests.random_scenes.make")
        found.append(truth)
    return found


def truth_of(kind: Kind, row: dict[str, Any]) -> Truth:
    """Return the truth of a line; judgements that end at the same time share their numbers there."""
    judgements = {}
    for part in row["judged"]:
        position = np.array(part["slider_position_m"])
        judgement = Judgement(part["end_time_s"], position, part["uncertainty_m"], part["integrations"])
        judgements.update(dict.fromkeys(part["at"], judgement))
    return Truth(row["seed"], kind, row["stopped"], judgements)


def row_of(truth: Truth) -> dict[str, Any]:
    """Return the line of a truth, see ``truth_of``; positions are rounded to 1e-15 m."""
    parts: dict[float, dict[str, Any]] = {}
    for tolerance, judgement in truth.judgements.items():
        part = parts.setdefault(
            judgement.end_time_s,
            {
                "at": [],
                "end_time_s": judgement.end_time_s,
                "uncertainty_m": float(f"{judgement.uncertainty_m:.1e}"),
                "integrations": judgement.integrations,
                "slider_position_m": [round(x, 15) for x in judgement.slider_position_m.tolist()],
            },
        )
        part["at"].append(tolerance)
    row = {"seed": truth.seed, "scene": fingerprint(truth.scene), "stopped": truth.stopped}
    return row | {"judged": list(parts.values())}


def write(kind: Kind, rows: Iterable[dict[str, Any]]) -> None:
    """Write a kind's file, whole or not at all, in the order of the seeds."""
    lines = [json.dumps(row) + "\n" for row in sorted(rows, key=lambda row: int(row["seed"]))]
    draft = path_of(kind).with_suffix(".draft")
    draft.write_text("".join(lines), encoding="utf-8")
    draft.replace(path_of(kind))
