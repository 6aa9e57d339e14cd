"""Crank-sliders with compliant clearance: the standard case, samples within steps, light links."""

import numpy as np
import pytest
from numpy.typing import NDArray

from engine_models.engine import RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import CLEARANCE_SCENES, IDEAL_SCENES
from engine_models.scene.scene import Scene
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J

FloatArray = NDArray[np.float64]
STANDARD = CLEARANCE_SCENES["clearance-driven-0.5mm"]()


def test_the_standard_cases_first_impacts_and_peak_force_are_those_known() -> None:
    fine = ReferenceEngine(steps_per_contact=200)
    run = fine.simulate(STANDARD.replace("end_time_s", 0.001), RunSettings(5e-6, 1))
    impacts = run.contacts["B"].impacts
    time_s, speed = impacts.time_s[:3], impacts.approach_speed_m_s[:3]
    np.testing.assert_allclose(time_s, [0.000227285, 0.000636428, 0.000749140], atol=5e-10, rtol=0)
    np.testing.assert_allclose(speed, [4.385827, 2.748345, 1.825504], atol=5e-7, rtol=0)
    assert impacts.largest_normal_force_N[0] == pytest.approx(45870, abs=0.5)
    # t1 ~ sqrt(2c/a0), v1 ~ sqrt(2 c a0), a0 = r w^2 (1 + r/L): within 0.5 %.
    a0, c = 0.05 * (2 * np.pi * 5000 / 60) ** 2 * (1 + 0.05 / 0.12), 5e-4
    assert time_s[0] == pytest.approx(np.sqrt(2 * c / a0), rel=5e-3)
    assert speed[0] == pytest.approx(np.sqrt(2 * c * a0), rel=5e-3)


def test_the_interpolation_adds_nothing_to_the_ledgers_residual_as_it_falls_at_order_four() -> None:
    rates, scene, sizes = [(2e-5, 200), (1e-5, 400), (5e-6, 800)], STANDARD.replace("end_time_s", 0.003), []
    for step, per_contact in rates:
        engine, left = ReferenceEngine(steps_per_contact=per_contact * step / 1e-5), []
        for samples in (150, 9000):
            run = engine.simulate(scene, RunSettings(step, samples))
            assert run.step_s == step, "samples do not shorten steps"
            assert constraint_violation_m(scene, run).max() < 1e-14
            left.append(np.abs(energy_balance_residual_J(scene, run)).max())
        few, many = np.array(left) / kinetic_energy_J(scene, run).max()
        assert many < 1.5 * few, f"{many:.1e} at dense samples, {few:.1e} at few"
        sizes.append(many)
    assert sizes[-1] < 1e-11
    order = np.polyfit(np.log([step for step, _ in rates]), np.log(sizes), 1)[0]
    assert abs(order - 4) < 0.5, f"order {order:.2f} of {sizes}"


def test_friction_on_a_light_crank_between_a_heavy_rod_and_a_loose_pivot_is_followed() -> None:
    friction = {"law": "tanh", "coefficient": 0.3, "regularisation_speed_m_s": 1e-3}
    soft = {"law": "kelvin-voigt", "stiffness": 1e5, "damping_N_s_m": 2e3, "friction": friction}
    scene: Scene = IDEAL_SCENES["ideal-free"]().replace(
        {
            "crank": {"length_m": 0.05, "mass_kg": 1e-3, "inertia_kg_m2": 2.5e-7, "centre_of_mass_m": 0.025},
            "rod": {"length_m": 0.15, "mass_kg": 1.0, "inertia_kg_m2": 2e-3, "centre_of_mass_m": 0.07},
            "slider.mass_kg": 1.0,
            "start": {"crank_angle_rad": 0.5, "crank_speed_rad_s": 2.0},
            "clearance": {"O": {"radial_clearance_m": 1e-4, "bearing_radius_m": 0.01, **soft}},
            "end_time_s": 0.04,
        }
    )
    sharp = ReferenceEngine(method="dop853", step_tolerance=1e-11)
    found, true = (engine.simulate(scene, RunSettings(1e-4, 200)) for engine in (ReferenceEngine(), sharp))
    # With the mobility along the normal in place of that of sliding, friction is off by 12 % of its size.
    for name in ("normal_force_N", "friction_force_N"):
        value, expected = getattr(found.contacts["O"], name), getattr(true.contacts["O"], name)
        assert np.abs(value - expected).max() < 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("angle_rad", np.linspace(-1e-6, 1e-6, 8))
def test_a_pin_that_is_off_its_wall_by_round_off_at_a_steps_start_touches_it(angle_rad: float) -> None:
    """A third of such runs stopped within 0.15 s: what projection moved was more than what was left to go."""
    scene = STANDARD.replace({"start.crank_angle_rad": float(angle_rad), "end_time_s": 0.15})
    run = ReferenceEngine().simulate(scene, RunSettings(1e-5, 100))
    assert energy_balance_residual_J(scene, run)[-1] == pytest.approx(0, abs=1e-5)
