"""Corners of the general form: names, whole turns, legs too many, springs without length, units of slopes."""

import math

import numpy as np
import pytest

import crankslider as cs
from engine_models.engine import RunSettings
from engine_models.mechanics.energy import energy_balance_residual_J, energy_in_play_J
from engine_models.mechanics.states import observed
from engine_models.reference.engine import ReferenceEngine
from engine_models.reference.inspection import inspect
from engine_models.scene.drives import TorqueDrive
from engine_models.scene.file import SceneError
from engine_models.scene.library import clearance_pendulum, ideal_driven
from engine_models.scene.scene import Clearance
from tests.engines.mechanism_texts import FOUR_BAR, PARALLELOGRAM, WALL, scene
from tests.helpers.arrays import joint_forces

SHARP = ReferenceEngine(method="dop853", step_tolerance=1e-11)
#: A block on a slotted arm that turns, with a spring to the arm's pivot.
ARM = """
name = "bead"
end_time_s = 0.2
observe = "slot.along"
ground.pins_m = { O = 0.0 }
[body]
arm = { pins_m = { O = 0.0 }, mass_kg = 1.0, inertia_kg_m2 = 0.1, centre_of_mass_m = 0.2 }
bead = { pins_m = { P = 0.0 }, mass_kg = 0.2, inertia_kg_m2 = 1e-4 }
[guide]
slot = { body = "bead", pin = "P", on = "arm" }
[start]
angle_rad = { arm = 0.5 }
position_m = { slot = 0.3 }
hold = ["arm", "slot"]
speed_rad_s = { arm = 2.0 }
speed_m_s = { slot = 0.0 }
"""


@pytest.mark.parametrize("body", ["ground", "rocker"])
def test_a_ground_pin_may_have_its_bearing_on_either_side(body: str) -> None:
    """The force and the motion are the same, and the gap is turned round."""
    of = scene(FOUR_BAR + f'[clearance.C]{WALL}bearing = "{body}"\n', end_time_s=0.02)
    other = scene(FOUR_BAR + f"[clearance.C]{WALL}", end_time_s=0.02)
    run, twin = (SHARP.simulate(each, RunSettings(0.02, 10)) for each in (of, other))
    assert np.abs(run.position - twin.position).max() < 1e-9
    sign = 1.0 if body == "ground" else -1.0
    assert np.abs(run.contacts["C"].gap_m - sign * twin.contacts["C"].gap_m).max() < 1e-9
    assert np.abs(joint_forces(run) - joint_forces(twin)).max() < 1e-4 * np.abs(joint_forces(twin)).max()


def test_a_crank_may_have_the_bearing_of_its_pivot() -> None:
    room = Clearance(
        radial_clearance_m=1e-4, bearing_radius_m=0.01, law="hertz", stiffness=1e9, bearing="crank"
    )
    of = ideal_driven().replace({"clearance.O": room.model_dump(exclude_none=True), "end_time_s": 0.002})
    run = SHARP.simulate(of, RunSettings(0.002, 10))
    assert np.abs(energy_balance_residual_J(of, run)).max() < 1e-9 * energy_in_play_J(of, run)


def test_a_body_and_a_guide_of_one_name_are_held_apart() -> None:
    text = ARM.replace("slot", "bead").replace('hold = ["arm", "bead"]\n', "")
    of = scene(text + '[drive]\nkind = "constant-speed"\nguide = "bead"\n')
    run = ReferenceEngine().simulate(of, RunSettings(1e-3, 1))
    assert run.position[0, 0, 2] == pytest.approx(0.5, abs=1e-12)
    with pytest.raises(SceneError, match=r"start.hold.1: expected a name that is of a body or of a guide"):
        scene(ARM.replace("slot", "bead"))


@pytest.mark.parametrize("turns", [0, 10, -1000])
@pytest.mark.parametrize("told", ["", ", bead = 0.5"])
def test_a_body_that_keeps_its_angle_turns_with_what_it_is_on(turns: int, told: str) -> None:
    angle = 0.5 + 2 * math.pi * turns
    of = scene(ARM.replace("arm = 0.5 }", f"arm = {angle!r}{told} }}"))
    run = ReferenceEngine().simulate(of, RunSettings(1e-3, 1))
    assert run.position[0, :, 2] == pytest.approx([angle, angle], rel=1e-12)


def test_a_leg_too_many_runs_where_it_has_clearance() -> None:
    """A third leg makes one row too many, unless its pin M is loose."""
    leg = "middle = { pins_m = { D = 0.0, M = 0.1 }, mass_kg = 0.2, inertia_kg_m2 = 2e-4 }\n[start]"
    text = PARALLELOGRAM.replace("C = 0.2 }", "C = 0.2, D = 0.1 }").replace("B = 0.2 }", "B = 0.2, M = 0.1 }")
    text = text.replace("[start]", leg).replace("right = 1.0 }", "right = 1.0, middle = 1.0 }")
    with pytest.raises(SceneError, match=r"12 rows of rank 11, those of .*M.* depend on each other"):
        scene(text)
    of = scene(text + f"[clearance.M]{WALL}", end_time_s=0.2)
    assert inspect(of)[0].endswith("12 rows of rank 11 (with M taken as ideal), 1 degree of freedom")
    run = SHARP.simulate(of, RunSettings(0.2, 10))
    assert np.abs(energy_balance_residual_J(of, run)).max() < 1e-9 * energy_in_play_J(of, run)


def test_a_pin_may_be_called_drive_and_a_body_spring() -> None:
    """What is not theirs is called so in the solver, and nothing is lost where names are the same."""
    drive = '[drive]\nkind = "constant-speed"\nbody = "BODY"\n[load.BODY]\ntorque_N_m = 0.1\n'
    spring = '[spring.torque]\nbetween = ["ground.O", "coupler.B"]\nstiffness_N_m = 50.0\n'
    text = FOUR_BAR + drive + spring + "free_length_m = 0.1\ndamping_N_s_m = 1.0\n"
    named = text.replace("crank = ", "spring = ").replace('"crank"', '"spring"').replace("BODY", "spring")
    named = named.replace("A = 0.", "drive = 0.")
    runs = []
    for each in (text.replace("BODY", "crank"), named):
        of = scene(each, end_time_s=0.1)
        runs.append(SHARP.simulate(of, RunSettings(0.1, 10)))
        assert np.abs(energy_balance_residual_J(of, runs[-1])).max() < 1e-9 * energy_in_play_J(of, runs[-1])
    assert (runs[0].position == runs[1].position).all()


def test_a_pendulum_observes_its_pin_a() -> None:
    of = clearance_pendulum().replace({"clearance.O": None, "crank.centre_of_mass_m": 0.0})
    of = of.replace({"start.crank_angle_rad": 0.3, "start.crank_speed_rad_s": 2.0})
    run = ReferenceEngine().simulate(of, RunSettings(1e-3, 10))
    x = of.crank.length_m * np.cos(run.position[:, 0, 2])
    assert observed(of, run)[0] == pytest.approx(x, abs=1e-12)


def test_slopes_have_the_unit_of_their_table() -> None:
    text = FOUR_BAR + '[drive]\nkind = "torque"\ntime_s = [0.0, 0.2, 0.4, 0.6]\n'
    text += 'torque_N_m = [0.0, 1.0, 1.0, 0.0]\nend_slopes = ["SLOPE", 0.0]\n'
    drive = scene(text.replace("SLOPE", "1 N m/s")).driven_by
    assert isinstance(drive, TorqueDrive)
    assert drive.end_slopes == (1.0, 0.0)
    with pytest.raises(SceneError, match="end_slopes"):
        scene(text.replace("SLOPE", "60 rpm"))


def test_a_spring_without_length_is_refused_unless_it_has_no_free_length() -> None:
    spring = '[spring.s]\nbetween = ["ground.O", "bead.P"]\nstiffness_N_m = 10.0\nfree_length_m = LENGTH\n'
    text = ARM.replace("slot = 0.3", "slot = 0.0") + spring
    with pytest.raises(SceneError, match=r"spring.s.between: expected ends that are apart at the start"):
        scene(text.replace("LENGTH", "0.1"))
    of = scene(text.replace("LENGTH", "0.0").replace("slot = 0.0 }\nhold", "slot = 0.0 }\nhold"))
    run = SHARP.simulate(of, RunSettings(0.2, 10))
    assert np.abs(energy_balance_residual_J(of, run)).max() < 1e-9 * energy_in_play_J(of, run)


def test_a_driven_guide_takes_its_speed_from_the_states_of_all_bodies() -> None:
    drive = '[drive]\nkind = "constant-speed"\nguide = "slot"\n'
    first = scene(ARM.replace("slot = 0.0 }\n", "slot = 0.4 }\n") + drive)
    run = SHARP.simulate(first, RunSettings(0.2, 2))
    states = "".join(
        f"[start.{body}]\n"
        + "".join(f"{key} = {value!r}\n" for key, value in zip(KEYS, (*x, *v), strict=True))
        for body, x, v in zip(
            ("arm", "bead"), run.position[1].tolist(), run.velocity[1].tolist(), strict=True
        )
    )
    rest = scene(ARM[: ARM.index("[start]")] + drive + states, end_time_s=0.1)
    again = SHARP.simulate(rest, RunSettings(0.1, 1))
    assert np.abs(again.position[-1] - run.position[-1]).max() < 1e-8


KEYS = ("x_m", "y_m", "angle_rad", "velocity_x_m_s", "velocity_y_m_s", "angular_velocity_rad_s")


def test_the_library_takes_the_general_form() -> None:
    run = cs.simulate(scene(FOUR_BAR), end=0.01, samples=5)
    assert len(run.frame) == 6
