"""Exudyn's runs as trajectories: forces, works and contacts follow from the motion that it recorded."""

import numpy as np

from engine_models.engine import BareRun, FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.exudyn.contact import contact_record
from engine_models.exudyn.engine import IMPLICIT, ExudynEngine
from engine_models.exudyn.model import Model
from engine_models.exudyn.motion import GAP, SLIDING_SPEED, Motion, bodies_at, integral, link_rows, trapezoids
from engine_models.exudyn.solver import silence, simulation_settings, solve
from engine_models.mechanics.forces import (
    contact_states,
    driven_speeds,
    integrals_of,
    powers_W,
    reactions,
    works_J,
)
from engine_models.mechanics.trajectory import Reactions
from engine_models.scene.scene import Scene
from reference_solver.mechanism.data import MechanismData

#: The end of a run is off by no more than this part of it.
ROUND_OFF = 1e-9


def exudyn_run(engine: ExudynEngine, scene: Scene, run: RunSettings) -> Trajectory:
    """Run a scene that the engine supports; numbers may come out that are not finite.

    Samples of runs with steps as they come lie between steps (see ``Motion``).

    Raises:
        SimulationFailed: Exudyn gave up, stopped short or ran out of time.
    """
    tree, of = engine.solver_of(scene) not in IMPLICIT, engine.twin(scene).mechanism
    as_they_come, integrals = engine.steps_as_they_come(scene), integrals_of(scene).values()
    every = 1 if as_they_come or integrals else run.steps_per_sample(scene.end_time_s)
    with silence(), np.errstate(all="ignore"):  # require_finite is the judge
        model, solve_time_s = _solved(engine, scene, run, every)
        motion = _recorded(scene, model, tree)
        time, recorded = run.times_s(scene), len(motion.time_s) - 1
        sampled_s = time if as_they_come else motion.time_s[:: recorded // run.samples]
        grid = np.union1d(motion.time_s, sampled_s)

        def powers(at: FloatArray) -> FloatArray:
            moved = motion.at(at)
            found = powers_W(scene, at, *moved[:2])
            if of.drive.prescribes:
                torque = _reactions(of, motion, at, moved).driver_torque_N_m
                assert torque is not None
                found["driver"] = torque * driven_speeds(of, at)
            return np.stack([found[name] for name in integrals])

        works = dict[str, FloatArray]()
        if integrals:
            sums = integral(grid, powers) if tree else trapezoids(grid, powers(grid))
            works = dict(zip(integrals, sums[:, np.searchsorted(grid, sampled_s)], strict=True))
        position, velocity, _ = moved = motion.at(sampled_s)
        works = works_J(scene, position, works)
        return Trajectory(
            **vars(_reactions(of, motion, sampled_s, moved)),
            time_s=time,
            position=position,
            velocity=velocity,
            driver_work_J=works.pop("driver", None),
            step_s=run.step_used_s(scene.end_time_s),
            steps=recorded * every,
            solve_time_s=solve_time_s,
            contacts={
                pin.name: contact_record(motion, pin, scene.clearances[pin.name], sampled_s)
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
        q = (model.start + np.concatenate(ends))[:, None]
        links, bodies = link_rows(model.branches), len(model.of.bodies)
        return BareRun(solve_time_s, bodies_at(links, bodies, q, q, q)[0][0])  # rates change no position


def _solved(engine: ExudynEngine, scene: Scene, run: RunSettings, every: int) -> tuple[Model, float]:
    """Return a model that has run, and the time of the solve; one in ``every`` equal steps is recorded."""
    model = Model(scene, engine.solver_of(scene) not in IMPLICIT)
    settings = simulation_settings(engine, scene, run, every)
    return model, solve(model.mbs, settings, engine.timeout_s)


def _reactions(
    of: MechanismData, motion: Motion, time_s: FloatArray, moved: tuple[FloatArray, FloatArray, FloatArray]
) -> Reactions:
    """Return all forces at times (n,), by the motion then."""
    touches = {pin.name: motion.approach_m_s(pin.name, time_s) for pin in of.loose}
    contacts = {pin.name: contact_states(pin, *moved[:2], touches[pin.name]) for pin in of.loose}
    return reactions(of, time_s, *moved, contacts)


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
