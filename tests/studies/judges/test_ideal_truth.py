"""The independent truth, against closed forms, published numbers and a second derivation."""

import numpy as np
import pytest
from scipy.integrate import quad

from engine_models.engine import SimulationFailed
from engine_models.mechanics.assembly import assembled
from engine_models.scene.library import ideal_driven, ideal_free, ideal_torque
from engine_models.scene.scene import Scene
from studies.judges.ideal_truth import configuration, exact, exact_repeats
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J

#: Set R: crank radius times speed squared is the scale of the accelerations.
SPEED = 2 * np.pi * 5000 / 60


@pytest.mark.parametrize(
    ("end", "samples", "position"), [(0.1, 10, 0.0945044247832), (1.0, 1000, 0.159335040674)]
)
def test_the_free_slider_is_where_converged_runs_put_it(end: float, samples: int, position: float) -> None:
    scene = ideal_free().model_copy(update={"end_time_s": end})
    slider = exact(scene, samples).position[:, -1, 0][-1]
    assert abs(slider - position) < 1e-11, f"off by {slider - position:.2e} m"  # the digits given


def test_the_driven_slider_meets_the_closed_forms_at_both_dead_centres() -> None:
    truth = exact(ideal_driven(), 480)
    assert truth.position[:, -1, 0].max() == pytest.approx(0.17, abs=1e-15)
    assert truth.position[:, -1, 0].min() == pytest.approx(0.07, abs=1e-15)
    _, _, X_2 = configuration(ideal_driven(), np.array([0.0, np.pi]))
    outer, inner = X_2[:, 2, 0] * SPEED**2
    assert outer == pytest.approx(-19419.36, abs=0.005)
    assert inner == pytest.approx(7996.21, abs=0.005)
    assert truth.joint_force_N["B"][0, 0] == pytest.approx(-2718.71, abs=0.005)


def test_the_drivers_torque_peaks_and_averages_as_published() -> None:
    scene = ideal_driven()
    on_axis = scene.crank.model_copy(update={"centre_of_mass_m": 0.0})
    truth = exact(scene.model_copy(update={"crank": on_axis}), 4800)
    torque = truth.driver_torque_N_m
    assert torque is not None
    assert torque.max() == pytest.approx(138.56, abs=0.005)
    # The mean over whole revolutions of a smooth periodic function: the trapezoidal rule is exact.
    assert abs(torque[:-1].mean()) < 1e-10


@pytest.mark.parametrize("scene", [ideal_free(), ideal_torque()], ids=lambda scene: scene.name)
def test_time_by_the_energy_integral_agrees_with_the_integrated_motion(scene: Scene) -> None:
    """A second derivation: theta' from the energy integral, then t as the integral of 1/theta'."""
    truth = exact(scene, 200)
    first, last = 100, 130
    samples = truth.position[:, 0, 2]
    energy_0 = kinetic_energy_J(scene, truth)[0]

    def slowness(theta: float) -> float:
        X, X_1, _ = configuration(scene, np.array([theta]))
        mass = np.array([[p.mass_kg, p.mass_kg, p.inertia_kg_m2] for p in scene.bodies])
        height = mass[:, 0] @ (X[0, :, 1] - truth.position[0, :, 1])
        torque = getattr(scene.drive, "torque_N_m", 0.0)
        energy = energy_0 - scene.gravity_m_s2 * height + torque * (theta - samples[0])
        return float(np.sqrt(np.sum(mass * X_1[0] ** 2) / (2 * energy)))

    elapsed, uncertainty = quad(
        slowness, samples[first], samples[last], epsabs=1e-14, epsrel=1e-13, limit=500
    )
    expected = truth.time_s[last] - truth.time_s[first]
    assert abs(elapsed - expected) < 1e-12 + uncertainty, f"off by {elapsed - expected:.2e} s"


@pytest.mark.parametrize("scene", [ideal_free(), ideal_driven(), ideal_torque()], ids=lambda s: s.name)
def test_the_truth_keeps_energy_and_joints_and_agrees_with_its_twins(scene: Scene) -> None:
    truth = exact(scene, 200)
    energy = kinetic_energy_J(scene, truth).max()
    residual = np.abs(energy_balance_residual_J(scene, truth)).max()
    assert residual < 1e-12 * energy, f"energy residual {residual:.2e} of {energy:.2e} J"
    assert constraint_violation_m(scene, truth).max() < 1e-15
    for repeat in exact_repeats(scene, 200):
        difference = np.abs(truth.position[:, -1, 0] - repeat.position[:, -1, 0]).max()
        assert difference < 1e-13, f"repeats differ by {difference:.2e} m"


def test_the_scenes_assembly_agrees_with_the_truths_own_kinematics() -> None:
    scene = ideal_free()
    for theta in (0.0, 1.0, 2.5, -2.0):
        X, X_1, _ = configuration(scene, np.array([theta]))
        position, velocity = assembled(scene, theta, 3.0)
        np.testing.assert_allclose(position, X[0], atol=1e-16)
        np.testing.assert_allclose(velocity, 3.0 * X_1[0], atol=1e-15)


@pytest.mark.parametrize(
    "change",
    [
        {
            "clearance.B": {
                "radial_clearance_m": 5e-4,
                "bearing_radius_m": 0.01,
                "law": "rigid",
                "restitution": 0.9,
            }
        },
        {"rod.length_m": 0.045},
        {"rod.length_m": 0.05},
    ],
)
def test_only_ideal_cranks_that_can_turn_have_a_closed_form(change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="expected ideal joints and a rod longer than the crank"):
        exact(ideal_free().replace(change), 10)


def test_a_rod_that_is_hardly_longer_than_the_crank_folds_as_in_extended_precision() -> None:
    """Beside the fold, where sin(phi) is all but -1: cos(phi) is a root of a difference that cancels."""
    r, part = 0.05, 1e-9
    scene = ideal_free().replace("rod.length_m", r * (1 + part))
    assert scene.rod is not None
    length, theta = np.longdouble(scene.rod.length_m), np.pi / 2 + np.array([-1e-3, 1e-4, 0.0, 2e-5])
    sine = np.longdouble(r) / length * np.sin(np.longdouble(theta))
    cosine = np.sqrt((1 - sine) * (1 + sine))
    slope = -r / length * np.cos(np.longdouble(theta)) / cosine
    X, X_1, _ = configuration(scene, theta)
    np.testing.assert_allclose(X[:, 2, 0] - r * np.cos(theta), length * cosine, rtol=1e-10)
    np.testing.assert_allclose(X_1[:, 1, 2], slope, rtol=1e-10)  # 3e-8 without care


def test_a_fold_too_fast_to_be_followed_is_told() -> None:
    scene = ideal_free().replace({"rod.length_m": 0.05 * (1 + 1e-12), "end_time_s": 0.2})
    with pytest.raises(SimulationFailed, match=r"evaluations do not get past t = 0\.12"):
        exact(scene, 10)


def test_a_motion_that_overflows_is_told() -> None:
    """The spline through a narrow spike of 1e8 N reaches 1e14 N beside it."""
    spike = {
        "crank_angle_rad": (0.0, 1.0, 1.000001, 1.000002, 2 * np.pi),
        "force_N": (0.0, 0.0, -1e8, 0.0, 0.0),
    }
    with pytest.raises(SimulationFailed, match=r"the motion overflows after t = 0"):
        exact(ideal_free().replace("load.slider.gas", spike), 10)
