"""The truth of crank-sliders, pendulums and wheels against closed forms and published numbers."""

import re
from typing import Any

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from engine_models.engine import Trajectory
from engine_models.minimal.model import LimitPosition
from engine_models.scene.format import Drive
from engine_models.scene.library import IDEAL_SCENES, SCENES, ideal_driven, ideal_free, ideal_torque
from engine_models.scene.scene import Scene
from engine_models.scene.short import CrankGas, CrankLoad
from studies.extremes import gallery
from studies.judges.converged_truth import INDEPENDENT, converged, followed, truth_by
from studies.judges.metrics import constraint_violation_m, energy_balance_residual_J, kinetic_energy_J
from tests.engines.runs import errors, numbers
from tests.helpers.crank_sliders import pendulum
from tests.helpers.ideal_crank_slider import configuration, exact

#: Set R: crank radius times speed squared is the scale of the accelerations.
SPEED = 2 * np.pi * 5000 / 60
#: What is within this of a closed form is right, over ten turns.
RIGHT = 1e-11
SAMPLES = 40


def truth_of(scene: Scene, samples: int = SAMPLES) -> Trajectory:
    """Return the truth of a scene, which the reference does not stand in for."""
    assert truth_by(scene, samples) == INDEPENDENT
    return converged(scene, samples)[0]


def driven(drive: Drive, scene: Scene | None = None, **start: float) -> Scene:
    of = (scene or ideal_driven()).model_copy(update={"drive": drive})
    return of.model_copy(update={"start": of.short.start.model_copy(update=start)})


def table(end_time_s: float) -> Drive:
    time = np.linspace(0.0, end_time_s, 41)
    angle = 0.3 + SPEED * time + 0.05 * np.sin(540 * time)
    return Drive(kind="table", time_s=tuple(time.tolist()), angle_rad=tuple(angle.tolist()))


def gas(peak_N: float, points: int = 17) -> CrankGas:
    """Return a push on the slider once a revolution, from an angle off zero on."""
    angle = np.linspace(0.0, 2 * np.pi, points) - 0.3
    force = -peak_N * np.exp(-(((angle + 0.3) - 1.2) ** 2))
    force[-1] = force[0]
    return CrankGas(crank_angle_rad=tuple(angle.tolist()), force_N=tuple(force.tolist()))


RAMP = Drive(kind="ramp", final_speed_rad_s=700.0, ramp_time_s=0.015)
FLUCTUATING = Drive(kind="fluctuating", amplitude_rad_s=30.0, frequency_Hz=170.0, phase_rad=0.4)
MOTOR = Drive(kind="motor", stall_torque_N_m=1.2, no_load_speed_rad_s=80.0)
PRESCRIBED = {
    "constant-speed": ideal_driven(),
    "ramp": driven(RAMP),
    "ramp from rest": driven(RAMP, crank_speed_rad_s=0.0),
    "ramp, later": driven(RAMP, time_s=0.006),
    "past the ramp": driven(RAMP, time_s=0.02),
    "fluctuating": driven(FLUCTUATING),
    "fluctuating, later": driven(FLUCTUATING, time_s=0.006),
    "table": driven(table(0.024)),
    "table, later": driven(table(0.036), time_s=0.0055),
}
DRIVES = PRESCRIBED | {
    "free": ideal_free(),
    "torque": ideal_torque(),
    "motor": driven(MOTOR, ideal_torque()),
}


def loaded(name: str, load: str) -> Scene:
    """Return a scene with a load of the size of its inertia forces."""
    scene = DRIVES[name].model_copy(update={"end_time_s": 0.02 if name in PRESCRIBED else 0.06})
    push, damping, stiffness, peak = (
        (-300.0, 20.0, 5e3, 3e3) if name in PRESCRIBED else (-5.0, 1.0, 200.0, 10.0)
    )
    parts: dict[str, Any] = {
        "force_N": push,
        "viscous_N_s_m": damping,
        "spring_N_m": stiffness,
        "free_position_m": 0.1,
    }
    loads = {
        "none": {},
        "all": {"slider": CrankLoad(**parts, gas=gas(peak))},
        "lines": {"slider": CrankLoad(gas=gas(peak).model_copy(update={"interpolation": "linear"}))},
    }
    return scene.model_copy(update={"load": loads[load]})


def off(mine: Trajectory, true: Trajectory, part: float) -> dict[str, float]:
    """Return the numbers of two runs that are off by more than a part of the largest of their kind."""
    assert numbers(mine).keys() == numbers(true).keys()
    parts = {name: error for name, error in errors(mine, true).items() if not name.startswith("moment")}
    return {name: error for name, error in parts.items() if error > part}


#: Every drive without a load, and half of them with each of two.
LOADED = [(name, load) for k, name in enumerate(DRIVES) for load in ("none", ("lines", "all")[k % 2])]


@pytest.mark.parametrize(("name", "load"), LOADED)
def test_it_is_the_motion_in_one_coordinate_whatever_drives_and_loads(name: str, load: str) -> None:
    scene = loaded(name, load)
    assert off(truth_of(scene), exact(scene, SAMPLES), 1e-12) == {}


@pytest.mark.parametrize("name", IDEAL_SCENES)
def test_ideal_scenes_of_the_library_are_the_motion_in_one_coordinate(name: str) -> None:
    scene = SCENES[name]()
    truth, repeats = converged(scene, 120)
    # Of 16 turns of the free crank, each of which is rounded: 2.4e-12 of a force is measured.
    assert off(truth, exact(scene, 120), 1e-11) == {}
    energy = kinetic_energy_J(scene, truth).max()
    assert np.abs(energy_balance_residual_J(scene, truth)).max() < 1e-12 * energy
    assert constraint_violation_m(scene, truth).max() < 1e-15
    assert np.abs(truth.position[:, -1, 0] - repeats[0].position[:, -1, 0]).max() < 1e-13


def test_the_driven_slider_meets_the_closed_forms_at_both_dead_centres() -> None:
    truth = truth_of(ideal_driven(), 480)
    assert truth.position[:, -1, 0].max() == pytest.approx(0.17, abs=1e-15)
    assert truth.position[:, -1, 0].min() == pytest.approx(0.07, abs=1e-15)
    _, _, X_2 = configuration(ideal_driven(), np.array([0.0, np.pi]))
    outer, inner = X_2[:, 2, 0] * SPEED**2
    assert outer == pytest.approx(-19419.36, abs=0.005)
    assert inner == pytest.approx(7996.21, abs=0.005)
    assert truth.joint_force_N["B"][0, 0] == pytest.approx(-2718.71, abs=0.005)


def test_the_drivers_torque_peaks_and_averages_as_published() -> None:
    scene = ideal_driven()
    on_axis = scene.short.crank.model_copy(update={"centre_of_mass_m": 0.0})
    torque = truth_of(scene.model_copy(update={"crank": on_axis}), 4800).driver_torque_N_m
    assert torque is not None
    assert torque.max() == pytest.approx(138.56, abs=0.005)
    # The mean over whole revolutions of a smooth periodic function: the trapezoidal rule is exact.
    assert abs(torque[:-1].mean()) < 1e-10


def test_an_ideal_pendulum_swings_by_the_elliptic_integral() -> None:
    """With k = sin(a/2) and w^2 = m g s/J: sin(psi/2) = k cd(w t, k) from rest at a, hanging being 0."""
    scene = pendulum()
    truth = truth_of(scene)
    rate = np.sqrt(1.2 * 9.81 * 0.3 / (0.02 + 1.2 * 0.3**2))
    k = np.sin((0.5 + np.pi / 2) / 2)
    sn, *_ = ellipj(ellipk(k * k) - rate * truth.time_s, k * k)
    np.testing.assert_allclose(truth.position[:, 0, 2], 2 * np.arcsin(k * sn) - np.pi / 2, atol=RIGHT)
    assert followed(scene, SAMPLES) == SAMPLES + 1


def test_a_rod_as_long_as_the_crank_goes_through_its_fold_free_and_has_no_truth_driven() -> None:
    """At minus the crank's angle: x = 2 r cos(theta). The reference stands in for the truth of a free one."""
    free, driven = (SCENES[f"ideal-{kind}"]().replace("rod.length_m", 0.05) for kind in ("free", "driven"))
    truth, _ = converged(free.replace("end_time_s", 0.1), SAMPLES)
    theta = truth.position[:, 0, 2]
    assert theta[-1] > np.pi / 2, "no fold was passed"
    np.testing.assert_allclose(truth.position[:, -1, 0], 0.1 * np.cos(theta), atol=RIGHT)
    with pytest.raises(LimitPosition) as stopped:
        truth_of(driven)
    stated = re.search(r"cannot go on at t = (\S+) s: the drive has come to", str(stopped.value))
    assert stated
    assert float(stated[1]) == pytest.approx(np.pi / 2 / SPEED, abs=1e-6), "near the fold"


def test_a_wheel_on_a_dry_bearing_is_braked_evenly() -> None:
    """Friction mu N at the pin's surface, of N = m g cos(atan mu), less half of the depth: 6e-4 of it."""
    scene = gallery()["friction 1"].scene
    truth = truth_of(scene)
    room, weight = scene.clearances["O"], scene.short.crank.mass_kg * -scene.mechanism.gravity_m_s2[1]
    pin = room.bearing_radius_m - room.radial_clearance_m - truth.contacts["O"].penetration_m.mean() / 2
    braking = weight * np.cos(np.pi / 4) * pin / scene.short.crank.inertia_kg_m2
    spin = scene.short.start.crank_speed_rad_s - braking * truth.time_s
    assert np.abs(truth.velocity[:, 0, 2] - spin).max() < 1e-5 * spin[0]
