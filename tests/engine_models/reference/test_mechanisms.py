"""Any mechanism in the reference against independent truths, peers, closed forms and balances of its own."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from engine_models.convergence.step_halving import simulate_to_tolerance
from engine_models.engine import FloatArray, RunSettings, Trajectory
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.mechanics.quality import constraint_violation_m
from engine_models.mechanics.states import lever_m
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.parts import AnyScene
from tests.engines.mechanism_texts import ENDS, PARALLELOGRAM, TEXTS, four_bars, scene
from tests.helpers.arrays import joint_forces
from tests.helpers.orders import ORDER_TOLERANCE, slope

SHARP, RK4 = ReferenceEngine(method="dop853", step_tolerance=1e-12), ReferenceEngine()
#: What DOP853 at 1e-12, and RK4 in 4000 steps, were off by when such runs were first made, by other programs.
#: The offset crank-slider was not among them; its numbers are the other one's.
MEASURED = {
    "crank-slider": (1.0e-11, 4.1e-7),
    "offset-crank-slider": (1.0e-11, 4.1e-7),
    "four-bar": (1.5e-12, 4.3e-11),
    "andrews": (1.2e-12, 3.6e-11),
    "scotch-yoke": (2.2e-13, 8.1e-12),
    "quick-return": (8.1e-13, 6.5e-11),
    "v-twin": (4.2e-13, 2.7e-13),
    "four-bar-clearance": (8.4e-11, np.inf),
    "crank-slider-clearance": (1e-12, np.inf),
}
#: Other compilers, and other steps by a hair, change errors by less than this.
MARGIN = 3.0
#: How far in s, and from how many steps of RK4 on, errors fall as h^4 and are far above round-off: in longer
#: runs of what is free, errors of the energy, of order 5, grow with the square of time and are in front.
ORDERLY = {
    "crank-slider": (0.1, 500),
    "offset-crank-slider": (0.1, 500),
    "four-bar": (0.5, 500),
    "andrews": (0.01, 500),
    "scotch-yoke": (0.3, 1000),
    "quick-return": (0.1, 60),
    "v-twin": (0.2, 250),
}
#: What runs by DOP853 at 1e-12 leave of the energy in play.
LEDGER = 1e-9


@cache
def sharp(name: str, samples: int = 20) -> tuple[AnyScene, Trajectory]:
    """Return a mechanism of the texts and its run."""
    of = scene(TEXTS[name])
    return of, SHARP.simulate(of, RunSettings(of.end_time_s, samples))


def off(of: AnyScene, name: str, run: Trajectory) -> float:
    """Return the largest error of places in m and angles in rad at the end."""
    return float(np.abs(run.position[-1] - [ENDS[name][body] for body in of.mechanism.names]).max())


@pytest.mark.parametrize("name", TEXTS)
def test_a_mechanism_ends_where_an_independent_integration_does(name: str) -> None:
    of, run = sharp(name)
    assert off(of, name, run) < MARGIN * MEASURED[name][0]
    if of.joints_with_clearance:
        assert len(run.contacts["B"].impacts.time_s) in {"four": (36, 37), "cran": (17, 18)}[name[:4]]


@pytest.mark.parametrize("name", ORDERLY)
def test_rk4_comes_as_near_and_converges_at_its_order(name: str) -> None:
    of = scene(TEXTS[name])
    run = RK4.simulate(of, RunSettings(of.end_time_s / 4000, 1))
    assert off(of, name, run) < MARGIN * MEASURED[name][1]
    end_s, fewest = ORDERLY[name]
    of, steps = scene(TEXTS[name], end_time_s=end_s), [fewest * 2**k for k in range(4)]
    runs = [RK4.simulate(of, RunSettings(end_s / count, 10)).position for count in steps]
    errors = [float(np.abs(a - b).max()) for a, b in pairwise(runs)]
    order = slope([1 / count for count in steps[:-1]], errors)
    assert abs(order - 4) < ORDER_TOLERANCE, f"order {order:.3f} from errors {errors}"


def test_andrews_mechanism_turns_by_the_published_angles() -> None:
    published = {
        "beta": 15.81077119629904,
        "Theta": -15.75637105984298,
        "gamma": 0.04082224013073101,
        "phi": -0.5347301163226948,
        "delta": 0.5244099658805304,
        "Omega": 0.5347301163226948,
        "epsilon": 1.048080741042263,
    }
    of, run = sharp("andrews")
    k = dict(zip(of.mechanism.names, run.position[-1, :, 2].tolist(), strict=True))
    found = {
        "beta": k["K1"],
        "Theta": k["K2"] - k["K1"],
        "gamma": k["K3"],
        "phi": k["K4"] - k["K5"],
        "delta": k["K5"],
        "Omega": k["K6"] - k["K7"],
        "epsilon": k["K7"],
    }
    for angle, value in published.items():
        assert found[angle] == pytest.approx(value, rel=5e-10), angle


@pytest.mark.parametrize("name", TEXTS)
def test_the_ledger_closes_and_joints_stay_closed(name: str) -> None:
    of, run = sharp(name)
    assert np.abs(energy_balance_residual_J(of, run)).max() < LEDGER * energy_in_play_J(of, run)
    assert constraint_violation_m(of, run).max() < 1e-12, "projection closes after every step"


PISTON_ENGINE = """
name = "piston engine"
end_time_s = 10.0
gravity_m_s2 = 9.81
crank = { length_m = 0.3, mass_kg = 1.0, inertia_kg_m2 = 0.1, centre_of_mass_m = 0.0 }
rod = { length_m = 0.8, mass_kg = 1e-9, inertia_kg_m2 = 1e-10, centre_of_mass_m = 0.4 }
slider = { mass_kg = 3.0, inertia_kg_m2 = 1e-4 }
start = { crank_angle_rad = 0.0, crank_speed_rad_s = -2.5 }
drive = { kind = "free" }
"""
DOUBLE_PENDULUM = """
name = "double pendulum"
end_time_s = 10.0
gravity_m_s2 = 9.81
observe = "tip.angle"
ground.pins_m = { O = 0.0 }
[body]
arm = { pins_m = { O = 0.0, A = 1.0 }, centre_of_mass_m = 1.0, mass_kg = 1.0, inertia_kg_m2 = 0.1 }
tip = { pins_m = { A = 0.0 }, centre_of_mass_m = 0.4, mass_kg = 0.2, inertia_kg_m2 = 0.01 }
"""


def test_peers_of_the_literature_end_where_theirs_do() -> None:
    # Modelica's PlanarMechanics, by Dymola at a tolerance of 1e-6: the last digits are its own.
    engine = scene(PISTON_ENGINE)
    run = SHARP.simulate(engine, RunSettings(10.0, 1))
    assert run.position[-1, 0, 2] == pytest.approx(-16.81494, abs=1e-4)
    assert run.velocity[-1, 0, 2] == pytest.approx(-1.59427, abs=1e-4)
    assert run.position[-1, 0, 2] == pytest.approx(-16.814995, abs=1e-6), "with a rod of 1e-9 kg"
    assert run.velocity[-1, 0, 2] == pytest.approx(-1.594232, abs=1e-6)
    # SciPy's DOP853 at 1e-12 on the two angles' own equations.
    pendulum = scene(DOUBLE_PENDULUM)
    run = SHARP.simulate(pendulum, RunSettings(10.0, 1))
    (arm, tip), (arm_speed, tip_speed) = run.position[-1, :, 2], run.velocity[-1, :, 2]
    assert (arm, tip - arm) == pytest.approx((-0.449808, 2.722998), abs=1e-6)
    assert (arm_speed, tip_speed - arm_speed) == pytest.approx((2.358602, 9.483477), abs=2e-6)


def swing(count: int, end_time_s: float) -> FloatArray:
    """Return angle and rate of all legs of four-bars in a row: one pendulum's."""
    inertia = (count + 1) / 3 + count
    weight = 9.81 * ((count + 1) / 2 + count)

    def rates(_: float, y: FloatArray) -> list[float]:
        return [y[1], -weight / inertia * float(np.cos(y[0]))]

    return np.asarray(
        solve_ivp(rates, (0.0, end_time_s), [np.pi / 2, -1.0], "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    )


@pytest.mark.parametrize("count", [1, 4])
def test_four_bars_in_a_row_swing_as_one_pendulum_does(count: int) -> None:
    of = scene(four_bars(count, 0.6))
    run = SHARP.simulate(of, RunSettings(0.6, 1))
    angle, rate = swing(count, 0.6)
    legs = slice(0, count + 1)
    assert 0.3 < angle < 1.3, "short of the first singular position, at 0"
    assert np.abs(run.position[-1, legs, 2] - angle).max() < 1e-10
    assert np.abs(run.velocity[-1, legs, 2] - rate).max() < 1e-9
    assert np.abs(run.position[-1, count + 1 :, 2]).max() < 1e-10
    # Through all singular positions, as the benchmark of the literature asks.
    of = scene(four_bars(count, 20.0))
    run = ReferenceEngine(method="dop853", step_tolerance=1e-8).simulate(of, RunSettings(20.0, 1))
    assert_first_pin_near(run, count)


def assert_first_pin_near(run: Trajectory, count: int) -> None:
    angle, _ = swing(count, 20.0)
    pin = 2 * run.position[-1, 0, :2]
    assert np.hypot(*(pin - [np.cos(angle), np.sin(angle)])) < 1e-3


@pytest.mark.accuracy
def test_forty_four_bars_pass_their_singular_positions() -> None:
    assert swing(40, 20.0) == pytest.approx((-61.684499, -1.718570), abs=2e-6)
    of = scene(four_bars(40, 20.0))
    run = ReferenceEngine(method="dop853", step_tolerance=1e-8).simulate(of, RunSettings(20.0, 1))
    assert_first_pin_near(run, 40)


def along(body: FloatArray, point: tuple[float, float]) -> FloatArray:
    """Return the arm to a point of a body in states (n, 3), (n, 2)."""
    x, y = point
    cos, sin = np.cos(body[:, 2]), np.sin(body[:, 2])
    return np.column_stack([x * cos - y * sin, x * sin + y * cos])


@pytest.mark.parametrize("name", ["four-bar", "andrews"])
def test_joint_forces_obey_newton_and_euler(name: str) -> None:
    # Sixth differences of places: truncation is below their round-off, some 1e-16 m / h^2.
    samples = 2000
    of, run = sharp(name, samples)
    h, x = of.end_time_s / samples, run.position
    weights = np.array([2, -27, 270, -490, 270, -27, 2]) / 180
    rates = sum(w * x[k : len(x) - 6 + k] for k, w in enumerate(weights)) / h**2
    x, forces, data = x[3:-3], joint_forces(run)[3:-3], of.mechanism
    load = np.zeros_like(x)

    def add(body: int, point: tuple[float, float], force: FloatArray) -> None:
        if body >= 0:
            arm = along(x[:, body], point)
            load[:, body, :2] += force
            load[:, body, 2] += arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]

    for pin, force in zip(data.pins, forces.transpose(1, 0, 2), strict=True):
        add(pin.body_j, pin.point_j, force)
        add(pin.body_i, pin.point_i, -force)
    for number, body in enumerate(data.bodies):
        load[:, number, :2] += body.mass_kg * np.array(data.gravity_m_s2)
    if name == "andrews":
        k3 = data.names.index("K3")
        end = x[:, k3, :2] + along(x[:, k3], (957e-5, 74e-5)) - [0.014, 0.072]
        length = np.hypot(*end.T)[:, None]
        add(k3, (957e-5, 74e-5), -4530.0 * (length - 0.07785) * end / length)
        load[:, 0, 2] += 0.033
    mass = np.array([[body.mass_kg, body.mass_kg, body.inertia_kg_m2] for body in data.bodies])
    largest = np.abs(forces).max()
    arms = np.array([1.0, 1.0, lever_m(of)])
    assert np.abs((mass * rates - load) / arms).max() < 1e-6 * largest


@pytest.mark.parametrize(
    ("engine", "tolerance"), [(RK4, 1e-6), (RK4, 1e-9), (ReferenceEngine(method="dop853"), 1e-9)]
)
@pytest.mark.parametrize(("name", "observe"), [("four-bar", "B.x"), ("andrews", "K3.angle")])
def test_a_tolerance_of_what_a_mechanism_observes_is_kept(
    name: str, observe: str, engine: ReferenceEngine, tolerance: float
) -> None:
    of = scene(TEXTS[name])
    assert of.observed.name == observe
    run = simulate_to_tolerance(engine, of, tolerance, 10)
    ends, last = ENDS[name], dict(zip(of.mechanism.names, run.position[-1], strict=True))
    if observe == "B.x":
        places = (body["rocker"][0] + 0.11 * np.cos(body["rocker"][2]) for body in (ends, last))
    else:  # the longest lever is K7's, from H to A
        assert lever_m(of) == pytest.approx(0.04)
        places = (0.04 * body["K3"][2] for body in (ends, last))
    true, found = places
    assert abs(found - true) <= tolerance


def test_a_parallelogram_passes_its_singular_position_by_its_inertia() -> None:
    of = scene(PARALLELOGRAM, end_time_s=2.0)
    run = SHARP.simulate(of, RunSettings(2.0, 40))
    angle = 1.0 + 2.0 * run.time_s
    assert np.abs(run.position[:, 0, 2] - angle).max() < 1e-9
    assert np.abs(run.position[:, 2, 2] - angle).max() < 1e-6
