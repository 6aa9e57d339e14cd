"""What only SciPy's integrators have: their tolerances, located events, rebounds, and how they fail."""

from importlib.metadata import version
from typing import Any

import numpy as np
import pytest

from engine_models.engine import (
    AdapterCannot,
    RunSettings,
    SimulationFailed,
    Trajectory,
)
from engine_models.mechanics.start import start_state
from engine_models.minimal.engine import ScipyEngine
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.library import SCENES, ideal_driven
from engine_models.scene.scene import Scene
from tests.helpers.starts import started_from

SAMPLES, SLIDER = 20, 2
FREE = SCENES["ideal-free"]()
METHODS = ("DOP853", "LSODA", "Radau")


def run(
    of: Scene, method: str = "DOP853", rtol: float = 1e-12, step_s: float = 1.0, **more: Any
) -> Trajectory:
    engine = ScipyEngine(method=method, rtol=rtol, atol=rtol / 100, **more)  # type: ignore[arg-type]
    return engine.simulate(of, RunSettings(step_s, SAMPLES))


# Tolerances and steps.


def test_steps_are_no_longer_than_asked() -> None:
    of = SCENES["ideal-driven"]()
    assert run(of, rtol=1e-6).steps < 100
    steps = run(of, rtol=1e-6, step_s=of.end_time_s / 1000).steps
    assert 1000 <= steps < 1010, "all of the longest but for a few at the start"


# Contacts.


@pytest.mark.parametrize("method", ["DOP853", "LSODA"])  # whose interpolants tell it to a nanosecond
def test_a_touch_within_a_long_step_is_not_missed(method: str) -> None:
    """Flight is a parabola, which steps of any length follow: the pin is beyond the wall for 0.3 ms of 15."""
    pendulum, c = SCENES["clearance-pendulum"](), 5e-4
    g, s = -pendulum.mechanism.gravity_m_s2[1], pendulum.short.crank.centre_of_mass_m
    found = []
    for height in (c + 1e-7, c - 1e-7):
        state = {"x_m": 0.0, "y_m": -s, "angle_rad": -np.pi / 2, "velocity_x_m_s": 0.0}
        state |= {"velocity_y_m_s": float(np.sqrt(2 * g * height)), "angular_velocity_rad_s": 0.0}
        found.append(run(pendulum.replace({"start.crank": state, "end_time_s": 0.015}), method).contacts["O"])
    touched, missed = found
    speed = np.sqrt(2 * g * 1e-7)
    np.testing.assert_allclose(touched.impacts.approach_speed_m_s, [speed], rtol=1e-6)
    np.testing.assert_allclose(touched.impacts.time_s, [(np.sqrt(2 * g * (c + 1e-7)) - speed) / g], rtol=1e-8)
    assert (len(missed.impacts.time_s), missed.normal_impulse_N_s[-1]) == (0, 0)


def stiff(stiffness: float, **more: Any) -> Scene:
    sizes = {"radial_clearance_m": 5e-4, "bearing_radius_m": 0.01, "restitution": 0.5}
    gap = {**sizes, "law": "lankarani-nikravesh", "stiffness": stiffness, **more}
    return ideal_driven().replace({"end_time_s": 0.002, "clearance.B": gap})


def test_a_contact_that_would_pull_loses_its_spring_s_energy_however_long_the_steps() -> None:
    of, depth = stiff(1e9, minimum_impact_speed_m_s=0.1), 2e-5
    position, velocity = start_state(of)
    position[SLIDER, 0] += 5e-4 + depth
    velocity[SLIDER, 0] -= 1.0  # ten times as fast as the law lets it out
    contact = run(started_from(of, position, velocity, end_time_s=5e-5), rtol=1e-3).contacts["B"]
    assert contact.penetration_m[-1] < 0 < contact.penetration_m[3], "it has left, and took some samples to"
    stored = 1e9 * np.maximum(contact.penetration_m, 0.0) ** 2.5 / 2.5
    assert contact.clipped_loss_J == pytest.approx(1e9 * depth**2.5 / 2.5 - stored, rel=1e-6)


# Rebounds from rigid walls.


def state(y_m: float, speed_m_s: float) -> dict[str, float]:
    still = dict.fromkeys(("x_m", "angle_rad", "velocity_x_m_s", "angular_velocity_rad_s"), 0.0)
    return still | {"y_m": y_m, "velocity_y_m_s": speed_m_s}


def test_an_impact_that_throws_a_pin_off_a_compliant_wall_clips_its_force_at_once() -> None:
    """Body two strikes body one, which is in contact and leaves so fast that its law would pull."""
    body = {"mass_kg": 1.0, "inertia_kg_m2": 1e-3}
    soft = {"law": "hunt-crossley", "radial_clearance_m": 1e-3, "stiffness": 1e9, "restitution": 0.5}
    hard = {"law": "rigid", "radial_clearance_m": 2e-3, "restitution": 0.8}
    of = Scene.checked(
        {
            "name": "two",
            "end_time_s": 0.004,
            "observe": "one.angle",
            "ground": {"pins_m": {"O": 0.0}},
            "body": {"one": body | {"pins_m": {"O": 0.0, "R": 0.0}}, "two": body | {"pins_m": {"R": 0.0}}},
            "guide": {
                name: {"body": name, "pin": pin, "angle_rad": np.pi / 2}
                for name, pin in (("one", "O"), ("two", "R"))
            },
            "clearance": {"O": soft | {"bearing_radius_m": 0.01}, "R": hard | {"bearing_radius_m": 0.01}},
            "start": {"one": state(-9.9e-4, -0.05), "two": state(-3e-4, 1.0)},
        }
    )
    known = ReferenceEngine(method="dop853", step_tolerance=1e-12).simulate(of, RunSettings(1.0, SAMPLES))
    off = np.abs(run(of).position - known.position).max()
    assert off < 1e-13, f"{off:.1e} m: 5e-6 if the force goes on for a step"


def test_a_pin_that_comes_to_rest_ends_the_run_in_words_that_blame_no_engine() -> None:
    """When bounces accumulate: the reference's pins follow their walls from then on, to round-off."""
    with pytest.raises(AdapterCannot, match=r"at t = (.*) s: pin B .*law = 'rigid'") as end:
        run(SCENES["rigid-driven-0.5mm"]())
    assert float(str(end.value).split("t = ")[1].split(" s")[0]) == pytest.approx(0.00663301, rel=1e-5)


# What is refused, and what fails.


@pytest.mark.parametrize("method", METHODS)
def test_a_run_that_takes_too_many_evaluations_fails_in_silence(
    method: Any, capfd: pytest.CaptureFixture[str]
) -> None:
    engine = ScipyEngine(method=method, max_evaluations=500)
    for simulate in (engine.simulate, engine.bare_run):
        with pytest.raises(SimulationFailed, match=r"500 evaluations came no further than t = 0\.0"):
            simulate(FREE, RunSettings(1.0, 2))
    limited = ScipyEngine(method=method, max_evaluations=20_000)
    with pytest.raises(SimulationFailed, match=r"t = 0\.000227"):
        limited.simulate(stiff(1e300), RunSettings(1e-4, SAMPLES))
    if method != "LSODA" or version("scipy") >= "1.17":  # whose Fortran wrote to the terminal before
        assert capfd.readouterr() == ("", "")


def test_radau_says_when_a_jacobian_of_its_own_is_not_finite() -> None:
    """Its differences reach so far beyond a wall that a force overflows."""
    with pytest.raises(SimulationFailed, match=r"Radau stopped at t = \S+ s: "):
        run(SCENES["clearance-driven-0.5mm"](), "Radau", 1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_a_start_in_a_dead_centre_fails_with_the_reason(method: str) -> None:
    """Equal links folded on each other, the slider above the crank's pivot: [B] has lost a rank.

    A scene may begin no nearer to it than the crank's sine is from 1 by rounding.
    """
    start = {"crank_angle_rad": np.pi / 2 - 3e-8, "crank_speed_rad_s": 0.0}
    dead = FREE.model_copy(update={"rod": FREE.short.crank, "start": start})
    with pytest.raises(SimulationFailed, match=r"cannot go on at t = 0 s: its loops are singular"):
        run(dead, method, 1e-3, 1e-4)
