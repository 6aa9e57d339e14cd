"""Exudyn's runs as trajectories: forces, works and contacts follow from the motion that it recorded."""

import numpy as np
from scipy.integrate import cumulative_trapezoid

from engine_models.engine import BareRun, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.exudyn.contact import contact_record
from engine_models.exudyn.engine import IMPLICIT, ExudynEngine
from engine_models.exudyn.model import Model
from engine_models.exudyn.motion import GAP, SLIDING_SPEED, Motion, integral, link_rows, states
from engine_models.exudyn.solver import silence, simulation_settings, solve
from engine_models.mechanics.forces import works_J
from engine_models.mechanics.trajectory import Reactions
from engine_models.minimal import equations as eq
from engine_models.minimal.forces import Forces
from engine_models.scene.scene import Scene

#: The end of a run is off by no more than this part of it.
ROUND_OFF = 1e-9


def exudyn_run(engine: ExudynEngine, scene: Scene, run: RunSettings) -> Trajectory:
    """Run a scene that the engine supports; numbers may come out that are not finite.

    Samples of runs with steps as they come lie between steps (see ``Motion``).

    Raises:
        SimulationFailed: Exudyn gave up, stopped short or ran out of time.
    """
    tree, of = engine.solver_of(scene) not in IMPLICIT, scene.mechanism
    forces = Forces(engine.twin(scene))
    forces.contacts[:, eq.DRAGS : eq.MU] = 1.0  # friction drives where a contact pulls
    as_they_come = engine.steps_as_they_come(scene)
    every = 1 if as_they_come or forces.integrated else run.steps_per_sample(scene.end_time_s)
    with silence(), np.errstate(all="ignore"):  # require_finite is the judge
        model, solve_time_s = _solved(engine, scene, run, every)
        motion = _recorded(scene, model, tree)
        time, recorded = run.times_s(scene), len(motion.time_s) - 1
        sampled_s = time if as_they_come else motion.time_s[:: recorded // run.samples]
        grid = np.union1d(motion.time_s, sampled_s)

        def powers(at: FloatArray) -> FloatArray:
            position, velocity, _ = motion.at(at)
            found = forces.act(at, position, velocity).powers_W
            if of.drive.prescribes:
                torque = _reactions(forces, motion, at).driver_torque_N_m
                assert torque is not None
                found["driver"] = torque * forces.motion(at)[1]
            return np.stack([found[name] for name in forces.integrated])

        works = dict[str, FloatArray]()
        if forces.integrated:
            sums = integral(grid, powers) if tree else cumulative_trapezoid(powers(grid), grid, initial=0.0)
            works = dict(zip(forces.integrated, sums[:, np.searchsorted(grid, sampled_s)], strict=True))
        position, velocity, _ = motion.at(sampled_s)
        works = works_J(scene, position, works)
        return Trajectory(
            **vars(_reactions(forces, motion, sampled_s)),
            time_s=time,
            position=position,
            velocity=velocity,
            driver_work_J=works.pop("driver", None),
            step_s=run.step_used_s(scene.end_time_s),
            steps=recorded * every,
            solve_time_s=solve_time_s,
            contacts={
                pin.name: contact_record(forces, motion, pin, scene.clearances[pin.name], sampled_s)
                for pin in of.loose
            },
            load_work_J=works,
        )


def bare_run(engine: ExudynEngine, scene: Scene, run: RunSettings) -> BareRun:
    """Return the same solve with nothing recorded but its ends; numbers may come out that are not finite.

    Raises:
        SimulationFailed: Exudyn gave up or ran out of time.
    """
    with silence(), np.errstate(all="ignore"):
        model, solve_time_s = _solved(engine, scene, run, 0)
        ends = [np.atleast_1d(model.mbs.GetSensorValues(sensor)) for sensor in model.motion[0]]
        q, out = (model.start + np.concatenate(ends))[None], np.zeros((1, 3, 3 * len(model.of.bodies)))
        states(link_rows(model.branches), q, q, q, out)  # their rates change no position
        return BareRun(solve_time_s, out[0, 0].reshape(-1, 3))


def _solved(engine: ExudynEngine, scene: Scene, run: RunSettings, every: int) -> tuple[Model, float]:
    """Return a model that has run, and the time of the solve; one in ``every`` equal steps is recorded."""
    model = Model(scene, engine.solver_of(scene) not in IMPLICIT)
    settings = simulation_settings(engine, scene, model.forces, run, every)
    return model, solve(model.mbs, settings, engine.timeout_s)


def _reactions(forces: Forces, motion: Motion, time_s: FloatArray) -> Reactions:
    """Return all forces at times (n,)."""
    moved = motion.at(time_s)
    acting = forces.act(time_s, *moved[:2], approach_m_s=motion.approach_m_s(time_s))
    return forces.reactions(time_s, *moved, acting.contacts)


def _recorded(scene: Scene, model: Model, tree: bool) -> Motion:
    """Return what the model's sensors recorded.

    Raises:
        SimulationFailed: the run broke off or is not finite.
    """
    time = _stored(model, model.motion[0][0])[:, 0]
    coordinates, rates, accelerations = (
        np.concatenate([_stored(model, sensor)[:, 1:] for sensor in of], axis=1) for of in model.motion
    )
    finite = np.isfinite(np.concatenate([coordinates, rates, accelerations], axis=1)).all(axis=1)
    if not finite.all():
        raise SimulationFailed(f"non-finite state at t = {time[int(np.argmin(finite))]:.6g} s")
    if time[-1] < (1 - ROUND_OFF) * scene.end_time_s:
        raise SimulationFailed(f"Exudyn stopped short of the end at t = {time[-1]:.6g} s")
    histories = {joint: _stored(model, sensor)[:, 1:] for joint, sensor in model.histories.items()}
    switched = np.append(tree, np.zeros(len(time) - 1, dtype=bool))
    for joint, history in histories.items():
        friction = scene.clearances[joint].friction
        switched[1:] |= np.diff(history[:, GAP] < 0)
        if friction is not None:
            switched[1:] |= np.diff(history[:, SLIDING_SPEED] < friction.regularisation_speed_m_s)
    links, bodies = link_rows(model.branches), len(scene.mechanism.bodies)
    states = model.start + coordinates, rates, accelerations
    return Motion(time, links, bodies, *states, histories, switched, implicit=not tree)


def _stored(model: Model, sensor: int) -> FloatArray:
    """Return all that a sensor recorded, (k, 1 + components), time first, each time once."""
    record = np.asarray(model.mbs.GetSensorStoredData(sensor), dtype=np.float64)
    return np.asarray(record[np.append(np.diff(record[:, 0]) > 0, True)])
