"""Sums of forces and torques against the equations that the reference solves, Newton's laws, and statics."""

from functools import cache

import numpy as np
import pytest

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.forces import accelerations, on_ground
from engine_models.mechanics.states import lever_m
from engine_models.reference.run import mechanism_of
from engine_models.scene.scene import Scene
from reference_solver.equations import Equations
from reference_solver.mechanism.contacts import CONTACT, FLIGHT
from reference_solver.mechanism.mechanism import Mechanism
from tests.engines.runs import run
from tests.scenes import scene

#: Round-off of forces and accelerations, in parts of the largest.
ROUND_OFF = 1e-9
#: Scenes with all kinds of parts, and steps between samples of runs that others look at, too.
STEPS = {"everything": 27, "yoke": 27, "bead": 27, "bearing": 243, "loop": 243}


def phases_of(of: Mechanism, run: Trajectory, sample: int) -> FloatArray:
    """Return phase and memory of every contact: the memory is that of the last touch."""
    phases = np.full((len(of.contacts), 2), FLIGHT)
    for k, (joint, contact) in enumerate(zip(of.contacts, run.contacts.values(), strict=True)):
        touches = contact.impacts
        before = touches.time_s <= run.time_s[sample]
        if contact.normal_force_N[sample]:
            factor = joint.law.damping_factor
            phases[k] = CONTACT, factor and factor / touches.approach_speed_m_s[before][-1]
    return phases


@cache
def ran(name: str) -> tuple[Scene, Trajectory, FloatArray]:
    """Return a scene, its run, and the accelerations (n, bodies, 3) that equations have in its states."""
    of = scene(name)
    found, mechanism = run("reference", of, STEPS[name]), mechanism_of(of)
    n, *shape = found.position.shape
    q, v = found.position.reshape(n, -1), found.velocity.reshape(n, -1)
    equations = Equations(mechanism, q[0])
    accelerated = [
        equations.required(float(found.time_s[k]), q[k], v[k], phases_of(mechanism, found, k)).accelerations
        for k in range(n)
    ]
    return of, found, np.reshape(accelerated, (n, *shape))


def ground_of(of: Scene, run: Trajectory) -> FloatArray:
    """Return force and torque (n, 3) on the ground."""
    return on_ground(of, run, accelerations(of, run))


def close(found: FloatArray, true: FloatArray, scale: float | np.floating) -> None:
    np.testing.assert_allclose(found, true, rtol=0, atol=ROUND_OFF * float(scale))


@pytest.mark.parametrize("name", STEPS)
def test_what_acts_on_bodies_accelerates_them_as_the_solver_says(name: str) -> None:
    of, run, true = ran(name)
    found = accelerations(of, run)
    for part in (slice(0, 2), slice(2, 3)):
        close(found[..., part], true[..., part], np.abs(true[..., part]).max())


@pytest.mark.parametrize("name", STEPS)
def test_the_ground_feels_the_bodies_weights_and_inertia(name: str) -> None:
    """By hand: the sums of m (g - a) and of their moments about the origin, less I alpha."""
    of, run, a = ran(name)
    masses = np.array([body.mass_kg for body in of.mechanism.bodies])
    inertias = np.array([body.inertia_kg_m2 for body in of.mechanism.bodies])
    own = masses[:, None] * (np.array(of.mechanism.gravity_m_s2) - a[..., :2])
    x, y = run.position[..., 0], run.position[..., 1]
    moment = (x * own[..., 1] - y * own[..., 0] - inertias * a[..., 2]).sum(axis=1)
    forces = [*run.joint_force_N.values(), *run.guide_force_N.values()]
    ground, largest = ground_of(of, run), max(np.abs(force).max() for force in forces)
    close(ground[:, :2], own.sum(axis=1), largest)
    close(ground[:, 2], moment, largest * lever_m(of))
