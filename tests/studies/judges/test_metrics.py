"""The judges themselves: metrics on trajectories altered by a known amount, and where results come from."""

from dataclasses import replace

import numpy as np
import pytest

from engine_models.mechanics.samples import selected
from engine_models.scene.library import ideal_driven, ideal_free, ideal_torque
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import converged
from studies.judges.metrics import constraint_violation_m, errors, scales, with_suffix
from studies.running.outcome import load_study
from tests.studies.truth.closed_forms.crank_slider import exact

SHIFT = 1e-3
#: Error of the differences that stand for derivatives.
DIFFERENCES = 1e-5


@pytest.mark.parametrize(("body", "axis"), [(0, 0), (1, 1), (2, 0), (2, 1)])
def test_a_body_out_of_place_is_a_constraint_violation_of_that_size(body: int, axis: int) -> None:
    scene = ideal_free().model_copy(update={"end_time_s": 0.02})
    truth = exact(scene, 4)
    position = truth.position.copy()
    position[2, body, axis] += SHIFT
    violation = constraint_violation_m(scene, replace(truth, position=position))
    assert violation[2] == pytest.approx(SHIFT, rel=1e-9)
    assert violation[[0, 1, 3, 4]].max() < 1e-15


def test_a_slider_off_its_guide_with_all_joints_closed_is_a_violation_too() -> None:
    scene = ideal_free().model_copy(update={"end_time_s": 0.02})
    truth = exact(scene, 4)
    _, rod, _ = scene.crank_slider()
    position, length = truth.position.copy(), rod.length_m
    theta = position[2, 0, 2]
    pin = scene.crank.length_m * np.array([np.cos(theta), np.sin(theta)])
    phi = np.arcsin((SHIFT - pin[1]) / length)
    along = np.array([np.cos(phi), np.sin(phi)])
    position[2, 1] = [*(pin + rod.centre_of_mass_m * along), phi]
    position[2, 2, :2] = pin + length * along
    violation = constraint_violation_m(scene, replace(truth, position=position))
    assert violation[2] == pytest.approx(SHIFT, rel=1e-9)


def test_an_error_is_found_in_its_signal_at_its_time_alone() -> None:
    scene = ideal_driven()
    truth = exact(scene, 4)
    force = truth.joint_force_N["A"].copy()
    force[3] += (3.0, 4.0)
    curves = errors(scene, replace(truth, joint_force_N={**truth.joint_force_N, "A": force}), truth)
    assert curves["joint_A_force_error_N"].tolist() == pytest.approx([0, 0, 0, 5, 0])
    assert all(not e.any() for name, e in curves.items() if name != "joint_A_force_error_N")


def test_a_scale_is_the_largest_distance_from_the_mean_over_time() -> None:
    truth = exact(ideal_driven(), 2)
    position = truth.position.copy()
    position[:, 2, 0] = 1.0, 2.0, 6.0  # 3 on average
    force = {**truth.joint_force_N, "A": np.array([(0.0, 0.0), (3.0, 0.0), (0.0, 12.0)])}  # (1, 4) on average
    found = scales(ideal_driven(), replace(truth, position=position, joint_force_N=force))
    assert found["slider_position_scale_m"] == pytest.approx(3.0)
    assert found["joint_A_force_scale_N"] == pytest.approx(65.0**0.5)
    alone = scales(ideal_driven(), selected(truth, slice(1)))
    assert set(alone.values()) == {0.0}, "the horizon may leave the start alone"
    early = replace(truth, position=position, time_s=np.array([0.0, 1.0, 4.0]))  # for 1, 2 and 3 s
    assert scales(ideal_driven(), early)["slider_position_scale_m"] == pytest.approx(23 / 6 - 1)


def test_a_suffix_goes_before_the_unit() -> None:
    assert with_suffix("driver_torque_N_m", "error") == "driver_torque_error_N_m"
    assert with_suffix("slider_velocity_m_s", "error") == "slider_velocity_error_m_s"
    with pytest.raises(ValueError, match="column"):
        with_suffix("nothing", "error")


@pytest.mark.parametrize("scene", [ideal_free(), ideal_driven(), ideal_torque()], ids=lambda s: s.name)
def test_the_truths_forces_carry_the_mechanism_as_a_whole(scene: Scene) -> None:
    """Momentum of all bodies together, and power, know nothing of the joints between them."""
    samples = 4000
    truth = exact(scene, samples)
    masses = np.array([body.mass_kg for body in scene.bodies])
    # The crank pivot, the guide and gravity change the total momentum; by central differences of order 4.
    momentum = np.einsum("b,nbk->nk", masses, truth.velocity[:, :, :2])
    h = truth.time_s[1]
    rate = (8 * (momentum[3:-1] - momentum[1:-3]) - (momentum[4:] - momentum[:-4])) / (12 * h)
    outside = truth.joint_force_N["O"][2:-2].copy()
    outside[:, 1] += truth.guide_force_N["guide"][2:-2] - masses.sum() * scene.gravity_m_s2
    scale = np.abs(outside).max()
    # h^4/30 times the fifth derivative: (n omega h)^4/30 of the force's n-th harmonic. Measured 3.4e-6 on
    # ideal-free; the smallest weight that could be missing is a hundredth of the force.
    assert np.abs(rate - outside).max() < DIFFERENCES * scale
    torque = truth.driver_torque_N_m
    if scene.drive.kind == "constant-speed" and torque is not None:
        inertia = np.array([[p.mass_kg, p.mass_kg, p.inertia_kg_m2] for p in scene.bodies])
        energy = np.sum(inertia * truth.velocity**2, axis=(1, 2)) / 2
        energy = energy + scene.gravity_m_s2 * truth.position[:, :, 1] @ masses
        power = (8 * (energy[3:-1] - energy[1:-3]) - (energy[4:] - energy[:-4])) / (12 * h)
        expected = torque[2:-2] * scene.start.crank_speed_rad_s
        assert np.abs(power - expected).max() < DIFFERENCES * np.abs(expected).max()


def test_a_truth_at_other_times_is_refused_by_its_samples() -> None:
    scene = ideal_driven()
    for truth in (exact(scene, 50), exact(scene.model_copy(update={"end_time_s": 0.01}), 100)):
        with pytest.raises(
            ValueError, match=r"truth: expected the run's 101 times up to 0.024 s, got \d+ up"
        ):
            errors(scene, exact(scene, 100), truth)
    with pytest.raises(ValueError, match="samples: expected an integer >= 1 and <= 100000, got 0"):
        converged(scene, 0)


def test_what_is_no_study_is_refused() -> None:
    with pytest.raises(ValueError, match=r'study: expected agreement, .*, clearance, .* got "agrement"'):
        load_study("agrement")
