"""What a comparison is judged by, of mechanisms that have no slider, no turn, no motion and no load."""

import pytest

from engine_models.scene.library import SCENES
from engine_models.scene.scene import Scene
from studies.comparison.question import asked
from tests.helpers.crank_sliders import HELD, pendulum, short_rod

#: A millionth of the crank, and a thousandth of the torque that is held.
QUESTIONS = [
    (pendulum(), "crank_angle_error_rad", 1e-6, 1.0),
    (short_rod(), "slider_position_error_m", 1e-6 * 0.3, 1.0),
    (HELD, "driver_torque_error_N_m", 1e-3 * 420.26506, 0.01),
    (HELD.replace("load.slider", None), "slider_position_error_m", 1e-6, 0.01),
    (
        SCENES["ideal-free"]().replace({"rod.length_m": 0.05, "end_time_s": 0.1}),
        "slider_position_error_m",
        5e-8,
        0.1,
    ),
]


@pytest.mark.parametrize(("scene", "column", "wanted", "until_s"), QUESTIONS)
def test_every_mechanism_has_a_signal_and_an_error_to_be_judged_by(
    scene: Scene, column: str, wanted: float, until_s: float
) -> None:
    """Held without a load there is no torque, and a thousandth of none is nothing that a run can keep."""
    question = asked(scene)
    assert question.column == column
    assert question.wanted == pytest.approx(wanted, rel=1e-6)
    assert question.compared_until_s == pytest.approx(until_s)
