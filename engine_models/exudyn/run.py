"""Exudyn's runs as trajectories: of ideal joints on the steps' grid, of clearance at steps as they came."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from engine_models.engine import (
    BareRun,
    Contact,
    FloatArray,
    RunSettings,
    SimulationFailed,
    Trajectory,
)
from engine_models.exudyn.contact import contact_record, contact_states
from engine_models.exudyn.model import Model, build_model
from engine_models.exudyn.motion import GAP, SLIDING_SPEED, Motion, Record, integral, place_bodies
from engine_models.exudyn.settings import IMPLICIT, ExudynSettings, steps_as_they_come
from engine_models.exudyn.solver import record_every, silence, simulation_settings, solve
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.joints import ContactForces
from engine_models.mechanics.loads import integrated_works, load_powers_W
from engine_models.mechanics.reactions import Reactions, force_on_later, reactions
from engine_models.mechanics.states import direction, way
from engine_models.mechanics.trajectory import drive_torque, trajectory_of
from engine_models.mechanics.wrenches import Wrenches, inertias
from engine_models.scene.scene import Scene

#: A recorded time may differ from its place on the grid by rounding, never by this part of an interval.
TIME_TOLERANCE = 1e-6
#: What joints with clearance do, by their names.
Contacts = Mapping[str, Contact | ContactForces]


def exudyn_run(engine: ExudynSettings, scene: Scene, run: RunSettings) -> Trajectory:
    """Run a scene that the engine supports; numbers may come out that are not finite.

    Raises:
        SimulationFailed: Exudyn gave up, stopped short or ran out of time.
    """
    with silence(), np.errstate(all="ignore"):  # require_finite is the judge
        model, settings = _model(engine, scene), simulation_settings(engine, scene, run)
        solve_time = solve(scene, model, settings, engine.timeout_s)
        read_out = _as_they_came if steps_as_they_come(engine, scene) else _on_the_grid
        return read_out(scene, run, model, solve_time)


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


def _on_the_grid(scene: Scene, run: RunSettings, model: Model, solve_time_s: float) -> Trajectory:
    """Return the run of a model of ideal joints whose sensors record every ``record_every`` steps."""
    per_sample, step = run.steps_per_sample(scene.end_time_s), run.step_used_s(scene.end_time_s)
    per_record = record_every(scene, run)
    grid = np.linspace(0.0, scene.end_time_s, run.samples * per_sample // per_record + 1)
    samples = slice(None, None, per_sample // per_record)
    states = np.zeros((3, len(grid), *model.reference.shape))
    for part in model.parts:
        place_bodies(states, part, *(_read(model, sensor, grid) for sensor in part.sensors))
    forces = {name: _read(model, sensor, grid)[samples, :2] for name, sensor in model.joint_forces.items()}
    powers, torque = _powers(scene, grid, states[0], states[1]), None
    if model.driver is not None:
        torque = -_read(model, model.driver, grid)[:, 0]
        powers["driver"] = torque * _driven_speed(scene, states[0], states[1])
        torque = torque[samples]
    works = {
        name: cumulative_trapezoid(power, dx=step, initial=0.0)[samples] for name, power in powers.items()
    }
    sampled = states[:, samples].copy()  # not a view, which would keep all steps
    found = _all_forces(scene, model, grid[samples], sampled, forces, {}, torque)
    return trajectory_of(
        scene,
        **vars(replace(found, driver_torque_N_m=torque)),
        time_s=grid[samples],
        position=sampled[0],
        velocity=sampled[1],
        driver_work_J=works.pop("driver", None),
        step_s=step,
        steps=run.samples * per_sample,
        solve_time_s=solve_time_s,
        load_work_J=works,
    )


def _as_they_came(scene: Scene, run: RunSettings, model: Model, solve_time_s: float) -> Trajectory:
    """Return the run of a model whose sensors record every step; samples lie between steps.

    The motion is interpolated as ``Motion`` says. Forces of constraints are Exudyn's multipliers, linear
    between steps; without constraints they follow from the accelerations.
    """
    motion, time = _recorded_motion(scene, model), run.times_s(scene)
    grid = np.union1d(motion.time_s, time)
    sampled = np.searchsorted(grid, time)

    def at_samples(sensor: int, values: slice, at: FloatArray = time) -> FloatArray:
        columns = _stored(model, sensor)[:, 1:][:, values].T
        return np.stack([np.interp(at, motion.time_s, column) for column in columns], axis=-1)

    def forces_at(at: FloatArray, told: Mapping[str, FloatArray], torque: FloatArray | None) -> Reactions:
        contacts = {name: contact_states(scene, name, motion, at) for name in scene.joints_with_clearance}
        return _all_forces(scene, model, at, np.stack(motion.at(at)), told, contacts, torque)

    def power(at: FloatArray) -> FloatArray:
        torque = forces_at(at, {}, None).driver_torque_N_m
        assert torque is not None, "a prescribed speed has one"
        return (torque * _prescribed_speed(scene, at))[None]

    forces = {name: at_samples(sensor, slice(2)) for name, sensor in model.joint_forces.items()}
    works, torque = _works(scene, motion, grid, sampled), None
    if model.driver is not None:
        torque = -at_samples(model.driver, slice(1), grid)[:, 0]
        power_W = torque * _prescribed_speed(scene, grid)
        torque, works["driver"] = torque[sampled], cumulative_trapezoid(power_W, grid, initial=0.0)[sampled]
    found = forces_at(time, forces, torque)
    if model.tree and scene.mechanism.drive.prescribes:
        torque, works["driver"] = found.driver_torque_N_m, integral(grid, power)[0][sampled]
    position, velocity, _ = motion.at(time)
    return trajectory_of(
        scene,
        **vars(replace(found, driver_torque_N_m=torque)),
        time_s=time,
        position=position,
        velocity=velocity,
        driver_work_J=works.pop("driver", None),
        step_s=run.step_used_s(scene.end_time_s),
        steps=len(motion.time_s) - 1,
        solve_time_s=solve_time_s,
        contacts={name: contact_record(scene, name, motion, time) for name in scene.joints_with_clearance},
        load_work_J=works,
    )


def _all_forces(
    scene: Scene,
    model: Model,
    time_s: FloatArray,
    states: FloatArray,
    told: Mapping[str, FloatArray],
    contacts: Contacts,
    torque: FloatArray | None,
) -> Reactions:
    """Return all forces at times (n,) in states (3, n, bodies, 3), with those of joints that Exudyn tells.

    Pins and guides that carry rotors and masses take what the body's momentum lacks of what else acts on it.
    """
    of, (position, velocity, acceleration) = scene.mechanism, states
    if model.by_balance:
        return reactions(scene, time_s, position, velocity, acceleration, contacts)
    acting, forces = Wrenches(position), dict(told)
    acting.loads(of, time_s, velocity)
    if torque is not None:
        acting.drive(of, torque)
    for pin in of.pins:
        if pin.clearance is not None:
            acting.contact(pin, contacts[pin.name])
            forces[pin.name] = force_on_later(pin.bearing_on_j, contacts[pin.name])
        elif pin.name in forces:
            acting.pin(pin, forces[pin.name])
    lacking = inertias(of) * (acceleration - [*of.gravity_m_s2, 0.0]) - acting.total[:, :-1]
    for pin in of.ideal:
        forces.setdefault(pin.name, lacking[:, pin.body_j, :2])
    across, moments = dict[str, FloatArray](), dict[str, FloatArray]()
    for guide in of.guides:
        across[guide.name] = np.sum(lacking[:, guide.body_j, :2] * direction(guide, position)[1], axis=1)
        acting.line(guide, across[guide.name], across=True)
        moments[guide.name] = -acting.total[:, guide.body_j, 2]
    return Reactions({pin.name: forces[pin.name] for pin in of.pins}, across, moments, torque)


def _driven_speed(scene: Scene, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return how fast what is driven turns, or moves along its guide, (n,) in states (n, bodies, 3)."""
    drive = scene.mechanism.drive
    if drive.guide is None:
        return velocity[:, drive.body, 2]
    return way(scene.mechanism.guides[drive.guide], position, velocity)[1]


def _prescribed_speed(scene: Scene, time_s: FloatArray) -> FloatArray:
    motion = crank_motion(scene)
    assert motion is not None
    return motion.speed_rad_s(time_s)


def _powers(
    scene: Scene, time_s: FloatArray, position: FloatArray, velocity: FloatArray
) -> dict[str, FloatArray]:
    """Return the powers (n,) in W, at times (n,) in states (n, bodies, 3), of what has no other work.

    They are named as in ``integrated_works``; a driver that prescribes the speed has its torque from the run.
    """
    powers, drive = load_powers_W(scene, time_s, position, velocity), scene.mechanism.drive
    if "driver" in integrated_works(scene) and not drive.prescribes:
        torque = drive_torque(drive, time_s, velocity)
        assert torque is not None
        powers["driver"] = torque * velocity[:, drive.body, 2]
    return powers


def _works(
    scene: Scene, motion: Motion, grid: FloatArray, sampled: NDArray[np.int64]
) -> dict[str, FloatArray]:
    """Return the integrals of ``_powers`` since t = 0 on a grid (g,), at the samples, which are in it."""

    def at(time: FloatArray) -> FloatArray:
        return np.stack([*_powers(scene, time, *motion.at(time)[:2]).values()])

    names = [*_powers(scene, grid[:1], *motion.at(grid[:1])[:2])]
    if not names:
        return {}
    return dict(zip(names, integral(grid, at)[:, sampled], strict=True))


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
        if not finite.all():
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
