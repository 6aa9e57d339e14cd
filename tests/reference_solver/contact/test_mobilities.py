"""The mobilities that limit RK4's steps in contact, and runs whose light links need the right one."""

import numpy as np
import pytest

from engine_models.engine import Contact, RunSettings
from engine_models.engines import make_engine
from engine_models.mechanics.assembly import start_state
from engine_models.reference.model import mechanism_of
from reference_solver.equations import Equations
from reference_solver.mechanism.points import State, ends_of
from tests.random_scenes.recipe import random_scene

SAMPLES = 200
#: Seeds of the recipe with friction at several joints; of a crank of 70 mg that rubs; of a slider of 0.3 g
#: whose pins follow rigid walls.
SEVERAL, RUBBING, FOLLOWING = (20, 23), 2, 5


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


def test_friction_on_a_light_crank_is_followed_at_the_default_step() -> None:
    # With the mobility along the normal in place of that of sliding, forces are off by all of their size.
    scene = random_scene(RUBBING, rigid=False)
    plain, sharp = (run.contacts["O"] for run in _runs(RUBBING, rigid=False))
    assert scene.crank.mass_kg < 1e-4
    assert _off(plain, sharp, "normal_force_N") < 1e-4
    assert _off(plain, sharp, "friction_force_N") < 1e-4


def test_a_pin_that_follows_a_rigid_wall_swings_at_its_own_frequency() -> None:
    plain, sharp = _runs(FOLLOWING, rigid=True)
    least = random_scene(FOLLOWING, rigid=True).clearance.A
    assert least is not None
    # Without that frequency's limit on the step the slider is off by 0.7 of the clearance in such scenes.
    off = np.abs(plain.slider_position_m - sharp.slider_position_m).max()
    assert off < 1e-4 * least.radial_clearance_m


def _runs(seed: int, rigid: bool):  # type: ignore[no-untyped-def]
    scene = random_scene(seed, rigid)
    yield make_engine("reference").simulate(scene, RunSettings(1e-5, SAMPLES))
    sharp = make_engine("reference", method="dop853", tolerance=1e-12)
    yield sharp.simulate(scene, RunSettings(scene.end_time_s, SAMPLES))


def _off(one: Contact, other: Contact, name: str) -> float:
    """Return the largest difference of a signal, as a part of the largest value of it."""
    value, true = getattr(one, name), getattr(other, name)
    return float(np.abs(value - true).max() / np.abs(true).max())
