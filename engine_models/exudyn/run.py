"""Exudyn's runs as trajectories: of ideal joints on the steps' grid, of clearance at steps as they came."""

import exudyn as exu
import numpy as np
from scipy.integrate import cumulative_trapezoid

from engine_models.engine import JOINTS, Contact, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.exudyn.contact_record import contact_record, contact_states, integral
from engine_models.exudyn.forces import driver_torque, joint_forces
from engine_models.exudyn.model import Model
from engine_models.exudyn.motion import Motion, recorded_motion
from engine_models.exudyn.solver import solve, stored
from engine_models.exudyn.tree import CRANK
from engine_models.scene.scene import Scene

#: A recorded time may differ from its place on the grid by rounding, never by this part of an interval.
TIME_TOLERANCE = 1e-6


def record_every(scene: Scene, run: RunSettings) -> int:
    """Return 1 where the driver's work has to be integrated over every step, else samples are enough."""
    return 1 if scene.drive.kind == "constant-speed" else run.steps_per_sample(scene.end_time_s)


def ideal_run(
    scene: Scene, run: RunSettings, model: Model, settings: exu.SimulationSettings, timeout_s: float
) -> Trajectory:
    """Run a model of ideal joints whose sensors record every ``record_every`` steps."""
    solve_time = solve(scene, model, settings, timeout_s)
    per_sample, step = run.steps_per_sample(scene.end_time_s), run.step_used_s(scene.end_time_s)
    per_record = record_every(scene, run)
    grid = np.linspace(0.0, scene.end_time_s, run.samples * per_sample // per_record + 1)
    samples = slice(None, None, per_sample // per_record)
    coordinates, speeds, forces = (
        [_read(model, sensor, grid) for sensor in sensors]
        for sensors in (model.coordinates, model.speeds, model.joint_forces.values())
    )
    position, velocity = np.zeros((2, run.samples + 1, *model.reference.shape))
    for body, (at, rate) in enumerate(zip(coordinates, speeds, strict=True)):  # the slider has x alone
        position[:, body, : at.shape[1]] = at[samples]
        velocity[:, body, : rate.shape[1]] = rate[samples]
    torque: FloatArray | None = None
    work: FloatArray | None = None
    if model.driver is not None:
        torque = -_read(model, model.driver, grid)[:, 0]
        work = cumulative_trapezoid(torque * speeds[CRANK][:, 2], dx=step, initial=0.0)[samples]
        torque = torque[samples]
    return _trajectory(
        scene,
        run,
        position=position + model.reference,
        velocity=velocity,
        joint_force=np.stack([force[samples, :2] for force in forces], axis=1),
        torque=torque,
        work=work,
        steps=run.samples * per_sample,
        solve_time_s=solve_time,
    )


def clearance_run(
    scene: Scene, run: RunSettings, model: Model, settings: exu.SimulationSettings, timeout_s: float
) -> Trajectory:
    """Run a model with clearance whose sensors record every step; samples lie between steps.

    The motion is interpolated as ``Motion`` says. Forces of constraints are Exudyn's multipliers, linear
    between steps; without constraints they follow from the accelerations.
    """
    solve_time = solve(scene, model, settings, timeout_s)
    motion = recorded_motion(scene, model)
    time = np.linspace(0.0, scene.end_time_s, run.samples + 1)
    position, velocity, _ = motion.at(time)
    if model.accelerations:
        force, torque, work = _balances(scene, motion, time)
    else:
        force, torque, work = _multipliers(scene, model, motion, time)
    return _trajectory(
        scene,
        run,
        position=position,
        velocity=velocity,
        joint_force=force,
        torque=torque,
        work=work,
        steps=len(motion.time_s) - 1,
        solve_time_s=solve_time,
        contacts={name: contact_record(scene, name, motion, time) for name in scene.joints_with_clearance},
    )


#: Joint forces (n, joints, 2), driver torque (n,), driver work (n,); the last two for a constant speed only.
Forces = tuple[FloatArray, FloatArray | None, FloatArray | None]


def _multipliers(scene: Scene, model: Model, motion: Motion, time_s: FloatArray) -> Forces:
    """Return what the sensors of joints and driver recorded, at the samples (n,)."""

    def at_samples(values: FloatArray, time: FloatArray = time_s) -> FloatArray:
        return np.stack([np.interp(time, motion.time_s, column) for column in values.T], axis=-1)

    force = np.zeros((len(time_s), len(scene.joints), 2))
    for name, sensor in model.joint_forces.items():
        force[:, JOINTS.index(name)] = at_samples(stored(model, sensor)[:, 1:3])
    for name in scene.joints_with_clearance:
        force[:, JOINTS.index(name)] = contact_states(scene, name, motion, time_s).force_on_pin_N
    if model.driver is None:
        return force, None, None
    grid = np.union1d(motion.time_s, time_s)
    torque = at_samples(-stored(model, model.driver)[:, 1:2], grid)[:, 0]
    work = cumulative_trapezoid(torque * scene.start.crank_speed_rad_s, grid, initial=0.0)
    sampled = np.searchsorted(grid, time_s)
    return force, torque[sampled], work[sampled]


def _balances(scene: Scene, motion: Motion, time_s: FloatArray) -> Forces:
    """Return what the bodies' accelerations ask for, at the samples (n,)."""

    def at(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        position, _, acceleration = motion.at(time)
        contacts = {name: contact_states(scene, name, motion, time) for name in scene.joints_with_clearance}
        force = joint_forces(scene, acceleration, contacts)
        return force, driver_torque(scene, position, acceleration, force, contacts)

    force, torque = at(time_s)
    if scene.drive.kind != "constant-speed":
        return force, None, None
    grid = np.union1d(motion.time_s, time_s)
    work = scene.start.crank_speed_rad_s * integral(grid, lambda time: at(time)[1][None])[0]
    return force, torque, work[np.searchsorted(grid, time_s)]


def _trajectory(
    scene: Scene,
    run: RunSettings,
    *,
    position: FloatArray,
    velocity: FloatArray,
    joint_force: FloatArray,
    torque: FloatArray | None,
    work: FloatArray | None,
    steps: int,
    solve_time_s: float,
    contacts: dict[str, Contact] | None = None,
) -> Trajectory:
    if scene.drive.kind == "torque":
        torque = np.full(len(position), scene.drive.torque_N_m)
        work = scene.drive.torque_N_m * (position[:, CRANK, 2] - position[0, CRANK, 2])
    guide: FloatArray | None = None
    if scene.is_crank_slider:  # the slider does not accelerate along y: N + F_B,y - m g = 0
        weight = scene.bodies[-1].mass_kg * scene.gravity_m_s2
        guide = weight - joint_force[:, JOINTS.index("B"), 1]
    return Trajectory(
        time_s=np.linspace(0.0, scene.end_time_s, run.samples + 1),
        position=position,
        velocity=velocity,
        joint_force_N=joint_force,
        guide_normal_force_N=guide,
        driver_torque_N_m=torque,
        driver_work_J=work,
        step_s=run.step_used_s(scene.end_time_s),
        steps=steps,
        solve_time_s=solve_time_s,
        contacts=contacts or {},
    )


def _read(model: Model, sensor: int, grid_s: FloatArray) -> FloatArray:
    """Return what a sensor recorded at the grid's times, (n, components); one missing is a failed run."""
    record = np.asarray(model.mbs.GetSensorStoredData(sensor), dtype=np.float64)
    tolerance = TIME_TOLERANCE * (grid_s[1] - grid_s[0])
    common = min(len(record), len(grid_s))
    right = np.abs(record[:common, 0] - grid_s[:common]) <= tolerance
    if not right.all() or len(record) != len(grid_s):
        missed = common if right.all() else int(np.argmin(right))
        when = grid_s[min(missed, len(grid_s) - 1)]
        raise SimulationFailed(f"Exudyn recorded nothing at t = {when:.6g} s")
    return record[:, 1:]
