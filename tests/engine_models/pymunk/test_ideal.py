"""The Pymunk engine against the independent truth, closed forms and the mechanics it must not break."""

import time
from typing import Any

import numpy as np
import pydantic
import pymunk
import pytest

from engine_models.engine import RunSettings, SimulationFailed
from engine_models.mechanics.crank_motion import crank_motion
from engine_models.mechanics.reactions import reactions
from engine_models.pymunk.engine import PymunkEngine
from engine_models.scene.library import IDEAL_SCENES, ideal_driven, ideal_free, ideal_torque
from engine_models.scene.scene import Scene
from studies.judges.metrics import errors
from tests.engine_models.pymunk.ideal_errors import ORDER_TOLERANCE, SAMPLES, orders, run, worst
from tests.helpers.arrays import arrays, joint_forces
from tests.studies.truth.closed_forms.crank_slider import configuration, crank_acceleration, exact

#: Odd numbers of steps between samples, since an even one would hide a force that rings from step to step;
#: above the steps where a phase error of a radian bends the slope, below those where round-off shows.
TUNED_STEPS = {
    "ideal-free": (81, 161, 321, 641),
    "ideal-driven": (11, 21, 41, 81),
    "ideal-torque": (41, 81, 161, 321),
    "ideal-fluctuating": (11, 21, 41, 81),
    "ideal-compressor": (21, 41, 81, 161),
}
LIBRARY_STEPS = {
    "ideal-free": (321, 641, 1281),
    "ideal-driven": (11, 21, 41, 81),
    "ideal-torque": (321, 641, 1281),
    "ideal-fluctuating": (11, 21, 41, 81),
    "ideal-compressor": (81, 161, 321),
}
#: Out of the box the free crank is a radian late after a second at any step worth running, so it gets less.
LIBRARY_END_TIME_S = {"ideal-free": 0.2, "ideal-torque": 0.15}
ARMS = (PymunkEngine(), PymunkEngine.out_of_the_box())
#: Relative error of a closed form evaluated from exact states; measured 1e-16.
ROUND_OFF = 1e-14
#: 5000 steps a revolution leave 0.006 N of 2719 N and 0.0004 N m of 139 N m; 0.005 is the digits given.
PIN_FORCE_ACCURACY, TORQUE_ACCURACY = 0.012, 0.006
#: A smooth periodic torque: the trapezoidal rule is exact, and what is left is how far the angle has drifted.
REVOLUTION_ACCURACY = 1e-5
#: Steps of 10 us leave 3e-5 of the force (driven, t = 0); kick 0 itself would be off by all of it, and with
#: fewer kicks at the full number of sweeps it would be 2e-4 (free, joint B).
FIRST_FORCES = 5e-5
#: Round-off of a place of 0.17 m over the square of 1e-6 s, by the coefficients 10, 15 and 6 of the parabola
#: behind the first forces, on 0.14 kg: 1.2e-4 N, measured 1.1e-4; 7e-7 N at steps ten times as long.
FIRST_ROUNDING_N = 2e-4


def shorter(scene: Scene, end_time_s: float) -> Scene:
    return scene.model_copy(update={"end_time_s": end_time_s})


def with_rod(scene: Scene, length_m: float) -> Scene:
    rod = scene.crank_slider()[1].model_copy(update={"length_m": length_m, "centre_of_mass_m": length_m / 2})
    return scene.model_copy(update={"rod": rod})


@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_tuned_every_signal_converges_at_order_two(name: str) -> None:
    slopes = orders(IDEAL_SCENES[name](), PymunkEngine(), TUNED_STEPS[name])
    assert slopes == pytest.approx(dict.fromkeys(slopes, 2.0), abs=ORDER_TOLERANCE), slopes


@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_out_of_the_box_every_signal_converges_at_order_one_once_started(name: str) -> None:
    scene = IDEAL_SCENES[name]()
    scene = shorter(scene, LIBRARY_END_TIME_S.get(name, scene.end_time_s))
    slopes = orders(scene, PymunkEngine.out_of_the_box(), LIBRARY_STEPS[name], since=1)
    assert slopes == pytest.approx(dict.fromkeys(slopes, 1.0), abs=ORDER_TOLERANCE), slopes


@pytest.mark.parametrize("steps", [1001, 10001])
def test_out_of_the_box_the_first_force_is_wrong_however_short_the_step(steps: int) -> None:
    scene = shorter(ideal_torque(), 0.01)
    force = [joint_forces(run(scene, engine, steps, 1))[0, 1, 0] for engine in ARMS]
    truth = joint_forces(exact(scene, 1))[0, 1, 0]
    assert force[0] == pytest.approx(truth, abs=FIRST_ROUNDING_N), f"tuned {force[0]:.6g} N of {truth:.6g} N"
    assert 0.02 < abs(force[1] / truth - 1) < 0.1, f"out of the box {force[1]:.6g} N, truth {truth:.6g} N"


@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_tuned_the_first_forces_are_as_good_as_the_later_ones(name: str) -> None:
    scene = shorter(IDEAL_SCENES[name](), 12e-5)
    trajectory = run(scene, PymunkEngine(), samples=12)
    error, size = errors(scene, trajectory, exact(scene, 12)), np.abs(joint_forces(trajectory)).max()
    for signal in ("joint_A_force_error_N", "joint_B_force_error_N", "guide_normal_force_error_N"):
        assert (error[signal][:2] < FIRST_FORCES * size).all(), f"{signal}: {error[signal] / size}"
    velocity = np.abs(trajectory.velocity[:, -1, 0] - exact(scene, 12).velocity[:, -1, 0])
    assert velocity[:2].max() <= 2 * velocity[2:].max(), velocity


def test_without_the_half_kick_a_full_correction_makes_the_first_force_half_too_large() -> None:
    scene = shorter(ideal_driven(), 12e-5)
    engine = PymunkEngine(joints="all", iterations=20, half_kick_start=False)
    ratio = joint_forces(run(scene, engine, samples=12))[:, 1, 0] / joint_forces(exact(scene, 12))[:, 1, 0]
    assert ratio[1] == pytest.approx(1.5, abs=0.01), ratio
    assert ratio[2:] == pytest.approx(1.0, abs=0.01), ratio


def test_the_momentum_balance_gives_the_exact_forces_of_an_exact_motion() -> None:
    for make in IDEAL_SCENES.values():
        scene, truth = make(), exact(make(), SAMPLES)
        theta, speed = truth.position[:, 0, 2], truth.velocity[:, 0, 2]
        X, X_1, X_2 = configuration(scene, theta)
        motion = crank_motion(scene)
        if motion is None:
            theta_2 = crank_acceleration(scene)(theta, speed)
        else:
            theta_2 = motion.acceleration_rad_s2(truth.time_s)
        acceleration = X_1 * theta_2[:, None, None] + X_2 * (speed**2)[:, None, None]
        found = reactions(scene, truth.time_s, X, truth.velocity, acceleration, {})
        size = np.abs(joint_forces(truth)).max()
        worst_force = (
            np.abs(np.stack(list(found.joint_force_N.values()), axis=1) - joint_forces(truth)).max() / size
        )
        assert worst_force < ROUND_OFF, f"{scene.name}: {worst_force}"
        guide = found.guide_force_N["guide"] - truth.guide_force_N["guide"]
        assert np.abs(guide).max() / size < ROUND_OFF, f"{scene.name}: {guide}"
        needed, torque = truth.driver_torque_N_m, found.driver_torque_N_m
        assert (needed is None) == (torque is None)
        if needed is not None and torque is not None:
            assert np.abs(torque - needed).max() / size < ROUND_OFF, f"{scene.name}: {torque - needed}"


def test_driven_pin_force_and_torque_have_the_values_of_the_closed_form() -> None:
    plain = ideal_driven()
    on_axis = plain.crank.model_copy(update={"centre_of_mass_m": 0.0})  # as the torque was computed
    scene = plain.model_copy(update={"crank": on_axis})
    trajectory = run(scene, PymunkEngine(), steps_per_sample=5, samples=2000)
    pin, torque = trajectory.joint_force_N["B"][0, 0], trajectory.driver_torque_N_m
    assert torque is not None
    assert trajectory.driver_work_J is not None
    assert -pin == pytest.approx(2718.71, abs=PIN_FORCE_ACCURACY), f"pin force {-pin} N"
    peak, mean, work = torque.max(), torque[:1000].mean(), trajectory.driver_work_J[1000]
    assert peak == pytest.approx(138.56, abs=TORQUE_ACCURACY), f"peak torque {peak} N m"
    assert mean == pytest.approx(0.0, abs=REVOLUTION_ACCURACY), f"mean torque {mean} N m"
    assert work == pytest.approx(0.0, abs=REVOLUTION_ACCURACY), f"work of one revolution {work} J"


def test_free_slider_is_where_the_converged_value_says() -> None:
    x = run(shorter(ideal_free(), 0.1), PymunkEngine(), 20001, 1).position[:, -1, 0][-1]
    assert x == pytest.approx(0.0945044247832, abs=1e-7), f"x_B(0.1 s) = {x}"


@pytest.mark.parametrize("make", [ideal_free, ideal_torque])
@pytest.mark.parametrize("iterations", [4, 5])
def test_five_sweeps_are_too_few_and_are_caught(make: Any, iterations: int) -> None:
    with pytest.raises(SimulationFailed, match=r"^constraints lost, .* at t = 0\.\d+ s$"):
        run(make(), PymunkEngine(joints="all", iterations=iterations), 41)


@pytest.mark.parametrize("make", [ideal_free, ideal_driven, ideal_torque])
def test_twenty_sweeps_are_as_good_as_a_hundred_and_six_nearly(make: Any) -> None:
    scene = make()
    x = {n: run(scene, PymunkEngine(joints="all", iterations=n), 41).position[:, -1, 0] for n in (6, 20, 100)}
    error = np.abs(x[100] - exact(scene, SAMPLES).position[:, -1, 0]).max()
    assert np.abs(x[20] - x[100]).max() < 0.02 * error, f"{np.abs(x[20] - x[100]).max()} of {error}"
    assert np.abs(x[6] - x[100]).max() < 0.2 * error, f"{np.abs(x[6] - x[100]).max()} of {error}"


@pytest.mark.parametrize("joints", ["fewest", "all"])
@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_an_ideal_scene_has_no_shapes_and_nothing_but_its_joints(name: str, joints: Any) -> None:
    model = PymunkEngine(joints=joints)._model(IDEAL_SCENES[name](), RunSettings(1e-6, 1))
    driven, space = name in ("ideal-driven", "ideal-fluctuating"), model.space
    kinds = sorted(type(joint).__name__ for joint in space.constraints)
    assert (len(space.shapes), len(space.bodies)) == (0, 3)
    assert kinds == ["GrooveJoint"] + ["PivotJoint"] * (3 if joints == "all" and not driven else 2)
    kinematic = [body.body_type == pymunk.Body.KINEMATIC for body in model.bodies]
    assert kinematic == [driven, False, False]


@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_a_driver_is_reported_only_where_there_is_one(name: str) -> None:
    trajectory = run(IDEAL_SCENES[name](), PymunkEngine(), 5)
    torque, work = trajectory.driver_torque_N_m, trajectory.driver_work_J
    assert (torque is None) == (work is None) == (name == "ideal-free")
    if name == "ideal-torque":
        assert torque == pytest.approx(0.3, abs=0)


def test_the_drivers_work_does_not_depend_on_how_often_it_is_looked_at() -> None:
    often, seldom = (run(ideal_driven(), PymunkEngine(), 4000 // n, n) for n in (200, 20))
    assert often.driver_work_J is not None
    assert seldom.driver_work_J is not None
    assert np.array_equal(often.driver_work_J[::10], seldom.driver_work_J)


@pytest.mark.parametrize("make", [ideal_free, ideal_driven, ideal_torque])
@pytest.mark.parametrize("samples", [1, 2, 3, 7])
def test_the_step_that_a_sample_falls_on_does_not_change_it(make: Any, samples: int) -> None:
    scene = shorter(make(), 42e-5)
    each, some = run(scene, PymunkEngine(), samples=42), run(scene, PymunkEngine(), 42 // samples, samples)
    for name in ("position", "velocity"):
        assert np.array_equal(getattr(each, name)[:: 42 // samples], getattr(some, name)), name
    assert np.array_equal(joint_forces(each)[:: 42 // samples], joint_forces(some))
    assert np.array_equal(each.guide_force_N["guide"][:: 42 // samples], some.guide_force_N["guide"])


@pytest.mark.parametrize("samples", [1, 2])
def test_a_run_of_one_or_two_steps_gives_forces(samples: int) -> None:
    scene = shorter(ideal_driven(), samples * 1e-5)
    force, truth = run(scene, PymunkEngine(), samples=samples), exact(scene, samples)
    assert joint_forces(force) == pytest.approx(joint_forces(truth), abs=0.5)


def test_two_runs_are_identical_to_the_last_bit() -> None:
    for make in IDEAL_SCENES.values():
        one, two = (run(make(), PymunkEngine(), 5) for _ in range(2))
        assert arrays(one) == arrays(two)
        assert (one.step_s, one.steps) == (two.step_s, two.steps)


def test_the_solve_time_is_the_stepping_alone() -> None:
    started = time.perf_counter()
    trajectory = run(ideal_driven(), PymunkEngine(), 81)
    wall = time.perf_counter() - started
    assert 0.01 * wall < trajectory.solve_time_s < 0.8 * wall, f"{trajectory.solve_time_s} s of {wall} s"


def started(scene: Scene, speed: float) -> Scene:
    return scene.model_copy(update={"start": scene.start.model_copy(update={"crank_speed_rad_s": speed})})


@pytest.mark.parametrize(
    ("scene", "engine", "steps", "reason"),
    [
        (ideal_driven(), PymunkEngine(), 10, "constraints lost"),
        (ideal_driven(), PymunkEngine.out_of_the_box(), 20, "constraints lost"),
        (started(ideal_free(), 1e200), PymunkEngine(), 100, "constraints lost"),
        (started(ideal_driven(), 1e300), PymunkEngine(), 100, "constraints lost"),
        # The joints come open before the rod is turned over: up to ten sweeps, and at twenty all is well.
        (with_rod(ideal_driven(), 0.051), PymunkEngine(iterations=10), 20000, "constraints lost"),
        (
            with_rod(ideal_driven(), 0.051),
            PymunkEngine(joints="all", iterations=20),
            20000,
            "constraints lost",
        ),
    ],
)
def test_a_failure_names_time_and_reason_in_one_line_and_prints_nothing(
    scene: Scene, engine: PymunkEngine, steps: int, reason: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SimulationFailed, match=rf"^{reason}.* at t = \S+ s$"):
        run(scene, engine, samples=steps)
    assert capfd.readouterr() == ("", "")


def test_a_rod_a_little_longer_than_the_crank_passes_with_the_sweeps_it_needs() -> None:
    scene = with_rod(ideal_driven(), 0.051)
    error = worst(scene, run(scene, PymunkEngine(), 41))["slider_position_error_m"]
    assert error < 1e-5, error


@pytest.mark.parametrize(
    "settings",
    [
        {"iterations": 0},
        {"iterations": -1},
        {"iterations": 2**31},
        {"error_bias": -0.1},
        {"error_bias": 1.0},
        {"error_bias": float("nan")},
        {"bias": 0.1},
    ],
)
def test_settings_that_would_abort_the_process_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(pydantic.ValidationError):
        PymunkEngine(**settings)
