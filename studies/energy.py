"""Energy: what every engine makes or loses over long runs, where it goes, and how constraints drift.

The quick set leaves out what SciPy and Pymunk with contacts take longest for, Pymunk as it comes, and
stabilisations that need a kernel of their own.
"""

import math
from dataclasses import dataclass

import numpy as np

from engine_models import arms
from engine_models.arms import Arm
from engine_models.engine import FloatArray, RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.energy import energy_in_play_J
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.case import Case, Curves, Row
from studies.judges.energy_ledger import constraint_speed_m_s, ledger
from studies.judges.energy_rates import blocks_of, drift_rate, growth_exponent, so_far, thinned
from studies.judges.metrics import (
    checked,
    constraint_violation_m,
    energy_balance_residual_J,
    numerical_gain_J,
)
from studies.settings import speeds_rad_s


@dataclass(frozen=True)
class Length:
    """How long a scene runs: ``intervals`` samples, and the steps between two of them on each rung.

    Its ``name`` is the library's unless one is given.
    """

    scene: str
    end_s: float
    intervals: int
    steps_per_sample: tuple[int, ...]
    name: str = ""


#: One turn of set R's crank. Its runs are whole turns, sampled equally often in each.
TURN_S = 60 / 5000
#: Some 25 to 100 turns without clearance, 2 to 6 with it; and those of them that the quick set has.
SHORT = (
    Length("ideal-free", 6.0, 600, (25, 50)),
    Length("ideal-driven", 100 * TURN_S, 1000, (15, 30)),
    Length("ideal-fluctuating", 100 * TURN_S, 1000, (15, 30)),
    Length("ideal-compressor", 1.0, 400, (10, 20)),
    Length("clearance-start-up", 0.036, 360, (10, 20)),
    Length("clearance-free-0.5mm", 0.4, 200, (50, 100)),
    Length("clearance-driven-damped", 6 * TURN_S, 720, (10, 20)),
    Length("rigid-free-0.5mm", 0.4, 200, (50, 100)),
)
QUICK = ("ideal-free", "ideal-driven", "clearance-driven-damped", "rigid-free-0.5mm")
#: What the full set adds: ten times as many turns.
LONG = (
    Length("ideal-free", 60.0, 3000, (50, 100), "ideal-free-long"),
    Length("ideal-driven", 1000 * TURN_S, 5000, (30, 60), "ideal-driven-long"),
    Length("ideal-fluctuating", 1000 * TURN_S, 5000, (30, 60), "ideal-fluctuating-long"),
    Length("ideal-compressor", 10.0, 2000, (20, 40), "ideal-compressor-long"),
    Length("clearance-start-up", 0.36, 1800, (20, 40), "clearance-start-up-long"),
    Length("clearance-free-0.5mm", 4.0, 800, (125,), "clearance-free-0.5mm-long"),
    Length("clearance-driven-damped", 60 * TURN_S, 720, (100,), "clearance-driven-damped-long"),
    Length("rigid-free-0.5mm", 4.0, 800, (125,), "rigid-free-0.5mm-long"),
)

#: Methods that choose their steps have a tolerance on each rung in place of the step: as many as steps.
TOLERANCES, CLEARANCE_TOLERANCES = (1e-6, 1e-8), (1e-5, 1e-7)
RIGID_ARMS = (
    arms.DOPRI5,  # of an engine without rigid contact one configuration tells that it has none
    arms.LOCATED,
    arms.REFERENCE_DOP853,
    arms.NATIVE_CONTACT,
    arms.OUT_OF_THE_BOX,
)
#: With clearance Baumgarte is left out: it is the same between events, and needs a kernel of its own.
CLEARANCE_ARMS = (
    arms.DOPRI5,
    arms.LOCATED,
    arms.LOCATED_ALONE,
    arms.REFERENCE_DOP853,
    arms.SHORTER_IN_CONTACT,
    arms.OUT_OF_THE_BOX,
    arms.SCIPY_DOP853,
    arms.TRAPEZOIDAL,
    arms.GENERALIZED_ALPHA,
)
IDEAL_ARMS = (
    arms.PROJECTION,
    arms.NO_STABILISATION,
    arms.BAUMGARTE,
    arms.REFERENCE_DOP853,
    arms.TUNED,
    arms.OUT_OF_THE_BOX,
    arms.SCIPY_DOP853,
    arms.TRAPEZOIDAL,
    arms.GENERALIZED_ALPHA,
)
#: Samples of a curve that are kept.
KEPT = 240
#: Round-off of a constraint in places of the largest coordinate or speed, below which no growth is told: so
#: many, and so many for each rad of an angle, which after many turns is rounded by that much more.
PLACES, PLACES_PER_RAD = 1000, 2


def cases(full: bool) -> list[Case]:
    """Return every configuration on scenes at a series of steps; the full set adds scenes and long runs."""
    lengths = SHORT + LONG if full else tuple(length for length in SHORT if length.scene in QUICK)
    every = [case for length in lengths for case in _series(length)]
    return every if full else [case for case in every if _is_quick(case)]


def _is_quick(case: Case) -> bool:
    loose = bool(case.scene.clearances)
    left_out = (arms.OUT_OF_THE_BOX, arms.BAUMGARTE, arms.LOCATED_ALONE)
    slow = loose and case.engine in ("scipy", "pymunk")  # has the finer setting alone, which the tables show
    return case.arm not in left_out and not (slow and case.columns["rung"] == 0)


def _series(length: Length) -> list[Case]:
    changes = {"end_time_s": length.end_s, "name": length.name or length.scene}
    scene, out = SCENES[length.scene]().model_copy(update=changes), []
    tolerances = CLEARANCE_TOLERANCES if scene.clearances else TOLERANCES
    for arm in (*_arms(scene), *arms.newcomers()):
        for rung, count in enumerate(length.steps_per_sample):
            step = scene.end_time_s / (1 if arm.tolerances else length.intervals * count)
            run, added = RunSettings(step, length.intervals), dict.fromkeys(arm.tolerances, tolerances[rung])
            out.append(Case("energy", scene, arm, run, added, columns={"rung": rung}))
    return out


def _arms(scene: Scene) -> tuple[Arm, ...]:
    laws = {room.law for room in scene.clearances.values()}
    return RIGID_ARMS if laws == {"rigid"} else CLEARANCE_ARMS if laws else IDEAL_ARMS


def measure(case: Case) -> tuple[Row, Curves]:
    """Run one case and return its hidden power, its ledger at the end, its drift, and curves of all three."""
    scene = case.scene
    run = make_engine(case.engine, **case.settings).simulate(scene, case.run)
    gain = numerical_gain_J(scene, run)
    turns = float(np.ptp(run.position[:, scene.turning_body or 0, 2])) / (2 * math.pi)
    row: Row = {
        "steps": run.steps,
        "mean_step_s": scene.end_time_s / run.steps,
        "turns": turns,
        "energy_in_play_J": energy_in_play_J(scene, run),
        "largest_numerical_gain_J": float(np.abs(gain).max()),
        **_powers(scene, run, gain),
    }
    lines = {**ledger(scene, run), "energy_balance_residual_J": energy_balance_residual_J(scene, run)}
    row |= {name: float(line[-1]) for name, line in lines.items()} | checked(scene, run)
    drift, curves = _drift(scene, run)
    curves |= {"numerical_gain_so_far_J": so_far(gain), "time_s": run.time_s}
    if run.contacts:  # without, none of them says where energy goes
        curves |= lines
        row["compliant_contact"] = any(room.law != "rigid" for room in scene.clearances.values())
    return {**row, **drift}, {name: thinned(curve, KEPT) for name, curve in curves.items()}


def _powers(scene: Scene, run: Trajectory, gain: FloatArray) -> Row:
    """Return the power that no physics accounts for with its interval, and mean powers over the whole run."""
    nominal = abs(float(speeds_rad_s(scene).mean())) * scene.end_time_s / (2 * math.pi)
    rate = drift_rate(run.time_s, gain, blocks_of(nominal))
    row: Row = {
        "hidden_power_W": rate.per_s,
        "hidden_power_low_W": rate.low_per_s,
        "hidden_power_high_W": rate.high_per_s,
        "mean_hidden_power_W": float(gain[-1]) / scene.end_time_s,
    }
    if run.dissipated_energy_J is not None:
        row["dissipated_power_W"] = float(run.dissipated_energy_J[-1]) / scene.end_time_s
    if run.stabilisation_loss_J is not None:
        row["stabilisation_power_W"] = -float(run.stabilisation_loss_J[-1]) / scene.end_time_s
    return row


def _drift(scene: Scene, run: Trajectory) -> tuple[Row, Curves]:
    """Return the largest violation of the constraints in position and speed, and how each grows with time."""
    row: Row = {}
    curves: Curves = {}
    if not (scene.mechanism.ideal or scene.mechanism.guides):
        return row, curves  # nothing is constrained
    angle = float(np.abs(run.position[:, :, 2]).max())
    round_off = (PLACES + PLACES_PER_RAD * angle) * float(np.finfo(float).eps)
    judged = {
        "constraint_violation": ("m", constraint_violation_m(scene, run), run.position),
        "constraint_speed": ("m_s", constraint_speed_m_s(scene, run), run.velocity),
    }
    for name, (unit, curve, coordinates) in judged.items():
        largest = float(curve.max())
        row[f"{name}_{unit}"] = largest
        curves[f"{name}_so_far_{unit}"] = so_far(curve)
        # Impacts are no steady cause: what grows from one to the next follows no power of time.
        if not run.contacts and largest > round_off * np.abs(coordinates[:, :, :2]).max():
            row[f"{name}_exponent"] = growth_exponent(run.time_s, curve)
    return row, curves
