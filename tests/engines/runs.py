"""Runs of engines and reference solutions of scenes, each made once a session, and what they tell by name."""

from dataclasses import fields
from functools import cache

import numpy as np

from engine_models.engine import Contact, Engine, FloatArray, Impacts, RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import converged

#: Equal output intervals of the runs that are compared.
SAMPLES = 20
#: What the fields of a contact are; others are energies.
KINDS = {"gap_m": "gap", "penetration_m": "gap", "normal_force_N": "force", "friction_force_N": "force"}
KINDS |= {"normal_impulse_N_s": "impulse"}


@cache
def engine(name: str) -> Engine:
    """Return an engine by its name and, after it, settings: "exudyn solver=RK44"."""
    kind, *settings = name.split()
    return make_engine(kind, **dict(setting.split("=") for setting in settings))


@cache
def true_solution(scene: Scene, samples: int = SAMPLES) -> Trajectory:
    """Return the reference solution, of independent equations where there is one."""
    return converged(scene, samples)[0]


def fresh(name: str, scene: Scene, steps: int, samples: int = SAMPLES) -> Trajectory:
    """Return an engine's run of a scene in so many steps between samples."""
    return engine(name).simulate(scene, RunSettings(scene.end_time_s / samples / steps, samples))


run = cache(fresh)


def numbers(run: Trajectory) -> dict[str, FloatArray]:
    """Return all that a run tells at its n samples, (n,) or more of each, by "KIND NAME"."""
    told: dict[str, FloatArray | None] = {"position": run.position, "velocity": run.velocity}
    told |= {"torque driver": run.driver_torque_N_m, "work driver": run.driver_work_J}
    for kind, by_name in {
        "force": {**run.joint_force_N, **run.guide_force_N},
        "moment": run.guide_moment_N_m,
        "work": run.load_work_J,
    }.items():
        told |= {f"{kind} {name}": value for name, value in by_name.items()}
    for joint, contact in run.contacts.items():
        names = [field.name for field in fields(Contact) if field.name != "impacts"]
        told |= {f"{KINDS.get(name, 'work')} {joint} {name}": getattr(contact, name) for name in names}
    return {name: value for name, value in told.items() if value is not None}


def largest_of_kind(run: Trajectory) -> dict[str, float]:
    """Return the largest size of each number's kind by its name, never zero."""
    sizes = dict[str, float]()
    for name, value in numbers(run).items():
        kind = name.split()[0]
        sizes[kind] = max(sizes.get(kind, 1e-300), float(np.abs(value).max()))
    return {name: sizes[name.split()[0]] for name in numbers(run)}


def errors(run: Trajectory, true: Trajectory, since: int = 0) -> dict[str, float]:
    """Return the largest error of each number from a sample on, as a part of the largest of its kind."""
    own, largest = numbers(run), largest_of_kind(true)
    return {
        name: float(np.abs(own[name] - value)[since:].max()) / largest[name]
        for name, value in numbers(true).items()
        if name in own
    }


def impact_numbers(run: Trajectory) -> dict[str, FloatArray]:
    """Return all that is told of the m impacts of each joint, (m,), by "JOINT FIELD"."""
    names = [field.name for field in fields(Impacts)]
    return {
        f"{joint} {name}": getattr(of.impacts, name) for joint, of in run.contacts.items() for name in names
    }
