"""Ideal mechanisms: drift, the energy that stabilisation removes, and round-off."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.engine import RunSettings, Trajectory
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.run import mechanism_of
from engine_models.scene.library import IDEAL_SCENES
from engine_models.scene.scene import Scene
from reference_solver.equations import Equations
from reference_solver.mechanism.contacts import CLIPPED, CONTACT, ClearanceJoint, ContactLaw
from reference_solver.mechanism.data import GROUND, Body, Pin, Spring
from reference_solver.mechanism.loads import Constant, Torque
from reference_solver.mechanism.mechanism import Mechanism
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J
from tests.helpers.mechanism_energy import kinetic_energy_J as kinetic_J
from tests.helpers.mechanism_energy import place, potential_energy_J

FloatArray = NDArray[np.float64]
SAMPLES = 200
EPS = float(np.finfo(float).eps)


def run(name: str, stabilisation: str, step: float, end_time_s: float) -> tuple[Scene, Trajectory]:
    scene = IDEAL_SCENES[name]().replace("end_time_s", end_time_s)
    engine = ReferenceEngine(stabilisation=stabilisation)  # type: ignore[arg-type]
    return scene, engine.simulate(scene, RunSettings(step, SAMPLES))


def test_energy_and_joints_hold_to_round_off_at_a_fine_step() -> None:
    scene, found = run("ideal-driven", "projection", 1.2e-7, 0.024)
    residual = np.abs(energy_balance_residual_J(scene, found)).max()
    # The sums of the steps are compensated: the energy keeps some units in the last place. The driver's work
    # is a plain sum, which walks at random by up to one with every step. Truncation is below both.
    assert found.driver_work_J is not None
    walk = 2 * np.sqrt(found.steps) * np.abs(found.driver_work_J).max()
    assert residual < EPS * (50 * kinetic_energy_J(scene, found).max() + walk)
    assert constraint_violation_m(scene, found).max() < 1e-15


@cache
def drift(stabilisation: str) -> tuple[FloatArray, FloatArray]:
    """Return the largest |g| and |g'| (2,) of a free run of 3 s, and at what powers of t they grow."""
    scene, found = run("ideal-free", stabilisation, 2.5e-4, 3.0)
    equations, late = Equations(mechanism_of(scene), found.position[0].ravel()), slice(SAMPLES // 10, None)
    off = []
    for q, v in zip(found.position.reshape(-1, 9), found.velocity.reshape(-1, 9), strict=True):
        rates = equations.system(0.0, q).B @ v
        off.append([np.abs(equations.system(0.0, q).g).max(), np.abs(rates).max()])
    largest = np.maximum.accumulate(off)
    return largest[-1], np.polyfit(np.log(found.time_s[late]), np.log(largest[late]), 1)[0]


def test_the_papers_own_algorithm_drifts_which_baumgarte_bounds_and_projection_removes() -> None:
    # The oscillation within a revolution (1/30 of the span) moves the fitted powers by less than 0.1.
    (plain, _), growth = drift("none")
    assert growth == pytest.approx([2, 1], abs=0.1)
    (bounded, _), growth = drift("baumgarte")
    assert growth[0] < 0.1
    assert bounded < 1e-3 * plain
    (g, g_rate), _ = drift("projection")
    assert g < 1e-14, f"|g| = {g:.2e} m"  # one Newton step squares a violation near 1e-10
    assert g_rate < 1e-13, f"|g'| = {g_rate:.2e} m/s"  # round-off of a few m/s


def energy(mechanism: Mechanism, q: FloatArray, v: FloatArray) -> Any:
    """Return kinetic, gravitational and elastic energy less the torques' work, a ``np.longdouble``."""
    states: list[Any] = [part.astype(np.longdouble)[None] for part in (q, v)]
    (total,) = kinetic_J(mechanism, states[1]) + potential_energy_J(mechanism, states[0])
    for joint in mechanism.contacts:
        law, reach = joint.law, place(states[0], joint.body_j, joint.point_j) - np.array(joint.point_i)
        depth = max(np.sqrt((reach**2).sum()) - joint.radial_clearance_m, np.longdouble(0))
        total += law.stiffness * depth ** (law.exponent + 1) / (law.exponent + 1)
    return total


@pytest.mark.parametrize("phase", [CONTACT, CLIPPED])
def test_what_a_projection_removes_is_the_energy_before_less_that_after(phase: float) -> None:
    """A loaded double pendulum, its pin deep in a wall, is moved onto its joints from 1e-6 m beside."""
    joints = (Pin(GROUND, (0.0, 0.0), 0, (-0.5, 0.0)), Pin(0, (0.5, 0.0), 1, (-0.4, 0.1)))
    pin = ClearanceJoint(GROUND, (1.5, 0.2), 1, (0.3, -0.1), 0.1, 0.5, ContactLaw(1e3, 1.5, 0.5))
    loads = Torque(1, Constant(3.0)), Spring(GROUND, (0.5, 0.7), 1, (0.1, 0.2), 300.0, 2.0, 0.3)
    mechanism = Mechanism((Body(1.0, 0.1), Body(2.0, 0.3)), joints, loads, 9.81, (pin,))
    q, v = np.array([0.5, 0.0, 0.0, 1.4, -0.1, 0.0]), np.zeros(6)
    equations, random = Equations(mechanism, q), np.random.default_rng(5)
    q, v = q + random.uniform(-1e-6, 1e-6, 6), v + random.uniform(-1e-3, 1e-3, 6)
    moved_q, moved_v, counted, ok = equations.project(0.0, q, v, np.array([[phase, 2.0]]))
    assert ok
    assert np.abs(moved_q - q).max() > 1e-7
    # Neglected: the stiffness of springs times the square of the moves.
    removed = float(energy(mechanism, q, v) - energy(mechanism, moved_q, moved_v))
    assert counted == pytest.approx(removed, rel=1e-4)
    without = equations.project(0.0, q, v)[2]
    assert abs(without - counted) > 0.01 * abs(counted), "the wall's energy is part of it"
