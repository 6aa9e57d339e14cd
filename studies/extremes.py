"""Extremes: a gallery of named cases, what theory expects of each, and how near every engine came to it.

The cases are data, ``gallery.toml``. One check is of all: the largest error of any signal against the true
motion of the engine's own model, the energy balance, and the constraints, each as a part of its size. Left
out are signals that say no more than which side of an impact a sample fell on: forces, where pins have
clearance; their impulses count. Also left out: runs of hours.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from engine_models import arms
from engine_models.engine import FloatArray, ImpossibleScene, RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.states import lever_m
from engine_models.mechanics.trajectory import selected
from engine_models.scene.format import SceneError
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene, with_fields
from studies.case import Case, Curves, Row
from studies.judges.converged_truth import converged, followed
from studies.judges.metrics import checked, constraint_violation_m, finite, scales, signals, with_suffix

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

#: What is asked of an engine: the motion; the motion, or word that step or numbers are none to run with; a
#: refusal, for there is no motion; a stop at ``stop_s``, past which no motion is determined, or a way on.
Wanted = Literal["answer", "answer or word", "refusal", "stop"]

#: The cases as data.
GALLERY = Path(__file__).with_name("gallery.toml")
#: What a run may take. A kernel's compilation counts.
LIMIT_S = 120.0
#: A run is right within this part of the truth, with an energy balance closed to this part of the energy in
#: play and constraints kept to this part of the crank's length. Beyond ten times one of these it is wrong. A
#: signal that stands still is judged by a part of its size.
RIGHT = {"relative_error": 1e-3, "unaccounted_energy_part": 1e-2, "constraint_relative": 1e-3}
NONSENSE, STILL = 10.0, 1e-3
#: Every engine's best practice, and what a plain user would have: the paper's RK4, Pymunk as it comes.
ARMS = (
    arms.REFERENCE,
    arms.PLAIN_RK4,
    arms.REFERENCE_DOP853,
    arms.EXUDYN,
    arms.TUNED,
    arms.OUT_OF_THE_BOX,
    arms.SCIPY,
)


@dataclass(frozen=True)
class Extreme:
    """A case of the gallery, as ``gallery.toml`` explains it; its name is its scene's. Where no
    scene can be so, ``refused`` is what a scene's file says, and the scene that of its base."""

    group: str
    scene: Scene
    theory: str
    step_s: float
    samples: int = 100
    for_all: bool = False
    wanted: Wanted = "answer"
    stop_s: float | None = None
    quick: bool = False
    refused: str = ""
    truth: Mapping[str, Any] = field(default_factory=dict)


@cache
def gallery() -> dict[str, Extreme]:
    """Return all cases by name, in the order of the report."""
    groups = tomllib.loads(GALLERY.read_text(encoding="utf-8"))
    bases = groups.pop("bases")

    def completed(entry: dict[str, Any]) -> dict[str, Any]:
        name, changes = entry["base"], paths(entry.pop("scene", {}))
        base = completed(dict(bases[name])) if name in bases else {"scene": SCENES[name]().as_written()}
        return base | entry | {"scene": with_fields(base["scene"], changes)}

    cases = {}
    for group, entries in groups.items():
        for name, entry in entries.items():
            fields = completed(entry)
            base = fields.pop("base")
            try:
                scene = Scene.checked(fields["scene"] | {"name": name})
            except SceneError as reason:
                scene, fields["refused"] = (
                    Scene.checked(completed(dict(bases[base]))["scene"] | {"name": name}),
                    str(reason),
                )
            cases[name] = Extreme(group, **(fields | {"scene": scene}))
    return cases


def paths(changes: Mapping[str, Any], within: str = "") -> dict[str, Any]:
    """Return values of fields by their paths, as ``Scene.replace`` takes them; "none" takes a part away."""
    by_path: dict[str, Any] = {}
    for name, value in changes.items():
        if isinstance(value, Mapping):
            by_path |= paths(value, f"{within}{name}.")
        else:
            by_path[f"{within}{name}"] = None if value == "none" else value
    return by_path


def cases(full: bool) -> list[Case]:
    """Return every case by every engine and configuration; the quick set has 22 cases, and no plain RK4."""
    return [
        _case(place, extreme, arm)
        for place, extreme in enumerate(gallery().values())
        for arm in (*ARMS, *arms.newcomers())
        if full or (extreme.quick and arm is not arms.PLAIN_RK4)
    ]


def _case(place: int, extreme: Extreme, arm: arms.Arm) -> Case:
    scene, step = extreme.scene, extreme.step_s
    chooses = arm in (arms.REFERENCE_DOP853, arms.SCIPY) or (arm is arms.EXUDYN and bool(scene.clearances))
    if chooses and not extreme.for_all:
        step = scene.end_time_s
    columns: Row = {
        "place": place,
        "group": extreme.group,
        "theory": extreme.theory,
        "wanted": extreme.wanted,
        "stop_s": extreme.stop_s,
        **{f"{name}_bound": bound for name, bound in RIGHT.items()},
        "nonsense_factor": NONSENSE,
    }
    run = RunSettings(step, extreme.samples)
    return Case("extremes", scene, arm, run, limit_s=LIMIT_S, columns=columns)


def measure(case: Case) -> tuple[Row, Curves]:
    """Return how far a run is from the truth, from a closed energy balance and from its constraints.

    A number that is not finite is left out; so is the error of a run that is not finite throughout, or of a
    scene that has no motion.

    Raises:
        ImpossibleScene: no scene can be so, as a scene's file says in the same words.
    """
    scene, engine, extreme = case.scene, make_engine(case.engine, **case.settings), gallery()[case.scene.name]
    if extreme.refused:
        raise ImpossibleScene(f"no such scene: {extreme.refused}")
    with np.errstate(over="ignore"):  # of a mass that is no number's inverse, of joints very far apart
        run = engine.simulate(scene, case.run)
        row: Row = {"steps": run.steps, **checked(scene, run)}
        if not finite(run):
            return row, {}
        constraint = float(constraint_violation_m(scene, run).max()) / lever_m(scene)
        row |= {"constraint_relative": constraint} if np.isfinite(constraint) else {}
        if case.columns["wanted"] == "refusal":
            return row, {}
        own = engine.twin(scene)
        parts = relative_errors(own, own.replace(paths(extreme.truth)), run)
    judged = max(parts, key=lambda name: parts[name] if np.isfinite(parts[name]) else np.inf)
    row |= {"relative_error": parts[judged]} if np.isfinite(parts[judged]) else {}
    return {**row, "judged": judged}, {}


def relative_errors(scene: Scene, true_scene: Scene, run: Trajectory) -> dict[str, float]:
    """Return the largest error of every signal in parts of how far the true signal is from its mean.

    One that hardly moves is judged in parts of ``STILL`` of its size. ``true_scene`` has the motion that a
    run of ``scene`` is held to, for as long as independent solutions agree, and as it lasts.
    """
    samples = round((len(run.time_s) - 1) * true_scene.end_time_s / scene.end_time_s)
    truth, until = converged(true_scene, samples)[0], slice(followed(true_scene, samples))
    truth, run = selected(truth, until), selected(run, until)
    told, swings = dict(signals(scene, run)), scales(true_scene, truth)
    loose, parts = bool(scene.clearances), {}
    for name, true in signals(true_scene, truth):
        if not (loose and name.endswith(("_N", "_N_m"))):
            off, size = _size(told[name] - true), STILL * float(_size(true).max())
            parts[name] = float(off.max()) / (max(swings[with_suffix(name, "scale")], size) or 1.0)
    return parts


def _size(signal: FloatArray) -> FloatArray:
    """Return the size of a signal, (n,), of a vector (n, 2) its length."""
    return np.asarray(np.hypot.reduce(signal.reshape(len(signal), -1), axis=1))
