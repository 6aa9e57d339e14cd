"""What a comparison is judged by, of mechanisms that have no slider, no turn, no motion and no load."""

import pytest

from engine_models.scene.file import from_toml
from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.compare import ask
from tests.engines.mechanism_texts import ANDREWS, FOUR_BAR_CLEARANCE
from tests.helpers.crank_sliders import HELD, pendulum

#: A lift of 2 kg, driven upwards.
LIFT = """
name = "lift"
end_time_s = 0.5
gravity_m_s2 = 9.81
observe = "rail.along"
body.car = { pins_m = { P = 0.0 }, mass_kg = 2.0, inertia_kg_m2 = 0.1 }
guide.rail = { body = "car", pin = "P", angle_rad = 1.5707963267948966 }
start.speed_m_s = { rail = 0.4 }
drive = { kind = "constant-speed", guide = "rail" }
"""
#: A millionth of the crank, and a thousandth of the torque that is held.
QUESTIONS = [
    (pendulum(), "crank_angle_error_rad", 1e-6),
    (HELD, "driver_torque_error_N_m", 1e-3 * 420.26506),
    (HELD.replace("load.slider", None), "slider_position_error_m", 1e-6),
    (
        SCENES["ideal-free"]().replace({"rod.length_m": 0.05, "end_time_s": 0.1}),
        "slider_position_error_m",
        5e-8,
    ),
    # A hundredth of the clearance; a millionth of the longest lever, of an angle by itself.
    (from_toml(FOUR_BAR_CLEARANCE), "observed_B_x_error_m", 5e-6),
    (from_toml(ANDREWS), "observed_K3_angle_error_rad", 1e-6),
    (from_toml(LIFT), "driver_force_error_N", 1e-3 * 2 * 9.81),
]


@pytest.mark.parametrize(("scene", "column", "wanted"), QUESTIONS)
def test_every_mechanism_has_a_signal_and_an_error_to_be_judged_by(
    scene: Scene, column: str, wanted: float
) -> None:
    """Held without a load there is no torque, and a thousandth of none is nothing that a run can keep."""
    judged_by, error = ask(scene)
    assert judged_by == column
    assert error == pytest.approx(wanted, rel=1e-6)
