"""Loose pins of the truth by closed forms: bounces of one body by every law, flights between, energies."""

import math

import numpy as np
import pytest
from scipy.special import lambertw

from engine_models.engine import AdapterCannot, RunSettings
from engine_models.engines import make_engine
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.minimal.model import damping_of
from engine_models.scene.file import from_toml
from reference_solver.mechanism.contacts import DAMPING_FACTORS
from studies.judges.converged_truth import CONFIRMING, REFERENCE, TRUE, truth_by
from studies.judges.metrics import constraint_violation_m
from tests.engines.runs import errors, numbers, true_solution
from tests.helpers.starts import started_from
from tests.scenes import NAMES, scene

#: Approach speed in m/s, stiffness in N/m^n, clearance in m and mass in kg.
SPEED, STIFFNESS, ROOM, MASS = 1.5, {1.0: 1e8, 1.5: 1e10}, 1e-3, 0.3
SPIN, INERTIA = 2.0, 1e-4
#: A disc alone in its bearing, in numbers that are told, and the law of its wall.
DISC = """
name = "disc"
end_time_s = {end_s}
observe = "O.x"
ground.pins_m = {{ O = 0.0 }}
body.disc = {{ pins_m = {{ O = 0.0 }}, mass_kg = {mass}, inertia_kg_m2 = 1e-4 }}
[start.disc]
x_m = {x_m}
y_m = 0.0
angle_rad = 0.3
velocity_x_m_s = {u}
velocity_y_m_s = {v}
angular_velocity_rad_s = 2.0
[clearance.O]
radial_clearance_m = {room}
bearing_radius_m = 0.01
law = "{law}"
{numbers}"""


def bounced(law: str, **constants: float | str) -> tuple[float, float, float]:
    """Return the speed back of a disc that flies at its bearing's wall, how long it touches, and its spin."""
    told = "".join(f"{name} = {value}\n" for name, value in constants.items())
    flight = {"end_s": 1.5 * ROOM / SPEED, "x_m": 0.0, "u": 0.6 * SPEED, "v": 0.8 * SPEED}
    of = from_toml(DISC.format(**flight, mass=MASS, room=ROOM, law=law, numbers=told))
    run = TRUE.simulate(of, RunSettings(1.0, 20))
    impacts = run.contacts["O"].impacts
    assert len(impacts.time_s) == 1
    assert impacts.time_s[0] == pytest.approx(ROOM / SPEED, rel=1e-13)
    (back, along), spin = [[-0.6, -0.8], [-0.8, 0.6]] @ run.velocity[-1, 0, :2], float(run.velocity[-1, 0, 2])
    lost = (MASS * (SPEED**2 - back**2 - along**2) + INERTIA * (SPIN**2 - spin**2)) / 2
    assert impacts.energy_lost_J[0] == pytest.approx(lost, abs=1e-12 * MASS * SPEED**2)
    assert impacts.normal_impulse_N_s[0] == pytest.approx(MASS * (SPEED + back), rel=1e-12)
    assert MASS * along * (0.01 - ROOM) == pytest.approx(INERTIA * (spin - SPIN), abs=1e-15), (
        "one push does both"
    )
    return float(back), float(impacts.duration_s[0]), spin


@pytest.mark.parametrize("law", DAMPING_FACTORS)
def test_a_bounce_has_the_restitution_of_its_law(law: str) -> None:
    """e_out = [1 + W0(-(1 + a) exp(-(1 + a)))]/a, whatever mass and stiffness."""
    a = damping_of(law, 0.7)
    expected = (1 + lambertw(-(1 + a) * math.exp(-(1 + a))).real) / a
    back, _, spin = bounced(law, restitution=0.7, stiffness=STIFFNESS[1.5])
    assert back / SPEED == pytest.approx(expected, rel=1e-12)
    assert spin == pytest.approx(SPIN, rel=1e-13)


def test_bounces_without_restitution_last_as_long_as_they_do() -> None:
    """A half-wave of a spring, Hertz's 2.94327518 delta_max/v0, the damped wave of Kelvin and Voigt."""
    rate = math.sqrt(STIFFNESS[1.0] / MASS)
    back, lasted, _ = bounced("linear", stiffness=STIFFNESS[1.0])
    assert back == pytest.approx(SPEED, rel=1e-12)
    assert lasted == pytest.approx(math.pi / rate, rel=1e-10)
    back, lasted, _ = bounced("hertz", stiffness=STIFFNESS[1.5])
    deepest = (5 * MASS * SPEED**2 / (4 * STIFFNESS[1.5])) ** 0.4
    assert back == pytest.approx(SPEED, rel=1e-12)
    assert lasted == pytest.approx(2.94327518 * deepest / SPEED, rel=1e-8)  # the digits given
    zeta = 0.2
    damping = 2 * zeta * rate * MASS
    back, lasted, _ = bounced("kelvin-voigt", stiffness=STIFFNESS[1.0], damping_N_s_m=damping)
    assert back / SPEED == pytest.approx(math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2)), rel=1e-12)
    assert lasted == pytest.approx(math.pi / rate / math.sqrt(1 - zeta**2), rel=1e-10)


def test_a_rigid_wall_gives_newtons_restitution() -> None:
    back, lasted, spin = bounced("rigid", restitution=0.7)
    assert back == pytest.approx(0.7 * SPEED, rel=1e-13)
    assert lasted == 0.0
    assert spin == pytest.approx(SPIN, rel=1e-13)


@pytest.mark.parametrize("numbers", ["restitution = 0.0", "restitution = 0.5"])
def test_a_pin_that_follows_or_rubs_on_its_rigid_wall_is_left_to_the_reference(numbers: str) -> None:
    flight = {"end_s": 0.01, "x_m": 0.0, "u": 0.6, "v": 0.8, "mass": MASS, "room": ROOM, "law": "rigid"}
    friction = "friction = { law = 'tanh', coefficient = 0.1, regularisation_speed_m_s = 1e-3 }\n"
    of = from_toml(DISC.format(**flight, numbers=f"{numbers}\n{friction if '5' in numbers else ''}"))
    with pytest.raises(AdapterCannot, match=r"follows its rigid wall|rubs"):
        TRUE.simulate(of, RunSettings(1.0, 1))
    assert truth_by(of, 4) == REFERENCE


#: Parts of the largest of a kind: stiff contacts make 1e-8 of a force of what the motion is off by; the
#: reference's steps end near the kinks of a table by an angle, not on them (measured 1.2e-9 of a work).
APART = {
    "tabled": 5e-9,
    "rubbing": 1e-7,
    "bearing": 1e-7,
    "loop": 1e-6,
    "linear": 1e-7,
    "rigid": 1e-9,
    "walls": 1e-7,
}
#: Of the energy in play: four stiff pins magnify what a step is off by, and so does one (measured 1.1e-12).
LEDGER = {"loop": 2e-10, "bearing": 3e-12}


@pytest.mark.parametrize("name", [name for name in NAMES if name != "fold"])
def test_both_formulations_agree_and_close_the_ledger_and_the_joints(name: str) -> None:
    of, run = scene(name), true_solution(scene(name))
    other = CONFIRMING.simulate(of, RunSettings(of.end_time_s, len(run.time_s) - 1))
    assert numbers(other).keys() == numbers(run).keys()
    apart = {key: error for key, error in errors(other, run).items() if error > APART.get(name, 1e-11)}
    assert {key: error for key, error in apart.items() if not key.startswith("moment")} == {}
    for solution in (run, other):
        left = np.abs(energy_balance_residual_J(of, solution)).max()
        assert left < LEDGER.get(name, 1e-12) * energy_in_play_J(of, solution)
        assert constraint_violation_m(of, solution).max() < 1e-15


@pytest.mark.parametrize("name", ["loop", "linear"])
def test_exudyn_s_own_model_moves_alike(name: str) -> None:
    """Its equations, contacts and integration share no line with these."""
    exudyn = make_engine("exudyn", solver="DOPRI5", step_tolerance=1e-11)
    run = exudyn.simulate(scene(name), RunSettings(1e-5, 20))
    assert np.abs(run.position - true_solution(exudyn.twin(scene(name))).position).max() < 1e-11


def test_a_scene_begun_on_its_way_goes_on_as_before() -> None:
    whole = true_solution(scene("bearing"))
    flies = whole.contacts["B"].penetration_m < 0
    at = int(np.flatnonzero(flies[:-1])[-1])
    now = float(whole.time_s[at])
    state = whole.position[at], whole.velocity[at], now, scene("bearing").end_time_s - now
    rest = true_solution(started_from(scene("bearing"), *state), 1)
    off = np.abs(rest.position[-1] - whole.position[-1]).max()
    assert off < 1e-13, f"off by {off:.1e}"  # round-off of the states, magnified by an impact or two
