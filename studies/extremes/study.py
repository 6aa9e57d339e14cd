"""Extremes: a gallery of named cases, what theory expects of each, and how near every engine came to it."""

import math
from functools import cache

import numpy as np

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import ImpossibleScene, RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.scene.file import SceneError, from_toml, to_toml
from engine_models.scene.scene import Scene
from studies.extremes import contacts, dead_centres, mechanisms, wheels
from studies.extremes.case import Extreme
from studies.judges.comparison import checked
from studies.judges.metrics import (
    constraint_violation_m,
    finite,
    kinetic_energy_J,
    numerical_gain_J,
    potential_energy_J,
)
from studies.running.case import Case, Curves, Limits, Row, Value

#: What a run may take, and one of very many steps.
LIMITS, LONG_LIMITS = Limits(10.0, 1_000_000_000), Limits(120.0, 1_000_000_000)

#: A run is right within this part of the truth, with an energy ledger closed to this part of the energy there
#: is and constraints kept to this part of the crank's length. Beyond ten times the last two it is nonsense,
#: however near to the truth.
RIGHT = {"relative_error": 1e-3, "energy_relative": 1e-2, "constraint_relative": 1e-3}
NONSENSE = 10.0
#: Energy in J below which there is nothing to account for: a millionth of what lifts a wheel through its
#: clearance.
LEAST_ENERGY_J = 1e-9

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
#: Arms that make a hundred thousand revolutions in seconds.
FAST = (arms.REFERENCE, arms.PLAIN_RK4, arms.REFERENCE_DOP853)


@cache
def gallery() -> dict[str, Extreme]:
    """Return all cases by name, in the order of the report."""
    groups = (
        contacts.everyday(),
        mechanisms.everyday(),
        contacts.stiffness(),
        contacts.clearance(),
        contacts.restitution(),
        wheels.friction(),
        mechanisms.speed(),
        contacts.speed(),
        mechanisms.masses(),
        dead_centres.dead_centres(),
        mechanisms.starts(),
        wheels.starts(),
        mechanisms.loads(),
        wheels.stability(),
        mechanisms.long_runs(),
    )
    return {extreme.scene.name: extreme for group in groups for extreme in group}


def cases(full: bool) -> list[Case]:
    """Return every case for every engine and arm; the quick set has long runs of few."""
    return [
        _case(place, extreme, arm)
        for place, extreme in enumerate(gallery().values())
        for arm in (*ARMS, *arms.newcomers())
        if full or not extreme.long or arm in FAST
    ]


def _case(place: int, extreme: Extreme, arm: Arm) -> Case:
    scene, step = extreme.scene, extreme.step_s
    if arm in (arms.REFERENCE_DOP853, arms.SCIPY) or (arm is arms.EXUDYN and scene.joints_with_clearance):
        step = scene.end_time_s  # it chooses its own
    elif extreme.fixed_step_s and arm is not arms.REFERENCE:
        step = extreme.fixed_step_s
    columns: dict[str, Value] = {
        "place": place,
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

    A number that is not finite is left out; so is the error of a run that is not finite throughout.

    Raises:
        ImpossibleScene: no scene can be so, as a scene's file says in the same words.
    """
    scene = _valid(case.scene)
    engine = make_engine(case.engine, **case.settings)
    run = engine.simulate(scene, case.run)
    row: Row = {"steps": run.steps} | checked(scene, run)
    if not finite(run):
        return row, {}
    errors = gallery()[scene.name].check(engine.twin(scene), run)
    judged = max(errors, key=lambda name: errors[name] if math.isfinite(errors[name]) else math.inf)
    numbers = {
        "relative_error": errors[judged],
        "energy_relative": energy_relative(scene, run),
        "constraint_relative": float(constraint_violation_m(scene, run).max()) / scene.crank.length_m,
    }
    row |= {name: value for name, value in numbers.items() if math.isfinite(value)}
    return {**row, "judged": judged}, {}


def energy_relative(scene: Scene, run: Trajectory) -> float:
    """Return the largest energy that no physics accounts for, in parts of the largest there is."""
    moved = [np.ptp(potential_energy_J(scene, run)), kinetic_energy_J(scene, run).max()]
    moved += [np.ptp(work) for work in (run.driver_work_J, run.dissipated_energy_J) if work is not None]
    moved += [contact.elastic_energy_J.max() for contact in run.contacts.values()]
    gain = np.abs(numerical_gain_J(scene, run)).max()
    return float(gain / max(LEAST_ENERGY_J, *moved))


def _valid(scene: Scene) -> Scene:
    """Return the scene as its file reads back: what is refused there no engine gets to see."""
    try:
        return from_toml(to_toml(scene))
    except SceneError as error:
        raise ImpossibleScene(f"no such scene: {error}") from None
