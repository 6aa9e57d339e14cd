"""Ideal, compliant and rigid joints side by side in one mechanism."""

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.engine import RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import clearance_driven_05
from reference_solver.mechanism.contact_laws import ContactLaw, FrictionLaw, RigidWall
from reference_solver.mechanism.mechanism import GROUND, Body, ClearanceJoint, Mechanism, RevoluteJoint
from reference_solver.solution import Solution
from reference_solver.solver import StepChoice, solve
from studies.judges.metrics import energy_balance_residual_J, kinetic_energy_J

FloatArray = NDArray[np.float64]

MASS, INERTIA, GRAVITY = 0.1, 1e-4, 9.81
CLEARANCE, BEARING = 5e-4, 0.01
HERTZ = ContactLaw(1e8, 1.5, damping_factor=0.5)
WALL = RigidWall(0.6)


def bearing(body: int, point: tuple[float, float], law: ContactLaw | RigidWall) -> ClearanceJoint:
    """A bearing on the ground, its centre where the pin is at the start."""
    friction = FrictionLaw("tanh", 0.2, 0.05)
    return ClearanceJoint(GROUND, point, body, point, CLEARANCE, BEARING, law, friction)


def run(mechanism: Mechanism, v: list[float], end_s: float, step: StepChoice, compiled: bool) -> Solution:
    q = np.zeros(3 * len(mechanism.bodies))
    return solve(mechanism, q, np.array(v), end_time_s=end_s, samples=50, step=step, compiled=compiled)


def test_parts_that_do_not_touch_move_as_each_does_alone() -> None:
    disc, hinge = Body(MASS, INERTIA), (-0.1, 0.0)
    thrown, turned = [0.1, 0.0, 3.0], [0.0, 0.2, 2.0]

    def moved(mechanism: Mechanism, v: list[float]) -> Solution:
        # Few steps: what kernels would save, compiling them takes.
        return run(mechanism, v, 0.02, StepChoice(1e-4, 40), compiled=False)

    contacts = bearing(0, (0.0, 0.0), HERTZ), bearing(1, (0.0, 0.0), WALL)
    joint = RevoluteJoint(GROUND, hinge, 2, hinge)
    together = moved(Mechanism((disc,) * 3, (joint,), (), GRAVITY, contacts), thrown + thrown + turned)
    alone = [
        moved(Mechanism((disc,), (), (), GRAVITY, (bearing(0, (0.0, 0.0), law),)), thrown)
        for law in (HERTZ, WALL)
    ]
    alone.append(moved(Mechanism((disc,), (RevoluteJoint(GROUND, hinge, 0, hinge),), (), GRAVITY), turned))
    expected = np.concatenate([one.q for one in alone], axis=1)
    # Events of all cut the steps of each; RK4 takes a flight alike in any, and impacts agree to 1e-14.
    assert np.abs(together.q - expected).max() < 1e-9
    for k in range(2):
        found, wanted = together.impacts_of(k), alone[k].impacts_of(0)
        assert [impact.kind for impact in found] == [impact.kind for impact in wanted]
        assert len(found) > 1
        for one, other in zip(found, wanted, strict=True):
            numbers = one.time_s, one.approach_speed_m_s, one.normal_impulse_N_s, one.energy_lost_J
            expected_numbers = other.time_s, other.approach_speed_m_s, other.normal_impulse_N_s
            assert numbers == pytest.approx((*expected_numbers, other.energy_lost_J), rel=1e-9)


def energy_J(found: Solution, elastic: int) -> FloatArray:
    """Kinetic energy, gravity's, and that of the Hertzian contact of this number; all were zero at a rest."""
    masses = np.array([MASS, MASS, INERTIA])
    kinetic = found.v**2 @ masses / 2
    gap = np.hypot(*np.moveaxis(found.gap_m[:, elastic], -1, 0)) - CLEARANCE
    stored = HERTZ.stiffness * np.where(found.closed[:, elastic], np.maximum(gap, 0.0), 0.0) ** 2.5 / 2.5
    return np.asarray(kinetic + MASS * GRAVITY * found.q[:, 1] + stored)


def test_a_beam_on_a_compliant_and_a_rigid_bearing_closes_its_ledger() -> None:
    beam = Mechanism(
        (Body(MASS, INERTIA),),
        (),
        (),
        GRAVITY,
        (bearing(0, (-0.05, 0.0), HERTZ), bearing(0, (0.05, 0.0), WALL)),
    )
    residuals = []
    for halving in (1, 2):
        step = StepChoice(2e-5, 100).at(2e-5 / halving)
        found = run(beam, [0.0, 0.0, 0.0], 0.05, step, compiled=True)
        assert min(len(found.impacts_of(k)) for k in range(2)) > 3
        energy, lost = energy_J(found, 0), found.losses_J() + found.stabilisation_loss_J
        residuals.append(float(np.abs(energy - energy[0] + lost).max() / lost[-1]))
    assert residuals[1] < 1e-8, "1.3e-9 of what is lost when this was written"
    assert residuals[1] < residuals[0] / 8, f"order four, 15.6 then: {residuals}"


def test_a_pin_at_rest_on_a_rigid_wall_leaves_when_a_compliant_one_lifts_it() -> None:
    spring = ContactLaw(1e6, 1.0)
    pins = [
        ClearanceJoint(GROUND, (0.0, y), 0, (0.0, 0.0), CLEARANCE, BEARING, law)
        for y, law in ((0.0, WALL), (1e-4, spring))
    ]
    disc = Mechanism((Body(MASS, INERTIA),), (), (), GRAVITY, tuple(pins))
    low = np.array([0.0, -CLEARANCE, 0.0])
    found = solve(disc, low, np.zeros(3), end_time_s=1e-4, samples=4, step=1e-5, compiled=False)
    assert not found.mode_changes
    # The spring is pressed by 0.1 mm: 100 N.
    assert found.normal_force_N[0] == pytest.approx([0.0, 1e6 * 1e-4], rel=1e-10)
    # Lifted by 100 N - m g, less what the spring loses in stiffness on the way: omega^2 t^2 / 12.
    lift = (1e6 * 1e-4 / MASS - GRAVITY) * 1e-4**2 / 2
    assert found.q[-1, 1] + CLEARANCE == pytest.approx(lift, rel=1e6 / MASS * 1e-4**2 / 10)


def test_a_scene_may_have_a_compliant_and_a_rigid_bearing() -> None:
    scene = clearance_driven_05()
    soft = scene.clearance.B
    assert soft is not None
    unset = {"young_modulus_Pa": None, "poisson_ratio": None}
    hard = soft.model_copy(update={"law": "rigid", "restitution": 0.5, **unset})
    both = scene.model_copy(update={"clearance": scene.clearance.model_copy(update={"A": hard})})
    found = ReferenceEngine().simulate(both, RunSettings(1e-5, 100))
    assert all(len(found.contacts[name].impacts.time_s) > 3 for name in "AB")
    residual = np.abs(energy_balance_residual_J(both, found)).max()
    # 3e-7 when this was written, the error of the steps.
    assert residual < 3e-6 * kinetic_energy_J(both, found).max()
