"""The independent clearance under drives and loads: closed forms in flight, the reference in contact."""

import math

import numpy as np
import pytest

from engine_models.engine import RunSettings
from engine_models.reference.engine import ReferenceEngine
from engine_models.scene.drives import Drive, FluctuatingDrive, TableDrive
from engine_models.scene.library import clearance, ideal_driven
from engine_models.scene.loads import Gas, Loads, SliderLoad
from engine_models.scene.scene import Clearances, Scene
from tests.independent.clearance import FloatArray, integrate

#: A force that changes over a turn as 1000 cos(theta), by its spline within 1e-5 of it.
TURN = np.linspace(0.0, 2 * np.pi, 61)
COSINE = Gas(crank_angle_rad=tuple(TURN.tolist()), force_N=(*(1000 * np.cos(TURN[:-1])).tolist(), 1000.0))
TIMES = np.linspace(0.0, 2e-4, 9)


def flown(load: SliderLoad) -> tuple[Scene, FloatArray]:
    """Return the scene and where its slider is while the pin at B, with much clearance, flies."""
    scene = ideal_driven().model_copy(
        update={"clearance": Clearances(B=clearance(3e-3)), "load": Loads(slider=load)}
    )
    run = integrate(scene, TIMES, 1e-12)
    assert not run.touches
    assert not run.normal_force_N["B"].any()
    return scene, run.slider_position_m


def test_a_slider_in_flight_does_what_its_load_makes_of_it() -> None:
    """By hand, of mass m from rest at x0: a push, a push against friction, a spring, a force by the crank."""
    scene, pushed = flown(SliderLoad(force_N=-500.0))
    m, x_0, speed, t = scene.bodies[2].mass_kg, 0.17, scene.start.crank_speed_rad_s, TIMES
    np.testing.assert_allclose(pushed, x_0 - 500 / m * t**2 / 2, rtol=0, atol=1e-14)
    _, braked = flown(SliderLoad(force_N=-500.0, viscous_N_s_m=700.0))
    expected = x_0 - 500 / 700 * (t - m / 700 * (1 - np.exp(-700 / m * t)))
    np.testing.assert_allclose(braked, expected, rtol=0, atol=1e-14)
    _, sprung = flown(SliderLoad(spring_N_m=1e4, free_position_m=0.1))
    expected = 0.1 + 0.07 * np.cos(math.sqrt(1e4 / m) * t)
    np.testing.assert_allclose(sprung, expected, rtol=0, atol=1e-14)
    _, blown = flown(SliderLoad(gas=COSINE))
    expected = x_0 + 1000 / m / speed**2 * (1 - np.cos(speed * t))
    np.testing.assert_allclose(blown, expected, rtol=0, atol=1e-5 * 1e-3)


def table() -> TableDrive:
    time = np.linspace(0.0, 0.036, 31)
    angle = 524 * time + 0.05 * np.sin(540 * time)
    return TableDrive(kind="table", time_s=tuple(time.tolist()), angle_rad=tuple(angle.tolist()))


DRIVES: dict[str, tuple[Drive, str]] = {
    "fluctuating": (FluctuatingDrive(kind="fluctuating", amplitude_rad_s=30.0, frequency_Hz=170.0), "O"),
    "table": (table(), "A"),
}


@pytest.mark.parametrize("name", DRIVES)
def test_in_contact_motion_force_and_torque_are_the_references(name: str) -> None:
    drive, joint = DRIVES[name]
    load = SliderLoad(force_N=-30.0, viscous_N_s_m=4.0, spring_N_m=900.0, free_position_m=0.1, gas=COSINE)
    scene = ideal_driven().model_copy(
        update={
            "end_time_s": 0.002,
            "drive": drive,
            "load": Loads(slider=load),
            "clearance": Clearances(**{joint: clearance(1e-4, "hu-guo", 0.5)}),
        }
    )
    if scene.speed_is_prescribed:
        scene = scene.model_copy(update={"start": scene.start.model_copy(update={"time_s": 0.006})})
    reference = ReferenceEngine(method="dop853", tolerance=1e-13)
    run = reference.simulate(scene, RunSettings(scene.end_time_s, 40))
    own = integrate(scene, run.time_s, 1e-12)
    contact, torque = run.contacts[joint], run.driver_torque_N_m
    assert len(own.touches) >= 1
    assert contact.normal_force_N.max() > 1000
    assert torque is not None
    assert np.abs(own.slider_position_m - run.slider_position_m).max() < 1e-10
    # Contacts are stiff: they make 1e-7 of the force of 1e-12 m, and less of a torque and a speed.
    off = np.abs(own.normal_force_N[joint] - contact.normal_force_N).max() / contact.normal_force_N.max()
    assert off < 1e-6, f"normal force off by {off:.1e}"
    off = np.abs(own.driver_torque_N_m - torque).max() / np.abs(torque).max()
    assert off < 1e-6, f"torque off by {off:.1e}"
    off = np.abs(own.slider_velocity_m_s - run.slider_velocity_m_s).max()
    assert off < 1e-6, f"velocity off by {off:.1e} m/s"
