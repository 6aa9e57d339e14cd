"""Extremes: a gallery of named cases, what theory expects of each, and how near every engine came to it."""

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, TypeAdapter

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import FloatArray, ImpossibleScene, RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.samples import selected
from engine_models.mechanics.states import observed_m
from engine_models.scene.data import Kind
from engine_models.scene.file import SceneError, from_toml
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Clearances, Scene
from studies.case import Case, Curves, Row, Value
from studies.judges.converged_truth import converged, followed
from studies.judges.metrics import checked, constraint_violation_m, finite

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

#: Relative errors of a run by what was judged: {"slider position": 1e-6}.
Errors = Mapping[str, float]
#: What compares a run with an independent truth. The scene is the engine's own (``Engine.twin``), so that an
#: engine is judged by the law that it solves.
Check = Callable[[Scene, Trajectory], Errors]
#: What is asked of an engine: the motion; the motion, or word that step or numbers are none to run with; a
#: refusal, for there is no motion; a stop at ``stop_s``, where the motion is determined no more, or a smooth
#: way on.
Wanted = Literal["answer", "answer or word", "refusal", "stop"]

#: The cases as data.
GALLERY = Path(__file__).with_name("gallery.toml")
#: What a run may take. A kernel's compilation counts.
LIMIT_S = 120.0
#: A run is right within this part of the truth, with an energy ledger closed to this part of the energy in
#: play and constraints kept to this part of the crank's length. Beyond ten times one of these it is wrong.
RIGHT = {"relative_error": 1e-3, "unaccounted_energy_part": 1e-2, "constraint_relative": 1e-3}
NONSENSE = 10.0
#: Turns after which a motion that settles has settled.
SETTLED_TURNS = 20
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
    """A case of the gallery, as ``gallery.toml`` explains it; its name is its scene's."""

    group: str
    scene: Scene
    theory: str
    check: str
    step_s: float
    samples: int = 100
    for_all: bool = False
    wanted: Wanted = "answer"
    stop_s: float | None = None
    quick: bool = False


@cache
def gallery() -> dict[str, Extreme]:
    """Return all cases by name, in the order of the report."""
    groups = tomllib.loads(GALLERY.read_text(encoding="utf-8"))
    bases = groups.pop("bases")

    def completed(entry: dict[str, Any]) -> dict[str, Any]:
        name, changes = entry["base"], entry.pop("scene", {})
        base = completed(dict(bases[name])) if name in bases else {"scene": SCENES[name]()}
        return base | entry | {"scene": changed(base["scene"], changes)}

    cases = {}
    for group, entries in groups.items():
        for name, entry in entries.items():
            fields = completed(entry)
            del fields["base"]
            fields["scene"] = changed(fields["scene"], {"name": name})
            cases[name] = Extreme(group, **fields)
    return cases


def changed(part: Kind, changes: Mapping[str, Any]) -> Kind:
    """Return a scene, or a part of one, with changes that nothing checks: a case may be what no scene is.

    No engine gets to see it (see ``measure``).
    """
    fields = {}
    for name, value in changes.items():
        old = getattr(part, name)
        if not isinstance(value, Mapping):
            fields[name] = None if value == "none" else value
        elif old is None:
            kind: Any = type(part).model_fields[name].annotation
            fields[name] = TypeAdapter(kind).validate_python(value)
        else:
            fields[name] = changed(old, value)
    return BaseModel.model_copy(part, update=fields)


def cases(full: bool) -> list[Case]:
    """Return every case by every engine and arm; the quick set has 22 cases, and no plain RK4."""
    return [
        _case(place, extreme, arm)
        for place, extreme in enumerate(gallery().values())
        for arm in (*ARMS, *arms.newcomers())
        if full or (extreme.quick and arm is not arms.PLAIN_RK4)
    ]


def _case(place: int, extreme: Extreme, arm: Arm) -> Case:
    scene, step = extreme.scene, extreme.step_s
    chooses = arm in (arms.REFERENCE_DOP853, arms.SCIPY) or (
        arm is arms.EXUDYN and bool(scene.joints_with_clearance)
    )
    if chooses and not extreme.for_all:
        step = scene.end_time_s
    columns: dict[str, Value] = {
        "place": place,
        "group": extreme.group,
        "theory": extreme.theory,
        "check": extreme.check,
        "wanted": extreme.wanted,
        "stop_s": extreme.stop_s,
        **{f"{name}_bound": bound for name, bound in RIGHT.items()},
        "nonsense_factor": NONSENSE,
    }
    run = RunSettings(step, extreme.samples)
    return Case("extremes", scene, arm, run, limit_s=LIMIT_S, columns=columns)


def measure(case: Case) -> tuple[Row, Curves]:
    """Return how far a run is from theory, from a closed ledger and from its constraints, in relative terms.

    A number that is not finite is left out; so is the error of a run that is not finite throughout.

    Raises:
        ImpossibleScene: no scene can be so, as a scene's file says in the same words.
    """
    scene, engine = _valid(case.plain_scene), make_engine(case.engine, **case.settings)
    with np.errstate(over="ignore"):  # of a mass that is no number's inverse, of joints very far apart
        run = engine.simulate(scene, case.run)
        row: Row = {"steps": run.steps, **checked(scene, run)}
        if not finite(run):
            return row, {}
        errors = CHECKS[str(case.columns["check"])](engine.twin(scene), run)
        judged = max(errors, key=lambda name: errors[name] if math.isfinite(errors[name]) else math.inf)
        numbers = {
            "relative_error": errors[judged],
            "constraint_relative": float(constraint_violation_m(scene, run).max()) / scene.crank.length_m,
        }
    row |= {name: value for name, value in numbers.items() if math.isfinite(value)}
    return {**row, "judged": judged}, {}


def _valid(scene: Scene) -> Scene:
    """Return the scene as its file reads back: what is refused there no engine gets to see."""
    try:
        read = from_toml(scene.to_toml())
        assert isinstance(read, Scene)
        return read
    except SceneError as error:
        raise ImpossibleScene(f"no such scene: {error}") from None


# The checks


def _off(value: FloatArray, true: FloatArray, size: float) -> float:
    """Return the largest distance from the truth, of numbers (n,) or vectors (n, k), in parts of a size."""
    difference = value - true
    distance = np.abs(difference) if difference.ndim == 1 else np.sqrt(np.sum(difference**2, axis=-1))
    return float(distance.max() / size)


def _truth(scene: Scene, run: Trajectory) -> Trajectory:
    """Return the true trajectory at the samples of a run."""
    return converged(scene, len(run.time_s) - 1)[0]


def ideal_motion(scene: Scene, run: Trajectory) -> Errors:
    """Judge a scene of ideal joints by its true motion: crank, slider, force at B."""
    truth = _truth(scene, run)
    force, angle = truth.joint_force_N["B"], truth.position[:, 0, 2]
    return {
        "slider position": _off(observed_m(scene, run), observed_m(scene, truth), scene.crank.length_m),
        "crank angle": _off(run.position[:, 0, 2], angle, float(np.ptp(angle)) or 1.0),
        "force at B": _off(run.joint_force_N["B"], force, float(np.hypot(*force.T).max()) or 1.0),
    }


def loose_motion(scene: Scene, run: Trajectory) -> Errors:
    """Judge joints with clearance by the converged solution, for as long as independent solutions agree.

    The distance is that from the farthest of these, so that no solver is judged by itself.
    """
    samples = len(run.time_s) - 1
    truth, repeats = converged(scene, samples)
    until = slice(None, followed(scene, samples))
    errors: dict[str, float] = {}
    for joint in scene.joints_with_clearance:
        own, *others = (selected(motion.contacts[joint], until) for motion in (run, truth, *repeats))
        size = float(np.hypot(*others[0].gap_m.T).max())
        impulse = float(others[0].normal_impulse_N_s[-1])
        errors[f"place in the bearing at {joint}"] = max(
            _off(own.gap_m, other.gap_m, size) for other in others
        )
        errors[f"impulse at {joint}"] = max(
            _off(own.normal_impulse_N_s, other.normal_impulse_N_s, impulse) for other in others
        )
    return errors


def settled(scene: Scene, run: Trajectory) -> Errors:
    """Judge a long run of clearance at B by the periodic motion that it settles to.

    The samples are whole turns and a little apart, so that they take a part of a turn by its phases, and the
    first of them comes after ``SETTLED_TURNS``. The truth is the converged solution, in the turn after these.
    """
    samples = len(run.time_s) - 1
    turn = 2 * np.pi / scene.start.crank_speed_rad_s
    per_turn = round(samples * turn / (scene.end_time_s % turn))
    short = scene.model_copy(update={"end_time_s": SETTLED_TURNS * turn + scene.end_time_s % turn})
    truth, _ = converged(short, SETTLED_TURNS * per_turn + samples)
    true, gap = truth.contacts["B"].gap_m[SETTLED_TURNS * per_turn :], run.contacts["B"].gap_m
    size = float(np.hypot(*true.T).max())
    return {"place in the bearing at B": _off(gap[1:], true[1:], size)}


def nearly_ideal(scene: Scene, run: Trajectory) -> Errors:
    """Judge a clearance of next to nothing by the ideal joint's slider: the walls give less than is right."""
    ideal = _truth(scene.model_copy(update={"clearance": Clearances()}), run)
    return _slider(scene, run, observed_m(scene, ideal))


def without_slider(scene: Scene, run: Trajectory) -> Errors:
    """Judge a slider of next to no mass by the motion with one of 1e-12 kg, the same to a part in 1e11."""
    return ideal_motion(scene.replace("slider.mass_kg", 1e-12), run)


def folded(scene: Scene, run: Trajectory) -> Errors:
    """Judge the slider of a driven crank with a rod of its length, phi = -theta."""
    theta = scene.start.crank_angle_rad + scene.start.crank_speed_rad_s * run.time_s
    return _slider(scene, run, 2 * scene.crank.length_m * np.cos(theta))


def turning(scene: Scene, run: Trajectory) -> Errors:
    """Judge the slider where the crank keeps its speed, its angle reduced to one turn."""
    crank, rod, _ = scene.crank_slider()
    turned = scene.start.crank_angle_rad + scene.start.crank_speed_rad_s * run.time_s
    r, theta = crank.length_m, np.remainder(turned, 2 * np.pi)
    return _slider(scene, run, r * np.cos(theta) + np.sqrt(rod.length_m**2 - (r * np.sin(theta)) ** 2))


def _slider(scene: Scene, run: Trajectory, true: FloatArray) -> Errors:
    return {"slider position": _off(observed_m(scene, run), true, scene.crank.length_m)}


def dropped(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel on the bearing's vertical by its place, in parts of the height it moves through."""
    true = _truth(scene, run).position[:, 0, :2]
    return {"height": _off(run.position[:, 0, :2], true, float(np.ptp(true[:, 1])))}


def bounced(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel that bounces between two samples by its height and the impulse told of impacts."""
    told, true = (
        float(each.contacts["O"].impacts.normal_impulse_N_s.sum()) for each in (run, _truth(scene, run))
    )
    return {**dropped(scene, run), "impulse of the bounce": abs(told / true - 1)}


def resting(scene: Scene, run: Trajectory) -> Errors:
    """Judge bodies that have to stay where they began, in parts of the crank's length (or of a radian)."""
    moved = run.position - run.position[0]
    return {"any body's place": float(np.abs(moved).max() / scene.crank.length_m)}


def braked(scene: Scene, run: Trajectory) -> Errors:
    """Judge a wheel on a dry bearing by its spin and the angle it turned."""
    truth = _truth(scene, run)
    spin, angle = truth.velocity[:, 0, 2], truth.position[:, 0, 2]
    return {
        "spin": _off(run.velocity[:, 0, 2], spin, float(spin[0])),
        "angle turned": _off(run.position[:, 0, 2], angle, float(np.ptp(angle))),
    }


def swung(scene: Scene, run: Trajectory) -> Errors:
    """Judge a pendulum on a dry bearing by its angle and its pin's place in the bearing."""
    truth = _truth(scene, run)
    angle, place = truth.position[:, 0, 2], truth.contacts["O"].gap_m
    return {
        "angle": _off(run.position[:, 0, 2], angle, float(np.ptp(angle))),
        "place in the bearing": _off(run.contacts["O"].gap_m, place, float(np.hypot(*place.T).max())),
    }


def impossible(scene: Scene, run: Trajectory) -> Errors:
    """Judge a run of a scene that has no motion: whatever came is wrong altogether."""
    del scene, run
    return {"a motion where there is none": 1.0}


CHECKS: Mapping[str, Check] = {
    check.__name__: check
    for check in (
        *(ideal_motion, loose_motion, settled, nearly_ideal, without_slider, folded, turning),
        *(dropped, bounced, resting, braked, swung, impossible),
    )
}
