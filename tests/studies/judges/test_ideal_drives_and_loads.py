"""The independent truth under changing speeds, a motor and loads on the slider, against other derivations."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from engine_models.engine import FloatArray, Trajectory
from engine_models.mechanics.samples import selected
from engine_models.scene.drives import Drive, FluctuatingDrive, MotorDrive, RampDrive, TableDrive
from engine_models.scene.library import ideal_driven, ideal_free, ideal_torque
from engine_models.scene.loads import Gas, Loads, SliderLoad
from engine_models.scene.scene import Scene
from studies.judges.ideal_drive import cubic_spline, prescribed_motion
from studies.judges.ideal_truth import configuration, crank_acceleration, exact, exact_repeats
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J
from tests.helpers.arrays import joint_forces
from tests.studies.independent.newton_euler import integrate, slider_load

SPEED = 2 * np.pi * 5000 / 60
#: Central differences of order 8 on equally spaced samples: weights at 1, 2, 3, 4 steps to either side.
DIFFERENCES = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
#: What they make of rounding here, relative to the largest value; 6e-13 is measured.
ROUNDED = 5e-12


def changed(scene: Scene, **start: float) -> Scene:
    return scene.model_copy(update={"start": scene.start.model_copy(update=start)})


def driven(drive: Drive, scene: Scene | None = None) -> Scene:
    return (scene or ideal_driven()).model_copy(update={"drive": drive})


def table(end_time_s: float) -> TableDrive:
    time = np.linspace(0.0, end_time_s, 41)
    angle = 0.3 + SPEED * time + 0.05 * np.sin(540 * time)
    return TableDrive(kind="table", time_s=tuple(time.tolist()), angle_rad=tuple(angle.tolist()))


def gas(peak_N: float, points: int = 17) -> Gas:
    """Return a push on the slider once a revolution, from an angle off zero on."""
    angle = np.linspace(0.0, 2 * np.pi, points) - 0.3
    force = -peak_N * np.exp(-(((angle + 0.3) - 1.2) ** 2))
    force[-1] = force[0]
    return Gas(crank_angle_rad=tuple(angle.tolist()), force_N=tuple(force.tolist()))


RAMP = driven(RampDrive(kind="ramp", final_speed_rad_s=700.0, ramp_time_s=0.015))
FLUCTUATING = driven(
    FluctuatingDrive(kind="fluctuating", amplitude_rad_s=30.0, frequency_Hz=170.0, phase_rad=0.4)
)
PRESCRIBED = {
    "constant-speed": ideal_driven(),
    "ramp": RAMP,
    "ramp from rest": changed(RAMP, crank_speed_rad_s=0.0),
    "ramp, later": changed(RAMP, time_s=0.006),
    "past the ramp": changed(RAMP, time_s=0.02),
    "fluctuating": FLUCTUATING,
    "fluctuating, later": changed(FLUCTUATING, time_s=0.006),
    "table": driven(table(0.024)),
    "table, later": changed(driven(table(0.036)), time_s=0.0055),
}
MOTOR = driven(MotorDrive(kind="motor", stall_torque_N_m=1.2, no_load_speed_rad_s=80.0), ideal_torque())
LEFT_FREE = {"free": ideal_free(), "torque": ideal_torque(), "motor": MOTOR}
SCENES = PRESCRIBED | LEFT_FREE


def loads(driven: bool) -> dict[str, SliderLoad]:
    """Return loads of the size of the inertia forces of the scenes with a driven crank, or of the others."""
    push, damping, stiffness, peak = (-300.0, 20.0, 5e3, 3e3) if driven else (-5.0, 1.0, 200.0, 10.0)
    parts: dict[str, dict[str, object]] = {
        "force": {"force_N": push},
        "viscous": {"viscous_N_s_m": damping},
        "spring": {"spring_N_m": stiffness, "free_position_m": 0.1},
        "gas": {"gas": gas(peak)},
    }
    parts["all"] = {name: value for part in parts.values() for name, value in part.items()}
    parts["lines"] = {"gas": gas(peak).model_copy(update={"interpolation": "linear"})}
    return {name: SliderLoad(**part) for name, part in parts.items()}  # type: ignore[arg-type]


def loaded(name: str, load: str) -> Scene:
    if load == "none":
        return SCENES[name]
    slider = loads(name in PRESCRIBED)[load]
    return SCENES[name].model_copy(update={"load": Loads(slider=slider)})


LOADS = ("force", "viscous", "spring", "gas", "all")


@pytest.mark.parametrize(
    ("name", "load"),
    [*((name, load) for name in LEFT_FREE for load in (*LOADS, "lines")), ("motor", "none")],
)
def test_the_energy_integral_closes_where_the_crank_is_left_free(name: str, load: str) -> None:
    scene = loaded(name, load).model_copy(update={"end_time_s": 0.3})
    truth = exact(scene, 200)
    energy = kinetic_energy_J(scene, truth).max()
    residual = np.abs(energy_balance_residual_J(scene, truth)).max() / energy
    # Round-off: 3e-13 over the 20 revolutions of a free crank under gas, 4e-14 at most in the others.
    assert residual < 1e-12, f"energy residual is {residual:.1e} of {energy:.2e} J"
    assert constraint_violation_m(scene, truth).max() < 1e-15
    for repeat in exact_repeats(scene, 200) if (name, load) == ("motor", "all") else ():
        difference = np.abs(truth.position[:, -1, 0] - repeat.position[:, -1, 0]).max()
        assert difference < 5e-13, f"repeats differ by {difference:.2e} m"


def short(name: str, load: str) -> Scene:
    return loaded(name, load).model_copy(update={"end_time_s": 0.02 if name in PRESCRIBED else 0.1})


@cache
def apart(name: str, load: str) -> dict[str, float]:
    """Return how far the truth and Newton's bodies are apart, in parts of each signal's largest value."""
    scene = short(name, load)
    truth = exact(scene, 40)
    bodies = integrate(scene, truth.time_s, 1e-12, 5e-5 if name in PRESCRIBED else 2e-4)
    signals = {
        "position": (truth.position, bodies.position),
        "velocity": (truth.velocity, bodies.velocity),
        "joint force": (joint_forces(truth), bodies.joint_force_N),
        "guide force": (truth.guide_force_N["guide"], bodies.guide_normal_force_N),
        "torque": (truth.driver_torque_N_m, bodies.driver_torque_N_m),
        "driver's work": (truth.driver_work_J, bodies.driver_work_J),
    }
    signals |= {part: (work, bodies.load_work_J[part]) for part, work in truth.load_work_J.items()}
    there = {key: (a, b) for key, (a, b) in signals.items() if a is not None and b is not None}
    return {key: float(np.abs(a - b).max() / np.abs(a).max()) for key, (a, b) in there.items()}


@pytest.mark.parametrize("name", ["constant-speed", "fluctuating", "fluctuating, later", "motor"])
def test_bodies_by_newton_and_euler_do_the_same_to_round_off_where_nothing_has_knots(name: str) -> None:
    for signal, off in apart(name, "none").items():
        assert off < 1e-12, f"{signal} off by {off:.1e} of its largest value"


@pytest.mark.parametrize("name", SCENES)
def test_bodies_by_newton_and_euler_do_the_same_under_load(name: str) -> None:
    found = apart(name, "all")
    # It is the other's steps across knots that are no sharper: at most 3e-10 is measured.
    for signal, off in found.items():
        assert off < 2e-9, f"{signal} off by {off:.1e} of its largest value"
    assert set(loads(True)) - {"all", "lines"} < set(found)


def derivative(values: FloatArray, step: float) -> FloatArray:
    """Return the derivatives (n - 8, ...) of samples (n, ...) but the first and last four."""
    n = len(values)
    pairs = (values[4 + k : n - 4 + k] - values[4 - k : n - 4 - k] for k in (1, 2, 3, 4))
    return np.asarray(sum(w * pair for w, pair in zip(DIFFERENCES, pairs, strict=True)) / step)


@cache
def fine(name: str) -> tuple[Scene, Trajectory, float]:
    """Return the truth of a scene under load at 1600 samples and their spacing in s."""
    scene = short(name, "all")
    return scene, exact(scene, 1600), scene.end_time_s / 1600


def smooth(scene: Scene, truth: Trajectory) -> NDArray[np.bool_]:
    """Return which samples have no knot in time or of the gas within four samples: differences hold there."""
    knots = prescribed_motion(scene).knots_s if scene.speed_is_prescribed else ()
    pieces = [np.searchsorted(knots, truth.time_s)]
    if scene.load.slider is not None and scene.load.slider.gas is not None:
        first, *others = scene.load.slider.gas.crank_angle_rad
        turns, offset = np.divmod(truth.position[:, 0, 2] - first, 2 * np.pi)
        pieces.append(turns * len(others) + np.searchsorted(np.array(others) - first, offset))
    windows = (np.lib.stride_tricks.sliding_window_view(piece, 9) for piece in pieces)
    return np.asarray(np.all([window.min(axis=1) == window.max(axis=1) for window in windows], axis=0))


@pytest.mark.parametrize("name", SCENES)
def test_velocities_are_the_rates_of_positions(name: str) -> None:
    scene, truth, step = fine(name)
    rate, there = derivative(truth.position, step), smooth(scene, truth)
    off = np.abs(rate - truth.velocity[4:-4])[there].max() / np.abs(truth.velocity).max()
    assert there.mean() > 0.5
    assert off < ROUNDED, f"off by {off:.1e}"


@pytest.mark.parametrize("name", SCENES)
def test_the_bodies_forces_are_the_rates_of_their_momenta(name: str) -> None:
    scene, truth, step = fine(name)
    masses = np.array([body.mass_kg for body in scene.bodies])
    rate, there = derivative(truth.velocity[:, :, :2], step) * masses[:, None], smooth(scene, truth)
    O, A, B = np.moveaxis(joint_forces(truth), 1, 0)  # noqa: E741  the joints' names
    forces_on = slider_load(scene)
    on_slider = [
        sum(forces_on(*state).values())
        for state in zip(
            truth.position[:, 0, 2], truth.position[:, -1, 0], truth.velocity[:, -1, 0], strict=True
        )
    ]
    force = np.stack([O - A, A - B, B], axis=1)
    force[:, 2] += np.stack([np.array(on_slider), np.asarray(truth.guide_force_N["guide"])], axis=-1)
    force[:, :, 1] -= masses * scene.gravity_m_s2
    off = np.abs(rate - force[4:-4])[there].max() / np.abs(force).max()
    assert off < ROUNDED, f"off by {off:.1e}"


@pytest.mark.parametrize("name", SCENES)
def test_works_grow_by_force_times_speed(name: str) -> None:
    scene, truth, step = fine(name)
    forces_on = slider_load(scene)
    states = zip(truth.position[:, 0, 2], truth.position[:, -1, 0], truth.velocity[:, -1, 0], strict=True)
    forces = [forces_on(*state) for state in states]
    powers = {
        part: np.array([force[part] for force in forces]) * truth.velocity[:, -1, 0]
        for part in truth.load_work_J
    }
    works = dict(truth.load_work_J)
    if truth.driver_work_J is not None and truth.driver_torque_N_m is not None:
        powers["driver"] = truth.driver_torque_N_m * truth.velocity[:, 0, 2]
        works["driver"] = truth.driver_work_J
    assert len(works) == 4 + (scene.drive.kind != "free")
    there = smooth(scene, truth)
    for part, power in powers.items():
        off = np.abs(derivative(works[part], step) - power[4:-4])[there].max() / np.abs(power).max()
        assert works[part][0] == 0
        assert off < ROUNDED, f"{part}: off by {off:.1e}"


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("name", PRESCRIBED)
def test_a_load_asks_of_a_prescribed_speed_what_virtual_work_says(name: str, load: str) -> None:
    """By hand: the torque takes -F dx/dtheta more, the pin B -F along the guide, the motion is the same."""
    bare, burdened = exact(SCENES[name], 60), exact(loaded(name, load), 60)
    assert (bare.position == burdened.position).all()
    scene = loaded(name, load)
    theta, forces_on = bare.position[:, 0, 2], slider_load(scene)
    states = zip(theta, bare.position[:, -1, 0], bare.velocity[:, -1, 0], strict=True)
    force = np.array([sum(forces_on(*state).values()) for state in states])
    slope = configuration(scene, theta)[1][:, 2, 0]
    assert bare.driver_torque_N_m is not None
    assert burdened.driver_torque_N_m is not None
    more = burdened.driver_torque_N_m - bare.driver_torque_N_m
    # Torques of 200 N m and forces of 5000 N in double precision.
    assert np.abs(more + force * slope).max() < 1e-12
    assert np.abs((joint_forces(burdened) - joint_forces(bare))[:, 2, 0] + force).max() < 1e-11


@pytest.mark.parametrize("name", ["ramp", "ramp from rest", "fluctuating", "table"])
def test_a_run_begun_later_is_the_rest_of_the_whole_run(name: str) -> None:
    scene = loaded(name, "all")
    whole = exact(scene, 240)
    at = float(whole.time_s[90])
    start = {"time_s": at, "crank_angle_rad": float(whole.position[90, 0, 2])}
    if scene.drive.kind == "table":
        start["crank_speed_rad_s"] = float(whole.velocity[90, 0, 2])
    later = {"start": scene.start.model_copy(update=start), "end_time_s": scene.end_time_s - at}
    rest = exact(scene.model_copy(update=later), 150)
    second = selected(whole, slice(90, None))
    pairs = {
        "position": (rest.position, second.position),
        "velocity": (rest.velocity, second.velocity),
        "force": (joint_forces(rest), joint_forces(second)),
        "torque": (np.asarray(rest.driver_torque_N_m), np.asarray(second.driver_torque_N_m)),
    }
    for signal, (a, b) in pairs.items():
        assert np.abs(a - b).max() < 1e-13 * np.abs(b).max(), signal
    for part, work in whole.load_work_J.items():
        grown = work[90:] - work[90]
        assert np.abs(rest.load_work_J[part] - grown).max() < 1e-13 * np.abs(work).max(), part


def test_a_ramp_turns_by_the_mean_of_its_speeds_and_then_evenly() -> None:
    motion = prescribed_motion(RAMP)
    turned = motion.turned_rad(np.array([0.015, 0.02]))
    np.testing.assert_allclose(turned[0], 0.015 * (SPEED + 700) / 2, rtol=1e-15)
    np.testing.assert_allclose(turned[1] - turned[0], 0.005 * 700, rtol=1e-14)
    assert motion.speed_rad_s(np.array([0.015, 0.02])).tolist() == [700.0, 700.0]
    assert motion.acceleration_rad_s2(np.array([0.0, 0.015, 0.02])).tolist() == [0.0, 0.0, 0.0]
    assert motion.knots_s == (0.015,)


def test_the_tables_spline_is_the_one_of_scipy_and_reproduces_a_cubic() -> None:
    x = np.cumsum(np.random.default_rng(1).uniform(0.5, 1.5, 30)).tolist()
    y, at = np.sin(x).tolist(), np.linspace(x[0], x[-1], 301)
    spline, theirs = cubic_spline(x, y), CubicSpline(x, y, bc_type="not-a-knot")
    for order in (0, 1, 2):
        np.testing.assert_allclose(spline(at, order), theirs(at, order), atol=1e-13)
    for ends in ((1.5, -0.5), (0.0, None), (None, 2.0)):
        spline = cubic_spline(x, y, *ends)
        theirs = CubicSpline(x, y, bc_type=tuple("not-a-knot" if end is None else (1, end) for end in ends))
        for order in (0, 1, 2):
            np.testing.assert_allclose(spline(at, order), theirs(at, order), atol=1e-13)
    for points in (4, 5, 30):
        cubic = cubic_spline(x[:points], [v**3 - 4 * v for v in x[:points]])
        inside = at[at <= x[points - 1]]
        np.testing.assert_allclose(cubic(inside, 2), 6 * inside, rtol=1e-10)


def test_of_a_speed_that_changes_with_time_there_is_no_law_by_angle_and_speed() -> None:
    with pytest.raises(ValueError, match=r"drive\.kind"):
        crank_acceleration(RAMP)
