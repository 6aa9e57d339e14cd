"""Extremes: a gallery of named cases, what theory expects of each, and how near every engine came to it."""

import math
from functools import cache, partial

import numpy as np

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import (
    Engine,
    EngineFailed,
    ImpossibleScene,
    RunSettings,
    SimulationFailed,
    Trajectory,
    UnsupportedScene,
    unguarded,
)
from engine_models.engines import make_engine
from engine_models.scene.file import SceneError, from_toml
from engine_models.scene.scene import Scene
from studies.extremes import contacts, dead_centres, loose_joints, mechanisms, wheels
from studies.extremes.case import Extreme
from studies.judges.metrics import (
    checked,
    constraint_violation_m,
    finite,
)
from studies.running.case import Case, Curves, Row, Value
from studies.running.execution import Limits

#: What a run may take, and one of very many steps.
LIMITS, LONG_LIMITS = Limits(10.0, 1_000_000_000), Limits(120.0, 1_000_000_000)

#: A run is right within this part of the truth, with an energy ledger closed to this part of the energy in
#: play and constraints kept to this part of the crank's length. Beyond ten times one of these it is wrong.
RIGHT = {"relative_error": 1e-3, "unaccounted_energy_part": 1e-2, "constraint_relative": 1e-3}
NONSENSE = 10.0

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
#: Cases of the full set alone, beside long ones: each takes as long as ten others, most by its own kernels.
COSTLY = (
    "everyday linear law",
    "everyday restitution 0.9",
    "everyday friction 0.1",
    "stick-slip",
    "regularisation 1 µm/s",
    "friction 0",
    "friction 1",
    "slider mass × 1e6",
    "slider × 1e6, long step",
    "gravity 0",
    "clearance at O, A and B",
    "rigid e = 0.5, mechanism",
    "dead centre, loose",
    "L = r, loose",
    "at rest at a dead centre",
)


@cache
def gallery() -> dict[str, Extreme]:
    """Return all cases by name, in the order of the report."""
    groups = (
        contacts.everyday(),
        mechanisms.everyday(),
        contacts.stiffness(),
        contacts.clearance(),
        loose_joints.denormal(),
        contacts.restitution(),
        loose_joints.restitution(),
        wheels.friction(),
        loose_joints.friction(),
        mechanisms.speed(),
        contacts.speed(),
        mechanisms.masses(),
        dead_centres.dead_centres(),
        loose_joints.dead_centres(),
        loose_joints.joints(),
        mechanisms.starts(),
        wheels.starts(),
        mechanisms.loads(),
        wheels.stability(),
        mechanisms.long_runs(),
        loose_joints.long_runs(),
    )
    return {extreme.scene.name: extreme for group in groups for extreme in group}


def cases(full: bool) -> list[Case]:
    """Return every case for every engine and arm, with guards and without; the quick set has the cheap ones.

    Long ones take too long to be made twice.
    """
    return [
        _case(place, extreme, arm, guarded)
        for place, extreme in enumerate(gallery().values())
        for arm in (*ARMS, *arms.newcomers())
        for guarded in ((True,) if extreme.long else (True, False))
        if full or not left_out(extreme)
    ]


def left_out(extreme: Extreme) -> bool:
    """Return whether the quick set leaves a case out."""
    return extreme.long or extreme.scene.name in COSTLY


def _case(place: int, extreme: Extreme, arm: Arm, guarded: bool) -> Case:
    scene, step = extreme.scene, extreme.step_s
    chooses = arm in (arms.REFERENCE_DOP853, arms.SCIPY) or (
        arm is arms.EXUDYN and bool(scene.joints_with_clearance)
    )
    if chooses and not extreme.for_all:
        step = scene.end_time_s
    columns: dict[str, Value] = {
        "place": place,
        "guarded": guarded,
        "group": extreme.group,
        "theory": extreme.theory,
        "wanted": extreme.wanted,
        "stop_s": extreme.stop_s,
        **{f"{name}_bound": bound for name, bound in RIGHT.items()},
        "nonsense_factor": NONSENSE,
    }
    limits = None if extreme.first else LONG_LIMITS if extreme.long else LIMITS
    run = RunSettings(step, extreme.samples)
    return Case("extremes", scene, arm, run, limits=limits, columns=columns)


def measure(case: Case) -> tuple[Row, Curves]:
    """Return how far a run is from theory, from a closed ledger and from its constraints, in relative terms.

    A number that is not finite is left out; so is the error of a run that is not finite throughout. Without
    guards there is no check after the run either.

    Raises:
        ImpossibleScene: no scene can be so, as a scene's file says in the same words.
    """
    scene, engine = _valid(case.plain_scene), make_engine(case.engine, **case.settings)
    simulate = engine.simulate if case.columns["guarded"] else partial(_bare_run, engine)
    with np.errstate(over="ignore"):  # of a mass that is no number's inverse, of joints very far apart
        run = simulate(scene, case.run)
        row: Row = {"steps": run.steps, "finite": finite(run)} | checked(scene, run) | _apart(scene, run)
        if not case.columns["guarded"]:
            row["quality_failure"] = ""
        if not row["finite"]:
            return row, {}
        errors = gallery()[scene.name].check(engine.twin(scene), run)
        judged = max(errors, key=lambda name: errors[name] if math.isfinite(errors[name]) else math.inf)
        numbers = {
            "relative_error": errors[judged],
            "constraint_relative": float(constraint_violation_m(scene, run).max()) / scene.crank.length_m,
        }
    row |= {name: value for name, value in numbers.items() if math.isfinite(value)}
    return {**row, "judged": judged}, {}


def _bare_run(engine: Engine, scene: Scene, settings: RunSettings) -> Trajectory:
    """Return a run without guards; whatever is raised is its failure."""
    with unguarded(), np.errstate(all="ignore"):
        try:
            return engine.simulate(scene, settings)
        except (UnsupportedScene, SimulationFailed, MemoryError):
            raise
        except Exception as error:
            raise EngineFailed(f"{type(error).__name__}: {error}") from error


def _apart(scene: Scene, run: Trajectory) -> Row:
    """Return how far a pin got outside its bearing's wall, and an ideal joint or guide apart, in m."""
    depths = [contact.penetration_m.max() for contact in run.contacts.values()]
    numbers = {
        "penetration_m": float(max(depths, default=0.0)),
        "ideal_gap_m": float(constraint_violation_m(scene, run).max()),
    }
    return {name: value for name, value in numbers.items() if math.isfinite(value)}


def _valid(scene: Scene) -> Scene:
    """Return the scene as its file reads back: what is refused there no engine gets to see."""
    try:
        read = from_toml(scene.to_toml())
        assert isinstance(read, Scene)
        return read
    except SceneError as error:
        raise ImpossibleScene(f"no such scene: {error}") from None
