"""Any mechanism: published ends, how it starts, and what a check tells of it."""

import math
import re

import numpy as np
import pytest
from scipy.special import ellipk

from engine_models.engine import FloatArray, RunSettings, SimulationFailed
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.mechanics.start import start_state
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.inspection import inspect
from engine_models.scene.file import SceneError, from_toml
from engine_models.scene.format import Place
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.judges.columns import sample_columns
from tests.engine_models.scene.test_mechanisms import TRAMMEL
from tests.engines.mechanism_texts import (
    ANDREWS,
    FOUR_BAR,
    FOUR_BAR_CLEARANCE,
    OFFSET_CRANK_SLIDER,
    PARALLELOGRAM,
    QUICK_RETURN,
    TEXTS,
    WALL,
    scene,
)
from tests.engines.runs import run
from tests.helpers.starts import started_from

SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-12)
DOP853 = "reference method=dop853 step_tolerance=1e-12"


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
    of = scene(ANDREWS)
    k = dict(zip(of.mechanism.names, run(DOP853, of, 1).position[-1, :, 2].tolist(), strict=True))
    found = (k["K1"], k["K2"] - k["K1"], k["K3"], k["K4"] - k["K5"], k["K5"], k["K6"] - k["K7"], k["K7"])
    assert found == pytest.approx(tuple(published.values()), rel=5e-10)


@pytest.mark.parametrize(("engine", "bound_m"), [("reference", 1e-14), ("scipy", 1e-14), ("exudyn", 1e-6)])
def test_a_marker_of_a_bar_whose_ends_slide_on_two_lines_draws_an_ellipse(
    engine: str, bound_m: float
) -> None:
    """The trammel of Archimedes: a marker s from the middle is at (s - a) cos, (s + a) sin.

    Chipmunk, whose slots do not let the bar turn, refuses it; Exudyn's joints are open by 3e-7 m.
    """
    of, (a, s) = from_toml(TRAMMEL.replace("Q = 0.5", "Q = 0.5, M = 0.2")), (0.5, 0.2)
    trajectory = run(engine, of, 40)
    columns = sample_columns(of, trajectory)
    angle = trajectory.position[:, 0, 2]
    off_x = columns["marker_M_x_m"] - (s - a) * np.cos(angle)
    off_y = columns["marker_M_y_m"] - (s + a) * np.sin(angle)
    assert np.hypot(off_x, off_y).max() < bound_m
    assert np.ptp(angle) > 0.5, "it moves"


PULLED = """
name = "pulled"
end_time_s = 1.0
observe = "P.x"
ground.pins_m = { O = 0.0 }
load.bar = { force_N = 2.0, along_rad = 0.3, pin = "P" }
start.angle_rad.bar = 1.3
[body.bar]
pins_m = { O = 0.0, P = 1.0 }
mass_kg = 1.5
inertia_kg_m2 = 0.2
centre_of_mass_m = [0.4, 0.1]
"""


@pytest.mark.parametrize(
    ("engine", "bound"), [("reference", 1e-9), ("scipy", 1e-8), ("exudyn", 1e-5), ("pymunk", 1e-5)]
)
def test_a_force_at_a_pin_swings_a_bar_as_gravity_would_a_pendulum(engine: str, bound: float) -> None:
    """A pendulum's quarter period is K(sin(a/2)) sqrt(I/(F L)) from an angle a off the force at rest."""
    about_o = 0.2 + 1.5 * (0.4**2 + 0.1**2)
    quarter_s = float(ellipk(math.sin(0.5) ** 2)) * math.sqrt(about_o / (2.0 * 1.0))
    trajectory = run(engine, from_toml(PULLED).replace("end_time_s", quarter_s), 10)
    off = abs(trajectory.position[-1, 0, 2] - 0.3)
    assert off < bound, f"{off:.1e} rad"
    assert np.ptp(trajectory.position[:, 0, 2]) > 0.9, "it swings"


TWISTED = """
name = "twisted"
end_time_s = 1.0
observe = "one.angle"
ground.pins_m = { O = 0.0, P = 0.5 }
start.angle_rad = { one = 0.1, two = 20.0 }
[body]
one = { pins_m = { O = 0.0 }, centre_of_mass_m = 0.1, mass_kg = 1.0, inertia_kg_m2 = 0.01 }
two = { pins_m = { P = 0.0 }, centre_of_mass_m = [0.0, 0.2], mass_kg = 0.5, inertia_kg_m2 = 0.03 }
[torsion]
t = { between = ["one", "two"], stiffness_N_m_rad = 2.0, free_angle_rad = 16.0, damping_N_m_s = 0.03 }
"""


@pytest.mark.parametrize(
    ("engine", "bound"),
    [
        *(("reference", 1e-7), (DOP853, 1e-11), ("scipy", 1e-11)),
        *(("exudyn", 1e-3), ("exudyn solver=RK44", 1e-7), ("pymunk", 1e-3)),
    ],
)
def test_a_torsion_pendulum_of_two_bodies_loses_its_decrement_in_each_period(
    engine: str, bound: float
) -> None:
    """Wound by x rad, it has exp(-c t/(2 I)) x at rest after each period, I the reduced inertia."""
    inertia = 0.02 * 0.05 / (0.02 + 0.05)
    rate = 0.03 / (2 * inertia)
    period_s = 2 * math.pi / math.sqrt(2.0 / inertia - rate**2)
    of = from_toml(TWISTED).replace("end_time_s", 3 * period_s)
    assert from_toml(of.to_toml()) == of
    trajectory = run(engine, of, 200, 3)
    one, two = trajectory.position[:, :, 2].T
    left, columns = (20.0 - 0.1 - 16.0) * np.exp(-rate * trajectory.time_s), sample_columns(of, trajectory)
    assert two - one - 16.0 == pytest.approx(left, abs=bound)
    assert 0.02 * one + 0.05 * two == pytest.approx(0.02 * 0.1 + 0.05 * 20.0, abs=bound)
    assert columns["torsion_t_torque_N_m"] == pytest.approx(-2.0 * left, abs=2.0 * bound)
    assert columns["torsion_t_work_J"] == pytest.approx(2.0 / 2 * (left**2 - left[0] ** 2), abs=16.0 * bound)


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
    run = SHARP.simulate(scene(PISTON_ENGINE), RunSettings(10.0, 1))
    angle, rate = run.position[-1, 0, 2], run.velocity[-1, 0, 2]
    assert (angle, rate) == pytest.approx((-16.81494, -1.59427), abs=1e-4)
    assert (angle, rate) == pytest.approx((-16.814995, -1.594232), abs=1e-6), "with a rod of 1e-9 kg"
    # So light a rod is no singular position for RK4 either.
    for step_s in (1e-3, 4e-3):
        plain = ReferenceEngine().simulate(scene(PISTON_ENGINE), RunSettings(step_s, 10))
        assert plain.position[-1, 0, 2] == pytest.approx(-16.814995, abs=5e-7)
        assert plain.velocity[-1, 0, 2] == pytest.approx(-1.594232, abs=5e-7)
    # SciPy's DOP853 at 1e-12 on the two angles' own equations.
    run = SHARP.simulate(scene(DOUBLE_PENDULUM), RunSettings(10.0, 1))
    (arm, tip), (arm_speed, tip_speed) = run.position[-1, :, 2], run.velocity[-1, :, 2]
    assert (arm, tip - arm) == pytest.approx((-0.449808, 2.722998), abs=1e-6)
    assert (arm_speed, tip_speed - arm_speed) == pytest.approx((2.358602, 9.483477), abs=2e-6)


# Starts.

GENERAL = [name for name, text in TEXTS.items() if "[body]" in text]


def pair(place: Place) -> FloatArray:
    return np.array(place if isinstance(place, tuple) else (place, 0.0))


def gaps(of: Scene, q: FloatArray) -> list[float]:
    """Return how far pins of one name are apart, from the file's own places."""
    places = {pin: [pair(place)] for pin, place in of.ground.pins_m.items()}
    for (x, y, angle), body in zip(q, of.body.values(), strict=True):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        for pin, place in body.pins_m.items():
            there = [x, y] + turn @ (pair(place) - pair(body.centre_of_mass_m))
            places.setdefault(pin, []).append(there)
    return [float(np.hypot(*(own - first))) for first, *rest in places.values() for own in rest]


@pytest.mark.parametrize("name", GENERAL)
def test_a_start_is_closed_and_what_is_held_is_exact_whatever_else_is_told(name: str) -> None:
    of = scene(TEXTS[name])
    q, v = start_state(of)
    assert max(gaps(of, q)) < 1e-12
    assert max(gaps(of, q + 1e-7 * v)) < 1e-7 * 1e-4 * (1 + np.abs(v).max()), "speeds keep them closed"
    (held,) = of.start.hold
    number = [*of.body].index(held)
    assert q[number, 2] == of.start.angle_rad[held]
    assert v[number, 2] == pytest.approx(of.start.speed_rad_s[held], rel=1e-14, abs=1e-14)
    others = {body: angle + 0.02 for body, angle in of.start.angle_rad.items() if body != held}
    again, _ = start_state(of.replace({f"start.angle_rad.{body}": angle for body, angle in others.items()}))
    assert np.abs(again - q).max() < 1e-13


def test_a_way_along_a_turning_guide_is_held_and_speeds_are_those_of_the_closed_form() -> None:
    way = 0.26  # from pin C, 0.2 below the crank's pivot, to its pin A: the law of cosines
    of = scene(QUICK_RETURN, start__hold=["slot"], start__position_m={"slot": way})
    q, _ = start_state(of)
    assert np.sin(q[0, 2]) == pytest.approx((way**2 - 0.2**2 - 0.08**2) / (2 * 0.2 * 0.08), abs=1e-13)
    assert max(gaps(of, q)) < 1e-12
    q, v = start_state(scene(FOUR_BAR))
    crank, coupler, rocker = q[:, 2]
    speeds = (
        20.0,
        -20.0 * 0.1 * np.sin(crank - rocker) / (0.25 * np.sin(coupler - rocker)),
        20.0 * 0.1 * np.sin(crank - coupler) / (0.2 * np.sin(rocker - coupler)),
    )
    np.testing.assert_allclose(v[:, 2], speeds, rtol=1e-13)
    np.testing.assert_allclose(v[0, :2], 20.0 * 0.04 * np.array([-np.sin(crank), np.cos(crank)]), rtol=1e-13)


def test_check_counts_rows_and_freedoms_and_tells_what_it_moved() -> None:
    of = scene(FOUR_BAR_CLEARANCE)
    size, start, least, *_ = inspect(of)
    rows = "8 rows of rank 8 (with B taken as ideal)"
    assert size == f"{of.name}: 3 bodies, 4 joints; {rows}, 1 degree of freedom"
    moved = np.abs(start_state(of)[0][:, 2] - [of.start.angle_rad.get(body, 0.0) for body in of.body])
    turned = zip(of.body, moved, strict=True)
    told = ", ".join(f"{body} turned by {angle:.3g} rad" for body, angle in turned if angle > 1e-12)
    assert start == f"start: put together, {told} from what the file tells"
    assert least.startswith("smallest singular value over 200 samples of the run: 0.")
    given = started_from(of, *start_state(of))
    assert "start: as the file gives it, the state of every body" in inspect(given)


def test_check_finds_when_a_parallelogram_is_flat() -> None:
    def least(end_s: float) -> tuple[float, float]:
        line = inspect(scene(PARALLELOGRAM, end_time_s=end_s))[2]
        found = re.search(r"run: (\S+) at t = (\S+) s", line)
        assert found is not None
        return float(found[1]), float(found[2])

    flat = (math.pi - 1.0) / 2.0  # its crank turns by 2 rad/s, and is along x at pi
    value, when = least(2.0)
    assert abs(when - flat) <= 2.0 / 200 / 2
    near, end = least(1.0)
    assert end == 1.0, "it only comes near"
    # Near the flat position the value is a multiple of the angle's distance from it.
    assert near / value == pytest.approx((flat - 1.0) / abs(when - flat), rel=0.1)


# Corners of the general form: names, whole turns, legs too many, springs without length.


def test_a_leg_too_many_runs_where_it_has_clearance() -> None:
    """A third leg makes one row too many, unless its pin M is loose."""
    leg = "middle = { pins_m = { D = 0.0, M = 0.1 }, mass_kg = 0.2, inertia_kg_m2 = 2e-4 }\n[start]"
    text = PARALLELOGRAM.replace("C = 0.2 }", "C = 0.2, D = 0.1 }").replace("B = 0.2 }", "B = 0.2, M = 0.1 }")
    text = text.replace("[start]", leg).replace("right = 1.0 }", "right = 1.0, middle = 1.0 }")
    with pytest.raises(SceneError, match=r"12 rows of rank 11, those of .*M.* depend on each other"):
        scene(text)
    of = scene(text + f"[clearance.M]{WALL}", end_time_s=0.2)
    assert inspect(of)[0].endswith("12 rows of rank 11 (with M taken as ideal), 1 degree of freedom")
    run = SHARP.simulate(of, RunSettings(of.end_time_s, 10))
    assert np.abs(energy_balance_residual_J(of, run)).max() < 1e-9 * energy_in_play_J(of, run)


def cosines(a: float, b: float, opposite: float) -> float:
    """Return the angle between two sides of a triangle, from its three."""
    return math.acos((a * a + b * b - opposite * opposite) / (2 * a * b))


@pytest.mark.parametrize(
    ("text", "dead_centres", "transmission"),
    [
        # Crank and rod in line; the rod farthest from the guide's direction.
        (
            OFFSET_CRANK_SLIDER,
            (0.3 + math.asin(0.02 / 0.17), 0.3 + math.pi + math.asin(0.02 / 0.07)),
            math.acos(0.07 / 0.12),
        ),
        (FOUR_BAR, (cosines(0.35, 0.28, 0.2), math.pi + cosines(0.15, 0.28, 0.2)), cosines(0.25, 0.2, 0.18)),
    ],
)
def test_dead_centres_and_transmission_angles_are_those_of_geometry(
    text: str, dead_centres: tuple[float, float], transmission: float
) -> None:
    """Angles are told to 0.1 deg, and the least one is of 200 samples of a turn or more."""
    for name, angles in (("dead centre", dead_centres), ("least transmission", (transmission,))):
        (line,) = [each for each in inspect(scene(text)) if each.startswith(name)]
        told = [float(each) for each in re.findall(r"[\d.]+(?=, |(?: deg))", line.partition(": ")[2])]
        assert told == pytest.approx(np.degrees(angles), abs=0.1), line


def test_a_joints_force_is_the_same_whichever_body_has_the_bearing() -> None:
    """Without friction the motion is the same, too; the force is that on the body named later."""
    bearings = [scene(FOUR_BAR_CLEARANCE, clearance__B__bearing=name) for name in ("coupler", "rocker")]
    one, other = (run(DOP853, of.replace("end_time_s", 0.002), 1) for of in bearings)
    assert np.abs(one.joint_force_N["B"]).max() > 100.0
    np.testing.assert_allclose(other.joint_force_N["B"], one.joint_force_N["B"], rtol=0, atol=1e-3)


def test_a_run_that_would_never_end_is_not_waited_for_in_inspection() -> None:
    """A slider of 1000 t on the wall of its bearing takes steps of 0.2 ns."""
    heavy = SCENES["clearance-driven-damped"]().replace("slider.mass_kg", 1e6)
    with pytest.raises(SimulationFailed, match="do not come to the end of the run"):
        inspect(heavy)
