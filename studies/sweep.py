"""Sweeps: one scene with many values of its fields, each member a simulation of its own, and a row.

A member's values depend on the seed and on its number alone, not on who runs it.
"""

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, replace
from operator import itemgetter
from typing import Any, Literal

import numpy as np

from engine_models.arms import AS_IT_COMES, Arm
from engine_models.convergence.doubts import doubts
from engine_models.engine import Engine, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.engines import engine_class, make_engine
from engine_models.mechanics.quality import quality_of
from engine_models.mechanics.start import start_angle, start_state
from engine_models.mechanics.states import observed_m
from engine_models.scene.format import SceneError
from engine_models.scene.plain_words import shown
from engine_models.scene.scene import Scene
from engine_models.scene.units import in_unit, unit_of
from studies.case import Case, Curves, Row, Value
from studies.failures import BadInput

NAME = "sweep"
Sample = Literal["grid", "random", "latin-hypercube", "sobol"]
MOST_MEMBERS = 100_000
#: Output intervals in a revolution, and of a whole run at most. With clearance half as many: parts of flight
#: are then known to 2 %, and differ by 20 % between members whose clearances do by 1e-9 m (10 revolutions).
TURN_SAMPLES, MOST_SAMPLES = 200, 100_000
#: How the columns of varied fields begin in the rows that are kept.
VARIED = "varied "


def draw_values(
    scene: Scene,
    vary: Mapping[str, str | Sequence[float]],
    sample: Sample = "grid",
    members: int | None = None,
    jitter: float = 0.0,
    seed: int = 0,
) -> dict[str, FloatArray]:
    """Return the values (n,) of every field that changes, by its path; the last of a grid goes fastest.

    A field has its values as text, ``LOW:HIGH[:log][:COUNT]`` or a list, or as numbers. ``members`` are those
    of each point of a grid, or in all of a sample. ``jitter`` moves the turning body's angle at the start by
    up to so many rad to either side.
    """
    if "end_time_s" in vary:
        raise BadInput("vary end_time_s: expected transient and revolutions, which end a member's run")
    drawn = sample != "grid"
    lacking = (drawn or not vary) if members is None else not (vary if drawn else jitter)
    if lacking:
        raise BadInput("vary: expected FIELD=VALUES, or members beside jitter or sample, got another call")
    if drawn:
        parts = _parts(sample, len(vary), members or 0, seed)
        points = [_numbers(*item, part) for item, part in zip(vary.items(), parts, strict=True)]
    else:
        axes = [_numbers(*item) for item in vary.items()]
        if not 0 < (count := math.prod(map(len, axes)) * (members or 1)) <= MOST_MEMBERS:
            raise BadInput(f"vary: expected 1 to {MOST_MEMBERS} members, got {count}")
        points = [np.repeat(values.ravel(), members or 1) for values in np.meshgrid(*axes, indexing="ij")]
    values = dict(zip(vary, points, strict=True))
    if jitter:
        try:
            path, angle = start_angle(scene)
        except ValueError as reason:
            raise BadInput(f"jitter: {reason}") from None
        if path in vary:
            raise BadInput(f"jitter: expected nothing beside vary {path}, which it moves")
        count = len(points[0]) if points else members or 0
        # Not of the sample's own seed, whose numbers these would be again.
        values[path] = angle + np.random.default_rng([seed, 1]).uniform(-jitter, jitter, count)
    return values


def _numbers(field: str, values: str | Sequence[float], part: FloatArray | None = None) -> FloatArray:
    """Return the numbers of a field, (n,): a list's, those of a range, or at parts of its way from 0 to 1."""
    form = re.fullmatch(r"([^:]*):([^:]*)(:log)?(?::(\d{1,9}))?", str(values), re.ASCII)
    if form is None or (form[4] is None) != (part is not None):
        if part is not None or ":" in str(values):
            expected = "LOW:HIGH[:log]:COUNT or a list" if part is None else "LOW:HIGH[:log] beside sample"
            raise BadInput(f"vary {field}: expected {expected}, got {shown(values)}")
        given = values.split(",") if isinstance(values, str) else values
        return np.array([_number(field, value) for value in given])
    low, high, log, count = _number(field, form[1]), _number(field, form[2]), form[3], int(form[4] or 2)
    if not low < high or (log and low <= 0) or not 2 <= count <= MOST_MEMBERS:
        expected = f"a range that rises, with log from above 0, of 2 to {MOST_MEMBERS} values"
        raise BadInput(f"vary {field}: expected {expected}, got {shown(values)}")
    part = np.linspace(0.0, 1.0, count) if part is None else part
    return np.clip(low * (high / low) ** part if log else low + (high - low) * part, low, high)


def _number(field: str, value: str | float) -> float:
    unit = unit_of(field.rpartition(".")[2])
    number = in_unit(value, unit) if unit else value
    with suppress(ValueError):
        if math.isfinite(number := float(number)):
            return number
    raise BadInput(f"vary {field}: expected a finite number, got {shown(value)}")


def _parts(sample: Sample, fields: int, members: int, seed: int) -> FloatArray:
    """Return draws from 0 to 1, (fields, members); Sobol's are the first of a balanced power of two."""
    from scipy.stats import qmc  # which takes a second to load

    generator = np.random.default_rng(seed)
    if sample == "random":
        points = generator.random((members, fields))
    elif sample == "sobol":
        points = qmc.Sobol(fields, seed=generator).random(2 ** (members - 1).bit_length())
    else:
        points = qmc.LatinHypercube(fields, seed=generator).random(members)
    return np.asarray(points[:members].T)


def member_cases(
    scene: Scene,
    values: Mapping[str, FloatArray],
    engine_name: str,
    engine: Engine,
    columns: Mapping[str, float | None],
) -> list[Case]:
    """Return a case for each member; ``columns`` have transient, revolutions and the longest step."""
    turns = float(columns["transient"] or 0.0) + float(columns["revolutions"] or 0.0)
    first = {name: float(numbers[0]) for name, numbers in values.items()}
    for name, numbers in values.items():
        for end in (numbers.min(), numbers.max()):
            try:
                checked = member(scene, {**first, name: float(end)}, turns)
            except SceneError as error:
                raise BadInput(f"vary {error}") from None
            engine.check(checked)
    arm, run = Arm(engine_name, AS_IT_COMES), RunSettings(columns["step"] or scene.end_time_s, 1)
    settings = {each.name: vars(engine)[each.name] for each in fields(engine_class(engine_name))}
    cases = []
    for row in np.array([*values.values()]).T.tolist():
        own: dict[str, Value] = {VARIED + name: value for name, value in zip(values, row, strict=True)}
        cases.append(Case(NAME, scene, arm, run, settings, columns={**columns, **own}))
    return cases


def member_rows(cases: Sequence[Case], fields: Sequence[str], rows: Sequence[Row]) -> Any:
    """Return a data frame, a row per member: number, fields that differ, how it ended, what it did."""
    import pandas as pd

    by_case = {row["case"]: row for row in rows}
    table = pd.DataFrame([by_case[case.key] for case in cases])
    head = {"member": range(len(table))} | {name: table[VARIED + name] for name in fields}
    head |= {name: table.get(name) for name in ("status", "reason", "warnings")}
    others = {*cases[0].head(), *head, "case", "exception"}
    return pd.DataFrame(head | {name: table[name] for name in table if name not in others})


def member(scene: Scene, values: Mapping[str, float], revolutions: float) -> Scene:
    """Return the scene with these values in its fields, by their paths, as long as so many revolutions.

    Without a turning body, or where it starts at rest, one is as long as the scene.
    """
    scene, body = scene.replace(values), scene.turning_body
    speed = 0.0 if body is None else float(start_state(scene)[1][body, 2])
    turn_s = 2 * math.pi / abs(speed) if speed else scene.end_time_s
    return scene.replace("end_time_s", revolutions * turn_s)


def measure(case: Case) -> tuple[Row, Curves]:
    """Simulate a member, and return what it did, with its warnings.

    No second run at half the step checks it: a loose pin's motion is soon another by any change, and what
    many members do is not. Each has its energy balance.
    """
    numbers = {name: float(str(value)) for name, value in case.columns.items() if value is not None}
    lengths = ("transient", "revolutions", "step")
    transient, revolutions, step_s = (numbers.pop(name, math.inf) for name in lengths)
    engine = make_engine(case.engine, **case.settings)
    values = {name.removeprefix(VARIED): number for name, number in numbers.items()}
    try:
        scene = member(case.scene, values, transient + revolutions)
    except SceneError as reason:
        raise SimulationFailed(str(reason)) from None
    in_turn = TURN_SAMPLES // 2 if scene.clearances else TURN_SAMPLES
    samples = max(1, min(round(in_turn * (transient + revolutions)), MOST_SAMPLES))
    with np.errstate(all="ignore"):  # engines look for non-finite numbers themselves
        run = engine.simulate(scene, RunSettings(min(step_s, scene.end_time_s), samples))
        quality = quality_of(scene, run)
        warnings = doubts(engine, scene, run, quality, None)
    results = {**quality.parts(), **summary(scene, run, transient, revolutions)}
    known = {name: value for name, value in results.items() if math.isfinite(value)}
    return {"warnings": "; ".join(warnings), **known}, {}


def summary(scene: Scene, run: Trajectory, transient: float, revolutions: float) -> dict[str, float]:
    """Return what a run did in the revolutions after the transient; NaN is what is not known.

    Of joints with clearance, all taken together: an impact is a touch; one that still lasts at the end has no
    impulse yet, and its speed is not known. The deviation is that of what the scene observes from where ideal
    joints would have it at the turning body's angle. That is the phase of an impact, or without such a body
    the part of a turn's time; its mean is that of cosine and sine, since angles go round.
    """
    from studies.judges.closing import closed  # which takes half a second to load

    turns, body = transient + revolutions, scene.turning_body
    first = round((len(run.time_s) - 1) * transient / turns)
    if not run.contacts:
        joints = {name: np.hypot(*force.T) for name, force in run.joint_force_N.items()}
        loads = {f"largest_joint_{name}_force_N": force for name, force in joints.items()}
        loads |= {f"largest_{name}_normal_force_N": force for name, force in run.guide_force_N.items()}
        if run.driver_torque_N_m is not None:
            loads["largest_driver_torque_N_m"] = run.driver_torque_N_m
        return {name: float(np.abs(load[first:]).max()) for name, load in loads.items()}
    turn_s, from_s = scene.end_time_s / turns, run.time_s[first]
    touch_s, speed, impulse = _touches(run, from_s)
    late = replace(run, position=run.position[first:], velocity=run.velocity[first:])
    ideal = replace(late, position=closed(scene, late.position, body))
    deviation = observed_m(scene, late) - observed_m(scene, ideal)
    angle = 2 * np.pi * run.time_s / turn_s if body is None else run.position[:, body, 2]
    phase = np.interp(touch_s, run.time_s, angle) % (2 * np.pi)
    contacts, lost = run.contacts.values(), run.dissipated_energy_J
    assert lost is not None, "there are contacts"
    pressed = np.sum([contact.normal_impulse_N_s for contact in contacts], axis=0)
    in_flight = np.all([contact.penetration_m[first:] < 0 for contact in contacts], axis=0)
    forces_N = [math.nan]
    for joint, contact in run.contacts.items():
        if scene.clearances[joint].law != "rigid":
            impacts = contact.impacts
            ended = impacts.largest_normal_force_N[impacts.largest_normal_force_time_s >= from_s]
            forces_N += [*contact.normal_force_N[first:], *ended]
    subject = "slider" if scene.is_short and "rod" in scene.body else "observed"
    return {
        "impacts_per_revolution": len(touch_s) / revolutions,
        "flight_part": float(in_flight.mean()),
        "impact_speed_m_s": _mean(speed),
        "impulse_N_s": _mean(impulse),
        "impulse_per_revolution_N_s": float(pressed[-1] - pressed[first]) / revolutions,
        "largest_contact_force_N": float(np.fmax.reduce(forces_N)),
        "dissipated_energy_per_revolution_J": float((lost[-1] - lost[first]) / revolutions),
        f"{subject}_deviation_m": float(np.abs(deviation).max()),
        f"rms_{subject}_deviation_m": float(np.sqrt(np.mean(deviation**2))),
        "impact_phase_cosine": _mean(np.cos(phase)),
        "impact_phase_sine": _mean(np.sin(phase)),
    }


def _mean(values: FloatArray) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else math.nan


def _touches(run: Trajectory, from_s: float) -> FloatArray:
    """Return times, speeds and impulses of touches from a time on, (3, m), NaN of what is not known.

    A contact that lasts at the end began between two samples, or where the one before ended if no sample lies
    in the flight between.
    """
    touches = list[tuple[float, float, float]]()
    for contact in run.contacts.values():
        depth, over = contact.penetration_m, contact.impacts
        touches += zip(over.time_s, over.approach_speed_m_s, over.normal_impulse_N_s, strict=True)
        flying = np.flatnonzero(depth < 0)[-1:]
        began = [float(np.interp(0.0, depth[k : k + 2], run.time_s[k : k + 2])) for k in flying]
        began += [*(over.time_s + over.duration_s)]
        if depth[-1] >= 0 and began:
            touches.append((max(began), math.nan, math.nan))
    late = sorted((touch for touch in touches if touch[0] >= from_s), key=itemgetter(0))
    return np.asarray(np.array(late).reshape(-1, 3).T)
