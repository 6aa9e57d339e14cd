"""Exudyn's runs as trajectories: of ideal joints on the steps' grid, of clearance at steps as they came."""

from dataclasses import replace
from itertools import chain

import numpy as np
from scipy.integrate import cumulative_trapezoid

from engine_models.engine import BareRun, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.exudyn.contact import contact_record, contact_states
from engine_models.exudyn.model import Model, build_model
from engine_models.exudyn.motion import GAP, SLIDING_SPEED, Motion, Record, integral, place_bodies
from engine_models.exudyn.settings import IMPLICIT, ExudynSettings
from engine_models.exudyn.solver import evaluations, record_every, silence, simulation_settings, solve
from engine_models.guards import guarded
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.joints import CRANK, SLIDER, contact_force
from engine_models.mechanics.loads import integrated_parts, slider_forces
from engine_models.mechanics.reactions import Reactions, guides_by_balance, reactions
from engine_models.mechanics.trajectory import trajectory_of
from engine_models.scene.scene import Scene
from reference_solver.mechanism.motor import motor_torque

#: A recorded time may differ from its place on the grid by rounding, never by this part of an interval.
TIME_TOLERANCE = 1e-6


def exudyn_run(engine: ExudynSettings, scene: Scene, run: RunSettings) -> Trajectory:
    """Run a scene that the engine supports; numbers may come out that are not finite.

    Raises:
        SimulationFailed: Exudyn gave up, stopped short or ran out of time.
    """
    with silence(), np.errstate(all="ignore"):  # require_finite is the judge
        model, settings = _model(engine, scene), simulation_settings(engine, scene, run)
        solve_time = solve(scene, model, settings, engine.timeout_s)
        read_out = _with_clearance if scene.joints_with_clearance else _ideal
        trajectory = read_out(scene, run, model, solve_time)
        return replace(trajectory, evaluations=evaluations(model, engine.solver_of(scene)))


def bare_run(engine: ExudynSettings, scene: Scene, run: RunSettings) -> BareRun:
    """Return the same solve with nothing recorded but its ends; numbers may come out that are not finite.

    Raises:
        SimulationFailed: Exudyn gave up or ran out of time.
    """
    with silence(), np.errstate(all="ignore"):
        model, settings = _model(engine, scene), simulation_settings(engine, scene, run)
        settings.solution.sensors.writePeriod = scene.end_time_s
        solve_time = solve(scene, model, settings, engine.timeout_s)
        end = np.zeros((3, 1, *model.reference.shape))
        for part in model.parts:
            place_bodies(end, part, *(np.atleast_2d(model.mbs.GetSensorValues(of)) for of in part.sensors))
        return BareRun(solve_time, end[0, 0])


def _model(engine: ExudynSettings, scene: Scene) -> Model:
    return build_model(scene, tree=engine.solver_of(scene) not in IMPLICIT)


def _ideal(scene: Scene, run: RunSettings, model: Model, solve_time_s: float) -> Trajectory:
    """Return the run of a model of ideal joints whose sensors record every ``record_every`` steps."""
    per_sample, step = run.steps_per_sample(scene.end_time_s), run.step_used_s(scene.end_time_s)
    per_record = record_every(scene, run)
    grid = np.linspace(0.0, scene.end_time_s, run.samples * per_sample // per_record + 1)
    samples = slice(None, None, per_sample // per_record)
    states = np.zeros((3, len(grid), *model.reference.shape))
    for part in model.parts:
        place_bodies(states, part, *(_read(model, sensor, grid) for sensor in part.sensors))
    forces = {name: _read(model, sensor, grid)[samples, :2] for name, sensor in model.joint_forces.items()}
    powers, torque = _powers(scene, states[0], states[1]), None
    if model.driver is not None:
        torque = -_read(model, model.driver, grid)[:, 0]
        powers["driver"] = torque * states[1, :, CRANK, 2]
        torque = torque[samples]
    works = {
        name: cumulative_trapezoid(power, dx=step, initial=0.0)[samples] for name, power in powers.items()
    }
    position, velocity, acceleration = states[:, samples].copy()  # not a view, which would keep all steps
    forces["O"] = _pivot_force(scene, acceleration, forces.get("A"))
    force, time = {name: forces[name] for name in scene.joints}, grid[samples]
    guide, moment = guides_by_balance(scene, time, position, velocity, force, {})
    return trajectory_of(
        scene,
        time_s=time,
        position=position,
        velocity=velocity,
        joint_force_N=force,
        guide_force_N=guide,
        guide_moment_N_m=moment,
        driver_torque_N_m=torque,
        driver_work_J=works.pop("driver", None),
        step_s=step,
        steps=run.samples * per_sample,
        solve_time_s=solve_time_s,
        load_work_J=works,
    )


def _pivot_force(scene: Scene, acceleration: FloatArray, at_A_N: FloatArray | None) -> FloatArray:
    """Return the ideal O's force on the crank (n, 2), which has no constraint there: from its momentum.

    ``acceleration`` (n, bodies, 3) is all bodies', ``at_A_N`` (n, 2) acts on the rod, None without one.
    """
    gravity = np.array([0.0, scene.weight_m_s2])
    force = scene.crank.mass_kg * (acceleration[:, CRANK, :2] + gravity)
    return np.asarray(force if at_A_N is None else force + at_A_N)


def _powers(scene: Scene, position: FloatArray, velocity: FloatArray) -> dict[str, FloatArray]:
    """Return the powers (n,) in W, in states (n, bodies, 3), of what has no other work than their integral.

    These are parts of the slider's load and, as "driver", a motor; a driver that prescribes the speed has
    its torque from the run.
    """
    forces = slider_forces(scene, position, velocity)
    powers = {part: forces[part] * velocity[:, SLIDER, 0] for part in integrated_parts(scene)}
    if scene.drive.kind == "motor":
        speed = velocity[:, CRANK, 2]
        powers["driver"] = motor_torque(scene.drive.line, speed) * speed
    return powers


def _with_clearance(scene: Scene, run: RunSettings, model: Model, solve_time_s: float) -> Trajectory:
    """Return the run of a model with clearance whose sensors record every step; samples lie between steps.

    The motion is interpolated as ``Motion`` says. Forces of constraints are Exudyn's multipliers, linear
    between steps; without constraints they follow from the accelerations.
    """
    motion = _recorded_motion(scene, model)
    time = run.times_s(scene)
    position, velocity, _ = motion.at(time)
    if model.tree:
        force, torque, work = _balances(scene, motion, time)
    else:
        force, torque, work = _multipliers(scene, model, motion, time)
    works = _works(scene, motion, time)
    contacts = {name: contact_record(scene, name, motion, time) for name in scene.joints_with_clearance}
    guide, moment = guides_by_balance(scene, time, position, velocity, force, contacts)
    return trajectory_of(
        scene,
        time_s=time,
        position=position,
        velocity=velocity,
        joint_force_N=force,
        guide_force_N=guide,
        guide_moment_N_m=moment,
        driver_torque_N_m=torque,
        driver_work_J=works.pop("driver", work),
        step_s=run.step_used_s(scene.end_time_s),
        steps=len(motion.time_s) - 1,
        solve_time_s=solve_time_s,
        contacts=contacts,
        load_work_J=works,
    )


def _works(scene: Scene, motion: Motion, time_s: FloatArray) -> dict[str, FloatArray]:
    """Return the integrals of ``_powers`` since t = 0, at the samples (n,)."""

    def at(time: FloatArray) -> FloatArray:
        return np.stack([*_powers(scene, *motion.at(time)[:2]).values()])

    names = [*_powers(scene, *motion.at(time_s[:1])[:2])]
    if not names:
        return {}
    grid = np.union1d(motion.time_s, time_s)
    sums = integral(grid, at)[:, np.searchsorted(grid, time_s)]
    return dict(zip(names, sums, strict=True))


#: Joint forces (n, 2), driver torque (n,) and driver work (n,); these two for prescribed speeds only.
Forces = tuple[dict[str, FloatArray], FloatArray | None, FloatArray | None]


def _multipliers(scene: Scene, model: Model, motion: Motion, time_s: FloatArray) -> Forces:
    """Return what the sensors of joints and driver recorded, at the samples (n,), with the force at O."""

    def at_samples(values: FloatArray, time: FloatArray = time_s) -> FloatArray:
        return np.stack([np.interp(time, motion.time_s, column) for column in values.T], axis=-1)

    found = {name: at_samples(_stored(model, sensor)[:, 1:3]) for name, sensor in model.joint_forces.items()}
    for name in scene.joints_with_clearance:
        found[name] = contact_force(contact_states(scene, name, motion, time_s))
    if "O" not in found:
        found["O"] = _pivot_force(scene, motion.at(time_s)[2], found["A"])
    force = {name: found[name] for name in scene.joints}
    if model.driver is None:
        return force, None, None
    grid = np.union1d(motion.time_s, time_s)
    torque = at_samples(-_stored(model, model.driver)[:, 1:2], grid)[:, 0]
    work = cumulative_trapezoid(torque * _speed(scene, grid), grid, initial=0.0)
    sampled = np.searchsorted(grid, time_s)
    return force, torque[sampled], work[sampled]


def _balances(scene: Scene, motion: Motion, time_s: FloatArray) -> Forces:
    """Return what the bodies' accelerations ask for, at the samples (n,)."""

    def at(time: FloatArray) -> Reactions:
        position, velocity, acceleration = motion.at(time)
        contacts = {name: contact_states(scene, name, motion, time) for name in scene.joints_with_clearance}
        return reactions(scene, time, position, velocity, acceleration, contacts)

    def power(time: FloatArray) -> FloatArray:
        torque = at(time).driver_torque_N_m
        assert torque is not None, "a prescribed speed has one"
        return (torque * _speed(scene, time))[None]

    found = at(time_s)
    if not scene.speed_is_prescribed:
        return found.joint_force_N, None, None
    grid = np.union1d(motion.time_s, time_s)
    work = integral(grid, power)[0]
    return found.joint_force_N, found.driver_torque_N_m, work[np.searchsorted(grid, time_s)]


def _speed(scene: Scene, time_s: FloatArray) -> FloatArray:
    """Return the crank's prescribed speed at times (n,)."""
    motion = crank_motion(scene)
    assert motion is not None
    return motion.speed_rad_s(time_s)


def _recorded_motion(scene: Scene, model: Model) -> Motion:
    """Return what the model's sensors recorded.

    Raises:
        SimulationFailed: the run broke off or is not finite.
    """
    records = [[_stored(model, sensor) for sensor in part.sensors] for part in model.parts]
    time = records[0][0][:, 0]
    for record in chain(*records):
        if len(record) != len(time):
            raise SimulationFailed(f"Exudyn recorded nothing at t = {time[-1]:.6g} s")
        finite = np.isfinite(record).all(axis=1)
        if guarded() and not finite.all():
            when = time[max(0, int(np.argmin(finite)))]
            raise SimulationFailed(f"non-finite state at t = {when:.6g} s")
    if time[-1] < scene.end_time_s:
        raise SimulationFailed(f"Exudyn stopped short of the end at t = {time[-1]:.6g} s")
    histories = {joint: _stored(model, sensor)[:, 1:] for joint, sensor in model.histories.items()}
    switched = np.append(True, np.zeros(len(time) - 1, dtype=bool))
    for joint, history in histories.items():
        friction = scene.clearances[joint].friction
        branches = [history[:, GAP] < 0]
        if friction is not None:
            branches.append(history[:, SLIDING_SPEED] < friction.regularisation_speed_m_s)
        for branch in branches:
            switched[1:] |= np.diff(branch)
    return Motion(
        time_s=time,
        bodies=len(model.reference),
        records=tuple(
            Record(part, *(quantity[:, 1:] for quantity in record))
            for part, record in zip(model.parts, records, strict=True)
        ),
        histories=histories,
        switched=switched,
    )


def _stored(model: Model, sensor: int) -> FloatArray:
    """Return all that a sensor recorded, (k, 1 + components), time first, each time once."""
    record = np.asarray(model.mbs.GetSensorStoredData(sensor), dtype=np.float64)
    return np.asarray(record[np.append(np.diff(record[:, 0]) > 0, True)])


def _read(model: Model, sensor: int, grid_s: FloatArray) -> FloatArray:
    """Return what a sensor recorded at the grid's times, (n, components); one missing is a failed run."""
    record = np.asarray(model.mbs.GetSensorStoredData(sensor), dtype=np.float64)
    common = min(len(record), len(grid_s))
    right = np.abs(record[:common, 0] - grid_s[:common]) <= TIME_TOLERANCE * (grid_s[1] - grid_s[0])
    if not right.all() or len(record) != len(grid_s):
        missed = common if right.all() else int(np.argmin(right))
        raise SimulationFailed(f"Exudyn recorded nothing at t = {grid_s[min(missed, len(grid_s) - 1)]:.6g} s")
    return record[:, 1:]
