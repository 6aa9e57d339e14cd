"""Contacts of the truth by closed forms: one body in one loose pin, which nothing else moves."""

import math

import numpy as np
import pytest
from scipy.special import lambertw

from engine_models.engine import RunSettings, UnsupportedScene
from studies.truth.physics import damping_of
from studies.truth.solver import TrueSolver
from tests.engines.mechanism_texts import scene
from tests.helpers.random_scenes import WITH_RESTITUTION

#: Approach speed in m/s, stiffness in N/m^n, clearance in m and mass in kg.
SPEED, STIFFNESS, ROOM, MASS = 1.5, {1.0: 1e8, 1.5: 1e10}, 1e-3, 0.3
METHODS = (TrueSolver("collocation", 1e-13), TrueSolver("extrapolation", 1e-14))


def bounced(solver: TrueSolver, law: str, **constants: float) -> tuple[float, float, float]:
    """Return the speed back of a disc that flies at its bearing's wall, how long it touches, and its spin."""
    numbers = "".join(f"{name} = {value}\n" for name, value in constants.items())
    of = scene(f"""
name = "disc"
end_time_s = {1.5 * ROOM / SPEED}
observe = "O.x"
ground.pins_m = {{ O = 0.0 }}
body.disc = {{ pins_m = {{ O = 0.0 }}, mass_kg = {MASS}, inertia_kg_m2 = 1e-4 }}
[start.disc]
x_m = 0.0
y_m = 0.0
angle_rad = 0.3
velocity_x_m_s = {0.6 * SPEED}
velocity_y_m_s = {0.8 * SPEED}
angular_velocity_rad_s = 2.0
[clearance.O]
radial_clearance_m = {ROOM}
bearing_radius_m = 0.01
law = "{law}"
{numbers}""")
    run = solver.simulate(of, RunSettings(1.0, 20))
    impacts = run.contacts["O"].impacts
    assert len(impacts.time_s) == 1
    assert impacts.time_s[0] == pytest.approx(ROOM / SPEED, rel=1e-13)
    back = -float(run.velocity[-1, 0, :2] @ (0.6, 0.8))
    lost = MASS * (SPEED**2 - back**2) / 2
    assert impacts.energy_lost_J[0] == pytest.approx(lost, abs=1e-12 * MASS * SPEED**2)
    assert impacts.normal_impulse_N_s[0] == pytest.approx(MASS * (SPEED + back), rel=1e-12)
    return back, float(impacts.duration_s[0]), float(run.velocity[-1, 0, 2])


@pytest.mark.parametrize("solver", METHODS, ids=lambda solver: solver.method)
@pytest.mark.parametrize("law", WITH_RESTITUTION)
def test_a_bounce_has_the_restitution_of_its_law(law: str, solver: TrueSolver) -> None:
    """e_out = [1 + W0(-(1 + a) exp(-(1 + a)))]/a, whatever mass and stiffness."""
    a = damping_of(law, 0.7)
    expected = (1 + lambertw(-(1 + a) * math.exp(-(1 + a))).real) / a
    back, _, spin = bounced(solver, law, restitution=0.7, stiffness=STIFFNESS[1.5])
    assert back / SPEED == pytest.approx(expected, rel=1e-12)
    assert spin == 2.0


@pytest.mark.parametrize("solver", METHODS, ids=lambda solver: solver.method)
def test_bounces_without_restitution_last_as_long_as_they_do(solver: TrueSolver) -> None:
    """A half-wave of a spring, Hertz's 2.94327518 delta_max/v0, the damped wave of Kelvin and Voigt."""
    rate = math.sqrt(STIFFNESS[1.0] / MASS)
    back, lasted, _ = bounced(solver, "linear", stiffness=STIFFNESS[1.0])
    assert back == pytest.approx(SPEED, rel=1e-12)
    assert lasted == pytest.approx(math.pi / rate, rel=1e-10)
    back, lasted, _ = bounced(solver, "hertz", stiffness=STIFFNESS[1.5])
    deepest = (5 * MASS * SPEED**2 / (4 * STIFFNESS[1.5])) ** 0.4
    assert back == pytest.approx(SPEED, rel=1e-12)
    assert lasted == pytest.approx(2.94327518 * deepest / SPEED, rel=1e-8)  # the digits given
    zeta = 0.2
    damping = 2 * zeta * rate * MASS
    back, lasted, _ = bounced(solver, "kelvin-voigt", stiffness=STIFFNESS[1.0], damping_N_s_m=damping)
    assert back / SPEED == pytest.approx(math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)), rel=1e-12)
    assert lasted == pytest.approx(math.pi / rate / math.sqrt(1 - zeta**2), rel=1e-10)


def test_a_rigid_wall_gives_newton_s_restitution() -> None:
    back, lasted, _ = bounced(METHODS[0], "rigid", restitution=0.7)
    assert back == pytest.approx(0.7 * SPEED, rel=1e-14)
    assert lasted == 0.0


def test_a_start_that_is_open_or_in_a_rigid_wall_is_refused() -> None:
    text = """
name = "disc"
end_time_s = 0.01
observe = "O.x"
ground.pins_m = { O = 0.0 }
body.disc = { pins_m = { O = 0.0 }, mass_kg = 0.3, inertia_kg_m2 = 1e-4 }
start.disc = { x_m = 2e-3, y_m = 0.0, angle_rad = 0.0, velocity_x_m_s = 0.0, velocity_y_m_s = 0.0, \
angular_velocity_rad_s = 0.0 }
clearance.O = { radial_clearance_m = 1e-3, bearing_radius_m = 0.01, law = "rigid", restitution = 0.5 }
"""
    with pytest.raises(UnsupportedScene, match="begins in its rigid wall"):
        METHODS[0].simulate(scene(text), RunSettings(1.0, 1))
    assert np.isfinite(
        METHODS[0].simulate(scene(text, start__disc__x_m=5e-4), RunSettings(1.0, 1)).position
    ).all()
