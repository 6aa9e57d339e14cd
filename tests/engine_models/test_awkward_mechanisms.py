"""Mechanisms at rest, gentle touches, two touches at one instant, and links of next to no mass."""

import numpy as np
import pytest

from engine_models.engine import RunSettings, SimulationFailed, Trajectory
from engine_models.engines import make_engine
from engine_models.mechanics.quality import quality_of
from engine_models.pace import too_slow
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.judges.converged_truth import INDEPENDENT, converged, truth_by
from tests.helpers.crank_sliders import HELD
from tests.helpers.engines import supporting


@pytest.mark.parametrize("engine", supporting(HELD))
def test_a_crank_that_is_held_takes_the_loads_torque(engine: str) -> None:
    """Statics by hand: T = -F dx/dtheta, and the guide takes F tan(phi)."""
    run = make_engine(engine).simulate(HELD, RunSettings(1e-4, 10))
    phi = -np.arcsin(np.sin(np.pi / 3) / 2.5)
    torque = -400 * (np.sin(np.pi / 3) - np.cos(np.pi / 3) * np.tan(phi))
    assert run.driver_torque_N_m is not None
    # Pymunk's joints come to their forces by sweeps: 1e-6 of them after ten steps.
    assert run.driver_torque_N_m[-1] == pytest.approx(torque, rel=1e-5)
    assert run.driver_torque_N_m[-1] == pytest.approx(-420.26506, rel=1e-5)
    assert run.guide_force_N["guide"][-1] == pytest.approx(-400 * np.tan(phi), rel=1e-5)
    assert run.guide_force_N["guide"][-1] == pytest.approx(147.70979, rel=1e-5)


@pytest.mark.parametrize("engine", supporting(HELD))
def test_rounding_at_rest_is_no_energy(engine: str) -> None:
    run = make_engine(engine).simulate(HELD, RunSettings(1e-5, 10))
    assert quality_of(HELD, run).parts()["unaccounted_energy_part"] < 1e-4


def gentle() -> Scene:
    """Return a crank left free without weight, so slow that the pin meets its bearing at 0.4 mm/s."""
    slow = {"gravity_m_s2": 0.0, "start.crank_speed_rad_s": 0.05, "end_time_s": 2.5}
    return SCENES["clearance-free-0.5mm"]().replace(slow)


@pytest.mark.parametrize(
    ("engine", "settings", "step_s"),
    [
        ("reference", {}, 1e-4),
        ("reference", {}, 1e-5),
        ("reference", {"method": "dop853"}, 1e-2),
        ("scipy", {}, 1e-3),
    ],
)
def test_a_gentle_touch_is_one_impact_however_short_the_step(
    engine: str, settings: dict[str, object], step_s: float
) -> None:
    """By independent equations: 2.3954398 s, 0.41101 mm/s, 0.3291 ms and 1.0875e-4 N s."""
    run = make_engine(engine, **settings).simulate(gentle(), RunSettings(step_s, 10))
    found = run.contacts["B"].impacts
    assert len(found.time_s) == 1, found
    assert found.time_s[0] == pytest.approx(2.3954398, abs=5e-8)
    assert found.approach_speed_m_s[0] == pytest.approx(4.1101e-4, abs=5e-9)
    assert found.duration_s[0] == pytest.approx(3.291e-4, abs=5e-8)
    assert found.normal_impulse_N_s[0] == pytest.approx(1.0875e-4, abs=5e-9)


def test_no_message_blames_a_number_whose_own_time_is_long() -> None:
    """The gentle contact takes 0.3 ms: steps of 1e-14 s are none of its stiffness's doing."""
    assert str(too_slow(gentle(), 1e-14, " at t = 1 s")) == (
        "steps of 1e-14 s at t = 1 s do not come to an end: take a longer step, or a looser tolerance"
    )
    stiff = gentle().replace("clearance.B.young_modulus_Pa", 1e45)
    assert str(too_slow(stiff, 1e-20)).startswith("clearance.B.young_modulus_Pa: expected a value that")


@pytest.mark.parametrize("engine", supporting(gentle()))
def test_a_clearance_whose_stiffness_overflows_is_not_blamed_on_the_material(engine: str) -> None:
    """By Hertz K goes with the clearance to the power -1/2: of 1e-320 m that is beyond all numbers."""
    scene = gentle().replace({"clearance.B.radial_clearance_m": 1e-320, "end_time_s": 0.01})
    with pytest.raises(SimulationFailed) as failed:
        make_engine(engine).simulate(scene, RunSettings(1e-4, 10))
    assert "young_modulus" not in str(failed.value)


def both(law: dict[str, object]) -> Scene:
    """Return a rod between a crank and a slider at rest, with clearance at both its ends, thrown upwards."""
    rest = dict.fromkeys(
        ("y_m", "angle_rad", "velocity_x_m_s", "velocity_y_m_s", "angular_velocity_rad_s"), 0.0
    )
    wall = {"radial_clearance_m": 1e-3, "bearing_radius_m": 0.01, **law}
    data = {
        "name": "both",
        "end_time_s": 0.01,
        "crank": {"length_m": 0.05, "mass_kg": 0.3, "inertia_kg_m2": 1e-4, "centre_of_mass_m": 0.0},
        "rod": {"length_m": 0.12, "mass_kg": 0.2, "inertia_kg_m2": 2.4e-4, "centre_of_mass_m": 0.06},
        "slider": {"mass_kg": 0.14, "inertia_kg_m2": 1e-4},
        "start": {
            "crank_angle_rad": 0.0,
            "crank_speed_rad_s": 0.0,
            "crank": {**rest, "x_m": 0.0},
            "rod": {**rest, "x_m": 0.11, "velocity_y_m_s": 1.0},
            "slider": {**rest, "x_m": 0.17},
        },
        "drive": {"kind": "constant-speed"},
        "clearance": {"A": wall, "B": wall},
    }
    return Scene.checked(data)


def touches(run: Trajectory, joint: str) -> list[float]:
    return [*run.contacts[joint].impacts.time_s]


@pytest.mark.parametrize("engine", ["reference", "scipy"])
def test_two_pins_that_touch_at_one_instant_both_do(engine: str) -> None:
    """Each contact takes 2.94327518 depth/speed of Hertz for half of the rod, each flight 2 ms."""
    depth = (5 * 0.1 / (4 * 1e9)) ** 0.4
    period = 2e-3 + 2.94327518 * depth
    run = make_engine(engine).simulate(both({"law": "hertz", "stiffness": 1e9}), RunSettings(1e-5, 10))
    for joint in "AB":
        np.testing.assert_allclose(touches(run, joint), 1e-3 + period * np.arange(4), atol=1e-10)


def test_two_pins_that_hit_rigid_walls_at_one_instant_both_do() -> None:
    """At 1 ms with 1 m/s, and with half of that four milliseconds later."""
    scene = both({"law": "rigid", "restitution": 0.5})
    run = make_engine("reference").simulate(scene, RunSettings(1e-5, 10))
    truth, _ = converged(scene, 10)
    for found in (run, truth):
        for joint in "AB":
            np.testing.assert_allclose(touches(found, joint), [1e-3, 5e-3], atol=1e-12)
            speeds = found.contacts[joint].impacts.approach_speed_m_s
            np.testing.assert_allclose(speeds, [1.0, 0.5], atol=1e-12)


def test_a_mechanism_at_rest_with_clearance_has_an_independent_truth() -> None:
    rest = {"gravity_m_s2": 0.0, "start.crank_speed_rad_s": 0.0, "end_time_s": 0.01}
    scene = SCENES["clearance-pendulum"]().replace(rest)
    truth, _ = converged(scene, 10)
    assert not np.any(truth.velocity)
    assert truth_by(scene, 10) == INDEPENDENT


@pytest.mark.parametrize("step_s", [1e-3, 4e-3])
def test_a_rod_of_no_mass_is_no_singular_position(step_s: float) -> None:
    """Modelica's piston engine: Dymola has -16.81494 and -1.59427, at a tolerance of 1e-6, for no mass."""
    piston = {
        "name": "piston",
        "end_time_s": 10.0,
        "crank": {"length_m": 0.3, "mass_kg": 1.0, "inertia_kg_m2": 0.1, "centre_of_mass_m": 0.0},
        "rod": {"length_m": 0.8, "mass_kg": 1e-9, "inertia_kg_m2": 1e-12, "centre_of_mass_m": 0.4},
        "slider": {"mass_kg": 3.0, "inertia_kg_m2": 1e-3},
        "start": {"crank_angle_rad": 0.0, "crank_speed_rad_s": -2.5},
        "drive": {"kind": "free"},
    }
    run = make_engine("reference").simulate(Scene.checked(piston), RunSettings(step_s, 10))
    assert run.position[-1, 0, 2] == pytest.approx(-16.814995, abs=5e-7)
    assert run.velocity[-1, 0, 2] == pytest.approx(-1.594232, abs=5e-7)
