"""The mobilities that limit RK4's steps in contact, and runs whose light links need the right one."""

import numpy as np
import pytest

from engine_models.engine import RunSettings, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.assembly import start_state
from engine_models.mechanics.equations import mechanism_of
from engine_models.scene.scene import Scene
from reference_solver.equations import Equations
from reference_solver.mechanism.points import State, ends_of
from tests.helpers.random_scenes import random_scene

SAMPLES = 200
#: Seeds of the recipe with clearance at several joints, and friction.
SEVERAL = (20, 23)


@pytest.mark.parametrize("seed", SEVERAL)
def test_a_mobility_is_the_speed_that_a_unit_impulse_makes(seed: int) -> None:
    scene = random_scene(seed, rigid=False)
    mechanism, q = mechanism_of(scene), start_state(scene)[0].ravel() + 1e-4
    equations = Equations(mechanism, q)
    M, B = np.diag(equations.mass), equations.constraint_matrix(q)
    rows = len(B)
    # [M]v - [B]^T p = the impulse, [B]v = 0: impulses of the joints solved for, none eliminated.
    whole = np.block([[M, -B.T], [B, np.zeros((rows, rows))]])
    found = np.reshape(equations.mobilities(q), (-1, 3))
    for joint, mobilities in zip(mechanism.contacts, found, strict=True):
        bearing, pin = ends_of(joint, State(q, np.zeros_like(q)))
        n = (pin.place - bearing.place) / np.hypot(*(pin.place - bearing.place))
        t = np.array([-n[1], n[0]])
        for way, mobility in zip((n, None, t), mobilities, strict=True):
            if way is None and joint.friction is None:
                assert mobility == 0
                continue
            push = np.zeros(len(q) + rows)
            radii = joint.bearing_radius_m, joint.bearing_radius_m - joint.radial_clearance_m
            for point, sign, radius in zip((bearing, pin), (-1.0, 1.0), radii, strict=True):
                if point.body >= 0:
                    force = sign * (t if way is None else way)
                    twist = point.lever[0] * force[1] - point.lever[1] * force[0]
                    twist += sign * radius if way is None else 0.0
                    push[3 * point.body : 3 * point.body + 3] += [*force, twist]
            speeds = np.linalg.solve(whole, push)[: len(q)]
            assert push[: len(q)] @ speeds == pytest.approx(mobility, rel=1e-9)


def light_crank(mass_kg: float, contact: dict[str, object], speed_rad_s: float, end_s: float) -> Scene:
    """Return a light crank between a heavy rod and a pivot with clearance, free to move."""
    J = 0.1 * mass_kg * 0.05**2
    crank = {"length_m": 0.05, "mass_kg": mass_kg, "inertia_kg_m2": J, "centre_of_mass_m": 0.025}
    rod = {"length_m": 0.15, "mass_kg": 1.0, "inertia_kg_m2": 2e-3, "centre_of_mass_m": 0.07}
    return Scene.model_validate(
        {
            "name": "light-crank",
            "end_time_s": end_s,
            "gravity_m_s2": 9.81,
            "crank": crank,
            "rod": rod,
            "slider": {"mass_kg": 1.0, "inertia_kg_m2": 1e-4},
            "start": {"crank_angle_rad": 0.5, "crank_speed_rad_s": speed_rad_s},
            "drive": {"kind": "free"},
            "clearance": {"O": {"radial_clearance_m": 1e-4, "bearing_radius_m": 0.01, **contact}},
        }
    )


def test_friction_on_a_light_crank_is_followed() -> None:
    friction = {"law": "tanh", "coefficient": 0.3, "regularisation_speed_m_s": 1e-3}
    soft = {"law": "kelvin-voigt", "stiffness": 1e5, "damping_N_s_m": 2e3, "friction": friction}
    plain, sharp = runs(light_crank(1e-3, soft, 2.0, 0.04), step_s=1e-4)
    # With the mobility along the normal in place of that of sliding, friction is off by 12 % of its size.
    for name in ("normal_force_N", "friction_force_N"):
        value, true = getattr(plain.contacts["O"], name), getattr(sharp.contacts["O"], name)
        assert np.abs(value - true).max() < 1e-5 * np.abs(true).max()


def test_a_pin_that_follows_a_rigid_wall_swings_at_its_own_frequency() -> None:
    plain, sharp = runs(light_crank(1.4e-3, {"law": "rigid", "restitution": 0.0}, 60.0, 0.02), step_s=1e-5)
    # Without that frequency's limit on the step the slider is off by a thousand clearances.
    assert np.abs(plain.position[:, -1, 0] - sharp.position[:, -1, 0]).max() < 1e-3 * 1e-4


def runs(scene: Scene, step_s: float) -> tuple[Trajectory, Trajectory]:
    """Return RK4's run at a step, and that of DOP853 near round-off."""
    plain = make_engine("reference").simulate(scene, RunSettings(step_s, SAMPLES))
    sharp = make_engine("reference", method="dop853", step_tolerance=1e-11)
    return plain, sharp.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))
