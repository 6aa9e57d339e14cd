"""The energy ledger of a run, line by line, and how far its velocities break the constraints.

Lines are curves over time since t = 0, (n,), in J. What a scene has no use for has no line.
"""

import re

import numpy as np

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.energy import potential_energies_J
from engine_models.mechanics.states import pin_gap, way
from engine_models.scene.scene import Scene
from studies.judges.metrics import kinetic_energy_J

Lines = dict[str, FloatArray]


def stored(scene: Scene, run: Trajectory) -> Lines:
    """Return the energy gained since t = 0: kinetic, gravitational, of springs, elastic in all contacts."""
    energies = {"kinetic": kinetic_energy_J(scene, run), **potential_energies_J(scene, run)}
    return {f"{name}_change_J": energy - energy[0] for name, energy in energies.items()}


def dissipated(run: Trajectory) -> Lines:
    """Return what each contact lost, each of its ways a line of its own: ``contact_B_normal_loss_J``."""
    return {
        f"contact_{joint}_{line}": loss
        for joint, contact in run.contacts.items()
        for line in ("normal_loss_J", "friction_loss_J", "clipped_loss_J")
        if (loss := getattr(contact, line)) is not None
    }


def load_works(run: Trajectory) -> Lines:
    """Return the work of each part of the loads: ``slider_gas_work_J``."""
    of_slider = {part: "" if {".", ":"} & {*part} else "slider_" for part in run.load_work_J}
    names = {part: re.sub("[.:]", "_", part) for part in run.load_work_J}
    return {f"{of_slider[part]}{names[part]}_work_J": work for part, work in run.load_work_J.items()}


def ledger(scene: Scene, run: Trajectory) -> Lines:
    """Return all lines: ``stored``, the works of driver and loads, what is ``dissipated``, or stabilised.

    A scene without a driver has no line of its work, and an engine that does not tell what stabilisation
    removed has none of that.
    """
    given = {"driver_work_J": run.driver_work_J, **load_works(run)}
    stabilised = {"stabilisation_loss_J": run.stabilisation_loss_J}
    lines = {**stored(scene, run), **given, **dissipated(run), **stabilised}
    return {name: line for name, line in lines.items() if line is not None}


def constraint_speed_m_s(scene: Scene, run: Trajectory) -> FloatArray:
    """Return the largest speed at which an ideal joint opens or a body leaves its guide, (n,).

    It is |g'|, the violation at velocity level, where ``metrics.constraint_violation_m`` is |g|. The vector
    counts, not its length's rate: a gap that turns without growing has a speed too.
    """
    of, states = scene.mechanism, (run.position, run.velocity)
    speeds = [np.hypot(*pin_gap(pin, *states)[1].T) for pin in of.ideal]
    speeds += [np.abs(way(guide, *states, across=True)[1]) for guide in of.guides]
    return np.asarray(np.max(speeds, axis=0)) if speeds else np.zeros(len(run.time_s))
