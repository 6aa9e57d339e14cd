"""The Exudyn engine against the independent truth, closed forms and the mechanics it must not break."""

import math
import re
import subprocess
import sys
from typing import Any

import exudyn as exu
import numpy as np
import pydantic
import pytest

from engine_models.engine import FloatArray, RunSettings, SimulationFailed, Trajectory
from engine_models.exudyn.engine import ExudynEngine
from engine_models.exudyn.model import build_model
from engine_models.exudyn.solver import simulation_settings
from engine_models.scene.drives import TorqueDrive
from engine_models.scene.library import ideal_driven, ideal_free, ideal_torque
from engine_models.scene.scene import Scene
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, errors
from tests.studies.truth.closed_forms.crank_slider import exact

#: Both solvers are of order 2; the rest is what a regression over a factor of 7 in the step leaves open.
ORDER, ORDER_TOLERANCE = 2.0, 0.05
#: Odd numbers of steps between samples: an even one would hide a force that rings from step to step.
STEPS_PER_SAMPLE = (11, 21, 41, 81)
SAMPLES = 160
#: Round-off of coordinates of order 1, over up to 1e4 steps of a stable scheme.
ROUND_OFF = 1e-11
#: In m and N: prescribed positions are exact but for what Newton's method leaves.
SMALLEST_ERROR = 1e-8


def shorter(scene: Scene, end_time_s: float) -> Scene:
    return scene.model_copy(update={"end_time_s": end_time_s})


def started(scene: Scene, **start: float) -> Scene:
    return scene.model_copy(update={"start": scene.start.model_copy(update=start)})


def heavier(scene: Scene, factor: float) -> Scene:
    """Scale all masses, inertias and torques: the motion stays, the forces grow by the factor."""

    def scaled(part: Any) -> Any:
        names = [name for name in ("mass_kg", "inertia_kg_m2") if hasattr(part, name)]
        return part.model_copy(update={name: getattr(part, name) * factor for name in names})

    parts = {name: scaled(getattr(scene, name)) for name in ("crank", "rod", "slider")}
    if isinstance(scene.drive, TorqueDrive):
        parts["drive"] = TorqueDrive(kind="torque", torque_N_m=scene.drive.constant_N_m * factor)
    return scene.model_copy(update=parts)


def change_point() -> Scene:
    """Equal links: at 90 and 270 degrees slider and crank pivot coincide and the joints leave two ways on.

    At steps of 50 us and less the default solver stops at 270 degrees; what it does at longer ones is chance.
    """
    scene = ideal_free()
    rod = scene.crank_slider()[1].model_copy(update={"length_m": scene.crank.length_m})
    return shorter(scene.model_copy(update={"rod": rod}), 0.1)


def overflowing(scene: Scene) -> Scene:
    """A slider so heavy that forces exceed the range of doubles: Exudyn reports success and infinities."""
    slider = scene.crank_slider()[2].model_copy(update={"mass_kg": 1e306})
    return shorter(scene.model_copy(update={"slider": slider}), 1e-3)


def run(scene: Scene, step_s: float, samples: int = SAMPLES, **settings: Any) -> Trajectory:
    return ExudynEngine(**settings).simulate(scene, RunSettings(step_s=step_s, samples=samples))


def largest_errors(scene: Scene, trajectory: Trajectory, first_sample: int = 0) -> dict[str, float]:
    """Return the largest error of everything that a trajectory holds, from a sample on."""
    truth = exact(scene, len(trajectory.time_s) - 1)
    error = errors(scene, trajectory, truth)
    error["velocity"] = np.abs(trajectory.velocity - truth.velocity).max(axis=(1, 2))
    error["energy_balance_residual_J"] = np.abs(energy_balance_residual_J(scene, trajectory))
    if truth.driver_work_J is not None and trajectory.driver_work_J is not None:
        error["driver_work_error_J"] = np.abs(trajectory.driver_work_J - truth.driver_work_J)
    return {name: float(values[first_sample:].max()) for name, values in error.items()}


def orders(scene: Scene, first_sample: int = 0, **settings: Any) -> dict[str, float]:
    """Return the slope of every error over the step in logarithms."""
    runs = [run(scene, scene.end_time_s / (SAMPLES * n), **settings) for n in STEPS_PER_SAMPLE]
    steps = [trajectory.step_s for trajectory in runs]
    largest = [largest_errors(scene, trajectory, first_sample) for trajectory in runs]
    return {
        name: float(np.polyfit(np.log(steps), np.log([e[name] for e in largest]), 1)[0])
        for name in largest[0]
    }


@pytest.mark.parametrize(
    "scene", [ideal_free(), ideal_driven(), ideal_torque()], ids=lambda scene: scene.name
)
def test_every_signal_of_the_trapezoidal_rule_converges_with_order_two(scene: Scene) -> None:
    for name, order in orders(shorter(scene, min(scene.end_time_s, 0.2))).items():
        assert abs(order - ORDER) < ORDER_TOLERANCE, f"{name}: order {order:.3f}"


@pytest.mark.parametrize("scene", [ideal_free(), ideal_torque()], ids=lambda scene: scene.name)
def test_generalized_alpha_converges_with_order_two_past_its_first_steps(scene: Scene) -> None:
    order_of = orders(shorter(scene, 0.2), first_sample=2, solver="GeneralizedAlpha")
    for name, order in order_of.items():
        assert abs(order - ORDER) < ORDER_TOLERANCE, f"{name}: order {order:.3f}"


def test_generalized_alpha_starts_with_forces_of_order_one() -> None:
    """Its known start of the multipliers, and why it is not the default."""
    steps, largest = (4e-5, 2e-5, 1e-5), []
    for step in steps:
        scene = shorter(ideal_driven(), 20 * step)
        largest.append(largest_errors(scene, run(scene, step, 20, solver="GeneralizedAlpha")))
    for name in ("joint_O_force_error_N", "driver_torque_error_N_m"):
        order = np.polyfit(np.log(steps), np.log([e[name] for e in largest]), 1)[0]
        assert abs(order - 1) < ORDER_TOLERANCE, f"{name}: order {order:.3f}"


def test_generalized_alpha_keeps_the_joints_closed_and_the_trapezoidal_rule_lets_them_drift() -> None:
    scene = ideal_driven()
    drifting, closed = (
        float(constraint_violation_m(scene, run(scene, 1e-5, solver=solver)).max())
        for solver in ("TrapezoidalIndex2", "GeneralizedAlpha")
    )
    # The one holds positions, to what one iteration leaves, of order 4: 4e-13 m here. The other holds
    # velocities: its drift, 2.3e-7 m here, is of order 2.
    assert closed < 1e-12, f"gap {closed:.2e} m"
    assert 1e-7 < drifting < 4e-7, f"gap {drifting:.2e} m"


def test_ten_microseconds_give_the_free_slider_to_a_tenth_of_a_micron_and_its_forces_to_a_millinewton() -> (
    None
):
    scene = shorter(ideal_free(), 0.2)
    error = largest_errors(scene, run(scene, 1e-5))  # 125 steps a sample
    # Measured 6.4e-8 m and 5.2e-4 N; far below that, the comparison would be empty at this order and step.
    assert 2e-8 < error["slider_position_error_m"] < 1e-7, f"{error['slider_position_error_m']:.2e} m"
    assert 1e-4 < error["joint_O_force_error_N"] < 1e-3, f"{error['joint_O_force_error_N']:.2e} N"


def test_two_runs_extrapolated_to_no_step_meet_the_published_position() -> None:
    scene = shorter(ideal_free(), 0.1)
    coarse, fine = (run(scene, step, 10).position[:, -1, 0][-1] for step in (2e-5, 1e-5))
    off = (4 * fine - coarse) / 3 - 0.0945044247832
    assert abs(off) < 1e-11, f"off by {off:.1e} m"  # the digits published; the fine run alone is off by 4e-8


def test_the_pin_force_and_the_driver_torque_of_set_R_meet_the_closed_forms() -> None:
    plain = ideal_driven()
    on_axis = plain.crank.model_copy(update={"centre_of_mass_m": 0.0})  # as the torque was computed
    scene, steps = plain.model_copy(update={"crank": on_axis}), 2400
    half_of_the_rods_weight = scene.crank_slider()[1].mass_kg * scene.weight_m_s2 / 2
    trajectory = run(scene, 1e-5, steps)
    torque = trajectory.driver_torque_N_m
    assert torque is not None
    digits = 0.005  # of the closed forms as given; the engine's own error is 0.02 N and 0.002 N m
    for revolution in (0, steps // 2, steps):
        force = trajectory.joint_force_N["B"][revolution]
        assert force == pytest.approx([-2718.71, -half_of_the_rods_weight], abs=digits), (
            f"B at revolution start: {force}"
        )
    assert torque.max() == pytest.approx(138.56, abs=digits)
    mean = torque[: steps // 2].mean()
    assert abs(mean) < 1e-6, f"mean torque {mean:.1e} N m"  # measured 6e-8, by Newton's increments left out


def test_driver_work_is_integrated_over_every_step_however_few_samples_are_asked_for() -> None:
    scene = shorter(ideal_driven(), 0.017)
    few, many = (run(scene, 1e-5, samples).driver_work_J for samples in (2, 100))
    assert few is not None
    assert many is not None
    assert abs(many[-1]) > 1, "nothing was at stake"
    assert few[-1] == pytest.approx(many[-1], abs=ROUND_OFF), f"{few[-1]} against {many[-1]} J"


def test_a_torque_drive_reports_the_applied_torque_and_a_free_crank_none() -> None:
    driven, free = run(shorter(ideal_torque(), 0.05), 1e-4), run(shorter(ideal_free(), 0.05), 1e-4)
    assert driven.driver_torque_N_m is not None
    assert set(driven.driver_torque_N_m) == {0.3}
    assert free.driver_torque_N_m is None
    assert free.driver_work_J is None


@pytest.mark.parametrize(
    "scene", [ideal_free(), ideal_driven(), ideal_torque()], ids=lambda scene: scene.name
)
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_a_mechanism_a_million_times_heavier_moves_alike_under_a_million_times_the_force(
    scene: Scene, factor: float
) -> None:
    """Newton's method must not stop early for a light mechanism, or never for a heavy one."""
    scene = shorter(scene, min(scene.end_time_s, 0.1))
    scaled, plain = run(heavier(scene, factor), 1e-5), run(scene, 1e-5)
    off = np.abs(scaled.position - plain.position).max()
    assert off < ROUND_OFF, f"off by {off:.1e}"
    force = max(
        np.abs(own / factor - plain.joint_force_N[joint]).max() for joint, own in scaled.joint_force_N.items()
    )
    assert force < 1e-6, f"off by {force:.1e} N"  # a last increment of 1e-12 m left out would be 1e-3 N


@pytest.mark.parametrize("angle", [0.5, 2.0, 3.5, -1.0])
def test_forces_are_right_from_the_first_instant_at_any_angle(angle: float) -> None:
    scene = shorter(started(ideal_driven(), crank_angle_rad=angle), 1e-3)
    error = errors(scene, run(scene, 1e-5, 100), exact(scene, 100))["joint_O_force_error_N"][0]
    # Initial accelerations come from one-sided differences: 2e-8 of 8 kN; Exudyn's own step gives 1e-3 N.
    assert error < 2e-4, f"{error:.1e} N at t = 0"


def test_whole_turns_in_the_start_angle_change_nothing_but_the_angle() -> None:
    turns = 2 * math.pi * 1000
    scene = shorter(ideal_free(), 0.15)
    far, near = run(started(scene, crank_angle_rad=turns), 1e-5), run(scene, 1e-5)
    moved = far.position - near.position
    assert moved[:, 0, 2] == pytest.approx(np.full(SAMPLES + 1, turns), rel=1e-15)
    moved[:, 0, 2] = 0.0
    assert np.abs(moved).max() < ROUND_OFF, f"off by {np.abs(moved).max():.1e}"
    assert near.position[-1, 0, 2] > 2 * math.pi, "the crank angle must be unwrapped"


def test_full_newton_gives_the_same_answer() -> None:
    scene = shorter(ideal_driven(), 0.01)
    full, modified = run(scene, 1e-5, modified_newton=False), run(scene, 1e-5)
    force = max(
        np.abs(own - modified.joint_force_N[joint]).max() for joint, own in full.joint_force_N.items()
    )
    assert 0 < force < 1e-3, f"differ by {force:.1e} N"  # not one run twice; the step's own error is 4e-2 N


#: Iterations a step, and how much larger an error may be than with increments down to round-off (measured
#: 1.01 and 1.7; where it is smaller, that is of the same order).
SOLVERS = {"TrapezoidalIndex2": (2, 1.05), "GeneralizedAlpha": (1, 2.0)}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("steps", [100, 1000, 10000])
def test_the_fewest_iterations_cost_no_digit_of_motion_or_forces(solver: str, steps: int) -> None:
    _, factor = SOLVERS[solver]
    for scene in (shorter(ideal_free(), 0.1), shorter(ideal_driven(), 0.012)):
        step_s = scene.end_time_s / steps
        settled = largest_errors(scene, run(scene, step_s, 20, solver=solver, newton_tolerance=1e-12))
        fewest = largest_errors(scene, run(scene, step_s, 20, solver=solver))
        for signal in ("slider_position_error_m", "joint_O_force_error_N", "joint_B_force_error_N"):
            if settled[signal] > SMALLEST_ERROR:
                assert fewest[signal] < factor * settled[signal], f"{scene.name}: {signal}"


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_driven_step_takes_as_many_iterations_as_its_order_needs(solver: str) -> None:
    scene = shorter(ideal_driven(), 0.012)
    model, steps = build_model(scene), 1000
    engine = ExudynEngine(solver=solver)  # type: ignore[arg-type]
    model.mbs.SolveDynamic(simulation_settings(engine, scene, RunSettings(scene.end_time_s / steps, 10)))
    taken = model.mbs.sys["dynamicSolver"].it.newtonStepsCount / steps
    assert taken == pytest.approx(SOLVERS[solver][0], abs=0.1)


def contents(scene: Scene) -> tuple[list[str], list[str], int]:
    """Return the types of the model's objects and loads, sorted, and the number of its sensors."""
    mbs = build_model(scene).mbs
    system = mbs.systemData
    objects = sorted(mbs.GetObject(i)["objectType"] for i in range(system.NumberOfObjects()))
    loads = sorted(mbs.GetLoad(i)["loadType"] for i in range(system.NumberOfLoads()))
    return objects, loads, system.NumberOfSensors()


IDEAL = [*["JointRevolute2D"] * 2, "Mass1D", "RigidBody2D", "RotationalMass1D"]
WEIGHTS = ["ForceVector"] * 2


def test_a_model_holds_what_its_scene_needs_and_nothing_else() -> None:
    weightless = {"gravity_m_s2": 0.0}
    assert contents(ideal_free()) == (IDEAL, WEIGHTS, 9)
    assert contents(ideal_free().model_copy(update=weightless)) == (IDEAL, [], 9)
    assert contents(ideal_torque()) == (IDEAL, [*WEIGHTS, "TorqueVector"], 9)
    assert contents(ideal_driven()) == (["ConnectorCoordinate", *IDEAL], WEIGHTS, 10)
    assert contents(ideal_driven().model_copy(update=weightless)) == (["ConnectorCoordinate", *IDEAL], [], 10)


@pytest.mark.parametrize(
    ("scene", "step_s"),
    [
        (change_point(), 1e-5),
        (ideal_free(), 0.1),
        (started(shorter(ideal_free(), 0.01), crank_speed_rad_s=1e200), 1e-5),
        (shorter(ideal_free(), 1e-8), 1e-11),
        (overflowing(ideal_free()), 1e-5),
    ],
    ids=[
        "change-point",
        "a-turn-a-step",
        "overflow",
        "below-the-clock",
        "infinite-forces",
    ],
)
def test_a_run_that_cannot_finish_says_when_and_why_in_one_line_and_prints_nothing(
    scene: Scene, step_s: float, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SimulationFailed) as failure:
        run(scene, step_s, 10)
    message = str(failure.value)
    match = re.fullmatch(r"(?:Exudyn|non-finite) .* at t = (\S+) s\b.*", message)  # no DOTALL: one line
    assert match, message
    assert 0 <= float(match[1]) <= scene.end_time_s, message
    assert capfd.readouterr() == ("", "")


def test_a_failed_run_leaves_exudyn_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exu.config, "printToConsole", True)
    monkeypatch.setattr(exu.config, "suppressWarnings", False)
    scene = shorter(ideal_free(), 0.01)
    before = run(scene, 1e-5)
    with pytest.raises(SimulationFailed):
        run(ideal_free(), 0.1, 10)
    assert exu.config.printToConsole
    assert not exu.config.suppressWarnings
    after = run(scene, 1e-5).joint_force_N
    assert all(np.array_equal(after[joint], force) for joint, force in before.joint_force_N.items())


@pytest.mark.parametrize(
    "scene", [ideal_free(), ideal_driven(), ideal_torque()], ids=lambda scene: scene.name
)
def test_two_runs_are_bit_identical(scene: Scene) -> None:
    first, second = (run(shorter(scene, 0.02), 1e-5) for _ in range(2))
    for name, value in vars(first).items():
        if isinstance(value, np.ndarray):
            assert np.array_equal(value, getattr(second, name)), name


def test_samples_lie_on_steps_of_the_size_reported() -> None:
    scene = shorter(ideal_free(), 0.1)
    trajectory = run(scene, 3e-5, 7)
    expected: FloatArray = np.linspace(0.0, 0.1, 8)
    assert np.array_equal(trajectory.time_s, expected)
    assert trajectory.steps == 7 * 477  # the fewest steps of at most 30 us in a seventh of 0.1 s
    assert trajectory.step_s * trajectory.steps == pytest.approx(0.1, rel=1e-15)
    assert 0 < trajectory.solve_time_s < 5


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("solver", "DVERK6"),
        ("spectral_radius", 1.0),
        ("spectral_radius", -0.1),
        ("newton_tolerance", 0.0),
        ("newton_tolerance", 1e-3),
        ("newton_tolerance", math.nan),
        ("modified_newton", "perhaps"),
        ("adaptive_step", True),
    ],
)
def test_nonsense_settings_are_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(pydantic.ValidationError, match=field):
        ExudynEngine(**{field: value})  # type: ignore[arg-type]


def test_importing_the_engine_neither_prints_nor_warns() -> None:
    command = [sys.executable, "-W", "error", "-c", "import engine_models.exudyn.engine"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_spectral_radius_reaches_the_solver_and_the_trapezoidal_rule_has_none() -> None:
    scene = ideal_free().model_copy(update={"end_time_s": 0.02})
    settings = RunSettings(step_s=1e-3, samples=4)
    ends = {
        (solver, radius): ExudynEngine(solver=solver, spectral_radius=radius)
        .simulate(scene, settings)
        .position[-1, -1, 0]
        for solver in ("GeneralizedAlpha", "TrapezoidalIndex2")
        for radius in (0.3, 0.9)
    }
    damped, barely = ends["GeneralizedAlpha", 0.3], ends["GeneralizedAlpha", 0.9]
    assert abs(damped - barely) > 1e-6, f"{damped} and {barely} m"
    assert ends["TrapezoidalIndex2", 0.3] == ends["TrapezoidalIndex2", 0.9]
